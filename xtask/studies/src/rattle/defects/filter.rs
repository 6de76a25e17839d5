//! The parameter filter of the research code: mass and three moments, predicted from the measurement before.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, Vector3, Vector4};
use tumble_astrobee::sensing::LocalizationEstimate;
use tumble_dynamics::InertialParameters;
use tumble_identification::Estimate;
use tumble_lie::Wrench;
use tumble_planning::ModelBelief;

/// Variances of measured velocity, rate and acceleration, SI units squared.
const MEASURED: [f64; 3] = [5e-6, 2.5e-4, 5e-6];
/// Variance that each parameter gains with each measurement.
const WALK: f64 = 1e-8;
/// A reset comes this long after the last at the earliest, ns.
const BETWEEN_RESETS_NS: i64 = 15_000_000_000;
/// Wrenches that are remembered.
const WRENCHES: usize = 256;

/// Which of its properties it has; without any it still predicts from the measurement before.
#[derive(Clone, Copy)]
pub struct FilterKind {
    /// Whether the prediction of a velocity in body axes knows that these turn.
    pub has_transport: bool,
    /// One measurement of so many is used.
    pub stride: usize,
}

/// Motion in body axes as it was measured.
#[derive(Clone, Copy)]
struct Seen {
    stamp_ns: i64,
    velocity: Vector3<f64>,
    rate: Vector3<f64>,
}

pub struct OriginalFilter {
    kind: FilterKind,
    /// Before the first measurement: parameters and their covariance.
    first: (Vector4<f64>, Matrix4<f64>),
    now: (Vector4<f64>, Matrix4<f64>),
    prior: Estimate,
    last: Option<Seen>,
    count: usize,
    wrenches: VecDeque<(i64, Wrench<f64>)>,
    begun_ns: i64,
    published: Estimate,
}

impl OriginalFilter {
    /// From the same prior as ours, so that only the filter differs.
    pub fn new(kind: FilterKind, prior: &Estimate) -> Self {
        let moments = prior.parameters.inertia_about_com().diagonal();
        let spread = prior.std.inertia_about_com_kg_m2.diagonal();
        let theta = Vector4::new(prior.parameters.mass, moments.x, moments.y, moments.z);
        let sigma = Vector4::new(prior.std.mass_kg, spread.x, spread.y, spread.z);
        let first = (theta, Matrix4::from_diagonal(&sigma.component_mul(&sigma)));
        Self {
            kind,
            first,
            now: first,
            prior: *prior,
            last: None,
            count: 0,
            wrenches: VecDeque::new(),
            begun_ns: 0,
            published: *prior,
        }
    }

    /// From a time on this wrench acts.
    pub fn acted(&mut self, from_ns: i64, wrench_body: &Wrench<f64>) {
        if self.wrenches.len() == WRENCHES {
            self.wrenches.pop_front();
        }
        self.wrenches.push_back((from_ns, *wrench_body));
    }

    pub fn measured(&mut self, measured: &LocalizationEstimate) {
        self.count += 1;
        if !(self.count - 1).is_multiple_of(self.kind.stride) {
            return;
        }
        let body_from_world = measured.world_from_body.rotation.inverse();
        let velocity = body_from_world * measured.velocity_origin_world;
        let seen = Seen { stamp_ns: measured.stamp_ns, velocity, rate: measured.rate_body };
        if let Some(last) = self.last.filter(|last| last.stamp_ns < seen.stamp_ns) {
            self.update(&last, &seen, &measured.acceleration_origin_body);
        }
        if self.last.is_none_or(|last| last.stamp_ns < seen.stamp_ns) {
            self.last = Some(seen);
        }
    }

