//! The laws of informative models, on every model of this crate but the one with its own file, and what the models say of one
//! another.

use crate::ten_parameters::{belief_about_com, body_of, wave};
use tumble_planning::ModelBelief;
use tumble_planning::dynamics::{
    FreeFlyerStep, InertialParameters, MuntheKaas4, ParametricModel, PlanarBody, PlanarWrench, RigidBodyState,
    VariationalFreeFlyer,
};
use tumble_planning::laws::{ModelSample, check_informative_model};
use tumble_planning::lie::{Manifold, Pose, Twist};
use tumble_planning::local::{
    BodyStep, InformativeModel, Kinematics, MuntheKaasBodyModel, PlanarBodyModel, PlanarState, RigidBodyModel,
    VariationalBodyModel,
};
use tumble_planning::nalgebra::{SMatrix, SVector, UnitQuaternion, Vector2, Vector3, Vector6};

const COM: [f64; 3] = [0.02, -0.03, 0.04];
const INERTIA: [f64; 6] = [0.15, 0.01, -0.02, 0.14, 0.005, 0.16];
/// Prior standard deviations of mass, centre of mass and inertia about it.
const SIGMA: [f64; 10] = [1.0, 0.01, 0.012, 0.008, 0.02, 0.005, 0.006, 0.018, 0.004, 0.021];

fn quantities() -> [f64; 10] {
    let [x, y, z] = COM;
    let [xx, xy, xz, yy, yz, zz] = INERTIA;
    [9.5, x, y, z, xx, xy, xz, yy, yz, zz]
}

fn belief() -> ModelBelief {
    belief_about_com(&quantities(), &SIGMA)
}

/// The body whose quantities at these places are off by `eta` prior standard deviations.
fn body_at<const P: usize>(places: [usize; P], eta: &[f64; P]) -> InertialParameters<f64> {
    let mut q = quantities();
    for (place, eta) in places.into_iter().zip(eta) {
        q[place] += SIGMA[place] * eta;
    }
    body_of(&q)
}

const PRINCIPAL: [usize; 4] = [0, 4, 7, 9];
const ALL: [usize; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9];

fn planar_samples<const P: usize>() -> Vec<ModelSample<PlanarState, 6, 3, P>> {
    let state = |position: [f64; 2], velocity: [f64; 2], heading_rad, rate_rad_s| PlanarState {
        position_world: position.into(),
        velocity_world: velocity.into(),
        heading_rad,
        rate_rad_s,
    };
    let samples = [
        (state([0.3, -0.2], [0.05, 0.1], 2.5, 0.4), [0.03, -0.2, 0.15]),
        (state([-1.3, 4.0], [-0.3, 0.2], -0.7, -1.1), [-0.02, 0.4, 0.3]),
        (PlanarState::at_rest(Vector2::new(0.1, 0.2), 0.3), [0.0; 3]),
    ];
    let sample = |(i, (state, input)): (usize, (PlanarState, [f64; 3]))| ModelSample {
        state,
        sensitivity: core::array::from_fn(|c| core::array::from_fn(|j| 0.05 * wave(30 * i + 6 * c + j))),
        input,
    };
    samples.into_iter().enumerate().map(sample).collect()
}

