//! Information weightings keep their laws, and every law catches a planted defect by name.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::float_cmp)]

use core::cell::Cell;
use tumble_planning::PlanningError;
use tumble_planning::laws::{LawViolation, WeightingPromise, check_information_weighting};
use tumble_planning::local::{
    CovarianceWeighting, ExponentialWeighting, FixedWeighting, Hysteresis, InformationWeighting, ShutOff,
    StepWeighting, WeightingContext,
};
use tumble_planning::nalgebra::{Matrix2, SMatrix};

const BASE: [f64; 4] = [50.0, 20.0, 20.0, 0.0];
const TARGET: [f64; 4] = [0.03, 1e-4, 1e-4, 1e-4];
const ALPHA: f64 = 2.2;

fn covariance() -> CovarianceWeighting<4> {
    CovarianceWeighting::try_new(BASE, TARGET, ALPHA, 5.0).unwrap()
}

fn steady() -> CovarianceWeighting<4> {
    covariance().with_hysteresis(Hysteresis { return_factor: 1.5 }).unwrap()
}

fn promise(silent_variance: Option<[f64; 4]>, steady_share: f64) -> WeightingPromise<4> {
    WeightingPromise { typical_variance: TARGET.map(|target| 3.0 * target), silent_variance, steady_share }
}

fn thresholds() -> [f64; 4] {
    TARGET.map(|target| ALPHA * target)
}

fn check<W: InformationWeighting<4>>(new: impl Fn() -> W, promise: &WeightingPromise<4>) -> Result<(), LawViolation> {
    check_information_weighting(new, promise, 3, 60)
}

#[test]
fn all_weightings_keep_the_laws() {
    let none = promise(None, 0.0);
    check(|| FixedWeighting::try_new(BASE).unwrap(), &none).unwrap();
    check(|| FixedWeighting::only(3, 20.0).unwrap(), &none).unwrap();
    check(|| StepWeighting::try_new(BASE, vec![(0.25, 1.0), (0.5, 0.8), (0.75, 0.4)]).unwrap(), &none).unwrap();
    check(|| ExponentialWeighting::try_new(BASE, 8.0, 0.1).unwrap(), &none).unwrap();
    check(covariance, &promise(Some(thresholds()), 0.0)).unwrap();
    check(|| covariance().with_shut_off(ShutOff::Continuous), &promise(Some(thresholds()), 0.0)).unwrap();
    check(steady, &promise(Some(thresholds()), 0.3)).unwrap();
    check(|| steady().with_shut_off(ShutOff::Continuous), &promise(Some(thresholds()), 0.3)).unwrap();
    let boxed = || -> Box<dyn InformationWeighting<4>> { Box::new(steady()) };
    let context = WeightingContext::try_new(SMatrix::identity(), SMatrix::identity(), 0.0, 1.0).unwrap();
    assert!(boxed().weights(&context).unwrap()[0] > 40.0);
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Negative,
    NotANumber,
    Refuses,
    Remembers,
    Decreases,
    LooksAtOthers,
    Pays,
    Chatters,
}

struct Faulty {
    inner: CovarianceWeighting<4>,
    fault: Fault,
    asked: u64,
}

impl InformationWeighting<4> for Faulty {
    fn weights(&mut self, context: &WeightingContext<4>) -> Result<[f64; 4], PlanningError> {
        let mut weights = self.inner.weights(context)?;
        let variances = context.variances();
        match self.fault {
            Fault::Negative => weights[3] = -1e-9,
            Fault::NotANumber if variances[0] < 0.01 => weights[0] = f64::NAN,
            Fault::Refuses if variances[0] < 0.01 => {
                return Err(PlanningError::NotPositive { what: "a variance", value: 0.0 });
            }
            Fault::Remembers => weights[0] += self.asked as f64,
            Fault::Decreases if variances[2] > 100.0 * TARGET[2] => weights[2] *= 0.9,
            Fault::LooksAtOthers if variances[2] > 100.0 * TARGET[2] => weights[1] *= 0.9,
            Fault::Pays if weights[1] == 0.0 => weights[1] = 1e-6,
            _ => {}
        }
        Ok(weights)
    }
}

