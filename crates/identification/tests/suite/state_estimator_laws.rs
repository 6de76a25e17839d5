//! The laws of estimators in flight on both that are shipped, and on planted defects.

use tumble_identification::dynamics::{InertialParameters, RigidBodyState};
use tumble_identification::estimator::{Acted, Doubt, EstimatorError, Finding, Measurement, StateEstimator};
use tumble_identification::laws::{BeginFlightIn, StateTrial, Units, check_flight_units, check_state_estimator};
use tumble_identification::lie::Wrench;
use tumble_identification::nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector6};
use tumble_identification::recursive::{
    FlightEstimator, FlightEstimatorSettings, FlightHealth, MotionNoise, Reception, ReceptionCounts, TwoStageEstimator,
    WrenchErrors,
};
use tumble_identification::{BodyScale, Estimate};

/// A body of 12 kg that is taken for one of 9, three quarters of a meter per second squared at most.
pub fn trial() -> StateTrial {
    let about_com = Matrix3::new(0.24, 0.01, -0.02, 0.01, 0.2, 0.005, -0.02, 0.005, 0.28);
    let body = InertialParameters::about_com(12.0, Vector3::new(0.03, -0.02, 0.01), about_com);
    let believed = InertialParameters::about_com(9.0, Vector3::zeros(), Matrix3::from_diagonal_element(0.2));
    let scale = BodyScale::of(&believed.to_vector()).unwrap();
    let spread =
        scale.parameter_magnitudes().component_mul(&SVector::from([0.4, 0.3, 0.3, 0.3, 0.4, 0.2, 0.2, 0.4, 0.2, 0.4]));
    let covariance = SMatrix::from_diagonal(&spread.component_mul(&spread));
    let prior = Finding::of_covariance(believed.to_vector(), &covariance, scale.parameter_magnitudes()).unwrap();
    StateTrial {
        body,
        prior,
        period_ns: 20_000_000,
        periods: 1500,
        lateness: 40,
        wrench: [0.05, 0.5],
        stored_body: Vector3::new(0.1, -0.4, 0.2),
        deviation: [1e-3, 1e-3, 1e-3, 1e-3],
        within: 5e-3,
    }
}

/// The same, shorter and less strict: for what is slow, and for what is wrong.
pub fn short_trial() -> StateTrial {
    StateTrial { periods: 700, within: 0.05, ..trial() }
}

pub fn settings() -> FlightEstimatorSettings {
    let noise = MotionNoise {
        attitude_rad: 1e-3,
        position_m: 1e-3,
        rate_rad_s: 1e-3,
        velocity_m_s: 1e-3,
        acceleration_m_s2: 1.0,
        torque_n_m: 1e-6,
        force_n: 1e-5,
        drift: SVector::zeros(),
    };
    let mut settings = FlightEstimatorSettings::new(noise);
    settings.wrench.drift *= 0.01;
    settings.wrench = settings.wrench.of_thrusters(1e-4, 1, 0.1);
    settings
}

fn joint(start: &RigidBodyState<f64>, prior: &Finding) -> Result<FlightEstimator, EstimatorError> {
    Ok(FlightEstimator::try_new(settings(), *start, 0, &Estimate::try_from(prior)?)?)
}

#[test]
fn the_joint_filter_keeps_them() {
    for trial in [trial(), short_trial()] {
        check_state_estimator(&|start, prior| Ok(Box::new(joint(start, prior)?)), &trial).unwrap();
    }
}

#[test]
fn two_stages_keep_them() {
    let begin = |start: &RigidBodyState<f64>, prior: &Finding| -> Result<Box<dyn StateEstimator>, EstimatorError> {
        Ok(Box::new(TwoStageEstimator::least_squares(settings(), *start, 0, prior)?))
    };
    check_state_estimator(&begin, &trial()).unwrap();
    let begin = |start: &RigidBodyState<f64>, prior: &Finding| -> Result<Box<dyn StateEstimator>, EstimatorError> {
        Ok(Box::new(TwoStageEstimator::sdp(settings(), *start, 0, prior)?))
    };
    check_state_estimator(&begin, &trial()).unwrap();
}

