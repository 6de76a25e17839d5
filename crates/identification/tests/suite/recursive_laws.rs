//! The laws of recursive estimators hold for ours and catch planted defects by name.

use crate::random::Random;
use nalgebra::{Matrix4, SMatrix, SVector, Vector3, Vector4, Vector6};
use tumble_identification::dynamics::strategies::body_d;
use tumble_identification::estimator::{Constrained, EstimatorError, Finding, Outcome, RecursiveEstimator};
use tumble_identification::laws::{
    EstimatorPromises, Told, check_gate, check_innovation, check_recursive_estimator, check_unit_equivariance,
};
use tumble_identification::lie::Wrench;
use tumble_identification::lie::laws::LawViolation;
use tumble_identification::recursive::{
    AccelerationObservation, ChiSquareGate, ExtendedKalmanFilter, KalmanFilter, LinearObservation, LinearProcess,
    PrincipalBody, PrincipalMotion, RecursiveLeastSquares, RecursiveSdp, RowsOutcome, SquareRootFilter,
    UnscentedKalmanFilter, Verdict,
};
use tumble_identification::regressors::newton_euler;
use tumble_identification::{
    Barrier, BarrierNewton, BodyScale, ConstrainedLeastSquares, FeasibleSet, IdentificationError, InteriorPoint,
    PseudoInertiaCone, SquareRootInformation,
};

type Parameters = SVector<f64, 10>;
type Row = LinearObservation<6, 10>;

fn cone() -> PseudoInertiaCone {
    PseudoInertiaCone::new(BodyScale::of(&body_d().to_vector()).unwrap())
}

const PRIOR: f64 = 3.0;

fn deviations() -> SVector<f64, 10> {
    cone().magnitudes() * PRIOR
}

/// Newton-Euler rows of body D with wrench noise.
fn rows(seed: u64, count: usize, noise: f64) -> Vec<Row> {
    let mut random = Random::new(seed);
    (0..count)
        .map(|_| {
            let regressor = newton_euler(&random.normals::<3>(), &random.normals::<3>(), &random.normals::<3>());
            let output = regressor * body_d().to_vector() + random.normals::<6>() * noise;
            LinearObservation { regressor, output, standard_deviation: Vector6::repeat(noise) }
        })
        .collect()
}

fn least_squares() -> RecursiveLeastSquares<10, 6> {
    let covariance = SMatrix::from_diagonal(&deviations().map(|s| s * s));
    RecursiveLeastSquares::new(cone().interior_point(), covariance)
}

fn square_root() -> SquareRootFilter<10, 6> {
    SquareRootFilter::try_new(cone().interior_point(), deviations()).unwrap()
}

fn sdp() -> RecursiveSdp<InteriorPoint, 10, 6> {
    RecursiveSdp::try_new(cone(), PRIOR).unwrap()
}

/// As laws and trait objects take them.
fn each<O>(observations: &[O]) -> Vec<&O> {
    observations.iter().collect()
}

/// The information of all rows and the prior, stacked.
fn batch(rows: &[Row]) -> SquareRootInformation<10> {
    let mut information = SquareRootInformation::new();
    information.add_prior(&cone().interior_point(), &deviations()).unwrap();
    for row in rows {
        let weight = 1.0 / row.standard_deviation[0];
        information.update(&(row.regressor * weight), &(row.output * weight)).unwrap();
    }
    information
}

fn linear_promises<'a>(rows: &[Row]) -> EstimatorPromises<'a, 10> {
    let information = batch(rows);
    let magnitudes = cone().magnitudes();
    let batch = Some((information.solve(&magnitudes).unwrap(), information.covariance(&magnitudes).unwrap()));
    EstimatorPromises { constant_parameters: true, batch, feasible_set: None }
}