/// Another formulation of the planar step: the body of `dynamics`, its motion as coordinates.
fn planar_step(values: [f64; 4], state: &PlanarState, [torque, fx, fy]: [f64; 3], h: f64) -> PlanarState {
    let [mass, inertia_about_com, cx, cy] = values;
    let body = PlanarBody { mass, inertia_about_com, center_of_mass: Vector2::new(cx, cy) };
    let wrench = PlanarWrench { torque, force: Vector2::new(fx, fy) };
    let field = |x: &SVector<f64, 6>| {
        let acceleration = body.forward(x[5], &wrench);
        let (sin, cos) = x[4].sin_cos();
        let a = acceleration.acceleration_origin_body;
        SVector::from([
            x[2],
            x[3],
            cos * a.x - sin * a.y,
            sin * a.x + cos * a.y,
            x[5],
            acceleration.angular_acceleration,
        ])
    };
    let (p, v) = (state.position_world, state.velocity_world);
    let x = SVector::from([p.x, p.y, v.x, v.y, state.heading_rad, state.rate_rad_s]);
    let k1 = field(&x);
    let k2 = field(&(x + k1 * (h / 2.0)));
    let k3 = field(&(x + k2 * (h / 2.0)));
    let k4 = field(&(x + k3 * h));
    let end = x + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
    PlanarState {
        position_world: Vector2::new(end[0], end[1]),
        velocity_world: Vector2::new(end[2], end[3]),
        heading_rad: end[4],
        rate_rad_s: end[5],
    }
}

#[test]
fn the_planar_body_keeps_the_laws() {
    let values = [quantities()[0], quantities()[9], quantities()[1], quantities()[2]];
    let sigma = [SIGMA[0], SIGMA[9], SIGMA[1], SIGMA[2]];
    let four = |state: &PlanarState, input: &[f64; 3], h: f64, eta: &[f64; 4]| {
        Some(planar_step(core::array::from_fn(|i| values[i] + sigma[i] * eta[i]), state, *input, h))
    };
    let two = |state: &PlanarState, input: &[f64; 3], h: f64, eta: &[f64; 2]| {
        four(state, input, h, &[eta[0], eta[1], 0.0, 0.0])
    };
    for step_s in [0.1, 0.5] {
        let samples = planar_samples();
        check_informative_model(&mut PlanarBodyModel::full(), &belief(), &four, &samples, step_s, 1e-9).unwrap();
        let (mut small, samples) = (PlanarBodyModel::mass_and_inertia(), planar_samples());
        check_informative_model(&mut small, &belief(), &two, &samples, step_s, 1e-9).unwrap();
    }
}

fn space_samples<const P: usize>() -> Vec<ModelSample<Kinematics, 12, 6, P>> {
    let motion = |i: usize, size: f64| Kinematics {
        world_from_body: Pose::from_parts(
            Vector3::new(wave(i), wave(i + 1), wave(i + 2)).into(),
            UnitQuaternion::from_scaled_axis(Vector3::new(wave(i + 3), wave(i + 4), wave(i + 5)) * 1.5),
        ),
        velocity_world: Vector3::new(wave(i + 6), wave(i + 7), wave(i + 8)) * (0.05 * size),
        rate_body: Vector3::new(wave(i + 9), wave(i + 10), wave(i + 11)) * (0.3 * size),
    };
    let sample = |(i, size): (usize, f64)| ModelSample {
        state: motion(100 * i, size),
        sensitivity: core::array::from_fn(|c| core::array::from_fn(|j| 0.05 * wave(200 * i + 12 * c + j))),
        input: core::array::from_fn(|j| wave(i + j) * size * if j < 3 { 0.02 } else { 0.3 }),
    };
    [1.0, 0.5, 0.0].into_iter().enumerate().map(sample).collect()
}

fn in_body_axes(state: &Kinematics) -> RigidBodyState<f64> {
    let attitude = state.world_from_body.rotation;
    RigidBodyState {
        world_from_body: state.world_from_body,
        twist_body: Twist::new(state.rate_body, attitude.inverse() * state.velocity_world),
    }
}

fn in_world_axes(state: &RigidBodyState<f64>) -> Kinematics {
    let attitude = state.world_from_body.rotation;
    Kinematics {
        world_from_body: state.world_from_body,
        velocity_world: attitude * state.twist_body.linear,
        rate_body: state.twist_body.angular,
    }
}

macro_rules! free_step {
    ($integrator:expr, $body:expr, $state:expr, $input:expr, $h:expr) => {{
        let parameters = $body.to_vector();
        let end = FreeFlyerStep($integrator).step(&in_body_axes($state), &Vector6::from(*$input), &parameters, $h);
        end.ok().map(|end| in_world_axes(&end))
    }};
}

