use super::{Curvature, Factorisation};
use crate::local::Stages;
use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng as _;
use tumble_identification::noise::signed_unit;

type Random = ChaCha8Rng;

/// Sum of the squares of random columns.
fn squares<const N: usize>(random: &mut Random, rank: usize, scale: f64) -> [[f64; N]; N] {
    let columns: Vec<[f64; N]> =
        (0..rank).map(|_| core::array::from_fn(|_| scale.sqrt() * signed_unit(random))).collect();
    core::array::from_fn(|i| core::array::from_fn(|j| columns.iter().map(|column| column[i] * column[j]).sum()))
}

/// Positions that follow velocities, everything else coupled at random; tracking weights `tracking`, effort `effort`, `columns`
/// columns with entries up to `arrow`.
fn stages<const X: usize, const U: usize>(
    seed: u64,
    steps: usize,
    columns: usize,
    [tracking, effort, arrow]: [f64; 3],
) -> Stages<X, U> {
    let random = &mut Random::seed_from_u64(seed);
    let mut stages = Stages::new(steps, columns);
    for by_state in &mut stages.by_state {
        for (i, row) in by_state.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry = if i == j {
                    1.0
                } else if i < X / 4 && j == i + X / 4 {
                    0.5
                } else if j < X / 2 {
                    0.0
                } else {
                    0.1 * signed_unit(random)
                };
            }
        }
    }
    for by_input in &mut stages.by_input {
        *by_input = core::array::from_fn(|_| core::array::from_fn(|_| 0.1 * signed_unit(random)));
    }
    for curvature in &mut stages.state_curvature {
        *curvature = squares(random, X, tracking);
    }
    for curvature in &mut stages.input_curvature {
        *curvature = squares(random, 2, effort);
        (0..U).for_each(|i| curvature[i][i] += effort);
    }
    stages.arrow = (0..columns * steps * U).map(|_| arrow * signed_unit(random)).collect();
    stages
}

