//! Where levels and parameters begin, and what is known of them.

use super::super::super::coordinates::Coordinates;
use super::super::grid::{ACCELERATION, ATTITUDE, POSITION, RATE, Row, STREAMS, VELOCITY, whole};
use super::super::layout::{BODY, CENTER, LOG_MASS};
use super::super::thrusters::Term;
use super::{
    Fit, GRAVITY_SIGMA, LARGEST_COLOUR, LASTING_START, SLOPE_SIGMA, SMALLEST_WHITE, WANDER_START, WANDER_TIME_S,
    WIDE_START, WRENCH_START, nearest,
};
use nalgebra::{SMatrix, SVector, Vector3};

/// Delays are first looked for up to this, s, over blocks of this length, of which so many are needed.
const ALIGNED_S: f64 = 0.35;
const BLOCK_S: f64 = 0.25;
const FEWEST_BLOCKS: usize = 32;
/// By so much less than twice minus the logarithm of its likelihood another place has to have: five standard deviations.
const PLAINLY: f64 = 25.0;
/// Torque, force and a constant.
const INPUTS: usize = 7;

impl Fit<'_> {
    pub(super) fn start_levels(&mut self, drive: [f64; 2]) {
        let sensing = &self.of.sensing;
        let span = |stream: usize| -> f64 {
            let seen = || self.grid.rows.iter().zip(&self.grid.valid).filter(|(_, valid)| valid[stream]);
            let value = |row: &Row| match stream {
                POSITION => row.position,
                VELOCITY => row.velocity,
                RATE => row.rate,
                ACCELERATION => row.acceleration,
                _ => Vector3::x(),
            };
            let Some((first, _)) = seen().next() else { return 1.0 };
            let most = seen().map(|(row, _)| (value(row) - value(first)).amax()).fold(0.0, f64::max);
            if stream == ATTITUDE || most == 0.0 { 1.0 } else { most }
        };
        let size = |stream: usize| {
            let seen = || self.grid.rows.iter().zip(&self.grid.valid).filter(|(_, valid)| valid[stream]);
            let value = |row: &Row| if stream == RATE { row.rate } else { row.acceleration };
            let count = seen().count().max(1) as f64;
            let mean = seen().map(|(row, _)| value(row)).sum::<Vector3<f64>>() / count;
            (seen().map(|(row, _)| (value(row) - mean).norm_squared()).sum::<f64>() / (3.0 * count)).sqrt()
        };
        let stated = [
            sensing.position.white,
            sensing.attitude.white,
            sensing.velocity.white,
            sensing.rate.white,
            sensing.acceleration.white,
        ];
        for (stream, stated) in stated.into_iter().enumerate() {
            self.smallest[stream] = SMALLEST_WHITE * span(stream);
            let seen = self.raw[stream].unwrap_or(0.0).max(self.smallest[stream]);
            // Differences of a stream that somebody has filtered say little of its density at low frequency: begun too wide the level falls at
            // once, begun too narrow it ties the motion to what the filter made of it.
            let start = if stream < RATE { seen } else { seen.max(WIDE_START * size(stream)) };
            let is_of_unit = stream == RATE || stream == ACCELERATION;
            self.levels.white[stream] = if stated.is_known() || is_of_unit { stated.or(start) } else { start };
            self.raw[stream] = Some(seen);
            if is_of_unit {
                self.largest[stream] = LARGEST_COLOUR.sqrt() * size(stream);
            }
        }
        let wander = [sensing.position.wander, sensing.attitude.wander, sensing.velocity.wander];
        for (i, stated) in wander.into_iter().enumerate() {
            self.levels.wander[i] = stated.or(WANDER_START[i], WANDER_TIME_S);
        }
        self.levels.wrench = self.of.wrench_noise.unwrap_or([drive[0] * WRENCH_START[0], drive[1] * WRENCH_START[1]]);
        // Who says what the error of a sample is says that none lasts. What a table does beside thrusters that are told is of places rather than of
        // times: windows tell it (`weak_form`).
        let may_last = self.of.wrench_noise.is_none() && !(self.planar && self.of.thrusters.is_some());
        self.levels.lasting = if may_last { drive.map(|of| LASTING_START * of) } else { [0.0; 2] };
    }

    pub(super) fn start_parameters(&mut self, has: [bool; STREAMS]) {
        let sensing = &self.of.sensing;
        let layout = self.layout;
        let start = Coordinates::of(&self.of.start);
        self.eta[LOG_MASS] = start.log_mass;
        for i in 0..3 {
            self.eta[CENTER + i] = if self.planar && i == 2 { 0.0 } else { start.center[i] };
        }
        self.set_inertia(&start.inertia);
        let mut sigma = vec![f64::INFINITY; layout.count()];
        if self.planar {
            for column in [3, 4, 5, 6, 7, 8] {
                sigma[column] = 0.0;
            }
        }
        if let Some(thrusters) = &self.of.thrusters {
            let acts = |term: &Term| {
                term.acts()
                    && self.grid.amounts.iter().skip(term.amount).step_by(self.width).any(|amount| *amount != 0.0)
            };
            for (i, of) in thrusters.sigma.iter().enumerate() {
                let acts = self.terms.iter().any(|term| term.parameter == i && acts(term));
                sigma[BODY + i] = if acts { *of } else { 0.0 };
            }
        }
        let slope = if self.planar { SLOPE_SIGMA } else { 0.0 };
        sigma[layout.slope()] = slope;
        sigma[layout.slope() + 1] = slope;
        // From the unit alone a doubt of its scale is far from linear.
        let fixed_by_poses = has[POSITION] || has[VELOCITY];
        let doubted = if fixed_by_poses {
            sensing.doubted_scale_sigma.max(sensing.acceleration.scale_sigma)
        } else {
            sensing.acceleration.scale_sigma
        };
        let triads = [
            (layout.rate_gain(), layout.rate_bias(), &sensing.rate, sensing.rate.scale_sigma, RATE),
            (layout.acceleration_gain(), layout.acceleration_bias(), &sensing.acceleration, doubted, ACCELERATION),
        ];
        for (gain, bias, errors, scale, stream) in triads {
            for i in 0..3 {
                for j in 0..3 {
                    let seen = has[stream] && self.axes[stream].contains(&i) && self.axes[stream].contains(&j);
                    let prior = if i == j { scale } else { errors.misalignment_sigma };
                    sigma[gain + 3 * i + j] = if seen { prior } else { 0.0 };
                }
                let seen = has[stream] && self.axes[stream].contains(&i);
                sigma[bias + i] = if seen { errors.bias_sigma } else { 0.0 };
            }
        }
        let delays = [
            (&sensing.pose_delay, has[POSITION] || has[ATTITUDE] || has[VELOCITY] && self.shares_delay()),
            (sensing.velocity_delay.as_ref().unwrap_or(&sensing.pose_delay), has[VELOCITY] && !self.shares_delay()),
            (&sensing.rate.delay, has[RATE]),
            (&sensing.acceleration.delay, has[ACCELERATION]),
        ];
        for (i, (delay, seen)) in delays.into_iter().enumerate() {
            let column = layout.delay() + i;
            sigma[column] = if seen { delay.sigma_s } else { 0.0 };
            let rows = delay.expected_s / self.grid.step_s;
            self.shift[i] = nearest(rows);
            self.eta[column] = (rows - self.shift[i] as f64) * self.grid.step_s;
            self.mean[column] = self.eta[column];
        }
        for (i, (errors, stream)) in
            [(&sensing.rate, RATE), (&sensing.acceleration, ACCELERATION)].into_iter().enumerate()
        {
            let width = errors.unknown_filter_s;
            sigma[layout.spread() + i] = if has[stream] { 0.5 * width * width } else { 0.0 };
        }
        for axis in 0..3 {
            let seen = has[ACCELERATION] && self.axes[ACCELERATION].contains(&axis);
            let of = |prior: f64| if seen { prior } else { 0.0 };
            sigma[layout.lever() + axis] = of(sensing.lever_arm_sigma_m);
            sigma[layout.lever_taken_out() + axis] = of(sensing.lever_arm_taken_out_sigma_m);
        }
        let unsaid = self.planar && sensing.gravity_added_world_m_s2.is_none() && has[ACCELERATION] && has[ATTITUDE];
        sigma[layout.gravity()] = if unsaid { GRAVITY_SIGMA } else { 0.0 };
        self.free = (0..layout.count()).filter(|&column| sigma[column] > 0.0).collect();
        self.prior =
            self.free.iter().map(|&c| if sigma[c].is_finite() { 1.0 / (sigma[c] * sigma[c]) } else { 0.0 }).collect();
    }

    /// Moves velocities, rates and accelerations to where they answer the wrench best, whatever the body.
    pub(super) fn align(&mut self) {
        let sensing = &self.of.sensing;
        let velocity = sensing.velocity_delay.as_ref().map(|delay| (1, VELOCITY, delay.sigma_s));
        let others = [(2, RATE, sensing.rate.delay.sigma_s), (3, ACCELERATION, sensing.acceleration.delay.sigma_s)];
        for (i, stream, sigma_s) in velocity.into_iter().chain(others) {
            if sigma_s > self.grid.step_s {
                let by = self.behind(stream, sigma_s, self.shift[i]);
                let column = self.layout.delay() + i;
                self.shift[i] += by;
                self.mean[column] -= by as f64 * self.grid.step_s;
            }
        }
        self.take_shift();
    }

    /// Rows by which a stream most likely is further behind the wrench than by so many: over short blocks it changes as the impulse does, by gains of
    /// which nothing is known.
    fn behind(&self, stream: usize, sigma_s: f64, shift: isize) -> isize {
        let grid = &self.grid;
        let block = whole(BLOCK_S / grid.step_s).max(1);
        let most = nearest(ALIGNED_S / grid.step_s);
        // Sums up to each row: impulse and time, what is measured, how much of it is missing.
        let mut impulse = vec![SVector::<f64, INPUTS>::zeros()];
        let mut sums = vec![(Vector3::zeros(), 0_usize)];
        for k in 0..grid.len() {
            let (torque, force, step_s) = (grid.torque[k], grid.force[k], grid.steps[k]);
            let acting = torque.iter().chain(&force).chain([&1.0]).copied();
            impulse.push(impulse[k] + SVector::<f64, INPUTS>::from_iterator(acting) * step_s);
            let (sum, missing) = sums[k];
            sums.push((sum + grid.rows[k].acceleration * step_s, missing + usize::from(!grid.valid[k][stream])));
        }
        let change = |k: usize, by: isize| -> Option<Vector3<f64>> {
            let from = k.checked_add_signed(by)?;
            let to = from + block;
            if to >= grid.len() || !grid.valid[from][stream] || !grid.valid[to][stream] {
                return None;
            }
            let is_whole = sums[to].1 == sums[from].1;
            Some(match stream {
                ACCELERATION if !is_whole => return None,
                RATE => grid.rows[to].rate - grid.rows[from].rate,
                VELOCITY => grid.guess[k]
                    .rotation
                    .inverse_transform_vector(&(grid.rows[to].velocity - grid.rows[from].velocity)),
                _ => sums[to].0 - sums[from].0,
            })
        };
        // How many blocks a shift leaves, and the logarithms of what they leave of each axis.
        let left_at = |by: isize| -> Option<(usize, f64)> {
            let (mut normal, mut right) = (SMatrix::<f64, INPUTS, INPUTS>::zeros(), SMatrix::<f64, INPUTS, 3>::zeros());
            let (mut squares, mut count) = (Vector3::<f64>::zeros(), 0_usize);
            for k in (0..grid.len().saturating_sub(block)).step_by(block) {
                let Some(change) = change(k, shift + by) else { continue };
                let input = impulse[k + block] - impulse[k];
                normal += input * input.transpose();
                right += input * change.transpose();
                squares += change.component_mul(&change);
                count += 1;
            }
            let floor =
                SMatrix::<f64, INPUTS, INPUTS>::from_diagonal(&normal.diagonal().map(|d| 1e-9 * d + f64::MIN_POSITIVE));
            let gains = (normal + floor).cholesky()?.solve(&right);
            let left = |axis: &usize| (squares[*axis] - right.column(*axis).dot(&gains.column(*axis))) / count as f64;
            let axes = self.axes[stream].iter().map(|axis| left(axis).max(1e-9 * squares[*axis] / count as f64));
            let logarithms: f64 = axes.map(f64::ln).sum();
            (count >= FEWEST_BLOCKS && logarithms.is_finite()).then_some((count, logarithms))
        };
        let left: Vec<(isize, usize, f64)> =
            (-most..=most).filter_map(|by| left_at(by).map(|(count, left)| (by, count, left))).collect();
        // Where rows are lost here and there, one shift has more of them than another.
        let count = left.iter().map(|(_, count, _)| *count).min().unwrap_or(0);
        let cost = |by: isize, left: f64| count as f64 * left + (by as f64 * grid.step_s / sigma_s).powi(2);
        let costs = || left.iter().map(|(by, _, left)| (*by, cost(*by, *left)));
        let unmoved = costs().find(|(by, _)| *by == 0).map_or(f64::INFINITY, |(_, cost)| cost);
        // The best of many is better than none of them by chance.
        let best = costs().min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, cost)| cost + PLAINLY < unmoved);
        best.map_or(0, |(by, _)| by)
    }
}
