//! Tutorial: bring your own criterion. Three steps: implement, check the laws, design.
//!
//! The example wants the mass and nothing else, say for the fuel left. Below it the crate's own criteria pass the same laws,
//! and one mistake for each law fails it by name.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::random::Random;
use tumble_identification::excitation::{
    ChannelLimits, CriterionGradient, ExcitationCriterion, NormalizedCondition, PlanarExcitation,
};
use tumble_identification::fourier::FourierBasis;
use tumble_identification::laws::{
    check_change_of_units, check_excitation_criterion, check_more_information, check_optimality_criterion,
};
use tumble_identification::lie::laws::LawViolation;
use tumble_identification::nalgebra::{SMatrix, SVector};
use tumble_identification::{AOptimality, ConditionNumber, DOptimality, EOptimality, InLikeUnits, OptimalityCriterion};

// Step 1: say what an information matrix costs, and the derivative. Here the variance of the first parameter.
struct MassVariance;

impl<const P: usize> OptimalityCriterion<P> for MassVariance {
    fn cost_and_gradient(&self, information: &SMatrix<f64, P, P>) -> Option<(f64, SMatrix<f64, P, P>)> {
        // Also where the mass is known and others are not: a design should not end there.
        DOptimality.cost(information)?;
        let mass = SVector::from_fn(|i, _| if i == 0 { 1.0 } else { 0.0 });
        let covariance_with_mass = information.cholesky()?.solve(&mass);
        Some((covariance_with_mass[0], -(covariance_with_mass * covariance_with_mass.transpose())))
    }
}

#[test]
fn a_criterion_of_ones_own() {
    // Step 2: the laws. Every optimality criterion is an excitation criterion too.
    let informations = informations::<10>(11);
    check_optimality_criterion(&MassVariance, &informations, 1e-6).unwrap();
    check_excitation_criterion(&MassVariance, &at_distances(&informations), 1e-6).unwrap();
    check_more_information(&MassVariance, &informations, &directions(12)).unwrap();

    // Step 3: design, here in the plane. Motions that are best for all parameters are not best for one.
    let [position, yaw] = [ChannelLimits::symmetric(0.5, 0.1, 0.05), ChannelLimits::symmetric(3.0, 0.5, 0.2)];
    let problem =
        PlanarExcitation::try_new(FourierBasis::try_new(20.0, 3).unwrap(), &[position, position, yaw], 100).unwrap();
    let variance = |information| OptimalityCriterion::cost(&MassVariance, information).unwrap();
    let for_all = problem.design(&DOptimality, 3, 1).unwrap();
    let for_mass = problem.design(&MassVariance, 3, 1).unwrap();
    let (all, mass) = (variance(&for_all.information), variance(&for_mass.information));
    println!("variance of the mass: {mass:.3e} instead of {all:.3e} kg^2");
    assert!(mass < all, "{mass} {all}");
}

/// Random, with eigenvalues over three decades and parameters of unlike sizes.
fn informations<const P: usize>(seed: u64) -> Vec<SMatrix<f64, P, P>> {
    let mut random = Random::new(seed);
    let mut one = || {
        let mut information = SMatrix::<f64, P, P>::zeros();
        for _ in 0..3 * P {
            let row = SMatrix::<f64, 1, P>::from_fn(|_, _| random.normal());
            information += row.transpose() * row;
        }
        let sizes = SVector::<f64, P>::from_fn(|_, _| random.magnitude(0.2, 5.0));
        information.component_mul(&(sizes * sizes.transpose()))
    };
    (0..20).map(|_| one()).collect()
}

/// Of rank one.
fn directions<const P: usize>(seed: u64) -> Vec<SMatrix<f64, P, P>> {
    let mut random = Random::new(seed);
    let mut one = || {
        let row = SMatrix::<f64, 1, P>::from_fn(|_, _| random.normal());
        row.transpose() * row
    };
    (0..20).map(|_| one()).collect()
}

fn at_distances<const P: usize>(informations: &[SMatrix<f64, P, P>]) -> Vec<(SMatrix<f64, P, P>, [f64; 6])> {
    let mut random = Random::new(17);
    informations.iter().map(|f| (*f, std::array::from_fn(|_| random.uniform(0.05, 0.5)))).collect()
}

const V1: NormalizedCondition = NormalizedCondition { rms_weights: [1.0, 2.0, 3.0, 0.5, 0.0, 7.0] };

fn the_crates_criteria_obey_the_laws_for<const P: usize>(seed: u64) {
    let informations = informations::<P>(seed);
    let magnitudes = SVector::from_fn(|i, _| 0.3 + i as f64);
    let in_like_units = InLikeUnits { criterion: AOptimality, magnitudes };
    let criteria: [&dyn OptimalityCriterion<P>; 5] =
        [&AOptimality, &DOptimality, &EOptimality, &ConditionNumber, &in_like_units];
    for (i, criterion) in criteria.into_iter().enumerate() {
        check_optimality_criterion(criterion, &informations, 1e-6)
            .unwrap_or_else(|violation| panic!("{i}: {violation}"));
    }
    for criterion in [&AOptimality as &dyn OptimalityCriterion<P>, &DOptimality, &EOptimality, &in_like_units] {
        check_more_information(criterion, &informations, &directions(seed + 1)).unwrap();
    }
    for criterion in [&AOptimality as &dyn ExcitationCriterion<P>, &DOptimality, &in_like_units, &V1] {
        check_excitation_criterion(criterion, &at_distances(&informations), 1e-6).unwrap();
    }
    check_change_of_units(&DOptimality, &informations, &magnitudes, 1e-12).unwrap();
    check_change_of_units(&V1, &informations, &magnitudes, 1e-12).unwrap();
}

