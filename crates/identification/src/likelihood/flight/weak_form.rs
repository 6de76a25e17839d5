//! A body on a table by smooth test functions: no start, no model of what is slow, no level.
//!
//! Where what acts beside the wrench is slow and of no known size, as a table's unevenness is, no white error of the wrench describes it, and a
//! likelihood of such errors believes the fastest motion most. A test function sees a band of frequencies only, and the scatter of its windows
//! says how much is unexplained there.

use super::super::coordinates::Coordinates;
use super::fit::solved;
use super::grid::held;
use super::outcome::planar_eta_by_parameters;
use super::thrusters::{FoundFactor, Term};
use super::{FlightEstimate, FlightLikelihood, FoundDelay, FoundLevels, FoundThrusters, Halves};
use crate::SquareRootInformation;
use crate::beside::listed_beside;
use crate::error::{Column, IdentificationError};
use crate::motion::{MotionSample, filled_poses};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, SMatrix, Vector2, Vector3};

/// Lengths of windows that are tried, s.
const WINDOWS_S: [f64; 5] = [1.25, 2.5, 5.0, 10.0, 20.0];
/// Windows that overlap, and samples in one at least.
const OVERLAP: usize = 8;
const FEWEST_SAMPLES: usize = 20;
/// What this many windows side by side leave is alike; so many of these stretches at least.
const ALONE: usize = 1;
const FEWEST_CLUSTERS: usize = 12;
/// So many before their halves are compared: on a real table masses of half a minute are up to six of their standard deviations apart where those of a minute
/// are right, for what acts beside the wrench comes and goes with the places that the body visits.
const FEWEST_TO_HALVE: usize = 64;
/// A longer window may differ by so many of its standard deviations.
const AGREE: f64 = 3.0;
/// Delays are tried at this distance, s, or at half a step, and up to so many standard deviations.
const DELAY_STEP_S: f64 = 0.02;
const DELAYS: f64 = 1.5;
/// A delay that is known so well is none, s; then it is looked for more closely so many times.
const KNOWN_S: f64 = 1e-6;
const ROUNDS: usize = 6;
/// Change of a table's slope along it, as acceleration: a tenth of a millimetre per metre and metre, 1/s^2.
const UNEVEN: f64 = 1e-3;
/// Thrusters that are freed have to leave less than this share of what is left otherwise: a thruster of twelve that gives 0.7 of its thrust on a table that
/// is even leaves three times as much in windows of 2.5 s, and what healthy ones seemed to be to blame for on a real one at most twice.
const LEFT: f64 = 0.45;
/// Residuals beyond this, in standard deviations, weigh less.
const HUBER: f64 = 1.5;
const ITERATIONS: usize = 30;
/// From the median of absolute values to one standard deviation.
const MEDIAN: f64 = 1.4826;

/// A test function and its second derivative in units of the window.
fn bump(s: f64) -> [f64; 3] {
    if s <= 0.0 || s >= 1.0 {
        return [0.0; 3];
    }
    let (a, slope) = (s * (1.0 - s), 1.0 - 2.0 * s);
    [256.0 * a.powi(4), 1024.0 * a.powi(3) * slope, 256.0 * (12.0 * a * a * slope * slope - 8.0 * a.powi(3))]
}

/// The record as the windows read it.
struct Table<'a> {
    times: Vec<f64>,
    measured: Vec<usize>,
    place: Vec<Vector2<f64>>,
    yaw: Vec<f64>,
    /// Sine and cosine of it.
    heading: Vec<(f64, f64)>,
    /// Torque about the normal and force in the plane over the step that begins at each sample.
    wrench: Vec<Vector3<f64>>,
    /// The same of each parameter of the thrusters.
    effects: Vec<Vec<Vector3<f64>>>,
    of: &'a FlightLikelihood,
}

/// A measured pose within a window: the sample, its place about the middle of the window, the time that it stands for, the test function there.
struct Weighed {
    sample: usize,
    about: f64,
    length_s: f64,
    bump: [f64; 3],
}

/// Linear equations of one kind, one row for each window and axis.
struct Equations {
    rows: Vec<Vec<f64>>,
    right: Vec<f64>,
    /// The window that does not overlap the next.
    cluster: Vec<usize>,
    prior: Vec<Prior>,
}

/// What is known of an unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Prior {
    Nothing,
    /// Zero within one standard deviation.
    Small(f64),
    /// In units of the first unknown: a value and one standard deviation.
    Relative(f64, f64),
}

impl Prior {
    /// Value and standard deviation where the first unknown is this.
    fn about(self, first: f64) -> Option<(f64, f64)> {
        match self {
            Self::Nothing => None,
            Self::Small(sigma) => Some((0.0, sigma)),
            Self::Relative(value, sigma) => Some((value * first, sigma * first.abs())),
        }
    }

