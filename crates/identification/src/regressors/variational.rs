//! The variational regressor: three poses and two steps, no velocity, no derivative; and its extrapolations.

use super::{MotionTerms, Regressor};
use crate::dynamics::PARAMETERS;
use crate::lie::nalgebra::Translation3;
use crate::lie::{Increment, LieError, Pose, Scalar, Wrench, real};
use crate::linear_model::LinearModel;
use nalgebra::{SMatrix, SVector, Vector3};

/// A frame without rotation that moves steadily or falls; the motion of a body is described in it.
///
/// A body moves in it as in the inertial frame, without the gravity it falls with. The variational regressor, like the
/// discrete Lagrangian it comes from, depends on the choice at second order in the step: least where the frame moves
/// with the body.
///
/// # Frame
/// Inertial axes, relative to the inertial frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObserverFrame<T: Scalar> {
    /// Velocity at the time of the node, m/s.
    pub velocity_world: Vector3<T>,
    /// Acceleration: that of gravity, m/s^2.
    pub acceleration_world: Vector3<T>,
}

impl<T: Scalar> ObserverFrame<T> {
    /// The inertial frame itself.
    pub fn inertial() -> Self {
        Self { velocity_world: Vector3::zeros(), acceleration_world: Vector3::zeros() }
    }
    /// Falling with the acceleration `gravity_world`, at rest at the time of the node.
    pub fn falling(gravity_world: Vector3<T>) -> Self {
        Self { velocity_world: Vector3::zeros(), acceleration_world: gravity_world }
    }
    /// Displacement of the frame `time_s` after (or before) the node.
    #[inline]
    fn displacement(&self, time_s: T) -> Vector3<T> {
        (self.velocity_world + self.acceleration_world * (time_s * real::<T>(0.5))) * time_s
    }
}

/// Two increments that meet at a node.
///
/// Only differences of positions enter, so a body a hundred metres from the inertial origin loses no digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseTriple<T: Scalar> {
    /// From the pose before to the node.
    pub before: Increment<T>,
    /// From the node to the pose after.
    pub after: Increment<T>,
    /// Time from the pose before to the node, s.
    pub step_before_s: T,
    /// Time from the node to the pose after, s.
    pub step_after_s: T,
}

impl<T: Scalar> PoseTriple<T> {
    /// From the poses before, at and after a node and the steps between them.
    ///
    /// Uniform gravity is removed exactly by an observer that falls with it.
    ///
    /// # Errors
    /// [`LieError::IncrementTooLarge`] where a step turns by half a turn or is not a number.
    #[inline]
    pub fn try_new(
        world_from_body: [&Pose<T>; 3],
        step_before_s: T,
        step_after_s: T,
        observer: &ObserverFrame<T>,
    ) -> Result<Self, LieError> {
        let [earlier, node, later] = world_from_body;
        Ok(Self {
            before: increment(earlier, node, &-observer.displacement(-step_before_s))?,
            after: increment(node, later, &observer.displacement(step_after_s))?,
            step_before_s,
            step_after_s,
        })
    }

    #[inline]
    fn terms(&self) -> MotionTerms<T> {
        // Discrete momenta before and after the node differ by the impulse, the node's wrench times the mean step.
        // With steps h1, h2 of any length the factors 4 / (h (h1 + h2)) are the 2 / h^2 of the print.
        let span = self.step_before_s + self.step_after_s;
        let weight = real::<T>(4.0) / span;
        let (p, r) = (weight / self.step_after_s, weight / self.step_before_s);
        let (f, b) = (&self.after, &self.before);
        let (phi_f, psi_f, phi_b, psi_b) = (f.phi(), f.psi(), b.phi(), b.psi());
        let (f_b0, b_b0) = (f.f_b0() * p, b.f_b0() * r);
        let (f_a0, b_a0) = (f.f_a0() * p, b.f_a0() * r);
        let acceleration = psi_f * f_a0 + phi_f.cross(&psi_f) * p - (psi_b * b_a0 - phi_b.cross(&psi_b) * r);
        let (x, y) = (&phi_f, &phi_b);
        MotionTerms {
            rate_derivative: phi_f * f_a0 - phi_b * b_a0,
            rate_products: [
                p * x.x * x.x + r * y.x * y.x,
                p * x.y * x.y + r * y.y * y.y,
                p * x.z * x.z + r * y.z * y.z,
                p * x.x * x.y + r * y.x * y.y,
                p * x.x * x.z + r * y.x * y.z,
                p * x.y * x.z + r * y.y * y.z,
            ],
            acceleration,
            lever_acceleration: acceleration - (phi_f * f_b0 - phi_b * b_b0),
            mass_torque: psi_f * f_b0 - psi_b * b_b0,
        }
    }
}

