//! A rigid body in the plane, as the local planner sees it.

mod motion;

use super::about_com::sizes_about_com;
use super::knowledge::{QUANTITIES, covariance_about_com};
use super::model::{Array2, InformativeModel, KINEMATICS, Kinematics, Knowledge, StepDerivatives};
use crate::belief::ModelBelief;
use crate::error::PlanningError;
use core::f64::consts::TAU;
use motion::{Drive, Gain, Lanes, Turns, gain};
use nalgebra::{SMatrix, UnitQuaternion, Vector2, Vector3};
use tumble_lie::{LieGroup, Pose};

/// Mass, inertia and the two coordinates of the centre of mass: the most that can be unknown.
const MOST: usize = 4;
/// Their places among [`QUANTITIES`].
const PLACES: [usize; MOST] = [0, 9, 1, 2];
/// Lanes of derivatives: heading, rate and the three inputs.
const LANES: usize = 5;

/// Where a body in the plane is and how it moves, the velocity in world axes.
///
/// Its changes have six coordinates: position, velocity, heading, rate.
/// # Units
/// m, m/s, rad, rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarState {
    /// Position of the body origin, world axes, m.
    pub position_world: Vector2<f64>,
    /// Velocity of the body origin, world axes, m/s.
    pub velocity_world: Vector2<f64>,
    /// Angle from the world's to the body's x axis, not wrapped, rad.
    pub heading_rad: f64,
    /// Its rate, rad/s.
    pub rate_rad_s: f64,
}

impl PlanarState {
    /// At this place, at rest.
    pub fn at_rest(position_world: Vector2<f64>, heading_rad: f64) -> Self {
        Self { position_world, velocity_world: Vector2::zeros(), heading_rad, rate_rad_s: 0.0 }
    }

    fn to_coordinates(self) -> [f64; 6] {
        let (p, v) = (self.position_world, self.velocity_world);
        [p.x, p.y, v.x, v.y, self.heading_rad, self.rate_rad_s]
    }

    fn from_coordinates([px, py, vx, vy, heading_rad, rate_rad_s]: [f64; 6]) -> Self {
        let (position_world, velocity_world) = (Vector2::new(px, py), Vector2::new(vx, vy));
        Self { position_world, velocity_world, heading_rad, rate_rad_s }
    }
}

/// A rigid body in the plane, a robot on a granite table, of which the first `P` of mass, moment of inertia about the centre of
/// mass, and centre of mass (x, y) are unknown.
///
/// One step is the classical Runge-Kutta method with the wrench held.
/// # Frame
/// Inputs are `[torque; force]` about the body origin in body axes, whose z axis is the normal of the plane. The origin need
/// not be the centre of mass.
/// # Units
/// Inputs N m, N.
/// # Source
/// Thesis (2.4) in the plane, (6.7), (6.8).
#[derive(Clone, Copy, Debug)]
pub struct PlanarBodyModel<const P: usize> {
    believed: Option<Believed<P>>,
    height_m: f64,
}

/// What is believed: mass, inertia, centre of mass, and the prior standard deviation of the first of them.
#[derive(Clone, Copy, Debug)]
struct Believed<const P: usize> {
    values: [f64; MOST],
    sigma: [f64; P],
}

impl PlanarBodyModel<2> {
    /// Unknown are mass and moment of inertia; the centre of mass is as believed.
    pub fn mass_and_inertia() -> Self {
        Self { believed: None, height_m: 0.0 }
    }
}

impl PlanarBodyModel<MOST> {
    /// Unknown are mass, moment of inertia and centre of mass.
    pub fn full() -> Self {
        Self { believed: None, height_m: 0.0 }
    }
}

impl<const P: usize> PlanarBodyModel<P> {
    /// The same in another plane than that of zero height: for surroundings as they are in space.
    pub fn at_height(self, height_m: f64) -> Self {
        Self { height_m, ..self }
    }

    /// Height of the plane, m.
    pub fn height_m(&self) -> f64 {
        self.height_m
    }
}