    const fn is_relative(self) -> bool {
        matches!(self, Self::Relative(..))
    }
}

struct Solution {
    value: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Robust scale of what is left, and the share of the right-hand side that is explained.
    scale: f64,
    explained: f64,
}

impl Equations {
    fn solve(&self) -> Option<Solution> {
        let n = self.prior.len();
        let count = self.rows.len();
        let x = DMatrix::from_fn(count, n, |i, j| self.rows[i][j]);
        let y = DVector::from_column_slice(&self.right);
        let mut weights = vec![1.0; count];
        let (mut first, mut variance) = (0.0_f64, 0.0_f64);
        let mut left = y.clone();
        let mut value = DVector::zeros(n);
        let mut information = DMatrix::zeros(n, n);
        for round in 0..ITERATIONS {
            let weighted = DMatrix::from_fn(count, n, |i, j| x[(i, j)] * weights[i]);
            information = weighted.transpose() * &x;
            let mut right = weighted.transpose() * &y;
            if round > 0 {
                for (i, prior) in self.prior.iter().enumerate() {
                    if let Some((mean, sigma)) = prior.about(first) {
                        let weight = variance / (sigma * sigma);
                        information[(i, i)] += weight;
                        right[i] += weight * mean;
                    }
                }
            } else {
                // Without the first scale nothing is known of what belongs to it: left out.
                for (i, _) in self.prior.iter().enumerate().filter(|(_, prior)| prior.is_relative()) {
                    information[(i, i)] += 1e12 * information[(i, i)].max(f64::MIN_POSITIVE);
                }
            }
            value = solved(&information, &DMatrix::from_column_slice(n, 1, right.as_slice()))?.column(0).into_owned();
            first = value[0];
            left = &y - &x * &value;
            let mut sizes: Vec<f64> = left.iter().map(|e| e.abs()).collect();
            let scale = MEDIAN * super::levels::median(&mut sizes)?;
            if !(scale > 0.0 && first.is_finite() && first != 0.0) {
                return None;
            }
            for (weight, e) in weights.iter_mut().zip(left.iter()) {
                *weight = (HUBER * scale / e.abs()).min(1.0);
            }
            let squares: f64 = weights.iter().zip(left.iter()).map(|(w, e)| w * e * e).sum();
            // Windows that overlap tell what one of them tells.
            variance = squares / count as f64 * OVERLAP as f64 / 2.0;
        }
        // How far each stretch of windows moves the answer when it is left out: what neighbours leave is alike.
        let clusters = self.cluster.iter().max()? + 1;
        let mut covariance = DMatrix::zeros(n, n);
        for cluster in 0..clusters {
            let (mut without, mut score) = (information.clone(), DVector::<f64>::zeros(n));
            for i in (0..count).filter(|i| self.cluster[*i] == cluster) {
                let row = x.row(i).transpose();
                without -= &row * row.transpose() * weights[i];
                score += &row * (weights[i] * left[i]);
            }
            let moved = solved(&without, &DMatrix::from_column_slice(n, 1, score.as_slice()))?;
            covariance += &moved * moved.transpose();
        }
        let inverse = solved(&information, &DMatrix::identity(n, n))?;
        for (i, prior) in self.prior.iter().enumerate() {
            if let Some((_, sigma)) = prior.about(first) {
                let column = inverse.column(i) * (variance / sigma);
                covariance += &column * column.transpose();
            }
        }
        let all = y.norm_squared().max(f64::MIN_POSITIVE);
        Some(Solution { value, covariance, scale: variance.sqrt(), explained: 1.0 - left.norm_squared() / all })
    }

    /// The same with what others found of the unknowns that both have.
    fn knowing(&self, others: &Solution) -> Self {
        let first = others.value[0];
        let own = self.prior.iter().filter(|prior| !prior.is_relative()).count();
        let theirs = others.value.len() + own - self.prior.len();
        let mut prior = self.prior.clone();
        for (i, prior) in prior.iter_mut().enumerate().skip(own) {
            let at = theirs + i - own;
            let std = others.covariance[(at, at)].max(0.0).sqrt() / first.abs();
            if let Prior::Relative(_, sigma) = *prior
                && std < sigma
            {
                *prior = Prior::Relative(others.value[at] / first, std);
            }
        }
        Self { rows: self.rows.clone(), right: self.right.clone(), cluster: self.cluster.clone(), prior }
    }

    /// Those of the windows that begin before a share of the record, or after it.
    fn half(&self, second: bool) -> Self {
        let middle = self.cluster.iter().max().copied().unwrap_or(0).div_ceil(2);
        let kept: Vec<usize> = (0..self.rows.len()).filter(|&i| (self.cluster[i] >= middle) == second).collect();
        Self {
            rows: kept.iter().map(|&i| self.rows[i].clone()).collect(),
            right: kept.iter().map(|&i| self.right[i]).collect(),
            cluster: kept.iter().map(|&i| self.cluster[i] - if second { middle } else { 0 }).collect(),
            prior: self.prior.clone(),
        }
    }
}

