//! The limits of a motion at equal steps of a period: distances to them, derivatives, and the products of the latter.
//!
//! Every limit is a function of the channels at one sample, and those are sums of sines and cosines of the harmonics. The sum
//! over the samples of weighted products of gradients therefore needs, of each pair of channels, the sums of a weight times
//! the sines and cosines of up to twice the harmonics only: no limit has a row of its own.

use super::objective::{Channels, RestTable, channels, instant};
use super::problem::ExcitationProblem;
use crate::fourier::{FourierBasis, MotionInstant};
use crate::lie::skew;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3, Vector6};

/// What a wrench depends on: accelerations of the positions; values, rates and accelerations of the angles.
const WRENCH_TERMS: usize = 12;
/// Channel and order of each.
const TERMS: [(usize, usize); WRENCH_TERMS] =
    [(0, 2), (1, 2), (2, 2), (3, 0), (3, 1), (3, 2), (4, 0), (4, 1), (4, 2), (5, 0), (5, 1), (5, 2)];
/// Values, rates and accelerations of all channels.
const STATES: usize = 18;
/// Products of states by their own limits, then of pairs of wrench terms.
const PRODUCTS: usize = STATES + WRENCH_TERMS * (WRENCH_TERMS + 1) / 2;

/// `state * per_share <= 1` of one channel's value, rate or acceleration.
struct StateLimit {
    channel: usize,
    order: usize,
    per_share: f64,
}

/// Limits on the wrench, and what was found at the samples.
struct WrenchSamples<'a> {
    parameters: &'a SVector<f64, 10>,
    /// Half-spaces `normal . wrench <= share`.
    normals: Vec<Vector6<f64>>,
    share: f64,
    instants: Vec<MotionInstant>,
    by_terms: Vec<SMatrix<f64, 6, WRENCH_TERMS>>,
}

/// The limits as functions of scaled numbers, in which each channel's limits are about a unit sphere.
pub(super) struct Limits<'a> {
    basis: FourierBasis,
    free: usize,
    moving: Vec<usize>,
    /// From scaled to free numbers of each moving channel.
    scaling: Vec<DMatrix<f64>>,
    /// From scaled numbers to coefficients of each moving channel.
    coefficients: Vec<DMatrix<f64>>,
    /// At time zero nothing moves: without it.
    table: RestTable,
    states: Vec<StateLimit>,
    wrench: Option<WrenchSamples<'a>>,
    waves: Waves,
    numbers: Vec<Channels>,
}

impl<'a> Limits<'a> {
    /// Limits at equal steps of a period.
    pub fn new<const P: usize>(problem: &'a ExcitationProblem<P>, samples: usize) -> Self {
        let basis = problem.basis;
        let free = basis.coefficients() - 3;
        let mut states = Vec::new();
        for (channel, limits) in &problem.channels {
            for (order, [lower, upper]) in limits.intervals().into_iter().enumerate() {
                let finite = [upper, lower].into_iter().filter(|bound| bound.is_finite());
                let channel = *channel as usize;
                states.extend(finite.map(|bound| StateLimit { channel, order, per_share: 1.0 / bound }));
            }
        }
        let wrench = problem.wrench_limits.as_ref().map(|limits| WrenchSamples {
            parameters: limits.parameters(),
            normals: limits.half_spaces().iter().map(|(normal, bound)| normal / *bound).collect(),
            share: 1.0,
            instants: Vec::with_capacity(samples),
            by_terms: Vec::with_capacity(samples),
        });
        let rest = basis.rest_to_rest();
        let mut limits = Self {
            basis,
            free,
            moving: problem.channels.iter().map(|(channel, _)| *channel as usize).collect(),
            scaling: Vec::new(),
            coefficients: vec![rest.clone(); problem.channels.len()],
            table: RestTable::after_zero(&basis, samples),
            states,
            wrench,
            waves: Waves::new(&basis, samples, if problem.wrench_limits.is_some() { PRODUCTS } else { STATES }),
            numbers: vec![[0.0; 6]; free],
        };
        let mut gram = DMatrix::zeros(limits.numbers(), limits.numbers());
        let of_states = limits.states.len();
        limits.waves.clear();
        let weights = vec![1.0; of_states];
        for sample in 0..samples - 1 {
            let mut products = [0.0; PRODUCTS];
            add_state_products(&limits.states, &weights, &mut products);
            limits.waves.add(sample, &products);
        }
        limits.assemble(&mut gram);
        limits.scaling = (0..limits.moving.len())
            .map(|part| {
                let own = limits.states.iter().filter(|limit| limit.channel == limits.moving[part]).count();
                let block = gram.view((part * free, part * free), (free, free)) / (own * (samples - 1)).max(1) as f64;
                // The limits span all numbers: more samples than coefficients, and at least one limit.
                let inverse = block.cholesky().and_then(|cholesky| cholesky.unpack().transpose().try_inverse());
                inverse.unwrap_or_else(|| DMatrix::identity(free, free))
            })
            .collect();
        limits.coefficients = limits.scaling.iter().map(|scaling| &rest * scaling).collect();
        limits
    }

