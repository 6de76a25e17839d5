//! Every law of trees catches a defect that the others let pass.

use tumble_dynamics::laws::{TreeMotion, TreeOperations, check_multibody};
use tumble_dynamics::lie::{Pose, Wrench};
use tumble_dynamics::strategies::{draws, tree_motions, trees};
use tumble_dynamics::*;

type Tree = Multibody<f64, Fixed<3>>;
type Operations = TreeOperations<3>;

/// The law that breaks in one of many trees and motions.
fn caught(operations: &Operations, prepare: fn(TreeMotion<3>) -> TreeMotion<3>) -> &'static str {
    let motions = draws(&tree_motions::<3>(), 31, 20);
    let trees: Vec<Tree> = draws(&trees::<3>(), 32, 20);
    let violation = trees
        .iter()
        .zip(motions)
        .find_map(|(tree, motion)| check_multibody(operations, tree, &[prepare(motion)], 1e-9).err());
    violation.expect("a defect that no law catches").law
}

fn as_drawn(motion: TreeMotion<3>) -> TreeMotion<3> {
    motion
}

/// The tree with each link changed.
fn changed(tree: &Tree, change: impl Fn(&mut Link<f64>)) -> Tree {
    let mut links: [Link<f64>; 3] = tree.links().to_vec().try_into().unwrap();
    links.iter_mut().for_each(change);
    Multibody::try_new(*tree.base(), links).unwrap()
}

#[test]
fn lost_products_of_velocities_cost_power() {
    let operations = Operations {
        inverse_dynamics: |tree, motion| {
            tree.inverse_dynamics(&GeneralizedMotion { rates: &[0.0; 3], ..*motion }).map(|mut force| {
                // springs and dampers are right: the coupling of the rates is what is missing
                for ((joint, link), (q, w)) in
                    force.joints.iter_mut().zip(tree.links()).zip(motion.positions.iter().zip(motion.rates))
                {
                    *joint += link.joint.passive_force(*q, 0.0) - link.joint.passive_force(*q, *w);
                }
                force
            })
        },
        ..Operations::default()
    };
    assert_eq!(caught(&operations, as_drawn), "power");
}

#[test]
fn a_gyroscopic_torque_that_does_no_work_is_a_torque_from_nowhere() {
    let operations = Operations {
        inverse_dynamics: |tree, motion| {
            tree.inverse_dynamics(motion).map(|mut force| {
                let w = motion.base_twist.angular;
                force.base.torque += w.cross(&(tree.base().inertia_about_origin * w));
                force
            })
        },
        ..Operations::default()
    };
    assert_eq!(caught(&operations, as_drawn), "momentum balance");
}

#[test]
fn momentum_about_the_base_is_not_momentum_about_a_fixed_point() {
    let operations = Operations {
        spatial_momentum: |tree, world_from_base, twist, positions, rates| {
            let turned = Pose::from_parts(nalgebra::Translation3::identity(), world_from_base.rotation);
            tree.spatial_momentum(&turned, twist, positions, rates)
        },
        ..Operations::default()
    };
    assert_eq!(caught(&operations, as_drawn), "momentum");
}

#[test]
fn a_forgotten_rotor_is_missed_by_forward_dynamics() {
    let operations = Operations {
        forward_dynamics: |tree, twist, positions, rates, force| {
            changed(tree, |link| link.joint.rotor_inertia = 0.0).forward_dynamics(twist, positions, rates, force)
        },
        ..Operations::default()
    };
    assert_eq!(caught(&operations, as_drawn), "forward undoes inverse");
}

#[test]
fn a_coupling_with_the_wrong_sign_changes_the_energy() {
    let wrong = Operations {
        mass_matrix: |tree, positions| {
            tree.mass_matrix(positions).map(|mut matrix| {
                matrix.coupling.iter_mut().for_each(|column| *column = -*column);
                matrix
            })
        },
        ..Operations::default()
    };
    assert_eq!(caught(&wrong, as_drawn), "mass matrix");
    // at rest there is no energy to judge by
    let at_rest = |motion: TreeMotion<3>| TreeMotion { base_twist: lie::Twist::zero(), rates: [0.0; 3], ..motion };
    assert_eq!(caught(&wrong, at_rest), "mass matrix columns");
}

#[test]
fn a_tool_without_the_lever_of_the_base_moves_elsewhere() {
    let operations = Operations {
        tool_jacobian: |tree, positions, body, point| {
            tree.tool_jacobian(positions, body, point).map(|mut jacobian| {
                jacobian.base = nalgebra::Matrix6::identity();
                jacobian
            })
        },
        ..Operations::default()
    };
    assert_eq!(caught(&operations, as_drawn), "tool velocity");
}

#[test]
fn swapped_products_of_inertia_are_another_regressor() {
    let operations = Operations {
        torque_regressor: |tree, motion| {
            tree.torque_regressor(motion).map(|mut regressor| {
                regressor.base_of_link.iter_mut().for_each(|block| block.swap_columns(5, 6));
                regressor
            })
        },
        ..Operations::default()
    };
    assert_eq!(caught(&operations, as_drawn), "torque regressor");
}

#[test]
fn a_momentum_regressor_that_forgets_where_the_base_is() {
    let operations = Operations {
        momentum_regressor: |tree, _, twist, positions, rates| {
            tree.momentum_regressor(&Pose::identity(), twist, positions, rates)
        },
        ..Operations::default()
    };
    assert_eq!(caught(&operations, as_drawn), "momentum regressor");
}

#[test]
fn a_floating_base_that_ignores_the_joints() {
    let operations = Operations {
        floating_base_twist: |tree, positions, _, momentum: &Wrench<f64>| {
            tree.floating_base_twist(positions, &[0.0; 3], momentum)
        },
        ..Operations::default()
    };
    assert_eq!(caught(&operations, as_drawn), "floating base");
}
