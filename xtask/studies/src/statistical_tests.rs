//! Figures of many runs, each beside the band in which a correct estimator's lies.

use nalgebra::SMatrix;
use tumble_identification::statistics::{
    Band, coverage_band, effective_degrees_of_freedom, mean_square_band, normal_quantile, rms_ratio_band,
    rms_ratio_failure,
};

use crate::flights::{Errors, GROUPS, GroupCovariances};

/// The chance with which a correct estimator may fail one cell.
pub const CELL_CHANCE: f64 = 0.001;

/// One figure of a cell and where it must lie.
pub struct Test {
    pub quantity: String,
    pub value: f64,
    pub limits: Band,
    /// The chance that a correct estimator's figure lies outside.
    pub chance: f64,
}

impl Test {
    pub fn passes(&self) -> bool {
        self.limits.contains(self.value)
    }
}

/// Told after each run how many there are in all.
pub type Progress<'a> = dyn FnMut(usize) + 'a;

/// Errors of one run and the bound that belongs to its motion.
pub struct Run {
    pub errors: Errors,
    pub bound: GroupCovariances,
}

/// Root-mean-square error over root-mean-square bound of each group: at most `target`, not below its band under one.
pub fn ratio_tests(label: &str, runs: &[Run], target: f64, tests_in_cell: usize) -> Vec<Test> {
    let sum = |of: &dyn Fn(&Run) -> f64| runs.iter().map(of).sum::<f64>();
    let freedoms = [
        effective_degrees_of_freedom(runs.iter().map(|run| &run.bound.inertia)),
        effective_degrees_of_freedom(runs.iter().map(|run| &run.bound.center_of_mass)),
        effective_degrees_of_freedom(runs.iter().map(|run| &run.bound.mass)),
    ];
    (0..GROUPS.len())
        .map(|group| {
            let value = (sum(&|run| run.errors.norms()[group].powi(2)) / sum(&|run| run.bound.traces()[group])).sqrt();
            let band = rms_ratio_band(freedoms[group], 1.0 - CELL_CHANCE / tests_in_cell as f64);
            let limits = Band { low: band.low, high: band.high.max(target) };
            Test {
                quantity: format!("{label}: {} rms / bound", GROUPS[group]),
                value,
                limits,
                chance: rms_ratio_failure(freedoms[group], &limits),
            }
        })
        .collect()
}

/// All groups of all runs together, each error in units of its own run's bound: at most `target`.
pub fn pooled_test(label: &str, runs: &[Run], target: f64, tests_in_cell: usize) -> Test {
    let n = (runs.len() * GROUPS.len()) as f64;
    let (mut square, mut deviation) = (0.0, 0.0);
    for run in runs {
        for (norm, trace) in run.errors.norms().iter().zip(run.bound.traces()) {
            square += norm * norm / trace / n;
        }
    }
    // Groups of one run are correlated; at worst fully, when their deviations add.
    let one = |freedom: f64| (2.0 / freedom).sqrt() / GROUPS.len() as f64;
    deviation += one(relative_freedom(runs.iter().map(|run| &run.bound.inertia)));
    deviation += one(relative_freedom(runs.iter().map(|run| &run.bound.center_of_mass)));
    deviation += one(runs.len() as f64);
    let freedom = 2.0 / (deviation * deviation);
    let band = rms_ratio_band(freedom, 1.0 - CELL_CHANCE / tests_in_cell as f64);
    let limits = Band { low: 0.0, high: band.high.max(target) };
    Test {
        quantity: format!("{label}: pooled rms / bound"),
        value: square.sqrt(),
        limits,
        chance: rms_ratio_failure(freedom, &limits),
    }
}

/// Degrees of freedom of a sum of squares each in units of its own expectation.
fn relative_freedom<'a, const N: usize>(covariances: impl Iterator<Item = &'a SMatrix<f64, N, N>>) -> f64 {
    let (mut runs, mut sum) = (0.0, 0.0);
    for covariance in covariances {
        runs += 1.0;
        sum += covariance.norm_squared() / (covariance.trace() * covariance.trace());
    }
    runs * runs / sum
}

