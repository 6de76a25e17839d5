//! What the local planner asks of a robot: steps, and how their ends change with everything.

use crate::belief::ModelBelief;
use crate::error::PlanningError;
use core::fmt::Debug;
use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};
use tumble_dynamics::RigidBodyState;
use tumble_lie::{Manifold, Pose, Scalar, Twist, real};

/// `R` rows of `C` numbers, row after row: what kernels loop over.
pub type Array2<const R: usize, const C: usize> = [[f64; C]; R];

/// Number of coordinates of a change of [`Kinematics`]: position and velocity in world axes, attitude (a right increment)
/// and rate in body axes; m, m/s, rad, rad/s.
pub const KINEMATICS: usize = 12;

/// Where a body is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics<T: Scalar = f64> {
    /// Pose, `world_from_body`.
    pub world_from_body: Pose<T>,
    /// Velocity of the origin, world axes, m/s.
    pub velocity_world: Vector3<T>,
    /// Angular velocity, body axes, rad/s.
    pub rate_body: Vector3<T>,
}

impl Kinematics {
    /// At this pose, at rest.
    pub fn at_rest(world_from_body: Pose<f64>) -> Self {
        Self { world_from_body, velocity_world: Vector3::zeros(), rate_body: Vector3::zeros() }
    }

    /// Position of the origin, world axes, m.
    pub fn position_world(&self) -> Vector3<f64> {
        self.world_from_body.translation.vector
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        let pose = &self.world_from_body;
        let vectors = pose.translation.vector.sum() + self.velocity_world.sum() + self.rate_body.sum();
        (vectors + pose.rotation.coords.sum()).is_finite()
    }

    /// The same motion over another scalar, with zero derivatives.
    pub fn lifted<T: Scalar>(&self) -> Kinematics<T> {
        Kinematics {
            world_from_body: nalgebra::convert(self.world_from_body),
            velocity_world: self.velocity_world.map(real),
            rate_body: self.rate_body.map(real),
        }
    }
}

impl From<&RigidBodyState<f64>> for Kinematics {
    fn from(state: &RigidBodyState<f64>) -> Self {
        let RigidBodyState { world_from_body, twist_body } = *state;
        let velocity_world = world_from_body.rotation * twist_body.linear;
        Self { world_from_body, velocity_world, rate_body: twist_body.angular }
    }
}

impl From<&Kinematics> for RigidBodyState<f64> {
    fn from(motion: &Kinematics) -> Self {
        let linear = motion.world_from_body.rotation.inverse() * motion.velocity_world;
        Self { world_from_body: motion.world_from_body, twist_body: Twist::new(motion.rate_body, linear) }
    }
}

impl<T: Scalar> Manifold for Kinematics<T> {
    type Scalar = T;
    /// In the order of [`KINEMATICS`].
    type Tangent = SVector<T, KINEMATICS>;
    fn oplus(&self, xi: &Self::Tangent) -> Self {
        let [position, velocity, attitude, rate] = [0, 3, 6, 9].map(|row| xi.fixed_rows::<3>(row).into_owned());
        let pose = &self.world_from_body;
        Self {
            world_from_body: Pose::from_parts(
                (pose.translation.vector + position).into(),
                pose.rotation.oplus(&attitude),
            ),
            velocity_world: self.velocity_world + velocity,
            rate_body: self.rate_body + rate,
        }
    }
    fn ominus(&self, base: &Self) -> Self::Tangent {
        let (pose, from) = (&self.world_from_body, &base.world_from_body);
        let mut xi = Self::Tangent::zeros();
        xi.fixed_rows_mut::<3>(0).copy_from(&(pose.translation.vector - from.translation.vector));
        xi.fixed_rows_mut::<3>(3).copy_from(&(self.velocity_world - base.velocity_world));
        xi.fixed_rows_mut::<3>(6).copy_from(&pose.rotation.ominus(&from.rotation));
        xi.fixed_rows_mut::<3>(9).copy_from(&(self.rate_body - base.rate_body));
        xi
    }
    fn increment_rate(xi: &Self::Tangent, velocity: &Self::Tangent) -> Self::Tangent {
        let mut rate = *velocity;
        let [attitude, turning] = [xi, velocity].map(|v| v.fixed_rows::<3>(6).into_owned());
        rate.fixed_rows_mut::<3>(6).copy_from(&UnitQuaternion::increment_rate(&attitude, &turning));
        rate
    }
}

