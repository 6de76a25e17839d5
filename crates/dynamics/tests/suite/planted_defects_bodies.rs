//! Every law of bodies, forces and actuators catches a deliberately broken implementation, by name.

use tumble_dynamics::laws::{
    InertiaOperations, InertiaSamples, LawViolation, WrenchNature, check_actuation, check_drag, check_gravity,
    check_gravity_of_points, check_gyrostat, check_inertia, check_inverse_dynamics, check_system, check_wrench_model,
    check_wrench_sum,
};
use tumble_dynamics::lie::{Pose, Twist, Wrench};
use tumble_dynamics::nalgebra::{Matrix3, Matrix4, SVector, UnitQuaternion, Vector3};
use tumble_dynamics::strategies::body_d;
use tumble_dynamics::strategies::{bodies, clouds, draws, judged_bodies, poses, states, twists, vectors, wrenches};
use tumble_dynamics::{
    Actuation, BodyAcceleration, ConstantBodyWrench, ConstantWorldWrench, DynamicsError, FreeFlyer, FreeFlyerIn,
    GravityGradient, Gyrostat, GyrostatInput, InertialParameters, LinearDrag, MechanicalSystem, QuadraticDrag,
    RigidBody, RigidBodyState, UniformGravity, WrenchBox, WrenchFn, WrenchModel, pseudo_inertia,
};

type Body = InertialParameters<f64>;
type State = RigidBodyState<f64>;

fn law_of(outcome: Result<(), LawViolation>) -> &'static str {
    outcome.expect_err("the planted defect was not caught").law
}

fn samples() -> InertiaSamples {
    InertiaSamples {
        clouds: draws(&clouds(6), 1, 60),
        candidates: draws(&judged_bodies(), 2, 200).iter().map(|body| body.parameters).collect(),
        poses: draws(&poses(2.0), 3, 4),
    }
}

/// Smallest eigenvalue of (5.38) as printed, with the inertia about the centre of mass.
fn printed_pseudo_inertia(body: &Body) -> Matrix4<f64> {
    let about_com = InertialParameters { inertia_about_origin: body.inertia_about_com(), ..*body };
    pseudo_inertia(&about_com)
}

fn triangles_of(inertia: &Matrix3<f64>) -> bool {
    let j = inertia.symmetric_eigenvalues();
    j.sum() - 2.0 * j.max() >= -1e-13 * inertia.amax()
}

#[test]
fn the_unbroken_implementations_pass() {
    check_inertia(&InertiaOperations::default(), &samples(), 1e-10).unwrap();
    let (body, cases) = (body_d(), free_body_samples());
    check_system(&FreeFlyer::new(body), &cases, 1e-13).unwrap();
    check_system(&FreeFlyerIn { body: FreeFlyer::new(body), environment: () }, &cases, 1e-13).unwrap();
}

