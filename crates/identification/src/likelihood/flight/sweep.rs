//! The flow through all segments with its tangents: mean rows of each segment, end tangents, defects.

use super::super::flow::{Body, Input, State};
use super::grid::{ATTITUDE, Grid, POSITION, RATE, Row, STREAMS, VELOCITY};
use super::layout::{BODY, CENTER, INERTIA, LOG_MASS, Layout, MOTION, WRENCH};
use super::thrusters::Term;
use super::unit::Unit;
use crate::lie::{LieGroup, skew};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Three entries of a column.
type Column = [f64; MOTION];

/// What a sweep reads.
pub(super) struct Swept<'a> {
    pub(super) grid: &'a Grid,
    pub(super) rows: &'a [Row],
    pub(super) valid: &'a [[bool; STREAMS]],
    pub(super) unit: &'a Unit,
    pub(super) layout: Layout,
    pub(super) terms: &'a [Term],
    /// Amounts of a row.
    pub(super) width: usize,
    pub(super) samples: usize,
    pub(super) gravity: Vector3<f64>,
}

/// What a sweep leaves, segment after segment.
pub(super) struct Sweep {
    /// Columns of a segment: states, errors of the wrench, dynamic parameters.
    pub(super) width: usize,
    /// Mean rows of position, attitude, velocity, rate.
    pub(super) means: Vec<Column>,
    /// End of the segment by the same columns.
    pub(super) ends: Vec<Column>,
    /// Mean residuals.
    pub(super) residual: Vec<Column>,
    /// Mean derivatives by a delay.
    pub(super) late: Vec<Column>,
    /// Mean published rate before gain and bias.
    pub(super) rate_mean: Vec<Vector3<f64>>,
    /// Mean derivatives of the lag of the rate by the body, and by the scales.
    pub(super) lag_by_body: Vec<[Vector3<f64>; BODY]>,
    pub(super) lag_by_scale: Vec<Vector3<f64>>,
    /// End less the next start.
    pub(super) defects: Vec<[f64; MOTION]>,
    /// Rates of the body at the rows, and the published ones before gain and bias.
    pub(super) rates: Vec<Vector3<f64>>,
    pub(super) published: Vec<Vector3<f64>>,
}

fn three(column: &Column, from: usize) -> Vector3<f64> {
    Vector3::new(column[from], column[from + 1], column[from + 2])
}

fn add(column: &mut Column, to: usize, value: &Vector3<f64>) {
    column[to] += value.x;
    column[to + 1] += value.y;
    column[to + 2] += value.z;
}

fn set(column: &mut Column, to: usize, value: &Vector3<f64>) {
    column[to] = value.x;
    column[to + 1] = value.y;
    column[to + 2] = value.z;
}

impl Sweep {
    pub(super) fn new(rows: usize, segments: usize, layout: Layout) -> Self {
        let width = MOTION + WRENCH + layout.dynamic();
        let zero = [0.0; MOTION];
        Self {
            width,
            means: vec![zero; segments * width],
            ends: vec![zero; segments * width],
            residual: vec![zero; segments],
            late: vec![zero; segments],
            rate_mean: vec![Vector3::zeros(); segments],
            lag_by_body: vec![[Vector3::zeros(); BODY]; segments],
            lag_by_scale: vec![Vector3::zeros(); segments * layout.thrusters],
            defects: vec![zero; segments],
            rates: vec![Vector3::zeros(); rows],
            published: vec![Vector3::zeros(); rows],
        }
    }

    /// Rolls every segment from its node.
    pub(super) fn run(
        &mut self,
        read: &Swept<'_>,
        nodes: &[State],
        errors: &[[f64; WRENCH]],
        body: &Body,
        eta: &[f64],
    ) {
        for (j, node) in nodes.iter().enumerate() {
            let end = self.segment(read, j, node, &errors[j], body, eta);
            if let Some(next) = nodes.get(j + 1) {
                self.defects[j] = end.difference(next);
            }
        }
    }

