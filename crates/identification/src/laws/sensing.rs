//! Laws of a description of sensors, held against what makes their logs.

use super::broken_unless;
use super::recursive_estimator::violation;
use crate::FlightLikelihood;
use crate::dynamics::InertialParameters;
use crate::lie::Wrench;
use crate::motion::MotionSample;
use crate::sensing::{Level, Sensing, TrueMotion, Wander};
use nalgebra::Vector3;
use std::vec::Vec;
use tumble_lie::laws::{LawViolation, require};

/// Flights that the laws make up, each seen by the sensors with another seed.
#[derive(Clone, Debug)]
pub struct SensingTrial {
    /// The true body.
    pub body: InertialParameters<f64>,
    /// Largest torque and force, N m and N: enough to determine all ten parameters beside the noise.
    pub wrench: [f64; 2],
    /// Step of the true motion and of the wrench, ns; that of the filters where there are some.
    pub step_ns: i64,
    /// Steps flown; half a minute at least.
    pub steps: usize,
    /// Seeds; twelve tell a squared error of 1 from one of 1.5.
    pub seeds: core::ops::Range<u64>,
}

/// A simulator of sensors: the log of a motion, with all errors drawn from a seed. Yours, or [`Sensing::publish`].
pub type Publish<'a> = &'a dyn Fn(&[TrueMotion], u64) -> Vec<MotionSample>;

/// Factor by which a level found may differ from that stated.
const SAME_LEVEL: f64 = 1.3;
/// The same of the rate of a wander, which a record tells less well.
const SAME_WANDER: f64 = 2.0;
/// Correlation between neighbouring segments, across which a filter reaches, and between others.
const NEIGHBOURS: f64 = 0.35;
const APART: f64 = 0.1;
/// Share by which squared errors may differ from those stated beside chance: levels are found, and the model is linear in small errors.
const SLACK: f64 = 0.15;

/// Whether a description of sensors and a simulator of them are of the same sensors: the true body is found with errors as large as stated.
///
/// # Errors
/// The first broken law: `sensors can be as described`, `same seed, same log`, `another seed, another log`,
/// `a good record is answered`, `noise is as stated`, `wander is as stated`, `biases, gains and delays are as large as stated`,
/// `errors are as large as stated`, `what is left of rate and acceleration is white`.
///
/// # Example
/// A robot whose velocities are twice as noisy as its description says:
/// ```
/// use tumble_identification::dynamics::InertialParameters;
/// use tumble_identification::laws::{SensingTrial, check_sensing};
/// use tumble_identification::nalgebra::{Matrix3, Vector3};
/// use tumble_identification::sensing::{Delay, Level, LocalizationErrors, Sensing, TrueMotion, Wander};
/// let localized = LocalizationErrors { white: Level::Known(1e-3), wander: Wander::Known { sigma: 0.01, time_s: 10.0 } };
/// let mut described = Sensing { position: localized, attitude: localized, velocity: localized, ..Sensing::default() };
/// (described.pose_delay, described.velocity_delay) = (Delay::NONE, Some(Delay::NONE));
/// (described.lever_arm_sigma_m, described.lever_arm_taken_out_sigma_m) = (0.0, 0.0);
/// for unit in [&mut described.rate, &mut described.acceleration] {
///     (unit.white, unit.delay, unit.unknown_filter_s) = (Level::Known(1e-3), Delay::NONE, 0.0);
/// }
/// let mut real = described.clone();
/// real.velocity.white = Level::Known(2e-3);
/// let published = |motion: &[TrueMotion], seed: u64| {
///     let rows: Vec<usize> = (0..motion.len()).collect();
///     real.publish(motion, &rows, &Vector3::zeros(), seed).unwrap_or_default()
/// };
/// let body = InertialParameters::about_com(9.6, Vector3::new(0.01, 0.0, 0.0), Matrix3::identity() * 0.15);
/// let trial = SensingTrial { body, wrench: [0.015, 0.25], step_ns: 16_000_000, steps: 2500, seeds: 1..3 };
/// assert_eq!(check_sensing(&described, &published, &trial).unwrap_err().law, "noise is as stated");
/// ```
pub fn check_sensing(sensing: &Sensing, publish: Publish<'_>, trial: &SensingTrial) -> Result<(), LawViolation> {
    let law = "sensors can be as described";
    sensing.check().map_err(|error| LawViolation { found: error.to_string(), ..violation(law, String::new(), &"") })?;
    let motion = trial.motion()?;
    let first = trial.seeds.start;
    let (log, again, other) = (publish(&motion, first), publish(&motion, first), publish(&motion, first + 1));
    require("same seed, same log", &first, &"the same", &"another", broken_unless(log == again), 0.0)?;
    require("another seed, another log", &first, &"another", &"the same", broken_unless(log != other), 0.0)?;
    let told = FlightLikelihood { sensing: sensing.clone(), ..FlightLikelihood::default() };
    let mut seen = Seen::default();
    for seed in trial.seeds.clone() {
        seen.add(&told, &publish(&motion, seed), &trial.body, seed)?;
    }
    seen.levels()?;
    seen.constants()?;
    seen.errors()?;
    seen.whiteness()
}