#[test]
fn defects_of_inertia_are_caught_by_name() {
    let cases: [(&str, InertiaOperations); 14] = [
        ("packing round trip", InertiaOperations { unpack: |v| Body::from_vector(&(v * 1.001)), ..Default::default() }),
        (
            "packing order", // chapter 5's order, unpacked accordingly
            InertiaOperations {
                pack: |body| tumble_dynamics::ParameterOrder::DualQuaternion.pack(&body.to_vector()),
                unpack: |v| Body::from_vector(&tumble_dynamics::ParameterOrder::DualQuaternion.unpack(v)),
                ..Default::default()
            },
        ),
        (
            "pseudo-inertia is the second moment", // linear, and wrong: products of inertia with the wrong sign
            InertiaOperations {
                pseudo_inertia: |body| {
                    let mut p = pseudo_inertia(body);
                    for (i, j) in [(0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)] {
                        p[(i, j)] *= -1.0;
                    }
                    p
                },
                ..Default::default()
            },
        ),
        (
            "pseudo-inertia is the second moment", // (5.38) as printed
            InertiaOperations { pseudo_inertia: printed_pseudo_inertia, ..Default::default() },
        ),
        (
            "pseudo-inertia is linear", // right for every body, "repaired" for what is none
            InertiaOperations {
                pseudo_inertia: |body| {
                    if body.is_consistent() { pseudo_inertia(body) } else { pseudo_inertia(body).abs() }
                },
                ..Default::default()
            },
        ),
        (
            "existing bodies are consistent", // (5.38) as printed
            InertiaOperations {
                is_consistent: |body| printed_pseudo_inertia(body).symmetric_eigenvalues().min() >= -1e-13,
                ..Default::default()
            },
        ),
        (
            "existing bodies are consistent", // an absolute tolerance on the wrong side
            InertiaOperations { is_consistent: Body::is_strictly_consistent, ..Default::default() },
        ),
        (
            "bodies without extent are not strictly consistent",
            InertiaOperations { is_strictly_consistent: Body::is_consistent, ..Default::default() },
        ),
        (
            "consistent exactly when a body exists", // triangle inequalities about the origin: too weak
            InertiaOperations {
                is_consistent: |body| body.mass > 0.0 && triangles_of(&body.inertia_about_origin),
                ..Default::default()
            },
        ),
        (
            "moved frame moves the points", // the linear term of the parallel-axis theorem forgotten
            InertiaOperations {
                transformed_by: |body, pose| {
                    let mut moved = body.transformed_by(pose);
                    let (h, t) = (pose.rotation * body.first_moment, pose.translation.vector);
                    moved.inertia_about_origin -=
                        Matrix3::identity() * (2.0 * h.dot(&t)) - h * t.transpose() - t * h.transpose();
                    moved
                },
                ..Default::default()
            },
        ),
        (
            "composition is the union of points", // the grasp pose the wrong way round
            InertiaOperations {
                with_payload: |robot, payload, pose| robot.with_payload(payload, &pose.inverse()),
                ..Default::default()
            },
        ),
        (
            "payload is combined minus robot", // left in the robot's frame
            InertiaOperations { payload_beside: |combined, robot, _| *combined - *robot, ..Default::default() },
        ),
        ("projection gives a body", InertiaOperations { nearest_consistent: |body| Ok(*body), ..Default::default() }),
        (
            "projection is nearest", // eigenvalues of the pseudo-inertia clipped: nearest in another norm
            InertiaOperations {
                nearest_consistent: |body| {
                    if body.is_consistent() {
                        return Ok(*body);
                    }
                    let eigen = pseudo_inertia(body).symmetric_eigen();
                    let clipped = Matrix4::from_diagonal(&eigen.eigenvalues.map(|value| value.max(0.0)));
                    let p = eigen.eigenvectors * clipped * eigen.eigenvectors.transpose();
                    Ok(tumble_dynamics::from_pseudo_inertia(&p))
                },
                ..Default::default()
            },
        ),
    ];
    for (law, broken) in cases {
        assert_eq!(law_of(check_inertia(&broken, &samples(), 1e-9)), law);
    }
    // a projection that shrinks what needs no projection
    let shrinking = InertiaOperations {
        nearest_consistent: |body| {
            let core = Body::solid_sphere(1e-4 * body.mass, 0.1);
            Ok((*body - core).nearest_consistent()? + core * 0.5)
        },
        ..Default::default()
    };
    assert_eq!(law_of(check_inertia(&shrinking, &samples(), 1e-9)), "projection keeps bodies");
}

fn free_body_samples() -> Vec<(State, Wrench<f64>)> {
    draws(&states(), 4, 100).into_iter().zip(draws(&wrenches(3.0, 5.0), 5, 100)).collect()
}

/// A free body with a broken field.
struct BrokenBody(Field);

type Field = fn(&FreeFlyer<f64>, &State, &Wrench<f64>) -> Result<SVector<f64, 12>, DynamicsError>;

impl RigidBody for BrokenBody {
    type Scalar = f64;
    fn inertial_parameters(&self) -> Body {
        body_d()
    }
}

impl MechanicalSystem for BrokenBody {
    type State = State;
    type Input = Wrench<f64>;
    fn vector_field(
        &self,
        _time_s: f64,
        state: &State,
        wrench_body: &Wrench<f64>,
    ) -> Result<SVector<f64, 12>, DynamicsError> {
        (self.0)(&FreeFlyer::new(body_d()), state, wrench_body)
    }
}

