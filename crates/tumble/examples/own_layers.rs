//! A program of one's own: an estimator in flight and a method of identification among those that come with `tumble`, by name.
//! `cargo run --example own_layers -- fly iss-cargo --estimator as-measured`, `... -- identify log.csv --method recent`

use std::process::ExitCode;
use tumble::cli::identify::ADDED_METHODS;
use tumble::mission::ADDED_ESTIMATORS;
use tumble::robots::shipped;
use tumble_dynamics::RigidBodyState;
use tumble_dynamics::nalgebra::Vector3;
use tumble_identification::estimator::{Acted, Estimator, EstimatorError, Finding, Gauss, Measurement, StateEstimator};
use tumble_identification::recursive::Reception;
use tumble_identification::{BodyScale, MotionSample, Regressed};
use tumble_lie::LieGroup;

/// Takes the motion for what was measured last, and the body for what it was taken for before the flight.
pub struct AsMeasured {
    seen: RigidBodyState<f64>,
    stamp_ns: i64,
    body: Finding,
}

impl StateEstimator for AsMeasured {
    fn name(&self) -> &'static str {
        "as-measured"
    }
    fn acted(&mut self, _acted: &Acted) {}
    fn measured(&mut self, measurement: &Measurement) -> Reception {
        if measurement.stamp_ns < self.stamp_ns {
            return Reception::TooOld;
        }
        self.seen = self.state_at(measurement.stamp_ns);
        let value = |seen: &Option<Gauss<Vector3<f64>>>| seen.as_ref().map(|gauss| gauss.value);
        let (pose, twist) = (&mut self.seen.world_from_body, &mut self.seen.twist_body);
        pose.rotation = measurement.attitude.as_ref().map_or(pose.rotation, |gauss| gauss.value);
        pose.translation.vector = value(&measurement.position_world).unwrap_or(pose.translation.vector);
        twist.angular = value(&measurement.rate_body).unwrap_or(twist.angular);
        twist.linear = value(&measurement.velocity_world).map_or(twist.linear, |v| pose.rotation.inverse() * v);
        self.stamp_ns = measurement.stamp_ns;
        Reception::Used { nis: 1.0 }
    }
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        let ahead = self.seen.twist_body * ((time_ns - self.stamp_ns) as f64 * 1e-9);
        let moved = self.seen.world_from_body.compose(&LieGroup::exp(&ahead.to_vector()));
        RigidBodyState { world_from_body: moved, ..self.seen }
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        Ok(self.body)
    }
    fn newest_stamp_ns(&self) -> i64 {
        self.stamp_ns
    }
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError> {
        self.body = *body;
        Ok(())
    }
}

/// Least squares on the later half of a record.
pub struct Recent(Regressed);

impl Estimator for Recent {
    type Record = [MotionSample];
    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        self.0.estimate(&record[record.len() / 2..])
    }
}

/// Makes them known in this process.
pub fn add() {
    ADDED_METHODS.add("recent", "Least squares on the later half of the log", |problem| {
        Ok(Box::new(Recent(Regressed::new(*problem))))
    });
    ADDED_ESTIMATORS.add("as-measured", "what was measured last, and the body as it was believed", |problem| {
        let scale = BodyScale::of(&problem.prior.parameters.to_vector())?;
        let (simulator, body) = (&problem.flight.simulator, problem.prior.to_finding(scale)?);
        Ok(Box::new(AsMeasured { seen: *simulator.state(), stamp_ns: simulator.time_ns(), body }))
    });
}

#[allow(dead_code, reason = "the test of this program adds and asks by itself")]
fn main() -> ExitCode {
    add();
    tumble::run(std::env::args_os(), &shipped())
}
