//! What moves, and what may limit it.

use core::fmt;

/// A channel of a motion: a coordinate of the position or an Euler angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channel {
    /// Position along x.
    X,
    /// Position along y.
    Y,
    /// Position along z.
    Z,
    /// Angle about x.
    Roll,
    /// Angle about y.
    Pitch,
    /// Angle about z.
    Yaw,
}

impl Channel {
    /// All six, in the order of a motion's coefficients.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Roll, Self::Pitch, Self::Yaw];
    /// Those that move in the plane.
    pub const PLANAR: [Self; 3] = [Self::X, Self::Y, Self::Yaw];
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
            Self::Roll => "roll",
            Self::Pitch => "pitch",
            Self::Yaw => "yaw",
        })
    }
}

/// A limit of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Limit {
    /// Lower end of the workspace.
    Lower,
    /// Upper end of the workspace.
    Upper,
    /// Size of the rate.
    Rate,
    /// Size of the acceleration.
    Acceleration,
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Lower => "lower end of the workspace",
            Self::Upper => "upper end of the workspace",
            Self::Rate => "rate",
            Self::Acceleration => "acceleration",
        })
    }
}
