//! The default solver of the excitation design against the reference route: argmin's L-BFGS with quadratic penalties, on the
//! same problem, with a cost and a gradient that share the regressor with the crate's and nothing else.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::random::Random;
use argmin::core::{CostFunction, Error, Executor, Gradient, State};
use argmin::solver::gradientdescent::SteepestDescent;
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use tumble_identification::excitation::{
    ChannelLimits, CriterionGradient, ExcitationCriterion, LimitsHold, SpaceExcitation,
};
use tumble_identification::fourier::{AttitudeChart, FourierBasis, MOTION_TERMS, MotionInstant};
use tumble_identification::nalgebra::{DMatrix, DVector, SVector};
use tumble_identification::regressors::{Regressor, newton_euler};
use tumble_identification::{AOptimality, DOptimality, FisherInformation, InLikeUnits};

const SAMPLES: usize = 100;
const STARTS: usize = 5;

fn basis() -> FourierBasis {
    FourierBasis::try_new(10.0, 3).unwrap()
}

/// Of problem 6: value, rate and acceleration of positions and of angles.
fn limits(channel: usize) -> [f64; 3] {
    if channel < 3 { [0.3, 0.2, 0.15] } else { [0.5, 0.4, 0.4] }
}

/// The cost of numbers, four for each channel, that are of the order of one, and a penalty on the limits.
#[derive(Clone)]
struct Penalized<'a> {
    criterion: &'a dyn ExcitationCriterion<10>,
    /// Values, rates and accelerations at the samples by the numbers of a channel whose limits are one.
    tables: [DMatrix<f64>; 3],
    weight: f64,
}

impl<'a> Penalized<'a> {
    fn new(criterion: &'a dyn ExcitationCriterion<10>) -> Self {
        let times: Vec<f64> = (0..SAMPLES).map(|i| 10.0 * i as f64 / SAMPLES as f64).collect();
        let rest = basis().rest_to_rest();
        Self { criterion, tables: basis().table(&times).map(|table| table * &rest), weight: 0.0 }
    }

    fn free(&self) -> usize {
        self.tables[0].ncols()
    }

    /// Values, rates and accelerations at the samples, one column for each channel.
    fn channels(&self, numbers: &[f64]) -> [DMatrix<f64>; 3] {
        let numbers = DMatrix::from_column_slice(self.free(), 6, numbers);
        self.tables.each_ref().map(|table| table * &numbers)
    }

    /// The motion at the samples.
    fn instants(&self, numbers: &[f64]) -> Vec<MotionInstant> {
        let channels = self.channels(numbers);
        let instant = |sample: usize| {
            let [value, rate, acceleration] = channels.each_ref().map(|table| table.row(sample).transpose());
            let parts = [value.as_slice(), rate.as_slice(), acceleration.as_slice()];
            MotionInstant::from_channels(AttitudeChart::EulerZyx, parts[0], parts[1], parts[2]).unwrap()
        };
        (0..SAMPLES).map(instant).collect()
    }

    /// What the criterion says, of unit noise.
    fn judged(&self, instants: &[MotionInstant]) -> CriterionGradient<10> {
        let mut information = FisherInformation::new();
        for instant in instants {
            information.add(&instant.regressor());
        }
        self.criterion.gradient(information.matrix(), &[0.0; 6]).unwrap()
    }

    fn cost_without_penalty(&self, numbers: &[f64]) -> f64 {
        self.judged(&self.instants(numbers)).cost
    }

    fn gradient_without_penalty(&self, numbers: &[f64]) -> DVector<f64> {
        let instants = self.instants(numbers);
        let by_information = self.judged(&instants).by_information;
        let mut by_channels = [0; 3].map(|_| DMatrix::zeros(SAMPLES, 6));
        for (sample, instant) in instants.iter().enumerate() {
            let by_regressor = instant.regressor() * by_information * 2.0;
            // The regressor is quadratic in its terms, so this difference is exact.
            let mut by_terms = SVector::<f64, MOTION_TERMS>::zeros();
            for term in 0..9 {
                let moved = |by: f64| {
                    let mut terms = instant.terms();
                    terms[term] += by;
                    regressor(&terms)
                };
                by_terms[term] = by_regressor.dot(&(moved(1.0) - moved(-1.0))) / 2.0;
            }
            for (by_channels, sensitivity) in by_channels.iter_mut().zip(instant.sensitivities()) {
                let row = sensitivity.tr_mul(&by_terms).fixed_rows::<6>(0).transpose();
                by_channels.row_mut(sample).copy_from(&row);
            }
        }
        self.by_numbers(&by_channels)
    }

    fn by_numbers(&self, by_channels: &[DMatrix<f64>; 3]) -> DVector<f64> {
        let parts = self.tables.iter().zip(by_channels);
        let gradient = parts.map(|(table, by)| table.tr_mul(by)).sum::<DMatrix<f64>>();
        DVector::from_column_slice(gradient.as_slice())
    }

