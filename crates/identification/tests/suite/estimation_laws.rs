//! The laws of the estimation kernel hold for ours and catch planted defects by name.

use crate::problem4_hard;
use crate::random::Random;
use nalgebra::{SMatrix, SVector};
use tumble_identification::dynamics::strategies::body_d;
use tumble_identification::laws::{
    SquareRootOf, check_constrained_solver, check_feasible_set, check_square_root_information,
};
use tumble_identification::{
    Barrier, BarrierNewton, BodyScale, ConstrainedEstimate, ConstrainedLeastSquares, FeasibleSet, IdentificationError,
    InteriorPoint, PseudoInertiaCone, SquareRootInformation,
};

type Parameters = SVector<f64, 10>;
type Blocks = Vec<(SMatrix<f64, 6, 10>, SVector<f64, 6>)>;

fn cone() -> PseudoInertiaCone {
    PseudoInertiaCone::new(BodyScale::of(&body_d().to_vector()).unwrap())
}

fn random_parameters(random: &mut Random) -> Parameters {
    let magnitudes = cone().magnitudes();
    SVector::from_fn(|i, _| body_d().to_vector()[i] + magnitudes[i] * random.normal())
}

fn random_blocks(random: &mut Random, count: usize) -> Blocks {
    (0..count).map(|_| (SMatrix::from_fn(|_, _| random.normal()), SVector::from_fn(|_, _| random.normal()))).collect()
}

/// Noisy and clean measurements of body D: the constraint binds in some and not in others.
fn problems() -> Vec<SquareRootInformation<10>> {
    let mut random = Random::new(5);
    (0..20)
        .map(|k| {
            let mut information = SquareRootInformation::new();
            let noise = if k % 2 == 0 { 0.01 } else { 2.0 };
            for (block, error) in random_blocks(&mut random, 4) {
                information.update(&(block / noise), &(block * body_d().to_vector() / noise + error)).unwrap();
            }
            information
        })
        .collect()
}

fn recursion(blocks: &[(SMatrix<f64, 6, 10>, SVector<f64, 6>)]) -> SquareRootInformation<10> {
    let mut information = SquareRootInformation::new();
    for (block, rhs) in blocks {
        information.update(block, rhs).unwrap();
    }
    information
}

fn broken_law<T>(outcome: Result<T, tumble_lie::laws::LawViolation>) -> &'static str {
    outcome.err().expect("a planted defect must be caught").law
}

#[test]
fn square_root_recursion_holds_its_laws() {
    let mut random = Random::new(1);
    for count in [1, 2, 5, 100] {
        let blocks = random_blocks(&mut random, count);
        check_square_root_information(
            &|blocks| {
                let information = recursion(blocks);
                (information.factor(), information.rhs(), information.residual_sum_of_squares())
            },
            &blocks,
            1e-13,
        )
        .unwrap();
    }
}

#[test]
fn square_root_laws_catch_planted_defects() {
    let blocks = random_blocks(&mut Random::new(2), 20);
    let run = |spoil: &dyn Fn(SquareRootInformation<10>, &Blocks) -> SquareRootOf<10>| {
        check_square_root_information(&|blocks| spoil(recursion(blocks), &blocks.to_vec()), &blocks, 1e-13)
    };
    let parts = |i: &SquareRootInformation<10>| (i.factor(), i.rhs(), i.residual_sum_of_squares());
    // A sign that flips with the reflection.
    let flipped = run(&|i, _| (-i.factor(), -i.rhs(), i.residual_sum_of_squares()));
    assert_eq!(broken_law(flipped), "factor is upper triangular");
    // The last block is lost.
    let lost = run(&|_, blocks| parts(&recursion(&blocks[..blocks.len() - 1])));
    assert_eq!(broken_law(lost), "equals batch");
    // The residual, as in the printed recursion, is dropped.
    let dropped = run(&|i, _| (i.factor(), i.rhs(), 0.0));
    assert_eq!(broken_law(dropped), "keeps the residual");
    // The first block counts once more when it arrives last.
    let first = blocks[0];
    let ordered = run(&|i, given| {
        let mut i = i;
        if given.last() == Some(&first) {
            i.update(&first.0, &first.1).unwrap();
        }
        parts(&i)
    });
    assert_eq!(broken_law(ordered), "order independent");
}

