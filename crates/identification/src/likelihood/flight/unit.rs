//! What the filters of the inertial unit make of the wrench and of the turning of the body.
//!
//! Nothing is a state: the rate is that of the body less a lag that is linear in the filtered wrench, the acceleration is a regression on
//! filtered wrenches.
//!
//! # Source
//! The equations of rate and acceleration in [`FlightLikelihood`](super::FlightLikelihood).

use super::super::flow::{Body, by_inertia};
use super::grid::Grid;
use super::layout::{BODY, CENTER, INERTIA, LOG_MASS, Layout};
use super::thrusters::Term;
use crate::lie::skew;
use crate::sensing::LinearFilter;
use nalgebra::{Matrix3, SMatrix, Vector3};

/// Entries of a symmetric matrix.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
/// Part of a step within which two times are one.
const SAME: f64 = 1e-6;

/// The steps of a filter beside the rows of a record.
struct Clock {
    filter: LinearFilter,
    /// The row whose wrench acts at each step, and how far on the way to the next it is.
    row: Vec<(usize, f64)>,
    /// The step at or before each row, and how far on the way to the next the row is.
    step: Vec<(usize, f64)>,
}

impl Clock {
    fn new(filter: &LinearFilter, grid: &Grid) -> Self {
        let h = filter.step_s();
        let end = grid.times.last().copied().unwrap_or_default();
        let steps = super::grid::whole((end / h).ceil()) + 2;
        let mut row = Vec::with_capacity(steps);
        let mut k = 0;
        for j in 0..steps {
            let time = j as f64 * h;
            while k + 1 < grid.len() && grid.times[k + 1] <= time + SAME * h {
                k += 1;
            }
            let along = ((time - grid.times[k]) / grid.steps[k]).clamp(0.0, 1.0);
            row.push((k, along));
        }
        let step = grid
            .times
            .iter()
            .map(|time| {
                let place = time / h;
                let j = (place + SAME).floor().max(0.0);
                let along = place - j;
                (super::grid::whole(j), if along < SAME { 0.0 } else { along })
            })
            .collect();
        Self { filter: filter.clone(), row, step }
    }

    fn at_rows(&self, series: &[f64], mut take: impl FnMut(usize, f64)) {
        for (k, &(j, along)) in self.step.iter().enumerate() {
            let here = series[j];
            take(k, if along > 0.0 { here + (series[j + 1] - here) * along } else { here });
        }
    }

    /// The filtered series at the rows.
    fn filtered(&self, input: &[f64], take: impl FnMut(usize, f64)) {
        self.at_rows(&self.filter.filtered(input), take);
    }

    /// What the filter still owes of the integral of the series at the rows.
    fn owed(&self, input: &[f64], take: impl FnMut(usize, f64)) {
        let h = self.filter.step_s();
        let mut sum = 0.0;
        let mut integral: Vec<f64> = Vec::with_capacity(input.len());
        for x in input {
            integral.push(sum);
            sum += x * h;
        }
        let filtered = self.filter.filtered(&integral);
        for (whole, filtered) in integral.iter_mut().zip(filtered) {
            *whole -= filtered;
        }
        self.at_rows(&integral, take);
    }

    /// A series of the rows that is held over each step.
    fn held(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        self.row.iter().map(|&(k, _)| value(k)).collect()
    }
}

/// Wrenches and thrusts as the filters leave them, row by row.
struct Filtered {
    torque: Vec<Vector3<f64>>,
    force: Vec<Vector3<f64>>,
    amounts: Vec<f64>,
    /// Products of the components of the rate, in the order of `ENTRIES`.
    turning: Vec<[f64; 6]>,
    /// Torque that it takes to turn the wheels' momentum along, `w x s`; nothing without wheels.
    along: Vec<Vector3<f64>>,
}

impl Filtered {
    fn zeros(rows: usize, width: usize) -> Self {
        Self {
            torque: vec![Vector3::zeros(); rows],
            force: vec![Vector3::zeros(); rows],
            amounts: vec![0.0; rows * width],
            turning: vec![[0.0; 6]; rows],
            along: Vec::new(),
        }
    }

    /// What turning costs of the torque.
    fn gyroscopic(&self, k: usize, inertia: &Matrix3<f64>) -> Vector3<f64> {
        let of_body = gyroscopic(&self.turning(k), inertia);
        self.along.get(k).map_or(of_body, |along| of_body + along)
    }

    fn turning(&self, k: usize) -> Matrix3<f64> {
        let t = &self.turning[k];
        Matrix3::new(t[0], t[1], t[2], t[1], t[3], t[4], t[2], t[4], t[5])
    }
}

/// The unit beside one record.
pub(super) struct Unit {
    layout: Layout,
    lever: Vector3<f64>,
    terms: Vec<Term>,
    /// Amounts of a row.
    width: usize,
    gyro: Option<Clock>,
    accelerometer: Option<Clock>,
    /// Momentum of wheels over the steps of the rows; nothing without wheels.
    stored: Vec<Vector3<f64>>,
    owed: Filtered,
    passed: Filtered,
}

