//! States and wrench noise eliminated from a chain of segments, last to first: what is left is about the parameters.
//!
//! Each segment is a quadratic in `z = [x, e, eta, 1]`, the segments are tied by `x' = A x + B e + Gamma eta + d`. Lanes as in
//! the module `segment`.

#![allow(clippy::needless_range_loop)] // lanes of several rows go together

use super::lanes::{NOISE, PARAMETERS};
use super::segment::{MEASUREMENTS, Tangent, packed_start};
use nalgebra::{DMatrix, DVector, SMatrix};

/// A pivot below this fraction of its diagonal entry is rounding.
const ROUNDING: f64 = 1e-13;

/// A square matrix over lanes; only the first `lanes` rows and columns are used.
pub(crate) type Square<const W: usize> = [[f64; W]; W];

/// Pivot that was not positive: the data do not determine what was to be eliminated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Indefinite;

/// Quadratic cost of one segment and the map to the next one.
pub(crate) struct Stage<'a, const W: usize> {
    /// Packed normal matrices of the groups present, one after the other.
    pub(crate) normals: &'a [f64],
    /// Weights of these groups, `1 / sigma^2`.
    pub(crate) weights: &'a [f64],
    /// Wrench noise at which the stage is linearised, and the precision of its prior.
    pub(crate) noise: &'a [f64; 6],
    pub(crate) precision: &'a [f64; 6],
    /// Twelve rows `[A B Gamma d]`; `None` for the last segment of a stretch.
    pub(crate) transition: Option<&'a [[f64; W]]>,
}

/// What the forward pass needs of an eliminated stage.
#[derive(Clone)]
pub(crate) struct Gain<const W: usize> {
    /// `e = -K [x; eta; 1]`, lanes of the noise empty.
    pub(crate) rows: [[f64; W]; 6],
    /// Lower Cholesky factor of the noise block.
    factor: [[f64; 6]; 6],
}

impl<const W: usize> Gain<W> {
    pub(crate) fn new() -> Self {
        Self { rows: [[0.0; W]; 6], factor: [[0.0; 6]; 6] }
    }
}

/// The cost to go as a quadratic in `[x, eta, 1]`, lanes of the noise empty.
pub(crate) struct CostToGo<const W: usize> {
    lanes: usize,
    value: Box<Square<W>>,
    stage: Box<Square<W>>,
    product: Box<Square<W>>,
    /// Sum of the log determinants of the blocks eliminated.
    pub(crate) log_determinant: f64,
}

impl<const W: usize> CostToGo<W> {
    pub(crate) fn new(lanes: usize) -> Self {
        let zero = || Box::new([[0.0; W]; W]);
        Self { lanes, value: zero(), stage: zero(), product: zero(), log_determinant: 0.0 }
    }

    /// The end of the chain: nothing comes after.
    pub(crate) fn clear(&mut self) {
        *self.value = [[0.0; W]; W];
        self.log_determinant = 0.0;
    }

    /// Puts a stage before the chain eliminated so far.
    pub(crate) fn eliminate(&mut self, stage: &Stage<'_, W>, gain: &mut Gain<W>) -> Result<(), Indefinite> {
        self.sum_up(stage);
        match stage.transition {
            Some(transition) => self.carry(transition),
            None => self.add_parameters(),
        }
        self.eliminate_noise(gain)
    }

    /// The stage's own quadratic, upper triangle.
    fn sum_up(&mut self, stage: &Stage<'_, W>) {
        let (lanes, last) = (self.lanes, self.lanes - 1);
        let length = stage.normals.len() / stage.weights.len().max(1);
        for i in 0..lanes {
            let row = &mut self.stage[i];
            *row = [0.0; W];
            let start = packed_start(i, lanes);
            for (normals, weight) in stage.normals.chunks_exact(length).zip(stage.weights) {
                for (sum, value) in row[i..lanes].iter_mut().zip(&normals[start..]) {
                    *sum += weight * value;
                }
            }
        }
        for i in 0..6 {
            let (noise, precision) = (stage.noise[i], stage.precision[i]);
            self.stage[NOISE + i][NOISE + i] += precision;
            self.stage[NOISE + i][last] += precision * noise;
            self.stage[last][last] += precision * noise * noise;
        }
    }