/// Derivatives of one step; every increment is a right one at the state it belongs to.
///
/// A step takes a state `x`, its sensitivities `phi_c = dx / d eta_c` to the parameters' coordinates, and an input `u` to
/// the next state and `phi_c' = A phi_c + E_c`.
#[derive(Clone, Debug, PartialEq)]
pub struct StepDerivatives<const X: usize, const U: usize, const P: usize> {
    /// `A`, row by row: change of the end by change of the start.
    pub by_state: Array2<X, X>,
    /// Change of the end by the input.
    pub by_input: Array2<X, U>,
    /// For each coordinate `c`: change of `phi_c'` by change of the start, with the numbers of `phi_c` held.
    pub sensitivity_by_state: [Array2<X, X>; P],
    /// For each coordinate `c`: change of `phi_c'` by the input.
    pub sensitivity_by_input: [Array2<X, U>; P],
}

impl<const X: usize, const U: usize, const P: usize> StepDerivatives<X, U, P> {
    /// All zero.
    pub fn zeros() -> Self {
        Self {
            by_state: [[0.0; X]; X],
            by_input: [[0.0; U]; X],
            sensitivity_by_state: [[[0.0; X]; X]; P],
            sensitivity_by_input: [[[0.0; U]; X]; P],
        }
    }
}

