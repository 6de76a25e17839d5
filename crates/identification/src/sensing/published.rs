//! The other direction: the log that such sensors make of a true motion.

use super::{Delay, InertialErrors, Level, LocalizationErrors, Sensing};
use crate::dynamics::{BodyAcceleration, FreeFlyer, InertialParameters, Integrator, MuntheKaas4, RigidBodyState};
use crate::error::IdentificationError;
use crate::lie::{LieGroup, Pose, Twist, Wrench};
use crate::motion::MotionSample;
use crate::noise::{Gaussian, spread};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Share of a step within which two steps are equal.
const SAME: f64 = 1e-6;

/// What a body does at one time.
///
/// # Frame
/// As the names say; the twist in body axes, its velocity that of the body origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueMotion {
    /// Time, ns.
    pub time_ns: i64,
    /// Pose and twist.
    pub state: RigidBodyState<f64>,
    /// Acceleration under what acts from now on.
    pub acceleration: BodyAcceleration<f64>,
    /// The wrench that the robot believes to make until the next time, about the body origin.
    pub wrench_body: Wrench<f64>,
}

impl TrueMotion {
    /// A body from rest under a wrench that is held over each step, nothing else acting; it is asked for once for each step, in order.
    ///
    /// # Errors
    /// [`IdentificationError::Dynamics`] for a body or a wrench whose motion is not finite.
    pub fn flown(
        body: &InertialParameters<f64>,
        wrench_body: &dyn Fn(f64) -> Wrench<f64>,
        step_ns: i64,
        steps: usize,
    ) -> Result<Vec<Self>, IdentificationError> {
        let flyer = FreeFlyer::new(*body);
        let mut state = RigidBodyState { world_from_body: Pose::identity(), twist_body: Twist::zero() };
        let mut motion = Vec::with_capacity(steps);
        let mut time_ns = 0;
        for _ in 0..steps {
            let wrench_body = wrench_body(time_ns as f64 * 1e-9);
            let acceleration = flyer.forward(&state.twist_body, &wrench_body);
            motion.push(Self { time_ns, state, acceleration, wrench_body });
            state = MuntheKaas4.step(&flyer, &state, &wrench_body, 0.0, step_ns as f64 * 1e-9)?;
            time_ns += step_ns;
        }
        Ok(motion)
    }
}

/// Sources of chance, each with its own stream: one that is zero changes no other.
#[derive(Clone, Copy)]
enum Source {
    Position,
    Attitude,
    Velocity,
    Rate,
    Acceleration,
    Place,
}

fn dice(seed: u64, source: Source) -> Gaussian {
    Gaussian::from_seed(spread(seed).wrapping_add(source as u64))
}

fn stated(what: &'static str, level: Level) -> Result<f64, IdentificationError> {
    level.stated().ok_or(IdentificationError::ImpossibleSensing { what, value: f64::NAN })
}

/// White noise and wander of a stream of the localisation.
struct Slow {
    dice: Gaussian,
    white: f64,
    sigma: f64,
    time_s: f64,
    now: Vector3<f64>,
}