#[inline]
fn increment<T: Scalar>(start: &Pose<T>, end: &Pose<T>, moved: &Vector3<T>) -> Result<Increment<T>, LieError> {
    let mut start_from_end = start.inv_mul(end);
    start_from_end.translation = Translation3::from(
        start.rotation.inverse_transform_vector(&(end.translation.vector - start.translation.vector - moved)),
    );
    Increment::from_displacement(&start_from_end)
}

/// `wrench at the node = variational(poses) * parameters`, with an error of second order in the step.
///
/// # Shape
/// 6x10, rows `[torque; force]`, columns `[m, h, J11, J12, J13, J22, J23, J33]`.
/// # Frame
/// Body axes at the middle pose, about the body origin.
/// # Units
/// As [`newton_euler`](super::newton_euler): the printed regressor times `2 / h^2`.
/// # Source
/// Thesis (5.21)-(5.29); steps of different length by the same discrete action.
/// # Deviation
/// (5.24), (5.25) and (5.27) print a `B_k` in which the coupling block multiplies `Phi` where it must multiply `Psi`. With
/// the print the estimate never converges (`tests/suite/regressor_orders.rs`, `printed_coupling_does_not_converge`).
/// Collecting terms, `B_k = -S(a')` with `a' = E_k - (f_b0 Phi)` differences, which is what is evaluated here.
#[inline]
pub fn variational<T: Scalar>(triple: &PoseTriple<T>) -> Regressor<T> {
    triple.terms().regressor()
}

/// How far the error of the variational regressor is pushed down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Extrapolation {
    /// `H_1`: three poses.
    Order2,
    /// `(4 H_1 - H_2) / 3`: five poses.
    Order4,
    /// `1.5 H_1 - 0.6 H_2 + 0.1 H_3`: seven poses.
    Order6,
}

impl Extrapolation {
    /// Coefficients of `H_1`, `H_2`, ...
    pub const fn coefficients(self) -> &'static [f64] {
        match self {
            Self::Order2 => &[1.0],
            Self::Order4 => &[4.0 / 3.0, -1.0 / 3.0],
            Self::Order6 => &[1.5, -0.6, 0.1],
        }
    }
    /// Poses on each side of the node.
    pub const fn reach(self) -> usize {
        self.coefficients().len()
    }
}

/// The combination of variational regressors whose errors cancel: triples at once, twice (and three times) the lag.
///
/// Legal because the error of the variational regressor has an even expansion in the step; for wrenches that jump at
/// the samples the orders beyond two hold only up to the jumps.
///
/// # Shape
/// `LAGS` 1, 2 or 3 give order 2, 4 or 6; another number does not compile.
#[inline]
pub fn variational_extrapolated<T: Scalar, const LAGS: usize>(triples: &[PoseTriple<T>; LAGS]) -> Regressor<T> {
    let coefficients = const {
        match LAGS {
            1 => Extrapolation::Order2,
            2 => Extrapolation::Order4,
            3 => Extrapolation::Order6,
            _ => [][LAGS],
        }
        .coefficients()
    };
    let mut sum = MotionTerms {
        rate_derivative: Vector3::zeros(),
        rate_products: [T::zero(); 6],
        acceleration: Vector3::zeros(),
        lever_acceleration: Vector3::zeros(),
        mass_torque: Vector3::zeros(),
    };
    for (triple, coefficient) in triples.iter().zip(coefficients) {
        let (terms, c) = (triple.terms(), real::<T>(*coefficient));
        sum.rate_derivative += terms.rate_derivative * c;
        sum.acceleration += terms.acceleration * c;
        sum.lever_acceleration += terms.lever_acceleration * c;
        sum.mass_torque += terms.mass_torque * c;
        for (s, t) in sum.rate_products.iter_mut().zip(terms.rate_products) {
            *s += t * c;
        }
    }
    sum.regressor()
}

/// Pose triples about one node and the wrench there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VariationalSample<T: Scalar, const LAGS: usize> {
    /// Triples of lag 1 to `LAGS`, all about the same node.
    pub triples: [PoseTriple<T>; LAGS],
    /// Node wrench ([`WrenchTiming::node_wrench`](crate::WrenchTiming::node_wrench)), except gravity.
    pub wrench: Wrench<T>,
}

/// [`variational_extrapolated`] as a [`LinearModel`]; `Variational<1>` is the plain regressor of order 2.
#[derive(Clone, Copy, Debug, Default)]
pub struct Variational<const LAGS: usize>;

