//! Motion and ten parameters as one state: what a filter on poses needs.

use super::extended_kalman::{DifferentiableModel, FilterModel};
use crate::dynamics::{
    FreeFlyer, FreeFlyerIn, InertialParameters, Integrator, LogCholesky, MuntheKaas4, RigidBodyState, StoredMomentum,
    UniformGravity,
};
use crate::error::IdentificationError;
use crate::lie::{LieGroup, Manifold, Pose, Twist, Wrench, skew};
use crate::regressors::newton_euler;
use nalgebra::{ComplexField, Matrix3, SMatrix, SVector, Vector3, Vector6};

type Vector10 = SVector<f64, 10>;
type Vector22 = SVector<f64, 22>;
type Matrix22 = SMatrix<f64, 22, 22>;

/// Pose and twist of a body, and the body: any point of this state exists.
///
/// # Shape
/// Increments: pose (angular, linear) on SE(3) to the right, twist, then the [`LogCholesky`] coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointState {
    /// Pose and twist.
    pub motion: RigidBodyState<f64>,
    /// The ten parameters in a chart in which every point is a body.
    pub body: LogCholesky<f64>,
}

impl Manifold for JointState {
    type Scalar = f64;
    type Tangent = Vector22;

    fn oplus(&self, xi: &Vector22) -> Self {
        let body = self.body.to_vector() + xi.fixed_rows::<10>(12);
        Self { motion: self.motion.oplus(&xi.fixed_rows::<12>(0).into_owned()), body: LogCholesky::from_vector(&body) }
    }

    fn ominus(&self, base: &Self) -> Vector22 {
        let mut xi = Vector22::zeros();
        xi.fixed_rows_mut::<12>(0).copy_from(&self.motion.ominus(&base.motion));
        xi.fixed_rows_mut::<10>(12).copy_from(&(self.body.to_vector() - base.body.to_vector()));
        xi
    }

    fn increment_rate(xi: &Vector22, velocity: &Vector22) -> Vector22 {
        let head = |v: &Vector22| v.fixed_rows::<12>(0).into_owned();
        let mut rate = *velocity;
        rate.fixed_rows_mut::<12>(0).copy_from(&RigidBodyState::increment_rate(&head(xi), &head(velocity)));
        rate
    }
}

/// A step under a held wrench and what was measured at its end.
///
/// # Frame
/// As in [`MotionSample`](crate::MotionSample).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointObservation {
    /// Time since the last observation, s.
    pub step_s: f64,
    /// Wrench held over that time, body axes about the origin, without gravity.
    pub wrench_body: Wrench<f64>,
    /// Momentum in wheels meanwhile, body axes, N m s: the body turns it along.
    pub stored_body: Vector3<f64>,
    /// Measured pose; `None` where there was none.
    pub world_from_body: Option<Pose<f64>>,
    /// Measured angular velocity, body axes.
    pub rate_body: Option<Vector3<f64>>,
    /// Measured velocity of the origin, inertial axes.
    pub velocity_origin_world: Option<Vector3<f64>>,
    /// Measured inertial acceleration of the origin, body axes, and the wrench that acts at that moment.
    pub acceleration_origin_body: Option<(Vector3<f64>, Wrench<f64>)>,
}

/// One standard deviation per axis of everything that is not known exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionNoise {
    /// Of a measured attitude, rad.
    pub attitude_rad: f64,
    /// Of a measured position, m.
    pub position_m: f64,
    /// Of a measured angular velocity, rad/s.
    pub rate_rad_s: f64,
    /// Of a measured velocity, m/s.
    pub velocity_m_s: f64,
    /// Of a measured acceleration, m/s^2.
    pub acceleration_m_s2: f64,
    /// Of the torque held over one step, N m.
    pub torque_n_m: f64,
    /// Of the force held over one step, N.
    pub force_n: f64,
    /// Of the drift of the ten [`LogCholesky`] coordinates over one second.
    pub drift: Vector10,
}

