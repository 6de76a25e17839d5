//! Solids that a link is drawn or collides as: how far they reach, and how mass of one density lies in them.

use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_lie::Pose;

/// A solid about its own centre, its length along z. Lengths in m.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Solid {
    /// Half its edges.
    Box([f64; 3]),
    /// Its semi-axes; a ball has three equal ones.
    Ellipsoid([f64; 3]),
    /// Radius, and half its length.
    Cylinder(f64, f64),
    /// Radius, and half the length of its straight part.
    Capsule(f64, f64),
}

impl Solid {
    /// m^3.
    pub fn volume(&self) -> f64 {
        let pi = std::f64::consts::PI;
        match *self {
            Self::Box([x, y, z]) => 8.0 * x * y * z,
            Self::Ellipsoid([x, y, z]) => 4.0 / 3.0 * pi * x * y * z,
            Self::Cylinder(radius, half) => 2.0 * pi * radius * radius * half,
            Self::Capsule(radius, half) => pi * radius * radius * (2.0 * half + 4.0 / 3.0 * radius),
        }
    }

    /// Whether no length is negative.
    fn has_sizes(&self) -> bool {
        match *self {
            Self::Box(lengths) | Self::Ellipsoid(lengths) => lengths.iter().all(|length| *length >= 0.0),
            Self::Cylinder(radius, half) | Self::Capsule(radius, half) => radius >= 0.0 && half >= 0.0,
        }
    }

    /// Mean of the squares of the three coordinates over the volume, m^2.
    fn mean_squares(&self) -> Vector3<f64> {
        match *self {
            Self::Box(half) => Vector3::from(half).map(|h| h * h / 3.0),
            Self::Ellipsoid(axes) => Vector3::from(axes).map(|a| a * a / 5.0),
            Self::Cylinder(radius, half) => {
                let across = radius * radius / 4.0;
                Vector3::new(across, across, half * half / 3.0)
            }
            Self::Capsule(radius, half) => {
                let (straight, ends) = (2.0 * half, 4.0 / 3.0 * radius);
                let square = radius * radius;
                let across = straight * square / 4.0 + ends * square / 5.0;
                let along =
                    straight * half * half / 3.0 + ends * (square / 5.0 + half * half + 2.0 * half * 0.375 * radius);
                Vector3::new(across, across, along) / (straight + ends)
            }
        }
    }

    /// How far it reaches along a direction from its centre, m.
    fn reach(&self, direction: &Vector3<f64>) -> f64 {
        match *self {
            Self::Box(half) => Vector3::from(half).dot(&direction.abs()),
            Self::Ellipsoid(axes) => Vector3::from(axes).component_mul(direction).norm(),
            Self::Cylinder(radius, half) => radius * direction.xy().norm() + half * direction.z.abs(),
            Self::Capsule(radius, half) => radius * direction.norm() + half * direction.z.abs(),
        }
    }
}

/// A solid where it is in a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedSolid {
    /// What it is.
    pub solid: Solid,
    /// Where its centre is, and how it is turned.
    pub link_from_solid: Pose<f64>,
}

/// Some solids as one, filled with one density: overlaps count twice.
pub(super) struct Filled {
    solids: Vec<PlacedSolid>,
    pub volume: f64,
    pub centre: Vector3<f64>,
    /// Mean of x x^T about the centre, link axes, m^2.
    pub spread: Matrix3<f64>,
}

impl Filled {
    /// `None` where there is nothing that mass could lie in.
    pub fn of(solids: &[PlacedSolid]) -> Option<Self> {
        let volume: f64 = solids.iter().map(|placed| placed.solid.volume()).sum();
        if !(volume > 0.0 && volume.is_finite() && solids.iter().all(|placed| placed.solid.has_sizes())) {
            return None;
        }
        let (mut centre, mut second) = (Vector3::zeros(), Matrix3::zeros());
        for placed in solids {
            let share = placed.solid.volume() / volume;
            let (at, turn) = (placed.link_from_solid.translation.vector, placed.link_from_solid.rotation);
            let turn = turn.to_rotation_matrix();
            let own = turn * Matrix3::from_diagonal(&placed.solid.mean_squares()) * turn.transpose();
            centre += at * share;
            second += (own + at * at.transpose()) * share;
        }
        let spread = second - centre * centre.transpose();
        let is_finite = spread.iter().chain(centre.iter()).all(|number| number.is_finite());
        (is_finite && spread.trace() > 0.0).then(|| Self { solids: solids.to_vec(), volume, centre, spread })
    }

