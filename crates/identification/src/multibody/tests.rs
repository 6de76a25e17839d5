//! Trees of bodies with known answers, and random ones against other methods.

mod arm;

use super::*;
use crate::body_scale::BodyScale;
use crate::consistency::{ConstrainedLeastSquares, FeasibleSet, InteriorPoint, PseudoInertiaCone};
use crate::error::IdentificationError;
use crate::laws::{check_base_parameters, check_links_solver};
use crate::noise::Gaussian;
use crate::square_root_information::SquareRootInformation;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, SMatrix, SVector, Vector3};

fn unknown_body(name: &str, mass_kg: f64, length_m: f64) -> UnknownBody {
    UnknownBody { name: name.into(), scale: BodyScale::try_new(mass_kg, length_m).unwrap() }
}

fn nuisance(name: &str, magnitude: f64, lower_bound: Option<f64>) -> LinkNuisance {
    LinkNuisance { name: name.into(), unit: "N m".into(), magnitude, lower_bound }
}

/// Random rows of this rank over bodies and nuisances, about a truth near or beyond the boundary.
fn random_problem(
    bodies: usize,
    nuisances: usize,
    rank: usize,
    seed: u64,
) -> (LinkInformation, ParameterLayout, LinkPrior) {
    let mut dice = Gaussian::from_seed(seed);
    let unknown =
        (0..bodies).map(|i| unknown_body(&format!("link{i}"), 1.0 + i as f64, 0.3 + 0.1 * i as f64)).collect();
    let extra = (0..nuisances)
        .map(|i| nuisance(&format!("friction {i}"), 0.1, (i % 3 < 2).then_some(if i % 3 == 0 { 0.0 } else { -0.05 })))
        .collect();
    let layout = ParameterLayout::try_new(unknown, extra).unwrap();
    let (unknowns, magnitudes) = (layout.unknowns(), layout.magnitudes());
    let basis = DMatrix::from_fn(rank, unknowns, |_, j| (2.0 * dice.uniform() - 1.0) / magnitudes[j]);
    // Numbers that are no bodies, and friction that would be negative.
    let scale = |i: usize| layout.bodies()[i].scale;
    let mut truth: DVector<f64> = DVector::zeros(unknowns);
    for i in 0..bodies {
        let ball = PseudoInertiaCone::new(scale(i)).interior_point();
        for (k, value) in ball.iter().enumerate() {
            truth[10 * i + k] = value + 0.6 * (2.0 * dice.uniform() - 1.0) * magnitudes[10 * i + k];
        }
    }
    for j in 10 * bodies..unknowns {
        truth[j] = magnitudes[j] * (2.0 * dice.uniform() - 1.0);
    }
    let mut information = LinkInformation::new(unknowns);
    for _ in 0..3 * rank {
        let weights = DMatrix::from_fn(1, rank, |_, _| 20.0 * (2.0 * dice.uniform() - 1.0));
        let row = weights * &basis;
        let y = (&row * &truth)[0] + dice.normal();
        information.add_rows(row.as_slice(), &[y]).unwrap();
    }
    let nominal: Vec<f64> = (0..bodies)
        .flat_map(|i| PseudoInertiaCone::new(scale(i)).interior_point().data.0[0])
        .chain((0..nuisances).map(|_| 0.05))
        .collect();
    let prior = LinkPrior::uniform(&layout, &nominal, 0.5).unwrap();
    (information, layout, prior)
}

fn solved(base: &BaseParameters, prior: &LinkPrior) -> Result<LinksEstimate, IdentificationError> {
    ConsistentLinks::new(base, prior)?.solve()
}