impl MotionNoise {
    /// The same for a body like this that drifts. Over one second the deviations are `share` for the logarithms of mass and extents, and `share` times
    /// the mean extent (geometric, m) for the centre of mass and the shears of [`LogCholesky`].
    ///
    /// # Errors
    /// [`IdentificationError::Dynamics`] for a body that is not strictly consistent.
    #[must_use = "the noise is not changed in place"]
    pub fn drifting(self, share: f64, body: &InertialParameters<f64>) -> Result<Self, IdentificationError> {
        let chart = LogCholesky::try_from_parameters(body)?;
        let length_m = share * chart.log_extents.mean().exp();
        let drift = Vector10::from_fn(|i, _| if matches!(i, 0 | 4..=6) { share } else { length_m });
        Ok(Self { drift, ..self })
    }
}

/// A free body under a held wrench: poses, rates, velocities and accelerations in, motion and ten parameters out.
///
/// Reported parameters are those of [`InertialParameters::to_vector`], strictly consistent because the state knows no other
/// bodies.
///
/// # Shape
/// 22 coordinates of the state; rows attitude, position, rate, velocity, acceleration, all in body axes.
/// # Source
/// Thesis (6.1), (6.10), (6.11), (2.4).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointMotion {
    /// Noise of measurements and wrench.
    pub noise: MotionNoise,
    /// Gravitational acceleration, inertial axes, m/s^2.
    pub gravity_world: Vector3<f64>,
}

/// Derivatives of the twist rate at one instant: by attitude, twist, chart.
pub(super) struct Derivatives {
    attitude: Matrix3<f64>,
    pub(super) twist: SMatrix<f64, 6, 6>,
    pub(super) body: SMatrix<f64, 6, 10>,
}

impl JointMotion {
    /// Rate of the components of the twist.
    fn twist_rate(&self, flyer: &FreeFlyer<f64>, motion: &RigidBodyState<f64>, wrench: &Wrench<f64>) -> Twist<f64> {
        let twist = &motion.twist_body;
        let acceleration = flyer.forward(twist, wrench);
        let gravity = motion.world_from_body.rotation.inverse() * self.gravity_world;
        let linear = acceleration.acceleration_origin_body + gravity - twist.angular.cross(&twist.linear);
        Twist::new(acceleration.angular_acceleration_body, linear)
    }

    /// Derivatives of the twist rate under a wrench that holds the gyroscopic torque of what is `stored`. The acceleration of the origin
    /// is the lower half plus w × v.
    pub(super) fn derivatives(&self, state: &JointState, wrench: &Wrench<f64>, stored: &Vector3<f64>) -> Derivatives {
        let parameters = state.body.to_parameters();
        let flyer = FreeFlyer::new(parameters);
        let twist = &state.motion.twist_body;
        let (w, v) = (&twist.angular, &twist.linear);
        let gravity = state.motion.world_from_body.rotation.inverse() * self.gravity_world;
        let acceleration = flyer.forward(twist, wrench);
        let angular = acceleration.angular_acceleration_body;
        let linear = acceleration.acceleration_origin_body;
        // What a change of the required wrench does to the accelerations, the twist held.
        let response = |wrench: &Wrench<f64>| {
            let change = flyer.forward(&Twist::zero(), wrench);
            let (a, l) = (change.angular_acceleration_body, change.acceleration_origin_body);
            Vector6::new(a.x, a.y, a.z, l.x, l.y, l.z)
        };
        // Wrench (required) = newton_euler(w, wdot, a) parameters stays the same: its rows give the derivatives.
        let required = newton_euler(w, &angular, &linear) * parameters_by_chart(&state.body);
        let mut by_body = SMatrix::<f64, 6, 10>::zeros();
        for j in 0..10 {
            let column: Vector6<f64> = required.column(j).into_owned();
            by_body.set_column(j, &response(&Wrench::from(-column)));
        }
        // By the rate: torque w × (J w + stored), force w × (w × h).
        let (inertia, h) = (parameters.inertia_about_origin, parameters.first_moment);
        let mut by_twist = SMatrix::<f64, 6, 6>::zeros();
        for j in 0..3 {
            let e = Vector3::ith(j, 1.0);
            let torque = e.cross(&(inertia * w + stored)) + w.cross(&(inertia * e));
            let force = e.cross(&w.cross(&h)) + w.cross(&e.cross(&h));
            by_twist.set_column(j, &response(&Wrench::new(-torque, -force)));
        }
        // The component rate of the velocity is the acceleration less w × v.
        let mut lower = by_twist.fixed_view_mut::<3, 3>(3, 0);
        lower += skew(v);
        by_twist.fixed_view_mut::<3, 3>(3, 3).copy_from(&-skew(w));
        Derivatives { attitude: skew(&gravity), twist: by_twist, body: by_body }
    }