    /// From where to where it reaches along a unit vector, m.
    pub fn interval(&self, direction: &Vector3<f64>) -> (f64, f64) {
        let mut interval = (f64::INFINITY, f64::NEG_INFINITY);
        for placed in &self.solids {
            let at = placed.link_from_solid.translation.vector.dot(direction);
            let reach = placed.solid.reach(&placed.link_from_solid.rotation.inverse_transform_vector(direction));
            interval = (interval.0.min(at - reach), interval.1.max(at + reach));
        }
        interval
    }

    /// Half the diagonal of the box around it, m.
    pub fn radius(&self) -> f64 {
        let half = |axis: Vector3<f64>| {
            let (low, high) = self.interval(&axis);
            0.5 * (high - low)
        };
        Vector3::new(half(Vector3::x()), half(Vector3::y()), half(Vector3::z())).norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::InertialParameters;

    #[test]
    fn spreads_are_those_of_the_solids_that_the_dynamics_know() {
        let of = |body: InertialParameters<f64>| {
            let inertia = body.inertia_about_com() / body.mass;
            Matrix3::identity() * (0.5 * inertia.trace()) - inertia
        };
        let pairs = [
            (Solid::Box([0.1, 0.2, 0.3]), InertialParameters::solid_box(2.0, [0.2, 0.4, 0.6])),
            (Solid::Ellipsoid([0.1, 0.2, 0.3]), InertialParameters::solid_ellipsoid(2.0, [0.1, 0.2, 0.3])),
            (Solid::Cylinder(0.1, 0.4), InertialParameters::solid_cylinder(2.0, 0.1, 0.8)),
            // without a straight part it is a ball
            (Solid::Capsule(0.3, 0.0), InertialParameters::solid_sphere(2.0, 0.3)),
        ];
        for (solid, body) in pairs {
            let filled = Filled::of(&[PlacedSolid { solid, link_from_solid: Pose::identity() }]).unwrap();
            assert!((filled.spread - of(body)).amax() < 1e-15, "{solid:?} {} {}", filled.spread, of(body));
        }
    }

    #[test]
    fn a_capsule_is_a_cylinder_with_two_half_balls() {
        // by thin discs across the axis
        let (radius, half, steps) = (0.07_f64, 0.2_f64, 200_000_u32);
        let (mut volume, mut along, mut across) = (0.0, 0.0, 0.0);
        for step in 0..steps {
            let z = (f64::from(step) + 0.5) / f64::from(steps) * (half + radius);
            let square = radius * radius - (z - half).max(0.0).powi(2);
            volume += square;
            along += square * z * z;
            across += square * square / 4.0;
        }
        let spread = Solid::Capsule(radius, half).mean_squares();
        assert!((spread.z - along / volume).abs() < 1e-9 && (spread.x - across / volume).abs() < 1e-9, "{spread}");
    }

    #[test]
    fn solids_reach_as_far_as_their_farthest_points() {
        let turned = Pose::new(Vector3::new(1.0, 0.0, 0.0), Vector3::y() * std::f64::consts::FRAC_PI_2);
        let rod = PlacedSolid { solid: Solid::Capsule(0.1, 0.5), link_from_solid: turned };
        let filled = Filled::of(&[rod]).unwrap();
        let (low, high) = filled.interval(&Vector3::x());
        assert!((low - 0.4).abs() < 1e-12 && (high - 1.6).abs() < 1e-12, "{low} {high}");
        assert!((filled.interval(&Vector3::z()).1 - 0.1).abs() < 1e-12);
    }
}