/// A row of the unit: value and derivatives by the dynamic parameters.
pub(super) struct Predicted {
    pub(super) value: Vector3<f64>,
    pub(super) by_body: SMatrix<f64, 3, 10>,
    /// By the lever arm, and by the one that is taken out; the rate has none.
    pub(super) by_lever: [Matrix3<f64>; 2],
}

/// `w x J w` from products of rates.
fn gyroscopic(turning: &Matrix3<f64>, inertia: &Matrix3<f64>) -> Vector3<f64> {
    let a = turning * inertia;
    Vector3::new(a[(1, 2)] - a[(2, 1)], a[(2, 0)] - a[(0, 2)], a[(0, 1)] - a[(1, 0)])
}

/// Derivatives of it by the six entries of the inertia.
fn gyroscopic_by_inertia(turning: &Matrix3<f64>) -> SMatrix<f64, 3, 6> {
    let mut out = SMatrix::<f64, 3, 6>::zeros();
    for (column, (i, j)) in ENTRIES.into_iter().enumerate() {
        let mut unit = Matrix3::zeros();
        unit[(i, j)] = 1.0;
        unit[(j, i)] = 1.0;
        out.set_column(column, &gyroscopic(turning, &unit));
    }
    out
}

impl Unit {
    pub(super) fn new(
        grid: &Grid,
        layout: Layout,
        (terms, width): (&[Term], usize),
        lever: Vector3<f64>,
        gyro: Option<&LinearFilter>,
        accelerometer: Option<&LinearFilter>,
    ) -> Self {
        let (rows, n) = (grid.len(), width);
        let gyro = gyro.map(|filter| Clock::new(filter, grid));
        let accelerometer = accelerometer.map(|filter| Clock::new(filter, grid));
        let mut owed = Filtered::zeros(rows, n);
        let mut passed = Filtered::zeros(rows, n);
        if let Some(clock) = &gyro {
            for i in 0..3 {
                clock.owed(&clock.held(|k| grid.torque[k][i]), |k, x| owed.torque[k][i] = x);
                clock.owed(&clock.held(|k| grid.force[k][i]), |k, x| owed.force[k][i] = x);
            }
            for i in 0..n {
                clock.owed(&clock.held(|k| grid.amounts[k * n + i]), |k, x| owed.amounts[k * n + i] = x);
            }
        }
        if let Some(clock) = &accelerometer {
            for i in 0..3 {
                clock.filtered(&clock.held(|k| grid.torque[k][i]), |k, x| passed.torque[k][i] = x);
                clock.filtered(&clock.held(|k| grid.force[k][i]), |k, x| passed.force[k][i] = x);
            }
            for i in 0..n {
                clock.filtered(&clock.held(|k| grid.amounts[k * n + i]), |k, x| passed.amounts[k * n + i] = x);
            }
        } else {
            passed.torque.clone_from(&grid.torque);
            passed.force.clone_from(&grid.force);
            passed.amounts.clone_from(&grid.amounts);
        }
        let has_wheels = grid.stored.iter().any(|stored| *stored != Vector3::zeros());
        let stored = if has_wheels { grid.stored.clone() } else { Vec::new() };
        if has_wheels {
            (owed.along, passed.along) = (vec![Vector3::zeros(); rows], vec![Vector3::zeros(); rows]);
        }
        Self { layout, lever, terms: terms.to_vec(), width, gyro, accelerometer, stored, owed, passed }
    }

    /// Takes the turning of the present trajectory, rate by rate at the rows.
    pub(super) fn take_rates(&mut self, rates: &[Vector3<f64>]) {
        if !self.stored.is_empty() {
            self.take_wheels(rates);
        }
        let last = rates.len().saturating_sub(1);
        let products = |clock: &Clock, a: usize, b: usize| -> Vec<f64> {
            let product = |&(k, along): &(usize, f64)| {
                let (here, next) = (&rates[k], &rates[(k + 1).min(last)]);
                (here[a] + (next[a] - here[a]) * along) * (here[b] + (next[b] - here[b]) * along)
            };
            clock.row.iter().map(product).collect()
        };
        for (entry, (a, b)) in ENTRIES.into_iter().enumerate() {
            if let Some(clock) = &self.gyro {
                let turning = &mut self.owed.turning;
                clock.owed(&products(clock, a, b), |k, x| turning[k][entry] = x);
            }
            let turning = &mut self.passed.turning;
            if let Some(clock) = &self.accelerometer {
                clock.filtered(&products(clock, a, b), |k, x| turning[k][entry] = x);
            } else {
                for (out, w) in turning.iter_mut().zip(rates) {
                    out[entry] = w[a] * w[b];
                }
            }
        }
    }

