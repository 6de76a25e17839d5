//! Solutions against all sets of active rows tried, proofs, warm starts, inputs that are wrong.

use super::factor::ActiveFactor;
use super::*;
use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use tumble_identification::noise::signed_unit;

const SETTINGS: GramSettings = GramSettings { tolerance: 1e-10, iterations: 500 };
const FREE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

fn one_of(rng: &mut ChaCha8Rng, kinds: usize) -> usize {
    let draw = signed_unit(rng);
    (0..kinds - 1).take_while(|kind| draw > 2.0 * (kind + 1) as f64 / kinds as f64 - 1.0).count()
}

#[derive(Clone)]
struct Case {
    h: DMatrix<f64>,
    f: DVector<f64>,
    a: DMatrix<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    equality: Vec<bool>,
}

impl Case {
    fn random(rng: &mut ChaCha8Rng, n: usize, m: usize) -> Self {
        let root = DMatrix::from_fn(n, n, |_, _| signed_unit(rng));
        let mut a = DMatrix::from_fn(m, n, |_, _| signed_unit(rng));
        for row in 1..m {
            let before = a.row(row - 1).into_owned();
            match one_of(rng, 6) {
                0 => a.set_row(row, &(before * -1.5)),
                1 => a.set_row(row, &before),
                _ => {}
            }
        }
        let (mut lower, mut upper, mut equality) = (vec![FREE[0]; m], vec![FREE[1]; m], vec![false; m]);
        for row in 0..m {
            let (middle, room) = (0.4 * signed_unit(rng), 0.5 + 0.5 * signed_unit(rng));
            match one_of(rng, 6) {
                0 if row < n / 2 => {
                    equality[row] = true;
                    (lower[row], upper[row]) = (middle, middle);
                }
                1 => lower[row] = middle,
                2 => upper[row] = middle,
                _ => (lower[row], upper[row]) = (middle - room, middle + room),
            }
        }
        let f = DVector::from_fn(n, |_, _| 4.0 * signed_unit(rng));
        Self { h: &root * root.transpose() + DMatrix::identity(n, n) * 0.2, f, a, lower, upper, equality }
    }

    fn program(&self) -> GramProgram {
        GramProgram::try_new(self.h.as_slice(), self.a.transpose().as_slice(), &self.equality).unwrap()
    }

    fn solve(&self, program: &GramProgram, workspace: &mut GramWorkspace) -> GramStatus {
        program.solve(self.f.as_slice(), &self.lower, &self.upper, &SETTINGS, workspace)
    }

    fn cost(&self, x: &DVector<f64>) -> f64 {
        0.5 * x.dot(&(&self.h * x)) + self.f.dot(x)
    }

    fn violation(&self, x: &DVector<f64>) -> f64 {
        let values = &self.a * x;
        let beyond = |row: usize| f64::max(values[row] - self.upper[row], self.lower[row] - values[row]);
        (0..values.len()).map(beyond).fold(0.0, f64::max)
    }

    /// The solution by trying every set of active rows and bounds.
    fn brute_force(&self) -> Option<DVector<f64>> {
        let (n, m) = (self.f.len(), self.upper.len());
        let mut best: Option<(f64, DVector<f64>)> = None;
        let powers: Vec<usize> = core::iter::successors(Some(1), |power| Some(3 * power)).take(m + 1).collect();
        for set in 0..powers[m] {
            let side = |row: usize| set / powers[row] % 3;
            let active: Vec<(usize, f64)> = (0..m)
                .filter(|row| side(*row) > 0)
                .map(|row| (row, if side(row) == 1 { self.lower[row] } else { self.upper[row] }))
                .collect();
            if active.len() > n || active.iter().any(|(_, bound)| !bound.is_finite()) {
                continue;
            }
            let size = n + active.len();
            let (mut system, mut right) = (DMatrix::zeros(size, size), DVector::zeros(size));
            system.view_mut((0, 0), (n, n)).copy_from(&self.h);
            right.rows_mut(0, n).copy_from(&-&self.f);
            for (k, (row, bound)) in active.iter().enumerate() {
                system.view_mut((n + k, 0), (1, n)).copy_from(&self.a.row(*row));
                system.view_mut((0, n + k), (n, 1)).copy_from(&self.a.row(*row).transpose());
                right[n + k] = *bound;
            }
            let Some(solution) = system.lu().solve(&right) else { continue };
            let x = solution.rows(0, n).into_owned();
            if self.violation(&x) < 1e-8 && best.as_ref().is_none_or(|(cost, _)| self.cost(&x) < *cost) {
                best = Some((self.cost(&x), x));
            }
        }
        best.map(|(_, x)| x)
    }

