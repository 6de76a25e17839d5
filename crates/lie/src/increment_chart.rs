//! The (Phi, Psi) chart of pose increments: the vector parts of the unit dual quaternion between two poses.

use crate::error::LieError;
use crate::scalar::{Scalar, real, value};
use crate::se3::Pose;
use nalgebra::{
    DualQuaternion, Isometry3, Quaternion, Translation3, UnitDualQuaternion, UnitQuaternion, Vector3, Vector6,
};

/// The displacement over one step, `p_k* o p_{k+1} = [Phi; f_a0] + eps [Psi; f_b0]`.
///
/// Six coordinates without constraint instead of eight with two: `f_a0 = sqrt(1 - |Phi|^2) > 0` and
/// `f_b0 = -Phi.Psi / f_a0` follow from the unit conditions. For a short step `Phi ~ w h / 2` and `Psi ~ v h / 2`.
/// The chart covers rotations by less than half a turn (`|Phi| < 1`); the constructors enforce it.
///
/// # Frame
/// Body axes of the first pose; `Psi` includes the rotation of the step (equations of [`Increment::to_displacement`]).
/// # Units
/// `Phi` without unit, `Psi` in m.
/// # Source
/// (5.13)-(5.15)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increment<T: Scalar> {
    phi: Vector3<T>,
    psi: Vector3<T>,
    f_a0: T,
}

impl<T: Scalar> Increment<T> {
    /// The increment with these coordinates.
    ///
    /// # Errors
    /// [`LieError::IncrementTooLarge`] unless `|Phi| < 1`.
    #[inline]
    pub fn try_new(phi: Vector3<T>, psi: Vector3<T>) -> Result<Self, LieError> {
        let norm_squared = phi.norm_squared();
        if norm_squared < T::one() {
            Ok(Self { phi, psi, f_a0: (T::one() - norm_squared).sqrt() })
        } else {
            Err(LieError::IncrementTooLarge { norm: value(norm_squared.sqrt()) })
        }
    }
    /// The increment with the coordinates `[Phi; Psi]`.
    ///
    /// # Errors
    /// As [`Increment::try_new`].
    #[inline]
    pub fn try_from_vector(coordinates: &Vector6<T>) -> Result<Self, LieError> {
        let [[a, b, c, d, e, f]] = coordinates.data.0;
        Self::try_new(Vector3::new(a, b, c), Vector3::new(d, e, f))
    }
    /// The increment that leads from one pose to another.
    ///
    /// # Errors
    /// [`LieError::IncrementTooLarge`] when half a turn or a value that is not a number lies between them.
    #[inline]
    pub fn between(world_from_start: &Pose<T>, world_from_end: &Pose<T>) -> Result<Self, LieError> {
        Self::from_displacement(&world_from_start.inv_mul(world_from_end))
    }
    /// The increment of the displacement `start_from_end`.
    ///
    /// # Errors
    /// As [`Increment::between`].
    #[inline]
    pub fn from_displacement(start_from_end: &Pose<T>) -> Result<Self, LieError> {
        let (w, v) = (start_from_end.rotation.w, start_from_end.rotation.imag());
        // f and -f are one displacement: the chart holds the one with f_a0 > 0.
        let (f_a0, phi) = if w < T::zero() { (-w, -v) } else { (w, v) };
        if f_a0 > T::zero() {
            let l = start_from_end.translation.vector;
            // vector part of l o f_a / 2
            Ok(Self { phi, psi: (l * f_a0 + l.cross(&phi)) * real::<T>(0.5), f_a0 })
        } else {
            Err(LieError::IncrementTooLarge { norm: value(phi.norm()) })
        }
    }
    /// `Phi`, the sine of half the rotation angle times the axis.
    #[inline(always)]
    pub fn phi(&self) -> Vector3<T> {
        self.phi
    }
    /// `Psi`, the vector part of the dual half, m.
    #[inline(always)]
    pub fn psi(&self) -> Vector3<T> {
        self.psi
    }
    /// `sqrt(1 - |Phi|^2)`, the cosine of half the rotation angle.
    #[inline(always)]
    pub fn f_a0(&self) -> T {
        self.f_a0
    }
    /// `-Phi.Psi / f_a0`, the scalar part of the dual half, m.
    #[inline(always)]
    pub fn f_b0(&self) -> T {
        -self.phi.dot(&self.psi) / self.f_a0
    }
    /// The coordinates `[Phi; Psi]`.
    #[inline(always)]
    pub fn to_vector(&self) -> Vector6<T> {
        Vector6::new(self.phi.x, self.phi.y, self.phi.z, self.psi.x, self.psi.y, self.psi.z)
    }
    /// The same step backwards: `[-Phi; -Psi]`.
    #[inline]
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self { phi: -self.phi, psi: -self.psi, f_a0: self.f_a0 }
    }
    /// The displacement `start_from_end`: rotation `[Phi; f_a0]`, translation `2 vec(f_b o f_a*)`.
    #[inline]
    pub fn to_displacement(&self) -> Pose<T> {
        let translation = self.psi * self.f_a0 - self.phi * self.f_b0() + self.phi.cross(&self.psi);
        Isometry3::from_parts(Translation3::from(translation * real::<T>(2.0)), self.rotation())
    }
    /// The unit dual quaternion `f_a + eps f_b`.
    #[inline]
    pub fn to_dual_quaternion(&self) -> UnitDualQuaternion<T> {
        UnitDualQuaternion::new_unchecked(DualQuaternion::from_real_and_dual(
            self.rotation().into_inner(),
            Quaternion::from_parts(self.f_b0(), self.psi),
        ))
    }
    /// The pose one increment after `world_from_start`.
    #[inline]
    #[must_use]
    pub fn step(&self, world_from_start: &Pose<T>) -> Pose<T> {
        world_from_start * self.to_displacement()
    }
    #[inline(always)]
    fn rotation(&self) -> UnitQuaternion<T> {
        UnitQuaternion::new_unchecked(Quaternion::from_parts(self.f_a0, self.phi))
    }
}

