//! The laws of estimators of a whole record hold for the library's and catch planted defects by name.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    clippy::neg_cmp_op_on_partial_ord
)]

use crate::exact_motion::{Multisine, Random, Run, body_d};
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::estimator::{Constrained, Estimator, EstimatorError, Finding};
use tumble_identification::laws::{Case, Retold, check_coverage, check_estimator};
use tumble_identification::lie::{Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};
use tumble_identification::{
    BarrierNewton, BodyScale, MotionSample, Problem, PseudoInertiaCone, Regressed, Settings, constrained_solvers,
    identify, methods,
};

type Boxed = Box<dyn Estimator<Record = [MotionSample]> + Send + Sync>;

/// Body D under a held multisine; noise of the wrench and of the poses.
pub fn record(seed: u64, samples: usize, wrench_noise: f64, pose_noise: f64) -> Vec<MotionSample> {
    let mut random = Random::new(seed);
    let signal = Multisine::random(&mut random, 0.5, 1.0, (0.5, 3.0), 4);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body_d(), &wrench, true);
    run.step_ns = 16_000_000;
    run.samples = samples;
    let mut record = run.record();
    spoil(&mut record, &mut random, wrench_noise, pose_noise);
    record
}

fn spoil(record: &mut [MotionSample], random: &mut Random, wrench_noise: f64, pose_noise: f64) {
    for sample in record {
        (sample.rate_body, sample.velocity_origin_world, sample.acceleration_origin_body) = (None, None, None);
        sample.wrench_body = sample
            .wrench_body
            .map(|w| Wrench::new(w.torque + random.normal3(wrench_noise), w.force + random.normal3(wrench_noise)));
        let turn = UnitQuaternion::from_scaled_axis(random.normal3(pose_noise));
        let place = sample.world_from_body.unwrap().translation.vector + random.normal3(pose_noise);
        sample.world_from_body = Some(Pose::from_parts(place.into(), sample.world_from_body.unwrap().rotation * turn));
    }
}

/// The record with mass, length and time multiplied.
fn in_units(record: &[MotionSample], mass: f64, length: f64, time: f64) -> Vec<MotionSample> {
    let force = mass * length / (time * time);
    let scaled = |sample: &MotionSample| MotionSample {
        time_ns: (sample.time_ns as f64 * time).round() as i64,
        world_from_body: Some(Pose::from_parts(
            Translation3::from(sample.world_from_body.unwrap().translation.vector * length),
            sample.world_from_body.unwrap().rotation,
        )),
        wrench_body: sample.wrench_body.map(|w| Wrench::new(w.torque * (force * length), w.force * force)),
        ..*sample
    };
    record.iter().map(scaled).collect()
}

fn units_of_parameters(mass: f64, length: f64) -> SMatrix<f64, 10, 10> {
    SMatrix::from_diagonal(&BodyScale::try_new(mass, length).unwrap().parameter_magnitudes())
}

/// The record seen from another inertial frame, of a body whose axes are others.
fn in_frame(record: &[MotionSample], world: &Pose<f64>, body_from_other: &UnitQuaternion<f64>) -> Vec<MotionSample> {
    let other = Pose::from_parts(Translation3::identity(), *body_from_other);
    let seen = |sample: &MotionSample| MotionSample {
        world_from_body: sample.world_from_body.map(|pose| world * pose * other),
        wrench_body: sample
            .wrench_body
            .map(|w| Wrench::new(body_from_other.inverse() * w.torque, body_from_other.inverse() * w.force)),
        ..*sample
    };
    record.iter().map(seen).collect()
}

fn turned_parameters(body_from_other: &UnitQuaternion<f64>) -> SMatrix<f64, 10, 10> {
    let other_from_body = Pose::from_parts(Translation3::identity(), body_from_other.inverse());
    let column =
        |j: usize| InertialParameters::from_vector(&SVector::ith(j, 1.0)).transformed_by(&other_from_body).to_vector();
    SMatrix::from_columns(&std::array::from_fn::<_, 10, _>(column))
}

struct Told {
    whole: Vec<MotionSample>,
    exact: Vec<MotionSample>,
    otherwise: Vec<(&'static str, Vec<MotionSample>, SMatrix<f64, 10, 10>)>,
}

impl Told {
    fn new(seed: u64, samples: usize, pose_noise: f64) -> Self {
        let whole = record(seed, samples, 1e-2, pose_noise);
        let quarter = UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::FRAC_PI_2);
        let world =
            Pose::from_parts(Vector3::new(30.0, -20.0, 10.0).into(), UnitQuaternion::from_euler_angles(0.3, -0.8, 2.0));
        let mut otherwise = vec![("the frame", in_frame(&whole, &world, &quarter), turned_parameters(&quarter))];
        for (what, mass, length, time) in [
            ("the unit of mass, small", 1e-3, 1.0, 1.0),
            ("the unit of mass, large", 1e3, 1.0, 1.0),
            ("the unit of length, small", 1.0, 0.1, 1.0),
            ("the unit of length, large", 1.0, 10.0, 1.0),
            ("the unit of time, short", 1.0, 1.0, 0.1),
            ("the unit of time, long", 1.0, 1.0, 10.0),
        ] {
            otherwise.push((what, in_units(&whole, mass, length, time), units_of_parameters(mass, length)));
        }
        Self { exact: record(seed, samples, 0.0, 0.0), whole, otherwise }
    }

