//! One attitude loop, flown: an independent body, actuator and controller, in plain numbers.
//!
//! Principal axes, scalar-first quaternions, the midpoint rule; nothing of the crates.

use crate::local_cases::Xorshift;

type Vector = [f64; 3];

/// Integration steps per control step.
const FINE: usize = 2;
/// Ways to push.
pub const POLICIES: usize = 9;

/// What is flown.
pub struct Circumstances {
    pub stiffness: f64,
    pub damping: f64,
    /// Least and largest moment of inertia.
    pub inertia: (f64, f64),
    /// Whether the believed gyroscopic torque is fed forward.
    pub is_fed_forward: bool,
    pub step_s: f64,
    /// Delay in control steps.
    pub delay: usize,
    pub lag_s: f64,
    pub disturbance: f64,
    /// Largest vector part and combined error at the start.
    pub start: (f64, f64),
}

/// Largest of what happened.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Happened {
    /// Vector part of the attitude error.
    pub vector: f64,
    /// Angular velocity, rad/s.
    pub rate: f64,
    /// `w + stiffness / damping vec`, rad/s.
    pub combined: f64,
    /// Commanded feedback torque, N m.
    pub feedback: f64,
    /// Commanded torque, N m.
    pub torque: f64,
    /// The vector part at the end.
    pub last: f64,
}

impl Happened {
    pub fn largest(self, other: Self) -> Self {
        Self {
            vector: self.vector.max(other.vector),
            rate: self.rate.max(other.rate),
            combined: self.combined.max(other.combined),
            feedback: self.feedback.max(other.feedback),
            torque: self.torque.max(other.torque),
            last: self.last.max(other.last),
        }
    }
}

