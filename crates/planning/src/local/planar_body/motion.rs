//! One Runge-Kutta step of a planar body, its changes along parameters and lanes.

use core::ops::{Add, Mul, Neg, Sub};

/// A number with its change along one direction, its changes along `L` lanes, and the changes of the first along the second.
#[derive(Clone, Copy, Debug)]
pub struct Lanes<const L: usize> {
    pub value: f64,
    pub along: f64,
    pub each: [f64; L],
    pub mixed: [f64; L],
}

impl<const L: usize> Lanes<L> {
    pub fn constant(value: f64) -> Self {
        Self { value, along: 0.0, each: [0.0; L], mixed: [0.0; L] }
    }

    /// A number that changes by `along`, and by one along `lane`; where there is no such lane, by nothing.
    pub fn variable(value: f64, along: f64, lane: usize) -> Self {
        let mut number = Self { along, ..Self::constant(value) };
        if let Some(change) = number.each.get_mut(lane) {
            *change = 1.0;
        }
        number
    }

    pub fn scaled(&self, factor: f64) -> Self {
        self.chained(self.value * factor, factor, 0.0)
    }

    pub fn recip(&self) -> Self {
        let inverse = 1.0 / self.value;
        self.chained(inverse, -inverse * inverse, 2.0 * inverse * inverse * inverse)
    }

    /// A function of this number, from its value and first two derivatives.
    #[inline]
    fn chained(&self, value: f64, first: f64, second: f64) -> Self {
        let bend = second * self.along;
        Self {
            value,
            along: first * self.along,
            each: self.each.map(|lane| first * lane),
            mixed: core::array::from_fn(|i| first * self.mixed[i] + bend * self.each[i]),
        }
    }
}

impl<const L: usize> Add for Lanes<L> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            along: self.along + other.along,
            each: core::array::from_fn(|i| self.each[i] + other.each[i]),
            mixed: core::array::from_fn(|i| self.mixed[i] + other.mixed[i]),
        }
    }
}

impl<const L: usize> Neg for Lanes<L> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.scaled(-1.0)
    }
}

impl<const L: usize> Sub for Lanes<L> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<const L: usize> Mul for Lanes<L> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            along: self.along * other.value + self.value * other.along,
            each: core::array::from_fn(|i| self.each[i] * other.value + self.value * other.each[i]),
            mixed: core::array::from_fn(|i| {
                self.mixed[i] * other.value
                    + self.along * other.each[i]
                    + self.each[i] * other.along
                    + self.value * other.mixed[i]
            }),
        }
    }
}

/// What a step depends on beside position and velocity, which only add.
#[derive(Clone, Copy, Debug)]
pub struct Drive<N> {
    pub heading: N,
    pub rate: N,
    pub torque: N,
    pub force: [N; 2],
    pub mass: N,
    pub inertia_about_com: N,
    pub center_of_mass: [N; 2],
}

/// What a step adds: to the position beside `step_s` times the velocity, to the velocity, the heading and the rate.
#[derive(Clone, Copy, Debug)]
pub struct Gain<N> {
    pub position: [N; 2],
    pub velocity: [N; 2],
    pub heading: N,
    pub rate: N,
}

/// Sines and cosines of the headings of the Runge-Kutta stages.
#[derive(Clone, Copy, Debug)]
pub struct Turns {
    sin_cos: [(f64, f64); 4],
}

/// Angular acceleration, which the held input makes constant.
fn angular_acceleration<const L: usize>(drive: &Drive<Lanes<L>>) -> Lanes<L> {
    let ([cx, cy], [fx, fy]) = (drive.center_of_mass, drive.force);
    (drive.torque - (cx * fy - cy * fx)) * drive.inertia_about_com.recip()
}

/// Headings and rates of the four stages.
fn stages<const L: usize>(drive: &Drive<Lanes<L>>, step_s: f64) -> [(Lanes<L>, Lanes<L>); 4] {
    let (heading, rate) = (drive.heading, drive.rate);
    let angular_acceleration = angular_acceleration(drive);
    let middle = rate + angular_acceleration.scaled(0.5 * step_s);
    [
        (heading, rate),
        (heading + rate.scaled(0.5 * step_s), middle),
        (heading + middle.scaled(0.5 * step_s), middle),
        (heading + middle.scaled(step_s), rate + angular_acceleration.scaled(step_s)),
    ]
}

impl Turns {
    pub fn of(drive: &Drive<Lanes<0>>, step_s: f64) -> Self {
        let sin_cos = |(heading, _): (Lanes<0>, Lanes<0>)| libm::sincos(heading.value);
        Self { sin_cos: stages(drive, step_s).map(sin_cos) }
    }
}

/// The step; the force and the torque are held in body axes.
///
/// The centre of mass does not show in the turn, which is quadratic in time: only the acceleration of the origin has to be
/// evaluated at the stages.
pub fn gain<const L: usize>(drive: &Drive<Lanes<L>>, turns: &Turns, step_s: f64) -> Gain<Lanes<L>> {
    let ([cx, cy], [fx, fy]) = (drive.center_of_mass, drive.force);
    let turning = angular_acceleration(drive);
    let per_mass = drive.mass.recip();
    let steady = [fx * per_mass + turning * cy, fy * per_mass - turning * cx];
    let stages = stages(drive, step_s);
    let [first, second, third, fourth] = core::array::from_fn(|i| {
        let ((heading, rate), (sin, cos)) = (stages[i], turns.sin_cos[i]);
        let square = rate * rate;
        let (x, y) = (steady[0] + square * cx, steady[1] + square * cy);
        let (sin, cos) = (heading.chained(sin, cos, -sin), heading.chained(cos, -sin, -cos));
        [cos * x - sin * y, sin * x + cos * y]
    });
    let axis = |i: usize| {
        let early = first[i] + second[i] + third[i];
        let velocity = (early + second[i] + third[i] + fourth[i]).scaled(step_s / 6.0);
        (early.scaled(step_s * step_s / 6.0), velocity)
    };
    let ((px, vx), (py, vy)) = (axis(0), axis(1));
    let rate = turning.scaled(step_s);
    let heading = drive.rate.scaled(step_s) + turning.scaled(0.5 * step_s * step_s);
    Gain { position: [px, py], velocity: [vx, vy], heading, rate }
}