    /// Derivatives of the end of a step: by motion, by body. Those at the middle of the step, to second order.
    pub(super) fn transition(
        &self,
        state: &JointState,
        observation: &JointObservation,
    ) -> (SMatrix<f64, 12, 12>, SMatrix<f64, 12, 10>) {
        let step_s = observation.step_s;
        let flyer = FreeFlyer::new(state.body.to_parameters());
        let (given, stored) = (&observation.wrench_body, &observation.stored_body);
        let start = self.twist_rate(&flyer, &state.motion, &felt(given, stored, &state.motion.twist_body.angular));
        let twist_body = state.motion.twist_body + start * (0.5 * step_s);
        let turn = Pose::exp(&(state.motion.twist_body.to_vector() * (0.5 * step_s)));
        let world_from_body = state.motion.world_from_body.compose(&turn);
        let middle = JointState { motion: RigidBodyState { world_from_body, twist_body }, body: state.body };
        let found = self.derivatives(&middle, &felt(given, stored, &twist_body.angular), stored);
        let (w, v) = (skew(&twist_body.angular), skew(&twist_body.linear));
        let mut by_motion = SMatrix::<f64, 12, 12>::zeros();
        by_motion.fixed_view_mut::<3, 3>(0, 0).copy_from(&-w);
        by_motion.fixed_view_mut::<3, 3>(3, 0).copy_from(&-v);
        by_motion.fixed_view_mut::<3, 3>(3, 3).copy_from(&-w);
        by_motion.fixed_view_mut::<6, 6>(0, 6).fill_with_identity();
        by_motion.fixed_view_mut::<3, 3>(9, 0).copy_from(&found.attitude);
        by_motion.fixed_view_mut::<6, 6>(6, 6).copy_from(&found.twist);
        let mut by_body = SMatrix::<f64, 12, 10>::zeros();
        by_body.fixed_view_mut::<6, 10>(6, 0).copy_from(&found.body);
        let half = by_motion * (0.5 * step_s * step_s);
        (SMatrix::identity() + by_motion * step_s + half * by_motion, by_body * step_s + half * by_body)
    }
}

/// A wrench with the gyroscopic torque h × w of what is stored.
pub(super) fn felt(wrench: &Wrench<f64>, stored: &Vector3<f64>, rate: &Vector3<f64>) -> Wrench<f64> {
    Wrench::new(wrench.torque + stored.cross(rate), wrench.force)
}

impl FilterModel<22, 15, 10> for JointMotion {
    type State = JointState;
    type Observation = JointObservation;

    fn propagate(&self, state: &JointState, observation: &JointObservation) -> Result<JointState, IdentificationError> {
        let parameters = state.body.to_parameters();
        let gravity = UniformGravity {
            mass: parameters.mass,
            first_moment: parameters.first_moment,
            gravity_world: self.gravity_world,
        };
        let environment = (gravity, StoredMomentum { momentum_body: observation.stored_body });
        let system = FreeFlyerIn { body: FreeFlyer::new(parameters), environment };
        let motion = MuntheKaas4.step(&system, &state.motion, &observation.wrench_body, 0.0, observation.step_s)?;
        Ok(JointState { motion, body: state.body })
    }

    fn process_noise(&self, state: &JointState, observation: &JointObservation) -> Matrix22 {
        let (step_s, flyer) = (observation.step_s, FreeFlyer::new(state.body.to_parameters()));
        let mut input = SMatrix::<f64, 12, 6>::zeros();
        for j in 0..6 {
            let deviation = if j < 3 { self.noise.torque_n_m } else { self.noise.force_n };
            let change = flyer.forward(&Twist::zero(), &Wrench::from(Vector6::ith(j, deviation * step_s)));
            let change = Twist::new(change.angular_acceleration_body, change.acceleration_origin_body).to_vector();
            input.fixed_view_mut::<6, 1>(0, j).copy_from(&(change * (0.5 * step_s)));
            input.fixed_view_mut::<6, 1>(6, j).copy_from(&change);
        }
        let mut noise = Matrix22::zeros();
        noise.fixed_view_mut::<12, 12>(0, 0).copy_from(&(input * input.transpose()));
        for i in 0..10 {
            noise[(12 + i, 12 + i)] = self.noise.drift[i] * self.noise.drift[i] * step_s;
        }
        noise
    }