fn add(a: Vector, b: Vector, factor: f64) -> Vector {
    [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm(a: Vector) -> f64 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
}

fn scaled(a: Vector, b: Vector) -> Vector {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

fn direction(chance: &mut Xorshift) -> Vector {
    loop {
        let drawn = [chance.next(), chance.next(), chance.next()];
        let size = norm(drawn);
        if (0.1..1.0).contains(&size) {
            return drawn.map(|x| x / size);
        }
    }
}

/// Moments that a body can have; in a third of the runs each at one end of the interval.
fn moments(chance: &mut Xorshift, (least, largest): (f64, f64), is_vertex: bool) -> Vector {
    loop {
        let drawn = [(); 3].map(|()| {
            let share = 0.5 * (chance.next() + 1.0);
            least + (largest - least) * if is_vertex { share.round() } else { share }
        });
        if 2.0 * drawn.iter().copied().fold(0.0, f64::max) <= drawn.iter().sum::<f64>() + 1e-12 {
            return drawn;
        }
    }
}

/// A tensor with moments in the interval, in axes of its own: its columns.
fn believed(chance: &mut Xorshift, interval: (f64, f64)) -> [Vector; 3] {
    let moments = moments(chance, interval, true);
    let (x, y) = (direction(chance), direction(chance));
    let z = cross(x, y);
    let size = norm(z).max(1e-9);
    let z = z.map(|value| value / size);
    let axes = [x, cross(z, x), z];
    let mut columns = [[0.0; 3]; 3];
    for (axis, moment) in axes.iter().zip(moments) {
        for (column, share) in columns.iter_mut().zip(axis) {
            *column = add(*column, *axis, moment * share);
        }
    }
    columns
}

fn apply(columns: &[Vector; 3], v: Vector) -> Vector {
    add(add(columns[0].map(|x| x * v[0]), columns[1], v[1]), columns[2], v[2])
}

impl Circumstances {
    /// One run from rest (even) or from the edge or inside of where starts are admitted (odd).
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts of steps")]
    pub fn fly(&self, run: usize, time_s: f64, chance: &mut Xorshift) -> Happened {
        let corner = self.stiffness / self.damping;
        let inertia = moments(chance, self.inertia, run.is_multiple_of(3));
        let inverse = inertia.map(|moment| 1.0 / moment);
        let believed = believed(chance, self.inertia);
        let policy = run / 2 % POLICIES;
        let mut push = direction(chance).map(|x| x * self.disturbance);
        let (change, look_ahead) = (1.0 + 10.0 * (1.0 + chance.next()), 1.5 * (1.0 + chance.next()));
        let (mut vector, mut rate) = ([0.0; 3], [0.0; 3]);
        if run % 2 == 1 {
            let shares = [(); 2].map(|()| (1.0 + chance.next()).min(1.0));
            vector = direction(chance).map(|x| x * shares[0] * self.start.0);
            rate = add(direction(chance).map(|x| x * shares[1] * self.start.1), vector, -corner);
        }
        let mut scalar = (1.0 - vector.iter().map(|x| x * x).sum::<f64>()).sqrt();
        let fine_s = self.step_s / FINE as f64;
        let kept = if self.lag_s > 0.0 { (-fine_s / self.lag_s).exp() } else { 0.0 };
        // what the lag passes on average of a fine step
        let passed = if self.lag_s > 0.0 { 1.0 - self.lag_s / fine_s * (1.0 - kept) } else { 1.0 };
        let (mut commands, mut acting) = (vec![[0.0; 3]; self.delay + 1], [0.0; 3]);
        let mut happened = Happened::default();
        let steps = (time_s / self.step_s).round() as usize;
        let (period, short) = ((change / self.step_s).round() as usize, (0.5 / self.step_s).round() as usize);
        for step in 0..steps {
            let combined = add(rate, vector, corner);
            let feedback = combined.map(|x| -self.damping * x);
            let gyroscopic = if self.is_fed_forward { cross(rate, apply(&believed, rate)) } else { [0.0; 3] };
            let command = add(feedback, gyroscopic, 1.0);
            happened.feedback = happened.feedback.max(norm(feedback));
            happened.torque = happened.torque.max(norm(command));
            let place = step % (self.delay + 1);
            commands[place] = command;
            // the oldest in the ring: written `delay` steps ago, next to be overwritten
            let command = commands[(step + 1) % (self.delay + 1)];
            let along = match policy {
                0 => None,
                1 => Some(combined),
                2 => Some(rate),
                3 => Some(vector),
                4 => (step % period == period - 1).then(|| push.map(|x| -x)),
                5 => (step % short == short - 1).then(|| direction(chance)),
                6 => Some(scaled(inverse, combined)),
                7 => Some(scaled(inverse, add(vector, rate, 0.5 * look_ahead))),
                // with the error until it has settled, then against it, again and again
                _ => (step % period == period - 1).then(|| vector.map(|x| -x)),
            };
            if let Some((along, size)) = along.map(|along| (along, norm(along))).filter(|(_, size)| *size > 1e-9) {
                push = along.map(|x| x * self.disturbance / size);
            }
            for _ in 0..FINE {
                let mean = add(acting, add(command, acting, -1.0), passed);
                acting = add(command, add(acting, command, -1.0), kept);
                let torque = add(mean, push, 1.0);
                let slope = |rate: Vector| scaled(inverse, add(torque, cross(rate, scaled(inertia, rate)), -1.0));
                let middle = add(rate, slope(rate), 0.5 * fine_s);
                rate = add(rate, slope(middle), fine_s);
                let half = middle.map(|x| 0.5 * fine_s * x);
                let along = half[0] * vector[0] + half[1] * vector[1] + half[2] * vector[2];
                vector = add(add(vector, half, scalar), cross(vector, half), 1.0);
                scalar -= along;
                let size = (scalar * scalar + vector.iter().map(|x| x * x).sum::<f64>()).sqrt();
                let sign = if scalar < 0.0 { -size } else { size };
                scalar /= sign;
                vector = vector.map(|x| x / sign);
                happened.vector = happened.vector.max(norm(vector));
                happened.rate = happened.rate.max(norm(rate));
                happened.combined = happened.combined.max(norm(add(rate, vector, corner)));
            }
        }
        happened.last = norm(vector);
        happened
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CALM: Circumstances = Circumstances {
        stiffness: 0.15,
        damping: 0.4,
        inertia: (0.2, 0.2),
        is_fed_forward: false,
        step_s: 0.016,
        delay: 0,
        lag_s: 0.0,
        disturbance: 0.003,
        start: (0.0, 0.0),
    };

    /// A torque that lasts is met by the stiffness alone.
    #[test]
    fn a_lasting_torque_ends_at_its_static_error() {
        for (delay, lag_s) in [(0, 0.0), (5, 0.0), (0, 0.18), (5, 0.08)] {
            let happened = Circumstances { delay, lag_s, ..CALM }.fly(0, 60.0, &mut Xorshift(1));
            assert!((happened.last / (0.003 / 0.15) - 1.0).abs() < 1e-3, "{happened:?}");
        }
    }

    /// `2 J x'' + 2 D x' + k x = d` in closed form: the feedback `d - 2 J x''` is most where `x''` is least.
    #[test]
    fn the_feedback_overshoots_as_it_must() {
        let happened = CALM.fly(0, 60.0, &mut Xorshift(1));
        let root = (1.0_f64 - 0.375).sqrt();
        let (slow, fast) = (1.0 - root, 1.0 + root);
        let time_s = 2.0 * (fast / slow).ln() / (fast - slow);
        let size = 0.003 / (2.0 * 0.2) / (fast - slow);
        let curvature = size * (fast * (-fast * time_s).exp() - slow * (-slow * time_s).exp());
        let expected = 0.003 - 2.0 * 0.2 * curvature;
        assert!((happened.feedback / expected - 1.0).abs() < 2e-3 && expected > 0.0031, "{happened:?} {expected}");
    }

    /// Small angles about one axis: `2 J x'' + 2 D x' + k x = 0` in closed form, from a start without a push.
    #[test]
    fn small_errors_die_out_as_they_must() {
        let calm = Circumstances { disturbance: 0.0, start: (1e-4, 0.0), step_s: 1e-3, ..CALM };
        let (time_s, mut chance) = (1.0, Xorshift(5));
        let happened = calm.fly(1, time_s, &mut chance);
        // slopes: D / J and k / (2 D) up to what couples them
        let (damping, stiffness) = (0.4_f64 / 0.2, 0.15_f64 / (2.0 * 0.2));
        let root = (0.25 * damping * damping - stiffness).sqrt();
        let (slow, fast) = (-0.5 * damping + root, -0.5 * damping - root);
        let start_rate = -0.5 * 0.15 / 0.4;
        let first = (start_rate - fast) / (slow - fast);
        let expected = first * (slow * time_s).exp() + (1.0 - first) * (fast * time_s).exp();
        assert!((happened.last / happened.vector - expected).abs() < 2e-3, "{happened:?} {expected}");
    }

    /// Without torques momentum and energy stay.
    #[test]
    fn a_free_body_tumbles_on() {
        let free = Circumstances {
            stiffness: 1e-12,
            damping: 1e-9,
            inertia: (0.1, 0.3),
            disturbance: 0.0,
            start: (0.0, 0.2),
            ..CALM
        };
        let happened = free.fly(3, 60.0, &mut Xorshift(9));
        assert!(happened.rate > 0.0 && happened.rate < 0.2 * 3.0_f64.sqrt());
        assert!(happened.vector > 0.99, "{happened:?}");
    }

    #[test]
    fn believed_tensors_are_symmetric_with_moments_in_the_interval() {
        let mut chance = Xorshift(3);
        for _ in 0..100 {
            let columns = believed(&mut chance, (0.1, 0.3));
            for (i, j) in [(0, 1), (0, 2), (1, 2)] {
                assert!((columns[i][j] - columns[j][i]).abs() < 1e-12);
            }
            let matrix = nalgebra::Matrix3::from_fn(|i, j| columns[j][i]);
            let moments = matrix.symmetric_eigenvalues();
            assert!(moments.min() > 0.1 - 1e-9 && moments.max() < 0.3 + 1e-9, "{moments}");
        }
    }
}