/// The step of a body, the change of what it adds along the change `phi` of the start and of parameter `unknown` by `sigma`.
fn drive<const L: usize>(
    values: &[f64; MOST],
    unknown: Option<(usize, f64)>,
    (state, phi): (&PlanarState, &[f64; 6]),
    [torque, fx, fy]: &[f64; 3],
) -> Drive<Lanes<L>> {
    let parameter = |i: usize| {
        let along = unknown.map_or(0.0, |(index, sigma)| if index == i { sigma } else { 0.0 });
        Lanes::variable(values[i], along, LANES)
    };
    let (heading, rate) = (phi[4], phi[5]);
    Drive {
        heading: Lanes::variable(state.heading_rad, heading, 0),
        rate: Lanes::variable(state.rate_rad_s, rate, 1),
        torque: Lanes::variable(*torque, 0.0, 2),
        force: [Lanes::variable(*fx, 0.0, 3), Lanes::variable(*fy, 0.0, 4)],
        mass: parameter(0),
        inertia_about_com: parameter(1),
        center_of_mass: [parameter(2), parameter(3)],
    }
}

/// What position and velocity at the end are beside what is added: the start's, moved on.
fn carried([px, py, vx, vy, heading, rate]: &[f64; 6], step_s: f64) -> [f64; 6] {
    [px + step_s * vx, py + step_s * vy, *vx, *vy, *heading, *rate]
}

fn rows<N: Copy>(gain: &Gain<N>) -> [N; 6] {
    let ([px, py], [vx, vy]) = (gain.position, gain.velocity);
    [px, py, vx, vy, gain.heading, gain.rate]
}

fn end_of<const L: usize>(state: &PlanarState, gain: &Gain<Lanes<L>>, step_s: f64) -> Option<PlanarState> {
    let (carried, gains) = (carried(&state.to_coordinates(), step_s), rows(gain));
    let end: [f64; 6] = core::array::from_fn(|i| carried[i] + gains[i].value);
    let is_finite = end.iter().sum::<f64>().is_finite();
    is_finite.then(|| PlanarState::from_coordinates(end))
}

impl<const P: usize> InformativeModel<6, 3, P> for PlanarBodyModel<P> {
    type State = PlanarState;

    const FIRST_ACTIVE: usize = 4;

    fn retract(&self, state: &PlanarState, change: &[f64; 6]) -> PlanarState {
        let x = state.to_coordinates();
        PlanarState::from_coordinates(core::array::from_fn(|i| x[i] + change[i]))
    }

    fn difference(&self, to: &PlanarState, from: &PlanarState) -> [f64; 6] {
        let (to, from) = (to.to_coordinates(), from.to_coordinates());
        core::array::from_fn(|i| to[i] - from[i])
    }

    fn adopt(&mut self, belief: &ModelBelief) -> Result<Knowledge<P>, PlanningError> {
        let (covariance, sizes) = (covariance_about_com(belief)?, sizes_about_com(belief.parameters()));
        let place = |i: usize| PLACES.get(i).copied().unwrap_or_default();
        let knowledge = Knowledge::of_covariance(
            &SMatrix::from_fn(|i, j| covariance[(place(i), place(j))]),
            &core::array::from_fn(|i| sizes[place(i)]),
            core::array::from_fn(|i| QUANTITIES[place(i)].0),
            core::array::from_fn(|i| QUANTITIES[place(i)].1),
        )?;
        let body = belief.parameters();
        let (com, inertia) = (body.center_of_mass(), body.inertia_about_com().m33);
        self.believed = Some(Believed { values: [body.mass, inertia, com.x, com.y], sigma: knowledge.scales() });
        Ok(knowledge)
    }

    /// The heading error is the one of less than half a turn.
    fn residual(&self, state: &PlanarState, reference: &PlanarState) -> ([f64; 6], Array2<6, 6>) {
        let mut residual = self.difference(state, reference);
        residual[4] = libm::remainder(residual[4], TAU);
        (residual, core::array::from_fn(|i| core::array::from_fn(|j| if i == j { 1.0 } else { 0.0 })))
    }

