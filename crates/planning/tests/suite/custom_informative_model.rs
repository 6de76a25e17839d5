//! Tutorial: plan informatively for a robot of your own. Three steps: say how it moves, say what is not known of it, check the
//! laws. No derivative has to be written.
//!
//! The robot here is a hovercraft. Its mass and the drag of its skirt are known poorly; its inertia well enough.
#![allow(clippy::unwrap_used)]

use tumble_planning::dynamics::{
    DynamicsError, InertialParameters, Integrator, MechanicalSystem, ParametricModel, RungeKutta4,
};
use tumble_planning::laws::{ModelSample, check_informative_model};
use tumble_planning::lie::{LieGroup, Pose, Scalar, real};
use tumble_planning::local::{BelievedParameters, Kinematics, ParametricInformative, UncertainBody, UnknownParameter};
use tumble_planning::nalgebra::{Matrix3, UnitQuaternion, Vector3, Vector6};
use tumble_planning::{ModelBelief, PlanningError};

// Step 1: how it moves, once for every scalar. State: position and velocity in the world, heading, rate. Input: torque, force.
struct Hovercraft<T> {
    mass_kg: T,
    inertia_kg_m2: T,
    drag_n_s_m: T,
}

impl<T: Scalar> MechanicalSystem for Hovercraft<T> {
    type State = Vector6<T>;
    type Input = Vector3<T>;
    fn vector_field(&self, _time_s: T, x: &Vector6<T>, input: &Vector3<T>) -> Result<Vector6<T>, DynamicsError> {
        let [vx, vy, heading, rate] = [x[2], x[3], x[4], x[5]];
        let (sin, cos) = heading.sin_cos();
        let (fx, fy) = (cos * input.y - sin * input.z, sin * input.y + cos * input.z);
        let acceleration = [(fx - self.drag_n_s_m * vx) / self.mass_kg, (fy - self.drag_n_s_m * vy) / self.mass_kg];
        Ok(Vector6::new(vx, vy, acceleration[0], acceleration[1], rate, input.x / self.inertia_kg_m2))
    }
}

/// The step, and what a body's belief does not hold: drag and its standard deviation.
#[derive(Clone, Debug)]
struct HovercraftStep {
    drag_n_s_m: (f64, f64),
}

impl ParametricModel for HovercraftStep {
    type State<T: Scalar> = Vector6<T>;
    type Input<T: Scalar> = Vector3<T>;
    /// Mass, inertia, drag.
    type Parameters<T: Scalar> = Vector3<T>;
    fn lift<T: Scalar>(state: &Vector6<f64>) -> Vector6<T> {
        state.map(real)
    }
    fn step<T: Scalar>(
        &self,
        state: &Vector6<T>,
        input: &Vector3<T>,
        parameters: &Vector3<T>,
        step_s: T,
    ) -> Result<Vector6<T>, DynamicsError> {
        let [mass_kg, inertia_kg_m2, drag_n_s_m] = (*parameters).into();
        RungeKutta4.step(&Hovercraft { mass_kg, inertia_kg_m2, drag_n_s_m }, state, input, T::zero(), step_s)
    }
}

// Step 2: what is not known of it, and what it looks like from outside.
impl UncertainBody<2> for HovercraftStep {
    /// Where it is does not matter.
    const FIRST_ACTIVE: usize = 2;
    fn believed(&self, belief: &ModelBelief) -> Result<BelievedParameters<Vector3<f64>, 2>, PlanningError> {
        let (body, (drag_n_s_m, sigma)) = (belief.parameters(), self.drag_n_s_m);
        let values = Vector3::new(body.mass, body.inertia_about_com().m33, drag_n_s_m);
        let mass_sigma_kg = belief.estimate.std.mass_kg;
        let mass = UnknownParameter { index: 0, standard_deviation: mass_sigma_kg, name: "mass", unit: "kg" };
        let drag = UnknownParameter { index: 2, standard_deviation: sigma, name: "drag", unit: "N s/m" };
        BelievedParameters::independent(values, [mass, drag])
    }
    fn at_rest(&self) -> Vector6<f64> {
        Vector6::zeros()
    }
    fn kinematics<T: Scalar>(&self, x: &Vector6<T>) -> Kinematics<T> {
        let upright = |angle: T| Vector3::new(T::zero(), T::zero(), angle);
        let attitude = <UnitQuaternion<T> as LieGroup>::exp(&upright(x[4]));
        Kinematics {
            world_from_body: Pose::from_parts(Vector3::new(x[0], x[1], T::zero()).into(), attitude),
            velocity_world: Vector3::new(x[2], x[3], T::zero()),
            rate_body: upright(x[5]),
        }
    }
}

type Model = ParametricInformative<HovercraftStep, 6, 3, 2>;

fn belief(mass_kg: f64) -> ModelBelief {
    let body = InertialParameters::about_origin(mass_kg, Vector3::zeros(), Matrix3::identity() * 0.4);
    let mut belief = ModelBelief::certain(1, body);
    belief.estimate.std.mass_kg = 1.5;
    belief
}

// Step 3: the laws. The same step written down with other numbers is what the sensitivities are held against.
#[test]
fn it_keeps_the_laws() {
    let mut model = Model::new(HovercraftStep { drag_n_s_m: (0.8, 0.3) });
    let body_at = |state: &Vector6<f64>, input: &[f64; 3], step_s: f64, eta: &[f64; 2]| {
        let body = Hovercraft { mass_kg: 10.0 + 1.5 * eta[0], inertia_kg_m2: 0.4, drag_n_s_m: 0.8 + 0.3 * eta[1] };
        RungeKutta4.step(&body, state, &(*input).into(), 0.0, step_s).ok()
    };
    let sample = |state, input| ModelSample {
        state,
        sensitivity: [[0.01, -0.02, 0.015, 0.005, -0.01, 0.02], [0.02, 0.01, -0.005, 0.01, 0.03, -0.02]],
        input,
    };
    let moving = sample(Vector6::new(0.5, 1.0, 0.2, -0.1, 0.7, 0.3), [0.05, 1.0, -0.5]);
    let resting = sample(Vector6::new(0.0, 0.0, 0.0, 0.0, -2.0, 0.0), [0.0, 0.3, 0.2]);
    check_informative_model(&mut model, &belief(10.0), &body_at, &[moving, resting], 0.5, 1e-8).unwrap();
}