#[test]
fn linear_estimators_hold_the_laws() {
    for (seed, count, noise) in [(1, 1, 0.1), (2, 2, 0.01), (3, 60, 0.1), (4, 60, 10.0)] {
        let mut rows = rows(seed, count, noise);
        // Some rows are not measured, whatever stands in them.
        if count > 2 {
            rows[7].standard_deviation[2] = f64::INFINITY;
            rows[7].output[2] = 1e9;
            rows[9].standard_deviation.fill(f64::INFINITY);
        }
        let promises = linear_promises(&without(&rows));
        check_recursive_estimator(&|| Ok(least_squares()), &each(&rows), &promises, 1e-8).unwrap();
        check_recursive_estimator(&|| Ok(square_root()), &each(&rows), &promises, 1e-9).unwrap();
        let (mut covariance_form, mut square_root_form) = (least_squares(), square_root());
        check_innovation(&mut |row: &Row| covariance_form.update_rows(row), &rows, 1e-8).unwrap();
        check_innovation(&mut |row: &Row| square_root_form.update_rows(row), &rows, 1e-9).unwrap();
        let still = KalmanFilter::new(
            LinearProcess::random_walk(SMatrix::zeros()),
            least_squares().parameters(),
            least_squares().covariance(),
        );
        check_recursive_estimator(&|| Ok(still), &each(&rows), &promises, 1e-8).unwrap();
        let mut told = still;
        check_innovation(&mut |row: &Row| told.update_rows(row), &rows, 1e-8).unwrap();
        let cone = cone();
        let found = InteriorPoint::new(cone).solve(&batch(&without(&rows))).unwrap();
        let covariance = promises.batch.unwrap().1;
        let of_bodies =
            EstimatorPromises { batch: Some((found.parameters, covariance)), feasible_set: Some(&cone), ..promises };
        check_recursive_estimator(&|| Ok(sdp()), &each(&rows), &of_bodies, 1e-5).unwrap();
        let mut told = sdp();
        check_innovation(&mut |row: &Row| told.update_rows(row), &rows, 1e-5).unwrap();
        // Any estimator under any constraint, by any solver, its kind hidden.
        let hidden = || -> Result<Box<dyn RecursiveEstimator<Observation = Row>>, EstimatorError> {
            Ok(Box::new(Constrained::new(square_root(), BarrierNewton::new(cone))))
        };
        check_recursive_estimator(&hidden, &each(&rows), &of_bodies, 1e-4).unwrap();
    }
}

/// Two masses, each positive and together less than a known sum.
#[derive(Clone, Copy)]
struct Shares {
    sum: f64,
}

impl FeasibleSet<2> for Shares {
    fn margin(&self, p: &SVector<f64, 2>) -> f64 {
        p[0].min(p[1]).min(self.sum - p[0] - p[1]) / self.sum
    }
    fn barrier(&self, p: &SVector<f64, 2>) -> Option<Barrier<2>> {
        let rest = self.sum - p[0] - p[1];
        if self.margin(p) <= 0.0 {
            return None;
        }
        let gradient = SVector::from([1.0 / rest - 1.0 / p[0], 1.0 / rest - 1.0 / p[1]]);
        let diagonal = SMatrix::from_diagonal(&SVector::from([p[0].powi(-2), p[1].powi(-2)]));
        let hessian = diagonal + SMatrix::repeat(rest.powi(-2));
        Some(Barrier { value: -(p[0] * p[1] * rest).ln(), gradient, hessian })
    }
    fn barrier_parameter(&self) -> f64 {
        3.0
    }
    fn interior_point(&self) -> SVector<f64, 2> {
        SVector::repeat(self.sum / 3.0)
    }
    fn magnitudes(&self) -> SVector<f64, 2> {
        SVector::repeat(self.sum)
    }
}

#[test]
fn the_constraint_is_any_set_of_any_number_of_parameters() {
    let set = Shares { sum: 10.0 };
    let begin = || {
        let vague = SquareRootFilter::<2, 1>::try_new(set.interior_point(), set.magnitudes() * 3.0)?;
        Ok(RecursiveSdp::over(BarrierNewton::new(set), vague)?)
    };
    // Scales that say more than there can be.
    let seen = |first: f64, second: f64, output: f64| LinearObservation {
        regressor: SMatrix::<f64, 1, 2>::new(first, second),
        output: SVector::from([output]),
        standard_deviation: SVector::from([0.1]),
    };
    let rows = [seen(1.0, 0.0, 9.0), seen(1.0, 0.0, 9.2), seen(0.0, 1.0, 2.1), seen(1.0, 1.0, 10.9)];
    let promises = EstimatorPromises { constant_parameters: true, batch: None, feasible_set: Some(&set) };
    check_recursive_estimator(&begin, &each(&rows), &promises, 1e-8).unwrap();
    let mut found = begin().unwrap();
    for row in &rows {
        found.update(row).unwrap();
    }
    assert!(found.estimate().is_active() && found.unconstrained().parameters().sum() > 10.5);
    assert!((found.parameters().sum() - 10.0).abs() < 1e-3, "{}", found.parameters());
}

/// The rows that were measured, the others zero.
fn without(rows: &[Row]) -> Vec<Row> {
    rows.iter()
        .map(|row| {
            let mut kept = *row;
            for i in 0..6 {
                if row.standard_deviation[i].is_infinite() {
                    kept.regressor.row_mut(i).fill(0.0);
                    kept.output[i] = 0.0;
                    kept.standard_deviation[i] = 1.0;
                }
            }
            if row.standard_deviation[0].is_infinite() {
                kept
            } else {
                Row { standard_deviation: row.standard_deviation, ..kept }
            }
        })
        .collect()
}