    /// The same of `w x s`.
    fn take_wheels(&mut self, rates: &[Vector3<f64>]) {
        let last = rates.len().saturating_sub(1);
        let stored = &self.stored;
        let series = |clock: &Clock, axis: usize| -> Vec<f64> {
            let torque = |&(k, along): &(usize, f64)| rates[k].lerp(&rates[(k + 1).min(last)], along).cross(&stored[k]);
            clock.row.iter().map(|place| torque(place)[axis]).collect()
        };
        for axis in 0..3 {
            if let Some(clock) = &self.gyro {
                let along = &mut self.owed.along;
                clock.owed(&series(clock, axis), |k, x| along[k][axis] = x);
            }
            let along = &mut self.passed.along;
            if let Some(clock) = &self.accelerometer {
                clock.filtered(&series(clock, axis), |k, x| along[k][axis] = x);
            } else {
                for (k, out) in along.iter_mut().enumerate() {
                    out[axis] = rates[k].cross(&stored[k])[axis];
                }
            }
        }
    }

    pub(super) fn has_gyro_filter(&self) -> bool {
        self.gyro.is_some()
    }

    fn with_scales(&self, of: &Filtered, k: usize, eta: &[f64]) -> (Vector3<f64>, Vector3<f64>) {
        let (mut torque, mut force) = (of.torque[k], of.force[k]);
        for term in &self.terms {
            let thrust = of.amounts[k * self.width + term.amount] * eta[BODY + term.parameter];
            torque += term.torque * thrust;
            force += term.force * thrust;
        }
        (torque, force)
    }

    /// Published rate less the rate of the body, and its derivatives; those by the scales into `by_scale`.
    pub(super) fn lag(&self, body: &Body, eta: &[f64], k: usize, by_scale: &mut [Vector3<f64>]) -> Predicted {
        let (torque, force) = self.with_scales(&self.owed, k, eta);
        let turning = self.owed.turning(k);
        let inverse = &body.inverse;
        let alpha = inverse * (torque - body.center.cross(&force) - self.owed.gyroscopic(k, &body.inertia));
        let mut by_body = SMatrix::<f64, 3, 10>::zeros();
        by_body.fixed_view_mut::<3, 3>(0, CENTER).copy_from(&-(inverse * skew(&force)));
        let by_j = inverse * (gyroscopic_by_inertia(&turning) + by_inertia(&alpha));
        by_body.fixed_view_mut::<3, 6>(0, INERTIA).copy_from(&by_j);
        by_scale.fill(Vector3::zeros());
        for Term { parameter, amount, torque, force } in &self.terms {
            let owed = self.owed.amounts[k * self.width + amount];
            by_scale[*parameter] -= inverse * (torque - body.center.cross(force)) * owed;
        }
        Predicted { value: -alpha, by_body, by_lever: [Matrix3::zeros(); 2] }
    }

    /// Published acceleration before gain and bias.
    pub(super) fn acceleration(
        &self,
        body: &Body,
        eta: &[f64],
        k: usize,
        rate_beside: &Vector3<f64>,
        by_scale: &mut [Vector3<f64>],
    ) -> Predicted {
        let (torque, force) = self.with_scales(&self.passed, k, eta);
        let turning = self.passed.turning(k);
        let inverse = &body.inverse;
        let alpha = inverse * (torque - body.center.cross(&force) - self.passed.gyroscopic(k, &body.inertia));
        let [lever, taken_out] = [self.layout.lever(), self.layout.lever_taken_out()]
            .map(|from| self.lever + Vector3::new(eta[from], eta[from + 1], eta[from + 2]));
        let arm = lever - body.center;
        let swing = skew(&arm);
        let centripetal = turning - Matrix3::identity() * turning.trace();
        let value = force / body.mass + alpha.cross(&arm) + centripetal * arm
            - rate_beside.cross(&rate_beside.cross(&taken_out));
        let mut by_body = SMatrix::<f64, 3, 10>::zeros();
        by_body.set_column(LOG_MASS, &(-force / body.mass));
        let by_c = -(swing * inverse * skew(&force)) - skew(&alpha) - centripetal;
        by_body.fixed_view_mut::<3, 3>(0, CENTER).copy_from(&by_c);
        let by_j = swing * (inverse * (gyroscopic_by_inertia(&turning) + by_inertia(&alpha)));
        by_body.fixed_view_mut::<3, 6>(0, INERTIA).copy_from(&by_j);
        by_scale.fill(Vector3::zeros());
        for Term { parameter, amount, torque, force } in &self.terms {
            let turned = swing * (inverse * (torque - body.center.cross(force)));
            by_scale[*parameter] += (force / body.mass - turned) * self.passed.amounts[k * self.width + amount];
        }
        let turned = skew(rate_beside);
        Predicted { value, by_body, by_lever: [skew(&alpha) + centripetal, -turned * turned] }
    }
}