    fn residual(&self, state: &JointState, observation: &JointObservation) -> SVector<f64, 15> {
        let (motion, mut residual) = (&state.motion, SVector::<f64, 15>::zeros());
        let body_from_world = motion.world_from_body.rotation.inverse();
        if let Some(measured) = &observation.world_from_body {
            let attitude = LieGroup::log(&(body_from_world * measured.rotation));
            let moved = measured.translation.vector - motion.world_from_body.translation.vector;
            residual.fixed_rows_mut::<3>(0).copy_from(&attitude);
            residual.fixed_rows_mut::<3>(3).copy_from(&(body_from_world * moved));
        }
        if let Some(measured) = &observation.rate_body {
            residual.fixed_rows_mut::<3>(6).copy_from(&(measured - motion.twist_body.angular));
        }
        if let Some(measured) = &observation.velocity_origin_world {
            residual.fixed_rows_mut::<3>(9).copy_from(&(body_from_world * measured - motion.twist_body.linear));
        }
        if let Some((measured, wrench)) = &observation.acceleration_origin_body {
            let flyer = FreeFlyer::new(state.body.to_parameters());
            let felt = felt(wrench, &observation.stored_body, &motion.twist_body.angular);
            let expected = flyer.forward(&motion.twist_body, &felt).acceleration_origin_body;
            residual.fixed_rows_mut::<3>(12).copy_from(&(measured - expected - body_from_world * self.gravity_world));
        }
        residual
    }

    fn standard_deviation(&self, observation: &JointObservation) -> SVector<f64, 15> {
        let noise = &self.noise;
        let groups = [
            (observation.world_from_body.is_some(), noise.attitude_rad),
            (observation.world_from_body.is_some(), noise.position_m),
            (observation.rate_body.is_some(), noise.rate_rad_s),
            (observation.velocity_origin_world.is_some(), noise.velocity_m_s),
            (observation.acceleration_origin_body.is_some(), noise.acceleration_m_s2),
        ];
        let mut deviation = SVector::<f64, 15>::repeat(f64::INFINITY);
        for (group, (measured, value)) in groups.into_iter().enumerate() {
            if measured {
                deviation.fixed_rows_mut::<3>(3 * group).fill(value);
            }
        }
        deviation
    }

    fn parameters(&self, state: &JointState) -> Vector10 {
        state.body.to_parameters().to_vector()
    }

    fn parameter_jacobian(&self, state: &JointState) -> SMatrix<f64, 10, 22> {
        let mut jacobian = SMatrix::<f64, 10, 22>::zeros();
        jacobian.fixed_view_mut::<10, 10>(0, 12).copy_from(&parameters_by_chart(&state.body));
        jacobian
    }
}

impl DifferentiableModel<22, 15, 10> for JointMotion {
    fn predicted_covariance(
        &self,
        state: &JointState,
        observation: &JointObservation,
        covariance: &Matrix22,
    ) -> Matrix22 {
        let (by_motion, by_body) = self.transition(state, observation);
        // Φ = [by_motion by_body; 0 I].
        let moved =
            by_motion * covariance.fixed_view::<12, 22>(0, 0) + by_body * covariance.fixed_view::<10, 22>(12, 0);
        let mut predicted = *covariance;
        let cross = moved.fixed_view::<12, 10>(0, 12).into_owned();
        let corner = moved.fixed_view::<12, 12>(0, 0) * by_motion.transpose() + cross * by_body.transpose();
        predicted.fixed_view_mut::<12, 12>(0, 0).copy_from(&super::belief::symmetric(&corner));
        predicted.fixed_view_mut::<12, 10>(0, 12).copy_from(&cross);
        predicted.fixed_view_mut::<10, 12>(12, 0).copy_from(&cross.transpose());
        predicted + self.process_noise(state, observation)
    }