fn cube_flyer() -> Vector4<f64> {
    Vector4::new(9.58, 0.153, 0.143, 0.162)
}

/// Accelerations of a body under random wrenches.
fn accelerations(seed: u64, count: usize, body: &PrincipalBody) -> Vec<AccelerationObservation> {
    let mut random = Random::new(seed);
    let [[m, x, y, z]] = body.parameters().data.0;
    (0..count)
        .map(|_| {
            let (w, torque, force) =
                (random.normals::<3>() * 0.3, random.normals::<3>() * 0.03, random.normals::<3>() * 0.3);
            let inertia = Vector3::new(x, y, z);
            let angular =
                (torque - w.cross(&inertia.component_mul(&w))).component_div(&inertia) + random.normals::<3>() * 0.01;
            let linear = force / m + random.normals::<3>() * 2e-3;
            AccelerationObservation {
                rate_body: w,
                wrench_body: Wrench::new(torque, force),
                acceleration_body: Vector6::new(angular.x, angular.y, angular.z, linear.x, linear.y, linear.z),
                standard_deviation: Vector6::new(0.01, 0.01, 0.01, 2e-3, 2e-3, 2e-3),
            }
        })
        .collect()
}

fn true_body() -> PrincipalBody {
    let p = cube_flyer();
    PrincipalBody::try_new(p[0], Vector3::new(p[1], p[2], p[3])).unwrap()
}

fn guess() -> (PrincipalMotion, PrincipalBody, Matrix4<f64>) {
    let body = PrincipalBody::try_new(12.0, Vector3::repeat(0.2)).unwrap();
    let covariance = Matrix4::from_diagonal(&Vector4::new(9.0, 2.5e-3, 2.5e-3, 2.5e-3));
    (PrincipalMotion { drift: Vector4::zeros() }, body, body.increment_covariance(&covariance))
}

/// Bodies in principal axes: positive mass and the triangle inequalities.
struct PrincipalBodies;

impl FeasibleSet<4> for PrincipalBodies {
    fn margin(&self, p: &SVector<f64, 4>) -> f64 {
        p[0].min(p[1] + p[2] - p[3]).min(p[2] + p[3] - p[1]).min(p[3] + p[1] - p[2])
    }
    fn barrier(&self, _parameters: &SVector<f64, 4>) -> Option<tumble_identification::Barrier<4>> {
        None
    }
    fn barrier_parameter(&self) -> f64 {
        4.0
    }
    fn interior_point(&self) -> SVector<f64, 4> {
        cube_flyer()
    }
    fn magnitudes(&self) -> SVector<f64, 4> {
        cube_flyer()
    }
}

#[test]
fn nonlinear_filters_hold_the_laws_and_agree() {
    let observations = accelerations(5, 400, &true_body());
    let (model, body, covariance) = guess();
    // The chart moves with the estimate, so that the covariance of the parameters may grow where the estimate does.
    let promises = EstimatorPromises { constant_parameters: false, batch: None, feasible_set: Some(&PrincipalBodies) };
    let mut extended = ExtendedKalmanFilter::new(model, body, covariance);
    let mut unscented = UnscentedKalmanFilter::new(model, body, covariance);
    check_recursive_estimator(&|| Ok(extended), &each(&observations), &promises, 1e-9).unwrap();
    check_recursive_estimator(&|| Ok(unscented), &each(&observations), &promises, 1e-9).unwrap();
    let (mut one, mut other) = (extended, unscented);
    check_innovation(&mut |seen| one.update_rows(seen), &observations, 1e-9).unwrap();
    check_innovation(&mut |seen| other.update_rows(seen), &observations, 1e-9).unwrap();
    for observation in &observations {
        extended.update(observation).unwrap();
        unscented.update(observation).unwrap();
    }
    let sigma = extended.covariance().diagonal().map(f64::sqrt);
    let error = (extended.parameters() - cube_flyer()).component_div(&sigma);
    assert!(error.amax() < 4.0, "{error}");
    let apart = (extended.parameters() - unscented.parameters()).component_div(&sigma);
    assert!(apart.amax() < 0.5, "{apart}");
}