impl<T: Scalar, const LAGS: usize> LinearModel<T, 6, PARAMETERS> for Variational<LAGS> {
    type Sample = VariationalSample<T, LAGS>;
    fn regressor(&self, sample: &Self::Sample) -> SMatrix<T, 6, PARAMETERS> {
        variational_extrapolated(&sample.triples)
    }
    fn output(&self, sample: &Self::Sample) -> SVector<T, 6> {
        sample.wrench.to_vector()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::ParameterOrder;
    use crate::dynamics::strategies::body_d;
    use crate::lie::LieGroup;
    use nalgebra::UnitQuaternion;

    fn golden_triple(offset: Vector3<f64>) -> PoseTriple<f64> {
        let pose = |position: [f64; 3], rotation: [f64; 3]| {
            let rotation = <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::from(rotation));
            Pose::from_parts(Translation3::from(Vector3::from(position) + offset), rotation)
        };
        let poses = [
            pose([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            pose([0.01, -0.02, 0.015], [0.02, -0.01, 0.03]),
            pose([0.022, -0.037, 0.034], [0.045, -0.012, 0.065]),
        ];
        PoseTriple::try_new([&poses[0], &poses[1], &poses[2]], 0.05, 0.05, &ObserverFrame::inertial()).unwrap()
    }

    #[test]
    fn golden_values_of_section_c() {
        let regressor = variational(&golden_triple(Vector3::zeros()));
        let body_d = body_d().to_vector();
        let golden = [
            4.040_765_412_799_70,
            6.597_377_976_030_21,
            7.206_264_355_677_76,
            4.012_162_262_552_47,
            5.660_215_866_213_14,
            8.044_867_294_849_80,
        ];
        for (found, expected) in (regressor * body_d).iter().zip(golden) {
            assert!((found - expected).abs() < 1e-11 * expected, "{found} {expected}");
        }
        let rows: [(usize, [f64; 10]); 2] = [
            (
                0,
                [
                    2.570_540_461_014_95e-3,
                    3.615_634_697_893_68e-3,
                    2.382_748_653_010_72e-3,
                    9.268_388_537_016_76e-5,
                    -5.033_123_287_496_74e-4,
                    -9.268_388_537_016_76e-5,
                    0.0,
                    1.959_584_382_261_04e-3,
                    -1.508_622_827_239_18e-3,
                    -3.852_052_479_926_93e-7,
                ],
            ),
            (
                3,
                [
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                    -5.553_634_353_878_91e-4,
                    -2.508_234_614_140_32e-3,
                    4.354_232_112_043_29e-3,
                    // Forty-digit arithmetic; the reference's last digits (...19322) carry rounding.
                    1.063_920_593_219_378e-3,
                ],
            ),
        ];
        for (row, expected) in rows {
            for (i, column) in ParameterOrder::DualQuaternion.indices().into_iter().enumerate() {
                let found = regressor[(row, column)] * 0.05 * 0.05 / 2.0;
                assert!((found - expected[i]).abs() < 1e-15, "row {row} column {i}: {found} {}", expected[i]);
            }
        }
    }

    #[test]
    fn a_distant_origin_costs_only_the_digits_of_the_positions() {
        let (near, far) = (golden_triple(Vector3::zeros()), golden_triple(Vector3::new(100.0, -60.0, 30.0)));
        let difference = (variational(&near) - variational(&far)).amax();
        // A position of 100 m carries 1.4e-14 m, divided by the step squared.
        assert!(difference < 4.0 * 1.4e-14 / (0.05 * 0.05), "{difference:e}");
    }

    #[test]
    fn free_fall_is_no_acceleration() {
        let gravity = Vector3::new(0.3, -9.0, 2.0);
        let velocity = Vector3::new(1.0, 2.0, -0.5);
        let pose = |t: f64| {
            Pose::from_parts(Translation3::from(velocity * t + gravity * (t * t / 2.0)), UnitQuaternion::identity())
        };
        let triple =
            PoseTriple::try_new([&pose(0.9), &pose(1.0), &pose(1.2)], 0.1, 0.2, &ObserverFrame::falling(gravity))
                .unwrap();
        assert!(variational(&triple).amax() < 1e-12);
    }

    #[test]
    fn half_a_turn_is_refused() {
        let turned = Pose::from_parts(
            Translation3::identity(),
            UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(0.0, 1.0, 0.0, 0.0)),
        );
        let still = <Pose<f64> as LieGroup>::identity();
        let found = PoseTriple::try_new([&still, &turned, &still], 0.1, 0.1, &ObserverFrame::inertial());
        assert!(matches!(found, Err(LieError::IncrementTooLarge { .. })));
    }
}