impl Slow {
    fn new(
        errors: &LocalizationErrors,
        [white, wander]: [&'static str; 2],
        mut dice: Gaussian,
    ) -> Result<Self, IdentificationError> {
        let unknown = IdentificationError::ImpossibleSensing { what: wander, value: f64::NAN };
        let (sigma, time_s) = errors.wander.stated().ok_or(unknown)?;
        Ok(Self { white: stated(white, errors.white)?, now: dice.vector(sigma), sigma, time_s, dice })
    }

    /// The error now; the next one is `step_s` later.
    fn error(&mut self, step_s: f64) -> Vector3<f64> {
        let error = self.now + self.dice.vector(self.white);
        let kept = libm::exp(-step_s / self.time_s);
        self.now = self.now * kept + self.dice.vector(self.sigma * (1.0 - kept * kept).sqrt());
        error
    }
}

fn drawn(delay: &Delay, dice: &mut Gaussian) -> f64 {
    delay.expected_s + delay.sigma_s * dice.normal()
}

/// A triad of the inertial unit, filtered, at the steps of the motion.
struct Triad {
    series: Vec<Vector3<f64>>,
    /// Noise of a row of a unit without a filter.
    white: f64,
    bias: Vector3<f64>,
    delay_s: f64,
    dice: Gaussian,
}

impl Triad {
    fn new(
        errors: &InertialErrors,
        what: &'static str,
        mut dice: Gaussian,
        truth: Vec<Vector3<f64>>,
        step_s: f64,
        rows_per_step: f64,
    ) -> Result<Self, IdentificationError> {
        let white = stated(what, errors.white)?;
        let gain = Matrix3::from_fn(|i, j| {
            let sigma = if i == j { errors.scale_sigma } else { errors.misalignment_sigma };
            f64::from(u8::from(i == j)) + sigma * dice.normal()
        });
        let bias = dice.vector(errors.bias_sigma);
        let delay_s = drawn(&errors.delay, &mut dice);
        let Some(filter) = &errors.filter else {
            let series = truth.into_iter().map(|v| gain * v).collect();
            return Ok(Self { series, white, bias, delay_s, dice });
        };
        if (filter.step_s() - step_s).abs() > SAME * step_s {
            let what = "step of a filter, s, beside another step of the motion,";
            return Err(IdentificationError::ImpossibleSensing { what, value: filter.step_s() });
        }
        // Noise goes through the filter; of a row its level is that of the density.
        let fine = white / rows_per_step.sqrt();
        let noisy: Vec<Vector3<f64>> = truth.into_iter().map(|v| gain * v + dice.vector(fine)).collect();
        let [x, y, z] = [0, 1, 2].map(|i| filter.filtered(&noisy.iter().map(|v| v[i]).collect::<Vec<_>>()));
        let series = (0..noisy.len()).map(|k| Vector3::new(x[k], y[k], z[k])).collect();
        Ok(Self { series, white: 0.0, bias, delay_s, dice })
    }

    fn at(&mut self, place: Option<Place>) -> Option<Vector3<f64>> {
        let noise = self.dice.vector(self.white);
        let Place { step, along } = place?;
        let here = self.series[step];
        let then = self.series.get(step + 1).unwrap_or(&here);
        Some(here + (then - here) * along + self.bias + noise)
    }
}

/// A time among the steps of a motion.
#[derive(Clone, Copy)]
struct Place {
    step: usize,
    along: f64,
}

impl Place {
    /// Where row `row` of age `age_s` finds its content; nowhere before the first and after the last.
    fn of(row: usize, age_s: f64, step_s: f64, steps: usize) -> Option<Self> {
        let place = row as f64 - age_s / step_s;
        let step = (place + SAME).floor();
        (step >= 0.0 && place <= (steps - 1) as f64)
            .then(|| Self { step: crate::likelihood::whole(step), along: (place - step).max(0.0) })
    }

    fn pose(self, motion: &[TrueMotion]) -> Pose<f64> {
        let here = &motion[self.step].state.world_from_body;
        let Some(next) = motion.get(self.step + 1).filter(|_| self.along > 0.0) else { return *here };
        let between: nalgebra::Vector6<f64> = LieGroup::log(&here.between(&next.state.world_from_body));
        here.compose(&Pose::exp(&(between * self.along)))
    }

