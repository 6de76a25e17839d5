//! Tutorial: bring your own estimator of a record. Three steps: implement, check the laws, put it into `identify` by name.
//!
//! The estimator here is least squares that outliers cannot bend: rows beyond so many standard deviations pull with a constant force (Huber).

use crate::exact_motion::{Multisine, Run};
use crate::random::Random;
use tumble_identification::dynamics::strategies::body_d;
use tumble_identification::estimator::{Estimator, EstimatorError, Finding, Verdict};
use tumble_identification::laws::{Case, check_estimator};
use tumble_identification::lie::Wrench;
use tumble_identification::nalgebra::{SMatrix, SVector};
use tumble_identification::{FlightLikelihood, MotionSample, Pipeline, Problem, Settings, Thrusters, methods};

// Step 1: from the rows of the problem to a point with its covariance; errors of your own keep their numbers.
struct Huber {
    problem: Problem,
    bound: f64,
}

#[derive(Debug)]
struct Unsolvable {
    round: usize,
    rows: usize,
}

impl std::fmt::Display for Unsolvable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "round {} of {} rows cannot be solved", self.round, self.rows)
    }
}

impl std::error::Error for Unsolvable {}

impl Estimator for Huber {
    type Record = [MotionSample];

    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        let rows = self.problem.rows(record)?;
        let m = self.problem.scale.parameter_magnitudes();
        let length = self.problem.scale.length_m();
        // Torque counts at the body's length until residuals say more.
        let mut sigma = SVector::<f64, 6>::from([length, length, length, 1.0, 1.0, 1.0]);
        let (mut weights, mut finding) = (vec![1.0; rows.len()], None);
        for round in 0..8 {
            let (mut a, mut b) = (SMatrix::<f64, 10, 10>::zeros(), SVector::<f64, 10>::zeros());
            for (row, weight) in rows.iter().zip(&weights) {
                let inverse = SMatrix::<f64, 6, 6>::from_diagonal(&sigma.map(|s| weight / (s * s)));
                a += row.regressor.transpose() * inverse * row.regressor;
                b += row.regressor.transpose() * inverse * row.wrench;
            }
            let scaled = SMatrix::<f64, 10, 10>::from_fn(|i, j| a[(i, j)] * m[i] * m[j]);
            let solved = scaled.cholesky().ok_or(Unsolvable { round, rows: rows.len() });
            let solved = solved.map_err(|error| EstimatorError::foreign("huber", error))?;
            let point = solved.solve(&b.component_mul(&m)).component_mul(&m);
            let inverse = solved.inverse() * self.problem.rows_alike();
            finding = Some((point, SMatrix::<f64, 10, 10>::from_fn(|i, j| inverse[(i, j)] * m[i] * m[j])));
            let left: Vec<SVector<f64, 6>> = rows.iter().map(|row| row.wrench - row.regressor * point).collect();
            let squares: SVector<f64, 6> = left.iter().zip(&weights).map(|(l, w)| l.component_mul(l) * *w).sum();
            sigma = squares.map(|s| (s / rows.len() as f64).sqrt());
            let far = |l: &SVector<f64, 6>| l.component_div(&sigma).norm() / 6.0_f64.sqrt();
            weights = left.iter().map(|l| (self.bound / far(l)).min(1.0)).collect();
        }
        let (point, covariance) =
            finding.ok_or_else(|| EstimatorError::foreign("huber", Unsolvable { round: 0, rows: 0 }))?;
        Finding::of_covariance(point, &covariance, m)
    }
}

/// A minute of body D under a held multisine, the logged wrench noisy; every fortieth wrench is nonsense.
fn record(seed: u64, noise: f64, nonsense: bool) -> Vec<MotionSample> {
    let mut random = Random::new(seed);
    let signal = Multisine::random(&mut random, 0.5, 1.0, (0.5, 3.0), 4);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body_d(), &wrench, true);
    run.samples = 1200;
    let mut record = run.record();
    for (index, sample) in record.iter_mut().enumerate() {
        let size = if nonsense && index % 40 == 7 { 0.3 } else { noise };
        sample.wrench_body =
            sample.wrench_body.map(|w| Wrench::new(w.torque + random.normal3(size), w.force + random.normal3(size)));
    }
    record
}

fn settings(method: &'static str) -> Settings {
    Settings { method, ..Settings::default() }
}