    fn update(&mut self, last: &Seen, seen: &Seen, acceleration: &Vector3<f64>) {
        let held = self.wrenches.iter().rev().find(|(from_ns, _)| *from_ns <= last.stamp_ns);
        let Some((_, wrench)) = held else { return };
        let dt_s = (seen.stamp_ns - last.stamp_ns) as f64 * 1e-9;
        let (theta, covariance) = &mut self.now;
        let [mass, xx, yy, zz] = (*theta).into();
        let (moments, rate) = (Vector3::new(xx, yy, zz), last.rate);
        let push = wrench.force / mass;
        let gyroscopic = rate.cross(&moments.component_mul(&rate));
        let angular = (wrench.torque - gyroscopic).component_div(&moments);
        let carried = if self.kind.has_transport { rate.cross(&last.velocity) } else { Vector3::zeros() };
        let mut residual = SVector::<f64, 9>::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&(seen.velocity - last.velocity - (push - carried) * dt_s));
        residual.fixed_rows_mut::<3>(3).copy_from(&(seen.rate - last.rate - angular * dt_s));
        residual.fixed_rows_mut::<3>(6).copy_from(&(acceleration - push));
        let mut by_theta = SMatrix::<f64, 9, 4>::zeros();
        by_theta.fixed_view_mut::<3, 1>(0, 0).copy_from(&(-push / mass * dt_s));
        by_theta.fixed_view_mut::<3, 1>(6, 0).copy_from(&(-push / mass));
        for axis in 0..3 {
            // the moment of one axis, and those of the two others through the gyroscopic torque
            let (next, after) = ((axis + 1) % 3, (axis + 2) % 3);
            let product = rate[next] * rate[after] / moments[axis];
            by_theta[(3 + axis, 1 + axis)] = -angular[axis] / moments[axis] * dt_s;
            by_theta[(3 + axis, 1 + next)] = product * dt_s;
            by_theta[(3 + axis, 1 + after)] = -product * dt_s;
        }
        *covariance += Matrix4::identity() * WALK;
        let noise = SVector::<f64, 9>::from_fn(|row, _| MEASURED[row / 3]);
        let innovation = by_theta * *covariance * by_theta.transpose() + SMatrix::from_diagonal(&noise);
        let Some(factor) = innovation.cholesky() else { return };
        let gain = factor.solve(&(by_theta * *covariance)).transpose();
        *theta += gain * residual;
        let kept = (Matrix4::identity() - gain * by_theta) * *covariance;
        *covariance = (kept + kept.transpose()) * 0.5;
        let [mass, xx, yy, zz] = (*theta).into();
        let is_body = mass > 0.0 && [xx, yy, zz].iter().all(|moment| *moment > 0.0 && 2.0 * moment < xx + yy + zz);
        if is_body {
            self.publish();
        } else if seen.stamp_ns - self.begun_ns >= BETWEEN_RESETS_NS {
            self.begun_ns = seen.stamp_ns;
            self.now = self.first;
            self.publish();
        }
    }

    fn publish(&mut self) {
        let (theta, covariance) = &self.now;
        let center = self.prior.parameters.center_of_mass();
        let moments = Vector3::new(theta[1], theta[2], theta[3]);
        let body = InertialParameters::about_com(theta[0], center, Matrix3::from_diagonal(&moments));
        let share = |i: usize| covariance[(i, i)].max(0.0).sqrt() / theta[i];
        let inertia = (1..4).map(share).fold(0.0, f64::max);
        let shares = [share(0), self.prior.std.center_of_mass_m.max(), inertia];
        self.published = ModelBelief::vague(0, body, shares).estimate;
    }

    /// What it says; the last body where what it has is none.
    pub fn estimate(&self) -> Estimate {
        self.published
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_lie::Pose;

    /// A body pushed and turned about z; measurements are exact, one each 16 ms.
    fn found(kind: FilterKind) -> [f64; 2] {
        let prior = ModelBelief::vague(
            0,
            InertialParameters::about_com(9.0, Vector3::zeros(), Matrix3::identity() * 0.2),
            [0.4, 0.01, 0.4],
        );
        let mut filter = OriginalFilter::new(kind, &prior.estimate);
        let (mass, moment, dt) = (12.0, 0.3, 0.016);
        let (mut velocity, mut rate, mut angle) = (Vector3::zeros(), 0.0, 0.0_f64);
        for k in 0..4000_i64 {
            let force = Vector3::new(0.2 * (0.02 * k as f64).sin(), 0.1 * (0.03 * k as f64).cos(), 0.0);
            let torque = 0.3 * (0.01 * k as f64).cos();
            let now_ns = k * 16_000_000;
            filter.acted(now_ns, &Wrench::new(Vector3::z() * torque, force));
            let rotation = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
            filter.measured(&LocalizationEstimate {
                stamp_ns: now_ns,
                arrival_ns: now_ns,
                world_from_body: Pose::from_parts(Vector3::zeros().into(), rotation),
                velocity_origin_world: rotation * velocity,
                rate_body: Vector3::z() * rate,
                acceleration_origin_body: force / mass,
                confidence: tumble_astrobee::sensing::Confidence::Good,
            });
            let spin = Vector3::z() * rate;
            velocity += (force / mass - spin.cross(&velocity)) * dt;
            (angle, rate) = (angle + rate * dt, rate + torque / moment * dt);
        }
        let body = filter.estimate().parameters;
        [body.mass / mass, body.inertia_about_com()[(2, 2)] / moment]
    }

    #[test]
    fn exact_motion_teaches_the_body_and_a_missing_transport_does_not() {
        let [mass, moment] = found(FilterKind { has_transport: true, stride: 1 });
        assert!((mass - 1.0).abs() < 1e-3 && (moment - 1.0).abs() < 1e-2, "{mass} {moment}");
        let [wrong, _] = found(FilterKind { has_transport: false, stride: 1 });
        assert!((wrong - 1.0).abs() > 3.0 * (mass - 1.0).abs(), "{wrong}");
    }
}