    /// Adds what a later stretch says about the parameters.
    fn add_parameters(&mut self) {
        for a in PARAMETERS..self.lanes {
            for q in 0..W {
                self.stage[a][q] += self.value[a][q];
            }
        }
    }

    /// Adds `F^T V F`, upper triangle.
    fn carry(&mut self, transition: &[[f64; W]]) {
        let lanes = self.lanes;
        for a in (0..NOISE).chain(PARAMETERS..lanes) {
            let value = &self.value[a];
            let mut row = *value;
            row[..PARAMETERS].fill(0.0);
            let from = if a < NOISE { 0 } else { aligned(PARAMETERS) };
            for (factor, step) in value.iter().zip(transition) {
                add_scaled(&mut row[from..], *factor, &step[from..]);
            }
            self.product[a] = row;
        }
        for a in 0..lanes {
            let (row, from) = (&mut self.stage[a], aligned(a));
            for (step, product) in transition.iter().zip(self.product.iter()) {
                add_scaled(&mut row[from..], step[a], &product[from..]);
            }
            if a >= PARAMETERS {
                add_scaled(&mut row[from..], 1.0, &self.product[a][from..]);
            }
        }
    }

    fn eliminate_noise(&mut self, gain: &mut Gain<W>) -> Result<(), Indefinite> {
        let lanes = self.lanes;
        let mut l = [[0.0; 6]; 6];
        for a in 0..6 {
            for b in 0..=a {
                let sum = self.stage[NOISE + b][NOISE + a] - (0..b).map(|i| l[a][i] * l[b][i]).sum::<f64>();
                if a == b {
                    if sum.is_nan() || sum <= 0.0 {
                        return Err(Indefinite);
                    }
                    l[a][a] = sum.sqrt();
                    self.log_determinant += sum.ln();
                } else {
                    l[a][b] = sum / l[b][b];
                }
            }
        }
        let mut y = [[0.0; W]; 6];
        for a in 0..6 {
            let mut row = self.stage[NOISE + a];
            for q in 0..NOISE {
                row[q] = self.stage[q][NOISE + a];
            }
            row[NOISE..PARAMETERS].fill(0.0);
            for i in 0..a {
                for q in 0..W {
                    row[q] -= l[a][i] * y[i][q];
                }
            }
            let inverse = 1.0 / l[a][a];
            y[a] = row.map(|value| value * inverse);
        }
        for a in (0..lanes).filter(|a| !(NOISE..PARAMETERS).contains(a)) {
            let mut row = self.stage[a];
            row[NOISE..PARAMETERS].fill(0.0);
            let from = aligned(a);
            for y in &y {
                add_scaled(&mut row[from..], -y[a], &y[from..]);
            }
            // The lower triangle comes from the rows above.
            for q in 0..a {
                row[q] = self.value[q][a];
            }
            self.value[a] = row;
        }
        for a in (0..6).rev() {
            let mut row = y[a];
            for i in a + 1..6 {
                for q in 0..W {
                    row[q] -= l[i][a] * gain.rows[i][q];
                }
            }
            let inverse = 1.0 / l[a][a];
            gain.rows[a] = row.map(|value| value * inverse);
        }
        gain.factor = l;
        Ok(())
    }

    /// Adds what is known of the first state and the parameters from elsewhere.
    pub(crate) fn add(&mut self, arrival: &Square<W>) {
        for (row, known) in self.value.iter_mut().zip(arrival) {
            for (sum, value) in row.iter_mut().zip(known) {
                *sum += value;
            }
        }
    }