/// Kilograms to pounds and metres to feet, about; then each unit by powers of ten.
const UNITS: [[f64; 3]; 7] = [
    [2.2, 3.3, 1.0],
    [1e-3, 1.0, 1.0],
    [1e3, 1.0, 1.0],
    [1.0, 1e-2, 1.0],
    [1.0, 1e2, 1.0],
    [1.0, 1.0, 1e-2],
    [1.0, 1.0, 1e2],
];

#[test]
fn units_do_not_matter() {
    let told_rows = rows(6, 40, 0.1);
    let rows = each(&told_rows);
    for (k, [mass, length, time]) in UNITS.into_iter().enumerate() {
        let [h, j] = [mass * length, mass * length * length];
        let factors = SVector::from([mass, h, h, h, j, j, j, j, j, j]);
        let wrench = Vector6::new(j, j, j, h, h, h) / (time * time);
        let scaled: Vec<Row> = told_rows
            .iter()
            .map(|row| Row {
                regressor: SMatrix::from_fn(|r, c| row.regressor[(r, c)] * wrench[r] / factors[c]),
                output: row.output.component_mul(&wrench),
                standard_deviation: row.standard_deviation.component_mul(&wrench),
            })
            .collect();
        let mean = least_squares().parameters().component_mul(&factors);
        let deviation = deviations().component_mul(&factors);
        let scaled = each(&scaled);
        let covariance = SMatrix::from_diagonal(&deviation.map(|s| s * s));
        let other = RecursiveLeastSquares::new(mean, covariance);
        let told = Told { begin: &|| Ok(least_squares()), observations: &rows };
        check_unit_equivariance(&told, &Told { begin: &|| Ok(other), observations: &scaled }, &factors, 1e-8).unwrap();
        let other = SquareRootFilter::try_new(mean, deviation).unwrap();
        let told = Told { begin: &|| Ok(square_root()), observations: &rows };
        check_unit_equivariance(&told, &Told { begin: &|| Ok(other), observations: &scaled }, &factors, 1e-8).unwrap();
        let scale = BodyScale::of(&body_d().to_vector().component_mul(&factors)).unwrap();
        let other = RecursiveSdp::try_with_prior(PseudoInertiaCone::new(scale), mean, deviation).unwrap();
        let told = Told { begin: &|| Ok(sdp()), observations: &rows };
        check_unit_equivariance(&told, &Told { begin: &|| Ok(other), observations: &scaled }, &factors, 1e-5).unwrap();
        // A body that drifts from row to row.
        let drifting = |mean: Parameters, deviation: Parameters| {
            let drift = SMatrix::from_diagonal(&deviation.map(|s| (0.01 * s).powi(2)));
            let covariance = SMatrix::from_diagonal(&deviation.map(|s| s * s));
            KalmanFilter::<10, 6>::new(LinearProcess::random_walk(drift), mean, covariance)
        };
        let one = drifting(least_squares().parameters(), deviations());
        let other = drifting(mean, deviation);
        let told = Told { begin: &|| Ok(one), observations: &rows };
        check_unit_equivariance(&told, &Told { begin: &|| Ok(other), observations: &scaled }, &factors, 1e-8).unwrap();
        // Absolute numbers hidden in an estimator: a floor under the noise, a floor under what is reported.
        let law = |defect| {
            let one = Told { begin: &|| Ok(Broken::new(least_squares(), defect)), observations: &rows };
            let begin = || Ok(Broken::new(RecursiveLeastSquares::new(mean, covariance), defect));
            broken_law(check_unit_equivariance(&one, &Told { begin: &begin, observations: &scaled }, &factors, 1e-8))
        };
        if k == 0 {
            assert_eq!(law(Defect::AbsoluteNoiseFloor), "nis is free of units");
            assert_eq!(law(Defect::AbsoluteReportFloor), "the estimate scales with the units");
        }
    }
}