    fn check(
        &self,
        make: &dyn Fn(&[MotionSample]) -> Result<Boxed, EstimatorError>,
        tolerances: (f64, Option<f64>),
        told: &[&str],
    ) -> Result<(), &'static str> {
        let (tolerance, exact) = tolerances;
        let retold: Vec<Retold<'_, [MotionSample], 10>> = self
            .otherwise
            .iter()
            .filter(|(what, ..)| told.iter().any(|kind| what.contains(kind)))
            .map(|(what, record, map)| Retold { what, record: &record[..], map: *map, tolerance })
            .collect();
        let (first, second) = self.whole.split_at(self.whole.len() / 2);
        let truth = body_d().to_vector();
        let case = Case {
            record: &self.whole[..],
            halves: [first, second],
            exact: exact.map(|tolerance| (&self.exact[..], tolerance)),
            truth,
            magnitudes: BodyScale::of(&truth).unwrap().parameter_magnitudes(),
            sigmas: 4.5,
            retold: &retold,
        };
        check_estimator(make, &case).map_err(|broken| {
            println!("{broken}");
            assert!(broken.to_string().lines().count() <= 3, "{broken}");
            broken.law
        })
    }
}

const ALL: [&str; 4] = ["frame", "mass", "length", "time"];

fn problem(record: &[MotionSample]) -> Result<Problem, EstimatorError> {
    Ok(Problem::of(record, &Settings::default())?)
}

fn named(name: &'static str) -> impl Fn(&[MotionSample]) -> Result<Boxed, EstimatorError> {
    move |record: &[MotionSample]| methods().make(name, &problem(record)?)
}

#[test]
fn regressions_and_recursions_hold_the_laws() {
    let told = Told::new(1, 2400, 0.0);
    for name in ["variational4", "variational", "rls", "recursive-sdp"] {
        let exact = if name == "variational4" { 1e-4 } else { 1e-2 };
        assert_eq!(told.check(&named(name), (1e-3, Some(exact)), &ALL), Ok(()), "{name}");
    }
    for name in ["interior-point", "barrier-newton"] {
        let make = |record: &[MotionSample]| -> Result<Boxed, EstimatorError> {
            let problem = problem(record)?;
            Ok(Box::new(Constrained::new(Regressed::new(problem), constrained_solvers().make(name, &problem.scale)?)))
        };
        assert_eq!(told.check(&make, (1e-3, Some(1e-4)), &ALL), Ok(()), "{name}");
    }
}

#[test]
fn the_likelihood_and_the_joint_filter_hold_the_laws() {
    let told = Told::new(2, 1500, 1e-3);
    assert_eq!(told.check(&named("maximum-likelihood"), (0.05, None), &["frame"]), Ok(()));
    assert_eq!(told.check(&named("ekf"), (0.3, None), &["frame", "mass", "length"]), Ok(()));
}

/// An estimator with a defect in front.
struct Broken(Problem, Defect);

#[derive(Clone, Copy)]
enum Defect {
    /// Everything a tenth light.
    Light,
    /// What was known before counts as data.
    PriorAsData,
    /// In world axes.
    WrongFrame,
    /// Inertias below a number are reported as that number.
    InSquareMetres,
}

impl Estimator for Broken {
    type Record = [MotionSample];
    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        let found = Regressed::new(self.0).estimate(record)?;
        let point = found.point().copied().unwrap_or_default();
        let magnitudes = *found.magnitudes();
        Ok(match self.1 {
            Defect::Light => found.at(point * 0.9),
            Defect::PriorAsData => {
                let mut known = *found.information();
                known.add_prior(&body_d().to_vector(), &(magnitudes * 5e-5))?;
                Finding::of_information(known, magnitudes)
            }
            Defect::WrongFrame => {
                let turn = turned_parameters(&record[0].world_from_body.unwrap().rotation.inverse());
                Finding::of_covariance(turn * point, &(turn * found.covariance()? * turn.transpose()), magnitudes)?
            }
            Defect::InSquareMetres => found.at(point.map(|p| if p.abs() < 0.01 { p + 0.05 } else { p })),
        })
    }
}