#[test]
fn defects_of_the_equations_of_motion_are_caught_by_name() {
    let cases: [(&str, BrokenBody); 4] = [
        ("the field has a value", BrokenBody(|_, _, _| Err(DynamicsError::NotFinite))),
        (
            "the pose moves with the twist", // the pose increment in world axes
            BrokenBody(|body, state, wrench| {
                let mut rate = body.vector_field(0.0, state, wrench)?;
                let velocity_world = state.world_from_body.rotation * state.twist_body.linear;
                rate.fixed_rows_mut::<3>(3).copy_from(&velocity_world);
                Ok(rate)
            }),
        ),
        (
            "power balance", // the torque taken about the centre of mass without the lever of the force
            BrokenBody(|body, state, wrench| {
                let lever = body.parameters().center_of_mass().cross(&wrench.force);
                body.vector_field(0.0, state, &Wrench::new(wrench.torque + lever, wrench.force))
            }),
        ),
        (
            "momentum balance", // gyroscopic torque forgotten: keeps the energy, not the momentum
            BrokenBody(|body, state, wrench| {
                let still = State { twist_body: Twist::zero(), ..*state };
                let mut rate = body.vector_field(0.0, &still, wrench)?;
                rate.fixed_rows_mut::<6>(0).copy_from(&state.twist_body.to_vector());
                Ok(rate)
            }),
        ),
    ];
    for (law, broken) in cases {
        assert_eq!(law_of(check_system(&broken, &free_body_samples(), 1e-12)), law);
    }
}

/// A body whose wheels are broken: what the field makes of the wrench and of what is stored.
struct BrokenGyrostat(fn(&State, &GyrostatInput<f64>, Vector3<f64>) -> Wrench<f64>);

impl RigidBody for BrokenGyrostat {
    type Scalar = f64;
    fn inertial_parameters(&self) -> Body {
        body_d()
    }
}

impl MechanicalSystem for BrokenGyrostat {
    type State = State;
    type Input = GyrostatInput<f64>;
    fn vector_field(
        &self,
        time_s: f64,
        state: &State,
        input: &GyrostatInput<f64>,
    ) -> Result<SVector<f64, 12>, DynamicsError> {
        FreeFlyer::new(body_d()).vector_field(time_s, state, &(self.0)(state, input, input.stored_at(time_s)))
    }
}

fn gyrostat_samples() -> Vec<(State, GyrostatInput<f64>)> {
    let wheels = draws(&(vectors(2.0), vectors(0.3)), 14, 100).into_iter();
    let samples = free_body_samples().into_iter().zip(wheels);
    let input = |((state, wrench_body), (stored_body, stored_rate_body))| {
        (state, GyrostatInput { wrench_body, stored_body, stored_rate_body, since_s: 3.0 })
    };
    samples.map(input).collect()
}

#[test]
fn defects_of_momentum_within_are_caught_by_name() {
    check_gyrostat(&Gyrostat(FreeFlyer::new(body_d())), &gyrostat_samples(), 1e-13).unwrap();
    let cases: [(&str, BrokenGyrostat); 5] = [
        // wheels without gyroscopic torque
        ("momentum balance", BrokenGyrostat(|_, input, _| input.wrench_body)),
        // precession the other way
        (
            "momentum balance",
            BrokenGyrostat(|state, input, stored| {
                input.wrench_body - Wrench::new(stored.cross(&state.twist_body.angular), Vector3::zeros())
            }),
        ),
        // what was stored at the start of the hold, all the time
        (
            "momentum balance",
            BrokenGyrostat(|state, input, _| {
                let torque = input.stored_body.cross(&state.twist_body.angular);
                input.wrench_body + Wrench::new(torque, Vector3::zeros())
            }),
        ),
        // the motors counted twice
        (
            "power balance",
            BrokenGyrostat(|state, input, stored| {
                let torque = stored.cross(&state.twist_body.angular) - input.stored_rate_body;
                input.wrench_body + Wrench::new(torque, Vector3::zeros())
            }),
        ),
        // what is stored taken for a force
        ("power balance", BrokenGyrostat(|_, input, stored| input.wrench_body + Wrench::new(stored, Vector3::zeros()))),
    ];
    for (law, broken) in cases {
        assert_eq!(law_of(check_gyrostat(&broken, &gyrostat_samples(), 1e-12)), law);
    }
}

