//! Where each unknown stands.

/// Attitude, rate, centre of mass, its velocity; lasting errors of torque and force; wander of position, attitude and velocity.
pub(super) const STATES: usize = ACTING + WANDERS;
/// Of these the motion's.
pub(super) const MOTION: usize = 12;
/// The motion's and those that push it: lasting errors of the wrench, in units of one sigma, constant over a segment.
pub(super) const ACTING: usize = MOTION + WRENCH;
/// States that go by factors of their own: lasting errors and wander.
pub(super) const SLOW: usize = WRENCH + WANDERS;
/// Error of torque and force over a segment alone, drives of the slow states.
pub(super) const NOISES: usize = WRENCH + SLOW;
/// Axes of a wrench.
pub(super) const WRENCH: usize = 6;
/// Rows of a segment: position, attitude, velocity, rate, acceleration.
pub(super) const ROWS: usize = 15;
pub(super) const WANDERS: usize = 9;

pub(super) const LOG_MASS: usize = 0;
pub(super) const CENTER: usize = 1;
pub(super) const INERTIA: usize = 4;
pub(super) const BODY: usize = 10;

/// Delays: of poses, velocities, rates, accelerations.
pub(super) const DELAYS: usize = 4;

/// Parameters in order: ten of the body, those of thrusters, two of the table's slope; then those of the measurements only.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// Parameters of thrusters.
    pub(super) thrusters: usize,
}

impl Layout {
    pub(super) fn slope(self) -> usize {
        BODY + self.thrusters
    }

    /// Parameters that act on the motion.
    pub(super) fn dynamic(self) -> usize {
        self.slope() + 2
    }

    pub(super) fn rate_gain(self) -> usize {
        self.dynamic()
    }

    pub(super) fn rate_bias(self) -> usize {
        self.rate_gain() + 9
    }

    pub(super) fn acceleration_gain(self) -> usize {
        self.rate_bias() + 3
    }

    pub(super) fn acceleration_bias(self) -> usize {
        self.acceleration_gain() + 9
    }

    pub(super) fn delay(self) -> usize {
        self.acceleration_bias() + 3
    }

    pub(super) fn gravity(self) -> usize {
        self.delay() + DELAYS
    }

    /// Half the variance of the answer of a filter that nobody describes: of the rate, of the acceleration.
    pub(super) fn spread(self) -> usize {
        self.gravity() + 1
    }

    /// Error of the accelerometer's lever arm.
    pub(super) fn lever(self) -> usize {
        self.spread() + 2
    }

    /// Error of the lever arm that the publisher takes the centripetal part out for.
    pub(super) fn lever_taken_out(self) -> usize {
        self.lever() + 3
    }

    pub(super) fn count(self) -> usize {
        self.lever_taken_out() + 3
    }
}