/// The settings in other units of mass and length.
fn settings_in(units: &Units) -> FlightEstimatorSettings {
    let (length, force) = (units.length, units.mass * units.length);
    let usual = settings();
    let noise = MotionNoise {
        position_m: usual.noise.position_m * length,
        velocity_m_s: usual.noise.velocity_m_s * length,
        acceleration_m_s2: usual.noise.acceleration_m_s2 * length,
        torque_n_m: usual.noise.torque_n_m * force * length,
        force_n: usual.noise.force_n * force,
        ..usual.noise
    };
    let [[tx, ty, tz, fx, fy, fz]] = usual.wrench.drift.data.0;
    let wrench = WrenchErrors {
        drift: Vector6::new(tx * length, ty * length, tz * length, fx, fy, fz) * force,
        ..usual.wrench.of_thrusters(1e-4, 1, 0.1 * length)
    };
    let [attitude, position, rate, velocity] = usual.start_deviation;
    let start_deviation = [attitude, position * length, rate, velocity * length];
    FlightEstimatorSettings { noise, wrench, start_deviation, ..usual }
}

/// Of mass and length: in time, a filter that must keep pace has steps and patience of so many milliseconds and seconds.
#[test]
fn no_unit_decides_in_flight() {
    let of_bodies = [[1e-3, 1.0], [1e3, 1.0], [1.0, 1e-2], [1.0, 1e2]];
    let of_bodies = of_bodies.map(|[mass, length]| Units { mass, length, time: 1.0 });
    let joint = |units: &Units, start: &RigidBodyState<f64>, prior: &Finding| -> Result<Box<dyn StateEstimator>, _> {
        Ok(Box::new(FlightEstimator::try_new(settings_in(units), *start, 0, &Estimate::try_from(prior)?)?))
    };
    check_flight_units(&joint, &short_trial(), &of_bodies, 0.01).unwrap();
    let rls = |units: &Units, start: &RigidBodyState<f64>, prior: &Finding| -> Result<Box<dyn StateEstimator>, _> {
        Ok(Box::new(TwoStageEstimator::least_squares(settings_in(units), *start, 0, prior)?))
    };
    check_flight_units(&rls, &short_trial(), &of_bodies, 0.01).unwrap();
    let sdp = |units: &Units, start: &RigidBodyState<f64>, prior: &Finding| -> Result<Box<dyn StateEstimator>, _> {
        Ok(Box::new(TwoStageEstimator::sdp(settings_in(units), *start, 0, prior)?))
    };
    check_flight_units(&sdp, &short_trial(), &of_bodies, 0.01).unwrap();
    // A drift of so many newtons whatever their unit, and patience that the unit of mass decides.
    let law = |begin: BeginFlightIn<'_>| check_flight_units(begin, &short_trial(), &of_bodies, 0.01).unwrap_err().law;
    let wrench = |units: &Units, start: &RigidBodyState<f64>, prior: &Finding| -> Result<Box<dyn StateEstimator>, _> {
        let usual = FlightEstimatorSettings { wrench: settings().wrench, ..settings_in(units) };
        Ok(Box::new(FlightEstimator::try_new(usual, *start, 0, &Estimate::try_from(prior)?)?))
    };
    assert_eq!(law(&wrench), "units do not matter");
    let late = |units: &Units, start: &RigidBodyState<f64>, prior: &Finding| -> Result<Box<dyn StateEstimator>, _> {
        let hasty = FlightEstimatorSettings { lateness_s: 0.03 * units.mass, ..settings_in(units) };
        Ok(Box::new(FlightEstimator::try_new(hasty, *start, 0, &Estimate::try_from(prior)?)?))
    };
    assert_eq!(law(&late), "units do not decide");
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Defect {
    OnlyInOrder,
    KeepsKnowledge,
    LosesMotion,
    Narrows,
    WantsPoses,
    ForgetsWheels,
    WheelsTurnedAround,
    CountsTwice,
    TakesNonsense,
    NoNumber,
    TenPercentLight,
}

struct Planted {
    inner: FlightEstimator,
    defect: Defect,
    prior: Finding,
    start: RigidBodyState<f64>,
    said: i64,
}

impl Planted {
    fn told(&mut self, measurement: &Measurement) -> Reception {
        StateEstimator::measured(&mut self.inner, measurement)
    }
}

impl StateEstimator for Planted {
    fn acted(&mut self, acted: &Acted) {
        let stored_body = match self.defect {
            Defect::ForgetsWheels => Vector3::zeros(),
            Defect::WheelsTurnedAround => -acted.stored_body,
            _ => acted.stored_body,
        };
        StateEstimator::acted(&mut self.inner, &Acted { stored_body, ..*acted });
    }
    fn measured(&mut self, measurement: &Measurement) -> Reception {
        match self.defect {
            Defect::OnlyInOrder if measurement.stamp_ns < self.inner.newest_stamp_ns() => Reception::TooOld,
            Defect::WantsPoses if measurement.attitude.is_none() => Reception::Malformed { what: "no pose" },
            Defect::CountsTwice if measurement.stamp_ns == self.said => {
                let stamp_ns = measurement.stamp_ns - 1;
                self.told(&Measurement { stamp_ns, ..measurement.clone() })
            }
            Defect::TakesNonsense => {
                let reception = self.told(measurement);
                let malformed = matches!(reception, Reception::Malformed { .. });
                if malformed { Reception::Used { nis: 1.0 } } else { reception }
            }
            _ => {
                self.said = measurement.stamp_ns;
                self.told(measurement)
            }
        }
    }
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        StateEstimator::state_at(&self.inner, time_ns)
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        let found = self.inner.finding()?;
        let point = found.point().copied().unwrap();
        Ok(match self.defect {
            Defect::NoNumber => found.at(point * f64::NAN),
            Defect::TenPercentLight => found.at(point * 0.9),
            _ => found,
        })
    }
    fn health(&self) -> FlightHealth {
        StateEstimator::health(&self.inner)
    }
    fn newest_stamp_ns(&self) -> i64 {
        StateEstimator::newest_stamp_ns(&self.inner)
    }
    fn doubt(&mut self, doubt: &Doubt) {
        if self.defect == Defect::Narrows {
            let found = self.inner.finding().unwrap();
            let narrower = found.covariance().unwrap() * 0.5;
            let found = Finding::of_covariance(*found.point().unwrap(), &narrower, *found.magnitudes()).unwrap();
            StateEstimator::restart(&mut self.inner, &found).unwrap();
        } else {
            StateEstimator::doubt(&mut self.inner, doubt);
        }
    }
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError> {
        match self.defect {
            Defect::KeepsKnowledge => Ok(()),
            Defect::LosesMotion => {
                self.inner = joint(&self.start, &self.prior)?;
                Ok(())
            }
            _ => StateEstimator::restart(&mut self.inner, body),
        }
    }
    fn counts(&self) -> ReceptionCounts {
        StateEstimator::counts(&self.inner)
    }
    fn compensated(&self, wrench: &Wrench<f64>) -> Option<Wrench<f64>> {
        StateEstimator::compensated(&self.inner, wrench)
    }
}