    /// Asserts that the certificate proves that there is no solution.
    fn assert_proof(&self, workspace: &GramWorkspace) {
        let y = DVector::from_column_slice(workspace.certificate());
        let left = self.a.transpose() * &y;
        let supports = y.iter().zip(self.lower.iter().zip(&self.upper)).filter(|(y, _)| **y != 0.0);
        let support: f64 = supports.map(|(y, (lower, upper))| y * if *y > 0.0 { upper } else { lower }).sum();
        assert!(support < 0.0 && left.norm() < 1e-10 * support.abs(), "{support} {left}");
    }
}

fn solution(workspace: &GramWorkspace) -> DVector<f64> {
    DVector::from_column_slice(workspace.solution())
}

#[test]
fn solutions_are_those_of_every_active_set_tried() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (mut solved, mut infeasible, mut most) = (0, 0, 0);
    for _ in 0..150 {
        let case = Case::random(&mut rng, 3, 6);
        let program = case.program();
        let mut workspace = GramWorkspace::new(&program);
        let status = case.solve(&program, &mut workspace);
        if let Some(expected) = case.brute_force() {
            assert_eq!(status, GramStatus::Solved);
            assert!((solution(&workspace) - expected).norm() < 1e-8);
            assert!(case.violation(&solution(&workspace)) < 1e-10);
            let mut gradient = &case.h * solution(&workspace) + &case.f;
            for (row, multiplier) in workspace.multipliers() {
                gradient += case.a.row(row).transpose() * multiplier;
                let bound = if multiplier > 0.0 { case.upper[row] } else { case.lower[row] };
                assert!(case.equality[row] || multiplier == 0.0 || bound.is_finite());
            }
            assert!(gradient.norm() < 1e-10, "{gradient}");
            solved += 1;
            most = most.max(workspace.multipliers().len());
        } else {
            assert_eq!(status, GramStatus::Infeasible);
            case.assert_proof(&workspace);
            infeasible += 1;
        }
    }
    assert!(solved > 60 && infeasible > 20 && most == 3, "{solved} {infeasible} {most}");
}

#[test]
fn a_factor_follows_its_rows() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let (n, m) = (12, 30);
    let vectors: Vec<DVector<f64>> = (0..m).map(|_| DVector::from_fn(n, |_, _| signed_unit(&mut rng))).collect();
    let (mut factor, mut active) = (ActiveFactor::new(n), Vec::<usize>::new());
    for round in 0..400 {
        if active.len() > 2 && one_of(&mut rng, 5) < 2 {
            let position = one_of(&mut rng, active.len());
            active.remove(position);
            factor.remove(position);
        } else {
            let row = one_of(&mut rng, m);
            let matrix = DMatrix::from_fn(n, active.len(), |i, j| vectors[active[j]][i]);
            let mut products: Vec<f64> = active.iter().map(|other| vectors[*other].dot(&vectors[row])).collect();
            let is_new = active.len() < n && !active.contains(&row);
            assert_eq!(factor.append(&mut products, vectors[row].norm_squared(), 1e-10), is_new, "round {round}");
            if is_new {
                active.push(row);
            } else {
                let combined = matrix * DVector::from_vec(products);
                assert!((combined - &vectors[row]).norm() < 1e-9, "round {round}");
            }
        }
        let gram = DMatrix::from_fn(active.len(), active.len(), |i, j| vectors[active[i]].dot(&vectors[active[j]]));
        let right = DVector::from_fn(active.len(), |_, _| signed_unit(&mut rng));
        let mut x = right.as_slice().to_vec();
        factor.solve(&mut x);
        let left = &gram * DVector::from_vec(x) - right;
        assert!(left.norm() < 1e-9, "round {round}: {left}");
    }
}