#[test]
fn defects_of_inverse_dynamics_are_caught_by_name() {
    let body = FreeFlyer::new(body_d());
    let samples: Vec<_> = draws(&twists(2.0, 2.0), 6, 50).into_iter().zip(draws(&wrenches(3.0, 5.0), 7, 50)).collect();
    let forward = |twist: &Twist<f64>, wrench: &Wrench<f64>| body.forward(twist, wrench);
    let inverse = |twist: &Twist<f64>, acceleration: &BodyAcceleration<f64>| body.inverse(twist, acceleration);
    check_inverse_dynamics(forward, inverse, &samples, 1e-13).unwrap();
    // the rate of the velocity components taken for the acceleration of the origin
    let component_rate = |twist: &Twist<f64>, acceleration: &BodyAcceleration<f64>| {
        let rate = Twist::new(acceleration.angular_acceleration_body, acceleration.acceleration_origin_body);
        body.inverse(twist, &BodyAcceleration::from_twist_rate_body(twist, &rate))
    };
    let outcome = check_inverse_dynamics(forward, component_rate, &samples, 1e-12);
    assert_eq!(law_of(outcome), "forward(inverse(a)) = a");
    // saturation inside the model: a light body never meets it on the way from acceleration to acceleration
    let light = FreeFlyer::new(*body.parameters() * 1e-4);
    let saturating = |twist: &Twist<f64>, wrench: &Wrench<f64>| {
        let cut = |v: &Vector3<f64>| v.map(|component| component.clamp(-0.1, 0.1));
        light.forward(twist, &Wrench::new(cut(&wrench.torque), cut(&wrench.force)))
    };
    let outcome = check_inverse_dynamics(saturating, |twist, a| light.inverse(twist, a), &samples, 1e-12);
    assert_eq!(law_of(outcome), "inverse(forward(w)) = w");
}

fn linear_drag() -> LinearDrag<f64> {
    LinearDrag {
        center_of_pressure: Vector3::new(0.1, -0.05, 0.2),
        force_coefficient: 0.3,
        torque_coefficient: 0.05,
        medium_velocity_world: Vector3::zeros(),
    }
}

fn quadratic_drag() -> QuadraticDrag<f64> {
    let LinearDrag { center_of_pressure, force_coefficient, torque_coefficient, medium_velocity_world } = linear_drag();
    QuadraticDrag { center_of_pressure, force_coefficient, torque_coefficient, medium_velocity_world }
}

fn gravity() -> UniformGravity<f64> {
    let body = body_d();
    UniformGravity { mass: body.mass, first_moment: body.first_moment, gravity_world: Vector3::new(0.3, -0.2, -9.81) }
}

fn gravity_in(world: &Pose<f64>) -> UniformGravity<f64> {
    UniformGravity { gravity_world: world.rotation * gravity().gravity_world, ..gravity() }
}

/// Potential of uniform gravity.
fn height(_: f64, state: &State) -> f64 {
    let com = state.world_from_body.transform_point(&body_d().center_of_mass().into()).coords;
    -body_d().mass * gravity().gravity_world.dot(&com)
}

/// The earth from a low orbit: gravitational parameter, its centre, the angular velocity of the orbit.
fn orbit() -> (f64, Vector3<f64>, Vector3<f64>) {
    let center = Vector3::<f64>::new(-2.0e6, 3.0e6, -6.0e6);
    let across = Vector3::new(0.3, 1.0, 0.4);
    let rate = (3.986e14 / f64::powi(center.norm(), 3)).sqrt();
    (3.986e14, center, center.cross(&across).normalize() * rate)
}

fn tide_in(world: &Pose<f64>) -> GravityGradient<f64> {
    let (mu, center, rate) = orbit();
    let field = GravityGradient::of_point_mass(body_d(), mu, world.rotation * center, world.rotation * rate);
    GravityGradient { reference_world: world.translation.vector, ..field }
}