    /// Shares of the limits by which they are exceeded, with their signs.
    fn excess(&self, numbers: &[f64]) -> [DMatrix<f64>; 3] {
        let channels = self.channels(numbers);
        std::array::from_fn(|order| {
            DMatrix::from_fn(SAMPLES, 6, |sample, channel| {
                let share = channels[order][(sample, channel)] / limits(channel)[order];
                share - share.clamp(-1.0, 1.0)
            })
        })
    }

    fn largest_excess(&self, numbers: &[f64]) -> f64 {
        self.excess(numbers).iter().map(DMatrix::amax).fold(0.0, f64::max)
    }

    /// Random numbers that use four fifths of the limits.
    fn start(&self, random: &mut Random) -> Vec<f64> {
        let mut numbers: Vec<f64> = (0..6 * self.free()).map(|_| random.uniform(-1.0, 1.0)).collect();
        let channels = self.channels(&numbers);
        for (channel, numbers) in numbers.chunks_exact_mut(self.free()).enumerate() {
            let share = |order: usize| channels[order].column(channel).amax() / limits(channel)[order];
            let largest = (0..3).map(share).fold(0.0, f64::max);
            for number in numbers {
                *number *= 0.8 / largest;
            }
        }
        numbers
    }
}

fn regressor(terms: &SVector<f64, MOTION_TERMS>) -> Regressor<f64> {
    let part = |first: usize| terms.fixed_rows::<3>(first).into_owned();
    newton_euler(&part(0), &part(3), &part(6))
}

impl CostFunction for Penalized<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, numbers: &Self::Param) -> Result<f64, Error> {
        let penalty: f64 = self.excess(numbers).iter().map(DMatrix::norm_squared).sum();
        Ok(self.cost_without_penalty(numbers) + 0.5 * self.weight * penalty)
    }
}

impl Gradient for Penalized<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, numbers: &Self::Param) -> Result<Vec<f64>, Error> {
        let mut by_channels = self.excess(numbers);
        for (order, by_channels) in by_channels.iter_mut().enumerate() {
            for (channel, mut column) in by_channels.column_iter_mut().enumerate() {
                column *= self.weight / limits(channel)[order];
            }
        }
        let gradient = self.gradient_without_penalty(numbers) + self.by_numbers(&by_channels);
        Ok(gradient.as_slice().to_vec())
    }
}

/// Numbers that the reference route ends at.
fn reference(criterion: &dyn ExcitationCriterion<10>, start: Vec<f64>) -> Vec<f64> {
    let mut problem = Penalized::new(criterion);
    let mut numbers = start;
    for weight in [1e1, 1e2, 1e3, 1e4] {
        problem.weight = weight;
        let solver = LBFGS::new(MoreThuenteLineSearch::new(), 10).with_tolerance_cost(1e-7).unwrap();
        let executor = Executor::new(problem.clone(), solver);
        let result = executor.configure(|state| state.param(numbers.clone()).max_iters(200)).run().unwrap();
        numbers = result.state().get_best_param().unwrap().clone();
    }
    numbers
}

#[test]
fn the_reference_gradient_is_the_derivative() {
    let mut problem = Penalized::new(&DOptimality);
    problem.weight = 10.0;
    let mut numbers = problem.start(&mut Random::new(3));
    // Outside some limits.
    for number in &mut numbers {
        *number *= 1.5;
    }
    let gradient = problem.gradient(&numbers).unwrap();
    for (i, stated) in gradient.iter().enumerate() {
        let at = |by: f64| {
            let mut moved = numbers.clone();
            moved[i] += by;
            problem.cost(&moved).unwrap()
        };
        let slope = (at(1e-6) - at(-1e-6)) / 2e-6;
        assert!((slope - stated).abs() < 1e-5 * (1.0 + slope.abs()), "{i}: {slope} {stated}");
    }
}

/// The cost of the design, and of the reference route from where it ended.
fn design_and_polished(criterion: &impl ExcitationCriterion<10>) -> (f64, f64) {
    let problem = Penalized::new(criterion);
    let channel_limits = std::array::from_fn(|channel| {
        let [workspace, rate, acceleration] = limits(channel);
        ChannelLimits::symmetric(workspace, rate, acceleration)
    });
    let excitation = SpaceExcitation::try_new(basis(), &channel_limits, SAMPLES).unwrap();
    let design = excitation.with_limits_holding(LimitsHold::AtSamples).design(criterion, STARTS, 1).unwrap();
    let numbers = basis().rest_to_rest().tr_mul(design.motion.coefficients()).as_slice().to_vec();
    let cost = problem.cost_without_penalty(&numbers);
    assert!((cost - design.cost).abs() < 1e-9 * cost.abs(), "{cost} {}", design.cost);
    let excess = problem.largest_excess(&numbers);
    assert!(excess == 0.0, "{excess:e}");

    // Penalties step over the limits, if only by a little.
    let polished = reference(criterion, numbers);
    let excess = problem.largest_excess(&polished);
    assert!(excess > 1e-6 && excess < 0.02, "{excess:e}");
    println!("polished outside by {excess:.1e}: {:.4}", problem.cost_without_penalty(&polished));
    (cost, problem.cost_without_penalty(&polished))
}

