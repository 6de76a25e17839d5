//! States and wrench noise eliminated from a chain of segments, last to first: what is left is about the parameters.
//!
//! Each segment is a quadratic in `z = [x, e, eta, 1]`, the segments are tied by `x' = A x + B e + Gamma eta + d`. Lanes as in
//! the module `segment`.

use super::segment::{MEASUREMENTS, NOISE, PARAMETERS, Tangent, packed_start};
use nalgebra::{DMatrix, DVector};

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
    /// Twelve rows `[A B Gamma d]`; `None` for the last segment.
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

    /// Covariance of the noise given everything else.
    fn noise_covariance(&self) -> [[f64; 6]; 6] {
        let l = &self.factor;
        // Columns of L^-1.
        let mut inverse = [[0.0; 6]; 6];
        for j in 0..6 {
            for i in j..6 {
                let unit = if i == j { 1.0 } else { 0.0 };
                inverse[i][j] = (unit - (j..i).map(|k| l[i][k] * inverse[k][j]).sum::<f64>()) / l[i][i];
            }
        }
        core::array::from_fn(|i| {
            core::array::from_fn(|j| (i.max(j)..6).map(|k| inverse[k][i] * inverse[k][j]).sum::<f64>())
        })
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
        if let Some(transition) = stage.transition {
            self.carry(transition);
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

    /// Adds `F^T V F`.
    fn carry(&mut self, transition: &[[f64; W]]) {
        let lanes = self.lanes;
        for a in (0..NOISE).chain(PARAMETERS..lanes) {
            let value = &self.value[a];
            let mut row = *value;
            row[..PARAMETERS].fill(0.0);
            for (factor, step) in value.iter().zip(transition) {
                for q in 0..W {
                    row[q] += factor * step[q];
                }
            }
            self.product[a] = row;
        }
        for a in 0..lanes {
            let row = &mut self.stage[a];
            for (step, product) in transition.iter().zip(self.product.iter()) {
                let factor = step[a];
                for q in 0..W {
                    row[q] += factor * product[q];
                }
            }
            if a >= PARAMETERS {
                for q in 0..W {
                    row[q] += self.product[a][q];
                }
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
            for y in &y {
                for q in 0..W {
                    row[q] -= y[a] * y[q];
                }
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

    /// Eliminates the first state: what the chain says about the parameters.
    pub(crate) fn finish(&self) -> Result<Schur<W>, Indefinite> {
        let (lanes, last, value) = (self.lanes, self.lanes - 1, &self.value);
        let columns = last - PARAMETERS;
        let (mut l, mut y, mut log_determinant) = ([[0.0; 12]; 12], [[0.0; W]; 12], self.log_determinant);
        for a in 0..12 {
            for b in 0..=a {
                let sum = value[a][b] - (0..b).map(|i| l[a][i] * l[b][i]).sum::<f64>();
                if a == b {
                    if sum.is_nan() || sum <= 0.0 {
                        return Err(Indefinite);
                    }
                    l[a][a] = sum.sqrt();
                    log_determinant += sum.ln();
                } else {
                    l[a][b] = sum / l[b][b];
                }
            }
        }
        for a in 0..12 {
            for q in PARAMETERS..lanes {
                y[a][q] = (value[a][q] - (0..a).map(|i| l[a][i] * y[i][q]).sum::<f64>()) / l[a][a];
            }
        }
        let left = |a: usize, b: usize| value[a][b] - (0..12).map(|i| y[i][a] * y[i][b]).sum::<f64>();
        let information = DMatrix::from_fn(columns, columns, |i, j| {
            let (i, j) = (PARAMETERS + i.min(j), PARAMETERS + i.max(j));
            left(i, j)
        });
        let gradient = DVector::from_fn(columns, |i, _| -left(PARAMETERS + i, last));
        let minimum = left(last, last);
        let mut first = y;
        for a in (0..12).rev() {
            for q in PARAMETERS..lanes {
                first[a][q] = (y[a][q] - (a + 1..12).map(|i| l[i][a] * first[i][q]).sum::<f64>()) / l[a][a];
            }
        }
        Ok(Schur { information, gradient, minimum, first, factor: l, log_determinant })
    }
}

/// The quadratic in the parameters alone, `d^T S d / 2 - g^T d`.
#[derive(Clone)]
pub(crate) struct Schur<const W: usize> {
    /// S.
    pub(crate) information: DMatrix<f64>,
    /// g.
    pub(crate) gradient: DVector<f64>,
    /// Value at d = 0 with states and noise at their best, twice.
    pub(crate) minimum: f64,
    /// The first state follows as `x = -first [eta; 1]`.
    first: [[f64; W]; 12],
    factor: [[f64; 12]; 12],
    /// Of states and noise.
    pub(crate) log_determinant: f64,
}

impl<const W: usize> Schur<W> {
    pub(crate) fn first_state(&self, step: &[f64]) -> [f64; 12] {
        core::array::from_fn(|a| {
            let row = &self.first[a][PARAMETERS..];
            -(row[step.len()] + step.iter().zip(row).map(|(d, x)| d * x).sum::<f64>())
        })
    }
}

/// Steps of states and noise that belong to a step of the parameters.
pub(crate) fn forward<const W: usize>(
    first: [f64; 12],
    step: &[f64],
    gains: &[Gain<W>],
    transitions: &[Tangent<W>],
    mut visit: impl FnMut(usize, &[f64; W]),
) {
    let last = PARAMETERS + step.len();
    let mut z = [0.0; W];
    z[PARAMETERS..last].copy_from_slice(step);
    z[last] = 1.0;
    z[..12].copy_from_slice(&first);
    for (j, (gain, transition)) in gains.iter().zip(transitions).enumerate() {
        z[NOISE..PARAMETERS].fill(0.0);
        let noise = gain.rows.map(|row| -inner(&row, &z));
        z[NOISE..PARAMETERS].copy_from_slice(&noise);
        visit(j, &z);
        let next = transition.map(|rows| rows.map(|row| inner(&row, &z)));
        z[..12].copy_from_slice(next.as_flattened());
    }
}

fn inner<const W: usize>(a: &[f64; W], b: &[f64; W]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
