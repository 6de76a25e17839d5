//! Random bodies, poses, states and wrenches for property tests (feature `testing`).

use crate::free_flyer::BodyAcceleration;
use crate::inertia::InertialParameters;
use crate::laws::TreeMotion;
use crate::multibody::{Fixed, Joint, Link, Multibody};
use crate::state::RigidBodyState;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use tumble_lie::nalgebra::{Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use tumble_lie::{Pose, Twist, Wrench};

/// The body of thesis 5.4, to which golden values belong; its centre of mass lies beside its origin, and every product of inertia is there.
pub fn body_d() -> InertialParameters<f64> {
    InertialParameters::about_origin(
        5.0,
        Vector3::new(0.05, 0.1, 0.05),
        Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0),
    )
}

/// `count` draws from a strategy, always the same for the same seed; for loops too long for a proptest run.
pub fn draws<S: Strategy>(strategy: &S, seed: u64, count: usize) -> Vec<S::Value> {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &bytes);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    // a strategy that rejects a draw is asked again
    core::iter::repeat_with(|| strategy.new_tree(&mut runner))
        .flatten()
        .map(|tree| tree.current())
        .take(count)
        .collect()
}

/// Vectors with components in `[-bound, bound]`.
pub fn vectors(bound: f64) -> impl Strategy<Value = Vector3<f64>> + Clone {
    [-bound..=bound, -bound..=bound, -bound..=bound].prop_map(Vector3::from)
}

/// Rotations all over SO(3).
pub fn rotations() -> impl Strategy<Value = UnitQuaternion<f64>> + Clone {
    let part = -1.0..1.0;
    [part.clone(), part.clone(), part.clone(), part]
        .prop_map(|[w, x, y, z]| Quaternion::new(w, x, y, z))
        .prop_filter("too short to normalise", |q| q.norm() > 0.1)
        .prop_map(UnitQuaternion::from_quaternion)
}

/// Poses with any rotation and position components up to `bound` (m).
pub fn poses(bound: f64) -> impl Strategy<Value = Pose<f64>> + Clone {
    (vectors(bound), rotations()).prop_map(|(t, r)| Pose::from_parts(Translation3::from(t), r))
}

/// Twists with components up to `angular` (rad/s) and `linear` (m/s).
pub fn twists(angular: f64, linear: f64) -> impl Strategy<Value = Twist<f64>> + Clone {
    (vectors(angular), vectors(linear)).prop_map(|(w, v)| Twist::new(w, v))
}

/// Wrenches with components up to `torque` (N m) and `force` (N).
pub fn wrenches(torque: f64, force: f64) -> impl Strategy<Value = Wrench<f64>> + Clone {
    (vectors(torque), vectors(force)).prop_map(|(t, f)| Wrench::new(t, f))
}

/// States with positions up to 10 m, rates up to 2 rad/s and 2 m/s.
pub fn states() -> impl Strategy<Value = RigidBodyState<f64>> + Clone {
    (poses(10.0), twists(2.0, 2.0))
        .prop_map(|(world_from_body, twist_body)| RigidBodyState { world_from_body, twist_body })
}

/// Ten numbers with the verdict known by construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JudgedBody {
    /// The ten numbers.
    pub parameters: InertialParameters<f64>,
    /// What [`InertialParameters::consistency_margin`] is up to rounding.
    pub margin: f64,
}

/// Principal second moments about the centre of mass, relative to `mass * radius^2`; placed anywhere.
fn placed(
    second_moments: impl Strategy<Value = [f64; 3]> + Clone,
    offset_in_radii: f64,
) -> impl Strategy<Value = JudgedBody> + Clone {
    (second_moments, -2.0..3.0, -2.0..1.0, vectors(offset_in_radii), rotations()).prop_map(
        |(moments, mass_decade, radius_decade, offset, rotation)| {
            let (mass, radius) = (10f64.powf(mass_decade), 10f64.powf(radius_decade));
            let moments = Vector3::from(moments);
            let principal = Matrix3::from_diagonal(&moments.map(|own| moments.sum() - own));
            let r = rotation.to_rotation_matrix().into_inner();
            let inertia = r * (principal * (mass * radius * radius)) * r.transpose();
            let symmetric = (inertia + inertia.transpose()) * 0.5;
            let size = moments.map(f64::abs).sum();
            JudgedBody {
                parameters: InertialParameters::about_com(mass, offset * radius, symmetric),
                margin: if size > 0.0 { moments.min() / size } else { 0.0 },
            }
        },
    )
}

