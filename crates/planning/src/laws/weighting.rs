//! Laws of information weightings.

use super::{LawViolation, broken_unless, require};
use crate::error::PlanningError;
use crate::local::{InformationWeighting, WeightingContext};
use nalgebra::{SMatrix, SVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::noise::unit_interval;

/// What a weighting promises beyond the laws that all keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightingPromise<const P: usize> {
    /// Scale of the variances that are tried: from a thousandth to a thousand times these.
    pub typical_variance: [f64; P],
    /// Variances at and below which nothing is paid, where there are such.
    pub silent_variance: Option<[f64; P]>,
    /// A variance that wanders about the silent one by up to this share switches a weight at most once.
    pub steady_share: f64,
}

/// Plans in each tried mission.
const PLANS: usize = 12;
/// Length of each tried mission, s.
const DURATION_S: f64 = 120.0;

fn weights<const P: usize>(
    weighting: &mut dyn InformationWeighting<P>,
    variances: &[f64; P],
    initial: &[f64; P],
    elapsed_s: f64,
) -> Result<[f64; P], LawViolation> {
    let diagonal = |variances: &[f64; P]| SMatrix::from_diagonal(&SVector::from(*variances));
    let answer = WeightingContext::try_new(diagonal(variances), diagonal(initial), elapsed_s, DURATION_S)
        .and_then(|context| weighting.weights(&context));
    answer.map_err(|error: PlanningError| LawViolation {
        law: "every belief has weights",
        inputs: format!("{variances:?} at {elapsed_s} s"),
        expected: "weights".to_owned(),
        found: error.to_string(),
        error: f64::INFINITY,
        tolerance: 0.0,
    })
}

/// The laws of weightings, on `missions` of estimates that get better, stay or get worse by chance, drawn with `seed`; `new`
/// makes a weighting that has not been asked yet.
///
/// "every belief has weights", "weights are finite and not negative", "the same mission gives the same weights", "more variance
/// never weighs less" (the last estimate of a mission with one variance raised), "each quantity is judged on its own" (by that,
/// no other weight changes); with a promise, "what is known well enough weighs nothing" and "weights do not chatter".
///
/// # Errors
/// The first broken law.
pub fn check_information_weighting<const P: usize, W: InformationWeighting<P>>(
    new: impl Fn() -> W,
    promise: &WeightingPromise<P>,
    seed: u64,
    missions: usize,
) -> Result<(), LawViolation> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut uniform = || unit_interval(&mut rng);
    for _ in 0..missions {
        let spread = |chance: f64| libm::exp(6.9 * (2.0 * chance - 1.0));
        let initial = promise.typical_variance.map(|variance| variance * spread(uniform()));
        let mut variances = initial;
        let mut mission = Vec::new();
        for plan in 0..PLANS {
            let elapsed_s = DURATION_S * (plan as f64 + uniform()) / PLANS as f64;
            mission.push((variances, elapsed_s));
            variances = variances.map(|variance| variance * libm::exp(3.0 * (uniform() - 0.6)));
        }
        check_mission(&new, promise, &initial, &mission)?;
        if let Some(silent) = promise.silent_variance {
            check_silence(&new, &silent, &initial, promise.steady_share, &mut uniform)?;
        }
    }
    Ok(())
}

fn check_mission<const P: usize, W: InformationWeighting<P>>(
    new: &impl Fn() -> W,
    promise: &WeightingPromise<P>,
    initial: &[f64; P],
    mission: &[([f64; P], f64)],
) -> Result<(), LawViolation> {
    let fly = |raised: Option<(usize, f64)>| -> Result<Vec<[f64; P]>, LawViolation> {
        let mut weighting = new();
        let mut answers = Vec::new();
        for (index, (variances, elapsed_s)) in mission.iter().enumerate() {
            let mut variances = *variances;
            if let (Some((quantity, factor)), true) = (raised, index + 1 == mission.len()) {
                variances[quantity] *= factor;
            }
            answers.push(weights(&mut weighting, &variances, initial, *elapsed_s)?);
        }
        Ok(answers)
    };
    let answers = fly(None)?;
    for ((variances, elapsed_s), answer) in mission.iter().zip(&answers) {
        let is_weight = answer.iter().all(|weight| weight.is_finite() && *weight >= 0.0);
        let law = "weights are finite and not negative";
        require(law, &(variances, elapsed_s), &"weights", answer, broken_unless(is_weight), 0.0)?;
        for i in 0..P {
            if promise.silent_variance.is_some_and(|silent| variances[i] <= silent[i]) {
                let law = "what is known well enough weighs nothing";
                require(law, &(variances, elapsed_s), &0.0, &answer[i], answer[i], 0.0)?;
            }
        }
    }
    let again = fly(None)?;
    let is_same = answers == again;
    require("the same mission gives the same weights", &mission, &answers, &again, broken_unless(is_same), 0.0)?;
    let Some(before) = answers.last() else { return Ok(()) };
    for quantity in 0..P {
        let mut least = before[quantity];
        for factor in [1.01, 2.0, 10.0, 1000.0] {
            let raised = fly(Some((quantity, factor)))?;
            let Some(after) = raised.last() else { return Ok(()) };
            let inputs = (mission, quantity, factor);
            let law = "more variance never weighs less";
            require(law, &inputs, &least, &after[quantity], least - after[quantity], 1e-12 * least)?;
            least = after[quantity];
            let others = (0..P).filter(|i| *i != quantity).map(|i| (after[i] - before[i]).abs());
            let law = "each quantity is judged on its own";
            require(law, &inputs, before, after, others.fold(0.0, f64::max), 0.0)?;
        }
    }
    Ok(())
}

/// A variance that comes down and then wanders about the silent one.
fn check_silence<const P: usize, W: InformationWeighting<P>>(
    new: &impl Fn() -> W,
    silent: &[f64; P],
    initial: &[f64; P],
    share: f64,
    uniform: &mut impl FnMut() -> f64,
) -> Result<(), LawViolation> {
    let mut weighting = new();
    let mut before = [true; P];
    let mut switches = [0_u32; P];
    let factors = core::iter::once(1.0 + 2.0 * share).chain((0..PLANS).map(|_| 1.0 + share * (2.0 * uniform() - 1.0)));
    for factor in factors {
        let now = weights(&mut weighting, &silent.map(|variance| variance * factor), initial, 0.0)?.map(|w| w > 0.0);
        for i in 0..P {
            switches[i] += u32::from(now[i] != before[i]);
        }
        before = now;
    }
    let most = switches.iter().max().copied().unwrap_or(0);
    require("weights do not chatter", &(silent, share), &1, &switches, f64::from(most), 1.0)
}
