//! Robots and sensors drawn at random, of which `identify` is told nothing.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};
use tumble_dynamics::InertialParameters;
use tumble_identification::lie::Wrench;
use tumble_identification::noise::Gaussian;
use tumble_identification::sensing::{
    Delay, InertialErrors, Level, LinearFilter, LocalizationErrors, Sensing, TrueMotion, Wander,
};
use tumble_identification::{IdentificationError, MotionSample};

const STEP_NS: i64 = 4_000_000;
const STEP_S: f64 = 0.004;
/// Two minutes.
const STEPS: usize = 30_000;

/// Chance by its range.
struct Draw(Gaussian);

impl Draw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.uniform()
    }

    /// Each decade as likely as another.
    fn scale(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.0.uniform())
    }

    fn below(&mut self, share: f64) -> bool {
        self.0.uniform() < share
    }

    fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        let place = self.0.uniform() * all.len() as f64;
        let index = (0..all.len()).take_while(|i| *i as f64 <= place).last().unwrap_or(0);
        all[index]
    }

    /// None, a moving average, a low pass of first order, two of them.
    fn filter(&mut self) -> Result<Option<LinearFilter>, IdentificationError> {
        let kept = (-TAU * self.scale(1.5, 12.0) * STEP_S).exp();
        let low_pass = LinearFilter::try_new(&[1.0 - kept], &[1.0, -kept], STEP_S)?;
        let samples = self.one_of(&[4_usize, 8, 16, 32]);
        Ok(match self.one_of(&[0, 1, 2, 3]) {
            0 => None,
            1 => Some(LinearFilter::try_new(&vec![1.0; samples], &[1.0], STEP_S)?),
            2 => Some(low_pass),
            _ => Some(low_pass.then(&low_pass)?),
        })
    }

    fn localization(&mut self, white: f64, sigma: f64, time_s: f64) -> LocalizationErrors {
        LocalizationErrors {
            white: Level::Known(white * self.scale(0.4, 2.5)),
            wander: Wander::Known { sigma, time_s },
        }
    }

    fn unit(&mut self, white: f64, bias_sigma: f64, late_s: f64) -> Result<InertialErrors, IdentificationError> {
        Ok(InertialErrors {
            white: Level::Known(white * self.scale(0.3, 3.0)),
            filter: self.filter()?,
            bias_sigma,
            delay: Delay { expected_s: late_s, sigma_s: 0.0 },
            ..InertialErrors::default()
        })
    }

    /// Wander of 0.5 to 5 cm within 3 to 60 s, up to 0.3 s late, any filter.
    fn sensing(&mut self) -> Result<Sensing, IdentificationError> {
        let (sigma, time_s) = (self.scale(0.005, 0.05), self.scale(3.0, 60.0));
        let late_s = self.between(0.0, 0.3);
        let velocity_late_s = self.one_of(&[late_s, late_s + 0.05]);
        let unit_late_s = self.one_of(&[0.0, 0.02, late_s]);
        // A publisher takes the lever arm out where it is, or knows of none.
        let takes_out = self.below(0.5);
        let lever_arm_body = self.0.vector(if takes_out { 0.03 } else { 0.0 });
        Ok(Sensing {
            position: self.localization(1e-3, sigma, time_s),
            attitude: self.localization(1e-3, 0.5 * sigma, time_s),
            velocity: self.localization(2e-3, 0.1 * sigma, time_s),
            pose_delay: Delay { expected_s: late_s, sigma_s: 0.0 },
            velocity_delay: Some(Delay { expected_s: velocity_late_s, sigma_s: 0.0 }),
            rate: self.unit(3e-4, 5e-3, unit_late_s)?,
            acceleration: self.unit(4e-3, 0.03, unit_late_s)?,
            lever_arm_body_m: lever_arm_body.into(),
            lever_arm_sigma_m: if takes_out { 0.0 } else { 0.03 },
            lever_arm_taken_out_sigma_m: 0.0,
            ..Sensing::default()
        })
    }

    /// 2 to 50 kg, of a size that goes with it.
    fn body(&mut self) -> InertialParameters<f64> {
        let mass = self.scale(2.0, 50.0);
        let size = 0.13 * (mass / 10.0).cbrt();
        let center = self.0.vector(0.1 * size);
        let root = Matrix3::from_fn(|i, j| if i == j { size } else { 0.15 * size * self.0.normal() });
        let second = root * root.transpose() * mass;
        InertialParameters::about_com(mass, center, Matrix3::identity() * second.trace() - second)
    }

    /// Three tones about every axis; the largest acceleration is 4 cm/s^2 or so, the largest turning 0.15 rad/s^2.
    fn wrench(&mut self, body: &InertialParameters<f64>) -> impl Fn(f64) -> Wrench<f64> + use<> {
        let tones: Vec<[[f64; 2]; 3]> =
            (0..6).map(|_| [(); 3].map(|()| [TAU * self.scale(0.04, 0.35), self.between(0.0, TAU)])).collect();
        let force = 0.02 * body.mass;
        let torque = 0.05 * body.inertia_about_com().trace() / 3.0;
        move |t| {
            let wave = |i: usize| tones[i].iter().map(|[w, phase]| (w * t + phase).sin()).sum::<f64>();
            Wrench::new(Vector3::from_fn(|i, _| torque * wave(i)), Vector3::from_fn(|i, _| force * wave(i + 3)))
        }
    }

    /// 21 to 250 rows a second, a third of the logs at uneven times.
    fn rows(&mut self, steps: usize) -> Vec<usize> {
        let every = self.one_of(&[1_usize, 2, 4, 8, 12]);
        let uneven = every > 1 && self.below(0.33);
        let (mut rows, mut row) = (Vec::new(), 0);
        while row < steps {
            rows.push(row);
            row += if uneven { self.one_of(&[every - 1, every, every + 1]) } else { every };
        }
        rows
    }
}

/// A log and the body behind it. One in four lacks velocities, one in four accelerations, one in ten rates.
pub fn flown(seed: u64) -> Result<(Vec<MotionSample>, InertialParameters<f64>), IdentificationError> {
    let mut draw = Draw(Gaussian::from_seed(seed));
    let body = draw.body();
    let motion = TrueMotion::flown(&body, &draw.wrench(&body), STEP_NS, STEPS)?;
    let rows = draw.rows(STEPS);
    let mut log = draw.sensing()?.publish(&motion, &rows, &Vector3::zeros(), seed)?;
    let (velocities, accelerations, rates) = (draw.below(0.75), draw.below(0.75), draw.below(0.9));
    for sample in &mut log {
        sample.velocity_origin_world = sample.velocity_origin_world.filter(|_| velocities);
        sample.acceleration_origin_body = sample.acceleration_origin_body.filter(|_| accelerations);
        sample.rate_body = sample.rate_body.filter(|_| rates);
    }
    Ok((log, body))
}