#[test]
fn one_body_is_what_the_single_body_solver_says() {
    let mut active = 0;
    for seed in 0..40 {
        let (information, layout, prior) = random_problem(1, 0, 10, 77 + seed);
        let base = BaseParameters::new(&information, &layout).unwrap();
        let estimate = solved(&base, &prior).unwrap();
        let factor = SMatrix::<f64, 10, 10>::from_fn(|i, j| information.factor()[(i, j)]);
        let rhs = SVector::<f64, 10>::from_fn(|i, _| information.rhs()[i]);
        let single = SquareRootInformation::from_square_root(&factor, &rhs).unwrap();
        let cone = PseudoInertiaCone::new(layout.bodies()[0].scale);
        let expected = InteriorPoint::with_gap_tolerance(cone, 1e-10).solve(&single).unwrap();
        let sharp = ConsistentLinks::new(&base, &prior).unwrap().with_gap_tolerance(1e-10).solve().unwrap();
        let off = single.objective(&estimate.body(0).unwrap()) - expected.objective;
        assert!(off.abs() < 2e-7 * (1.0 + expected.objective), "{seed}: {off:e}");
        assert!((sharp.misfit - expected.objective).abs() < 1e-8 * (1.0 + expected.objective));
        let difference = (sharp.body(0).unwrap() - expected.parameters).component_div(&cone.magnitudes()).amax();
        assert!(difference < 1e-5, "{seed}: {difference:e}");
        assert_eq!(estimate.is_active(), expected.is_active());
        active += usize::from(estimate.is_active());
    }
    assert!(active > 20, "{active}");
}

#[test]
fn random_trees_keep_the_laws() {
    let (mut active, mut at_floor, mut rounded) = (0, 0, 0);
    for seed in 0..60 {
        let bodies = 1 + (seed % 3) as usize;
        let nuisances = (seed % 4) as usize;
        let unknowns = 10 * bodies + nuisances;
        let rank = unknowns - (seed % 5) as usize * bodies;
        let (information, layout, prior) = random_problem(bodies, nuisances, rank, 500 + seed);
        let base = BaseParameters::new(&information, &layout).unwrap();
        assert_eq!(base.rank(), rank);
        check_base_parameters(&base, &information, 1e-10).unwrap();
        check_links_solver(&solved, &base, &prior, 1e-6, 1e-2).unwrap();
        let estimate = solved(&base, &prior).unwrap();
        assert!(estimate.duality_gap <= 1e-7 * (1.0 + 0.1 * estimate.misfit), "{estimate:?}");
        rounded += u32::from(estimate.duality_gap > 1e-7 * (1.0 + 1e-3 * estimate.misfit));
        active += usize::from(estimate.is_active());
        at_floor += (0..bodies).filter(|&body| estimate.is_at_floor(body)).count();
    }
    // Where the data contradict all that can be by a hundred sigmas, rounding may end the search: of two thousand such problems in five.
    assert!(active > 30 && at_floor > 30 && rounded <= 1, "{active} {at_floor} {rounded}");
}

/// Alternating directions: a linear solve, then each body onto its cone by eigenvalues. Slow, and nothing like Newton.
fn by_projection(information: &LinkInformation, layout: &ParameterLayout, sweeps: usize) -> f64 {
    let bodies = layout.bodies().len();
    let scaled = information.factor() * DMatrix::from_diagonal(&layout.magnitudes());
    let penalty = 1000.0;
    let n = layout.unknowns();
    // Squared length of P(p) as a quadratic form, so that the projection of the matrix is that of the ten numbers.
    let image = |p: &[f64]| {
        let cone = PseudoInertiaCone::with_relative_floor(BodyScale::try_new(1.0, 1.0).unwrap(), 0.0);
        cone.normalized(&SVector::from_column_slice(p))
    };
    let mut gram = DMatrix::<f64>::identity(n, n);
    for body in 0..bodies {
        for i in 0..10 {
            for j in 0..10 {
                let unit = |k: usize| SVector::<f64, 10>::from_fn(|l, _| f64::from(u8::from(k == l)));
                gram[(10 * body + i, 10 * body + j)] = image(unit(i).as_slice()).dot(&image(unit(j).as_slice()));
            }
        }
    }
    let system = (scaled.transpose() * &scaled + &gram * penalty).cholesky().unwrap();
    let gradient = scaled.transpose() * information.rhs();
    let (mut inside, mut sum) = (DVector::<f64>::zeros(n), DVector::<f64>::zeros(n));
    for _ in 0..sweeps {
        let x = system.solve(&(&gradient + &gram * (&inside - &sum) * penalty));
        let moved = &x + &sum;
        inside.copy_from(&moved);
        for body in 0..bodies {
            let floor = Matrix4::identity() * 1e-6;
            let eigen = (image(&moved.as_slice()[10 * body..10 * body + 10]) - floor).symmetric_eigen();
            let clipped = Matrix4::from_diagonal(&eigen.eigenvalues.map(|value| value.max(0.0)));
            let projected =
                PseudoInertiaCone::parameters(&(eigen.eigenvectors * clipped * eigen.eigenvectors.transpose() + floor));
            inside.rows_mut(10 * body, 10).copy_from(&projected);
        }
        for (i, nuisance) in layout.nuisances().iter().enumerate() {
            if let Some(bound) = nuisance.lower_bound {
                let column = layout.nuisance_column(i);
                inside[column] = inside[column].max(bound / nuisance.magnitude);
            }
        }
        sum = moved - &inside;
    }
    0.5 * (scaled * inside - information.rhs()).norm_squared()
}