#[test]
fn units_do_not_matter_to_nonlinear_filters() {
    let told_accelerations = accelerations(5, 200, &true_body());
    let (model, body, covariance) = guess();
    for [mass, length, time] in UNITS {
        let [h, j, square] = [mass * length, mass * length * length, time * time];
        let factors = Vector4::new(mass, j, j, j);
        let slower = Vector6::new(1.0, 1.0, 1.0, length, length, length) / square;
        let scaled: Vec<AccelerationObservation> = told_accelerations
            .iter()
            .map(|seen| AccelerationObservation {
                rate_body: seen.rate_body / time,
                wrench_body: Wrench::new(seen.wrench_body.torque * (j / square), seen.wrench_body.force * (h / square)),
                acceleration_body: seen.acceleration_body.component_mul(&slower),
                standard_deviation: seen.standard_deviation.component_mul(&slower),
            })
            .collect();
        let (told, scaled) = (each(&told_accelerations), each(&scaled));
        let [[m, x, y, z]] = body.parameters().component_mul(&factors).data.0;
        let other = PrincipalBody::try_new(m, Vector3::new(x, y, z)).unwrap();
        // Increments of the chart have no unit.
        let (one, two) =
            (ExtendedKalmanFilter::new(model, body, covariance), ExtendedKalmanFilter::new(model, other, covariance));
        let one = Told { begin: &|| Ok(one), observations: &told };
        check_unit_equivariance(&one, &Told { begin: &|| Ok(two), observations: &scaled }, &factors, 1e-8).unwrap();
        let (one, two) =
            (UnscentedKalmanFilter::new(model, body, covariance), UnscentedKalmanFilter::new(model, other, covariance));
        let one = Told { begin: &|| Ok(one), observations: &told };
        check_unit_equivariance(&one, &Told { begin: &|| Ok(two), observations: &scaled }, &factors, 1e-8).unwrap();
    }
}

fn broken_law<T>(outcome: Result<T, LawViolation>) -> &'static str {
    outcome.err().expect("a planted defect must be caught").law
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Defect {
    /// Innovations judged by the noise alone.
    NisByNoise,
    /// Rows without a measurement counted.
    AllRowsCount,
    /// The determinant of the inverse.
    Determinant,
    /// S with a sign.
    NegativeInnovationCovariance,
    /// (I - K H) P computed without the symmetry.
    Asymmetric,
    /// P + K H P.
    Growing,
    /// What comes first counts less.
    ForgetsFirst,
    /// Half the gain.
    HalfGain,
    /// The unconstrained solution is reported.
    Unconstrained,
    /// Fails on the third update.
    Fails,
    /// No noise is taken to be smaller than a number.
    AbsoluteNoiseFloor,
    /// No parameter is reported smaller than a number.
    AbsoluteReportFloor,
    /// A rejected observation still moves the estimate.
    RejectedMoves,
    /// What was known before is not told apart.
    PriorAsData,
}

/// An estimator with a defect in front.
#[derive(Clone)]
struct Broken {
    inner: RecursiveLeastSquares<10, 6>,
    start: Finding,
    defect: Defect,
}

impl Broken {
    #[allow(clippy::large_types_passed_by_value)] // it is kept
    fn new(inner: RecursiveLeastSquares<10, 6>, defect: Defect) -> Self {
        Self { inner, start: inner.finding().unwrap(), defect }
    }

    fn update_rows(&mut self, observation: &Row) -> Result<RowsOutcome<6>, IdentificationError> {
        if self.defect == Defect::Fails && observation.output[0] > 2.0 {
            return Err(IdentificationError::NotFinite { row: 0 });
        }
        let mut altered = *observation;
        match self.defect {
            Defect::HalfGain => altered.standard_deviation *= 2.0_f64.sqrt(),
            // What it learns depends on what it knows: the first rows weigh less.
            Defect::ForgetsFirst if self.inner.covariance()[(0, 0)] > 1.0 => altered.standard_deviation *= 1.0 + 1e-3,
            Defect::AbsoluteNoiseFloor => altered.standard_deviation.apply(|s| *s = s.max(0.3)),
            _ => {}
        }
        let mut outcome = self.inner.update_rows(&altered)?;
        let innovation = &mut outcome.innovation;
        match self.defect {
            Defect::NisByNoise => {
                innovation.nis = innovation.residual.component_div(&observation.standard_deviation).norm_squared();
            }
            Defect::AllRowsCount => innovation.degrees_of_freedom = 6,
            Defect::Determinant => innovation.determinant = 1.0 / innovation.determinant,
            Defect::NegativeInnovationCovariance => innovation.covariance *= -1.0,
            _ => {}
        }
        Ok(outcome)
    }
}

impl RecursiveEstimator for Broken {
    type Observation = Row;
    fn update(&mut self, observation: &Row) -> Result<Outcome, EstimatorError> {
        Ok(self.update_rows(observation)?.into())
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        let floor = if self.defect == Defect::AbsoluteReportFloor { 0.15 } else { f64::NEG_INFINITY };
        let mut covariance = self.inner.covariance();
        match self.defect {
            Defect::Asymmetric => covariance[(0, 1)] *= 1.0 + 1e-5,
            // Less certain the more is known.
            Defect::Growing => {
                let start = self.start.covariance()?;
                covariance = start * (start[(0, 0)] / covariance[(0, 0)]);
            }
            _ => {}
        }
        let found = Finding::of_covariance(self.inner.parameters(), &covariance, deviations())?;
        let found = found.at(self.inner.parameters().map(|p| p.max(floor)));
        let prior = if self.defect == Defect::PriorAsData { None } else { Some(*self.start.information()) };
        Ok(prior.map_or(found, |prior| found.with_prior(prior)))
    }
}