    fn sensitivity(&self, state: &JointState, observation: &JointObservation) -> SMatrix<f64, 15, 22> {
        let mut sensitivity = SMatrix::<f64, 15, 22>::zeros();
        sensitivity.fixed_view_mut::<9, 9>(0, 0).fill_with_identity();
        sensitivity.fixed_view_mut::<3, 3>(9, 9).fill_with_identity();
        let twist = &state.motion.twist_body;
        sensitivity.fixed_view_mut::<3, 3>(9, 0).copy_from(&-skew(&twist.linear));
        if let Some((_, wrench)) = &observation.acceleration_origin_body {
            let stored = &observation.stored_body;
            let found = self.derivatives(state, &felt(wrench, stored, &twist.angular), stored);
            // Acceleration of the origin = component rate of the velocity + w × v.
            let by_rate = found.twist.fixed_view::<3, 3>(3, 0) - skew(&twist.linear);
            sensitivity.fixed_view_mut::<3, 3>(12, 0).copy_from(&found.attitude);
            sensitivity.fixed_view_mut::<3, 3>(12, 6).copy_from(&by_rate);
            sensitivity.fixed_view_mut::<3, 10>(12, 12).copy_from(&found.body.fixed_view::<3, 10>(3, 0));
        }
        sensitivity
    }
}