/// By its definition: the changes of all nodes by all inputs, and what they cost.
fn brute_force<const X: usize, const U: usize>(stages: &Stages<X, U>, damping: f64) -> DMatrix<f64> {
    let (steps, n) = (stages.by_input.len(), stages.unknowns());
    let matrix = |rows: usize, columns: usize, at: &dyn Fn(usize, usize) -> f64| DMatrix::from_fn(rows, columns, at);
    let mut change = DMatrix::zeros(X, n);
    let mut h = DMatrix::identity(n, n) * damping;
    for k in 0..steps {
        change = matrix(X, X, &|i, j| stages.by_state[k][i][j]) * change;
        let by_input = matrix(X, U, &|i, j| stages.by_input[k][i][j]);
        change.view_mut((0, k * U), (X, U)).copy_from(&by_input);
        h += change.transpose() * matrix(X, X, &|i, j| stages.state_curvature[k][i][j]) * &change;
        let mut own = h.view_mut((k * U, k * U), (U, U));
        own += matrix(U, U, &|i, j| stages.input_curvature[k][i][j]);
    }
    for column in stages.arrow.chunks_exact(n) {
        let column = DVector::from_column_slice(column);
        h += &column * column.transpose();
    }
    h
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The largest of what solutions leave over, for a random right-hand side and for one along the arrow: relative to the
/// right-hand side, and as the change of matrix and right-hand side that would make the solution exact. The rounding of `x`
/// alone leaves `1e-16 |H| |x|`: no solver does better than that.
fn left_over<const X: usize, const U: usize>(
    curvature: &mut Curvature<X, U>,
    stages: &Stages<X, U>,
    seed: u64,
) -> (f64, f64) {
    let damping = 0.01;
    let h = brute_force(stages, damping);
    let n = stages.unknowns();
    let random = &mut Random::seed_from_u64(seed);
    let mut right_hand_sides = vec![(0..n).map(|_| signed_unit(random)).collect::<Vec<f64>>()];
    right_hand_sides.extend(stages.arrow_columns().next().map(<[f64]>::to_vec));
    assert!(curvature.factorise(stages, damping));
    let (mut product, mut worst) = (vec![0.0; n], (0.0_f64, 0.0_f64));
    for b in right_hand_sides {
        curvature.times(stages, &b, &mut product);
        let expected = &h * DVector::from_column_slice(&b);
        let error = norm(&difference(&product, expected.as_slice()));
        assert!(error < 1e-15 * (n as f64) * h.norm() * norm(&b), "{error}");

        let mut x = b.clone();
        curvature.solve(stages, &mut x);
        curvature.times(stages, &x, &mut product);
        let left = norm(&difference(&product, &b));
        worst.0 = worst.0.max(left / norm(&b));
        worst.1 = worst.1.max(left / (norm(&b) + h.norm() * norm(&x)));
    }
    worst
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Tracking weight, effort weight, largest entry of the arrow.
const MILD: [f64; 3] = [1.0, 0.1, 1.0];
const STEEP: [[f64; 3]; 3] = [[1.0, 0.003, 1e3], [1e3, 0.003, 1e3], [1e3, 0.003, 3e4]];
/// Columns whose square is below a thousand are not corrected for rounding: they may leave a hundred times what others do.
const BACKWARD: f64 = 2e-14;
const ROUTES: [Factorisation; 2] = [Factorisation::Riccati, Factorisation::Dense];

#[test]
fn solutions_leave_nothing_over() {
    for steps in [1, 24, 40, 120] {
        for columns in [0, 10, 55] {
            let seed = (steps + 1000 * columns) as u64;
            for route in ROUTES {
                let mut curvature = Curvature::<12, 6>::new(route, steps, columns);
                let (relative, backward) = left_over(&mut curvature, &stages(seed, steps, columns, MILD), seed);
                assert!(
                    relative < 1e-9 && backward < BACKWARD,
                    "{route:?} {steps} {columns}: {relative:e} {backward:e}"
                );
                for scales in STEEP {
                    let (_, backward) = left_over(&mut curvature, &stages(seed, steps, columns, scales), seed);
                    assert!(backward < BACKWARD, "{route:?} {steps} {columns} {scales:?}: {backward:e}");
                }
            }
        }
    }
}

#[test]
fn planar_bodies_and_odd_sizes() {
    for (steps, columns) in [(1, 1), (2, 3), (7, 8), (13, 9), (40, 10)] {
        for route in ROUTES {
            let mut planar = Curvature::<6, 3>::new(route, steps, columns);
            let (relative, backward) = left_over(&mut planar, &stages(3, steps, columns, MILD), 4);
            assert!(relative < 1e-11 && backward < BACKWARD, "{route:?} {steps} {columns}: {relative:e} {backward:e}");
            let mut odd = Curvature::<5, 1>::new(route, steps, columns);
            let (relative, backward) = left_over(&mut odd, &stages(5, steps, columns, MILD), 6);
            assert!(relative < 1e-11 && backward < BACKWARD, "{route:?} {steps} {columns}: {relative:e} {backward:e}");
        }
    }
}

/// Sum of two numbers with some 106 bits together.
#[derive(Clone, Copy, Debug)]
struct Double(f64, f64);

impl Double {
    fn of(value: f64) -> Self {
        Self(value, 0.0)
    }
    fn normal(high: f64, low: f64) -> Self {
        let sum = high + low;
        Self(sum, low - (sum - high))
    }
    fn plus(self, other: Self) -> Self {
        let sum = self.0 + other.0;
        let part = sum - self.0;
        let error = (self.0 - (sum - part)) + (other.0 - part);
        Self::normal(sum, error + self.1 + other.1)
    }
    fn times(self, other: Self) -> Self {
        let product = self.0 * other.0;
        let error = self.0.mul_add(other.0, -product);
        Self::normal(product, error + self.0 * other.1 + self.1 * other.0)
    }
    fn minus(self, other: Self) -> Self {
        self.plus(Self(-other.0, -other.1))
    }
    fn over(self, other: Self) -> Self {
        let first = Self::of(self.0 / other.0);
        let second = Self::of(self.minus(first.times(other)).0 / other.0);
        let third = self.minus(first.times(other)).minus(second.times(other)).0 / other.0;
        first.plus(second).plus(Self::of(third))
    }
    fn root(self) -> Self {
        let first = Self::of(f64::sqrt(self.0));
        first.plus(self.minus(first.times(first)).over(first.plus(first)))
    }
}

type DoubleMatrix = Vec<Vec<Double>>;

/// The definition once more, in twice the precision.
fn precise<const X: usize, const U: usize>(stages: &Stages<X, U>, damping: f64) -> DoubleMatrix {
    let n = stages.unknowns();
    let mut h = vec![vec![Double::of(0.0); n]; n];
    let mut change = vec![[Double::of(0.0); X]; n];
    let combine = |row: &[f64; X], with: &[Double; X]| {
        row.iter().zip(with).fold(Double::of(0.0), |sum, (a, b)| sum.plus(Double::of(*a).times(*b)))
    };
    for k in 0..stages.by_input.len() {
        for (j, column) in change.iter_mut().enumerate().take((k + 1) * U) {
            *column = if j >= k * U {
                core::array::from_fn(|i| Double::of(stages.by_input[k][i][j - k * U]))
            } else {
                core::array::from_fn(|i| combine(&stages.by_state[k][i], column))
            };
        }
        for j in 0..(k + 1) * U {
            let cost: [Double; X] = core::array::from_fn(|i| combine(&stages.state_curvature[k][i], &change[j]));
            for i in j..(k + 1) * U {
                h[i][j] = (0..X).fold(h[i][j], |sum, x| sum.plus(change[i][x].times(cost[x])));
            }
        }
        for i in 0..U {
            for j in 0..=i {
                let entry = &mut h[k * U + i][k * U + j];
                *entry = entry.plus(Double::of(stages.input_curvature[k][i][j]));
            }
        }
    }
    for i in 0..n {
        h[i][i] = h[i][i].plus(Double::of(damping));
        for column in stages.arrow_columns() {
            for j in 0..=i {
                h[i][j] = h[i][j].plus(Double::of(column[i]).times(Double::of(column[j])));
            }
        }
    }
    h
}

/// Solves with a lower triangle that counts for both.
fn precise_solution(mut h: DoubleMatrix, b: &[f64]) -> Vec<Double> {
    let n = b.len();
    for i in 0..n {
        for j in 0..=i {
            let left = (0..j).fold(h[i][j], |left, k| left.minus(h[i][k].times(h[j][k])));
            h[i][j] = if i == j { left.root() } else { left.over(h[j][j]) };
        }
    }
    let mut x: Vec<Double> = b.iter().map(|b| Double::of(*b)).collect();
    for i in 0..n {
        x[i] = (0..i).fold(x[i], |left, k| left.minus(h[i][k].times(x[k]))).over(h[i][i]);
    }
    for i in (0..n).rev() {
        x[i] = (i + 1..n).fold(x[i], |left, k| left.minus(h[k][i].times(x[k]))).over(h[i][i]);
    }
    x
}

#[test]
fn twice_the_precision_says_the_same() {
    let (steps, columns, damping) = (24, 10, 0.01);
    for scales in [MILD, STEEP[0], STEEP[1], STEEP[2]] {
        let stages = stages::<12, 6>(11, steps, columns, scales);
        let eigenvalues = brute_force(&stages, damping).symmetric_eigenvalues();
        let condition = eigenvalues.max() / eigenvalues.min();
        let b: Vec<f64> = (0..stages.unknowns()).map(|i| f64::sin(1.0 + 1.7 * i as f64)).collect();
        let along = stages.arrow_columns().next().unwrap().to_vec();
        for b in [b, along] {
            let expected = precise_solution(precise(&stages, damping), &b);
            let expected: Vec<f64> = expected.iter().map(|x| x.0).collect();
            for route in ROUTES {
                let mut curvature = Curvature::new(route, steps, columns);
                assert!(curvature.factorise(&stages, damping));
                let mut x = b.clone();
                curvature.solve(&stages, &mut x);
                let error = norm(&difference(&x, &expected)) / norm(&expected);
                assert!(error < 1e-16 * condition, "{route:?} {scales:?}: {error:e}, condition {condition:e}");
            }
        }
    }
}

#[test]
fn what_is_not_positive_definite_is_refused() {
    let (mut definite, mut indefinite) = (0, 0);
    for seed in 0..60 {
        let mut stages = stages::<6, 3>(seed, 6, 0, MILD);
        // A state's negative curvature may be outweighed by the inputs', or not.
        stages.state_curvature[4][3][3] -= 0.6 * seed as f64;
        let least = brute_force(&stages, 0.01).symmetric_eigenvalues().min();
        for route in ROUTES {
            let mut curvature = Curvature::new(route, 6, 0);
            assert_eq!(curvature.factorise(&stages, 0.01), least > 0.0, "{route:?} {least}");
        }
        if least > 0.0 { definite += 1 } else { indefinite += 1 }
    }
    assert!(definite > 5 && indefinite > 5, "{definite} {indefinite}");
}

#[test]
fn what_is_no_number_is_refused_and_nothing_solved() {
    let good = stages::<6, 3>(1, 5, 3, MILD);
    let mut bad = vec![good.clone(); 8];
    bad[0].by_state[2][1][1] = f64::NAN;
    bad[1].by_input[0][3][2] = f64::INFINITY;
    bad[2].state_curvature[4][5][5] = f64::NAN;
    bad[3].input_curvature[3][0][0] = f64::INFINITY;
    bad[4].arrow[7] = f64::NAN;
    bad[5].arrow[0] = 1e200;
    bad[6].by_state.pop();
    bad[7].arrow.pop();
    for (index, bad) in bad.iter().enumerate() {
        for route in ROUTES {
            let mut curvature = Curvature::new(route, 5, 3);
            assert!(curvature.factorise(&good, 0.0));
            assert!(!curvature.factorise(bad, 0.0), "{route:?} {index}");
            let mut x = vec![2.0; 15];
            curvature.solve(&good, &mut x);
            assert_eq!(x, [2.0; 15]);
            assert!(!curvature.factorise(&good, f64::NAN), "{route:?}");
        }
    }
    for route in ROUTES {
        let mut curvature = Curvature::<6, 3>::new(route, 0, 0);
        assert!(curvature.factorise(&Stages::new(0, 0), 0.0));
        curvature.solve(&Stages::new(0, 0), &mut []);
    }
}

#[test]
fn one_room_serves_shorter_horizons_and_fewer_columns() {
    for route in ROUTES {
        let mut room = Curvature::<12, 6>::new(route, 24, 55);
        for (steps, columns) in [(24, 55), (3, 2), (24, 0), (9, 55)] {
            let stages = stages(8, steps, columns, MILD);
            let (mut fresh, mut x) = (Curvature::new(route, steps, columns), vec![1.0; steps * 6]);
            assert!(fresh.factorise(&stages, 0.1) && room.factorise(&stages, 0.1));
            let mut y = x.clone();
            fresh.solve(&stages, &mut x);
            room.solve(&stages, &mut y);
            assert_eq!(x, y);
        }
    }
}
