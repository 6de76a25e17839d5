//! Attitude loops flown with their worst allowed inertia, reference, noise, lag and disturbance: no bound of a certificate is ever exceeded.
//!
//! The body, its actuator and its kinematics are integrated here, with quaternions as plain numbers; only the torque comes from the crate.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts of steps")]

use nalgebra::{Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use tumble_dynamics::{BodyAcceleration, InertialParameters, PoseReference, RigidBodyState};
use tumble_lie::{Pose, Twist};
use tumble_planning::control::{
    AttitudeCertificate, AttitudeConditions, AttitudeController, AttitudeGains, AttitudeLaw, AttitudeLoop,
    AttitudeNoise, AttitudeTiming, InertiaInterval, ReferenceTurning, TorqueBudget,
};

const STEP_S: f64 = 0.016;
/// Integration steps per control step.
const FINE: usize = 2;
const FLIGHT_S: f64 = 24.0;
const PERIOD_S: f64 = 16.0;

struct Chance(ChaCha8Rng);

impl Chance {
    /// Between -1 and 1.
    fn next(&mut self) -> f64 {
        2.0 * f64::from(self.0.next_u32()) / f64::from(u32::MAX) - 1.0
    }

    fn direction(&mut self) -> Vector3<f64> {
        loop {
            let v = Vector3::new(self.next(), self.next(), self.next());
            if (0.01..1.0).contains(&v.norm_squared()) {
                return v.normalize();
            }
        }
    }

    /// Principal moments in the interval that a body can have, every third time at its ends.
    fn inertia(&mut self, least: f64, largest: f64) -> Matrix3<f64> {
        let is_vertex = self.next() < -0.3;
        let moments = loop {
            let moments = Vector3::from_fn(|_, _| {
                let share = 0.5 * (self.next() + 1.0);
                least + (largest - least) * if is_vertex { share.round() } else { share }
            });
            if 2.0 * moments.max() <= moments.sum() {
                break moments;
            }
        };
        let turn = Rotation3::new(self.direction() * 3.0).into_inner();
        turn * Matrix3::from_diagonal(&moments) * turn.transpose()
    }
}

/// A flight's circumstances.
struct Flight {
    law: AttitudeLaw,
    gains: AttitudeGains,
    interval: (f64, f64),
    timing: AttitudeTiming,
    rate: f64,
    noise: AttitudeNoise,
    /// Half of it comes from a force beside the true centre of mass.
    disturbance: f64,
}

/// Largest vector part, rate, combined error and commanded torque.
#[derive(Debug, Default, Clone, Copy)]
struct Worst {
    vector: f64,
    rate: f64,
    combined: f64,
    torque: f64,
}

impl Flight {
    fn turning(&self) -> ReferenceTurning {
        let pulse = core::f64::consts::TAU / PERIOD_S;
        ReferenceTurning {
            rate_rad_s: self.rate,
            acceleration_rad_s2: 0.5 * self.rate * pulse,
            jerk_rad_s3: 0.5 * self.rate * pulse * pulse,
        }
    }

    fn certificate(&self) -> AttitudeCertificate {
        let (law, timing, noise) = (self.law, self.timing, self.noise);
        let conditions = AttitudeConditions { law, timing, noise, turning: self.turning() };
        let interval = InertiaInterval::between(self.interval.0, self.interval.1).unwrap();
        let budget = TorqueBudget { limit_n_m: 1.0, feed_forward_n_m: 0.0 };
        AttitudeLoop::try_new(self.gains, interval, &conditions).unwrap().certify(self.disturbance, &budget).unwrap()
    }

    /// The reference turns about one axis, from rest, in swells.
    fn reference(&self, axis: &Vector3<f64>, time_s: f64) -> PoseReference {
        let pulse = core::f64::consts::TAU / PERIOD_S;
        let angle = 0.5 * self.rate * (time_s - f64::sin(pulse * time_s) / pulse);
        let rate = 0.5 * self.rate * (1.0 - f64::cos(pulse * time_s));
        let acceleration = 0.5 * self.rate * pulse * f64::sin(pulse * time_s);
        PoseReference {
            state: RigidBodyState {
                world_from_body: Pose::from_parts(Translation3::identity(), UnitQuaternion::new(axis * angle)),
                twist_body: Twist::new(axis * rate, Vector3::zeros()),
            },
            acceleration: BodyAcceleration {
                angular_acceleration_body: axis * acceleration,
                acceleration_origin_body: Vector3::zeros(),
            },
        }
    }

    fn fly(&self, run: usize, chance: &mut Chance, bound: &AttitudeCertificate) -> Worst {
        let (least, largest) = self.interval;
        let (inertia, believed) = (chance.inertia(least, largest), chance.inertia(least, largest));
        let inverse = inertia.try_inverse().unwrap();
        let (mass, believed_center) = (9.0, chance.direction() * 0.1);
        let offset = 0.02;
        let center = believed_center + chance.direction() * offset;
        let force = chance.direction() * (0.5 * self.disturbance / offset);
        let body = InertialParameters::about_com(mass, believed_center, believed);
        let controller = AttitudeController { law: self.law, gains: self.gains, body, torque_limit_n_m: f64::INFINITY };
        // feedback alone does not know the force: it gets none
        let force = if self.law == AttitudeLaw::Geometric { force } else { Vector3::zeros() };
        let direct = if self.law == AttitudeLaw::Geometric { 0.5 * self.disturbance } else { self.disturbance };
        let axis = chance.direction();
        let corner = self.gains.corner_per_s();

        let vector = if run.is_multiple_of(2) { Vector3::zeros() } else { chance.direction() * bound.vector };
        let combined = if run.is_multiple_of(2) { Vector3::zeros() } else { chance.direction() * bound.start_rad_s };
        let mut attitude = Quaternion::from_parts(f64::sqrt(1.0 - vector.norm_squared()), vector);
        let mut rate = combined - vector * corner;
        let (mut torque, mut acting_force) = (Vector3::zeros(), Vector3::zeros());
        let late = (self.timing.delay_s / STEP_S).round() as usize;
        let mut commands = vec![(Vector3::zeros(), Vector3::zeros()); late];
        let mut push = chance.direction() * direct;
        let fine_s = STEP_S / FINE as f64;
        let kept = if self.timing.lag_s > 0.0 { f64::exp(-fine_s / self.timing.lag_s) } else { 0.0 };
        let mut worst = Worst::default();
        let steps = (FLIGHT_S / STEP_S) as usize;
        for step in 0..steps {
            for part in 0..FINE {
                let time_s = (step * FINE + part) as f64 * fine_s;
                let reference = self.reference(&axis, time_s);
                let wanted = reference.state.world_from_body.rotation.into_inner();
                // error by hand: conj(wanted) * attitude, the rate carried by the matrix
                let error = wanted.conjugate() * attitude;
                let error = if error.w < 0.0 { -error } else { error };
                let carried = UnitQuaternion::new_unchecked(error).inverse().to_rotation_matrix()
                    * reference.state.twist_body.angular;
                let (vector, rate_error) = (error.imag(), rate - carried);
                let combined = rate_error + vector * corner;
                worst.vector = worst.vector.max(vector.norm());
                worst.rate = worst.rate.max(rate_error.norm());
                worst.combined = worst.combined.max(combined.norm());
                if part == 0 {
                    // half the flights are misled steadily, to the side they are pushed to
                    let misled = if run % 8 < 4 { -push.normalize() } else { chance.direction() };
                    let tilt = UnitQuaternion::new(misled * self.noise.angle_rad);
                    let measured = RigidBodyState {
                        world_from_body: Pose::from_parts(
                            Translation3::identity(),
                            UnitQuaternion::new_unchecked(attitude) * tilt,
                        ),
                        twist_body: Twist::new(rate + misled * self.noise.rate_rad_s, Vector3::zeros()),
                    };
                    let found = controller.torque_body(&measured, &reference, &force);
                    worst.torque = worst.torque.max(found.feedback_n_m.norm());
                    commands.push((found.torque_n_m, force));
                    let along = match run / 2 % 4 {
                        0 => Some(combined),
                        1 => Some(vector + rate_error),
                        2 if step % 500 == 499 => Some(-push),
                        3 if step % 50 == 49 => Some(chance.direction()),
                        _ => None,
                    };
                    if let Some(along) = along.filter(|along| along.norm() > 1e-9) {
                        push = along.normalize() * direct;
                    }
                }
                let (command, command_force) = commands[step];
                torque = command + (torque - command) * kept;
                acting_force = command_force + (acting_force - command_force) * kept;
                let about_center = torque - center.cross(&acting_force) + push;
                let slope = |rate: &Vector3<f64>| inverse * (about_center - rate.cross(&(inertia * rate)));
                let middle = rate + slope(&rate) * (0.5 * fine_s);
                rate += slope(&middle) * fine_s;
                attitude += attitude * Quaternion::from_imag(middle) * (0.5 * fine_s);
                attitude /= attitude.norm();
            }
        }
        worst
    }
}

/// Flies every circumstance and holds the largest of what happens against its bounds; returns the least ratio of what happens to a bound.
fn hold(flights: &[Flight], runs: usize) -> f64 {
    let mut chance = Chance(ChaCha8Rng::seed_from_u64(8));
    let mut least = f64::INFINITY;
    for (index, flight) in flights.iter().enumerate() {
        let bound = flight.certificate();
        let mut reached = 0.0_f64;
        for run in 0..runs {
            let worst = flight.fly(run, &mut chance, &bound);
            assert!(worst.vector <= bound.vector * (1.0 + 1e-12), "{index}, {run}: {worst:?} {bound:?}");
            assert!(worst.rate <= bound.rate_rad_s, "{index}, {run}: {worst:?} {bound:?}");
            assert!(worst.combined <= bound.combined_rad_s, "{index}, {run}: {worst:?} {bound:?}");
            assert!(worst.torque <= bound.feedback_n_m, "{index}, {run}: {worst:?} {bound:?}");
            if run.is_multiple_of(2) {
                reached = reached.max(worst.vector / bound.vector);
            }
        }
        println!("{index}: {reached} of {bound:?}");
        least = least.min(reached);
    }
    least
}

const QUIET: AttitudeNoise = AttitudeNoise { angle_rad: 0.0, rate_rad_s: 0.0 };
const NOISY: AttitudeNoise = AttitudeNoise { angle_rad: 0.004, rate_rad_s: 0.001 };

fn flight(law: AttitudeLaw, gains: (f64, f64), interval: (f64, f64), late: (f64, f64)) -> Flight {
    Flight {
        law,
        gains: AttitudeGains { stiffness_n_m: gains.0, damping_n_m_s: gains.1 },
        interval,
        timing: AttitudeTiming { step_s: STEP_S, delay_s: late.0 * STEP_S, lag_s: late.1 },
        rate: 0.0,
        noise: QUIET,
        disturbance: 0.002,
    }
}

#[test]
fn at_rest_the_bounds_hold_and_are_at_most_five_times_too_wide() {
    let mut flights = Vec::new();
    for law in [AttitudeLaw::Feedback, AttitudeLaw::Geometric] {
        for late in [(0.0, 0.0), (0.0, 0.1), (5.0, 0.05)] {
            flights.push(flight(law, (0.1, 0.2), (0.143, 0.162), late));
            flights.push(flight(law, (0.15, 0.4), (0.0715, 0.243), late));
            flights.push(flight(law, (0.15, 0.6), (0.15, 0.45), late));
        }
    }
    let reached = hold(&flights, 16);
    assert!(reached > 0.2, "{reached}");
}

#[test]
fn turning_and_noise_are_covered() {
    let mut flights = Vec::new();
    for late in [(0.0, 0.0), (3.0, 0.05)] {
        for law in [AttitudeLaw::Feedback, AttitudeLaw::Geometric] {
            let known = flight(law, (0.15, 0.4), (0.15, 0.17), late);
            flights.push(Flight { rate: 0.1, noise: NOISY, ..known });
            let wide = flight(law, (0.15, 0.6), (0.12, 0.24), late);
            flights.push(Flight { rate: 0.05, noise: NOISY, disturbance: 0.001, ..wide });
        }
    }
    let reached = hold(&flights, 12);
    assert!(reached > 0.15, "{reached}");
}