/// Derivative of the ten parameters by the ten coordinates of the chart.
pub(super) fn parameters_by_chart(body: &LogCholesky<f64>) -> SMatrix<f64, 10, 10> {
    let (c, s) = (&body.center_of_mass, &body.shears);
    let d = body.log_extents.map(ComplexField::exp);
    let root = Matrix3::new(d.x, s.x, s.y, 0.0, d.y, s.z, 0.0, 0.0, d.z);
    let parameters = body.to_parameters();
    let mass = parameters.mass;
    let mut jacobian = SMatrix::<f64, 10, 10>::zeros();
    // All ten are proportional to the mass.
    jacobian.set_column(0, &parameters.to_vector());
    for i in 0..3 {
        let e = Vector3::ith(i, 1.0);
        let cross = e * c.transpose();
        let inertia_about_origin = (Matrix3::identity() * (2.0 * c[i]) - cross - cross.transpose()) * mass;
        let change = InertialParameters { mass: 0.0, first_moment: e * mass, inertia_about_origin };
        jacobian.set_column(1 + i, &change.to_vector());
    }
    let entries = [(0, 0, d.x), (1, 1, d.y), (2, 2, d.z), (0, 1, 1.0), (0, 2, 1.0), (1, 2, 1.0)];
    for (k, (i, j, size)) in entries.into_iter().enumerate() {
        // Second moment m U Uᵀ; only row i of dU is not zero.
        let half = Vector3::ith(i, mass * size) * root.column(j).transpose();
        let second = half + half.transpose();
        let inertia_about_origin = Matrix3::identity() * second.trace() - second;
        let change = InertialParameters { mass: 0.0, first_moment: Vector3::zeros(), inertia_about_origin };
        jacobian.set_column(4 + k, &change.to_vector());
    }
    jacobian
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::strategies::body_d;

    fn model() -> JointMotion {
        let noise = MotionNoise {
            attitude_rad: 1e-3,
            position_m: 1e-3,
            rate_rad_s: 1e-3,
            velocity_m_s: 1e-3,
            acceleration_m_s2: 1e-2,
            torque_n_m: 1e-4,
            force_n: 1e-3,
            drift: Vector10::zeros(),
        };
        JointMotion { noise, gravity_world: Vector3::new(0.3, -0.2, -0.5) }
    }

    /// A body ten times as long drifts by ten times as many metres, one a thousand times as heavy by as many of its logarithms.
    #[test]
    fn a_body_drifts_by_a_share_of_itself() {
        let drift = |mass, side: f64| {
            let body = InertialParameters::solid_box(mass, [side, 2.0 * side, 1.5 * side]);
            model().noise.drifting(1e-4, &body).unwrap().drift
        };
        let (small, large) = (drift(10.0, 0.1), drift(1e4, 1.0));
        for i in 0..10 {
            let expected = if matches!(i, 0 | 4..=6) { 1.0 } else { 10.0 };
            assert!((large[i] / small[i] - expected).abs() < 1e-9, "{i}: {small} {large}");
        }
        // by hand: a box as long as a has a squared extent of a^2 / 12
        let extent_m = 0.1 * f64::powf(3.0, 1.0 / 3.0) / f64::sqrt(12.0);
        assert!((small[0] - 1e-4).abs() < 1e-18 && (small[1] / (1e-4 * extent_m) - 1.0).abs() < 1e-12, "{small}");
        assert!(model().noise.drifting(1e-4, &InertialParameters::solid_box(1.0, [0.1, 0.1, 0.0])).is_err());
    }

    fn state() -> JointState {
        let body_d = body_d().to_vector();
        let motion = RigidBodyState {
            world_from_body: Pose::exp(&Vector6::new(0.3, -0.4, 0.7, 0.1, 0.2, -0.3)),
            twist_body: Twist::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.1, -0.05, 0.2)),
        };
        JointState {
            motion,
            body: LogCholesky::try_from_parameters(&InertialParameters::from_vector(&body_d)).unwrap(),
        }
    }

    fn observation(step_s: f64) -> JointObservation {
        let wrench_body = Wrench::new(Vector3::new(0.2, -0.1, 0.3), Vector3::new(1.0, -0.5, 0.8));
        JointObservation {
            step_s,
            wrench_body,
            stored_body: Vector3::new(0.4, -0.3, 0.6),
            world_from_body: Some(Pose::exp(&Vector6::new(0.31, -0.39, 0.7, 0.1, 0.21, -0.3))),
            rate_body: Some(Vector3::new(0.31, -0.2, 0.5)),
            velocity_origin_world: Some(Vector3::new(0.1, -0.05, 0.21)),
            acceleration_origin_body: Some((Vector3::new(0.2, -0.1, 0.3), wrench_body)),
        }
    }

    /// Derivative along increment j by central differences.
    fn slope<const R: usize>(j: usize, f: impl Fn(&JointState) -> SVector<f64, R>) -> SVector<f64, R> {
        let step = Vector22::ith(j, 1e-5);
        (f(&state().oplus(&step)) - f(&state().oplus(&-step))) / 2e-5
    }

    #[test]
    fn the_chart_has_the_stated_derivative() {
        let jacobian = model().parameter_jacobian(&state());
        for j in 0..22 {
            let expected = slope(j, |s| model().parameters(s));
            assert!((jacobian.column(j) - expected).amax() < 1e-9, "{j}");
        }
    }

    #[test]
    fn sensitivities_equal_difference_quotients() {
        // At the measured pose, where the logarithm is straight.
        let mut seen = observation(0.0);
        seen.world_from_body = Some(state().motion.world_from_body);
        let velocity = state().motion.world_from_body.rotation * state().motion.twist_body.linear;
        seen.velocity_origin_world = Some(velocity);
        let sensitivity = model().sensitivity(&state(), &seen);
        for j in 0..22 {
            let expected = -slope(j, |s| model().residual(s, &seen));
            assert!((sensitivity.column(j) - expected).amax() < 1e-8, "{j} {}", sensitivity.column(j) - expected);
        }
    }

    #[test]
    fn transition_is_the_derivative_of_the_step_to_second_order() {
        let error = |step_s: f64| {
            let (by_motion, by_body) = model().transition(&state(), &observation(step_s));
            let end = model().propagate(&state(), &observation(step_s)).unwrap();
            (0..22)
                .map(|j| {
                    let moved = slope(j, |s| model().propagate(s, &observation(step_s)).unwrap().ominus(&end));
                    let stated =
                        if j < 12 { by_motion.column(j).into_owned() } else { by_body.column(j - 12).into_owned() };
                    (moved.fixed_rows::<12>(0) - stated).amax()
                })
                .fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(0.1), error(0.05));
        assert!(coarse < 2e-3 && coarse / fine > 6.5, "{coarse:e} {fine:e}");
    }

    #[test]
    fn wrench_noise_is_what_a_wrong_wrench_does() {
        let (seen, noise) = (observation(0.01), model().process_noise(&state(), &observation(0.01)));
        let end = model().propagate(&state(), &seen).unwrap();
        let mut expected = SMatrix::<f64, 12, 12>::zeros();
        for j in 0..6 {
            let deviation = if j < 3 { 1e-4 } else { 1e-3 };
            let wrong = JointObservation { wrench_body: seen.wrench_body + Vector6::ith(j, deviation).into(), ..seen };
            let moved = model().propagate(&state(), &wrong).unwrap().ominus(&end).fixed_rows::<12>(0).into_owned();
            expected += moved * moved.transpose();
        }
        let found = noise.fixed_view::<12, 12>(0, 0);
        assert!((found - expected).amax() < 0.02 * expected.amax(), "{}", found - expected);
    }
}