    /// Lets the wrench use this share of its limits only.
    pub fn keep_wrench_within(&mut self, share: f64) {
        if let Some(wrench) = &mut self.wrench {
            wrench.share = share;
        }
    }

    /// Number of scaled numbers.
    pub fn numbers(&self) -> usize {
        self.free * self.moving.len()
    }

    /// Free numbers of a channel.
    pub fn free(&self) -> usize {
        self.free
    }

    /// Number of limits.
    pub fn count(&self) -> usize {
        self.table.samples().len() * self.per_sample()
    }

    /// Whether some limits are not linear.
    pub fn are_curved(&self) -> bool {
        self.wrench.is_some()
    }

    fn per_sample(&self) -> usize {
        self.states.len() + self.wrench.as_ref().map_or(0, |wrench| wrench.normals.len())
    }

    /// Free numbers of every channel from scaled ones.
    pub fn free_numbers(&self, scaled: &[f64], free: &mut [Channels]) {
        for ((scaled, scaling), &channel) in scaled.chunks_exact(self.free).zip(&self.scaling).zip(&self.moving) {
            for (row, free) in free.iter_mut().enumerate() {
                free[channel] = scaling.row(row).iter().zip(scaled).map(|(a, b)| a * b).sum();
            }
        }
    }

    /// Scaled numbers from free ones.
    pub fn scaled_numbers(&self, free: &[Channels]) -> Option<Vec<f64>> {
        let mut scaled = Vec::with_capacity(self.numbers());
        for (scaling, &channel) in self.scaling.iter().zip(&self.moving) {
            let own = DVector::from_iterator(self.free, free.iter().map(|free| free[channel]));
            scaled.extend(scaling.solve_upper_triangular(&own)?.iter());
        }
        Some(scaled)
    }

    /// Adds a gradient by free numbers to one by scaled numbers.
    pub fn add_scaled_gradient(&self, free: &[Channels], scaled: &mut [f64]) {
        let parts = scaled.chunks_exact_mut(self.free).zip(&self.scaling).zip(&self.moving);
        for ((scaled, scaling), &channel) in parts {
            for (column, scaled) in scaled.iter_mut().enumerate() {
                *scaled += scaling.column(column).iter().zip(free).map(|(a, free)| a * free[channel]).sum::<f64>();
            }
        }
    }

    /// Brings each channel's numbers to where the largest share of its limits is this; then all, for the wrench.
    pub fn shrink(&mut self, scaled: &mut [f64], share: f64) {
        let largest = self.free_numbers_taken(scaled, |limits, free| {
            let mut largest = [f64::MIN_POSITIVE; 6];
            for functions in limits.table.samples() {
                let found = channels(functions, free);
                for limit in &limits.states {
                    let largest = &mut largest[limit.channel];
                    *largest = largest.max(found[limit.order][limit.channel] * limit.per_share);
                }
            }
            largest
        });
        for (numbers, &channel) in scaled.chunks_exact_mut(self.free).zip(&self.moving) {
            for number in numbers {
                *number *= share / largest[channel];
            }
        }
        self.retreat(scaled, 0.8);
    }