/// `x` as near as can be to a point, in a box that moves by a fifth of itself from solve to solve, with a bound on the sum.
fn moving() -> Case {
    let n = 10;
    let mut a = DMatrix::zeros(n + 1, n);
    a.view_mut((0, 0), (n, n)).fill_with_identity();
    a.row_mut(n).fill(1.0);
    let f = DVector::from_fn(n, |i, _| if i < 5 { -2.0 } else { 0.3 });
    let (mut lower, mut upper) = (vec![-1.0; n + 1], vec![1.0; n + 1]);
    (lower[n], upper[n]) = (f64::NEG_INFINITY, 3.0);
    Case { h: DMatrix::identity(n, n), f, a, lower, upper, equality: vec![false; n + 1] }
}

#[test]
fn the_next_solve_begins_where_the_last_one_ended() {
    let mut case = moving();
    let program = case.program();
    let mut workspace = GramWorkspace::new(&program);
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved);
    let (cold, first, active) = (workspace.iterations(), solution(&workspace), workspace.multipliers().len());
    assert!(cold > 5 && active >= 5, "{cold} {active}");
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved);
    assert!(workspace.iterations() == 1 && (solution(&workspace) - &first).norm() < 1e-14);
    workspace.forget();
    assert!(workspace.multipliers().len() == 0);
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved);
    assert!(workspace.iterations() == cold && solution(&workspace) == first);

    // Unknowns swap their places, and so do the rows: the same set is active at once.
    case.f.as_mut_slice()[..10].rotate_right(1);
    let map: Vec<_> = (0..11).map(|row| Some(if row < 10 { (row + 1) % 10 } else { 10 })).collect();
    workspace.shift(&map);
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved);
    assert_eq!(workspace.iterations(), 1);
    let mut rotated = first.clone();
    rotated.as_mut_slice().rotate_right(1);
    assert!((solution(&workspace) - &rotated).norm() < 1e-14);

    // Maps to nowhere, to rows that are not there, all to one, and too short ones only cost time.
    for map in [vec![None; 11], vec![Some(99); 11], vec![Some(3); 11], vec![]] {
        workspace.shift(&map);
        assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved);
        assert!(workspace.iterations() > 1 && (solution(&workspace) - &rotated).norm() < 1e-13);
    }
    // A bound that was active goes away.
    case.upper[1] = f64::INFINITY;
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved);
    let mut fresh = GramWorkspace::new(&program);
    assert_eq!(case.solve(&program, &mut fresh), GramStatus::Solved);
    assert!((solution(&workspace) - solution(&fresh)).norm() < 1e-13 && solution(&fresh)[1] > 1.0);
}

#[test]
fn a_workspace_may_change_programs() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut workspace = GramWorkspace::new(&Case::random(&mut rng, 6, 12).program());
    let mut solved = 0;
    for _ in 0..60 {
        let case = Case::random(&mut rng, 6, 12);
        let program = case.program();
        let mut fresh = GramWorkspace::new(&program);
        let status = case.solve(&program, &mut fresh);
        assert_eq!(case.solve(&program, &mut workspace), status);
        if status == GramStatus::Solved {
            assert!((solution(&workspace) - solution(&fresh)).norm() < 1e-9);
            solved += 1;
        }
    }
    assert!(solved > 10, "{solved}");
    let other = Case::random(&mut rng, 5, 12);
    assert_eq!(other.solve(&other.program(), &mut workspace), GramStatus::Numerical);
}