    fn segment(
        &mut self,
        read: &Swept<'_>,
        j: usize,
        node: &State,
        error: &[f64; WRENCH],
        body: &Body,
        eta: &[f64],
    ) -> State {
        let width = self.width;
        let n = read.layout.thrusters;
        let (first_dynamic, slope) = (MOTION + WRENCH, MOTION + WRENCH + read.layout.slope());
        let means = &mut self.means[j * width..(j + 1) * width];
        let ends = &mut self.ends[j * width..(j + 1) * width];
        means.fill([0.0; MOTION]);
        ends.fill([0.0; MOTION]);
        for (i, column) in ends.iter_mut().enumerate().take(MOTION) {
            column[i] = 1.0;
        }
        let (mut residual, mut late) = ([0.0; MOTION], [0.0; MOTION]);
        let mut rate_mean = Vector3::zeros();
        let mut lag_by_body = [Vector3::zeros(); BODY];
        let lag_by_scale = &mut self.lag_by_scale[j * n..(j + 1) * n];
        lag_by_scale.fill(Vector3::zeros());
        let mut by_scale = vec![Vector3::zeros(); n];
        let mut counts = [0.0_f64; 4];
        let mut state = *node;
        let (mass, center) = (body.mass, body.center);
        let sc = skew(&center);
        let slope_world = Vector3::new(eta[read.layout.slope()], eta[read.layout.slope() + 1], 0.0);
        let gravity = read.gravity + slope_world;
        let first = j * read.samples;
        for k in first..(first + read.samples).min(read.grid.len()) {
            let h = read.grid.steps[k];
            let mut input = Input {
                stored: read.grid.stored[k],
                torque: read.grid.torque[k] + Vector3::new(error[0], error[1], error[2]),
                force: read.grid.force[k] + Vector3::new(error[3], error[4], error[5]),
                ..Input::default()
            };
            let amounts = &read.grid.amounts[k * read.width..(k + 1) * read.width];
            for term in read.terms {
                let thrust = eta[BODY + term.parameter] * amounts[term.amount];
                input.torque += term.torque * thrust;
                input.force += term.force * thrust;
            }
            let step = body.step(&state, &input, &gravity, h);
            let tangent = body.angular_tangent(&state.rate, &step, h);
            let r: Matrix3<f64> = state.world_from_body.to_rotation_matrix().into_inner();
            let w = state.rate;
            let (row, valid) = (&read.rows[k], &read.valid[k]);
            self.rates[k] = w;
            let wc = w.cross(&center);
            if valid[POSITION] {
                counts[0] += 1.0;
                let a = r * sc;
                for (mean, end) in means.iter_mut().zip(ends.iter()) {
                    add(mean, 0, &(three(end, 6) + a * three(end, 0)));
                }
                for b in 0..3 {
                    let by_center = -r.column(b).into_owned();
                    add(&mut means[first_dynamic + CENTER + b], 0, &by_center);
                }
                add(&mut residual, 0, &(state.center - r * center - row.position));
                add(&mut late, 0, &-(state.velocity - r * wc));
            }
            if valid[ATTITUDE] {
                counts[1] += 1.0;
                let d = LieGroup::log(&(row.attitude.conjugate() * state.world_from_body));
                let q = <UnitQuaternion<f64> as LieGroup>::right_jacobian_inverse(&d);
                for (mean, end) in means.iter_mut().zip(ends.iter()) {
                    add(mean, 3, &(q * three(end, 0)));
                }
                add(&mut residual, 3, &d);
                add(&mut late, 3, &-w);
            }
            if valid[VELOCITY] {
                counts[2] += 1.0;
                let (a, b, x) = (r * sc, r * skew(&wc), r * skew(&w));
                for (mean, end) in means.iter_mut().zip(ends.iter()) {
                    add(mean, 6, &(three(end, 9) + b * three(end, 0) + a * three(end, 3)));
                }
                for axis in 0..3 {
                    let by_center = -x.column(axis).into_owned();
                    add(&mut means[first_dynamic + CENTER + axis], 6, &by_center);
                }
                add(&mut residual, 6, &(state.velocity - r * wc - row.velocity));
                let swing = step.acceleration.cross(&center) + w.cross(&wc);
                add(&mut late, 6, &-(r * (input.force / mass - swing) + gravity));
            }
            let lag = if read.unit.has_gyro_filter() { Some(read.unit.lag(body, eta, k, &mut by_scale)) } else { None };
            let published = lag.as_ref().map_or(w, |lag| w + lag.value);
            self.published[k] = published;
            if valid[RATE] {
                counts[3] += 1.0;
                for (mean, end) in means.iter_mut().zip(ends.iter()) {
                    add(mean, 9, &three(end, 3));
                }
                rate_mean += published;
                add(&mut residual, 9, &(published - row.rate));
                if let Some(lag) = &lag {
                    for (i, sum) in lag_by_body.iter_mut().enumerate() {
                        *sum += lag.by_body.column(i);
                    }
                    for (sum, value) in lag_by_scale.iter_mut().zip(&by_scale) {
                        *sum += value;
                    }
                }
            }
            // The tangent over the step.
            let turned_back: Matrix3<f64> = step.turned.to_rotation_matrix().into_inner().transpose();
            let jacobian = <UnitQuaternion<f64> as LieGroup>::right_jacobian(&step.turn);
            let turn_by_rate = jacobian * tangent.turn.rate;
            let turn_by_torque = jacobian * tangent.turn.torque;
            let turn_by_inertia = jacobian * tangent.turn.inertia;
            let force = input.force;
            let (rg, rg2) = (r * skew(&step.velocity_force), r * skew(&step.center_force));
            let rf = r * skew(&force);
            let (hm, hhm) = (h / mass, h * h / mass);
            let rate_by_rate = tangent.rate.rate;
            for (q, column) in ends.iter_mut().enumerate() {
                if (6..MOTION).contains(&q) {
                    for i in 0..3 {
                        column[6 + i] += h * column[9 + i];
                    }
                    continue;
                }
                let (phi, rate, speed) = (three(column, 0), three(column, 3), three(column, 9));
                let turned_force = rf * rate;
                let by_speed = -(rg * phi) - turned_force * (0.5 * h);
                let by_center = -(rg2 * phi) - turned_force * (h / 6.0);
                add(column, 6, &(speed * h + by_center * hhm));
                add(column, 9, &(by_speed * hm));
                set(column, 0, &(turned_back * phi + turn_by_rate * rate));
                set(column, 3, &(rate_by_rate * rate));
            }
            let turn_by_force = -(turn_by_torque * sc);
            let rate_by_force = -(tangent.rate.torque * sc);
            let sf = skew(&force);
            let (turn_by_center, rate_by_center) = (turn_by_torque * sf, tangent.rate.torque * sf);
            for b in 0..3 {
                let column = &mut ends[MOTION + b];
                add(column, 0, &turn_by_torque.column(b).into_owned());
                add(column, 3, &tangent.rate.torque.column(b).into_owned());
                let column = &mut ends[MOTION + 3 + b];
                let along = r.column(b).into_owned();
                add(column, 0, &turn_by_force.column(b).into_owned());
                add(column, 3, &rate_by_force.column(b).into_owned());
                add(column, 6, &(along * (0.5 * hhm)));
                add(column, 9, &(along * hm));
                let column = &mut ends[first_dynamic + CENTER + b];
                add(column, 0, &turn_by_center.column(b).into_owned());
                add(column, 3, &rate_by_center.column(b).into_owned());
            }
            let column = &mut ends[first_dynamic + LOG_MASS];
            add(column, 9, &(r * step.velocity_force * -hm));
            add(column, 6, &(r * step.center_force * -hhm));
            for q in 0..6 {
                let column = &mut ends[first_dynamic + INERTIA + q];
                add(column, 0, &turn_by_inertia.column(q).into_owned());
                add(column, 3, &tangent.rate.inertia.column(q).into_owned());
            }
            for Term { parameter, amount, torque, force } in read.terms {
                let thrust = amounts[*amount];
                if thrust == 0.0 {
                    continue;
                }
                let column = &mut ends[first_dynamic + BODY + parameter];
                add(column, 0, &((turn_by_torque * torque + turn_by_force * force) * thrust));
                add(column, 3, &((tangent.rate.torque * torque + rate_by_force * force) * thrust));
                let along = r * force * thrust;
                add(column, 6, &(along * (0.5 * hhm)));
                add(column, 9, &(along * hm));
            }
            for axis in 0..2 {
                ends[slope + axis][6 + axis] += 0.5 * h * h;
                ends[slope + axis][9 + axis] += h;
            }
            state = step.next;
        }
        for (group, count) in counts.into_iter().enumerate() {
            if count > 0.0 {
                let share = 1.0 / count;
                for i in 3 * group..3 * group + 3 {
                    for mean in means.iter_mut() {
                        mean[i] *= share;
                    }
                    residual[i] *= share;
                    late[i] *= share;
                }
            }
        }
        let share = 1.0 / counts[3].max(1.0);
        self.rate_mean[j] = rate_mean * share;
        self.lag_by_body[j] = lag_by_body.map(|sum| sum * share);
        for sum in lag_by_scale.iter_mut() {
            *sum *= share;
        }
        (self.residual[j], self.late[j]) = (residual, late);
        state
    }
}