impl SensingTrial {
    fn motion(&self) -> Result<Vec<TrueMotion>, LawViolation> {
        let [torque, force] = self.wrench;
        // Two tones about every axis, each in its own time.
        let wave = |t: f64, i: usize| {
            let w = core::f64::consts::TAU * [0.11, 0.17, 0.13, 0.19, 0.23, 0.29][i];
            0.6 * (w * t).sin() + 0.4 * (2.3 * w * t + i as f64).cos()
        };
        let wrench = |t: f64| {
            Wrench::new(Vector3::from_fn(|i, _| torque * wave(t, i)), Vector3::from_fn(|i, _| force * wave(t, i + 3)))
        };
        TrueMotion::flown(&self.body, &wrench, self.step_ns, self.steps)
            .map_err(|error| violation("the trial can be flown", String::new(), &error))
    }
}

/// What was found over the seeds.
#[derive(Default)]
struct Seen {
    runs: f64,
    squared: f64,
    free: f64,
    /// Logarithms of found over stated: white noise of five streams, rate of three wanders.
    white: [f64; 5],
    wander: [f64; 3],
    /// Squares of what was found of biases, gains and delays of poses, in stated standard deviations, and their number.
    constants: [(f64, f64); 4],
    /// Autocorrelation of what is left of rate and acceleration, summed over the seeds, distance by distance in segments.
    correlation: [Vec<f64>; 2],
}

impl Seen {
    fn add(
        &mut self,
        told: &FlightLikelihood,
        log: &[MotionSample],
        truth: &InertialParameters<f64>,
        seed: u64,
    ) -> Result<(), LawViolation> {
        let failed = |error| violation(super::estimator::ANSWERED, format!("seed {seed}"), &error);
        let found = told.estimate(log).map_err(failed)?;
        let unanswered = broken_unless(found.is_determined() || found.planar);
        let law = super::estimator::ANSWERED;
        require(law, &seed, &"all ten parameters", &found.determined, unanswered, 0.0)?;
        let (squared, free) = found.squared_error(truth);
        self.squared += squared;
        self.free += free as f64;
        let stated = &told.sensing;
        let mut add = |i: usize, found: f64, sigma: f64| {
            if sigma > 0.0 {
                self.constants[i].0 += (found / sigma).powi(2);
                self.constants[i].1 += 1.0;
            }
        };
        let of_unit = [
            (&stated.rate, found.rate_bias, found.rate_gain),
            (&stated.acceleration, found.acceleration_bias, found.acceleration_gain),
        ];
        for (i, (stated, bias, gain)) in of_unit.into_iter().enumerate() {
            bias.iter().for_each(|bias| add(i, *bias, stated.bias_sigma));
            for (k, gain) in gain.iter().enumerate() {
                add(2, *gain, if k % 4 == 0 { stated.scale_sigma } else { stated.misalignment_sigma });
            }
        }
        if let Some(delay) = found.delays[0] {
            add(3, delay.value_s - stated.pose_delay.expected_s, stated.pose_delay.sigma_s);
        }
        let open = FlightLikelihood { sensing: without_levels(&told.sensing), ..told.clone() };
        let levels = open.estimate(log).map_err(failed)?.levels;
        let whites = [
            stated.position.white,
            stated.attitude.white,
            stated.velocity.white,
            stated.rate.white,
            stated.acceleration.white,
        ];
        for (sum, (found, stated)) in self.white.iter_mut().zip(levels.white.iter().zip(whites)) {
            *sum += if *found > 0.0 { libm::log(found / stated.or(*found)) } else { 0.0 };
        }
        let wanders = [stated.position.wander, stated.attitude.wander, stated.velocity.wander];
        for (sum, ((sigma, time_s), stated)) in self.wander.iter_mut().zip(levels.wander.into_iter().zip(wanders)) {
            let (stated_sigma, stated_time_s) = stated.or(sigma, time_s);
            let rate = |sigma: f64, time_s: f64| sigma * sigma / time_s;
            let both = rate(sigma, time_s) > 0.0 && stated_sigma > 0.0;
            *sum += if both { libm::log(rate(sigma, time_s) / rate(stated_sigma, stated_time_s)) } else { 0.0 };
        }
        for (sums, whiteness) in self.correlation.iter_mut().zip(found.whiteness.iter().flatten()) {
            sums.resize(whiteness.autocorrelation.len(), 0.0);
            sums.iter_mut().zip(&whiteness.autocorrelation).for_each(|(sum, rho)| *sum += rho);
        }
        self.runs += 1.0;
        Ok(())
    }