    /// Makes all numbers smaller by a factor, again and again, until no limit is exceeded.
    pub fn retreat(&mut self, scaled: &mut [f64], factor: f64) {
        let mut slacks = Vec::new();
        for _ in 0..60 {
            if self.slacks(scaled, &mut slacks) {
                return;
            }
            for number in scaled.iter_mut() {
                *number *= factor;
            }
        }
    }

    /// Distances to all limits, one at rest and zero at the limit; `false` where one is not positive.
    pub fn slacks(&mut self, scaled: &[f64], slacks: &mut Vec<f64>) -> bool {
        slacks.clear();
        self.free_numbers_taken(scaled, |limits, free| {
            if let Some(wrench) = &mut limits.wrench {
                wrench.instants.clear();
            }
            for functions in limits.table.samples() {
                let found = channels(functions, free);
                let first = slacks.len();
                slacks.extend(
                    limits.states.iter().map(|limit| 1.0 - found[limit.order][limit.channel] * limit.per_share),
                );
                if let Some(wrench) = &mut limits.wrench {
                    let Some(instant) = instant(&found) else { return false };
                    let needed = instant.regressor() * wrench.parameters;
                    slacks.extend(wrench.normals.iter().map(|normal| wrench.share - normal.dot(&needed)));
                    wrench.instants.push(instant);
                }
                let is_inside = slacks.iter().skip(first).all(|&slack| slack > 0.0);
                if !is_inside {
                    return false;
                }
            }
            true
        })
    }

    /// Takes derivatives of the wrenches where the slacks were computed last.
    pub fn linearize(&mut self) {
        let Some(wrench) = &mut self.wrench else { return };
        wrench.by_terms.clear();
        for instant in &wrench.instants {
            let by_motion = wrench_by_motion(wrench.parameters, &instant.angular_velocity_body);
            let by_channels = instant.sensitivities().map(|motion| by_motion * motion.fixed_rows::<9>(0));
            let mut by_terms = SMatrix::<f64, 6, WRENCH_TERMS>::zeros();
            for (mut column, (channel, order)) in by_terms.column_iter_mut().zip(TERMS) {
                column.copy_from(&by_channels[order].column(channel));
            }
            wrench.by_terms.push(by_terms);
        }
    }

    /// Adds `sum_j factor_j grad slack_j` to a gradient; of the wrench limits only, if asked.
    pub fn add_gradients(&mut self, factors: &[f64], wrench_only: bool, gradient: &mut DVector<f64>) {
        let mut by_free = core::mem::take(&mut self.numbers);
        by_free.fill([0.0; 6]);
        let samples = self.table.samples().zip(factors.chunks_exact(self.per_sample()));
        for (sample, (functions, factors)) in samples.enumerate() {
            let (of_states, of_wrench) = factors.split_at(self.states.len());
            let mut by_state = [[0.0; 6]; 3];
            if !wrench_only {
                for (limit, factor) in self.states.iter().zip(of_states) {
                    by_state[limit.order][limit.channel] -= factor * limit.per_share;
                }
            }
            if let Some(wrench) = &self.wrench {
                let pairs = wrench.normals.iter().zip(of_wrench);
                let force = pairs.fold(Vector6::zeros(), |sum, (normal, factor)| sum + normal * *factor);
                let by_terms = wrench.by_terms[sample].tr_mul(&force);
                for ((channel, order), by) in TERMS.into_iter().zip(by_terms.iter()) {
                    by_state[order][channel] -= by;
                }
            }
            for (function, by_free) in functions.iter().zip(by_free.iter_mut()) {
                for (function, by_state) in function.iter().zip(&by_state) {
                    for (by_free, by_state) in by_free.iter_mut().zip(by_state) {
                        *by_free += function * by_state;
                    }
                }
            }
        }
        self.add_scaled_gradient(&by_free, gradient.as_mut_slice());
        self.numbers = by_free;
    }