#[cfg(test)]
#[allow(clippy::unreadable_literal)]
mod tests {
    use super::*;
    use crate::group::LieGroup;
    use approx::assert_relative_eq;

    fn pose(rotation_vector: [f64; 3], position: [f64; 3]) -> Pose<f64> {
        Isometry3::from_parts(
            Translation3::from(Vector3::from(position)),
            <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::from(rotation_vector)),
        )
    }

    /// Golden increments of the reference equations.
    #[test]
    fn golden_increments() {
        let poses = [
            pose([0.0; 3], [0.0; 3]),
            pose([0.02, -0.01, 0.03], [0.01, -0.02, 0.015]),
            pose([0.045, -0.012, 0.065], [0.022, -0.037, 0.034]),
        ];
        let golden = [
            (
                [0.009999416676875, -0.004999708338437, 0.014999125015312],
                [0.004886631587906, -0.009998250051041, 0.007573683163357],
                0.999825005104107,
                -2.12487604383592e-4,
            ),
            (
                [0.012571120518550, -0.001014135025363, 0.017446034817225],
                [0.005701074417506, -0.008465616843091, 0.009709208631345],
                0.999768260312466,
                -2.49699229191052e-4,
            ),
        ];
        for (pair, (phi, psi, f_a0, f_b0)) in poses.windows(2).zip(golden) {
            let increment = Increment::between(&pair[0], &pair[1]).unwrap();
            assert_relative_eq!(increment.phi(), Vector3::from(phi), epsilon = 1e-14, max_relative = 1e-11);
            assert_relative_eq!(increment.psi(), Vector3::from(psi), epsilon = 1e-14, max_relative = 1e-11);
            assert_relative_eq!(increment.f_a0(), f_a0, max_relative = 1e-11);
            assert_relative_eq!(increment.f_b0(), f_b0, max_relative = 1e-11);
            let end = increment.step(&pair[0]);
            assert_relative_eq!(end, pair[1], epsilon = 1e-15);
            let dual = UnitDualQuaternion::from_isometry(&pair[0]) * increment.to_dual_quaternion();
            assert_relative_eq!(dual, UnitDualQuaternion::from_isometry(&pair[1]), epsilon = 1e-15);
        }
    }

    #[test]
    fn domain_is_enforced() {
        let psi = Vector3::new(1.0, 2.0, 3.0);
        assert!(Increment::try_new(Vector3::new(0.6, 0.0, 0.79), psi).is_ok());
        for phi in [Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 3.0, 4.0), Vector3::new(f64::NAN, 0.0, 0.0)] {
            assert!(matches!(Increment::try_new(phi, psi), Err(LieError::IncrementTooLarge { .. })), "{phi}");
        }
        let half_turn = Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0)),
        );
        assert_eq!(Increment::from_displacement(&half_turn), Err(LieError::IncrementTooLarge { norm: 1.0 }));
    }

    #[test]
    fn both_covers_give_one_increment() {
        let end = pose([2.5, 1.0, -1.0], [1.0, 2.0, 3.0]);
        let other_cover =
            Isometry3::from_parts(end.translation, UnitQuaternion::new_unchecked(-end.rotation.into_inner()));
        let start = pose([-0.3, 0.2, 0.4], [0.1, 0.0, -0.2]);
        assert_eq!(Increment::between(&start, &end), Increment::between(&start, &other_cover));
        let increment = Increment::between(&start, &end).unwrap();
        assert!(increment.f_a0() > 0.0);
        let rebuilt = Increment::try_from_vector(&increment.to_vector()).unwrap();
        assert_relative_eq!(rebuilt.f_a0(), increment.f_a0(), max_relative = 1e-12);
        assert_relative_eq!(increment.reversed().step(&increment.step(&start)), start, epsilon = 1e-14);
    }
}
