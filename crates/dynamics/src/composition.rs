//! Bodies add: robot and payload, and what the payload must be.

use crate::inertia::InertialParameters;
use core::ops::{Add, Mul, Sub};
use tumble_lie::{Pose, Scalar};

/// Two bodies fixed to each other, both described in the same frame.
impl<T: Scalar> Add for InertialParameters<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            mass: self.mass + other.mass,
            first_moment: self.first_moment + other.first_moment,
            inertia_about_origin: self.inertia_about_origin + other.inertia_about_origin,
        }
    }
}

/// What remains when a part is taken away, both described in the same frame.
impl<T: Scalar> Sub for InertialParameters<T> {
    type Output = Self;
    fn sub(self, part: Self) -> Self {
        Self {
            mass: self.mass - part.mass,
            first_moment: self.first_moment - part.first_moment,
            inertia_about_origin: self.inertia_about_origin - part.inertia_about_origin,
        }
    }
}

/// The same shape with another density.
impl<T: Scalar> Mul<T> for InertialParameters<T> {
    type Output = Self;
    fn mul(self, factor: T) -> Self {
        Self {
            mass: self.mass * factor,
            first_moment: self.first_moment * factor,
            inertia_about_origin: self.inertia_about_origin * factor,
        }
    }
}

impl<T: Scalar> InertialParameters<T> {
    /// Robot (`self`) and a payload held at a grasp pose, about the robot's origin.
    ///
    /// ```
    /// use tumble_dynamics::{InertialParameters, lie::Pose};
    /// let robot = InertialParameters::<f64>::solid_box(9.5, [0.3, 0.3, 0.3]);
    /// let cargo = InertialParameters::solid_sphere(4.0, 0.1);
    /// let both = robot.with_payload(&cargo, &Pose::translation(0.0, 0.0, -0.3));
    /// assert!((both.center_of_mass().z + 4.0 * 0.3 / 13.5).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn with_payload(&self, payload: &Self, robot_from_payload: &Pose<T>) -> Self {
        *self + payload.transformed_by(robot_from_payload)
    }

    /// The payload in its own frame, from robot and payload together (`self`) and the robot alone, both about the
    /// robot's origin.
    ///
    /// An estimate minus a body need not be a body: test it, or project it.
    #[must_use]
    pub fn payload_beside(&self, robot: &Self, robot_from_payload: &Pose<T>) -> Self {
        (*self - *robot).transformed_by(&robot_from_payload.inverse())
    }
}