#[test]
fn pseudo_inertia_cone_holds_its_laws() {
    let mut random = Random::new(3);
    let points: Vec<_> = (0..200).map(|_| random_parameters(&mut random)).collect();
    check_feasible_set(&cone(), &points, 1e-5).unwrap();
    check_feasible_set(&problem4_hard::cone(), &points, 1e-5).unwrap();
}

/// The cone with one thing wrong.
struct Spoiled(&'static str);

impl FeasibleSet<10> for Spoiled {
    fn margin(&self, p: &Parameters) -> f64 {
        let margin = cone().margin(p);
        match self.0 {
            "margin" => margin.max(0.0) + margin * margin.abs(),
            _ => margin,
        }
    }
    fn barrier(&self, p: &Parameters) -> Option<Barrier<10>> {
        let mut barrier = cone().barrier(p);
        if self.0 == "everywhere" && barrier.is_none() {
            barrier = cone().barrier(&self.interior_point());
        }
        let mut barrier = barrier?;
        match self.0 {
            "gradient" => barrier.gradient *= 1.001,
            "hessian" => barrier.hessian[(4, 7)] *= 1.01,
            "bounded" => barrier.value = barrier.value.min(20.0),
            _ => {}
        }
        Some(barrier)
    }
    fn barrier_parameter(&self) -> f64 {
        if self.0 == "parameter" { 3.0 } else { 4.0 }
    }
    fn interior_point(&self) -> Parameters {
        if self.0 == "outside" { -cone().interior_point() } else { cone().interior_point() }
    }
    fn magnitudes(&self) -> Parameters {
        cone().magnitudes()
    }
}

#[test]
fn feasible_set_laws_catch_planted_defects() {
    let mut random = Random::new(4);
    let points: Vec<_> = (0..50).map(|_| random_parameters(&mut random)).collect();
    let law = |defect| broken_law(check_feasible_set(&Spoiled(defect), &points, 1e-5));
    check_feasible_set(&Spoiled("none"), &points, 1e-5).unwrap();
    assert_eq!(law("outside"), "interior point is inside");
    assert_eq!(law("everywhere"), "barrier exists exactly inside");
    assert_eq!(law("margin"), "margin is concave");
    assert_eq!(law("gradient"), "barrier gradient is the derivative");
    assert_eq!(law("hessian"), "barrier Hessian is the second derivative");
    assert_eq!(law("parameter"), "barrier parameter bounds the decrement");
    assert_eq!(law("bounded"), "barrier grows towards the boundary");
}

#[test]
fn both_solvers_hold_the_laws() {
    let cone = cone();
    let problems = problems();
    let active = problems.iter().filter(|p| InteriorPoint::new(cone).solve(p).unwrap().is_active()).count();
    assert!((5..=15).contains(&active), "{active} of 20 bind");
    check_constrained_solver(&InteriorPoint::new(cone), &cone, &problems, 1e-6).unwrap();
    check_constrained_solver(&BarrierNewton::new(&cone), &cone, &problems, 1e-6).unwrap();
}

/// The interior point solver with one thing wrong.
struct SpoiledSolver(&'static str);

impl ConstrainedLeastSquares<10> for SpoiledSolver {
    fn solve(&self, information: &SquareRootInformation<10>) -> Result<ConstrainedEstimate<10>, IdentificationError> {
        let cone = cone();
        let mut estimate = InteriorPoint::new(cone).solve(information)?;
        let active = estimate.is_active();
        let deeper = estimate.parameters + (cone.interior_point() - estimate.parameters) * 1e-3;
        match self.0 {
            "ignores the constraint" => estimate.parameters = information.solve(&cone.magnitudes())?,
            "shrinks always" if !active => estimate.parameters = deeper,
            "stops early" | "hides the gap" if active => {
                estimate.parameters = deeper;
                estimate.duality_gap = if self.0 == "stops early" { 1.0 } else { 0.0 };
            }
            "wrong objective" => estimate.objective += 1.0,
            "loose gap" if active => estimate.duality_gap = 1e-3,
            "gives up" if active => {
                return Err(IdentificationError::NotConverged { iterations: 1, duality_gap: 1.0, tolerance: 0.0 });
            }
            _ => {}
        }
        if self.0 != "ignores the constraint" {
            estimate.margin = cone.margin(&estimate.parameters);
        }
        if self.0 != "wrong objective" {
            estimate.objective = information.objective(&estimate.parameters);
        }
        Ok(estimate)
    }
}

#[test]
fn solver_laws_catch_planted_defects() {
    let problems = problems();
    let law = |defect, gap| broken_law(check_constrained_solver(&SpoiledSolver(defect), &cone(), &problems, gap));
    check_constrained_solver(&SpoiledSolver("none"), &cone(), &problems, 1e-6).unwrap();
    assert_eq!(law("gives up", 1e-6), "solver succeeds");
    assert_eq!(law("ignores the constraint", 1e-6), "estimate is strictly inside");
    assert_eq!(law("wrong objective", 1e-6), "objective is the objective");
    assert_eq!(law("shrinks always", 1e-6), "inactive equals unconstrained");
    assert_eq!(law("stops early", 1e-6), "no feasible point is better");
    assert_eq!(law("loose gap", 1e-6), "duality gap is small");
    // With a lenient tolerance only the false claim is left to catch.
    assert_eq!(law("hides the gap", 1e9), "duality gap bounds the excess");
}

#[test]
fn problem4_hard_reaches_the_reference_sum() {
    let cone = problem4_hard::cone();
    let solver = InteriorPoint::new(cone);
    let problems = problem4_hard::problems();
    assert_eq!(problems.len(), 49);
    let mut sum = 0.0;
    for problem in &problems {
        let estimate = solver.solve(problem).unwrap();
        assert!(estimate.is_active() && estimate.margin > 0.0 && estimate.duality_gap <= 1e-6);
        sum += 2.0 * estimate.objective;
    }
    assert!((sum - 143.336).abs() < 0.01, "{sum}");
    check_constrained_solver(&solver, &cone, &problems, 1e-6).unwrap();
}

#[test]
fn answers_scale_with_mass_length_and_noise() {
    let reference: Vec<_> = problems().iter().map(|p| InteriorPoint::new(cone()).solve(p).unwrap()).collect();
    for (mass, length, weight) in [(1e-6, 1.0, 1.0), (1e6, 1e3, 1.0), (1.0, 1e-3, 1e5), (1e-3, 1e3, 1e-5)] {
        let scale = BodyScale::try_new(cone().scale().mass_kg() * mass, cone().scale().length_m() * length).unwrap();
        let cone = PseudoInertiaCone::new(scale);
        let units = BodyScale::try_new(mass, length).unwrap().parameter_magnitudes();
        for (problem, reference) in problems().iter().zip(&reference) {
            let factor = SMatrix::<f64, 10, 10>::from_fn(|i, j| problem.factor()[(i, j)] * weight / units[j]);
            let scaled = SquareRootInformation::from_square_root(&factor, &(problem.rhs() * weight)).unwrap();
            let tolerance = 1e-7 * weight * weight;
            let estimate = InteriorPoint::with_gap_tolerance(cone, tolerance).solve(&scaled).unwrap();
            let difference = estimate.parameters.component_div(&units) - reference.parameters;
            assert!(difference.component_div(&self::cone().magnitudes()).amax() < 1e-6, "{difference}");
            assert_eq!(estimate.iterations, reference.iterations);
        }
    }
}