/// Acceleration of a point less that of the world's origin, which falls freely: the law of gravity itself.
fn fall(time_s: f64, place: &Vector3<f64>) -> Vector3<f64> {
    let (mu, center, rate) = orbit();
    let center = UnitQuaternion::from_scaled_axis(rate * time_s) * center;
    let pull = |place: &Vector3<f64>| (center - place) * (mu / (center - place).norm().powi(3));
    pull(place) - pull(&Vector3::zeros())
}

/// Potential of the tides by the linear field, summed over second moments.
fn tide_energy(time_s: f64, state: &State) -> f64 {
    let turned = UnitQuaternion::from_scaled_axis(orbit().2 * time_s).to_rotation_matrix().into_inner();
    let gradient = turned * tide_in(&Pose::identity()).gradient_world * turned.transpose();
    let in_world = body_d().transformed_by(&state.world_from_body);
    let pseudo = pseudo_inertia(&in_world);
    -0.5 * (gradient * pseudo.fixed_view::<3, 3>(0, 0)).trace()
}

#[test]
fn the_gravity_gradient_is_that_of_a_point_mass() {
    let states = draws(&states(), 15, 100);
    let gravity = tide_in(&Pose::identity());
    // the field is linear but for 10 m over 7000 km
    let points = draws(&clouds(12), 16, 100);
    check_gravity_of_points(&gravity, &fall, &points, &states, 1e-5).unwrap();
    let tides = WrenchNature::Potential { energy_j: &tide_energy, width_m: 1e-2 };
    check_wrench_model(&|world| Box::new(tide_in(world)), tides, &states, 1e-8).unwrap();
    // the textbook torque about the centre of mass
    let (mu, center, _) = orbit();
    for state in states.iter().take(20) {
        let wrench = gravity.wrench_body(0.0, state);
        let up = state.world_from_body.rotation.inverse() * center.normalize();
        let expected = up.cross(&(body_d().inertia_about_com() * up)) * (3.0 * mu / center.norm().powi(3));
        let found = wrench.torque - body_d().center_of_mass().cross(&wrench.force);
        assert!((found - expected).amax() < 1e-12 * expected.amax().max(1e-6), "{found} {expected}");
    }
}

#[test]
fn defects_of_gravity_gradients_are_caught_by_name() {
    let states = draws(&states(), 17, 50);
    let points = draws(&clouds(12), 18, 50);
    let law = |field: &dyn Fn(GravityGradient<f64>) -> GravityGradient<f64>| {
        let model = field(tide_in(&Pose::identity()));
        law_of(check_gravity_of_points(&model, &fall, &points, &states, 1e-5))
    };
    let points_law = "gravity of a body is that of all its points";
    let turned_over = |field: GravityGradient<f64>| GravityGradient { gradient_world: -field.gradient_world, ..field };
    assert_eq!(law(&turned_over), points_law);
    let standing = |field| GravityGradient { turn_rate_world: Vector3::zeros(), ..field };
    assert_eq!(law(&standing), points_law);
    let backwards = |field: GravityGradient<f64>| GravityGradient { turn_rate_world: -field.turn_rate_world, ..field };
    assert_eq!(law(&backwards), points_law);
    let elsewhere = |field| GravityGradient { reference_world: Vector3::x(), ..field };
    assert_eq!(law(&elsewhere), points_law);
    // the wrong sign against the potential, the torque alone turned over, the field of the body's own axes
    let tides = WrenchNature::Potential { energy_j: &tide_energy, width_m: 1e-2 };
    let work = "does the work that the potential loses";
    let outcome = check_wrench_model(&|world| Box::new(turned_over(tide_in(world))), tides, &states, 1e-8);
    assert_eq!(law_of(outcome), work);
    let torque_over = |world: &Pose<f64>| -> Box<dyn WrenchModel<f64>> {
        let model = tide_in(world);
        Box::new(WrenchFn(move |time_s: f64, state: &State| {
            let wrench = model.wrench_body(time_s, state);
            Wrench::new(-wrench.torque, wrench.force)
        }))
    };
    assert_eq!(law_of(check_wrench_model(&torque_over, tides, &states, 1e-8)), work);
    let stands_still = |_: &Pose<f64>| -> Box<dyn WrenchModel<f64>> { Box::new(tide_in(&Pose::identity())) };
    let frame = "nothing depends on where the world stands";
    assert_eq!(law_of(check_wrench_model(&stands_still, tides, &states, 1e-8)), frame);
}

