//! Proptest strategies that mix the regimes where geometry goes wrong: zero, tiny, ordinary, near half a turn.

use crate::group::LieGroup;
use crate::scalar::Coordinates;
use crate::se3::Pose;
use crate::spatial::{Twist, Wrench};
use core::f64::consts::PI;
use nalgebra::{SVector, UnitDualQuaternion, UnitQuaternion, Vector3, Vector6};
use proptest::prelude::*;

/// Lengths of rotation vectors: 0, 1e-12, 1e-8, 1e-4, ordinary, `pi - 1e-3`, `pi - 1e-6`, rad.
pub fn angles() -> impl Strategy<Value = f64> + Clone {
    prop_oneof![
        1 => Just(0.0),
        1 => Just(1e-12),
        1 => Just(1e-8),
        1 => Just(1e-4),
        4 => 1e-3..3.0,
        1 => Just(PI - 1e-3),
        1 => Just(PI - 1e-6),
    ]
}

/// Lengths from zero to ten, tiny ones included.
fn lengths() -> impl Strategy<Value = f64> + Clone {
    prop_oneof![1 => Just(0.0), 1 => Just(1e-12), 1 => Just(1e-8), 1 => Just(1e-4), 4 => 1e-3..10.0]
}

/// Tangents of `V::DIM` coordinates in all regimes; the first `angular` ones form a rotation vector shorter than `pi`.
pub fn tangents<V: Coordinates<f64>>(angular: usize) -> impl Strategy<Value = V> + Clone {
    let directions = proptest::collection::vec(-1.0..1.0f64, V::DIM);
    (directions, angles(), lengths()).prop_map(move |(direction, angle, length)| {
        let norm = |range: &[f64]| range.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        let (first, rest) = direction.split_at(angular.min(V::DIM));
        let (turn, shift) = (angle / norm(first), length / norm(rest));
        V::from_fn(|i| match (first.get(i), rest.get(i.wrapping_sub(first.len()))) {
            (Some(x), _) => x * turn,
            (None, x) => x.map_or(0.0, |x| x * shift),
        })
    })
}

/// Points with coordinates in -10..10.
pub fn points<const N: usize>() -> impl Strategy<Value = SVector<f64, N>> + Clone {
    proptest::array::uniform(-10.0..10.0f64).prop_map(SVector::from)
}

/// Rotations in all regimes, both representatives.
pub fn rotations() -> impl Strategy<Value = UnitQuaternion<f64>> + Clone {
    (tangents::<Vector3<f64>>(3), any::<bool>()).prop_map(|(phi, other)| {
        let q = <UnitQuaternion<f64> as LieGroup>::exp(&phi);
        if other { UnitQuaternion::new_unchecked(-q.into_inner()) } else { q }
    })
}

/// Poses in all regimes.
pub fn poses() -> impl Strategy<Value = Pose<f64>> + Clone {
    (rotations(), points::<3>()).prop_map(|(rotation, position)| Pose::from_parts(position.into(), rotation))
}

/// Unit dual quaternions in all regimes, both representatives.
pub fn unit_dual_quaternions() -> impl Strategy<Value = UnitDualQuaternion<f64>> + Clone {
    poses().prop_map(|pose| UnitDualQuaternion::from_isometry(&pose))
}

/// Twists with coordinates in -10..10 (rad/s, m/s).
pub fn twists() -> impl Strategy<Value = Twist<f64>> + Clone {
    points::<6>().prop_map(|v: Vector6<f64>| Twist::from(v))
}

/// Wrenches with coordinates in -10..10 (N m, N).
pub fn wrenches() -> impl Strategy<Value = Wrench<f64>> + Clone {
    points::<6>().prop_map(|v: Vector6<f64>| Wrench::from(v))
}