    fn levels(&self) -> Result<(), LawViolation> {
        for (what, sum) in ["position", "attitude", "velocity", "rate", "acceleration"].iter().zip(self.white) {
            let factor = libm::exp((sum / self.runs).abs());
            require("noise is as stated", what, &1.0, &libm::exp(sum / self.runs), factor, SAME_LEVEL)?;
        }
        for (what, sum) in ["position", "attitude", "velocity"].iter().zip(self.wander) {
            let factor = libm::exp((sum / self.runs).abs());
            require("wander is as stated", what, &1.0, &libm::exp(sum / self.runs), factor, SAME_WANDER)?;
        }
        Ok(())
    }

    fn constants(&self) -> Result<(), LawViolation> {
        let whats = ["biases of the rate", "biases of the acceleration", "gains", "delays of poses"];
        for (what, (squares, count)) in whats.iter().zip(self.constants) {
            if count > 0.0 {
                let limit = 1.0 + SLACK + 3.0 * (2.0 / count).sqrt();
                let law = "biases, gains and delays are as large as stated";
                require(law, &(what, "squared"), &"at most 1", &(squares / count), squares / count, limit)?;
            }
        }
        Ok(())
    }

    fn errors(&self) -> Result<(), LawViolation> {
        let mean = self.squared / self.free;
        let band = SLACK + 3.0 * (2.0 / self.free).sqrt();
        require("errors are as large as stated", &"squared, per parameter", &1.0, &mean, (mean - 1.0).abs(), band)
    }

    fn whiteness(&self) -> Result<(), LawViolation> {
        let law = "what is left of rate and acceleration is white";
        for (what, sums) in ["rate", "acceleration"].iter().zip(&self.correlation) {
            for (distance, sum) in (1_usize..).zip(sums) {
                let correlation = sum / self.runs;
                let limit = if distance == 1 { NEIGHBOURS } else { APART };
                require(law, &(what, distance, "segments apart"), &0.0, &correlation, correlation.abs(), limit)?;
            }
        }
        Ok(())
    }
}

