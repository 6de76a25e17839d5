//! What errors of the model cost in tracking.

use crate::error::{PlanningError, finite, length, not_negative, pose, zero_or_moderate};
use nalgebra::{Matrix3, SMatrix};
use tumble_dynamics::{FreeFlyer, InertialParameters, PARAMETERS, PoseReference, PoseTracker};
use tumble_identification::regressors::newton_euler;
use tumble_lie::{Twist, Wrench};

/// Axes of the feedback: position in world axes, then attitude in body axes.
const AXES: usize = 6;

/// Feedback that makes the tracking error of each axis obey `e'' + damping e' + stiffness e = 0` when the model is right.
///
/// Axes: position x, y, z (world), attitude x, y, z (body).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosedLoop {
    /// Acceleration per error, 1/s^2.
    pub stiffness: [f64; AXES],
    /// Acceleration per rate of the error, 1/s.
    pub damping: [f64; AXES],
}

impl ClosedLoop {
    /// From the natural frequency and the damping ratio of each axis.
    pub fn second_order(natural_frequency_rad_s: [f64; AXES], damping_ratio: [f64; AXES]) -> Self {
        let damping = core::array::from_fn(|axis| 2.0 * damping_ratio[axis] * natural_frequency_rad_s[axis]);
        Self { stiffness: natural_frequency_rad_s.map(|frequency| frequency * frequency), damping }
    }
}

impl From<&PoseTracker> for ClosedLoop {
    fn from(tracker: &PoseTracker) -> Self {
        let both =
            |position: f64, rotation: f64| core::array::from_fn(|axis| if axis < 3 { position } else { rotation });
        Self {
            stiffness: both(tracker.position_stiffness, tracker.rotation_stiffness),
            damping: both(tracker.position_damping, tracker.rotation_damping),
        }
    }
}

/// A motion to be flown, with the feedback that flies it and what deviations from it cost.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedMotion {
    motion: Vec<PoseReference>,
    step_s: f64,
    closed_loop: ClosedLoop,
    tracking: [f64; 12],
}

impl TrackedMotion {
    /// One reference per step, which stands for the whole step: take the middle of it where the motion is smooth, the input
    /// held where it is a plan's. `tracking` weighs the squared deviations at the end of each step, in the order of
    /// [`super::LocalSettings::tracking`]: position and velocity in world axes, attitude and rate in body axes.
    ///
    /// # Errors
    /// A step without length; references, gains or weights that are not finite or are negative.
    pub fn try_new(
        motion: Vec<PoseReference>,
        step_s: f64,
        closed_loop: ClosedLoop,
        tracking: [f64; 12],
    ) -> Result<Self, PlanningError> {
        length("the length of a step", step_s)?;
        for gain in closed_loop.stiffness.iter().chain(&closed_loop.damping) {
            zero_or_moderate("a gain of the feedback", not_negative("a gain of the feedback", *gain)?)?;
        }
        for weight in tracking {
            not_negative("a tracking weight", weight)?;
        }
        for reference in &motion {
            pose(&reference.state.world_from_body)?;
            let acceleration = &reference.acceleration;
            let (linear, angular) = (&acceleration.acceleration_origin_body, &acceleration.angular_acceleration_body);
            for entry in reference.state.twist_body.to_vector().iter().chain(linear).chain(angular) {
                finite("a velocity or acceleration of a reference", *entry)?;
            }
        }
        Ok(Self { motion, step_s, closed_loop, tracking })
    }

    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.motion.len()
    }

    /// Length of a step, s.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// What errors of the model cost over the rest of the motion, beginning on track at the start of step `first`.
    ///
    /// `by_quantity` has one column per quantity: the change of [`InertialParameters::to_vector`] by it, zero for a nuisance
    /// that the body does not feel.
    ///
    /// # Errors
    /// A body without inertia; derivatives that are not finite.
    pub fn loss<const P: usize>(
        &self,
        body: &InertialParameters<f64>,
        by_quantity: &SMatrix<f64, PARAMETERS, P>,
        first: usize,
    ) -> Result<TrackingLoss<P>, PlanningError> {
        let body = body.validated()?;
        for entry in by_quantity {
            finite("the change of the body by a quantity", *entry)?;
        }
        let body = FreeFlyer::new(body);
        let steps: [AxisStep; AXES] = core::array::from_fn(|axis| {
            AxisStep::new(self.closed_loop.stiffness[axis], self.closed_loop.damping[axis], self.step_s)
        });
        let weights = &self.tracking;
        // error and its rate, per axis and quantity
        let mut response = [[[0.0; 2]; P]; AXES];
        let mut sensitivity = SMatrix::<f64, P, P>::zeros();
        for reference in self.motion.iter().skip(first) {
            let disturbance = disturbance_by_quantity(&body, by_quantity, reference);
            for axis in 0..AXES {
                let (position, rate) = if axis < 3 { (axis, axis + 3) } else { (axis + 3, axis + 6) };
                let row = &mut response[axis];
                for (place, acceleration) in row.iter_mut().zip(&disturbance[axis]) {
                    *place = steps[axis].advance(*place, *acceleration);
                }
                for i in 0..P {
                    for j in 0..=i {
                        sensitivity[(i, j)] +=
                            weights[position] * row[i][0] * row[j][0] + weights[rate] * row[i][1] * row[j][1];
                    }
                }
            }
        }
        for i in 0..P {
            for j in 0..i {
                sensitivity[(j, i)] = sensitivity[(i, j)];
            }
        }
        if sensitivity.iter().all(|entry| entry.is_finite()) {
            Ok(TrackingLoss { sensitivity })
        } else {
            Err(PlanningError::NotFinite { what: "the tracking loss", value: f64::INFINITY })
        }
    }
}