    fn kinematics(&self, state: &PlanarState) -> Kinematics {
        let attitude = <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::new(0.0, 0.0, state.heading_rad));
        Kinematics {
            world_from_body: Pose::from_parts(state.position_world.push(self.height_m).into(), attitude),
            velocity_world: state.velocity_world.push(0.0),
            rate_body: Vector3::new(0.0, 0.0, state.rate_rad_s),
        }
    }

    fn kinematics_by_state(&self, _state: &PlanarState) -> Array2<KINEMATICS, 6> {
        let mut by_state = [[0.0; 6]; KINEMATICS];
        for (row, column) in [(0, 0), (1, 1), (3, 2), (4, 3), (8, 4), (11, 5)] {
            by_state[row][column] = 1.0;
        }
        by_state
    }

    fn acceleration_by_input(&self) -> Array2<6, 3> {
        let mut by_input = [[0.0; 3]; 6];
        if let Some(Believed { values: [mass, inertia, cx, cy], .. }) = self.believed {
            let turning = [1.0 / inertia, cy / inertia, -cx / inertia];
            for (column, turning) in turning.into_iter().enumerate() {
                by_input[0][column] = turning * cy;
                by_input[1][column] = -turning * cx;
                by_input[5][column] = turning;
            }
            by_input[0][1] += 1.0 / mass;
            by_input[1][2] += 1.0 / mass;
        }
        by_input
    }

    fn center_of_mass_m(&self) -> f64 {
        self.believed.map_or(0.0, |Believed { values: [_, _, x, y], .. }| f64::sqrt(x * x + y * y))
    }

    fn step(
        &self,
        state: &PlanarState,
        sensitivity: &Array2<P, 6>,
        input: &[f64; 3],
        step_s: f64,
    ) -> Option<(PlanarState, Array2<P, 6>)> {
        let Believed { values, sigma } = self.believed.as_ref()?;
        let still = drive(values, None, (state, &[0.0; 6]), input);
        let turns = Turns::of(&still, step_s);
        let end = end_of(state, &gain(&still, &turns, step_s), step_s)?;
        let sensitivity = core::array::from_fn(|c| {
            let phi = &sensitivity[c];
            let moving = drive::<0>(values, Some((c, sigma[c])), (state, phi), input);
            let (carried, gains) = (carried(phi, step_s), rows(&gain(&moving, &turns, step_s)));
            core::array::from_fn(|i| carried[i] + gains[i].along)
        });
        Some((end, sensitivity))
    }

    fn differentiate(
        &self,
        state: &PlanarState,
        sensitivity: &Array2<P, 6>,
        input: &[f64; 3],
        step_s: f64,
        derivatives: &mut StepDerivatives<6, 3, P>,
    ) -> Option<(PlanarState, Array2<P, 6>)> {
        let Believed { values, sigma } = self.believed.as_ref()?;
        let still = drive(values, None, (state, &[0.0; 6]), input);
        let turns = Turns::of(&still, step_s);
        let gains = gain(&drive::<LANES>(values, None, (state, &[0.0; 6]), input), &turns, step_s);
        let end = end_of(state, &gains, step_s)?;
        for (i, gain) in rows(&gains).into_iter().enumerate() {
            let [heading, rate, torque, fx, fy] = gain.each;
            let row = &mut derivatives.by_state[i];
            *row = [0.0, 0.0, 0.0, 0.0, heading, rate];
            row[i] += 1.0;
            derivatives.by_input[i] = [torque, fx, fy];
        }
        derivatives.by_state[0][2] = step_s;
        derivatives.by_state[1][3] = step_s;
        let sensitivity = core::array::from_fn(|c| {
            let phi = &sensitivity[c];
            let moving = drive::<LANES>(values, Some((c, sigma[c])), (state, phi), input);
            let (carried, gains) = (carried(phi, step_s), rows(&gain(&moving, &turns, step_s)));
            for (i, gain) in gains.iter().enumerate() {
                let [heading, rate, torque, fx, fy] = gain.mixed;
                derivatives.sensitivity_by_state[c][i] = [0.0, 0.0, 0.0, 0.0, heading, rate];
                derivatives.sensitivity_by_input[c][i] = [torque, fx, fy];
            }
            core::array::from_fn(|i| carried[i] + gains[i].along)
        });
        Some((end, sensitivity))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use tumble_dynamics::{InertialParameters, PlanarBody, PlanarWrench};

    const VALUES: [f64; 4] = [9.5, 0.16, 0.02, -0.03];
    const SIGMA: [f64; 4] = [1.0, 0.02, 0.01, 0.015];

    /// A belief whose covariance of mass, inertia and centre of mass is diagonal.
    fn belief([mass, inertia, cx, cy]: [f64; 4], scale: f64) -> ModelBelief {
        let about_com = Matrix3::from_diagonal(&Vector3::new(0.13, 0.15, inertia));
        let body = InertialParameters::about_com(mass, Vector3::new(cx, cy, 0.05), about_com);
        let mut covariance = SMatrix::<f64, 10, 10>::identity() * 1e-4;
        for (place, sigma) in PLACES.into_iter().zip(SIGMA) {
            covariance[(place, place)] = sigma * sigma;
        }
        let by_about_com = crate::local::body_by_mass_center_and_inertia(&body);
        let mut belief = ModelBelief::certain(1, body);
        belief.estimate.covariance = by_about_com * covariance * by_about_com.transpose() * (scale * scale);
        belief
    }

    fn full() -> PlanarBodyModel<4> {
        let mut model = PlanarBodyModel::full();
        let knowledge = model.adopt(&belief(VALUES, 1.0)).unwrap();
        assert!(knowledge.scales().iter().zip(SIGMA).all(|(found, sigma)| (found / sigma - 1.0).abs() < 1e-12));
        assert!((knowledge.information - SMatrix::identity()).amax() < 1e-10);
        model
    }

    fn input(k: u32) -> [f64; 3] {
        let k = f64::from(k);
        [0.02 * (0.5 * k + 1.0).sin(), 0.3 * (0.4 * k).sin(), 0.25 * (0.3 * k).cos()]
    }

    /// Trajectory, sensitivity and Fisher information of the reference equations, section f.
    #[test]
    fn golden_information() {
        let model = full();
        let mut state = PlanarState::at_rest(Vector2::zeros(), 0.0);
        let mut phi = [[0.0; 6]; 4];
        let mut information = SMatrix::<f64, 4, 4>::zeros();
        let sigma = [0.01, 0.01, 0.005, 0.005, 0.01, 0.005];
        for k in 0..40 {
            (state, phi) = model.step(&state, &phi, &input(k), 0.1).unwrap();
            let rows = SMatrix::<f64, 4, 6>::from_fn(|c, i| phi[c][i] / SIGMA[c] / sigma[i]);
            information += rows * rows.transpose();
        }
        let golden = [
            0.030_192_862_605,
            0.006_682_977_270,
            0.015_442_937_978,
            -0.003_994_473_825,
            0.010_441_532_053,
            0.003_993_896_108,
        ];
        for (found, golden) in state.to_coordinates().into_iter().zip(golden) {
            assert!((found - golden).abs() < 6e-13, "{found} {golden}");
        }
        let heading = [0.0, -6.525_957_532_904e-2, -3.530_712_717_385e-1, 1.837_506_434_312];
        for (c, golden) in heading.into_iter().enumerate() {
            assert!(
                (phi[c][4] / SIGMA[c] - golden).abs() < 6e-13 * golden.abs().max(0.1),
                "{c} {}",
                phi[c][4] / SIGMA[c]
            );
        }
        let covariance = information.try_inverse().unwrap().diagonal();
        let golden = [0.251_443_261_988_1, 2.492_687_259_680e-5, 4.673_987_862_769e-6, 1.401_217_165_137e-6];
        for (found, golden) in covariance.iter().zip(golden) {
            assert!((found / golden - 1.0).abs() < 3e-12, "{found} {golden}");
        }
    }

    fn samples() -> [(PlanarState, [f64; 3]); 3] {
        let state = |position: [f64; 2], velocity: [f64; 2], heading_rad, rate_rad_s| PlanarState {
            position_world: position.into(),
            velocity_world: velocity.into(),
            heading_rad,
            rate_rad_s,
        };
        [
            (state([0.3, -0.2], [0.05, 0.1], 2.5, 0.4), [0.03, -0.2, 0.15]),
            (state([-1.3, 4.0], [-0.3, 0.2], -0.7, -1.1), [-0.02, 0.4, 0.3]),
            (PlanarState::at_rest(Vector2::zeros(), 0.0), [0.0; 3]),
        ]
    }

    /// Another formulation: the body of `dynamics`, stepped as coordinates.
    #[test]
    fn the_step_is_the_classical_one() {
        let body = PlanarBody { mass: 9.5, inertia_about_com: 0.16, center_of_mass: Vector2::new(0.02, -0.03) };
        let (model, h) = (full(), 0.5);
        for (state, [torque, fx, fy]) in samples() {
            let wrench = PlanarWrench { torque, force: Vector2::new(fx, fy) };
            let field = |x: &SMatrix<f64, 6, 1>| {
                let acceleration = body.forward(x[5], &wrench);
                let (sin, cos) = x[4].sin_cos();
                let a = acceleration.acceleration_origin_body;
                let (ax, ay) = (cos * a.x - sin * a.y, sin * a.x + cos * a.y);
                SMatrix::<f64, 6, 1>::from([x[2], x[3], ax, ay, x[5], acceleration.angular_acceleration])
            };
            let x = SMatrix::<f64, 6, 1>::from(state.to_coordinates());
            let k1 = field(&x);
            let k2 = field(&(x + k1 * (h / 2.0)));
            let k3 = field(&(x + k2 * (h / 2.0)));
            let k4 = field(&(x + k3 * h));
            let expected = x + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
            let (end, _) = model.step(&state, &[[0.0; 6]; 4], &[torque, fx, fy], h).unwrap();
            assert!((expected - SMatrix::from(end.to_coordinates())).amax() < 1e-14);
        }
    }

    #[test]
    fn only_the_first_parameters_are_unknown_to_the_smaller_model() {
        let mut small = PlanarBodyModel::<2>::mass_and_inertia();
        let knowledge = small.adopt(&belief(VALUES, 1.0)).unwrap();
        assert_eq!(knowledge.names, ["mass", "inertia_zz"]);
        let phi = core::array::from_fn(|c| core::array::from_fn(|i| libm::sin(1.0 + 2.3 * (6 * c + i) as f64)));
        for (state, input) in samples() {
            let (end, large) = full().step(&state, &phi, &input, 0.5).unwrap();
            assert_eq!(small.step(&state, &[phi[0], phi[1]], &input, 0.5), Some((end, [large[0], large[1]])));
        }
    }

    #[test]
    fn a_model_without_a_body_has_no_step() {
        let ((state, input), phi) = (samples()[0], [[0.0; 6]; 4]);
        assert_eq!(PlanarBodyModel::full().step(&state, &phi, &input, 0.5), None);
        let nowhere = PlanarState { heading_rad: f64::INFINITY, ..state };
        assert_eq!(full().step(&nowhere, &phi, &input, 0.5), None);
        // what is known exactly keeps a finite information
        let certain = ModelBelief::certain(1, *belief(VALUES, 1.0).parameters());
        let knowledge = PlanarBodyModel::full().adopt(&certain).unwrap();
        assert_eq!(knowledge.information, SMatrix::<f64, 4, 4>::identity());
        assert!((knowledge.scales()[0] - 9.5e-6).abs() < 1e-20);
    }

    #[test]
    fn whole_turns_are_no_error() {
        let state = PlanarState::at_rest(Vector2::zeros(), 3.0 * TAU + 0.1);
        let (residual, _) = full().residual(&state, &PlanarState::at_rest(Vector2::zeros(), -0.2));
        assert!((residual[4] - 0.3).abs() < 1e-14);
    }
}
