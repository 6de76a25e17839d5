//! Every group of this crate passes every law, over all regimes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use tumble_lie::group_laws;

use tumble_lie::nalgebra::{
    Isometry2, Isometry3, Rotation3, Translation, UnitComplex, UnitDualQuaternion, UnitQuaternion, Vector1, Vector3,
    Vector4, Vector6,
};
use tumble_lie::num_dual::Dual64;
use tumble_lie::strategies::{points, tangents};

group_laws!(so2, UnitComplex<f64>, tangents::<Vector1<f64>>(1), dual = UnitComplex<Dual64>, points = points::<2>());
group_laws!(se2, Isometry2<f64>, tangents::<Vector3<f64>>(1), dual = Isometry2<Dual64>, points = points::<2>());
group_laws!(so3, Rotation3<f64>, tangents::<Vector3<f64>>(3), dual = Rotation3<Dual64>, points = points::<3>());
group_laws!(quaternion, UnitQuaternion<f64>, tangents::<Vector3<f64>>(3), dual = UnitQuaternion<Dual64>, points = points::<3>());
group_laws!(se3, Isometry3<f64>, tangents::<Vector6<f64>>(3), dual = Isometry3<Dual64>, points = points::<3>());
group_laws!(dual_quaternion, UnitDualQuaternion<f64>, tangents::<Vector6<f64>>(3), dual = UnitDualQuaternion<Dual64>, points = points::<3>());
group_laws!(translation, Translation<f64, 4>, tangents::<Vector4<f64>>(0), dual = Translation<Dual64, 4>, points = points::<4>());