#[test]
fn an_estimator_of_ones_own() {
    let make = |record: &[MotionSample]| -> Result<Box<dyn Estimator<Record = [MotionSample]> + Send + Sync>, _> {
        Ok(Box::new(Huber { problem: Problem::of(record, &settings("auto"))?, bound: 2.0 }))
    };

    // Step 2: the laws.
    let whole = record(3, 1e-2, false);
    let (first, second) = whole.split_at(600);
    let truth = body_d().to_vector();
    let scale = Problem::of(&whole, &settings("auto")).unwrap().scale;
    let case = Case {
        record: &whole[..],
        halves: Some([first, second]),
        exact: None,
        truth,
        magnitudes: scale.parameter_magnitudes(),
        sigmas: 4.5,
        retold: &[],
    };
    check_estimator(&make, &case).unwrap();

    // Step 3: by name in `identify`, and in one list with the library's.
    let pipeline = Pipeline::new().with("huber", "Least squares that outliers cannot bend", |problem| {
        Ok(Box::new(Huber { problem: *problem, bound: 2.0 }))
    });
    let spoiled = record(4, 1e-3, true);
    let found = pipeline.identify(&spoiled, &settings("huber")).unwrap();
    assert_eq!((found.method, found.rank), ("huber", 10));
    let error = |found: &tumble_identification::Identification| {
        let error = found.estimate.unwrap().parameters.to_vector() - truth;
        error.component_div(&scale.parameter_magnitudes()).norm()
    };
    let plain = pipeline.identify(&spoiled, &settings("variational4")).unwrap();
    assert!(error(&found) < 0.5 * error(&plain), "{} {}", error(&found), error(&plain));
    let clean = pipeline.identify(&whole, &settings("huber")).unwrap();
    assert_eq!(clean.verdict, Verdict::Identified);
    // It answers too where thrusters are told of, whose scales the library's own methods would leave to their likelihood.
    let along = [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]];
    let thrusters = Thrusters::try_new(&along, &[0.01; 2], &vec![0.0; 2 * whole.len()]).unwrap();
    let told = pipeline.flown_with(FlightLikelihood { thrusters: Some(thrusters), ..FlightLikelihood::default() });
    let found = told.identify(&whole, &settings("huber")).unwrap();
    assert_eq!((found.method, found.estimate), ("huber", clean.estimate));

    // A record that every one of them can answer: exact poses, a noisy wrench. Noise in poses asks for instruments or for a state, which
    // rows have not.
    let seen = crate::estimator_laws::record(2, 1500, 1e-2, 0.0);
    let problem = Problem::of(&seen, &settings("auto")).unwrap();
    #[allow(clippy::type_complexity)] // the one list that holds them all
    let mut all: Vec<(&str, Box<dyn Estimator<Record = [MotionSample]> + Send + Sync>)> =
        vec![("huber", Box::new(Huber { problem, bound: 2.0 }))];
    for name in ["variational4", "rls", "ekf", "recursive-sdp", "maximum-likelihood"] {
        all.push((name, methods().make(name, &problem).unwrap()));
    }
    for (name, estimator) in &all {
        let found = estimator.estimate(&seen).unwrap();
        let error = found.point().unwrap() - truth;
        let off = error.component_div(&scale.parameter_magnitudes()).amax();
        let sigmas = error.component_div(&found.covariance().unwrap().diagonal().map(f64::sqrt)).amax();
        println!(
            "{name}: worst of ten off by {:.2} % of the body's size, by {sigmas:.1} of its own sigmas",
            100.0 * off
        );
        assert!(off < 0.02 && sigmas < 4.5, "{name}: {off} {sigmas}");
    }
}

/// Hands over what cannot be.
struct Liar(fn() -> Result<Finding, EstimatorError>);

impl Estimator for Liar {
    type Record = [MotionSample];
    fn estimate(&self, _: &[MotionSample]) -> Result<Finding, EstimatorError> {
        (self.0)()
    }
}

#[test]
fn what_cannot_be_is_refused_with_the_name_of_who_said_it() {
    let record = record(5, 1e-3, false);
    let refused = |lie: fn() -> Result<Finding, EstimatorError>| {
        let pipeline = Pipeline::new().with("liar", "", move |_| Ok(Box::new(Liar(lie))));
        pipeline.identify(&record, &settings("liar")).unwrap_err().to_string()
    };
    let indefinite = refused(|| {
        let mut covariance = SMatrix::<f64, 10, 10>::identity();
        covariance[(3, 2)] = 2.0;
        covariance[(2, 3)] = 2.0;
        Finding::of_covariance(SVector::repeat(1.0), &covariance, SVector::repeat(1.0))
    });
    assert!(indefinite.starts_with("liar: covariance is indefinite, least eigenvalue: component "), "{indefinite}");
    let nan = refused(|| {
        let mut point = SVector::repeat(1.0);
        point[4] = f64::NAN;
        Finding::of_covariance(point, &SMatrix::identity(), SVector::repeat(1.0))
    });
    assert_eq!(nan, "liar: estimate: component 4 is NaN");
    let no_body = refused(|| Finding::of_covariance(SVector::repeat(-1.0), &SMatrix::identity(), SVector::repeat(1.0)));
    assert_eq!(no_body, "liar: a point that is no body, mass: component 0 is -1");
    // A body that can be, and is another: nobody marks his own homework.
    let pipeline = Pipeline::new().with("sure", "", |_| {
        Ok(Box::new(Liar(|| {
            let scale = tumble_identification::BodyScale::of(&body_d().to_vector())?.parameter_magnitudes();
            let covariance = SMatrix::from_diagonal(&scale.map(|s| 1e-8 * s * s));
            Finding::of_covariance(body_d().to_vector() * 1.1, &covariance, scale)
        })))
    });
    let found = pipeline.identify(&record, &settings("sure")).unwrap();
    let doubted = matches!(found.verdict, Verdict::Doubtful(tumble_identification::estimator::Why::Disagrees { .. }));
    assert!(doubted, "{:?}", found.verdict);
    let unknown = Pipeline::new().identify(&record, &settings("hubre")).unwrap_err().to_string();
    assert!(unknown.contains("`hubre`") && unknown.contains("flight-likelihood, rls"), "{unknown}");
}