    /// Takes a quadratic in `[x, eta, 1]` over a stage to what follows it: to the next state, or to the parameters
    /// alone where a stretch ends. Any cost to go is lost.
    ///
    /// # Source
    /// `x = A^-1 (x' - B e - Gamma eta - d)` in the sum of both; then `e` is eliminated.
    pub(crate) fn arrive(
        &mut self,
        stage: &Stage<'_, W>,
        arrival: &mut Square<W>,
        gain: &mut Gain<W>,
    ) -> Result<(), Indefinite> {
        let lanes = self.lanes;
        self.sum_up(stage);
        for i in 0..lanes {
            for j in i..lanes {
                self.stage[i][j] += arrival[i][j];
                self.stage[j][i] = self.stage[i][j];
            }
        }
        if let Some(transition) = stage.transition {
            self.change_state(transition)?;
            self.eliminate_noise(gain)?;
        } else {
            self.eliminate_noise(gain)?;
            self.release();
        }
        *arrival = *self.value;
        Ok(())
    }

    /// The stage in terms of the state it leads to.
    fn change_state(&mut self, transition: &[[f64; W]]) -> Result<(), Indefinite> {
        let lanes = self.lanes;
        let by_state = SMatrix::<f64, 12, 12>::from_fn(|i, j| transition[i][j]);
        let back = by_state.try_inverse().ok_or(Indefinite)?;
        // x = F [x', e, eta, 1].
        let mut before = [[0.0; W]; 12];
        for (i, row) in before.iter_mut().enumerate() {
            for (k, step) in transition.iter().enumerate() {
                let factor = back[(i, k)];
                row[k] = factor;
                for q in NOISE..W {
                    row[q] -= factor * step[q];
                }
            }
        }
        for a in 0..lanes {
            let value = &self.stage[a];
            let mut row = *value;
            row[..NOISE].fill(0.0);
            for (factor, before) in value.iter().zip(&before) {
                for q in 0..W {
                    row[q] += factor * before[q];
                }
            }
            self.product[a] = row;
        }
        for a in 0..lanes {
            let mut row = if a < NOISE { [0.0; W] } else { self.product[a] };
            for (before, product) in before.iter().zip(self.product.iter()) {
                let factor = before[a];
                for q in 0..W {
                    row[q] += factor * product[q];
                }
            }
            self.stage[a] = row;
        }
        Ok(())
    }

    /// Eliminates the first state of the chain; what comes before knows nothing of it.
    pub(crate) fn release(&mut self) -> First<W> {
        let (lanes, value) = (self.lanes, &mut self.value);
        let (mut l, mut y) = ([[0.0; 12]; 12], [[0.0; W]; 12]);
        for a in 0..12 {
            for b in 0..a {
                l[a][b] = (value[a][b] - (0..b).map(|i| l[a][i] * l[b][i]).sum::<f64>()) / l[b][b];
            }
            let pivot = value[a][a] - (0..a).map(|i| l[a][i] * l[a][i]).sum::<f64>();
            // A direction that a few samples between two gaps do not show says nothing and stays where it is.
            let shown = pivot > ROUNDING * value[a][a];
            l[a][a] = if shown { pivot.sqrt() } else { f64::INFINITY };
            self.log_determinant += if shown { pivot.ln() } else { 0.0 };
            for q in PARAMETERS..lanes {
                y[a][q] = (value[a][q] - (0..a).map(|i| l[a][i] * y[i][q]).sum::<f64>()) / l[a][a];
            }
        }
        for a in 0..lanes {
            let mut row = if a < PARAMETERS { [0.0; W] } else { value[a] };
            row[..PARAMETERS].fill(0.0);
            if a >= PARAMETERS {
                for y in &y {
                    for q in PARAMETERS..lanes {
                        row[q] -= y[a] * y[q];
                    }
                }
            }
            value[a] = row;
        }
        let mut rows = y;
        for a in (0..12).rev() {
            for q in PARAMETERS..lanes {
                rows[a][q] = (y[a][q] - (a + 1..12).map(|i| l[i][a] * rows[i][q]).sum::<f64>()) / l[a][a];
            }
        }
        First { rows, factor: l }
    }