#[test]
fn two_and_three_bodies_are_what_alternating_projections_say() {
    for (bodies, seed) in [(2, 901), (2, 902), (3, 903), (3, 904)] {
        let rank = 10 * bodies + 2 - 2;
        let (information, layout, prior) = random_problem(bodies, 2, rank, seed);
        let base = BaseParameters::new(&information, &layout).unwrap();
        let estimate = solved(&base, &prior).unwrap();
        assert!(estimate.is_active());
        let least = base.residual_sum_of_squares() - information.residual_sum_of_squares();
        let expected = by_projection(&information, &layout, 5_000) - 0.5 * least;
        let off = (estimate.misfit - expected).abs();
        assert!(off < 1e-7 * (1.0 + expected), "{bodies}: {} {expected}", estimate.misfit);
    }
}

#[test]
fn planted_defects_are_caught_by_name() {
    let (information, layout, prior) = random_problem(2, 3, 19, 510);
    let base = BaseParameters::new(&information, &layout).unwrap();
    check_links_solver(&solved, &base, &prior, 1e-6, 1e-2).unwrap();
    let truth = solved(&base, &prior).unwrap();
    assert!(truth.is_active());
    let law = |solver: &dyn Fn(&BaseParameters, &LinkPrior) -> Result<LinksEstimate, IdentificationError>| {
        check_links_solver(solver, &base, &prior, 1e-6, 1e-2).unwrap_err().law
    };
    let without_a_cone = |base: &BaseParameters, prior: &LinkPrior| {
        let all = solved(base, prior)?;
        let none = ConsistentLinks::new(base, prior)?.least_squares();
        let mut unknowns = all.unknowns.clone();
        unknowns.rows_mut(0, 10).copy_from(&none.rows(0, 10));
        Ok(LinksEstimate { unknowns, ..all })
    };
    assert_eq!(law(&without_a_cone), "every body is made of mass");
    let biased =
        |base: &BaseParameters, prior: &LinkPrior| ConsistentLinks::new(base, prior)?.with_prior_weight(10.0).solve();
    assert_eq!(law(&biased), "no consistent change fits better");
    let half_way =
        |base: &BaseParameters, prior: &LinkPrior| ConsistentLinks::new(base, prior)?.with_gap_tolerance(1e3).solve();
    assert_eq!(law(&half_way), "no consistent change fits better");
    let boastful = |base: &BaseParameters, prior: &LinkPrior| Ok(LinksEstimate { misfit: 0.0, ..solved(base, prior)? });
    assert_eq!(law(&boastful), "misfit is that of the unknowns");
}

#[test]
fn two_priors_agree_on_what_the_data_determine() {
    let mut met = 0;
    for seed in 0..12 {
        let (information, layout, prior) = random_problem(2, 2, 17, 4000 + seed);
        let base = BaseParameters::new(&information, &layout).unwrap();
        let heavier: Vec<f64> = (0..22).map(|j| layout.magnitudes()[j] * if j % 10 < 4 { 0.6 } else { 1.1 }).collect();
        let other = LinkPrior::uniform(&layout, &heavier, 0.3).unwrap();
        let apart = |weight: f64| {
            let with = |prior: &LinkPrior| {
                ConsistentLinks::new(&base, prior).unwrap().with_prior_weight(weight).solve().unwrap()
            };
            let (one, two) = (with(&prior), with(&other));
            let sigmas = (information.factor() * (&one.unknowns - &two.unknowns)).norm();
            let bound = |e: &LinksEstimate| (2.0 * weight * e.prior_misfit).sqrt() + (2.0 * e.duality_gap).sqrt();
            (sigmas, bound(&one) + bound(&two), one.is_active() && two.is_active())
        };
        let (sigmas, bound, active) = apart(1e-6);
        // The bound takes the prior's misfit at the best consistent fit, which is a little above that reported.
        assert!(sigmas < 1.5 * bound + 1e-9, "{seed}: {sigmas:e} {bound:e}");
        if active && bound > 1e-4 {
            met += usize::from(apart(1.0).0 > 30.0 * sigmas);
        }
    }
    assert!(met >= 4, "{met}");
}