/// `[ln m, c_x, c_y, J]`, its covariance, and what was found beside it.
struct Planar {
    value: SMatrix<f64, 4, 1>,
    covariance: SMatrix<f64, 4, 4>,
    moving: Solution,
    turning: Solution,
}

impl Planar {
    fn of(moving: &Equations, turning: &Equations) -> Option<Self> {
        let turning = turning.solve()?;
        let moving = moving.knowing(&turning).solve()?;
        let (by_mass, by_inertia) = (moving.value[0], turning.value[0]);
        if !(by_mass > 0.0 && by_inertia > 0.0) {
            return None;
        }
        let value = SMatrix::<f64, 4, 1>::new(-by_mass.ln(), moving.value[1], moving.value[2], 1.0 / by_inertia);
        let mut covariance = SMatrix::<f64, 4, 4>::zeros();
        for i in 0..3 {
            for j in 0..3 {
                let slope = |k: usize| if k == 0 { -1.0 / by_mass } else { 1.0 };
                covariance[(i, j)] = moving.covariance[(i, j)] * slope(i) * slope(j);
            }
        }
        covariance[(3, 3)] = turning.covariance[(0, 0)] / by_inertia.powi(4);
        Some(Self { value, covariance, moving, turning })
    }
}

impl Table<'_> {
    fn of<'a>(of: &'a FlightLikelihood, record: &[MotionSample]) -> Result<Table<'a>, IdentificationError> {
        let missing = |column| IdentificationError::MissingColumn(column);
        let poses = filled_poses(record).ok_or(missing(Column::Position))?;
        let first_ns = record.first().map_or(0, |sample| sample.time_ns);
        let mut last = Vector3::zeros();
        let mut wrench = Vec::with_capacity(record.len());
        let beside = listed_beside(record);
        for i in 0..record.len() {
            if let Some((torque, force)) = held(record, beside.as_deref(), i, of.wrench_timing) {
                last = Vector3::new(torque.z, force.x, force.y);
            }
            wrench.push(last);
        }
        let terms: &[Term] = of.thrusters.as_ref().map_or(&[], |thrusters| &thrusters.terms);
        let parameters = of.thrusters.as_ref().map_or(0, |thrusters| thrusters.sigma.len());
        let effects = (0..record.len())
            .map(|i| {
                let mut effects = vec![Vector3::zeros(); parameters];
                if let Some(thrusters) = &of.thrusters {
                    let amounts = thrusters.of_sample(i);
                    for term in terms {
                        let along = Vector3::new(term.torque.z, term.force.x, term.force.y);
                        effects[term.parameter] += along * amounts[term.amount];
                    }
                }
                effects
            })
            .collect();
        let mut yaw = Vec::with_capacity(record.len());
        for pose in &poses {
            let angle = pose.rotation.euler_angles().2;
            let before = yaw.last().copied().unwrap_or(angle);
            let turn =
                (angle - before + core::f64::consts::PI).rem_euclid(core::f64::consts::TAU) - core::f64::consts::PI;
            yaw.push(before + turn);
        }
        Ok(Table {
            times: record.iter().map(|sample| sample.time_ns.saturating_sub(first_ns) as f64 * 1e-9).collect(),
            measured: (0..record.len()).filter(|&i| record[i].world_from_body.is_some()).collect(),
            place: poses.iter().map(|pose| pose.translation.vector.xy()).collect(),
            heading: yaw.iter().map(|yaw| yaw.sin_cos()).collect(),
            yaw,
            wrench,
            effects,
            of,
        })
    }

    /// The equations of windows of one length, moving and turning, for poses that are so old.
    fn equations(&self, window_s: f64, delay_s: f64, delay_sigma_s: f64) -> [Equations; 2] {
        let told = self.of.thrusters.as_ref();
        let sigma: Vec<f64> = told.map_or_else(Vec::new, |thrusters| thrusters.sigma.clone());
        let relative =
            || sigma.iter().copied().chain([delay_sigma_s]).map(|sigma| Prior::Relative(0.0, sigma.max(KNOWN_S)));
        let mut moving = Equations { rows: Vec::new(), right: Vec::new(), cluster: Vec::new(), prior: Vec::new() };
        let mut turning = Equations { rows: Vec::new(), right: Vec::new(), cluster: Vec::new(), prior: Vec::new() };
        let uneven = Prior::Small(UNEVEN);
        let slope = [Prior::Nothing, uneven, uneven];
        moving.prior = [Prior::Nothing; 3].into_iter().chain(slope).chain(slope).chain(relative()).collect();
        turning.prior = [Prior::Nothing; 4].into_iter().chain(relative()).collect();
        let end = self.times.last().copied().unwrap_or_default();
        let seen: Vec<f64> = self.measured.iter().map(|&i| self.times[i]).collect();
        let hop = window_s / OVERLAP as f64;
        let middle = self.measured.iter().map(|&i| self.place[i]).sum::<Vector2<f64>>() / seen.len().max(1) as f64;
        // Windows overlap: what is the same in all of them is asked once.
        let length_s = |i: usize| self.times.get(i + 1).map_or(0.0, |next| next - self.times[i]);
        let turned_by: Vec<(f64, f64)> =
            (0..self.times.len()).map(|i| self.yaw_at(self.times[i] + delay_s + 0.5 * length_s(i)).sin_cos()).collect();
        let mut window = 0;
        loop {
            let start = window as f64 * hop;
            if start + window_s > end {
                break;
            }
            let cluster = window / (ALONE * OVERLAP);
            window += 1;
            let inside = seen.partition_point(|t| *t < start)..seen.partition_point(|t| *t <= start + window_s);
            let gap = seen
                .get(inside.clone())
                .unwrap_or_default()
                .windows(2)
                .map(|pair| pair[1] - pair[0])
                .fold(0.0, f64::max);
            if inside.len() < FEWEST_SAMPLES || gap > window_s / 6.0 {
                continue;
            }
            // The second derivative on the measured samples, without what a sum leaves of a constant and of a line.
            let length = |at: usize| {
                let before = seen.get(at.wrapping_sub(1)).copied().unwrap_or(seen[at]);
                0.5 * (seen.get(at + 1).copied().unwrap_or(seen[at]) - before)
            };
            let samples: Vec<Weighed> = inside
                .map(|at| {
                    let s = (seen[at] - start) / window_s;
                    Weighed { sample: self.measured[at], about: s - 0.5, length_s: length(at), bump: bump(s) }
                })
                .collect();
            let sum = |value: &dyn Fn(&Weighed) -> f64| samples.iter().map(value).sum::<f64>();
            let square = window_s * window_s;
            let leaks = Vector2::new(
                sum(&|x| x.bump[2] * x.length_s / square),
                sum(&|x| x.bump[2] * x.length_s * x.about / square),
            );
            let moments = Matrix2::new(
                sum(&|x| x.length_s),
                sum(&|x| x.length_s * x.about),
                sum(&|x| x.length_s * x.about),
                sum(&|x| x.length_s * x.about * x.about),
            );
            let Some(inverse) = moments.try_inverse() else { continue };
            let out = inverse * leaks;
            let second = |x: &Weighed| x.length_s * (x.bump[2] / square - out.x - out.y * x.about);
            let whole = sum(&|x| x.bump[0] * x.length_s);
            let mut about = Vector2::zeros();
            let mut acceleration = Vector3::zeros();
            // Derivatives of the direction of the body's axes, weighed.
            let (mut cosine, mut sine) = (0.0, 0.0);
            for x in &samples {
                let (weight, place) = (second(x), self.place[x.sample] - middle);
                acceleration += Vector3::new(self.yaw[x.sample], place.x, place.y) * weight;
                let (sin, cos) = self.heading[x.sample];
                cosine += weight * cos;
                sine += weight * sin;
                about += place * (x.bump[0] * x.length_s);
            }
            let n = sigma.len();
            // Of the wrench, by its parameters and by its delay: torque, then force in the world's axes, and the force in the body's.
            let mut wrench = vec![Vector3::zeros(); n + 2];
            let mut body = Vector2::zeros();
            let from = self.times.partition_point(|t| *t + delay_s < start).saturating_sub(1);
            for (i, &(sin, cos)) in turned_by.iter().enumerate().skip(from) {
                let begin = self.times[i] + delay_s;
                if begin > start + window_s {
                    break;
                }
                let length = length_s(i);
                let [weight, slope, _] = bump((begin + 0.5 * length - start) / window_s);
                if weight == 0.0 {
                    continue;
                }
                let turned = |w: &Vector3<f64>| Vector3::new(w.x, cos * w.y - sin * w.z, sin * w.y + cos * w.z);
                let here = turned(&self.wrench[i]) * length;
                wrench[0] += here * weight;
                for (sum, effect) in wrench[1..=n].iter_mut().zip(&self.effects[i]) {
                    *sum += turned(effect) * (length * weight);
                }
                wrench[n + 1] += here * (slope / window_s);
                body += Vector2::new(self.wrench[i].y, self.wrench[i].z) * (length * weight);
            }
            for axis in 0..2 {
                let mut row = vec![wrench[0][1 + axis]];
                // The origin moves about the centre of mass.
                row.extend(if axis == 0 { [-cosine, sine] } else { [-sine, -cosine] });
                for other in 0..2 {
                    let on = if other == axis { 1.0 } else { 0.0 };
                    row.extend([on * whole, on * about.x, on * about.y]);
                }
                row.extend(wrench[1..].iter().map(|w| w[1 + axis]));
                moving.rows.push(row);
                moving.right.push(acceleration[1 + axis]);
                moving.cluster.push(cluster);
            }
            let mut row = vec![wrench[0].x, -body.y, body.x, whole];
            row.extend(wrench[1..].iter().map(|w| w.x));
            turning.rows.push(row);
            turning.right.push(acceleration.x);
            turning.cluster.push(cluster);
        }
        [moving, turning]
    }

    /// By windows of each length that fits, with the delay that each finds.
    fn found(&self) -> Vec<(f64, f64, Planar)> {
        let span_s = self.times.last().copied().unwrap_or_default();
        let step_s = span_s / (self.measured.len().max(2) - 1) as f64;
        let fits = |window_s: &f64| {
            *window_s * (ALONE * FEWEST_CLUSTERS) as f64 <= span_s && *window_s >= FEWEST_SAMPLES as f64 * step_s
        };
        let of = |window_s: f64| {
            let delay_s = self.delay_s(window_s)?;
            let [moving, turning] = self.equations(window_s, delay_s, self.of.sensing.pose_delay.sigma_s);
            Some((window_s, delay_s, Planar::of(&moving, &turning)?))
        };
        WINDOWS_S.into_iter().filter(fits).filter_map(of).collect()
    }

    fn yaw_at(&self, time_s: f64) -> f64 {
        let after = self.times.partition_point(|t| *t <= time_s).clamp(1, self.times.len() - 1);
        let (a, b) = (self.times[after - 1], self.times[after]);
        let along = ((time_s - a) / (b - a)).clamp(0.0, 1.0);
        self.yaw[after - 1] + (self.yaw[after] - self.yaw[after - 1]) * along
    }

    /// The delay under which windows of one length leave least.
    fn delay_s(&self, window_s: f64) -> Option<f64> {
        let delay = &self.of.sensing.pose_delay;
        let steps = super::grid::whole(DELAYS * delay.sigma_s / DELAY_STEP_S);
        let left = |delay_s: f64| {
            let [moving, turning] = self.equations(window_s, delay_s, 0.0);
            Some(2.0 * moving.solve()?.scale.ln() + turning.solve()?.scale.ln())
        };
        let tried = (0..=2 * steps).map(|i| delay.expected_s + (i as f64 - steps as f64) * DELAY_STEP_S);
        let all = tried.filter_map(|delay_s| Some((delay_s, left(delay_s)?)));
        let mut found = all.min_by(|a, b| a.1.total_cmp(&b.1))?.0;
        if delay.sigma_s > KNOWN_S {
            for _ in 0..ROUNDS {
                let [moving, turning] = self.equations(window_s, found, delay.sigma_s);
                let moving = moving.knowing(&turning.solve()?).solve()?;
                let late_s = moving.value[moving.value.len() - 1] / moving.value[0];
                found += late_s.clamp(-DELAY_STEP_S, DELAY_STEP_S);
            }
        }
        Some(found)
    }
}