    /// Adds `sum_j weight_j grad slack_j grad slack_j^T`, lower triangle.
    pub fn add_products(&mut self, weights: &[f64], hessian: &mut DMatrix<f64>) {
        self.waves.clear();
        for (sample, weights) in weights.chunks_exact(self.per_sample()).enumerate() {
            let (of_states, of_wrench) = weights.split_at(self.states.len());
            let mut products = [0.0; PRODUCTS];
            add_state_products(&self.states, of_states, &mut products);
            if let Some(wrench) = &self.wrench {
                let mut middle = SMatrix::<f64, 6, 6>::zeros();
                for (normal, weight) in wrench.normals.iter().zip(of_wrench) {
                    middle.ger(*weight, normal, normal, 1.0);
                }
                let by_terms = &wrench.by_terms[sample];
                let half = middle * by_terms;
                let mut at = STATES;
                for left in 0..WRENCH_TERMS {
                    for right in left..WRENCH_TERMS {
                        products[at] = by_terms.column(left).dot(&half.column(right));
                        at += 1;
                    }
                }
            }
            self.waves.add(sample, &products);
        }
        self.assemble(hessian);
    }

    /// From the sums over the samples to products by scaled numbers: adds to the lower triangle.
    fn assemble(&mut self, hessian: &mut DMatrix<f64>) {
        let count = self.basis.coefficients();
        let mut block = DMatrix::zeros(count, count);
        let mut half = DMatrix::zeros(count, self.free);
        for (low, &column_channel) in self.moving.iter().enumerate() {
            for (high, &row_channel) in self.moving.iter().enumerate().skip(low) {
                block.fill(0.0);
                if low == high {
                    for order in 0..3 {
                        self.waves.add_to(&mut block, 3 * row_channel + order, [order, order]);
                    }
                }
                if self.wrench.is_some() {
                    let mut at = STATES;
                    for (left, (left_channel, left_order)) in TERMS.into_iter().enumerate() {
                        for (right_channel, right_order) in TERMS.into_iter().skip(left) {
                            if (left_channel, right_channel) == (column_channel, row_channel) {
                                self.waves.add_to(&mut block, at, [right_order, left_order]);
                                if low == high && left_order != right_order {
                                    self.waves.add_to(&mut block, at, [left_order, right_order]);
                                }
                            }
                            at += 1;
                        }
                    }
                }
                half.gemm(1.0, &block, &self.coefficients[low], 0.0);
                let mut target = hessian.view_mut((high * self.free, low * self.free), (self.free, self.free));
                target.gemm_tr(1.0, &self.coefficients[high], &half, 1.0);
            }
        }
    }

    /// Changes of the slacks along a direction.
    pub fn changes(&mut self, direction: &[f64], changes: &mut Vec<f64>) {
        changes.clear();
        self.free_numbers_taken(direction, |limits, free| {
            for (sample, functions) in limits.table.samples().enumerate() {
                let moved = channels(functions, free);
                changes.extend(limits.states.iter().map(|limit| -moved[limit.order][limit.channel] * limit.per_share));
                if let Some(wrench) = &limits.wrench {
                    let terms = TERMS.map(|(channel, order)| moved[order][channel]);
                    let change = wrench.by_terms[sample] * SVector::from(terms);
                    changes.extend(wrench.normals.iter().map(|normal| -normal.dot(&change)));
                }
            }
        });
    }

    fn free_numbers_taken<R>(&mut self, scaled: &[f64], then: impl FnOnce(&mut Self, &[Channels]) -> R) -> R {
        let mut free = core::mem::take(&mut self.numbers);
        self.free_numbers(scaled, &mut free);
        let found = then(self, &free);
        self.numbers = free;
        found
    }
}

/// Adds to the products of states, `[x, its rate, its acceleration, y ..]`, those by their own limits.
fn add_state_products(limits: &[StateLimit], weights: &[f64], products: &mut [f64; PRODUCTS]) {
    for (limit, weight) in limits.iter().zip(weights) {
        products[3 * limit.channel + limit.order] += weight * limit.per_share * limit.per_share;
    }
}

