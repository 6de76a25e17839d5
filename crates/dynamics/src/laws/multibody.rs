//! Laws of trees of rigid bodies.
//!
//! Motion is differentiated by dual numbers: energy, momentum and kinematics of the tree one step of `epsilon` along the
//! motion give what power, external wrench and Jacobian must be, without any recursion under test.

use crate::error::DynamicsError;
use crate::free_flyer::BodyAcceleration;
use crate::laws::{LawViolation, require};
use crate::multibody::{
    Fixed, GeneralizedAcceleration, GeneralizedForce, GeneralizedMotion, MassMatrix, MomentumRegressor, Multibody,
    ToolJacobian, TorqueRegressor,
};
use num_dual::Dual64;
use tumble_lie::nalgebra::{SVector, Vector3, Vector6, convert};
use tumble_lie::{Manifold, Pose, Twist, Wrench, real};

type Tree<const J: usize> = Multibody<f64, Fixed<J>>;
type Outcome<X> = Result<X, DynamicsError>;

/// A tree in motion, free of gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeMotion<const J: usize> {
    /// Pose of the base.
    pub world_from_base: Pose<f64>,
    /// Twist of the base origin, base axes.
    pub base_twist: Twist<f64>,
    /// Acceleration of the base.
    pub base_acceleration: BodyAcceleration<f64>,
    /// Joint positions, rad or m.
    pub positions: [f64; J],
    /// Joint rates.
    pub rates: [f64; J],
    /// Joint accelerations.
    pub accelerations: [f64; J],
    /// A point of the last body, its frame, m.
    pub tool_body: Vector3<f64>,
}

impl<const J: usize> TreeMotion<J> {
    /// As the dynamics take it.
    pub fn generalized(&self) -> GeneralizedMotion<'_, f64> {
        GeneralizedMotion {
            base_twist: self.base_twist,
            base_acceleration: self.base_acceleration,
            positions: &self.positions,
            rates: &self.rates,
            accelerations: &self.accelerations,
        }
    }
}

