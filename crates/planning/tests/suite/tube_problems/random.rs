//! Random programs, with everything in them that makes an active set hard.

use super::{Matrices, uniform};

/// A program with linear part and bounds.
#[derive(Clone, Debug)]
pub struct RandomProgram {
    pub matrices: Matrices,
    pub linear: Vec<f64>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
}

impl RandomProgram {
    /// Rows among which some are copies, opposites or combinations of others, or empty; bounds on one side or both, some that meet,
    /// some equations. Most programs have a solution because a point fulfils all rows; of the others some do not.
    pub fn new(seed: &mut u64, n: usize, m: usize) -> Self {
        let root: Vec<f64> = (0..n * n).map(|_| uniform(seed)).collect();
        let scales: Vec<f64> = (0..n).map(|_| f64::exp2(3.0 * uniform(seed))).collect();
        let mut hessian = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                let product: f64 = (0..n).map(|k| root[i * n + k] * root[j * n + k]).sum();
                hessian[i * n + j] = (product + if i == j { 0.1 } else { 0.0 }) * scales[i] * scales[j];
            }
        }
        let slope = 10.0 * uniform(seed).abs();
        let linear = (0..n).map(|_| slope * uniform(seed)).collect();
        let mut rows: Vec<f64> = (0..n * m).map(|_| uniform(seed)).collect();
        for row in 2..m {
            let kind = choice(seed, 10);
            for column in 0..n {
                let (one, two) = (rows[(row - 1) * n + column], rows[(row - 2) * n + column]);
                let entry = &mut rows[row * n + column];
                match kind {
                    0 => *entry = one,
                    1 => *entry = -2.0 * one,
                    2 => *entry = one + 0.5 * two,
                    3 if row % 5 == 0 => *entry = 0.0,
                    4 if column % 4 != 0 => *entry = 0.0,
                    _ => {}
                }
            }
        }
        let point: Vec<f64> = (0..n).map(|_| uniform(seed)).collect();
        let is_random = choice(seed, 4) == 0;
        let most_equations = n / 2;
        let mut matrices = Matrices { hessian, rows, equality: vec![false; m] };
        let (mut lower, mut upper) = (vec![f64::NEG_INFINITY; m], vec![f64::INFINITY; m]);
        for row in 0..m {
            let value: f64 = matrices.rows[row * n..][..n].iter().zip(&point).map(|(a, x)| a * x).sum();
            // Often zero, so that many rows meet in the point.
            let room = |seed: &mut u64| if choice(seed, 3) == 0 { 0.0 } else { 2.0 * uniform(seed).abs() };
            let away = if is_random { 0.3 * uniform(seed) } else { 0.0 };
            match choice(seed, 8) {
                0 | 1 => upper[row] = value + away + room(seed),
                2 | 3 => lower[row] = value + away - room(seed),
                4 if row < most_equations => {
                    matrices.equality[row] = true;
                    (lower[row], upper[row]) = (value + away, value + away);
                }
                5 => (lower[row], upper[row]) = (value + away, value + away),
                6 if is_random && choice(seed, 20) == 0 => (lower[row], upper[row]) = (value + 0.1, value - 0.1),
                _ => (lower[row], upper[row]) = (value + away - room(seed), value + away + room(seed)),
            }
        }
        // Rows that meet leave a point of few dimensions: most of them are let go.
        let mut fixed = 0;
        for row in 0..m {
            if lower[row] >= upper[row] && !matrices.equality[row] {
                fixed += 1;
                if fixed > n / 3 {
                    upper[row] += 1.0;
                }
            }
        }
        Self { matrices, linear, lower, upper }
    }

    pub fn cost(&self, x: &[f64]) -> f64 {
        let n = x.len();
        let product = |i: usize| dot(&self.matrices.hessian[i * n..][..n], x);
        (0..n).map(|i| x[i] * (0.5 * product(i) + self.linear[i])).sum()
    }

    pub fn row_values(&self, x: &[f64]) -> Vec<f64> {
        self.matrices.rows.chunks_exact(x.len()).map(|row| dot(row, x)).collect()
    }

    /// Largest amount by which a row is beyond a bound.
    pub fn violation(&self, x: &[f64]) -> f64 {
        let values = self.row_values(x);
        let beyond = values.iter().zip(self.lower.iter().zip(&self.upper)).map(|(v, (l, u))| f64::max(v - u, l - v));
        beyond.fold(0.0, f64::max)
    }

    /// What is left of the optimality conditions: of the gradient, as a share of the largest multiplier where that is above one; and
    /// the largest distance of a row from the bound that the sign of its multiplier names.
    pub fn optimality(&self, x: &[f64], multipliers: impl Iterator<Item = (usize, f64)>) -> [f64; 2] {
        let n = x.len();
        let mut gradient: Vec<f64> =
            (0..n).map(|i| dot(&self.matrices.hessian[i * n..][..n], x) + self.linear[i]).collect();
        let (values, mut distance, mut largest) = (self.row_values(x), 0.0, 1.0);
        for (row, multiplier) in multipliers {
            let normal = &self.matrices.rows[row * n..][..n];
            gradient.iter_mut().zip(normal).for_each(|(gradient, entry)| *gradient += multiplier * entry);
            let bound = if multiplier > 0.0 { self.upper[row] } else { self.lower[row] };
            if multiplier != 0.0 {
                distance = f64::max(distance, (values[row] - bound).abs());
                largest = f64::max(largest, multiplier.abs());
            }
        }
        [gradient.iter().fold(0.0, |most, entry| f64::max(most, entry.abs())) / largest, distance]
    }

    /// Whether factors of the rows prove that there is no solution: `A' y` is nothing, while `y . A x` would have to be below zero;
    /// or a row whose bounds exclude each other.
    pub fn is_proof(&self, certificate: &[f64], crossed: Option<usize>) -> bool {
        if let Some(row) = crossed {
            return self.lower[row] > self.upper[row]
                || self.lower[row] == f64::INFINITY
                || self.upper[row] == f64::NEG_INFINITY;
        }
        let n = self.linear.len();
        let (mut sum, mut size, mut support) = (vec![0.0; n], 0.0, 0.0);
        for (row, factor) in certificate.iter().enumerate() {
            if *factor != 0.0 {
                support += factor * if *factor > 0.0 { self.upper[row] } else { self.lower[row] };
                for (sum, entry) in sum.iter_mut().zip(&self.matrices.rows[row * n..][..n]) {
                    *sum += factor * entry;
                    size = f64::max(size, (factor * entry).abs());
                }
            }
        }
        let left: f64 = sum.iter().map(|sum| sum.abs()).sum();
        support < 0.0 && left <= 1e-10 * size && left * 1e3 < -support
    }
}

/// One of so many.
fn choice(seed: &mut u64, kinds: u64) -> u64 {
    uniform(seed);
    (*seed >> 33) % kinds
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