#[test]
fn center_of_mass_is_as_certain_as_its_linearisation() {
    let (information, layout, _) = random_problem(1, 1, 11, 3);
    let base = BaseParameters::new(&information, &layout).unwrap();
    let at = DVector::from_fn(11, |i, _| 1.0 + 0.1 * i as f64);
    let center = |x: &DVector<f64>| Vector3::new(x[1], x[2], x[3]) / x[0];
    let jacobian = DMatrix::from_fn(3, 11, |i, j| {
        let step = DVector::from_fn(11, |k, _| if k == j { 1e-6 } else { 0.0 });
        (center(&(&at + &step)) - center(&(&at - step)))[i] / 2e-6
    });
    let inverse = (information.factor().transpose() * information.factor()).try_inverse().unwrap();
    let expected = &jacobian * &inverse * jacobian.transpose();
    let found = base.center_of_mass_covariance(0, &at).unwrap().unwrap();
    for (found, expected) in found.iter().zip(expected.iter()) {
        assert!((found - expected).abs() < 1e-7 * jacobian.norm_squared() * inverse.norm(), "{found} {expected}");
    }
    let mass = base.mass_variance(0).unwrap().unwrap();
    assert!((mass / inverse[(0, 0)] - 1.0).abs() < 1e-9);
}

#[test]
fn eight_bodies_and_forty_nuisances() {
    let (information, layout, prior) = random_problem(8, 40, 90, 31);
    let base = BaseParameters::new(&information, &layout).unwrap();
    assert_eq!((layout.unknowns(), base.rank()), (120, 90));
    let estimate = solved(&base, &prior).unwrap();
    assert!(estimate.is_active() && estimate.iterations < 50, "{}", estimate.iterations);
    check_links_solver(&solved, &base, &prior, 1e-6, 1e-2).unwrap();
}

#[test]
fn a_prior_of_another_layout_is_refused() {
    let (information, layout, prior) = random_problem(1, 0, 10, 1);
    let (_, other, _) = random_problem(1, 1, 10, 1);
    let base = BaseParameters::new(&information, &layout).unwrap();
    let count = |given, expected| Err(IdentificationError::UnknownCount { given, expected });
    let wrong = LinkPrior::uniform(&other, &[0.0; 11], 1.0).unwrap();
    assert_eq!(ConsistentLinks::new(&base, &wrong).map(|_| ()), count(11, 10));
    assert_eq!(LinkPrior::uniform(&layout, &[0.0; 9], 1.0).map(|_| ()), count(9, 10));
    assert_eq!(BaseParameters::new(&information, &other).map(|_| ()), count(10, 11));
    assert_eq!(base.mass_variance(1).map(|_| ()), count(20, 10));
    let refused = LinkPrior::uniform(&layout, &[1.0; 10], 0.0);
    assert_eq!(refused, Err(IdentificationError::NotPositive { index: 0, value: 0.0 }));
    let refused = LinkPrior::uniform(&layout, &[f64::NAN; 10], 1.0);
    assert_eq!(refused, Err(IdentificationError::NotFinite { row: 0 }));
    assert!(solved(&base, &prior).is_ok());
}

#[test]
fn a_direction_in_the_noise_is_left_to_the_prior_on_demand() {
    let (information, layout, prior) = random_problem(1, 0, 10, 5);
    let all = BaseParameters::new(&information, &layout).unwrap();
    assert_eq!((all.rank(), all.condition_number()), (10, all.singular_values()[0] / all.singular_values()[9]));
    let between = (all.singular_values()[6] * all.singular_values()[7]).sqrt();
    let bold = BaseParameters::with_signal_to_noise(&information, &layout, between).unwrap();
    assert_eq!((bold.rank(), bold.indistinguishable_changes().len()), (7, 3));
    assert!(bold.residual_sum_of_squares() > all.residual_sum_of_squares());
    // What is left out has no say: its data are gone, and the answer is a body all the same.
    check_links_solver(&solved, &bold, &prior, 1e-6, 1e-2).unwrap();
}