/// The operations under test; the default is this crate's, replace those that are yours.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::type_complexity, reason = "the signatures of the operations")]
pub struct TreeOperations<const J: usize> {
    /// Forces that give a motion.
    pub inverse_dynamics: fn(&Tree<J>, &GeneralizedMotion<'_, f64>) -> Outcome<GeneralizedForce<f64, Fixed<J>>>,
    /// The motion that forces give: twist of the base, positions, rates, forces.
    pub forward_dynamics: fn(
        &Tree<J>,
        &Twist<f64>,
        &[f64],
        &[f64],
        &GeneralizedForce<f64, Fixed<J>>,
    ) -> Outcome<GeneralizedAcceleration<f64, Fixed<J>>>,
    /// The generalised inertia.
    pub mass_matrix: fn(&Tree<J>, &[f64]) -> Outcome<MassMatrix<f64, Fixed<J>>>,
    /// Jacobian of a point of a body.
    pub tool_jacobian: fn(&Tree<J>, &[f64], usize, &Vector3<f64>) -> Outcome<ToolJacobian<f64, Fixed<J>>>,
    /// Momentum about the inertial origin.
    pub spatial_momentum: fn(&Tree<J>, &Pose<f64>, &Twist<f64>, &[f64], &[f64]) -> Outcome<Wrench<f64>>,
    /// The regressor of the inverse dynamics.
    pub torque_regressor: fn(&Tree<J>, &GeneralizedMotion<'_, f64>) -> Outcome<TorqueRegressor<f64, Fixed<J>>>,
    /// The regressor of the momentum.
    pub momentum_regressor:
        fn(&Tree<J>, &Pose<f64>, &Twist<f64>, &[f64], &[f64]) -> Outcome<MomentumRegressor<f64, Fixed<J>>>,
    /// Twist of a floating base with this momentum about its origin: positions, rates, momentum.
    pub floating_base_twist: fn(&Tree<J>, &[f64], &[f64], &Wrench<f64>) -> Outcome<Twist<f64>>,
}

impl<const J: usize> Default for TreeOperations<J> {
    fn default() -> Self {
        Self {
            inverse_dynamics: Tree::inverse_dynamics,
            forward_dynamics: Tree::forward_dynamics,
            mass_matrix: Tree::mass_matrix,
            tool_jacobian: Tree::tool_jacobian,
            spatial_momentum: Tree::spatial_momentum,
            torque_regressor: Tree::torque_regressor,
            momentum_regressor: Tree::momentum_regressor,
            floating_base_twist: Tree::floating_base_twist,
        }
    }
}

/// A motion an instant later: values with their rates as derivatives.
struct Moving<const J: usize> {
    tree: Multibody<Dual64, Fixed<J>>,
    pose: Pose<Dual64>,
    twist: Twist<Dual64>,
    positions: [Dual64; J],
    rates: [Dual64; J],
}

impl<const J: usize> Moving<J> {
    fn of(tree: &Tree<J>, motion: &TreeMotion<J>) -> Self {
        let epsilon = Dual64::new(0.0, 1.0);
        let both = |values: [f64; J], rates: [f64; J]| core::array::from_fn(|i| Dual64::new(values[i], rates[i]));
        let lifted = |v: Vector6<f64>| v.map(real::<Dual64>);
        let twist = motion.base_twist.to_vector();
        let twist_rate = motion.base_acceleration.twist_rate_body(&motion.base_twist).to_vector();
        Self {
            tree: tree.lifted(),
            pose: convert::<Pose<f64>, Pose<Dual64>>(motion.world_from_base).oplus(&(lifted(twist) * epsilon)),
            twist: Twist::from(lifted(twist) + lifted(twist_rate) * epsilon),
            positions: both(motion.positions, motion.rates),
            rates: both(motion.rates, motion.accelerations),
        }
    }
}

fn slopes(v: &Vector6<Dual64>) -> Vector6<f64> {
    v.map(|x| x.eps)
}

fn broken(law: &'static str, inputs: &dyn core::fmt::Debug, error: &DynamicsError) -> LawViolation {
    let (inputs, found) = (format!("{inputs:?}"), error.to_string());
    LawViolation { law, inputs, expected: "a value".into(), found, error: f64::INFINITY, tolerance: 0.0 }
}

/// Power, momentum, energy, kinematics, regressors and floating of a tree in these motions, all without springs and dampers
/// in the power (they are added back); `tolerance` is relative to the sizes that occur.
///
/// # Errors
/// The first broken law.
pub fn check_multibody<const J: usize>(
    operations: &TreeOperations<J>,
    tree: &Tree<J>,
    motions: &[TreeMotion<J>],
    tolerance: f64,
) -> Result<(), LawViolation> {
    for motion in motions {
        check_motion(operations, tree, motion, tolerance)?;
    }
    Ok(())
}

fn check_motion<const J: usize>(
    operations: &TreeOperations<J>,
    tree: &Tree<J>,
    motion: &TreeMotion<J>,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let inputs = (tree, motion);
    let of = |law: &'static str| move |error| broken(law, &inputs, &error);
    let zeta: Vec<f64> = motion.base_twist.to_vector().iter().chain(&motion.rates).copied().collect();
    let moving = Moving::of(tree, motion);
    let listed = |force: &GeneralizedForce<f64, Fixed<J>>| -> Vec<f64> {
        force.base.to_vector().iter().chain(&force.joints).copied().collect()
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let size = |list: &[f64]| list.iter().fold(1e-300_f64, |largest, x| largest.max(x.abs()));
    let compare = |law: &'static str, expected: &[f64], found: &[f64]| {
        let scale = size(expected).max(size(found)).max(1e-3);
        let error = expected.iter().zip(found).map(|(a, b)| (a - b).abs()).fold(0.0_f64, f64::max);
        let error = if found.iter().all(|x| x.is_finite()) { error / scale } else { f64::INFINITY };
        require(law, &inputs, &expected, &found, error, tolerance)
    };

    let force = (operations.inverse_dynamics)(tree, &motion.generalized()).map_err(of("inverse dynamics"))?;
    let passive: Vec<f64> = tree
        .links()
        .iter()
        .enumerate()
        .map(|(i, link)| link.joint.passive_force(motion.positions[i], motion.rates[i]))
        .collect();
    let mut active = force.clone();
    for (joint, passive) in active.joints.iter_mut().zip(&passive) {
        *joint += passive;
    }

    let energy = moving.tree.kinetic_energy(&moving.twist, &moving.positions, &moving.rates).map_err(of("power"))?;
    let (rate, power) = (energy.eps, dot(&listed(&active), &zeta));
    let scale = listed(&active).iter().zip(&zeta).map(|(f, v)| (f * v).abs()).sum::<f64>().max(1e-3);
    require("power", &inputs, &rate, &power, (rate - power).abs() / scale, tolerance)?;

    let momentum = moving
        .tree
        .spatial_momentum(&moving.pose, &moving.twist, &moving.positions, &moving.rates)
        .map_err(of("momentum balance"))?
        .to_vector();
    let external = force.base.transformed_by(&motion.world_from_base).to_vector();
    compare("momentum balance", slopes(&momentum).as_slice(), external.as_slice())?;
    let own = (operations.spatial_momentum)(
        tree,
        &motion.world_from_base,
        &motion.base_twist,
        &motion.positions,
        &motion.rates,
    );
    let own = own.map_err(of("momentum"))?.to_vector();
    compare("momentum", momentum.map(|x| x.re).as_slice(), own.as_slice())?;

    let back = (operations.forward_dynamics)(tree, &motion.base_twist, &motion.positions, &motion.rates, &force);
    let back = back.map_err(of("forward undoes inverse"))?;
    let flat = |base: &BodyAcceleration<f64>, joints: &[f64]| -> Vec<f64> {
        let halves = base.angular_acceleration_body.iter().chain(&base.acceleration_origin_body);
        halves.chain(joints).copied().collect()
    };
    compare(
        "forward undoes inverse",
        &flat(&motion.base_acceleration, &motion.accelerations),
        &flat(&back.base, &back.joints),
    )?;

    let mass_matrix = (operations.mass_matrix)(tree, &motion.positions).map_err(of("mass matrix"))?;
    let entry = |i: usize, j: usize| mass_matrix.get(i, j).unwrap_or(f64::NAN);
    let image: Vec<f64> = (0..6 + J).map(|i| (0..6 + J).map(|j| entry(i, j) * zeta[j]).sum()).collect();
    compare("mass matrix", &[2.0 * energy.re], &[dot(&image, &zeta)])?;
    let still = TreeMotion { base_twist: Twist::zero(), rates: [0.0; J], ..*motion };
    let mut from_rest = tree.inverse_dynamics(&still.generalized()).map_err(of("mass matrix columns"))?;
    for ((joint, link), position) in from_rest.joints.iter_mut().zip(tree.links()).zip(&motion.positions) {
        *joint += link.joint.passive_force(*position, 0.0);
    }
    let wanted = flat(&motion.base_acceleration, &motion.accelerations);
    let image: Vec<f64> = (0..6 + J).map(|i| (0..6 + J).map(|j| entry(i, j) * wanted[j]).sum()).collect();
    compare("mass matrix columns", &listed(&from_rest), &image)?;

    let jacobian = (operations.tool_jacobian)(tree, &motion.positions, J, &motion.tool_body).map_err(of("tool"))?;
    let placements = moving.tree.placements(&moving.positions).map_err(of("tool"))?;
    if let Some(base_from_body) = placements.base_from_body(J) {
        let world_from_body = moving.pose * base_from_body;
        let tool = world_from_body.rotation * motion.tool_body.map(real::<Dual64>) + world_from_body.translation.vector;
        let velocity = motion.world_from_base.rotation.inverse_transform_vector(&tool.map(|x| x.eps));
        let twist = jacobian.twist(&motion.base_twist, &motion.rates);
        compare("tool velocity", velocity.as_slice(), twist.linear.as_slice())?;
        let unit = Wrench::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(-0.4, 0.6, 0.1));
        let work = dot(&listed(&jacobian.generalized_force(&unit)), &zeta);
        compare("virtual work", &[twist.power(&unit)], &[work])?;
    }

    let parameters: Vec<SVector<f64, 10>> =
        (0..=J).filter_map(|body| tree.body(body)).map(crate::InertialParameters::to_vector).collect();
    let regressor = (operations.torque_regressor)(tree, &motion.generalized()).map_err(of("torque regressor"))?;
    let mut linear: Vec<f64> = (0..6 + J)
        .map(|row| {
            let blocks = parameters.iter().enumerate().filter_map(|(body, p)| Some((regressor.block(row, body)?, p)));
            blocks.map(|(block, p)| dot(&block, p.as_slice())).sum()
        })
        .collect();
    for (i, link) in tree.links().iter().enumerate() {
        linear[6 + i] += link.joint.rotor_inertia * motion.accelerations[i];
    }
    compare("torque regressor", &listed(&active), &linear)?;
    let regressor = (operations.momentum_regressor)(
        tree,
        &motion.world_from_base,
        &motion.base_twist,
        &motion.positions,
        &motion.rates,
    );
    let regressor = regressor.map_err(of("momentum regressor"))?;
    let linear: Vector6<f64> =
        parameters.iter().enumerate().filter_map(|(body, p)| Some(regressor.body(body)? * p)).sum();
    compare("momentum regressor", momentum.map(|x| x.re).as_slice(), linear.as_slice())?;

    let about_base =
        tree.base_momentum(&motion.base_twist, &motion.positions, &motion.rates).map_err(of("floating"))?;
    let twist = (operations.floating_base_twist)(tree, &motion.positions, &motion.rates, &about_base);
    let twist = twist.map_err(of("floating"))?.to_vector();
    compare("floating base", motion.base_twist.to_vector().as_slice(), twist.as_slice())
}
