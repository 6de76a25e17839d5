use super::*;
use proptest::prelude::*;

fn body() -> InertialParameters<f64> {
    InertialParameters::solid_box(9.5, [0.3, 0.3, 0.3])
}

fn covariance() -> SMatrix<f64, 10, 10> {
    // of unlike sizes, correlated, positive definite: A A^T + a little
    let a = SMatrix::<f64, 10, 10>::from_fn(|i, j| f64::from(u8::try_from((i * 7 + j * 3) % 11).unwrap()) - 5.0);
    let spread = SMatrix::<f64, 10, 10>::from_diagonal(&nalgebra::SVector::from_fn(|i, _| {
        [1.0, 1e-3, 1e-3, 1e-3, 1e-5, 1e-2, 1e-2, 1e-8, 1.0, 1e-4][i]
    }));
    spread * (a * a.transpose() + SMatrix::identity()) * spread
}

/// For as long as the test runs.
fn kept<T>(value: T) -> &'static T {
    Box::leak(Box::new(value))
}

fn limits() -> WatchLimits {
    WatchLimits::new(Vector3::new(0.15, 0.15, 0.1), 0.015)
}

const UNIT: [[f64; 4]; 2] = [[0.5, 0.5, -0.5, 0.5], [0.0, 0.0, 0.6, -0.8]];

/// All is well, at its limits.
fn step<'a>(time_s: f64, body: &'a InertialParameters<f64>, covariance: &'a SMatrix<f64, 10, 10>) -> WatchedStep<'a> {
    #[allow(clippy::cast_possible_truncation)]
    let time_ns = (time_s * 1e9) as i64;
    WatchedStep {
        time_ns,
        clearance_m: Some(0.0),
        wrench_body: Wrench::new(Vector3::new(0.0, 0.009, -0.012), Vector3::new(-0.15, 0.15, 0.1)),
        command_ns: time_ns - 200_000_000,
        command_revision: 3,
        offered_revision: 4,
        body,
        covariance: Some(covariance),
        quaternions_xyzw: &UNIT,
        speed_m_s: 0.05,
        rate_rad_s: 0.2,
        blind_since_ns: Some(time_ns - 14_900_000_000),
        planless_since_ns: None,
    }
}