    fn velocity(self, motion: &[TrueMotion]) -> Vector3<f64> {
        let of = |at: &TrueMotion| at.state.world_from_body.rotation * at.state.twist_body.linear;
        let here = of(&motion[self.step]);
        motion.get(self.step + 1).map_or(here, |next| here + (of(next) - here) * self.along)
    }
}

impl Sensing {
    /// The log of a motion as these sensors show it: one draw of all their errors.
    ///
    /// `rows` are the steps of the motion at which a row is published; its wrench is the mean until the next one. What has not happened yet, or
    /// lies before the motion, is missing in its row.
    /// A level that is [`About`](Level::About) is that; [`doubted_scale_sigma`](Self::doubted_scale_sigma) and
    /// [`unknown_filter_s`](InertialErrors::unknown_filter_s) are of estimation alone.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] for sensors that cannot be, a level that nobody states (its value is NaN), a filter
    /// whose step is not that of the motion; [`IdentificationError::TooFewSamples`], [`IdentificationError::TimesNotIncreasing`] for a motion
    /// of fewer than two times or of unequal steps, or rows beyond it.
    ///
    /// # Example
    /// ```
    /// use tumble_identification::dynamics::InertialParameters;
    /// use tumble_identification::lie::Wrench;
    /// use tumble_identification::nalgebra::{Matrix3, Vector3};
    /// use tumble_identification::sensing::{Delay, Level, Sensing, TrueMotion, Wander};
    /// let body = InertialParameters::about_com(10.0, Vector3::zeros(), Matrix3::identity());
    /// let push = |_: f64| Wrench::new(Vector3::zeros(), Vector3::x());
    /// let motion = TrueMotion::flown(&body, &push, 10_000_000, 200)?;
    /// let mut sensing = Sensing::default();
    /// for errors in [&mut sensing.position, &mut sensing.attitude, &mut sensing.velocity] {
    ///     *errors = tumble_identification::sensing::LocalizationErrors {
    ///         white: Level::Known(1e-9),
    ///         wander: Wander::Known { sigma: 0.0, time_s: 1.0 },
    ///     };
    /// }
    /// for errors in [&mut sensing.rate, &mut sensing.acceleration] {
    ///     (errors.white, errors.delay) = (Level::Known(1e-3), Delay::NONE);
    /// }
    /// sensing.pose_delay = Delay { expected_s: 0.05, sigma_s: 0.0 };
    /// let rows: Vec<usize> = (0..200).step_by(2).collect();
    /// let log = sensing.publish(&motion, &rows, &Vector3::zeros(), 7)?;
    /// assert!(log[2].world_from_body.is_none() && log[2].rate_body.is_some());
    /// // Half of 0.1 m/s^2 times the square of what has passed when a row is 0.05 s old.
    /// let x = log[50].world_from_body.unwrap().translation.x;
    /// assert!((x - 0.05 * 0.95_f64.powi(2)).abs() < 1e-6);
    /// # Ok::<(), tumble_identification::IdentificationError>(())
    /// ```
    pub fn publish(
        &self,
        motion: &[TrueMotion],
        rows: &[usize],
        gravity_world: &Vector3<f64>,
        seed: u64,
    ) -> Result<Vec<MotionSample>, IdentificationError> {
        self.check()?;
        let (step_s, rows_per_step) = steps(motion, rows)?;
        let mut places = dice(seed, Source::Place);
        let nominal = Vector3::from(self.lever_arm_body_m);
        let lever = nominal + places.vector(self.lever_arm_sigma_m);
        let taken_out = nominal + places.vector(self.lever_arm_taken_out_sigma_m);
        let pose_delay_s = drawn(&self.pose_delay, &mut places);
        let velocity_delay_s = self.velocity_delay.as_ref().map_or(pose_delay_s, |late| drawn(late, &mut places));
        let at_lever = |at: &TrueMotion| {
            let (w, dw) = (at.state.twist_body.angular, at.acceleration.angular_acceleration_body);
            let gravity = at.state.world_from_body.rotation.inverse() * gravity_world;
            at.acceleration.acceleration_origin_body + dw.cross(&lever) + w.cross(&w.cross(&lever)) - gravity
        };
        let mut position = Slow::new(
            &self.position,
            ["white noise of the position, m,", "wander of the position, m,"],
            dice(seed, Source::Position),
        )?;
        let mut attitude = Slow::new(
            &self.attitude,
            ["white noise of the attitude, rad,", "wander of the attitude, rad,"],
            dice(seed, Source::Attitude),
        )?;
        let mut velocity = Slow::new(
            &self.velocity,
            ["white noise of the velocity, m/s,", "wander of the velocity, m/s,"],
            dice(seed, Source::Velocity),
        )?;
        let rates = motion.iter().map(|at| at.state.twist_body.angular).collect();
        let forces = motion.iter().map(at_lever).collect();
        let triad =
            |errors, what, source, truth| Triad::new(errors, what, dice(seed, source), truth, step_s, rows_per_step);
        let mut rate = triad(&self.rate, "noise of the rate, rad/s,", Source::Rate, rates)?;
        let mut acceleration =
            triad(&self.acceleration, "noise of the acceleration, m/s^2,", Source::Acceleration, forces)?;
        let added = self.gravity_added_world_m_s2.map_or(*gravity_world, Vector3::from);
        let mut log = Vec::with_capacity(rows.len());
        for (i, &row) in rows.iter().enumerate() {
            let next = rows.get(i + 1).copied().unwrap_or(row + 1);
            let since_s = (next - row) as f64 * step_s;
            let [of_position, of_attitude, of_velocity] =
                [&mut position, &mut attitude, &mut velocity].map(|slow| slow.error(since_s));
            let at = |age_s: f64| Place::of(row, age_s, step_s, motion.len());
            let pose = at(pose_delay_s).map(|place| {
                let truth = place.pose(motion);
                let turned = truth.rotation * <UnitQuaternion<f64> as LieGroup>::exp(&of_attitude);
                Pose::from_parts((truth.translation.vector + of_position).into(), turned)
            });
            let rate_body = rate.at(at(rate.delay_s));
            let measured = acceleration.at(at(acceleration.delay_s));
            let turned = pose.map_or(motion[row].state.world_from_body.rotation, |pose| pose.rotation);
            let removed = rate_body.map_or_else(Vector3::zeros, |w| w.cross(&w.cross(&taken_out)));
            log.push(MotionSample {
                time_ns: motion[row].time_ns,
                world_from_body: pose,
                velocity_origin_world: at(velocity_delay_s).map(|place| place.velocity(motion) + of_velocity),
                rate_body,
                acceleration_origin_body: measured.map(|force| force - removed + turned.inverse() * added),
                wrench_body: Some(mean_wrench(&motion[row..next.min(motion.len())])),
                ..MotionSample::default()
            });
        }
        Ok(log)
    }
}

fn mean_wrench(motion: &[TrueMotion]) -> Wrench<f64> {
    let (mut torque, mut force) = (Vector3::zeros(), Vector3::zeros());
    for at in motion {
        torque += at.wrench_body.torque;
        force += at.wrench_body.force;
    }
    let share = 1.0 / motion.len().max(1) as f64;
    Wrench::new(torque * share, force * share)
}

/// Step of a motion, and rows per step of it.
fn steps(motion: &[TrueMotion], rows: &[usize]) -> Result<(f64, f64), IdentificationError> {
    let [first, second, ..] = motion else {
        return Err(IdentificationError::TooFewSamples { samples: motion.len(), needed: 2 });
    };
    let step_ns = second.time_ns - first.time_ns;
    let uneven = motion.windows(2).position(|pair| pair[1].time_ns - pair[0].time_ns != step_ns || step_ns <= 0);
    if let Some(index) = uneven.map(|i| i + 1) {
        return Err(IdentificationError::TimesNotIncreasing { index });
    }
    let beyond = rows.iter().position(|row| *row >= motion.len());
    let backwards = rows.windows(2).position(|pair| pair[1] <= pair[0]).map(|i| i + 1);
    if let Some(index) = beyond.or(backwards) {
        return Err(IdentificationError::TimesNotIncreasing { index });
    }
    let span = rows.last().zip(rows.first()).map_or(0, |(last, first)| last - first);
    let per_step = (rows.len().saturating_sub(1)) as f64 / span.max(1) as f64;
    Ok((step_ns as f64 * 1e-9, if per_step > 0.0 { per_step } else { 1.0 }))
}