/// Places of `[ln m, c_x, c_y, J]` among the ten.
const IN_PLANE: [usize; 4] = [0, 1, 2, 9];
/// A quantity is determined where one sigma of it is below this share of the body's own scale.
const DETERMINED: f64 = 0.2;

impl FlightLikelihood {
    /// The body on a table by test functions; `None` where what is left is of the poses, which other ways know better, and where no length of
    /// windows tells anything that longer ones agree with.
    pub(crate) fn weak_form(&self, record: &[MotionSample]) -> Result<Option<FlightEstimate>, IdentificationError> {
        let mut of = self.clone();
        // A record that is nothing for a likelihood may still be one for windows.
        let freed = of.screened(record, true).unwrap_or_default();
        let mut found = of.weak_form_as_told(record)?;
        if let Some(thrusters) = found.as_mut().and_then(|found| found.thrusters.as_mut()) {
            thrusters.suspects = freed;
        }
        Ok(found)
    }

    /// Whether windows leave less of the motion by so much that what was freed is to blame for it; also where windows say nothing. What acts on a table
    /// beside the wrench looks like thrusters that fail to a likelihood of white errors, and is left all the same by whatever they give.
    pub(super) fn leaves_less_than(&self, other: &Self, record: &[MotionSample]) -> Result<bool, IdentificationError> {
        let [here, there] = [self, other].map(|of| Table::of(of, record).map(|table| table.found()));
        let (here, there) = (here?, there?);
        let mut least: Option<f64> = None;
        for (window_s, _, planar) in &there {
            let same = here.iter().find(|(other_s, ..)| other_s.total_cmp(window_s).is_eq());
            let left = |planar: &Planar| 2.0 * planar.moving.scale.ln() + planar.turning.scale.ln();
            let ratio = same.map(|(_, _, freed)| ((left(freed) - left(planar)) / 3.0).exp());
            least = ratio.map(|ratio| least.map_or(ratio, |least| least.min(ratio))).or(least);
        }
        Ok(least.is_none_or(|least| least < LEFT))
    }