    /// What the chain eliminated so far says about the parameters by itself.
    pub(crate) fn alone(&mut self) -> Schur {
        let (value, log_determinant) = (self.value.clone(), self.log_determinant);
        self.release();
        let schur = self.schur();
        (self.value, self.log_determinant) = (value, log_determinant);
        schur
    }

    /// What the chain says about the parameters, once the first state is released.
    pub(crate) fn schur(&self) -> Schur {
        let last = self.lanes - 1;
        let columns = last - PARAMETERS;
        Schur {
            information: DMatrix::from_fn(columns, columns, |i, j| {
                self.value[PARAMETERS + i.min(j)][PARAMETERS + i.max(j)]
            }),
            gradient: DVector::from_fn(columns, |i, _| -self.value[PARAMETERS + i][last]),
            constant: self.value[last][last],
            log_determinant: self.log_determinant,
        }
    }
}

/// First state of a stretch as a function of the parameters.
#[derive(Clone)]
pub(crate) struct First<const W: usize> {
    /// `x = -rows [eta; 1]`.
    rows: [[f64; W]; 12],
    factor: [[f64; 12]; 12],
}

impl<const W: usize> First<W> {
    fn state(&self, z: &[f64; W]) -> [f64; 12] {
        self.rows.map(|row| -row[PARAMETERS..].iter().zip(&z[PARAMETERS..]).map(|(a, b)| a * b).sum::<f64>())
    }
}

/// The quadratic in the parameters alone, `d^T S d - 2 g^T d + constant`.
pub(crate) struct Schur {
    /// S.
    pub(crate) information: DMatrix<f64>,
    /// g.
    pub(crate) gradient: DVector<f64>,
    /// Weighted squares of all residuals when only states and noise follow.
    pub(crate) constant: f64,
    /// Of states and noise.
    pub(crate) log_determinant: f64,
}

impl Schur {
    /// Weighted squares of all residuals at the optimum; `None` where there is none.
    pub(crate) fn least(&self) -> Option<f64> {
        let step = self.information.clone().cholesky()?.solve(&self.gradient);
        Some(self.constant - self.gradient.dot(&step))
    }
}

/// A quadratic in `[x, eta, 1]` about a point that lies `state` and `parameters` further.
pub(crate) fn recenter<const W: usize>(quadratic: &mut Square<W>, state: &[f64; 12], parameters: &[f64]) {
    let last = PARAMETERS + parameters.len();
    let mut step = [0.0; W];
    step[..12].copy_from_slice(state);
    step[PARAMETERS..last].copy_from_slice(parameters);
    step[last] = 1.0;
    let by_one: [f64; W] = core::array::from_fn(|a| if a <= last { inner(&quadratic[a], &step) } else { 0.0 });
    for (row, value) in quadratic.iter_mut().zip(by_one) {
        row[last] = value;
    }
    quadratic[last] = by_one;
    quadratic[last][last] = inner(&by_one, &step);
}

/// Steps of states and noise that belong to a step of the parameters.
pub(crate) fn forward<const W: usize>(
    step: &[f64],
    firsts: &[Option<First<W>>],
    gains: &[Gain<W>],
    transitions: &[Tangent<W>],
    mut visit: impl FnMut(usize, &[f64; W]),
) {
    let last = PARAMETERS + step.len();
    let mut z = [0.0; W];
    z[PARAMETERS..last].copy_from_slice(step);
    z[last] = 1.0;
    for (j, ((gain, transition), first)) in gains.iter().zip(transitions).zip(firsts).enumerate() {
        z[NOISE..PARAMETERS].fill(0.0);
        if let Some(first) = first {
            let state = first.state(&z);
            z[..NOISE].copy_from_slice(&state);
        }
        let noise = gain.rows.map(|row| -inner(&row, &z));
        z[NOISE..PARAMETERS].copy_from_slice(&noise);
        visit(j, &z);
        let next = transition.map(|rows| rows.map(|row| inner(&row, &z)));
        z[..NOISE].copy_from_slice(next.as_flattened());
    }
}

/// First lane of the block of eight that holds this one.
fn aligned(lane: usize) -> usize {
    lane / 8 * 8
}