#[test]
fn planted_defects_are_caught_by_name() {
    let mut rows = rows(7, 30, 0.1);
    rows[4].standard_deviation[1] = f64::INFINITY;
    let promises = linear_promises(&{
        let mut kept = rows.clone();
        kept[4].regressor.row_mut(1).fill(0.0);
        kept[4].output[1] = 0.0;
        kept
    });
    let law = |defect| {
        let begin = || Ok(Broken::new(least_squares(), defect));
        let broken = check_recursive_estimator(&begin, &each(&rows), &promises, 1e-8).unwrap_err();
        assert!(broken.to_string().lines().count() <= 3, "{broken}");
        broken.law
    };
    let of_rows = |defect| {
        let mut told = Broken::new(least_squares(), defect);
        broken_law(check_innovation(&mut |row| told.update_rows(row), &rows, 1e-8))
    };
    assert_eq!(of_rows(Defect::NisByNoise), "nis is the normalised innovation");
    assert_eq!(of_rows(Defect::AllRowsCount), "degrees of freedom are the measured rows");
    assert_eq!(of_rows(Defect::Determinant), "determinant is that of the innovation covariance");
    assert_eq!(of_rows(Defect::NegativeInnovationCovariance), "innovation covariance is symmetric positive definite");
    assert_eq!(of_rows(Defect::Fails), "update succeeds");
    // A finding refuses what is no covariance, by component.
    assert_eq!(law(Defect::Asymmetric), "there is a finding at any time");
    assert_eq!(law(Defect::PriorAsData), "a finding of nothing holds no data");
    assert_eq!(law(Defect::Growing), "data never add uncertainty");
    assert_eq!(law(Defect::HalfGain), "equals batch");
    assert_eq!(law(Defect::Fails), "update succeeds");
}

#[test]
fn an_order_that_matters_is_caught() {
    // The batch is what the defective estimator itself gives forwards, so that only the order can tell.
    let rows = rows(8, 30, 0.1);
    let broken = Broken::new(least_squares(), Defect::ForgetsFirst);
    let mut forwards = broken.clone();
    for row in &rows {
        forwards.update(row).unwrap();
    }
    let batch = Some((forwards.inner.parameters(), forwards.inner.covariance()));
    let promises = EstimatorPromises { constant_parameters: true, batch, feasible_set: None };
    let outcome = check_recursive_estimator(&|| Ok(broken.clone()), &each(&rows), &promises, 1e-8);
    assert_eq!(broken_law(outcome), "order independent");
}

#[test]
fn an_estimate_that_is_no_body_is_caught() {
    let (rows, cone) = (rows(9, 3, 10.0), cone());
    let promises = EstimatorPromises { constant_parameters: true, batch: None, feasible_set: Some(&cone) };
    check_recursive_estimator(&|| Ok(sdp()), &each(&rows), &promises, 1e-8).unwrap();
    // What the recursive SDP reports without its constraint.
    let plain = Broken::new(least_squares(), Defect::Unconstrained);
    let outcome = check_recursive_estimator(&|| Ok(plain.clone()), &each(&rows), &promises, 1e-8);
    assert_eq!(broken_law(outcome), "estimate is inside the feasible set");
}

/// Draws its noise from a counter that all of them share.
struct Moody<'a>(RecursiveLeastSquares<10, 6>, &'a std::cell::Cell<f64>);

impl RecursiveEstimator for Moody<'_> {
    type Observation = Row;
    fn update(&mut self, observation: &Row) -> Result<Outcome, EstimatorError> {
        self.1.set(self.1.get() + 1e-9);
        let mut altered = *observation;
        altered.output[0] += self.1.get();
        self.0.update(&altered)
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        self.0.finding()
    }
}

#[test]
fn hidden_state_is_caught() {
    let (rows, mood) = (rows(10, 10, 0.1), std::cell::Cell::new(0.0));
    let begin = || Ok(Moody(least_squares(), &mood));
    let outcome = check_recursive_estimator(&begin, &each(&rows), &linear_promises(&rows), 1e-6);
    assert_eq!(broken_law(outcome), "same observations give the same finding");
}