/// Change of the acceleration by each quantity when the wrench that the model asks for is held: `-M^-1 Y`, linear in world
/// axes, angular in body axes.
fn disturbance_by_quantity<const P: usize>(
    body: &FreeFlyer<f64>,
    by_quantity: &SMatrix<f64, PARAMETERS, P>,
    reference: &PoseReference,
) -> [[f64; P]; AXES] {
    let acceleration = &reference.acceleration;
    let regressor = newton_euler(
        &reference.state.twist_body.angular,
        &acceleration.angular_acceleration_body,
        &acceleration.acceleration_origin_body,
    );
    let mut disturbance = [[0.0; P]; AXES];
    for (quantity, change) in by_quantity.column_iter().enumerate() {
        let missing = -(regressor * change);
        let wrench = Wrench::new(missing.fixed_rows::<3>(0).into_owned(), missing.fixed_rows::<3>(3).into_owned());
        let answer = body.forward(&Twist::zero(), &wrench);
        let linear_world = reference.state.world_from_body.rotation * answer.acceleration_origin_body;
        let linear_and_angular = linear_world.iter().chain(&answer.angular_acceleration_body);
        for (axis, acceleration) in disturbance.iter_mut().zip(linear_and_angular) {
            axis[quantity] = *acceleration;
        }
    }
    disturbance
}

/// One step of `e'' + damping e' + stiffness e = d` with `d` held, exactly.
#[derive(Clone, Copy, Debug)]
struct AxisStep {
    by_start: [[f64; 2]; 2],
    by_disturbance: [f64; 2],
}

impl AxisStep {
    /// The exponential of the held system by its series, halved until it converges fast and squared back.
    fn new(stiffness: f64, damping: f64, step_s: f64) -> Self {
        let mut generator = Matrix3::new(0.0, 1.0, 0.0, -stiffness, -damping, 1.0, 0.0, 0.0, 0.0) * step_s;
        let mut squarings = 0;
        while generator.amax() > 0.125 {
            generator *= 0.5;
            squarings += 1;
        }
        let (mut term, mut sum) = (Matrix3::<f64>::identity(), Matrix3::<f64>::identity());
        for power in 1..=12 {
            term = term * generator / f64::from(power);
            sum += term;
        }
        for _ in 0..squarings {
            sum *= sum;
        }
        Self { by_start: [[sum.m11, sum.m12], [sum.m21, sum.m22]], by_disturbance: [sum.m13, sum.m23] }
    }

    fn advance(&self, [error, rate]: [f64; 2], disturbance: f64) -> [f64; 2] {
        core::array::from_fn(|i| {
            let [by_error, by_rate] = self.by_start[i];
            by_error * error + by_rate * rate + self.by_disturbance[i] * disturbance
        })
    }
}

/// Expected cost of flying a motion with a model that is wrong: `tr(S P)` for a covariance `P` of the quantities.
///
/// A tracker with feed-forward asks for the wrench `Y theta_hat` that its model needs, `Y` the Newton-Euler regressor of the
/// motion; a body with `theta` instead feels the acceleration `M^-1 Y (theta_hat - theta)` too much, and feedback turns it
/// into a deviation that is linear in the error for small errors: `e = G (theta - theta_hat)`, one second-order response per
/// axis. The weighted sum of squares over the motion has the mean `tr(S P)` with `S = sum G' Q G`. The feedback's own effort
/// is not counted, nor do limits of the actuators bind.
///
/// # Units
/// `S` is cost per unit of one quantity and unit of another.
/// # Source
/// Own; weights of (6.9) that are derived instead of tuned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackingLoss<const P: usize> {
    sensitivity: SMatrix<f64, P, P>,
}

impl<const P: usize> TrackingLoss<P> {
    /// `S`, symmetric and positive semidefinite.
    pub fn sensitivity(&self) -> &SMatrix<f64, P, P> {
        &self.sensitivity
    }

    /// `diag(S)`: the weights with which the weighted sum of variances is the expected cost, but for correlations.
    pub fn weights(&self) -> [f64; P] {
        core::array::from_fn(|i| self.sensitivity[(i, i)])
    }