/// A watch that has seen a good step sees one with a defect; what it found.
fn found(defect: impl Fn(&mut WatchedStep<'_>)) -> Vec<Violation> {
    let (body, covariance) = (body(), covariance());
    let mut watch = InvariantWatch::new(limits());
    assert_eq!(watch.see(&step(20.0, &body, &covariance)), 0, "{:?}", watch.violations());
    let mut bad = step(20.016, &body, &covariance);
    defect(&mut bad);
    let broken = watch.see(&bad);
    assert_eq!((u64::from(broken), watch.steps()), (watch.total(), 2));
    assert_eq!(watch.violations().len() as u64, watch.total());
    watch.violations().to_vec()
}

/// Each planted defect breaks its own invariant, no other, with its own numbers.
/// What spoils a step.
type Spoil<'a> = &'a dyn Fn(&mut WatchedStep<'_>);

#[test]
fn each_invariant_bites() {
    // a plate
    let plate = kept(InertialParameters::solid_box(9.5, [0.3, 0.3, 0.0]));
    let mut indefinite = covariance();
    indefinite[(2, 2)] = 1e-12;
    let indefinite = kept(indefinite);
    let defects: [(Invariant, f64, f64, Spoil<'_>); 17] = [
        (Invariant::Clearance, -1e-9, 0.0, &|s| s.clearance_m = Some(-1e-9)),
        (Invariant::Force, 0.1001, 0.1, &|s| s.wrench_body.force.z = -0.1001),
        (Invariant::Force, f64::INFINITY, 0.15, &|s| s.wrench_body.force.x = f64::NEG_INFINITY),
        (Invariant::Torque, 0.017, 0.015, &|s| s.wrench_body.torque.x = 0.008),
        (Invariant::Body, 0.0, 0.0, &|s| s.body = plate),
        (Invariant::OfferedRevision, 3.0, 4.0, &|s| s.offered_revision = 3),
        (Invariant::CommandRevision, 5.0, 4.0, &|s| s.command_revision = 5),
        (Invariant::AdoptedRevision, 2.0, 3.0, &|s| s.command_revision = 2),
        (Invariant::AdoptedRevision, 0.0, 3.0, &|s| s.command_revision = 0),
        (Invariant::Quaternion, 2.0, 1.0, &|s| s.quaternions_xyzw = &[[1.0, -1.0, 1.0, 1.0]]),
        (Invariant::Quaternion, 0.0, 1.0, &|s| s.quaternions_xyzw = &[[0.0; 4]]),
        (Invariant::CommandAge, 0.26, 0.25, &|s| s.command_ns = s.time_ns - 260_000_000),
        (Invariant::CommandAge, -0.1, 0.25, &|s| s.command_ns = s.time_ns + 100_000_000),
        (Invariant::SafeState, 0.05, 0.02, &|s| (s.blind_since_ns, s.rate_rad_s) = (Some(0), 0.01)),
        (Invariant::SafeState, 0.2, 0.05, &|s| (s.blind_since_ns, s.speed_m_s) = (Some(0), 0.02)),
        (Invariant::SafeState, 0.05, 0.02, &|s| {
            (s.blind_since_ns, s.planless_since_ns, s.rate_rad_s) = (None, Some(0), 0.0);
        }),
        (Invariant::Clearance, f64::NEG_INFINITY, 0.0, &|s| s.clearance_m = Some(f64::NEG_INFINITY)),
    ];
    for (invariant, number, allowed, defect) in defects {
        let [violation] = found(defect)[..] else { panic!("{invariant:?}: {:?}", found(defect)) };
        assert_eq!(violation.invariant, invariant);
        assert_eq!(violation.time_ns, 20_016_000_000);
        assert!(
            violation.found.to_bits() == number.to_bits() || (violation.found - number).abs() < 1e-9,
            "{violation}"
        );
        assert!((violation.allowed - allowed).abs() < 1e-12, "{violation}");
    }
    let of_covariance = found(|s| s.covariance = Some(indefinite));
    assert!(matches!(of_covariance[..], [Violation { invariant: Invariant::Covariance, found, .. }] if found < 0.0));
}

/// Numbers that are none satisfy nothing.
#[test]
fn what_is_no_number_does_not_hold() {
    let nan_body = kept(InertialParameters { mass: f64::NAN, ..body() });
    let mut nan_covariance = covariance();
    nan_covariance[(9, 0)] = f64::NAN;
    let nan_covariance = kept(nan_covariance);
    let violations = found(|s| {
        s.clearance_m = Some(f64::NAN);
        s.wrench_body = Wrench::new(Vector3::repeat(f64::NAN), Vector3::new(0.0, f64::NAN, 0.0));
        s.body = nan_body;
        s.covariance = Some(nan_covariance);
        s.quaternions_xyzw = &[[f64::NAN, 0.0, 0.0, 1.0]];
        (s.planless_since_ns, s.speed_m_s, s.rate_rad_s) = (Some(0), f64::NAN, f64::NAN);
    });
    let mut broken: Vec<Invariant> = violations.iter().map(|violation| violation.invariant).collect();
    broken.dedup();
    let expected = [
        Invariant::Clearance,
        Invariant::Force,
        Invariant::Torque,
        Invariant::Body,
        Invariant::Covariance,
        Invariant::Quaternion,
        Invariant::SafeState,
    ];
    assert_eq!(broken, expected);
    assert!(violations.iter().all(|violation| violation.found.is_nan()));
}

#[test]
fn known_parameters_and_absent_things_are_no_violation() {
    let (body, mut covariance) = (body(), covariance());
    for known in [0, 4, 9] {
        covariance.row_mut(known).fill(0.0);
        covariance.column_mut(known).fill(0.0);
    }
    let mut watch = InvariantWatch::new(limits());
    let mut good = step(1.0, &body, &covariance);
    assert_eq!(watch.see(&good), 0);
    let none = SMatrix::zeros();
    good.covariance = Some(&none);
    assert_eq!(watch.see(&good), 0);
    (good.covariance, good.clearance_m, good.blind_since_ns) = (None, None, None);
    assert_eq!(watch.see(&good), 0);
    // known, and yet correlated with another
    let mut impossible = covariance;
    impossible[(4, 5)] = 1e-9;
    impossible[(5, 4)] = 1e-9;
    good.covariance = Some(&impossible);
    assert_eq!((watch.see(&good), watch.count(Invariant::Covariance)), (1, 1));
}

#[test]
fn all_are_counted_and_the_first_kept() {
    let (body, covariance) = (body(), covariance());
    let mut watch = InvariantWatch::new(limits());
    for k in 0..100 {
        let mut bad = step(f64::from(k), &body, &covariance);
        bad.clearance_m = Some(-0.01);
        watch.see(&bad);
    }
    assert_eq!((watch.count(Invariant::Clearance), watch.total(), watch.violations().len()), (100, 100, 16));
    assert_eq!(watch.violations()[15].to_string(), "15.000 s: clearance: -0.01, allowed 0");
    for (index, invariant) in Invariant::ALL.into_iter().enumerate() {
        assert_eq!(invariant as usize, index);
    }
}

proptest! {
    /// The pivots agree with the eigenvalues of the correlations on whether a matrix is positive definite.
    #[test]
    fn pivots_are_positive_where_eigenvalues_are(
        entries in proptest::collection::vec(-1.0..1.0_f64, 100),
        shift in -0.5..1.5_f64,
        exponents in proptest::collection::vec(-6..6_i32, 10),
    ) {
        let a = SMatrix::<f64, 10, 10>::from_column_slice(&entries);
        let symmetric = a * a.transpose() + SMatrix::<f64, 10, 10>::identity() * (shift - 0.5);
        let least = symmetric.symmetric_eigenvalues().min();
        prop_assume!(least.abs() > 1e-6 && symmetric.diagonal().min() > 0.0);
        let scale = SMatrix::<f64, 10, 10>::from_diagonal(&nalgebra::SVector::from_fn(|i, _| 10.0_f64.powi(exponents[i])));
        prop_assert_eq!(least_pivot(&(scale * symmetric * scale)) > 0.0, least > 0.0);
    }
}