/// Runs whose estimators start from a draw of their own prior, so that the model holds.
fn honest_runs<E>(count: u64, make: impl Fn(Parameters, SVector<f64, 10>) -> E) -> impl Iterator<Item = (E, Vec<Row>)> {
    (0..count).map(move |seed| {
        let deviation = cone().magnitudes() * 0.05;
        let off = Random::new(1000 + seed).normals::<10>().component_mul(&deviation);
        (make(body_d().to_vector() + off, deviation), rows(seed, 100, 0.1))
    })
}

fn gate() -> ChiSquareGate {
    ChiSquareGate::try_new(0.99).unwrap()
}

fn gated(mean: Parameters, deviation: SVector<f64, 10>) -> RecursiveLeastSquares<10, 6> {
    RecursiveLeastSquares::new(mean, SMatrix::from_diagonal(&deviation.map(|s| s * s))).with_gate(gate())
}

/// Rows of a body twice as heavy: beyond doubt, and for good.
fn changed_rows() -> Vec<Row> {
    let mut rows = rows(77, 60, 0.1);
    for row in &mut rows {
        row.output += row.regressor * body_d().to_vector();
    }
    rows
}

#[test]
fn gates_are_honest() {
    // 1.0 ± 0.2 %: forty thousand updates put 0.2 % at four standard deviations.
    check_gate(&mut honest_runs(400, gated), 0.99, 2e-3, &changed_rows()).unwrap();
    let square_root = |mean, deviation| SquareRootFilter::<10, 6>::try_new(mean, deviation).unwrap().with_gate(gate());
    check_gate(&mut honest_runs(400, square_root), 0.99, 2e-3, &changed_rows()).unwrap();
    let sdp =
        |mean, deviation| RecursiveSdp::<_, 10, 6>::try_with_prior(cone(), mean, deviation).unwrap().with_gate(gate());
    check_gate(&mut honest_runs(400, sdp), 0.99, 2e-3, &changed_rows()).unwrap();
}

#[test]
fn nonlinear_gates_are_honest() {
    let runs = |unscented: bool| {
        (0..400_u64).map(move |seed| {
            let mut random = Random::new(seed);
            let deviation = Vector4::new(0.05, 0.05, 0.05, 0.05);
            let truth = true_body();
            let off = random.normals::<4>().component_mul(&deviation);
            let start = tumble_identification::lie::Manifold::oplus(&truth, &off);
            let covariance = Matrix4::from_diagonal(&deviation.map(|s| s * s));
            let (model, observations) = (guess().0, accelerations(10_000 + seed, 100, &truth));
            let extended = ExtendedKalmanFilter::new(model, start, covariance).with_gate(gate());
            let sigma_points = UnscentedKalmanFilter::new(model, start, covariance).with_gate(gate());
            (extended, sigma_points, observations, unscented)
        })
    };
    let heavy = PrincipalBody::try_new(30.0, Vector3::new(0.5, 0.5, 0.5)).unwrap();
    let spoiled = accelerations(3, 200, &heavy);
    check_gate(&mut runs(false).map(|run| (run.0, run.2)), 0.99, 2e-3, &spoiled).unwrap();
    check_gate(&mut runs(true).map(|run| (run.1, run.2)), 0.99, 2e-3, &spoiled).unwrap();
}

/// A gate with a defect.
#[derive(Clone)]
struct BrokenGate {
    inner: RecursiveLeastSquares<10, 6>,
    threshold: f64,
    defect: Defect,
    recovers: bool,
}

impl RecursiveEstimator for BrokenGate {
    type Observation = Row;
    fn update(&mut self, observation: &Row) -> Result<Outcome, EstimatorError> {
        let before = self.inner;
        let mut outcome = self.inner.update(observation)?;
        if outcome.nis > self.threshold {
            outcome.gate = Verdict::Rejected { threshold: self.threshold };
            if self.defect != Defect::RejectedMoves {
                self.inner = before;
            }
        } else if self.recovers {
            outcome.gate = Verdict::Recovered { inflation: 1.0 };
        }
        Ok(outcome)
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        self.inner.finding()
    }
}

#[test]
fn planted_defects_of_gates_are_caught_by_name() {
    let law = |threshold: f64, defect, recovers| {
        let make = move |mean, deviation: SVector<f64, 10>| BrokenGate {
            inner: RecursiveLeastSquares::new(mean, SMatrix::from_diagonal(&deviation.map(|s| s * s))),
            threshold,
            defect,
            recovers,
        };
        broken_law(check_gate(&mut honest_runs(300, make), 0.99, 3e-3, &changed_rows()))
    };
    // One degree of freedom too many or too few.
    assert_eq!(law(gate().threshold(7), Defect::Fails, true), "gate rejects as often as stated");
    assert_eq!(law(gate().threshold(5), Defect::Fails, true), "gate rejects as often as stated");
    assert_eq!(law(gate().threshold(6), Defect::RejectedMoves, true), "a rejected update changes nothing");
    // No way back: the printed rule.
    assert_eq!(law(gate().threshold(6), Defect::Fails, false), "gate lets go of a wrong belief");
}