/// The wrench by `[angular velocity; angular acceleration; acceleration of the origin]`.
fn wrench_by_motion(p: &SVector<f64, 10>, w: &Vector3<f64>) -> SMatrix<f64, 6, 9> {
    let h = Vector3::new(p[1], p[2], p[3]);
    let inertia = Matrix3::new(p[4], p[5], p[6], p[5], p[7], p[8], p[6], p[8], p[9]);
    let mut by = SMatrix::<f64, 6, 9>::zeros();
    by.fixed_view_mut::<3, 3>(0, 0).copy_from(&(skew(w) * inertia - skew(&(inertia * w))));
    by.fixed_view_mut::<3, 3>(0, 3).copy_from(&inertia);
    by.fixed_view_mut::<3, 3>(0, 6).copy_from(&skew(&h));
    by.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-(skew(w) * skew(&h)) - skew(&w.cross(&h))));
    by.fixed_view_mut::<3, 3>(3, 3).copy_from(&-skew(&h));
    by.fixed_view_mut::<3, 3>(3, 6).fill_diagonal(p[0]);
    by
}

/// A basis function: amplitude times sine or cosine of so many turns per period.
struct Wave {
    amplitude: f64,
    is_sine: bool,
    turns: usize,
}

/// Sums over the samples of products times cosines and sines.
struct Waves {
    /// Basis functions, their first and their second derivatives.
    functions: [Vec<Wave>; 3],
    /// Twice the harmonics, and the constant.
    frequencies: usize,
    products: usize,
    /// Cosines, then sines, of one sample after the other.
    at_samples: Vec<f64>,
    /// Products, one cosine after the other, then one sine after the other.
    sums: Vec<f64>,
}

impl Waves {
    fn new(basis: &FourierBasis, samples: usize, products: usize) -> Self {
        let harmonics = basis.harmonics();
        let frequencies = 2 * harmonics + 1;
        let functions = core::array::from_fn(|order| {
            let amplitude = |turns| basis.frequency_rad_s(turns).powi([-1, 0, 1][order]);
            let is_odd = order == 1;
            let constant = Wave { amplitude: if order == 0 { 1.0 } else { 0.0 }, is_sine: false, turns: 0 };
            let sign = [1.0, 1.0, -1.0][order];
            let of_sines =
                (1..=harmonics).map(|turns| Wave { amplitude: sign * amplitude(turns), is_sine: !is_odd, turns });
            let sign = [-1.0, 1.0, 1.0][order];
            let of_cosines =
                (1..=harmonics).map(|turns| Wave { amplitude: sign * amplitude(turns), is_sine: is_odd, turns });
            core::iter::once(constant).chain(of_sines).chain(of_cosines).collect()
        });
        let angle =
            |sample: usize, turns: usize| core::f64::consts::TAU * ((sample * turns) % samples) as f64 / samples as f64;
        let at_sample = |sample: usize| {
            let cosines = (0..frequencies).map(move |turns| angle(sample, turns).cos());
            cosines.chain((0..frequencies).map(move |turns| angle(sample, turns).sin()))
        };
        let at_samples = (1..samples).flat_map(at_sample).collect();
        Self { functions, frequencies, products, at_samples, sums: vec![0.0; 2 * frequencies * products] }
    }

    fn clear(&mut self) {
        self.sums.fill(0.0);
    }

    fn add(&mut self, sample: usize, products: &[f64; PRODUCTS]) {
        let waves = self.at_samples.chunks_exact(2 * self.frequencies).nth(sample).unwrap_or_default();
        for (wave, sums) in waves.iter().zip(self.sums.chunks_exact_mut(self.products)) {
            for (sum, product) in sums.iter_mut().zip(products) {
                *sum += wave * product;
            }
        }
    }