#[test]
fn the_wrench_models_obey_their_laws() {
    let states = draws(&states(), 8, 200);
    let push = Wrench::new(Vector3::new(0.1, 0.2, -0.1), Vector3::new(1.0, -2.0, 0.5));
    let (body_push, world_push) =
        (ConstantBodyWrench { wrench_body: push }, ConstantWorldWrench { wrench_world: push });
    let (linear, quadratic, gravity) = (linear_drag(), quadratic_drag(), gravity());
    let models: [&dyn WrenchModel<f64>; 5] = [&body_push, &world_push, &linear, &quadratic, &gravity];
    let any = WrenchNature::Any;
    check_wrench_model(&|_| Box::new(body_push), any, &states, 1e-14).unwrap();
    let pushed = |world: &Pose<f64>| -> Box<dyn WrenchModel<f64>> {
        let Wrench { torque, force } = push;
        Box::new(ConstantWorldWrench { wrench_world: Wrench::new(world.rotation * torque, world.rotation * force) })
    };
    check_wrench_model(&pushed, any, &states, 1e-14).unwrap();
    check_wrench_model(&|_| Box::new(linear), WrenchNature::Dissipates, &states, 1e-14).unwrap();
    check_wrench_model(&|_| Box::new(quadratic), WrenchNature::Dissipates, &states, 1e-14).unwrap();
    let falls = WrenchNature::Potential { energy_j: &height, width_m: 1e-2 };
    check_wrench_model(&|world| Box::new(gravity_in(world)), falls, &states, 1e-8).unwrap();
    check_wrench_model(&|world| Box::new(gravity_in(world)), any, &states, 1e-13).unwrap();
    check_drag(&linear, &states, 1e-12).unwrap();
    check_drag(&quadratic, &states, 1e-12).unwrap();
    check_gravity(&gravity, &body_d(), &gravity.gravity_world, &states, 1e-14).unwrap();
    check_wrench_sum(&models, &models, &states, 1e-14).unwrap();
    check_wrench_sum(&(body_push, (linear, gravity)), &[&gravity, &body_push, &linear], &states, 1e-14).unwrap();
    // carried along by the medium, nothing drags
    let wind = Vector3::new(0.4, -0.3, 0.2);
    let windy = QuadraticDrag { medium_velocity_world: wind, ..quadratic };
    let mut carried = states[0];
    carried.twist_body = Twist::new(Vector3::zeros(), carried.world_from_body.rotation.inverse() * wind);
    assert!(windy.wrench_body(0.0, &carried).to_vector().amax() < 1e-16);
}

/// A wrench with the square of the mass.
struct Squared;
impl WrenchModel<f64> for Squared {
    fn wrench_body(&self, _time_s: f64, _state: &State) -> Wrench<f64> {
        Wrench::zero()
    }
    fn wrench_on(&self, body: &Body, _time_s: f64, _state: &State) -> Wrench<f64> {
        Wrench::new(Vector3::zeros(), Vector3::x() * (body.mass * body.mass))
    }
}

