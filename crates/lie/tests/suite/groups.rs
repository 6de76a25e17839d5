//! Every group of this crate passes every law, over all regimes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::cast_possible_truncation)]

use approx::assert_relative_eq;
use core::f64::consts::PI;
use tumble_lie::group_laws;
use tumble_lie::laws;
use tumble_lie::nalgebra::{
    DMatrix, Isometry2, Isometry3, Rotation3, SMatrix, Translation, Unit, UnitComplex, UnitDualQuaternion,
    UnitQuaternion, Vector1, Vector2, Vector3, Vector4, Vector6,
};
use tumble_lie::num_dual::Dual64;
use tumble_lie::strategies::{self, points, tangents};
use tumble_lie::{EulerZyx, GroupAction, Increment, LieGroup, Pose, Product, Scalar, Stacked, Twist, Wrench};

type PoseAndJoints<T> = Product<Pose<T>, Translation<T, 2>>;
type PoseAndJointTangent = Stacked<Vector6<f64>, Vector2<f64>>;

group_laws!(so2, UnitComplex<f64>, tangents::<Vector1<f64>>(1), dual = UnitComplex<Dual64>, points = points::<2>());
group_laws!(se2, Isometry2<f64>, tangents::<Vector3<f64>>(1), dual = Isometry2<Dual64>, points = points::<2>());
group_laws!(so3, Rotation3<f64>, tangents::<Vector3<f64>>(3), dual = Rotation3<Dual64>, points = points::<3>());
group_laws!(quaternion, UnitQuaternion<f64>, tangents::<Vector3<f64>>(3), dual = UnitQuaternion<Dual64>, points = points::<3>());
group_laws!(se3, Isometry3<f64>, tangents::<Vector6<f64>>(3), dual = Isometry3<Dual64>, points = points::<3>());
group_laws!(dual_quaternion, UnitDualQuaternion<f64>, tangents::<Vector6<f64>>(3), dual = UnitDualQuaternion<Dual64>, points = points::<3>());
group_laws!(product, PoseAndJoints<f64>, tangents::<PoseAndJointTangent>(3), dual = PoseAndJoints<Dual64>);
group_laws!(translation, Translation<f64, 4>, tangents::<Vector4<f64>>(0), dual = Translation<Dual64, 4>, points = points::<4>());

/// A quaternion and its negative; a pose and a unit dual quaternion likewise.
#[test]
fn double_cover() -> Result<(), String> {
    laws::for_all(&strategies::poses(), |pose| {
        let other = Pose::from_parts(pose.translation, UnitQuaternion::new_unchecked(-pose.rotation.into_inner()));
        laws::check_double_cover(&[(pose.rotation, other.rotation)], 1e-15)?;
        laws::check_double_cover(&[(pose, other)], 1e-15)?;
        let [first, second] = [pose, other].map(|p| UnitDualQuaternion::from_isometry(&p));
        laws::check_double_cover(&[(first, second)], 1e-15)
    })
}

#[test]
fn actions_are_isometries() -> Result<(), String> {
    laws::for_all(&(strategies::poses(), points::<3>(), points::<3>()), |(pose, p, q)| {
        laws::check_isometric_action(&[pose], &[p, q], 1e-14)?;
        laws::check_isometric_action(&[pose.rotation], &[p, q], 1e-14)?;
        laws::check_isometric_action(&[pose.rotation.to_rotation_matrix()], &[p, q], 1e-14)?;
        laws::check_isometric_action(&[UnitDualQuaternion::from_isometry(&pose)], &[p, q], 1e-14)
    })?;
    laws::for_all(&(tangents::<Vector3<f64>>(1), points::<2>(), points::<2>()), |(xi, p, q)| {
        let pose = <Isometry2<f64> as LieGroup>::exp(&xi);
        laws::check_isometric_action(&[pose], &[p, q], 1e-14)?;
        laws::check_isometric_action(&[pose.rotation], &[p, q], 1e-14)
    })
}