#[test]
fn the_crates_criteria_obey_the_laws() {
    the_crates_criteria_obey_the_laws_for::<4>(1);
    the_crates_criteria_obey_the_laws_for::<10>(2);
}

/// What may be wrong with a criterion.
#[derive(Clone, Copy)]
enum Defect {
    /// A small prior keeps the cost finite.
    Ridge,
    Refusing,
    /// The cost alone is of something else.
    OtherCost,
    /// Both off-diagonal derivatives in one entry.
    Triangle,
    Uphill,
    /// Each off-diagonal pair as one variable.
    PairsAsOne,
    /// As thesis 2.3.1 prints it: the trace of the inverse is to be large.
    Printed,
}

struct Spoiled(Defect);

impl<const P: usize> OptimalityCriterion<P> for Spoiled {
    fn cost_and_gradient(&self, information: &SMatrix<f64, P, P>) -> Option<(f64, SMatrix<f64, P, P>)> {
        if let Defect::Ridge = self.0 {
            return AOptimality.cost_and_gradient(&(information + SMatrix::identity() * 1e-6));
        }
        let (cost, gradient) = AOptimality.cost_and_gradient(information)?;
        match self.0 {
            Defect::Ridge | Defect::Refusing => None,
            Defect::OtherCost => Some((cost, gradient)),
            Defect::Triangle => {
                Some((cost, gradient.upper_triangle() * 2.0 - SMatrix::from_diagonal(&gradient.diagonal())))
            }
            Defect::Uphill => Some((cost, -gradient)),
            Defect::PairsAsOne => Some((cost, gradient * 2.0 - SMatrix::from_diagonal(&gradient.diagonal()))),
            Defect::Printed => Some((-cost, -gradient)),
        }
    }

    fn cost(&self, information: &SMatrix<f64, P, P>) -> Option<f64> {
        let cost = self.cost_and_gradient(information)?.0;
        Some(if let Defect::OtherCost = self.0 { 0.5 * cost } else { cost })
    }
}

/// The reward without its derivative.
struct RewardWithoutSlope;

impl<const P: usize> ExcitationCriterion<P> for RewardWithoutSlope {
    fn gradient(&self, information: &SMatrix<f64, P, P>, rms: &[f64; 6]) -> Option<CriterionGradient<P>> {
        Some(CriterionGradient { by_rms: [0.0; 6], ..V1.gradient(information, rms)? })
    }
}

/// Columns taken as of unit length while differentiating.
struct FrozenColumns;

impl<const P: usize> ExcitationCriterion<P> for FrozenColumns {
    fn gradient(&self, information: &SMatrix<f64, P, P>, rms: &[f64; 6]) -> Option<CriterionGradient<P>> {
        let found = V1.gradient(information, rms)?;
        let by_information = found.by_information - SMatrix::from_diagonal(&found.by_information.diagonal());
        Some(CriterionGradient { by_information, ..found })
    }
}

fn broken_law(outcome: Result<(), LawViolation>) -> &'static str {
    outcome.expect_err("a planted defect must be caught").law
}

#[test]
fn planted_defects_are_caught_by_name() {
    let informations = informations::<4>(3);
    let motions = at_distances(&informations);
    let cases = [
        (Defect::Ridge, "information without a direction has no cost"),
        (Defect::Refusing, "information has a cost"),
        (Defect::OtherCost, "cost is that of the gradient"),
        (Defect::Triangle, "gradient is symmetric"),
        (Defect::Uphill, "gradient is the derivative"),
        (Defect::PairsAsOne, "gradient is the derivative"),
    ];
    for (defect, law) in cases {
        assert_eq!(broken_law(check_optimality_criterion(&Spoiled(defect), &informations, 1e-6)), law);
    }
    let more = directions(4);
    for criterion in [&Spoiled(Defect::Printed) as &dyn OptimalityCriterion<4>, &ConditionNumber] {
        assert_eq!(
            broken_law(check_more_information(criterion, &informations, &more)),
            "more information never costs more"
        );
    }
    let frozen = broken_law(check_excitation_criterion(&FrozenColumns, &motions, 1e-6));
    assert_eq!(frozen, "gradient is the derivative");
    let flat = broken_law(check_excitation_criterion(&RewardWithoutSlope, &motions, 1e-6));
    assert_eq!(flat, "gradient by distances is the derivative");
    let magnitudes = SVector::from([1.0, 2.0, 3.0, 4.0]);
    for criterion in [&AOptimality as &dyn ExcitationCriterion<4>, &EOptimality, &ConditionNumber] {
        let units = broken_law(check_change_of_units(criterion, &informations, &magnitudes, 1e-12));
        assert_eq!(units, "units change the cost by a constant");
    }
}