#[test]
fn what_cannot_be_is_proved() {
    let mut case = moving();
    let program = case.program();
    let mut workspace = GramWorkspace::new(&program);
    // The sum of ten numbers of at least one.
    case.lower[..10].fill(1.0 - 1e-3);
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Infeasible);
    case.assert_proof(&workspace);
    assert_eq!(workspace.crossed_row(), None);
    case.lower[4] = 1.5;
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Infeasible);
    assert_eq!(workspace.crossed_row(), Some(4));
    assert!(workspace.certificate().iter().all(|y| *y == 0.0));
    case.lower[4] = f64::INFINITY;
    case.upper[4] = f64::INFINITY;
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Infeasible);
    assert_eq!(workspace.crossed_row(), Some(4));
    // Afterwards it goes on as if nothing had happened.
    let case = moving();
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved);
    assert!(workspace.crossed_row().is_none() && workspace.certificate().iter().all(|y| *y == 0.0));

    // A row of zeros is a condition on its bounds.
    let mut case = moving();
    case.a.row_mut(2).fill(0.0);
    let program = case.program();
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved);
    (case.lower[2], case.upper[2]) = (0.25, 1.0);
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Infeasible);
    case.assert_proof(&workspace);
}

#[test]
fn equations_hold_and_stay() {
    let mut case = moving();
    case.equality[..3].fill(true);
    // The same equation twice, and the sum of both.
    let first = DMatrix::from_fn(1, 10, |_, j| f64::from(u8::from(j < 6)));
    case.a.row_mut(0).copy_from(&first);
    case.a.row_mut(1).copy_from(&(&first * -2.0));
    for (row, bound) in [(0, 0.5), (1, -1.0), (2, 0.125)] {
        (case.lower[row], case.upper[row]) = (bound, bound);
    }
    let program = case.program();
    let mut workspace = GramWorkspace::new(&program);
    for sign in [1.0, -1.0] {
        case.f *= sign;
        assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved);
        let values = &case.a * solution(&workspace);
        assert!(
            (values[0] - 0.5).abs() < 1e-12 && (values[1] + 1.0).abs() < 1e-12 && (values[2] - 0.125).abs() < 1e-12
        );
        assert!(workspace.multipliers().take(2).map(|(row, _)| row).eq([0, 2]));
    }
    (case.lower[1], case.upper[1]) = (-1.1, -1.1);
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Infeasible);
    case.assert_proof(&workspace);
    // Bounds of an equation that are not the same.
    case.lower[1] = -1.2;
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Numerical);
    (case.lower[1], case.upper[1]) = (f64::NEG_INFINITY, f64::INFINITY);
    assert_eq!(case.solve(&program, &mut workspace), GramStatus::Numerical);
}

/// Several times as many rows as unknowns meet at the solution.
#[test]
fn rows_that_meet_in_one_point_come_to_an_end() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for n in [2, 5, 15] {
        let m = 8 * n;
        let mut case = Case::random(&mut rng, n, m);
        case.a = DMatrix::from_fn(m, n, |_, _| one_of(&mut rng, 3) as f64 - 1.0);
        let point = DVector::from_fn(n, |_, _| signed_unit(&mut rng));
        let values = &case.a * &point;
        case.equality.fill(false);
        case.lower.fill(f64::NEG_INFINITY);
        case.upper.copy_from_slice(values.as_slice());
        // Beyond the point in the direction of all rows together, so that it is the solution.
        case.f = -(&case.h * &point) - case.a.transpose() * DVector::repeat(m, 0.3);
        let program = case.program();
        let mut workspace = GramWorkspace::new(&program);
        assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved, "{n}");
        assert!((solution(&workspace) - point).norm() < 1e-9, "{n}");
    }
}

#[test]
fn an_end_comes_after_every_number_of_iterations() {
    let case = moving();
    let program = case.program();
    let mut enough = GramWorkspace::new(&program);
    assert_eq!(case.solve(&program, &mut enough), GramStatus::Solved);
    for iterations in 0..=enough.iterations() {
        let mut workspace = GramWorkspace::new(&program);
        let settings = GramSettings { iterations, ..SETTINGS };
        let status = program.solve(case.f.as_slice(), &case.lower, &case.upper, &settings, &mut workspace);
        let is_enough = iterations == enough.iterations();
        assert_eq!(status, if is_enough { GramStatus::Solved } else { GramStatus::Capped });
        assert_eq!(workspace.iterations(), iterations);
        // The next one goes on from there.
        assert_eq!(case.solve(&program, &mut workspace), GramStatus::Solved);
        assert!((solution(&workspace) - solution(&enough)).norm() < 1e-13);
    }
}