/// The named halves of twists and wrenches transform as Ad and Ad*.
#[test]
fn power_pairing() -> Result<(), String> {
    laws::for_all(&(strategies::poses(), strategies::twists(), strategies::wrenches()), |(pose, twist, wrench)| {
        let change_twist = |twist: &Twist<f64>| twist.transformed_by(&pose);
        let change_wrench = |wrench: &Wrench<f64>| wrench.transformed_by(&pose);
        laws::check_power_pairing(&twist, &wrench, change_twist, change_wrench, 1e-13)?;
        let (by_matrix, named) = (pose.adjoint() * twist.to_vector(), change_twist(&twist).to_vector());
        laws::require("power_pairing/adjoint", &pose, &by_matrix, &named, (by_matrix - named).norm(), 1e-11)?;
        let (by_matrix, named) = (pose.coadjoint() * wrench.to_vector(), change_wrench(&wrench).to_vector());
        laws::require("power_pairing/coadjoint", &pose, &by_matrix, &named, (by_matrix - named).norm(), 1e-11)
    })
}

/// All representations of a displacement act alike.
#[test]
fn representations_agree() -> Result<(), String> {
    laws::for_all(&(strategies::poses(), points::<3>()), |(pose, p)| {
        let expected = pose.act(&p);
        let dual = dual_of(&pose).act(&p);
        laws::require("representations/dual_quaternion", &pose, &expected, &dual, (dual - expected).norm(), 1e-13)?;
        let matrix = pose.rotation.to_rotation_matrix().act(&p) + pose.translation.vector;
        laws::require("representations/matrix", &pose, &expected, &matrix, (matrix - expected).norm(), 1e-13)?;
        let xi = dual_of(&pose).log() - pose.log();
        laws::require("representations/log", &pose, &pose.log(), &xi, xi.norm(), 1e-13)
    })
}

fn dual_of(pose: &Pose<f64>) -> UnitDualQuaternion<f64> {
    UnitDualQuaternion::from_isometry(pose)
}

/// Half a turn exactly, and rotation vectors longer than half a turn.
#[test]
fn at_and_beyond_half_a_turn() {
    for axis in [Vector3::x_axis(), Vector3::y_axis(), Unit::new_normalize(Vector3::new(1.0, -2.0, 0.5))] {
        for angle in [PI, 3.162, 3.163, 4.0, 6.0, 9.0, 40.0] {
            let phi = axis.into_inner() * angle;
            let q = <UnitQuaternion<f64> as LieGroup>::exp(&phi);
            assert_relative_eq!(q, UnitQuaternion::from_axis_angle(&axis, angle), epsilon = 1e-14);
            let shortest = q.log();
            assert!(shortest.norm() <= PI + 1e-15);
            let again = <UnitQuaternion<f64> as LieGroup>::exp(&shortest);
            assert_relative_eq!(again.adjoint(), q.adjoint(), epsilon = 1e-14);
            let matrix = <Rotation3<f64> as LieGroup>::exp(&phi);
            assert_relative_eq!(<Rotation3<f64> as LieGroup>::exp(&matrix.log()), matrix, epsilon = 1e-14);
            let twist = Vector6::new(phi.x, phi.y, phi.z, 1.0, -2.0, 3.0);
            let (right, inverse) = (Pose::right_jacobian(&twist), Pose::right_jacobian_inverse(&twist));
            assert_relative_eq!(right * inverse, tumble_lie::nalgebra::Matrix6::identity(), epsilon = 1e-11);
            laws::check_right_jacobian::<Pose<f64>>(&[twist], 1e-9).unwrap();
            let moving = twist.map_with_location(|i, _, x| Dual64::new(x, if i == 1 { 1.0 } else { 0.0 }));
            let at = <Pose<Dual64> as LieGroup>::exp(&twist.map(Dual64::from));
            let rate = at.between(&<Pose<Dual64> as LieGroup>::exp(&moving)).log().map(|x| x.eps);
            assert_relative_eq!(rate, right.column(1).into_owned(), epsilon = 1e-12);
            let both = <Pose<f64> as LieGroup>::exp(&(twist * 0.5));
            assert_relative_eq!(both * both, <Pose<f64> as LieGroup>::exp(&twist), epsilon = 1e-13);
        }
    }
}