    /// The same where nothing is freed: none where windows leave nothing but what is of the poses.
    pub(super) fn weak_form_as_told(
        &self,
        record: &[MotionSample],
    ) -> Result<Option<FlightEstimate>, IdentificationError> {
        let table = Table::of(self, record)?;
        let found = table.found();
        let agrees = |at: usize| {
            found.iter().skip(at + 1).all(|(_, _, longer)| {
                let apart = longer.value - found[at].2.value;
                (0..4).all(|i| apart[i].abs() < AGREE * longer.covariance[(i, i)].max(0.0).sqrt())
            })
        };
        // What poses are wrong by falls with the length of a window, what acts beside the wrench adds up.
        let acts = |at: usize| {
            let left = |planar: &Planar| [planar.moving.scale, planar.turning.scale];
            found.get(at + 1).is_some_and(|(_, _, longer)| {
                left(longer).iter().zip(left(&found[at].2)).all(|(longer, here)| *longer > here)
            })
        };
        let narrowest = (0..found.len()).filter(|at| acts(*at) && agrees(*at)).min_by(|a, b| {
            let mass = |at: usize| found[at].2.covariance[(0, 0)];
            mass(*a).total_cmp(&mass(*b))
        });
        let Some(at) = narrowest else { return Ok(None) };
        let (window_s, delay_s, planar) = &found[at];
        let [moving, turning] = table.equations(*window_s, *delay_s, self.sensing.pose_delay.sigma_s);
        let stretches = moving.cluster.iter().max().map_or(0, |last| last + 1);
        let halves = if stretches < FEWEST_TO_HALVE {
            [None, None]
        } else {
            [false, true].map(|second| Planar::of(&moving.half(second), &turning.half(second)))
        };
        planar.estimate(&table, *delay_s, &halves)
    }
}