#[test]
fn numbers_that_are_none_give_no_answer() {
    let case = moving();
    let program = case.program();
    let mut workspace = GramWorkspace::new(&program);
    let mut expect = |case: &Case, expected: GramStatus| {
        assert_eq!(case.solve(&program, &mut workspace), expected);
        assert_eq!(moving().solve(&program, &mut workspace), GramStatus::Solved);
    };
    for place in [0, 4, 9] {
        for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut other = case.clone();
            other.f[place] = wrong;
            expect(&other, GramStatus::Numerical);
        }
        let mut other = case.clone();
        other.lower[place] = f64::NAN;
        expect(&other, GramStatus::Numerical);
        let mut other = case.clone();
        other.upper[place] = f64::NAN;
        expect(&other, GramStatus::Numerical);
    }
    let mut short = case.clone();
    short.lower.pop();
    expect(&short, GramStatus::Numerical);
    let mut long = case.clone();
    long.f = DVector::zeros(11);
    expect(&long, GramStatus::Numerical);
    // Of tolerances that cannot be met, too, an answer comes.
    for tolerance in [0.0, -1.0, f64::NAN] {
        let settings = GramSettings { tolerance, iterations: 200 };
        let status = program.solve(case.f.as_slice(), &case.lower, &case.upper, &settings, &mut workspace);
        assert!(status != GramStatus::Solved || tolerance == 0.0, "{tolerance}");
    }
    // Numbers of any size.
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for _ in 0..300 {
        let mut wild = Case::random(&mut rng, 4, 8);
        let mut size = || f64::exp2(300.0 * signed_unit(&mut rng));
        wild.f.iter_mut().chain(&mut wild.lower).chain(&mut wild.upper).for_each(|x| *x *= size());
        let program = wild.program();
        let mut workspace = GramWorkspace::new(&program);
        if wild.solve(&program, &mut workspace) == GramStatus::Solved {
            assert!(workspace.solution().iter().all(|x| x.is_finite()));
        }
    }
}

#[test]
fn matrices_that_are_none_are_refused() {
    let identity = [1.0, 0.0, 0.0, 1.0];
    let program =
        |hessian: &[f64], rows: &[f64], count: usize| GramProgram::try_new(hessian, rows, &vec![false; count]);
    assert!(program(&identity, &[1.0, 2.0], 1).is_ok());
    assert!(program(&identity, &[], 0).is_ok());
    for (hessian, rows, count) in
        [(&identity[..3], &[][..], 0), (&[], &[], 0), (&identity, &[1.0], 1), (&identity, &[1.0, 2.0], 2)]
    {
        assert!(matches!(program(hessian, rows, count), Err(PlanningError::WrongCount { .. })));
    }
    assert!(matches!(program(&[1.0, f64::NAN, 0.0, 1.0], &[], 0), Err(PlanningError::NotFinite { .. })));
    assert!(matches!(program(&identity, &[f64::INFINITY, 0.0], 1), Err(PlanningError::NotFinite { .. })));
    assert!(matches!(program(&identity, &[1e-200, 0.0], 1), Ok(_) | Err(PlanningError::NotFinite { .. })));
    assert!(matches!(program(&identity, &[1e200, 0.0], 1), Err(PlanningError::NotFinite { .. })));
    assert!(matches!(program(&[1.0, 0.5, 0.4, 1.0], &[], 0), Err(PlanningError::Asymmetric { .. })));
    for indefinite in [[1.0, 2.0, 2.0, 1.0], [0.0; 4], [-1.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.0, 1.0]] {
        assert!(matches!(program(&indefinite, &[], 0), Err(PlanningError::NotPositive { .. })));
    }
    let free = program(&identity, &[], 0).unwrap();
    let mut workspace = GramWorkspace::new(&free);
    assert_eq!(free.solve(&[1.0, -2.0], &[], &[], &SETTINGS, &mut workspace), GramStatus::Solved);
    assert!(workspace.solution() == [-1.0, 2.0] && (free.unknowns(), free.rows()) == (2, 0));
}
