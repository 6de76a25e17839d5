//! Twists and wrenches with named halves. Order everywhere: `[angular; linear]`, `[torque; force]`.

use crate::scalar::Scalar;
use core::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};
use nalgebra::{Isometry3, Vector3, Vector6};

/// The angular and the linear half of six coordinates.
#[inline(always)]
pub(crate) fn halves<T: Scalar>(xi: &Vector6<T>) -> (Vector3<T>, Vector3<T>) {
    let [[a, b, c, d, e, f]] = xi.data.0;
    (Vector3::new(a, b, c), Vector3::new(d, e, f))
}

macro_rules! spatial_vector {
    ($(#[$doc:meta])* $name:ident { $(#[$first_doc:meta])* $first:ident, $(#[$second_doc:meta])* $second:ident }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub struct $name<T: Scalar> {
            $(#[$first_doc])*
            pub $first: Vector3<T>,
            $(#[$second_doc])*
            pub $second: Vector3<T>,
        }
        impl<T: Scalar> $name<T> {
            /// From the two halves.
            #[inline(always)]
            pub fn new($first: Vector3<T>, $second: Vector3<T>) -> Self {
                Self { $first, $second }
            }
            /// The zero vector.
            #[inline(always)]
            pub fn zero() -> Self {
                Self::new(Vector3::zeros(), Vector3::zeros())
            }
            /// The six coordinates, angular half first.
            #[inline(always)]
            pub fn to_vector(&self) -> Vector6<T> {
                let (a, b) = (self.$first, self.$second);
                Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z)
            }
        }
        impl<T: Scalar> From<Vector6<T>> for $name<T> {
            #[inline(always)]
            fn from(v: Vector6<T>) -> Self {
                let (first, second) = halves(&v);
                Self::new(first, second)
            }
        }
        impl<T: Scalar> Add for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self::new(self.$first + other.$first, self.$second + other.$second)
            }
        }
        impl<T: Scalar> Sub for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self::new(self.$first - other.$first, self.$second - other.$second)
            }
        }
        impl<T: Scalar> Neg for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self::new(-self.$first, -self.$second)
            }
        }
        impl<T: Scalar> Mul<T> for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, factor: T) -> Self {
                Self::new(self.$first * factor, self.$second * factor)
            }
        }
        impl<T: Scalar> AddAssign for $name<T> {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
        impl<T: Scalar> SubAssign for $name<T> {
            #[inline(always)]
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }
    };
}

spatial_vector! {
    /// Velocity of a rigid body: angular velocity and velocity of the frame's origin.
    ///
    /// # Frame
    /// Both halves in the axes of the frame the name states (`twist_body`: body axes, body origin).
    /// # Units
    /// rad/s, m/s.
    Twist {
        /// Angular velocity, rad/s.
        angular,
        /// Velocity of the origin, m/s.
        linear
    }
}
spatial_vector! {
    /// Torque about the frame's origin and force.
    ///
    /// # Frame
    /// Both halves in the axes of the frame the name states.
    /// # Units
    /// N m, N.
    Wrench {
        /// Torque about the origin, N m.
        torque,
        /// Force, N.
        force
    }
}

impl<T: Scalar> Twist<T> {
    /// The same motion described in frame `a`, from its description in frame `b` (`Ad` of `a_from_b`).
    #[inline]
    #[must_use]
    pub fn transformed_by(&self, a_from_b: &Isometry3<T>) -> Self {
        let angular = a_from_b.rotation * self.angular;
        Self::new(angular, a_from_b.rotation * self.linear + a_from_b.translation.vector.cross(&angular))
    }
    /// Power of `wrench` on this motion, both in the same frame, W.
    #[inline(always)]
    pub fn power(&self, wrench: &Wrench<T>) -> T {
        self.angular.dot(&wrench.torque) + self.linear.dot(&wrench.force)
    }
}

impl<T: Scalar> Wrench<T> {
    /// The same wrench described in frame `a`, from its description in frame `b` (`Ad*` of `a_from_b`).
    #[inline]
    #[must_use]
    pub fn transformed_by(&self, a_from_b: &Isometry3<T>) -> Self {
        let force = a_from_b.rotation * self.force;
        Self::new(a_from_b.rotation * self.torque + a_from_b.translation.vector.cross(&force), force)
    }
}