#[test]
fn planted_defects_are_caught_by_name() {
    let told = Told::new(3, 1500, 0.0);
    let law_of = |defect, otherwise: &[&str]| {
        let make = move |record: &[MotionSample]| -> Result<Boxed, EstimatorError> {
            Ok(Box::new(Broken(problem(record)?, defect)))
        };
        told.check(&make, (1e-3, None), otherwise).unwrap_err()
    };
    let law = |defect| law_of(defect, &ALL);
    assert_eq!(law(Defect::Light), "the truth is inside the stated sigmas");
    assert_eq!(law_of(Defect::PriorAsData, &[]), "halves together know no more than the whole");
    assert_eq!(law(Defect::WrongFrame), "frames and units do not matter");
    assert_eq!(law(Defect::InSquareMetres), "frames and units do not matter");
    // A tenth of the stated errors, and three times.
    let runs = |factor: f64| {
        let make = move |record: &[MotionSample]| -> Result<Boxed, EstimatorError> {
            struct Sure(Problem, f64);
            impl Estimator for Sure {
                type Record = [MotionSample];
                fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
                    let found = Regressed::new(self.0).estimate(record)?;
                    let point = found.point().copied().unwrap_or_default();
                    Finding::of_covariance(point, &(found.covariance()? * self.1), *found.magnitudes())
                }
            }
            Ok(Box::new(Sure(problem(record)?, factor)))
        };
        let mut runs = (10..22).map(|seed| {
            let record: Box<[MotionSample]> = record(seed, 600, 1e-2, 0.0).into();
            (record, body_d().to_vector())
        });
        check_coverage(&make, &mut runs, (0.6, 1.6))
    };
    runs(1.0).unwrap();
    assert_eq!(runs(0.3).unwrap_err().law, "errors are as large as stated");
    assert_eq!(runs(3.0).unwrap_err().law, "errors are as large as stated");
}

/// A free flyer of another mass, density kept; driven as strongly for its mass; 1 mm and 1 mrad of noise in the poses.
fn of_mass(mass_kg: f64, seed: u64) -> (InertialParameters<f64>, Vec<MotionSample>) {
    let length = (mass_kg / 9.4).cbrt();
    let inertia = Matrix3::new(0.153, 0.004, -0.006, 0.004, 0.143, 0.003, -0.006, 0.003, 0.162);
    let body = InertialParameters::about_com(
        mass_kg,
        Vector3::new(0.031, -0.017, 0.052) * length,
        inertia * (mass_kg / 9.4 * length * length),
    );
    let mut random = Random::new(seed);
    let force = 0.4 * mass_kg / 9.4;
    let signal = Multisine::random(&mut random, 0.1 * force * length, force, (0.3, 3.0), 5);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body, &wrench, true);
    run.step_ns = 16_000_000;
    run.samples = 1500;
    let mut record = run.record();
    spoil(&mut record, &mut random, 0.0025 * force, 1e-3);
    (body, record)
}

#[test]
fn filters_answer_or_say_why_not_from_a_chip_to_a_satellite() {
    for (index, mass_kg) in [0.05, 1.0, 15.0, 100.0, 300.0, 500.0].into_iter().enumerate() {
        let (body, record) = of_mass(mass_kg, 40 + index as u64);
        // The sigma points cost ten times as much.
        let names: &[&'static str] = if index % 4 == 0 { &["ekf", "ukf"] } else { &["ekf"] };
        for method in names {
            let found = identify(&record, &Settings { method, ..Settings::default() }).unwrap();
            println!("{mass_kg} kg {method}: {} {:?}", found.method, found.verdict);
            if found.verdict.is_identified() {
                let estimate = found.estimate.unwrap();
                let error = (estimate.parameters.mass - body.mass) / estimate.std.mass_kg;
                assert!(error.abs() < 5.0, "{mass_kg} kg {method}: {error} sigma");
            }
        }
    }
}

#[test]
fn any_solver_over_any_set_constrains_a_pipeline() {
    let record = record(6, 600, 1e-2, 0.0);
    let by = |name: &'static str| {
        let pipeline = tumble_identification::Pipeline::new()
            .constrained_by(move |scale| constrained_solvers().make(name, &scale).unwrap());
        pipeline.identify(&record, &Settings::default()).unwrap().estimate.unwrap().parameters.to_vector()
    };
    let size = BodyScale::of(&body_d().to_vector()).unwrap().parameter_magnitudes();
    assert!((by("interior-point") - by("barrier-newton")).component_div(&size).amax() < 1e-6);
    let heavy = tumble_identification::Pipeline::new()
        .constrained_by(|scale| Box::new(BarrierNewton::new(PseudoInertiaCone::with_relative_floor(scale, 0.05))));
    let found = heavy.identify(&record, &Settings::default()).unwrap();
    assert!(found.estimate.is_some());
}