#[test]
fn planted_defects_break_the_law_that_is_theirs() {
    let caught = [
        (Defect::OnlyInOrder, "the order of arrival is no matter"),
        (Defect::KeepsKnowledge, "a restart forgets"),
        (Defect::LosesMotion, "a restart keeps the motion"),
        (Defect::Narrows, "a doubt widens"),
        (Defect::WantsPoses, "a rate without a pose is used"),
        (Defect::ForgetsWheels, "stored momentum is accounted for"),
        (Defect::WheelsTurnedAround, "stored momentum is accounted for"),
        (Defect::CountsTwice, "duplicates change nothing"),
        (Defect::TakesNonsense, "what is no measurement changes nothing"),
        (Defect::NoNumber, "everything is finite"),
        (Defect::TenPercentLight, "exact data lead to the truth"),
    ];
    for (defect, law) in caught {
        let begin = |start: &RigidBodyState<f64>, prior: &Finding| -> Result<Box<dyn StateEstimator>, EstimatorError> {
            let inner = joint(start, prior)?;
            Ok(Box::new(Planted { inner, defect, prior: *prior, start: *start, said: i64::MIN }))
        };
        let broken = check_state_estimator(&begin, &short_trial()).expect_err(law);
        assert_eq!(broken.law, law, "{defect:?}: {broken}");
    }
}