#[test]
fn planted_defects_are_caught_by_name() {
    let asked = Cell::new(0);
    let law_of = |fault: Fault| {
        let new = || {
            asked.set(asked.get() + 1);
            let inner = if fault == Fault::Chatters { covariance() } else { steady() };
            Faulty { inner, fault, asked: asked.get() }
        };
        check(new, &promise(Some(thresholds()), 0.3)).expect_err("not caught").law
    };
    assert_eq!(law_of(Fault::Negative), "weights are finite and not negative");
    assert_eq!(law_of(Fault::NotANumber), "weights are finite and not negative");
    assert_eq!(law_of(Fault::Refuses), "every belief has weights");
    assert_eq!(law_of(Fault::Remembers), "the same mission gives the same weights");
    assert_eq!(law_of(Fault::Decreases), "more variance never weighs less");
    assert_eq!(law_of(Fault::LooksAtOthers), "each quantity is judged on its own");
    assert_eq!(law_of(Fault::Pays), "what is known well enough weighs nothing");
    assert_eq!(law_of(Fault::Chatters), "weights do not chatter");
}

fn at(elapsed_s: f64) -> WeightingContext<2> {
    WeightingContext::try_new(Matrix2::identity(), Matrix2::identity(), elapsed_s, 200.0).unwrap()
}

#[test]
fn schedules_are_those_given() {
    let mut steps = StepWeighting::try_new([50.0, 20.0], vec![(0.25, 1.0), (0.5, 0.8), (0.75, 0.4)]).unwrap();
    let mut decays = ExponentialWeighting::try_new([50.0, 20.0], 8.0, 0.1).unwrap();
    for (elapsed_s, factor) in
        [(0.0, 1.0), (49.9, 1.0), (50.0, 0.8), (99.9, 0.8), (100.0, 0.4), (150.0, 0.0), (1e9, 0.0)]
    {
        assert_eq!(steps.weights(&at(elapsed_s)).unwrap(), [50.0 * factor, 20.0 * factor], "{elapsed_s}");
    }
    // exp(-8 x) = 0.1 at x = ln(10) / 8 = 0.28782
    for (elapsed_s, factor) in [(0.0, 1.0), (25.0, (-1.0_f64).exp()), (57.5, (-2.3_f64).exp()), (57.6, 0.0)] {
        let weights = decays.weights(&at(elapsed_s)).unwrap();
        assert!(
            (weights[0] - 50.0 * factor).abs() < 1e-13 && (weights[1] - 20.0 * factor).abs() < 1e-13,
            "{elapsed_s}"
        );
    }
}

#[test]
fn impossible_numbers_are_errors() {
    type Steps = Vec<(f64, f64)>;
    let steps = |steps: Steps| StepWeighting::try_new([1.0], steps).unwrap_err();
    assert!(matches!(steps(vec![(0.5, 1.0), (0.5, 0.5)]), PlanningError::OutOfRange { lower: 0.5, .. }));
    assert!(matches!(steps(vec![(0.5, -1.0)]), PlanningError::Negative { .. }));
    assert!(matches!(steps(vec![(f64::NAN, 1.0)]), PlanningError::NotFinite { .. }));
    assert!(matches!(ExponentialWeighting::try_new([1.0], -8.0, 0.1), Err(PlanningError::Negative { .. })));
    assert!(matches!(FixedWeighting::<4>::only(4, 1.0), Err(PlanningError::OutOfRange { value: 4.0, .. })));
    assert!(matches!(FixedWeighting::try_new([-1.0]), Err(PlanningError::Negative { .. })));

    let known = Matrix2::new(1.0, 0.5, 0.5, 1.0);
    let context =
        |covariance, elapsed_s, duration_s| WeightingContext::try_new(covariance, known, elapsed_s, duration_s);
    assert!(context(known, 0.0, 1.0).is_ok() && context(Matrix2::zeros(), 0.0, 1.0).is_ok());
    assert!(matches!(context(known, -1.0, 1.0), Err(PlanningError::Negative { .. })));
    assert!(matches!(context(known, 0.0, 0.0), Err(PlanningError::NotPositive { .. })));
    assert!(matches!(context(-known, 0.0, 1.0), Err(PlanningError::Negative { .. })));
    assert!(matches!(context(Matrix2::new(1.0, 2.0, 2.0, 1.0), 0.0, 1.0), Err(PlanningError::OutOfRange { .. })));
    assert!(matches!(context(Matrix2::new(1.0, 0.5, 0.4, 1.0), 0.0, 1.0), Err(PlanningError::Asymmetric { .. })));
    assert!(matches!(context(known * f64::NAN, 0.0, 1.0), Err(PlanningError::NotFinite { .. })));
}