#[test]
fn defects_of_wrench_models_are_caught_by_name() {
    let states = draws(&states(), 9, 100);
    let model = |outcome| law_of(outcome);

    let divides_by_speed = WrenchFn(|_: f64, state: &State| {
        let axis = Vector3::x() / (state.twist_body.linear.norm() - state.twist_body.linear.norm());
        Wrench::new(Vector3::zeros(), axis)
    });
    let any = WrenchNature::Any;
    let outcome = check_wrench_model(&|_| Box::new(divides_by_speed), any, &states, 1e-12);
    assert_eq!(model(outcome), "finite wrench");
    let reads_the_quaternion = WrenchFn(|_: f64, state: &State| {
        Wrench::new(state.world_from_body.rotation.vector().into_owned(), Vector3::zeros())
    });
    let outcome = check_wrench_model(&|_| Box::new(reads_the_quaternion), any, &states, 1e-12);
    assert_eq!(model(outcome), "same wrench for q and -q");
    // in the wrong frame: world axes taken for the body's, and a force told in body axes turned once more
    let frame = "nothing depends on where the world stands";
    let in_body_axes = |world: &Pose<f64>| -> Box<dyn WrenchModel<f64>> {
        let UniformGravity { mass, first_moment, gravity_world } = gravity_in(world);
        let wrench_body = Wrench::new(first_moment.cross(&gravity_world), gravity_world * mass);
        Box::new(ConstantBodyWrench { wrench_body })
    };
    assert_eq!(model(check_wrench_model(&in_body_axes, any, &states, 1e-12)), frame);
    let turned_again = |_: &Pose<f64>| -> Box<dyn WrenchModel<f64>> {
        Box::new(WrenchFn(|time_s: f64, state: &State| {
            let Wrench { torque, force } = linear_drag().wrench_body(time_s, state);
            let rotation = state.world_from_body.rotation.inverse();
            Wrench::new(rotation * torque, rotation * force)
        }))
    };
    assert_eq!(model(check_wrench_model(&turned_again, any, &states, 1e-12)), frame);
    // with the wrong sign, or without its lever
    let pushes = |_: &Pose<f64>| -> Box<dyn WrenchModel<f64>> {
        Box::new(LinearDrag { torque_coefficient: -0.05, ..linear_drag() })
    };
    assert_eq!(model(check_wrench_model(&pushes, WrenchNature::Dissipates, &states, 1e-12)), "dissipates");
    let falls = WrenchNature::Potential { energy_j: &height, width_m: 1e-2 };
    let work = "does the work that the potential loses";
    let rises = |world: &Pose<f64>| -> Box<dyn WrenchModel<f64>> {
        let gravity = gravity_in(world);
        Box::new(UniformGravity { gravity_world: -gravity.gravity_world, ..gravity })
    };
    assert_eq!(model(check_wrench_model(&rises, falls, &states, 1e-8)), work);
    let at_the_origin = |world: &Pose<f64>| -> Box<dyn WrenchModel<f64>> {
        Box::new(UniformGravity { first_moment: Vector3::zeros(), ..gravity_in(world) })
    };
    assert_eq!(model(check_wrench_model(&at_the_origin, falls, &states, 1e-8)), work);
    let damped = |world: &Pose<f64>| -> Box<dyn WrenchModel<f64>> { Box::new((gravity_in(world), linear_drag())) };
    assert_eq!(model(check_wrench_model(&damped, falls, &states, 1e-8)), "a potential does not see velocity");
    assert_eq!(model(check_wrench_model(&|_| Box::new(Squared), any, &states, 1e-12)), "affine in the body");

    let last_one_wins = WrenchFn(|time_s: f64, state: &State| gravity().wrench_body(time_s, state));
    let outcome = check_wrench_sum(&last_one_wins, &[&linear_drag(), &gravity()], &states, 1e-12);
    assert_eq!(model(outcome), "models add up");

    let pushes_at_rest = WrenchFn(|time_s: f64, state: &State| {
        linear_drag().wrench_body(time_s, state) + Wrench::new(Vector3::zeros(), Vector3::x() * 1e-6)
    });
    assert_eq!(model(check_drag(&pushes_at_rest, &states, 1e-12)), "drag vanishes at rest");
    let pushes_forward = LinearDrag { force_coefficient: -0.3, ..linear_drag() };
    assert_eq!(model(check_drag(&pushes_forward, &states, 1e-12)), "drag dissipates");
    let without_lever = WrenchFn(|_: f64, state: &State| {
        // drag of one point, applied at another
        let drag = LinearDrag { center_of_pressure: Vector3::new(1.0, -2.0, 2.0), ..linear_drag() };
        let velocity = state.twist_body.linear + state.twist_body.angular.cross(&drag.center_of_pressure);
        Wrench::new(Vector3::zeros(), velocity * -drag.force_coefficient)
    });
    assert_eq!(model(check_drag(&without_lever, &states, 1e-12)), "drag dissipates");
    let unit_velocity = WrenchFn(|_: f64, state: &State| {
        let direction = state.twist_body.linear.try_normalize(1e-12).unwrap_or_default();
        Wrench::new(Vector3::zeros(), direction * -0.3)
    });
    assert_eq!(model(check_drag(&unit_velocity, &states, 1e-12)), "drag grows with speed");

    let pulls_down_in_body_axes = WrenchFn(|_: f64, _: &State| {
        let UniformGravity { mass, first_moment, gravity_world } = gravity();
        Wrench::new(first_moment.cross(&gravity_world), gravity_world * mass)
    });
    let g = gravity().gravity_world;
    let outcome = check_gravity(&pulls_down_in_body_axes, &body_d(), &g, &states, 1e-12);
    assert_eq!(model(outcome), "gravity gives every body its acceleration");
    let at_the_origin = UniformGravity { first_moment: Vector3::zeros(), ..gravity() };
    let outcome = check_gravity(&at_the_origin, &body_d(), &g, &states, 1e-12);
    assert_eq!(model(outcome), "gravity acts at the centre of mass");
}