/// Costs of local minima from different random starts differ by more than solvers do and are not compared: what is left to
/// gain where the design ended is.
#[test]
fn the_reference_gains_little_from_where_the_design_ends() {
    let (cost, polished) = design_and_polished(&DOptimality);
    println!("D: {cost:.4}, polished {polished:.4}");
    // Half a per cent of the variances in the geometric mean.
    assert!(cost < polished + 0.05, "{cost} {polished}");
    let magnitudes = SVector::from([1.0, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]);
    let (cost, polished) = design_and_polished(&InLikeUnits { criterion: AOptimality, magnitudes });
    println!("A: {cost:.4}, polished {polished:.4}");
    assert!(cost < 1.02 * polished, "{cost} {polished}");
}

fn space() -> SpaceExcitation {
    let channel_limits = std::array::from_fn(|channel| {
        let [workspace, rate, acceleration] = limits(channel);
        ChannelLimits::symmetric(workspace, rate, acceleration)
    });
    SpaceExcitation::try_new(basis(), &channel_limits, SAMPLES).unwrap().with_limits_holding(LimitsHold::AtSamples)
}

/// The crate's own cost function against the reference above, which shares nothing with it but the regressor.
#[test]
fn the_cost_function_and_its_gradient_are_those_of_the_reference() {
    let (excitation, mut reference) = (space(), Penalized::new(&DOptimality));
    reference.weight = 10.0;
    let cost = excitation.cost_function(&DOptimality, reference.weight);
    let mut numbers = reference.start(&mut Random::new(3));
    // Outside some limits.
    for number in &mut numbers {
        *number *= 1.5;
    }
    assert_eq!(cost.unknowns(), numbers.len());
    let (stated, expected) = (cost.cost(&numbers).unwrap(), reference.cost(&numbers).unwrap());
    assert!((stated - expected).abs() < 1e-9 * expected.abs(), "{stated} {expected}");
    let (stated, expected) = (cost.gradient(&numbers).unwrap(), reference.gradient(&numbers).unwrap());
    let size = expected.iter().fold(0.0, |most: f64, entry| most.max(entry.abs()));
    for (i, (stated, expected)) in stated.iter().zip(&expected).enumerate() {
        assert!((stated - expected).abs() < 1e-9 * size, "{i}: {stated} {expected}");
    }
    let again = cost.unknowns_of(&cost.motion(&numbers).unwrap());
    assert!(again.iter().zip(&numbers).all(|(a, b)| (a - b).abs() < 1e-14), "{again:?}");
    assert!(cost.cost(&numbers[1..].to_vec()).unwrap().is_infinite() && cost.motion(&numbers[1..]).is_none());
    assert!(cost.gradient(&numbers[1..].to_vec()).is_err() && cost.gradient(&vec![0.0; numbers.len()]).is_err());
    assert!(cost.cost(&vec![0.0; numbers.len()]).unwrap().is_infinite());
}

/// Two of argmin's solvers on the crate's cost function: both descend from a random motion, and neither goes further than the
/// design by more than the penalty lets it out of the limits.
#[test]
fn solvers_of_argmin_minimise_the_cost_function() {
    let excitation = space();
    let start = Penalized::new(&DOptimality).start(&mut Random::new(5));
    let of = |numbers: &Vec<f64>| excitation.cost_function(&DOptimality, 1e3).cost(numbers).unwrap();
    let before = of(&start);
    let run = || excitation.cost_function(&DOptimality, 1e3);
    let quasi_newton = Executor::new(run(), LBFGS::new(MoreThuenteLineSearch::new(), 10))
        .configure(|state| state.param(start.clone()).max_iters(60))
        .run()
        .unwrap();
    let descent = Executor::new(run(), SteepestDescent::new(MoreThuenteLineSearch::new()))
        .configure(|state| state.param(start.clone()).max_iters(60))
        .run()
        .unwrap();
    let found = [quasi_newton.state().get_best_cost(), descent.state().get_best_cost()];
    println!("from {before:.3} to {found:.3?}");
    assert!(found.iter().all(|cost| *cost < before - 0.5), "{before} {found:?}");
    assert!(found[0] <= found[1] + 0.5, "{found:?}");
    let designed = excitation.design(&DOptimality, 1, 1).unwrap().cost;
    assert!(found[0] > designed - 1.0, "{found:?} {designed}");
}