/// The same sensors, their noise and wander left to the record.
fn without_levels(sensing: &Sensing) -> Sensing {
    let mut open = sensing.clone();
    for errors in [&mut open.position, &mut open.attitude, &mut open.velocity] {
        (errors.white, errors.wander) = (Level::Unknown, Wander::Unknown);
    }
    (open.rate.white, open.acceleration.white) = (Level::Unknown, Level::Unknown);
    open
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensing::{Delay, LinearFilter, LocalizationErrors};
    use nalgebra::Matrix3;

    const STEP_NS: i64 = 8_000_000;

    fn trial() -> SensingTrial {
        let inertia = Matrix3::new(0.153, 0.004, -0.003, 0.004, 0.142, 0.006, -0.003, 0.006, 0.166);
        SensingTrial {
            body: InertialParameters::about_com(9.6, Vector3::new(0.012, -0.007, 0.009), inertia),
            wrench: [0.015, 0.25],
            step_ns: STEP_NS,
            steps: 5000,
            seeds: 1..13,
        }
    }

    fn sensors() -> Sensing {
        let errors = |white, sigma, time_s| LocalizationErrors {
            white: Level::Known(white),
            wander: Wander::Known { sigma, time_s },
        };
        let mut sensing = Sensing {
            position: errors(1e-3, 0.02, 10.0),
            attitude: errors(1e-3, 0.01, 6.0),
            velocity: errors(2e-3, 2e-3, 10.0),
            pose_delay: Delay { expected_s: 0.05, sigma_s: 0.01 },
            velocity_delay: Some(Delay { expected_s: 0.02, sigma_s: 0.0 }),
            lever_arm_body_m: [0.03, -0.02, 0.01],
            lever_arm_sigma_m: 0.005,
            lever_arm_taken_out_sigma_m: 0.01,
            ..Sensing::default()
        };
        (sensing.rate.white, sensing.acceleration.white) = (Level::Known(2e-4), Level::Known(5e-3));
        for triad in [&mut sensing.rate, &mut sensing.acceleration] {
            triad.filter = Some(LinearFilter::try_new(&[0.1, 0.1], &[1.0, -0.8], 0.008).unwrap());
            (triad.delay, triad.unknown_filter_s) = (Delay::NONE, 0.0);
            (triad.scale_sigma, triad.misalignment_sigma) = (0.01, 0.005);
        }
        sensing
    }

    fn published(sensing: &Sensing, every: usize) -> impl Fn(&[TrueMotion], u64) -> Vec<MotionSample> {
        let sensing = sensing.clone();
        move |motion, seed| {
            let rows: Vec<usize> = (0..motion.len()).step_by(every).collect();
            sensing.publish(motion, &rows, &Vector3::zeros(), seed).unwrap()
        }
    }

    #[test]
    fn the_simulation_of_a_description_keeps_its_laws() {
        for every in [1, 5] {
            let sensing = sensors();
            check_sensing(&sensing, &published(&sensing, every), &trial()).unwrap();
        }
    }

    /// Logs of sensors that differ from their description in one thing break a law.
    #[test]
    fn each_term_that_a_description_leaves_out_is_caught() {
        let broken = |what: &str, change: fn(&mut Sensing)| {
            let mut real = sensors();
            change(&mut real);
            let few = SensingTrial { seeds: 21..23, ..trial() };
            let law = check_sensing(&sensors(), &published(&real, 2), &few).unwrap_err().law;
            println!("{what}: {law}");
            law
        };
        assert_eq!(broken("white noise", |s| s.velocity.white = Level::Known(3e-3)), "noise is as stated");
        assert_eq!(broken("noise of the unit", |s| s.rate.white = Level::Known(3e-4)), "noise is as stated");
        let law = broken("wander", |s| s.position.wander = Wander::Known { sigma: 0.04, time_s: 10.0 });
        assert_eq!(law, "wander is as stated");
        for (what, change) in [
            ("gains", (|s: &mut Sensing| s.acceleration.misalignment_sigma = 0.1) as fn(&mut Sensing)),
            ("bias", |s| s.rate.bias_sigma = 1.0),
            ("delay of poses", |s| s.pose_delay.expected_s = 0.2),
            ("delay of the unit", |s| s.acceleration.delay.expected_s = 0.1),
            ("filter", |s| s.acceleration.filter = None),
            ("lever arm", |s| s.lever_arm_sigma_m = 0.5),
            ("lever arm taken out", |s| s.lever_arm_taken_out_sigma_m = 1.0),
            ("gravity", |s| s.gravity_added_world_m_s2 = Some([0.0, 0.0, 1.0])),
        ] {
            broken(what, change);
        }
    }

    #[test]
    fn chance_that_is_not_the_seeds_is_caught() {
        let sensing = sensors();
        let of = published(&sensing, 2);
        let law = |publish: Publish<'_>| check_sensing(&sensing, publish, &trial()).unwrap_err().law;
        let calls = core::cell::Cell::new(0);
        let other_each_time = |motion: &[TrueMotion], _: u64| {
            calls.set(calls.get() + 1);
            of(motion, calls.get())
        };
        assert_eq!(law(&other_each_time), "same seed, same log");
        assert_eq!(law(&|motion: &[TrueMotion], _: u64| of(motion, 1)), "another seed, another log");
        assert_eq!(
            law(&|_: &[TrueMotion], seed: u64| of(&trial().motion().unwrap()[..40], seed)),
            "a good record is answered"
        );
        let mut impossible = sensors();
        impossible.rate.bias_sigma = -1.0;
        let law = check_sensing(&impossible, &published(&sensors(), 2), &trial()).unwrap_err();
        assert!(law.law == "sensors can be as described" && law.found.contains("bias"), "{law}");
    }
}