/// Single precision follows double precision in all regimes.
#[test]
fn single_precision() -> Result<(), String> {
    laws::for_all(&tangents::<Vector6<f64>>(3), |xi| {
        let short = xi.map(|x| x as f32);
        // the same input in both precisions
        let xi = short.map(f64::from);
        let law = |name, expected: &DMatrix<f64>, found: &DMatrix<f32>| {
            let error = (found.map(f64::from) - expected).amax();
            laws::require(name, &xi, expected, found, error, 2e-6 * (1.0 + expected.amax()))
        };
        let (pose, single) = (<Pose<f64> as LieGroup>::exp(&xi), <Pose<f32> as LieGroup>::exp(&short));
        law("single/exp", &dynamic(&pose.to_homogeneous()), &dynamic(&single.to_homogeneous()))?;
        law("single/log", &dynamic(&xi), &dynamic(&single.log()))?;
        law("single/adjoint", &dynamic(&pose.adjoint()), &dynamic(&single.adjoint()))?;
        law("single/jacobian", &dynamic(&Pose::right_jacobian(&xi)), &dynamic(&Pose::right_jacobian(&short)))?;
        let (double, found) = (Pose::right_jacobian_inverse(&xi), Pose::right_jacobian_inverse(&short));
        law("single/inverse_jacobian", &dynamic(&double), &dynamic(&found))
    })
}

fn dynamic<T: Scalar, const R: usize, const C: usize>(matrix: &SMatrix<T, R, C>) -> DMatrix<T> {
    DMatrix::from_column_slice(R, C, matrix.as_slice())
}

/// Norms stay one to 1e-11 over ten thousand products.
#[test]
fn norms_after_ten_thousand_products() {
    let step = <UnitDualQuaternion<f64> as LieGroup>::exp(&Vector6::new(0.3, -0.1, 0.2, 0.01, 0.02, -0.03));
    let product = (0..10_000).fold(UnitDualQuaternion::identity(), |product, _| product.compose(&step));
    assert!((product.real.norm() - 1.0).abs() < 1e-11);
    let orthogonality = product.real.dot(&product.dual);
    assert!(orthogonality.abs() < 1e-11 * product.dual.norm());
}

/// The bits of every operation on fixed inputs: equal on every processor and at every optimisation level.
#[test]
fn bits_are_the_same_everywhere() {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |values: &[f64]| {
        for byte in values.iter().flat_map(|x| x.to_bits().to_le_bytes()) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    for k in 0..200_u32 {
        let t = f64::from(k) * 0.02;
        let xi = Vector6::new(t, -0.3 * t, 0.4 * t, 1.0 - t, t * t, -2.0);
        let pose = <Pose<f64> as LieGroup>::exp(&xi);
        let next = pose.compose(&pose.inverse().compose(&<Pose<f64> as LieGroup>::exp(&(xi * 0.3))));
        let euler = EulerZyx::from_rotation(&pose.rotation);
        let planar = <Isometry2<f64> as LieGroup>::exp(&Vector3::new(t, 1.0, -t));
        add(pose.to_homogeneous().as_slice());
        add(next.log().as_slice());
        add(pose.adjoint().as_slice());
        add(Pose::right_jacobian(&xi).as_slice());
        add(Pose::right_jacobian_inverse(&xi).as_slice());
        add(&[euler.roll, euler.pitch, euler.yaw]);
        add(planar.log().as_slice());
        add(dual_of(&pose).log().as_slice());
        add(Increment::between(&pose, &next).unwrap().to_vector().as_slice());
    }
    assert_eq!(hash, 0x4ead_ccda_c344_d836, "{hash:#x}");
}