#[test]
fn the_variational_step_keeps_the_laws() {
    let four = |state: &Kinematics, input: &[f64; 6], h: f64, eta: &[f64; 4]| {
        free_step!(VariationalFreeFlyer, body_at(PRINCIPAL, eta), state, input, h)
    };
    let mut model = VariationalBodyModel::<4>::new(BodyStep::default());
    check_informative_model(&mut model, &belief(), &four, &space_samples(), 0.5, 1e-8).unwrap();
    let ten = |state: &Kinematics, input: &[f64; 6], h: f64, eta: &[f64; 10]| {
        free_step!(VariationalFreeFlyer, body_at(ALL, eta), state, input, h)
    };
    let mut model = VariationalBodyModel::<10>::new(BodyStep::default());
    check_informative_model(&mut model, &belief(), &ten, &space_samples(), 0.5, 1e-8).unwrap();
}

#[test]
fn the_munthe_kaas_step_keeps_the_laws() {
    let four = |state: &Kinematics, input: &[f64; 6], h: f64, eta: &[f64; 4]| {
        free_step!(MuntheKaas4, body_at(PRINCIPAL, eta), state, input, h)
    };
    let mut model = MuntheKaasBodyModel::<4>::new(BodyStep::default());
    check_informative_model(&mut model, &belief(), &four, &space_samples(), 0.5, 1e-8).unwrap();
}

/// A rollout with the sensitivities of every node.
fn rollout<M, const P: usize>(
    model: &M,
    start: &M::State,
    seconds: usize,
    per_s: usize,
) -> Vec<(M::State, [[f64; 12]; P])>
where
    M: InformativeModel<12, 6, P>,
{
    // one input for each half second
    let input = |k: usize| -> [f64; 6] {
        core::array::from_fn(|j| wave(6 * (2 * k / per_s) + j) * if j < 3 { 0.01 } else { 0.2 })
    };
    let step_s = 1.0 / per_s as f64;
    let mut nodes = vec![(start.clone(), [[0.0; 12]; P])];
    for k in 0..seconds * per_s {
        let (state, phi) = nodes.last().unwrap();
        nodes.push(model.step(state, phi, &input(k), step_s).unwrap());
    }
    nodes
}

fn start() -> Kinematics {
    Kinematics {
        world_from_body: Pose::from_parts(
            Vector3::new(1.0, 2.0, 3.0).into(),
            UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.6, 0.2)),
        ),
        velocity_world: Vector3::new(0.03, -0.02, 0.01),
        rate_body: Vector3::new(0.05, -0.08, 0.1),
    }
}

/// The variational rollout and its sensitivities come to those of tiny Munthe-Kaas steps with the second order of the step.
#[test]
fn the_variational_step_converges_to_the_motion_with_its_sensitivities() {
    let (mut variational, mut fine) =
        (VariationalBodyModel::<10>::new(BodyStep::default()), MuntheKaasBodyModel::<10>::new(BodyStep::default()));
    variational.adopt(&belief()).unwrap();
    fine.adopt(&belief()).unwrap();
    let seconds = 4;
    let (truth, truth_phi) = rollout::<_, 10>(&fine, &start(), seconds, 80).pop().unwrap();
    let size = truth_phi.iter().flatten().fold(0.0_f64, |most, phi| most.max(phi.abs()));
    assert!(size > 1e-2, "{size}");
    let errors: Vec<(f64, f64)> = [2, 4, 8]
        .into_iter()
        .map(|per_s| {
            let (end, phi) = rollout::<_, 10>(&variational, &start(), seconds, per_s).pop().unwrap();
            let differences = phi.iter().flatten().zip(truth_phi.iter().flatten()).map(|(a, b)| (a - b).abs());
            (end.ominus(&truth).amax(), differences.fold(0.0_f64, f64::max) / size)
        })
        .collect();
    println!("{errors:?}");
    for pair in errors.windows(2) {
        let ratios = (pair[0].0 / pair[1].0, pair[0].1 / pair[1].1);
        assert!(ratios.0 > 3.5 && ratios.0 < 4.5 && ratios.1 > 3.5 && ratios.1 < 4.5, "{ratios:?}");
    }
    assert!(errors[2].0 < 1e-3 && errors[2].1 < 1e-2, "{errors:?}");
}