/// Errors of one number in units of their own deviations: their mean square in its band, and their 95 % intervals.
pub fn honesty_tests(label: &str, normalized: &[f64], tests_in_cell: usize) -> Vec<Test> {
    let n = normalized.len();
    let probability = 1.0 - CELL_CHANCE / tests_in_cell as f64;
    let inside = normalized.iter().filter(|error| error.abs() <= normal_quantile(0.95)).count();
    vec![
        nees_test(label, normalized.iter().map(|error| error * error), 1.0, tests_in_cell),
        Test {
            quantity: format!("{label}: coverage of 95 % intervals"),
            value: inside as f64 / n as f64,
            limits: coverage_band(0.95, n, probability),
            chance: 1.0 - probability,
        },
    ]
}

/// Normalised squared errors of `dimension` parameters each: their mean in its band.
pub fn nees_test(label: &str, squares: impl Iterator<Item = f64>, dimension: f64, tests_in_cell: usize) -> Test {
    let squares: Vec<f64> = squares.collect();
    let probability = 1.0 - CELL_CHANCE / tests_in_cell as f64;
    Test {
        quantity: format!("{label}: mean NEES"),
        value: squares.iter().sum::<f64>() / squares.len() as f64,
        limits: mean_square_band(dimension, squares.len(), probability),
        chance: 1.0 - probability,
    }
}

/// Runs from which on the target of an rms error is taken as it is; fewer scatter more.
const FULL_RUNS: f64 = 200.0;

/// The rms of errors: at most `target`, for an estimator whose errors have the deviation `sigma` it states.
pub fn rms_test(label: &str, errors: &[f64], sigma: f64, target: f64) -> Test {
    let n = errors.len() as f64;
    let scatter = |n: f64| rms_ratio_band(n, 1.0 - CELL_CHANCE).high;
    let high = target * (scatter(n) / scatter(FULL_RUNS)).max(1.0);
    Test {
        quantity: format!("{label}: rms error"),
        value: (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
        limits: Band { low: 0.0, high },
        chance: rms_ratio_failure(n, &Band { low: 0.0, high: high / sigma }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flights::chapter5_bodies;
    use nalgebra::SVector;
    use tumble_identification::noise::Gaussian;

    /// Runs of an imaginary estimator whose errors have `excess` times the deviation of the bound.
    fn imaginary(runs: usize, excess: f64) -> Vec<Run> {
        let mut random = Gaussian::from_seed(3);
        let body = chapter5_bodies()[0].parameters;
        (0..runs)
            .map(|_| {
                let factor = SMatrix::<f64, 10, 10>::from_fn(|_, _| 1e-4 * random.normal());
                let covariance = factor * factor.transpose();
                let noise = SVector::<f64, 10>::from_fn(|_, _| random.normal());
                let found = body.to_vector() + factor * noise * excess;
                Run { errors: Errors::of(&found, &body), bound: GroupCovariances::of(&covariance, &body) }
            })
            .collect()
    }

    #[test]
    fn an_efficient_estimator_passes_and_others_do_not() {
        for (excess, expected) in [(1.0, true), (0.7, false), (1.6, false)] {
            let runs = imaginary(300, excess);
            let tests = ratio_tests("imaginary", &runs, 1.15, 4);
            assert_eq!(tests.iter().all(Test::passes), expected, "{excess}");
            assert!(tests.iter().all(|test| test.chance > 0.0 && test.chance < CELL_CHANCE), "{excess}");
        }
        assert!(pooled_test("imaginary", &imaginary(300, 1.0), 1.10, 4).passes());
        assert!(!pooled_test("imaginary", &imaginary(300, 1.2), 1.10, 4).passes());
    }

    #[test]
    fn the_covariance_of_the_centre_of_mass_is_that_of_its_errors() {
        let runs = imaginary(2000, 1.0);
        let mean = |of: &dyn Fn(&Run) -> f64| runs.iter().map(of).sum::<f64>() / runs.len() as f64;
        let ratio = mean(&|run| run.errors.norms()[1].powi(2) / run.bound.traces()[1]);
        let freedom = relative_freedom(runs.iter().map(|run| &run.bound.center_of_mass));
        assert!(rms_ratio_band(freedom, 0.999).contains(ratio.sqrt()), "{ratio}");
    }

    #[test]
    fn over_confident_and_timid_deviations_are_seen() {
        let mut random = Gaussian::from_seed(4);
        for (scale, expected) in [(1.0, true), (1.4, false), (0.6, false)] {
            let normalized: Vec<f64> = (0..500).map(|_| scale * random.normal()).collect();
            assert_eq!(honesty_tests("x", &normalized, 2).iter().all(Test::passes), expected, "{scale}");
        }
    }
}
