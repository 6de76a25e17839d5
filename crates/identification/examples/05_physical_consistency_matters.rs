//! Why consistency: one second of noisy data, fitted fifty times. The best ten numbers are often no body; the best body is closer.

use tumble_identification::dynamics::{FreeFlyer, InertialParameters, Integrator, MuntheKaas4, RigidBodyState};
use tumble_identification::lie::Wrench;
use tumble_identification::nalgebra::{Matrix3, Vector3};
use tumble_identification::regressors::{Extrapolation, ObserverFrame, PoseTriple, variational};
use tumble_identification::{
    BodyScale, ConstrainedLeastSquares, InteriorPoint, PseudoInertiaCone, SquareRootInformation, WrenchTiming,
};

const STEP_S: f64 = 0.05;
/// Noise of the known wrench, N m and N.
const NOISE: (f64, f64) = (1e-2, 5e-2);
const FLIGHTS: u32 = 50;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A flat body: close to the bodies that do not exist.
    let truth = InertialParameters::about_com(
        9.58,
        Vector3::new(0.03, -0.02, 0.05),
        Matrix3::from_diagonal(&Vector3::new(0.08, 0.09, 0.169)),
    );
    let scale = BodyScale::try_new(10.0, 0.15)?;
    let solver = InteriorPoint::new(PseudoInertiaCone::new(scale));
    let (mut impossible, mut error_of_numbers, mut error_of_body) = (0, 0.0, 0.0);
    for flight in 0..FLIGHTS {
        let information = measure(&truth, flight)?;
        let numbers = InertialParameters::from_vector(&information.solve(&scale.parameter_magnitudes())?);
        let body = InertialParameters::from_vector(&solver.solve(&information)?.parameters);
        assert!(body.is_strictly_consistent());
        impossible += u32::from(!numbers.is_consistent());
        let error = |found: &InertialParameters<f64>| (found.inertia_about_com() - truth.inertia_about_com()).norm();
        error_of_numbers += error(&numbers) / f64::from(FLIGHTS);
        error_of_body += error(&body) / f64::from(FLIGHTS);
    }
    println!("{impossible} of {FLIGHTS} unconstrained fits are no body; all {FLIGHTS} constrained ones are");
    println!("mean error of the inertia: {error_of_numbers:.4} kg m^2 unconstrained, {error_of_body:.4} constrained");
    assert!(impossible > FLIGHTS / 4 && error_of_body < error_of_numbers);
    Ok(())
}

/// What one short flight with exact poses and noisy wrenches says about the body.
fn measure(
    truth: &InertialParameters<f64>,
    flight: u32,
) -> Result<SquareRootInformation<10>, Box<dyn std::error::Error>> {
    let system = FreeFlyer::new(*truth);
    let (mut state, mut poses, mut wrenches) = (RigidBodyState::at_rest(), Vec::new(), Vec::new());
    for k in 0..20_u32 {
        let t = STEP_S * f64::from(k);
        let tones = |phase: f64| Vector3::new((5.0 * t + phase).sin(), (7.0 * t).sin(), (9.0 * t - phase).cos());
        let wrench = Wrench::new(tones(0.5) * 0.1, tones(1.5) * 0.5);
        // A crude source of noise will do for an example.
        let noise = |i: u32| {
            f64::from((((flight * 20 + k) * 6 + i) ^ 0x5bd1).wrapping_mul(2_654_435_761) >> 8) / f64::from(1_u32 << 23)
                - 1.0
        };
        let torque = wrench.torque + Vector3::new(noise(0), noise(1), noise(2)) * NOISE.0;
        poses.push(state.world_from_body);
        wrenches.push(Wrench::new(torque, wrench.force + Vector3::new(noise(3), noise(4), noise(5)) * NOISE.1));
        state = MuntheKaas4.step(&system, &state, &wrench, t, STEP_S)?;
    }
    let mut information = SquareRootInformation::new();
    for (pose, known) in poses.windows(3).zip(wrenches.windows(3)) {
        let triple = PoseTriple::try_new([&pose[0], &pose[1], &pose[2]], STEP_S, STEP_S, &ObserverFrame::inertial())?;
        let wrench = WrenchTiming::Held
            .node_wrench(&[-STEP_S, 0.0, STEP_S], known, 1, Extrapolation::Order2)
            .ok_or("three times and three wrenches")?;
        let (mut rows, mut right) = (variational(&triple), wrench.to_vector());
        for i in 0..6 {
            let sigma = if i < 3 { NOISE.0 } else { NOISE.1 };
            rows.row_mut(i).scale_mut(1.0 / sigma);
            right[i] /= sigma;
        }
        information.update(&rows, &right)?;
    }
    Ok(information)
}