fn limits() -> WrenchBox {
    WrenchBox { torque_limit: Vector3::new(0.1, 0.2, 0.3), force_limit: Vector3::new(0.6, 0.5, 0.4) }
}

/// A box with broken halves.
#[derive(Clone, Copy)]
struct BrokenBox {
    allocate: fn(&Wrench<f64>) -> Result<Wrench<f64>, DynamicsError>,
    realize: fn(&Wrench<f64>) -> Wrench<f64>,
}

impl Default for BrokenBox {
    fn default() -> Self {
        Self { allocate: |wrench| limits().allocate(wrench), realize: |command| limits().realize(command) }
    }
}

impl Actuation for BrokenBox {
    type Command = Wrench<f64>;
    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<Wrench<f64>, DynamicsError> {
        (self.allocate)(wrench_body)
    }
    fn realize(&self, command: &Wrench<f64>) -> Wrench<f64> {
        (self.realize)(command)
    }
}

fn check_box<A: Actuation<Command = Wrench<f64>>>(actuation: &A) -> Result<(), LawViolation> {
    let inside = draws(&wrenches(0.1, 0.4), 10, 50);
    let wanted = draws(&wrenches(1.0, 2.0), 11, 50);
    let excess = |_: &Wrench<f64>, realized: &Wrench<f64>| {
        let over = |v: Vector3<f64>, limit: Vector3<f64>| (v.abs() - limit).max();
        over(realized.torque, limits().torque_limit).max(over(realized.force, limits().force_limit))
    };
    check_actuation(actuation, &inside, &wanted, &wanted, &excess, 1e-14)
}

#[test]
fn defects_of_actuators_are_caught_by_name() {
    check_box(&limits()).unwrap();
    check_box(&BrokenBox::default()).unwrap();
    let cases: [(&str, BrokenBox); 5] = [
        ("limits are never exceeded", BrokenBox { realize: |command| *command, ..Default::default() }),
        (
            "limits are never exceeded", // one side of one axis forgotten
            BrokenBox {
                realize: |command| {
                    let mut wrench = limits().realize(command);
                    wrench.force.x = command.force.x.min(0.6);
                    wrench
                },
                allocate: |wrench| Ok(*wrench),
            },
        ),
        (
            "what lies inside the limits is realised", // a row forgotten
            BrokenBox {
                allocate: |wrench| {
                    let mut command = limits().allocate(wrench)?;
                    command.force.z = 0.0;
                    Ok(command)
                },
                ..Default::default()
            },
        ),
        (
            "what was realised can be realised again", // creeps towards zero once saturated
            BrokenBox {
                allocate: |wrench| {
                    let command = limits().allocate(wrench)?;
                    let saturated = wrench.force.x.abs() > 0.5;
                    Ok(if saturated { command * 0.9 } else { command })
                },
                ..Default::default()
            },
        ),
        (
            "a wrench that is not finite is refused",
            BrokenBox { allocate: |wrench| Ok(limits().realize(wrench)), ..Default::default() },
        ),
    ];
    for (law, broken) in cases {
        assert_eq!(law_of(check_box(&broken)), law);
    }
    // a body of any strategy is accepted by everything above
    assert!(draws(&bodies(), 12, 100).iter().all(Body::is_strictly_consistent));
}
