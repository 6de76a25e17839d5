//! Predicted standard deviations of the local planner against those of the errors of a batch estimator over noisy flights
//! (`cargo xtask study predicted-sigma --runs N`).
//!
//! Problem 8: mass and three moments of inertia, velocity and rate measured at 24 nodes. The body is once as believed, with
//! the estimator's prior mean drawn about it (what a prediction by the information at the belief is right for, up to the
//! curvature within the posterior), and once drawn from the prior (a third of the inertia uncertain: the information then
//! is another for each body, and no prediction made at the belief can know it).

use nalgebra::{Matrix4, Vector4, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::json;
use tumble_dynamics::RigidBodyState;
use tumble_planning::local::{Guess, RigidBodyModel};

use crate::Failure;
use crate::arguments::Arguments;
use crate::local_cases::{LocalCase, documented_start};
use crate::local_tasks::frozen_task;

#[path = "../../../crates/planning/tests/suite/measured_flight/mod.rs"]
mod measured_flight;

use measured_flight::{BodyQuantities, MeasuredFlight, PrincipalBody, drawn};

const NAMES: [&str; 4] = ["mass", "Ixx", "Iyy", "Izz"];
/// Of the horizon.
const STEPS: usize = 24;
const SEED: u64 = 2000;
/// Largest difference of a sample's standard deviation from the predicted one, relative.
const BAND: f64 = 0.05;
/// A drawn quantity below this share of the true one is drawn again: there is no body below zero, and none to be flown near it.
const LEAST_SHARE: f64 = 0.1;
/// Residual to which the plan is made.
const TOLERANCE: f64 = 1e-6;

/// A flight, the standard deviations predicted for its end, and the prior.
struct Case {
    name: &'static str,
    flight: MeasuredFlight,
    predicted: Vector4<f64>,
    believed: Vector4<f64>,
    prior: Matrix4<f64>,
}

fn failed(what: &str) -> Failure {
    Failure::BadInput(format!("predicted-sigma: {what}"))
}

fn inverse(matrix: &Matrix4<f64>) -> Result<Matrix4<f64>, Failure> {
    Ok(matrix.cholesky().ok_or_else(|| failed("a matrix is not positive definite"))?.inverse())
}

fn flight(inputs: &[[f64; 6]]) -> MeasuredFlight {
    let task = frozen_task();
    let [_, _, velocity, rate] = task.measured;
    let block = |axis: usize| [f64::INFINITY, velocity, f64::INFINITY, rate][axis / 3];
    MeasuredFlight {
        start: RigidBodyState::at_rest(),
        inputs: inputs.iter().map(|input| Vector6::from(*input)).collect(),
        step_s: task.step_s,
        sigma: std::array::from_fn(block),
    }
}

/// A flight without a planner, predicted by the information of the flight itself; and a plan, predicted by its planner.
fn cases() -> Result<[Case; 2], Failure> {
    let task = frozen_task();
    let believed = Vector4::from([0, 4, 7, 9].map(|place: usize| task.parameters[place]));
    let prior_information = Matrix4::from_fn(|i, j| task.prior_information[i][j]);
    let prior = inverse(&prior_information)?;
    let body = PrincipalBody.body(&believed).ok_or_else(|| failed("no such body"))?;

    let scripted = documented_start(&task.wrench, STEPS).into_iter().map(|input| input.map(|entry| 2.0 * entry));
    let scripted = flight(&scripted.collect::<Vec<_>>());
    let information = scripted.information(&PrincipalBody, &body).ok_or_else(|| failed("the flight has no end"))?;
    let predicted = inverse(&(prior_information + information))?.diagonal().map(f64::sqrt);
    let scripted = Case { name: "scripted", flight: scripted, predicted, believed, prior };

    let case = LocalCase::new(task, STEPS, true)?;
    let start = documented_start(&case.task.wrench, STEPS);
    let mut planner = case.planner(RigidBodyModel::principal(), TOLERANCE)?;
    let run = case.run(&mut planner, Guess::Inputs(&start))?;
    let predicted = Vector4::from(run.sigma.ok_or_else(|| failed("there is no plan"))?);
    println!("plan: cost {:.5}, optimality {:.1e}, {} iterations", run.cost(), run.optimality, run.iterations);
    let planned = Case { name: "planned", flight: flight(&run.inputs), predicted, believed, prior };
    Ok([scripted, planned])
}

/// Errors of the estimates of many flights.
#[derive(Default)]
struct Errors {
    runs: u32,
    /// Flights whose estimate did not converge.
    lost: u32,
    /// Draws that were no bodies to be flown.
    redrawn: u32,
    sum: Vector4<f64>,
    squares: Vector4<f64>,
    /// Squares over the variances predicted at the true body.
    known_squares: Vector4<f64>,
    /// Sum of squared errors normalised by the estimator's own covariance.
    normalised: f64,
}

/// Flies a case many times: with the believed body, or with bodies drawn from the prior.
fn fly(case: &Case, runs: usize, is_drawn: bool) -> Result<Errors, Failure> {
    let prior_information = inverse(&case.prior)?;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut errors = Errors::default();
    for _ in 0..runs {
        let other = loop {
            let other = drawn(&case.believed, &case.prior, &mut rng).ok_or_else(|| failed("no prior"))?;
            if other.component_div(&case.believed).min() > LEAST_SHARE {
                break other;
            }
            errors.redrawn += 1;
        };
        let (truth, mean) = if is_drawn { (other, case.believed) } else { (case.believed, other) };
        let body = PrincipalBody.body(&truth).ok_or_else(|| failed("no such body"))?;
        let measured = case.flight.measured(&body, &mut rng).ok_or_else(|| failed("the flight has no end"))?;
        let Some(estimate) = case.flight.estimate(&PrincipalBody, &measured, &mean, &prior_information) else {
            errors.lost += 1;
            continue;
        };
        let known = case.flight.information(&PrincipalBody, &body).ok_or_else(|| failed("the flight has no end"))?;
        let known = inverse(&(prior_information + known))?.diagonal();
        let error = estimate.quantities - truth;
        let squares = error.component_mul(&error);
        errors.runs += 1;
        errors.sum += error;
        errors.squares += squares;
        errors.known_squares += squares.component_div(&known);
        errors.normalised += error.dot(&(inverse(&estimate.covariance)? * error));
    }
    Ok(errors)
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let runs = arguments.number("--runs")?.unwrap_or(2000).max(2);
    let mut missed = Vec::new();
    for case in cases()? {
        for is_drawn in [false, true] {
            let errors = fly(&case, runs, is_drawn)?;
            let count = f64::from(errors.runs);
            let bodies = if is_drawn { "drawn from the prior" } else { "as believed" };
            println!(
                "\n{} flight, bodies {bodies}: {} estimates, {} not converged, {} draws redrawn",
                case.name, errors.runs, errors.lost, errors.redrawn
            );
            println!(
                "{:>6} {:>12} {:>12} {:>9} {:>12} {:>14}",
                "", "predicted", "found", "ratio", "mean error", "at each body"
            );
            let mean = errors.sum / count;
            let found = (errors.squares / count - mean.component_mul(&mean)).map(f64::sqrt);
            let predicted = case.predicted;
            let ratio = found.component_div(&predicted);
            let known = (errors.known_squares / count).map(f64::sqrt);
            for (i, name) in NAMES.iter().enumerate() {
                println!(
                    "{name:>6} {:>12.6} {:>12.6} {:>9.4} {:>12.6} {:>14.4}",
                    predicted[i], found[i], ratio[i], mean[i], known[i]
                );
            }
            let nees = errors.normalised / count;
            println!("mean normalised squared error {nees:.4} of 4, standard error {:.4}", f64::sqrt(8.0 / count));
            let list = |vector: &Vector4<f64>| vector.as_slice().to_vec();
            let line = json!({
                "block": "predicted-sigma", "flight": case.name, "bodies": bodies, "runs": runs, "estimates": errors.runs,
                "not_converged": errors.lost, "redrawn": errors.redrawn, "quantities": NAMES,
                "predicted_sigma": list(&predicted), "sigma": list(&found), "ratio": list(&ratio),
                "mean_error": list(&mean), "ratio_at_each_body": list(&known), "nees": nees,
            });
            println!("{line}");
            let worst = ratio.map(|ratio| (ratio - 1.0).abs()).max();
            if !is_drawn && worst > BAND {
                missed.push(format!(
                    "{}: a standard deviation is {:.1} % from the predicted one",
                    case.name,
                    100.0 * worst
                ));
            }
        }
    }
    if missed.is_empty() { Ok(()) } else { Err(Failure::TargetMissed(missed.join("; "))) }
}