fn add_scaled(sum: &mut [f64], factor: f64, row: &[f64]) {
    for (sum, value) in sum.iter_mut().zip(row) {
        *sum += factor * value;
    }
}

fn inner<const W: usize>(a: &[f64; W], b: &[f64; W]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Sums over a chain that noise levels are judged by.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Evidence {
    /// Weighted squares of residuals at the optimum, by group, in units of its standard deviation.
    pub(crate) squares: [f64; MEASUREMENTS],
    /// Degrees of freedom that the fit takes from each group.
    pub(crate) absorbed: [f64; MEASUREMENTS],
    /// The same of the wrench noise (torque, force).
    pub(crate) wrench_squares: [f64; 2],
    pub(crate) wrench_absorbed: [f64; 2],
    /// Components of torque noise, and as many of force noise.
    pub(crate) wrench_counted: f64,
}

/// Covariance of `[x, e, eta]` of one segment after another, and the optimum of the quadratic there.
pub(crate) struct Posterior<const W: usize> {
    covariance: Box<Square<W>>,
    /// Optimum `[x, e, eta, 1]`.
    optimum: [f64; W],
    last: usize,
}

impl<const W: usize> Posterior<W> {
    /// The parameters alone; `None` where they are not determined.
    pub(crate) fn new(schur: &Schur) -> Option<Self> {
        let columns = schur.gradient.len();
        let last = PARAMETERS + columns;
        let inverse = schur.information.clone().cholesky()?.inverse();
        let step = &inverse * &schur.gradient;
        let mut covariance = Box::new([[0.0; W]; W]);
        for i in 0..columns {
            for j in 0..columns {
                covariance[PARAMETERS + i][PARAMETERS + j] = inverse[(i, j)];
            }
        }
        let mut optimum = [0.0; W];
        optimum[PARAMETERS..last].copy_from_slice(step.as_slice());
        optimum[last] = 1.0;
        Some(Self { covariance, optimum, last })
    }

    /// To the first state of a stretch.
    pub(crate) fn enter(&mut self, first: &First<W>) {
        let last = self.last;
        // x = -A eta + noise of the state given the parameters.
        let mut cross = [[0.0; W]; 12];
        for (row, first) in cross.iter_mut().zip(&first.rows) {
            for (factor, of_parameter) in first[PARAMETERS..last].iter().zip(&self.covariance[PARAMETERS..]) {
                for (sum, value) in row[PARAMETERS..].iter_mut().zip(&of_parameter[PARAMETERS..]) {
                    *sum -= factor * value;
                }
            }
        }
        let given = inverse_of_factored(&first.factor);
        for i in 0..12 {
            for j in 0..12 {
                let through: f64 = (PARAMETERS..last).map(|k| cross[i][k] * first.rows[j][k]).sum();
                self.covariance[i][j] = given[i][j] - through;
            }
            for j in PARAMETERS..last {
                self.covariance[i][j] = cross[i][j];
                self.covariance[j][i] = cross[i][j];
            }
        }
        let state = first.state(&self.optimum);
        self.optimum[..NOISE].copy_from_slice(&state);
    }

    /// Adds the noise of the segment reached.
    pub(crate) fn with_noise(&mut self, gain: &Gain<W>) {
        let last = self.last;
        self.optimum[NOISE..PARAMETERS].fill(0.0);
        let noise = gain.rows.map(|row| -inner(&row, &self.optimum));
        self.optimum[NOISE..PARAMETERS].copy_from_slice(&noise);
        for row in self.covariance.iter_mut() {
            row[NOISE..PARAMETERS].fill(0.0);
        }
        let mut cross = [[0.0; W]; 6];
        for (row, gain) in cross.iter_mut().zip(&gain.rows) {
            for k in (0..NOISE).chain(PARAMETERS..last) {
                for q in 0..W {
                    row[q] -= gain[k] * self.covariance[k][q];
                }
            }
        }
        let given = inverse_of_factored(&gain.factor);
        for i in 0..6 {
            let mut row = cross[i];
            for j in 0..6 {
                let through: f64 = (0..NOISE).chain(PARAMETERS..last).map(|k| cross[i][k] * gain.rows[j][k]).sum();
                row[NOISE + j] = given[i][j] - through;
            }
            for k in (0..NOISE).chain(PARAMETERS..last) {
                self.covariance[k][NOISE + i] = row[k];
            }
            self.covariance[NOISE + i] = row;
        }
    }

    /// On to the next segment.
    ///
    /// In closed loop, `x' = (A - B K) x + ...`, which is stable where the bare transition is not.
    pub(crate) fn advance(&mut self, gain: &Gain<W>, transition: &Tangent<W>) {
        let last = self.last;
        let transition = transition.as_flattened();
        let given = inverse_of_factored(&gain.factor);
        let (mut closed, mut cross, mut spread) = ([[0.0; W]; 12], [[0.0; W]; 12], [[0.0; 6]; 12]);
        for i in 0..12 {
            closed[i] = transition[i];
            let through = &transition[i][NOISE..PARAMETERS];
            for (factor, row) in through.iter().zip(&gain.rows) {
                for q in 0..W {
                    closed[i][q] -= factor * row[q];
                }
            }
            closed[i][NOISE..PARAMETERS].fill(0.0);
            for k in (0..NOISE).chain(PARAMETERS..last) {
                for q in 0..W {
                    cross[i][q] += closed[i][k] * self.covariance[k][q];
                }
            }
            spread[i] = core::array::from_fn(|j| through.iter().zip(&given).map(|(b, row)| b * row[j]).sum());
        }
        for i in 0..12 {
            for j in 0..=i {
                let noise: f64 = spread[i].iter().zip(&transition[j][NOISE..]).map(|(a, b)| a * b).sum();
                let state: f64 = (0..NOISE).chain(PARAMETERS..last).map(|k| cross[i][k] * closed[j][k]).sum();
                self.covariance[i][j] = state + noise;
                self.covariance[j][i] = state + noise;
            }
            for k in PARAMETERS..last {
                self.covariance[i][k] = cross[i][k];
                self.covariance[k][i] = cross[i][k];
            }
        }
        let next: [f64; 12] = core::array::from_fn(|i| inner(&transition[i], &self.optimum));
        self.optimum[..12].copy_from_slice(&next);
    }

    /// Weighted squares of residuals at the optimum, and the trace of normal matrix times covariance, of one group.
    pub(crate) fn contract(&self, packed: &[f64]) -> (f64, f64) {
        let (mut square, mut trace) = (0.0, 0.0);
        for i in 0..=self.last {
            let row = &packed[packed_start(i, self.last + 1)..][..=self.last - i];
            let (z, covariance) = (&self.optimum[i..], &self.covariance[i][i..]);
            square -= row[0] * z[0] * z[0];
            trace -= row[0] * covariance[0];
            let (mut along, mut over) = (0.0, 0.0);
            for ((value, z), c) in row.iter().zip(z).zip(covariance) {
                along += value * z;
                over += value * c;
            }
            square += 2.0 * along * z[0];
            trace += 2.0 * over;
        }
        (square, trace)
    }

    /// Expected noise of the wrench, given the step of the optimum, and its variance.
    pub(crate) fn noise(&self, i: usize) -> (f64, f64) {
        (self.optimum[NOISE + i], self.covariance[NOISE + i][NOISE + i])
    }
}

/// Inverse of `L L^T`.
fn inverse_of_factored<const N: usize>(l: &[[f64; N]; N]) -> [[f64; N]; N] {
    let mut inverse = [[0.0; N]; N];
    for j in 0..N {
        for i in j..N {
            let unit = if i == j { 1.0 } else { 0.0 };
            inverse[i][j] = (unit - (j..i).map(|k| l[i][k] * inverse[k][j]).sum::<f64>()) / l[i][i];
        }
    }
    core::array::from_fn(|i| {
        core::array::from_fn(|j| (i.max(j)..N).map(|k| inverse[k][i] * inverse[k][j]).sum::<f64>())
    })
}