impl Planar {
    fn estimate(
        &self,
        table: &Table<'_>,
        delay_s: f64,
        halves: &[Option<Self>; 2],
    ) -> Result<Option<FlightEstimate>, IdentificationError> {
        let [log_mass, x, y, moment] = [0, 1, 2, 3].map(|i| self.value[i]);
        let at = Coordinates {
            log_mass,
            center: Vector3::new(x, y, 0.0),
            // The other moments do not act; a ball is a body whatever its size.
            inertia: Matrix3::identity() * moment,
        };
        let length = (1.5 * moment / log_mass.exp()).sqrt();
        let sizes = SMatrix::<f64, 4, 1>::new(1.0, length, length, 1.5 * moment);
        let is_determined = |i: usize| self.covariance[(i, i)] < (DETERMINED * sizes[i]).powi(2);
        let inverse = DMatrix::from_fn(4, 4, |i, j| self.covariance[(i, j)]);
        let Some(information) = solved(&inverse, &DMatrix::identity(4, 4)) else { return Ok(None) };
        let Some(root) = information.cholesky() else { return Ok(None) };
        if !(0..4).all(is_determined) {
            return Ok(None);
        }
        let mut rows = SMatrix::<f64, 10, 10>::zeros();
        let mut covariance = SMatrix::<f64, 10, 10>::zeros();
        let mut determined = [false; 10];
        for (i, &to) in IN_PLANE.iter().enumerate() {
            determined[to] = true;
            for (j, &from) in IN_PLANE.iter().enumerate() {
                rows[(i, from)] = root.l()[(j, i)];
                covariance[(to, from)] = self.covariance[(i, j)];
            }
        }
        let factor = rows * planar_eta_by_parameters(&at);
        let parameters = at.parameters();
        let information = SquareRootInformation::from_square_root(&factor, &(factor * parameters.to_vector()))?;
        let told = table.of.thrusters.as_ref();
        // Relative to the first unknown, which is one over the mass.
        let first = 9;
        let by_mass = self.moving.value[0];
        let beside = |i: usize| {
            let at = first + i;
            FoundFactor {
                value: self.moving.value[at] / by_mass,
                std: self.moving.covariance[(at, at)].max(0.0).sqrt() / by_mass.abs(),
            }
        };
        let count = told.map_or(0, |thrusters| thrusters.sigma.len());
        let late = beside(count);
        let age = FoundDelay { value_s: delay_s + late.value, std_s: late.std };
        let halves = match halves {
            [Some(a), Some(b)] => {
                let (apart, joint) = (b.value - a.value, a.covariance + b.covariance);
                let chi_square = (0..4).map(|i| apart[i] * apart[i] / joint[(i, i)].max(f64::MIN_POSITIVE)).sum();
                let log_mass = (apart[0], joint[(0, 0)].max(0.0).sqrt());
                Some(Halves { chi_square, degrees_of_freedom: 4, log_mass })
            }
            _ => None,
        };
        let explained = self.moving.explained.min(self.turning.explained);
        Ok(Some(FlightEstimate {
            parameters,
            covariance,
            information,
            determined,
            planar: true,
            levels: FoundLevels { white: [0.0; 5], wander: [(0.0, 0.0); 3], wrench: [0.0; 2], lasting: [0.0; 2] },
            rate_gain: Matrix3::zeros(),
            rate_bias: Vector3::zeros(),
            acceleration_gain: Matrix3::zeros(),
            acceleration_bias: Vector3::zeros(),
            acceleration_gain_chi_square: 0.0,
            acceleration_gain_sane: true,
            delays: [Some(age), None, None, None],
            thrusters: told.map(|thrusters| FoundThrusters::beside(thrusters, beside)),
            halves,
            explained,
            wrench_errors: Vec::new(),
            whiteness: [None, None],
            gated: [0; 5],
            segment_samples: 1,
            sweeps: 0,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actuators::{Actuator, Actuators, CommonErrors};
    use crate::lie::Pose;
    use crate::noise::Gaussian;
    use nalgebra::UnitQuaternion;

    /// Mass, moment of inertia, centre of mass, delay of the valves and loss of thrust for each further one that is open.
    const BODY: (f64, f64) = (18.0, 0.25);
    const CENTER: (f64, f64) = (0.01, -0.015);
    const DELAY_S: f64 = 0.11;
    const SAG: f64 = 0.06;

    fn valves() -> Actuators {
        let place = [
            (0.15, 0.07),
            (0.15, -0.07),
            (0.07, -0.15),
            (-0.07, -0.15),
            (-0.15, -0.07),
            (-0.15, 0.07),
            (-0.07, 0.15),
            (0.07, 0.15),
        ];
        let along =
            [(-1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, 1.0), (1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, -1.0)];
        let one = |(place, along): ((f64, f64), (f64, f64))| Actuator {
            position_m: [place.0, place.1, 0.0],
            direction: [along.0, along.1, 0.0],
            thrust_n: 0.45,
            thrust_sigma: 0.005,
        };
        let common = CommonErrors { sag_sigma: 0.1, delay_sigma_s: 0.2, ..CommonErrors::default() };
        Actuators { actuators: place.into_iter().zip(along).map(one).collect(), common }
    }

    /// Valves of a body on an uneven table with air that drifts, seen by cameras with this noise, m; one may be dead.
    fn flight(seed: u64, pose_m: f64, drift_m_s2: f64, dead: Option<usize>) -> (FlightLikelihood, Vec<MotionSample>) {
        let (mut dice, actuators) = (Gaussian::from_seed(seed), valves());
        let (mut place, mut speed) = (Vector2::new(0.3, -0.2), Vector2::zeros());
        let (mut yaw, mut rate) = (0.4_f64, 0.0);
        let (mut drift, mut turn) = (Vector2::zeros(), 0.0);
        let (mut record, mut commands) = (Vec::new(), Vec::<f64>::new());
        let mut open = [0.0; 8];
        let turned = |yaw: f64, v: Vector2<f64>| {
            let (sin, cos) = yaw.sin_cos();
            Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
        };
        let center = Vector2::new(CENTER.0, CENTER.1);
        let fine = 12;
        let step_s = 0.06;
        let mut time_ns = 0;
        for k in 0..1600_usize {
            if k % 12 == 0 {
                // Back towards the middle, as any flight on a table goes, and something at random.
                let back = -0.01 * place - 0.12 * speed;
                let body = turned(-yaw, back);
                let twist = -0.02 * rate;
                for (valve, open) in actuators.actuators.iter().zip(&mut open) {
                    let torque = valve.position_m[0] * valve.direction[1] - valve.position_m[1] * valve.direction[0];
                    let wish =
                        20.0 * (body.x * valve.direction[0] + body.y * valve.direction[1]) + 60.0 * twist * torque;
                    *open = if wish + dice.normal() > 0.7 { 1.0 } else { 0.0 };
                }
            }
            commands.extend(open);
            let noisy = place + Vector2::new(dice.normal(), dice.normal()) * pose_m;
            let seen = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw + 2.0 * pose_m * dice.normal());
            record.push(MotionSample {
                time_ns,
                world_from_body: Some(Pose::from_parts(Vector3::new(noisy.x, noisy.y, 0.0).into(), seen)),
                ..MotionSample::default()
            });
            time_ns += 60_000_000;
            drift += Vector2::new(dice.normal(), dice.normal()) * drift_m_s2 - drift * 0.05;
            turn += 5.0 * drift_m_s2 * dice.normal() - turn * 0.05;
            for part in 0..fine {
                let at_s = step_s * (k as f64 + f64::from(part) / f64::from(fine)) - DELAY_S;
                let row = super::super::grid::whole((at_s / step_s).floor()).min(k);
                let told = &commands[8 * row..8 * row + 8];
                let further = (told.iter().sum::<f64>() - 1.0).max(0.0);
                let (mut force, mut torque) = (Vector2::zeros(), 0.0);
                for (index, (valve, told)) in actuators.actuators.iter().zip(told).enumerate() {
                    let gives = if dead == Some(index) { 0.0 } else { valve.thrust_n };
                    let thrust = gives * told * (1.0 - SAG * further);
                    let along = Vector2::new(valve.direction[0], valve.direction[1]) * thrust;
                    force += along;
                    torque += (valve.position_m[0] - CENTER.0) * along.y - (valve.position_m[1] - CENTER.1) * along.x;
                }
                // The state is that of the centre of mass until it is shown.
                let h = step_s / f64::from(fine);
                let mut com = place + turned(yaw, center);
                let world = turned(yaw, force);
                let uneven = Vector2::new(-8e-4 * com.x + 1e-3, 5e-4 * com.y);
                speed += (world / BODY.0 + uneven + drift) * h;
                rate += (torque / BODY.1 + turn) * h;
                com += speed * h;
                yaw += rate * h;
                place = com - turned(yaw, center);
            }
        }
        let thrusters = actuators.drive(&mut record, &commands).unwrap();
        let told = FlightLikelihood {
            sensing: actuators.aged(crate::sensing::Sensing::default()),
            thrusters: Some(thrusters),
            plane: super::super::Plane::Planar,
            ..FlightLikelihood::default()
        };
        (told, record)
    }

    fn flown(seed: u64, pose_m: f64, drift_m_s2: f64) -> Option<FlightEstimate> {
        let (told, record) = flight(seed, pose_m, drift_m_s2, None);
        told.weak_form(&record).unwrap()
    }

    /// What acts on the table is left whatever a valve gives, what a dead valve does not give is not.
    #[test]
    fn valves_are_blamed_where_windows_confirm_it() {
        for seed in 1..=2 {
            for dead in [None, Some(2)] {
                let (told, record) = flight(seed, 2e-4, 4e-4, dead);
                for suspect in [2, 5] {
                    let mut freed = told.clone();
                    freed.thrusters.as_mut().unwrap().free(suspect);
                    let is_to_blame = freed.leaves_less_than(&told, &record).unwrap();
                    assert_eq!(is_to_blame, dead == Some(suspect), "seed {seed}, {dead:?}, {suspect}");
                }
            }
        }
    }

    #[test]
    fn valves_that_sag_and_answer_late_on_an_uneven_table() {
        let (mut squares, mut count) = (0.0, 0);
        for seed in 1..=6 {
            let found = flown(seed, 2e-4, 4e-4).unwrap();
            let truth = [BODY.0.ln(), CENTER.0, CENTER.1, BODY.1];
            let value =
                [found.parameters.mass.ln(), found.parameters.center_of_mass().x, found.parameters.center_of_mass().y];
            let value = [value[0], value[1], value[2], found.parameters.inertia_about_com()[(2, 2)]];
            let std = IN_PLANE.map(|i| found.std()[i]);
            let z: Vec<f64> = (0..4).map(|i| (value[i] - truth[i]) / std[i]).collect();
            let thrusters = found.thrusters.as_ref().unwrap();
            let (sag, age) = (thrusters.sag.unwrap(), found.delays[0].unwrap());
            println!(
                "{seed}: mass {:.2} +- {:.2}, z {z:.2?}, sag {sag:?}, delay {age:?}",
                found.parameters.mass,
                found.parameters.mass * std[0]
            );
            assert!(z.iter().all(|z| z.abs() < 4.0), "{z:?}");
            assert!((sag.value - SAG).abs() < 4.0 * sag.std && (age.value_s - DELAY_S).abs() < 4.0 * age.std_s);
            assert!(std[0] < 0.1);
            squares += z.iter().map(|z| z * z).sum::<f64>();
            count += z.len();
        }
        assert!((0.3..2.5).contains(&(squares / count as f64)), "{}", squares / count as f64);
    }

    /// Where the poses make what is left, the answer is another's: feedback would bias this one.
    #[test]
    fn poses_that_are_worse_than_the_table_are_left_to_others() {
        assert!(flown(3, 1e-2, 4e-4).is_none());
    }
}