    /// Adds the sums of one product times two basis functions of these orders of derivative, by row and by column.
    fn add_to(&self, block: &mut DMatrix<f64>, product: usize, [row_order, column_order]: [usize; 2]) {
        let cosine = |turns: usize| self.sums[turns * self.products + product];
        let sine = |turns: usize| self.sums[(self.frequencies + turns) * self.products + product];
        for (column, right) in self.functions[column_order].iter().enumerate() {
            for (row, left) in self.functions[row_order].iter().enumerate() {
                let (sum, difference) = (left.turns + right.turns, left.turns.abs_diff(right.turns));
                let is_larger = left.turns >= right.turns;
                let twice = match (left.is_sine, right.is_sine) {
                    (false, false) => cosine(difference) + cosine(sum),
                    (true, true) => cosine(difference) - cosine(sum),
                    (true, false) if is_larger => sine(sum) + sine(difference),
                    (true, false) => sine(sum) - sine(difference),
                    (false, true) if is_larger => sine(sum) - sine(difference),
                    (false, true) => sine(sum) + sine(difference),
                };
                block[(row, column)] += 0.5 * left.amplitude * right.amplitude * twice;
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::dynamics::InertialParameters;
    use crate::excitation::{ChannelLimits, SpaceExcitation, WrenchLimits};

    /// Limits of all kinds, some of them absent.
    pub fn problem() -> SpaceExcitation {
        let basis = FourierBasis::try_new(8.0, 3).unwrap();
        let mut limits = [ChannelLimits::symmetric(0.3, 0.2, 0.15); 6];
        limits[1] = ChannelLimits { lower: -0.1, upper: 0.4, rate: f64::INFINITY, acceleration: 0.3 };
        limits[4] = ChannelLimits { upper: f64::INFINITY, ..ChannelLimits::symmetric(0.5, 0.4, f64::INFINITY) };
        let inertia = Matrix3::new(0.3, 0.02, -0.03, 0.02, 0.25, 0.01, -0.03, 0.01, 0.4);
        let body = InertialParameters::about_origin(7.0, Vector3::new(0.05, -0.02, 0.03), inertia);
        let normal = |seed: f64| Vector6::from_fn(|i, _| (seed + 1.7 * i as f64).sin());
        let half_spaces = vec![(normal(0.3), 0.9), (normal(2.0), 1.3)];
        SpaceExcitation::try_new(basis, &limits, 20)
            .unwrap()
            .with_wrench_limits(WrenchLimits::try_new(&body, half_spaces).unwrap())
    }

    #[test]
    fn changes_of_slacks_are_central_differences() {
        let problem = problem();
        let mut limits = Limits::new(&problem, 24);
        let numbers = limits.numbers();
        let at = DVector::from_fn(numbers, |i, _| 0.1 * (1.3 * i as f64).cos());
        let direction = DVector::from_fn(numbers, |i, _| (0.7 * i as f64).sin());
        let mut slacks = |step: f64| {
            let mut found = Vec::new();
            limits.slacks((&at + &direction * step).as_slice(), &mut found);
            found
        };
        let (before, after) = (slacks(-1e-5), slacks(1e-5));
        let mut changes = Vec::new();
        slacks(0.0);
        limits.linearize();
        limits.changes(direction.as_slice(), &mut changes);
        assert_eq!((changes.len(), before.len()), (limits.count(), limits.count()));
        // Gradients and products are of the same rows.
        let factors: Vec<f64> = (0..changes.len()).map(|i| (0.2 * i as f64).cos()).collect();
        let mut gradient = DVector::zeros(numbers);
        limits.add_gradients(&factors, false, &mut gradient);
        let mut products = DMatrix::zeros(numbers, numbers);
        limits.add_products(&factors, &mut products);
        products.fill_upper_triangle_with_lower_triangle();
        let (mut along, mut twice) = (0.0, 0.0);
        for (i, change) in changes.iter().enumerate() {
            let expected = (after[i] - before[i]) / 2e-5;
            assert!((change - expected).abs() < 1e-9, "{i}: {change} {expected}");
            along += factors[i] * change;
            twice += factors[i] * change * change;
        }
        assert!((gradient.dot(&direction) - along).abs() < 1e-10 * along.abs().max(1.0));
        assert!((direction.dot(&(products * &direction)) - twice).abs() < 1e-10 * twice.abs().max(1.0));
    }
}