#[test]
fn the_gate_lets_go_of_a_wrong_belief() {
    // Sure of body D, told of a body twice as heavy.
    let mut estimator = gated(body_d().to_vector(), cone().magnitudes() * 1e-3);
    let mut outcomes = changed_rows().into_iter().map(|row| estimator.update(&row).unwrap().is_accepted());
    assert!((0..5).all(|_| !outcomes.next().unwrap()) && outcomes.next().unwrap());
    assert!(outcomes.last().unwrap());
    let error = (estimator.parameters() - body_d().to_vector() * 2.0).component_div(&cone().magnitudes());
    assert!(error.amax() < 0.1, "{error}");
}

#[test]
fn spikes_cost_little_behind_a_gate() {
    // 10 sigma in 1 % of the rows; rms over many runs of the error in the metric of the true covariance.
    let runs = 200;
    let (mut clean, mut behind_gate, mut unprotected) = (0.0, 0.0, 0.0);
    for seed in 0..runs {
        let truth = body_d().to_vector();
        let rows = rows(seed, 400, 0.1);
        let mut random = Random::new(seed + 5000);
        let mut spiked = rows.clone();
        for row in &mut spiked {
            for i in 0..6 {
                if random.uniform(-1.0, 1.0) > 0.98 {
                    row.output[i] += random.uniform(-1.0, 1.0).signum();
                }
            }
        }
        let error = |gate: Option<ChiSquareGate>, rows: &[Row]| {
            let start = least_squares();
            let mut estimator = gate.map_or(start, |gate| start.with_gate(gate));
            for row in rows {
                estimator.update(row).unwrap();
            }
            (estimator.parameters() - truth).component_div(&cone().magnitudes()).norm_squared()
        };
        clean += error(None, &rows);
        behind_gate += error(Some(gate()), &spiked);
        unprotected += error(None, &spiked);
    }
    let ratio = |sum: f64| (sum / clean).sqrt();
    assert!(ratio(behind_gate) < 1.10, "{}", ratio(behind_gate));
    assert!(ratio(unprotected) > 1.30, "{}", ratio(unprotected));
}

#[test]
fn malformed_observations_change_nothing() {
    let good = rows(11, 1, 0.1)[0];
    let nan = Row { output: good.output.map(|x| x * f64::NAN), ..good };
    let certain = Row { standard_deviation: Vector6::zeros(), ..good };
    let (mut a, mut b, mut c) = (least_squares(), square_root(), sdp());
    for bad in [nan, certain] {
        assert!(a.update(&bad).is_err() && b.update(&bad).is_err() && c.update(&bad).is_err());
    }
    assert_eq!((a, b, c), (least_squares(), square_root(), sdp()));
    assert!(SquareRootFilter::<10, 6>::try_new(body_d().to_vector(), SVector::repeat(f64::INFINITY)).is_err());
}

#[test]
fn a_kalman_filter_follows_table_a_1() {
    // Constant velocity in one dimension against the matrices of the table.
    let process = LinearProcess {
        transition: SMatrix::<f64, 2, 2>::new(1.0, 0.1, 0.0, 1.0),
        noise: SMatrix::from_diagonal(&[1e-6, 1e-4].into()),
    };
    let mut filter = KalmanFilter::<2, 1>::new(process, SVector::zeros(), SMatrix::identity());
    let (mut x, mut p) = (SVector::<f64, 2>::zeros(), SMatrix::<f64, 2, 2>::identity());
    let h = SMatrix::<f64, 1, 2>::new(1.0, 0.0);
    for k in 0..50 {
        let (input, y) = (SVector::from([0.0, 0.01]), SVector::from([(0.3 * f64::from(k)).sin()]));
        filter.predict(&input);
        filter
            .correct(&LinearObservation { regressor: h, output: y, standard_deviation: SVector::from([0.2]) })
            .unwrap();
        (x, p) =
            (process.transition * x + input, process.transition * p * process.transition.transpose() + process.noise);
        let gain = p * h.transpose() / ((h * p * h.transpose())[0] + 0.04);
        (x, p) = (x + gain * (y - h * x), p - gain * h * p);
        assert!((filter.parameters() - x).amax() < 1e-13 && (filter.covariance() - p).amax() < 1e-13);
    }
}