/// Bodies with extent in every direction (margin at least 0.01), centre of mass up to three radii from the origin.
pub fn bodies() -> impl Strategy<Value = InertialParameters<f64>> + Clone {
    placed([0.03..1.0, 0.03..1.0, 0.03..1.0], 3.0).prop_map(|body| body.parameters)
}

/// Within one per cent of the boundary: margin between 1e-9 and 0.01, inside and outside, near plates and near rods.
pub fn near_boundary_bodies() -> impl Strategy<Value = JudgedBody> + Clone {
    let moments = (any::<bool>(), -8.5..-2.1, -8.0..0.0).prop_map(|(inside, thin, wide): (bool, f64, f64)| {
        [if inside { 1.0 } else { -1.0 } * 10f64.powf(thin), 10f64.powf(wide.max(thin)), 1.0]
    });
    placed(moments, 3.0)
}

/// Exactly on the boundary up to rounding: plates, rods and points.
pub fn boundary_bodies() -> impl Strategy<Value = JudgedBody> + Clone {
    let plates = (0.01..1.0).prop_map(|wide| [0.0, wide, 1.0]);
    placed(prop_oneof![plates, Just([0.0, 0.0, 1.0]), Just([0.0; 3])], 3.0)
}

/// Clearly impossible: a negative second moment.
pub fn impossible_bodies() -> impl Strategy<Value = JudgedBody> + Clone {
    placed([-1.0..-0.03, -1.0..1.0, 0.03..1.0], 3.0)
}

/// All of these: two fifths of the draws within one per cent of the boundary, one fifth on it.
pub fn judged_bodies() -> impl Strategy<Value = JudgedBody> + Clone {
    let inside = placed([0.03..1.0, 0.03..1.0, 0.03..1.0], 3.0);
    prop_oneof![1 => inside, 2 => near_boundary_bodies(), 1 => boundary_bodies(), 1 => impossible_bodies()]
}

/// Clouds of one to `largest` point masses within a metre.
pub fn clouds(largest: usize) -> impl Strategy<Value = Vec<(f64, Vector3<f64>)>> + Clone {
    proptest::collection::vec((0.01..2.0, vectors(1.0)), 1..=largest)
}

/// A joint of either kind with any axis and placement, often with spring, damper and rotor.
fn joints() -> impl Strategy<Value = Joint<f64>> + Clone {
    let passive = (any::<bool>(), 0.0..2.0, -1.0..1.0, 0.0..0.5, 0.0..0.2);
    (any::<bool>(), rotations(), poses(0.6), passive).prop_filter_map("an axis", |(turns, rotation, place, passive)| {
        let axis = rotation * Vector3::x();
        let joint = if turns { Joint::revolute(axis, place) } else { Joint::prismatic(axis, place) };
        let (sprung, stiffness, rest, damping, rotor_inertia) = passive;
        joint.ok().map(|joint| {
            if sprung { joint.with_spring(stiffness, rest, damping).with_rotor(rotor_inertia) } else { joint }
        })
    })
}

/// Chains and branched trees of `J` links with bodies that exist.
pub fn trees<const J: usize>() -> impl Strategy<Value = Multibody<f64, Fixed<J>>> + Clone {
    let link = (joints(), bodies(), 0.0..1.0_f64);
    (bodies(), proptest::collection::vec(link, J)).prop_filter_map("parents first", |(base, links)| {
        let link = |i: usize| {
            let (joint, body, place) = links[i];
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below J")]
            let parent = ((1.5 * place).min(0.999) * i as f64 + 1.0) as usize;
            // rather the last link than an earlier one, and sometimes the base
            let parent = if place < 0.1 { None } else { parent.min(i).checked_sub(1) };
            Link { parent, joint, body }
        };
        Multibody::try_new(base, core::array::from_fn(link)).ok()
    })
}

/// Motions of a tree of `J` joints.
pub fn tree_motions<const J: usize>() -> impl Strategy<Value = TreeMotion<J>> + Clone {
    let lists = proptest::collection::vec(-1.5..1.5_f64, 3 * J);
    (poses(2.0), twists(1.0, 1.0), twists(2.0, 2.0), lists, vectors(0.5)).prop_map(
        |(world_from_base, base_twist, acceleration, lists, tool_body)| TreeMotion {
            world_from_base,
            base_twist,
            base_acceleration: BodyAcceleration {
                angular_acceleration_body: acceleration.angular,
                acceleration_origin_body: acceleration.linear,
            },
            positions: core::array::from_fn(|i| lists[i]),
            rates: core::array::from_fn(|i| lists[J + i]),
            accelerations: core::array::from_fn(|i| lists[2 * J + i]),
            tool_body,
        },
    )
}