/// The law, on a model whose own account of its coordinates says which body to step.
fn check_rigid_body<const P: usize>(mut model: RigidBodyModel<P>) {
    let (mut sound, belief) = (model.clone(), belief());
    sound.adopt(&belief).unwrap();
    let body_at = |state: &Kinematics, input: &[f64; 6], h: f64, eta: &[f64; P]| {
        let mut moved = belief.clone();
        moved.estimate.parameters = sound.body_at(eta).ok()?;
        let mut model = sound.clone();
        model.adopt(&moved).ok()?;
        Some(model.step(state, &[[0.0; 12]; P], input, h)?.0)
    };
    let samples: Vec<ModelSample<Kinematics, 12, 6, P>> = space_samples::<P>().into_iter().collect();
    check_informative_model(&mut model, &belief, &body_at, &samples, 0.5, 1e-8).unwrap();
}

#[test]
fn the_rigid_body_keeps_the_laws() {
    check_rigid_body(RigidBodyModel::principal());
    check_rigid_body(RigidBodyModel::full());
}

/// Predicted covariance of the quantities after 12 s: positions good to 1 cm, velocities to 5 mm/s, attitudes to 10 mrad, rates
/// to 5 mrad/s, twice a second.
fn predicted<M, const P: usize>(model: &mut M, start: &M::State, per_s: usize) -> SMatrix<f64, P, P>
where
    M: InformativeModel<12, 6, P>,
{
    let knowledge = model.adopt(&belief()).unwrap();
    let mut information = knowledge.information;
    let nodes = rollout::<M, P>(model, start, 12, per_s);
    for (_, phi) in nodes.iter().step_by(per_s / 2) {
        let sigma = [0.01, 0.005, 0.01, 0.005];
        let rows = SMatrix::<f64, P, 12>::from_fn(|c, i| phi[c][i] / sigma[i / 3]);
        information += rows * rows.transpose();
    }
    knowledge.quantities * information.cholesky().unwrap().inverse() * knowledge.quantities.transpose()
}

/// Two transcriptions of one body predict the same standard deviations, to the second order of the variational step.
#[test]
fn the_variational_step_predicts_what_the_rigid_body_predicts() {
    fn errors<const P: usize>(
        mut rigid: RigidBodyModel<P>,
        predict: impl Fn(usize) -> SMatrix<f64, P, P>,
        prior: [f64; P],
    ) -> [f64; 2] {
        let truth = predicted(&mut rigid, &start(), 16);
        let gained = (0..P).any(|i| truth[(i, i)].sqrt() < 0.5 * prior[i]);
        assert!(gained, "the motion tells something: {truth}");
        [2, 4].map(|per_s| {
            let covariance = predict(per_s);
            let off = |i: usize| (covariance[(i, i)].sqrt() / truth[(i, i)].sqrt() - 1.0).abs();
            (0..P).map(off).fold(0.0, f64::max)
        })
    }
    let four = |per_s| predicted(&mut VariationalBodyModel::<4>::new(BodyStep::default()), &start(), per_s);
    let four = errors(RigidBodyModel::principal(), four, PRINCIPAL.map(|place| SIGMA[place]));
    let ten = |per_s| predicted(&mut VariationalBodyModel::<10>::new(BodyStep::default()), &start(), per_s);
    let ten = errors(RigidBodyModel::full(), ten, SIGMA);
    println!("{four:?} {ten:?}");
    for [coarse, fine] in [four, ten] {
        assert!(coarse < 0.03 && fine < 0.3 * coarse, "{coarse} {fine}");
    }
}