    /// `tr(S P)`: the expected cost of an error with this covariance.
    pub fn expected(&self, covariance: &SMatrix<f64, P, P>) -> f64 {
        self.sensitivity.component_mul(covariance).sum()
    }

    /// Which quantity's uncertainty costs how much: the drop of the expected cost if that one were told exactly, the largest
    /// first.
    ///
    /// Telling quantity `i` leaves the covariance `P - P e_i e_i' P / P_ii`, and so saves `(P S P)_ii / P_ii`. Of quantities that
    /// are not correlated that is `S_ii P_ii`, and all of it together [`TrackingLoss::expected`].
    pub fn ranking(&self, covariance: &SMatrix<f64, P, P>) -> [(usize, f64); P] {
        let both = covariance * self.sensitivity * covariance;
        let mut ranking = core::array::from_fn(|i| {
            let variance = covariance[(i, i)];
            (i, if variance > 0.0 { both[(i, i)] / variance } else { 0.0 })
        });
        ranking.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        ranking
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::local::body_by_principal;
    use nalgebra::{Vector3, Vector4};

    /// Double integrator, undamped and critically damped axes in closed form.
    #[test]
    fn a_step_is_the_exact_answer() {
        let (h, w) = (0.7_f64, 3.0_f64);
        let free = AxisStep::new(0.0, 0.0, h);
        let near = |found: [f64; 2], expected: [f64; 2]| {
            for (a, b) in found.iter().zip(expected) {
                assert!((a - b).abs() < 1e-13, "{found:?} {expected:?}");
            }
        };
        near(free.advance([1.0, 2.0], 3.0), [1.0 + 2.0 * h + 1.5 * h * h, 2.0 + 3.0 * h]);
        let (s, c) = (w * h).sin_cos();
        let swings = AxisStep::new(w * w, 0.0, h);
        near(swings.advance([1.0, 2.0], 0.0), [c + 2.0 * s / w, -w * s + 2.0 * c]);
        near(swings.advance([0.0, 0.0], w * w), [1.0 - c, w * s]);
        let (e, settles) = ((-w * h).exp(), AxisStep::new(w * w, 2.0 * w, h));
        near(settles.advance([1.0, 0.0], 0.0), [e * (1.0 + w * h), -e * w * w * h]);
        near(settles.advance([0.0, 0.0], w * w), [1.0 - e * (1.0 + w * h), e * w * w * h]);
    }

    #[test]
    fn the_ranking_is_what_telling_one_quantity_saves() {
        let root = SMatrix::<f64, 4, 4>::from_fn(|i, j| (1.0 + 3.0 * i as f64 + 1.7 * j as f64).sin());
        let (loss, spread) = (TrackingLoss { sensitivity: root * root.transpose() }, root.transpose() * root);
        let ranking = loss.ranking(&spread);
        for (index, saved) in ranking {
            let column = spread.column(index).into_owned();
            let told = spread - column * column.transpose() / spread[(index, index)];
            assert!((loss.expected(&spread) - loss.expected(&told) - saved).abs() < 1e-12);
        }
        assert!(ranking.windows(2).all(|pair| pair[0].1 >= pair[1].1));
        let alone = SMatrix::from_diagonal(&Vector4::new(1.0, 0.0, 4.0, 2.0));
        let sum: f64 = loss.ranking(&alone).iter().map(|(_, saved)| saved).sum();
        assert!((sum - loss.expected(&alone)).abs() < 1e-12);
        assert!(loss.ranking(&alone).contains(&(1, 0.0)));
    }

    #[test]
    fn impossible_motions_are_errors() {
        let closed_loop = ClosedLoop::second_order([1.0; 6], [0.7; 6]);
        let new = |step_s: f64, closed_loop: ClosedLoop, weight: f64| {
            TrackedMotion::try_new(Vec::new(), step_s, closed_loop, [weight; 12]).unwrap_err()
        };
        assert!(matches!(new(0.0, closed_loop, 1.0), PlanningError::NotPositive { .. }));
        assert!(matches!(new(1e300, closed_loop, 1.0), PlanningError::OutOfRange { .. }));
        assert!(matches!(new(0.1, closed_loop, f64::NAN), PlanningError::NotFinite { .. }));
        let unstable = ClosedLoop { damping: [-1.0; 6], ..closed_loop };
        assert!(matches!(new(0.1, unstable, 1.0), PlanningError::Negative { .. }));
        let point = InertialParameters::about_origin(1.0, Vector3::zeros(), -Matrix3::identity());
        let motion = TrackedMotion::try_new(Vec::new(), 0.1, closed_loop, [1.0; 12]).unwrap();
        assert!(matches!(motion.loss(&point, &body_by_principal(&point), 0), Err(PlanningError::Dynamics(_))));
    }
}