/// What is known of the parameters before the plan, in the model's coordinates `eta`, which are zero at the belief.
#[derive(Clone, Debug, PartialEq)]
pub struct Knowledge<const P: usize> {
    /// Information about the coordinates: the inverse of their covariance, positive definite.
    pub information: SMatrix<f64, P, P>,
    /// Change of the quantities of interest by the coordinates. Quantities may be weighted; nuisances are quantities too.
    pub quantities: SMatrix<f64, P, P>,
    /// Names of the quantities.
    pub names: [&'static str; P],
    /// Their units.
    pub units: [&'static str; P],
}

/// A robot that plans are made for: `X` coordinates of a change of its state, `U` inputs, `P` unknown parameters (nuisances
/// such as actuator scales included).
///
/// # Laws
/// `laws::check_informative_model`: the derivatives are those of the step.
///
/// # Example
/// ```
/// use tumble_planning::ModelBelief;
/// use tumble_planning::dynamics::InertialParameters;
/// use tumble_planning::local::{InformativeModel, PlanarBodyModel, PlanarState};
///
/// let mut robot = PlanarBodyModel::mass_and_inertia();
/// let knowledge = robot.adopt(&ModelBelief::vague(1, InertialParameters::solid_box(10.0, [0.3; 3]), [0.1, 0.0, 0.1]))?;
/// assert_eq!(knowledge.names[0], "mass");
///
/// // What a second of 1 N shows of the mass: the speed changes by -F / m^2 dt times its standard deviation of 1 kg.
/// let start = PlanarState::at_rest(Default::default(), 0.0);
/// let (end, sensitivity) = robot.step(&start, &[[0.0; 6]; 2], &[0.0, 1.0, 0.0], 1.0).ok_or("no such state")?;
/// assert!((end.velocity_world.x - 0.1).abs() < 1e-12 && (sensitivity[0][2] + 0.01).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
/// Tutorial: [a robot of your own, without a derivative written](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_informative_model.rs);
/// [with them](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/cart/mod.rs).
pub trait InformativeModel<const X: usize, const U: usize, const P: usize> {
    /// A state.
    type State: Clone + Debug + PartialEq;

    /// Derivatives depend on the start of a step only through its coordinates from this one on, and no step takes a change of
    /// the coordinates before it into one of those from it on: positions and velocities in space. Zero is always right.
    const FIRST_ACTIVE: usize = 0;

    /// The state that a change leads to: a right increment.
    fn retract(&self, state: &Self::State, change: &[f64; X]) -> Self::State;

    /// The change that leads from one state to another, the inverse of [`InformativeModel::retract`].
    fn difference(&self, to: &Self::State, from: &Self::State) -> [f64; X];

    /// Takes the body for what is believed from now on, and says how well it is known.
    ///
    /// # Errors
    /// A belief that is not a body, or whose covariance is none.
    fn adopt(&mut self, belief: &ModelBelief) -> Result<Knowledge<P>, PlanningError>;

    /// Tracking error of a state from a reference and its change with the state: zero at the reference.
    fn residual(&self, state: &Self::State, reference: &Self::State) -> ([f64; X], Array2<X, X>);

    /// The motion of the body in this state.
    fn kinematics(&self, state: &Self::State) -> Kinematics;

    /// The change of [`InformativeModel::kinematics`] by the change of the state.
    fn kinematics_by_state(&self, state: &Self::State) -> Array2<KINEMATICS, X>;

    /// The acceleration that a unit of each input gives the resting body: of the origin in body axes, and angular in body axes,
    /// m/s^2 and rad/s^2.
    fn acceleration_by_input(&self) -> Array2<6, U>;

    /// Distance of the centre of mass from the origin, m.
    fn center_of_mass_m(&self) -> f64 {
        0.0
    }

    /// Principal moments of inertia about the centre of mass, in any order; `None` where the body turns about one axis only, so
    /// that its rate changes by torques alone.
    fn principal_moments(&self) -> Option<Vector3<f64>> {
        None
    }

    /// Step of state and sensitivities, one row per parameter; `None` where there is no such state.
    fn step(
        &self,
        state: &Self::State,
        sensitivity: &Array2<P, X>,
        input: &[f64; U],
        step_s: f64,
    ) -> Option<(Self::State, Array2<P, X>)>;

    /// The same with the derivatives, all of which are written.
    fn differentiate(
        &self,
        state: &Self::State,
        sensitivity: &Array2<P, X>,
        input: &[f64; U],
        step_s: f64,
        derivatives: &mut StepDerivatives<X, U, P>,
    ) -> Option<(Self::State, Array2<P, X>)>;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vector(seed: f64) -> SVector<f64, KINEMATICS> {
        SVector::from_fn(|i, _| libm::sin(seed + 1.7 * f64::from(u8::try_from(i).unwrap_or(0))))
    }

    #[test]
    fn changes_of_a_motion_are_right_increments_in_their_order() {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -0.9, 0.2));
        let from = Kinematics {
            world_from_body: Pose::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), rotation),
            velocity_world: Vector3::new(0.1, 0.2, 0.3),
            rate_body: Vector3::new(-0.1, 0.3, 0.2),
        };
        let xi = vector(0.3);
        let to = from.oplus(&xi);
        assert!((to.ominus(&from) - xi).amax() < 1e-14);
        let world = |row: usize| Vector3::new(xi[row], xi[row + 1], xi[row + 2]);
        let moved = to.world_from_body.translation.vector - from.world_from_body.translation.vector;
        assert!((moved - world(0)).amax() < 1e-15);
        assert!((to.velocity_world - from.velocity_world - world(3)).amax() < 1e-15);
        let turned = rotation * UnitQuaternion::from_scaled_axis(world(6));
        assert!(to.world_from_body.rotation.angle_to(&turned) < 1e-7);
        assert!((to.rate_body - from.rate_body - world(9)).amax() < 1e-15);

        let (velocity, width) = (vector(2.0), 1e-5);
        let rate = Kinematics::increment_rate(&xi, &velocity);
        let along = |t: f64| from.oplus(&(xi + rate * t)).ominus(&to);
        let quotient = (along(width) - along(-width)) / (2.0 * width);
        assert!((quotient - velocity).amax() < 1e-9, "{quotient}");
    }

    #[test]
    fn a_motion_comes_back_from_the_body_axes() {
        let motion = Kinematics {
            world_from_body: Pose::from_parts(
                Vector3::new(1.0, -2.0, 0.5).into(),
                UnitQuaternion::from_euler_angles(0.3, -1.1, 2.0),
            ),
            velocity_world: Vector3::new(0.1, 0.2, -0.3),
            rate_body: Vector3::new(0.4, -0.5, 0.6),
        };
        let body: RigidBodyState<f64> = (&motion).into();
        // the speed is the same in all axes, its components are not
        assert!((body.twist_body.linear.norm_squared() - motion.velocity_world.norm_squared()).abs() < 1e-16);
        assert!((body.twist_body.linear - motion.velocity_world).amax() > 0.1);
        let back = Kinematics::from(&body);
        assert!((back.velocity_world - motion.velocity_world).amax() < 1e-15);
        assert_eq!((back.world_from_body, back.rate_body), (motion.world_from_body, motion.rate_body));
        assert_eq!(Kinematics::at_rest(body.world_from_body).velocity_world, Vector3::zeros());
    }
}
