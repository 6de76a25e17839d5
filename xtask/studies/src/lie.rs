//! Problem 1: Lie group operations on 1024 tangents.
//!
//! Targets are the fastest peer of the same representation in `benchmarks/RESULTS.md` plus 10 %, or 20 % where sine or cosine
//! is called, and 40 ns for the inverse Jacobian of SE(3).

use lie::{GroupAction, LieGroup};
use nalgebra::{
    Isometry3, Matrix3, Matrix4, Matrix6, Rotation3, SMatrix, UnitDualQuaternion, UnitQuaternion, Vector3, Vector6,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_lie as lie;

use crate::Failure;
use crate::bench::{Bench, Goal, numbers};
use tumble_identification::noise::signed_unit;

const PROBLEM: &str = "lie";
const ALGEBRA: f64 = 1.1;
const TRIGONOMETRY: f64 = 1.2;

type So3 = UnitQuaternion<f64>;
type Se3 = Isometry3<f64>;
type DualQuaternion = UnitDualQuaternion<f64>;

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    let xi = tangents(bench)?;
    let phi: Vec<Vector3<f64>> = xi.iter().map(|xi| xi.fixed_rows::<3>(0).into_owned()).collect();
    let point: Vec<Vector3<f64>> = xi.iter().map(|xi| xi.fixed_rows::<3>(3).into_owned()).collect();
    let rotation: Vec<So3> = phi.iter().map(|phi| So3::from_scaled_axis(*phi)).collect();
    let matrix: Vec<Rotation3<f64>> = phi.iter().map(<Rotation3<f64> as LieGroup>::exp).collect();
    let pose: Vec<Se3> = xi.iter().map(<Se3 as LieGroup>::exp).collect();
    let dual: Vec<DualQuaternion> = pose.iter().map(DualQuaternion::from_isometry).collect();
    let count = xi.len();
    let next = |i: usize| if i + 1 == count { 0 } else { i + 1 };
    let worst = |error: &dyn Fn(usize) -> f64| [("max_error", (0..count).map(error).fold(0.0, f64::max))];

    // Each quality compares with nalgebra's own function or with a power series summed term by term.
    let (item, goal) = ("so3_exp", Goal::beside("nalgebra", 11.6, TRIGONOMETRY));
    let quality = worst(&|i| (<So3 as LieGroup>::exp(&phi[i]).coords - So3::from_scaled_axis(phi[i]).coords).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| <So3 as LieGroup>::exp(&phi[i]));

    let (item, goal) = ("so3_log", Goal::beside("sophus_lie", 16.7, ALGEBRA));
    let quality = worst(&|i| (LieGroup::log(&rotation[i]) - phi[i]).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| LieGroup::log(&rotation[i]));

    let (item, goal) = ("so3_compose", Goal::beside("sophus-cpp", 3.01, ALGEBRA));
    bench.sweep(PROBLEM, item, goal, count, &[], |i| rotation[i].compose(&rotation[next(i)]));

    let (item, goal) = ("so3_act", Goal::beside("sophus-cpp", 2.04, ALGEBRA));
    bench.sweep(PROBLEM, item, goal, count, &[], |i| rotation[i].act(&point[i]));

    let (item, goal) = ("so3_left_jacobian", Goal::beside("sophus_lie", 21.0, TRIGONOMETRY));
    let quality = worst(&|i| (So3::left_jacobian(&phi[i]) - jacobian_series(skew(&phi[i]))).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| So3::left_jacobian(&phi[i]));

    let (item, goal) = ("so3_left_jacobian_inverse", Goal::beside("manif-cpp", 20.8, TRIGONOMETRY));
    let quality =
        worst(&|i| (So3::left_jacobian_inverse(&phi[i]) * jacobian_series(skew(&phi[i])) - Matrix3::identity()).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| So3::left_jacobian_inverse(&phi[i]));

    let (item, goal) = ("se3_exp", Goal::beside("sophus_lie", 36.0, TRIGONOMETRY));
    let quality = worst(&|i| (pose[i].to_homogeneous() - exponential_series(twist_matrix(&xi[i]))).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| <Se3 as LieGroup>::exp(&xi[i]));

    let (item, goal) = ("se3_log", Goal::beside("sophus_lie", 52.7, TRIGONOMETRY));
    let quality = worst(&|i| {
        let matrix = exponential_series(twist_matrix(&LieGroup::log(&pose[i])));
        (matrix - pose[i].to_homogeneous()).amax()
    });
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| LieGroup::log(&pose[i]));

    let (item, goal) = ("se3_compose", Goal::beside("sophus-cpp", 4.95, ALGEBRA));
    bench.sweep(PROBLEM, item, goal, count, &[], |i| pose[i].compose(&pose[next(i)]));

    let (item, goal) = ("se3_inverse", Goal::beside("nalgebra", 4.24, ALGEBRA));
    bench.sweep(PROBLEM, item, goal, count, &[], |i| LieGroup::inverse(&pose[i]));

    let (item, goal) = ("se3_act", Goal::beside("sophus-cpp", 2.31, ALGEBRA));
    bench.sweep(PROBLEM, item, goal, count, &[], |i| pose[i].act(&point[i]));

    let (item, goal) = ("se3_adjoint", Goal::beside("sophus_lie", 7.79, ALGEBRA));
    let quality = worst(&|i| (pose[i].adjoint() - exponential_series(bracket_matrix(&xi[i]))).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| pose[i].adjoint());

    let (item, goal) = ("se3_left_jacobian", Goal::beside("sophus-cpp", 71.0, TRIGONOMETRY));
    let quality = worst(&|i| (Se3::left_jacobian(&xi[i]) - jacobian_series(bracket_matrix(&xi[i]))).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| Se3::left_jacobian(&xi[i]));

    let quality = worst(&|i| {
        (Se3::left_jacobian_inverse(&xi[i]) * jacobian_series(bracket_matrix(&xi[i])) - Matrix6::identity()).amax()
    });
    bench.sweep(PROBLEM, "se3_left_jacobian_inverse", Goal::at(40.0, "sophus-cpp", 76.7), count, &quality, |i| {
        Se3::left_jacobian_inverse(&xi[i])
    });

    // Pinocchio's representation: rotation matrices, right Jacobians.
    let (item, goal) = ("so3_matrix_exp", Goal::beside("pinocchio-cpp", 19.0, TRIGONOMETRY));
    let quality = worst(&|i| (matrix[i].matrix() - exponential_series(skew(&phi[i]))).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| <Rotation3<f64> as LieGroup>::exp(&phi[i]));

    let (item, goal) = ("so3_matrix_log", Goal::beside("pinocchio-cpp", 99.4, TRIGONOMETRY));
    let quality = worst(&|i| (LieGroup::log(&matrix[i]) - phi[i]).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| LieGroup::log(&matrix[i]));

    let (item, goal) = ("so3_right_jacobian", Goal::beside("pinocchio-cpp", 24.1, TRIGONOMETRY));
    let quality = worst(&|i| (So3::right_jacobian(&phi[i]) - jacobian_series(-skew(&phi[i]))).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| So3::right_jacobian(&phi[i]));

    let (item, goal) = ("so3_right_jacobian_inverse", Goal::beside("pinocchio-cpp", 118.0, TRIGONOMETRY));
    let quality = worst(&|i| {
        (So3::right_jacobian_inverse(&phi[i]) * jacobian_series(-skew(&phi[i])) - Matrix3::identity()).amax()
    });
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| So3::right_jacobian_inverse(&phi[i]));

    let (item, goal) = ("se3_right_jacobian", Goal::beside("pinocchio-cpp", 71.3, TRIGONOMETRY));
    let quality = worst(&|i| (Se3::right_jacobian(&xi[i]) - jacobian_series(-bracket_matrix(&xi[i]))).amax());
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| Se3::right_jacobian(&xi[i]));

    let (item, goal) = ("se3_right_jacobian_inverse", Goal::at(40.0, "pinocchio-cpp", 149.0));
    let quality = worst(&|i| {
        (Se3::right_jacobian_inverse(&xi[i]) * jacobian_series(-bracket_matrix(&xi[i])) - Matrix6::identity()).amax()
    });
    bench.sweep(PROBLEM, item, goal, count, &quality, |i| Se3::right_jacobian_inverse(&xi[i]));

    // No peer has these.
    let none = Goal::default();
    bench.sweep(PROBLEM, "dual_quaternion_exp", none, count, &[], |i| <DualQuaternion as LieGroup>::exp(&xi[i]));
    bench.sweep(PROBLEM, "dual_quaternion_log", none, count, &[], |i| LieGroup::log(&dual[i]));
    bench.sweep(PROBLEM, "dual_quaternion_compose", none, count, &[], |i| dual[i].compose(&dual[next(i)]));
    bench.sweep(PROBLEM, "dual_quaternion_act", none, count, &[], |i| dual[i].act(&point[i]));
    Ok(())
}

/// `[phi; rho]`: the frozen inputs, or others of the same kind.
fn tangents(bench: &Bench) -> Result<Vec<Vector6<f64>>, Failure> {
    let Some(folder) = &bench.data else {
        eprintln!(
            "skipped: the frozen inputs of problem 1 (--data DIR); tangents of the same kind are drawn from seed 1"
        );
        let mut generator = ChaCha8Rng::seed_from_u64(1);
        return Ok((0..1024)
            .map(|_| {
                let mut draw = || Vector3::from_fn(|_, _| signed_unit(&mut generator));
                let (rho, axis, turn) = (draw(), draw(), draw());
                let angle = 0.5 * (1.0 + turn.x) * (std::f64::consts::PI - 0.1);
                let phi = axis.normalize() * angle;
                Vector6::new(phi.x, phi.y, phi.z, rho.x, rho.y, rho.z)
            })
            .collect());
    };
    let path = folder.join("lie_inputs.csv");
    // The file has rho first.
    numbers(&path)?
        .iter()
        .map(|row| match row[..] {
            [rho_x, rho_y, rho_z, phi_x, phi_y, phi_z] => Ok(Vector6::new(phi_x, phi_y, phi_z, rho_x, rho_y, rho_z)),
            _ => Err(Failure::file(&path, "a row has other than six numbers")),
        })
        .collect()
}

fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// `[[S(phi), rho], [0, 0]]`
fn twist_matrix(xi: &Vector6<f64>) -> Matrix4<f64> {
    let mut matrix = Matrix4::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&xi.fixed_rows::<3>(0).into_owned()));
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&xi.fixed_rows::<3>(3));
    matrix
}

/// `ad_xi = [[S(phi), 0], [S(rho), S(phi)]]`
fn bracket_matrix(xi: &Vector6<f64>) -> Matrix6<f64> {
    let angular = skew(&xi.fixed_rows::<3>(0).into_owned());
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&angular);
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&angular);
    matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&skew(&xi.fixed_rows::<3>(3).into_owned()));
    matrix
}

/// Sum of `A^k / k!`
fn exponential_series<const N: usize>(matrix: SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    SMatrix::identity() + matrix * jacobian_series(matrix)
}

/// Sum of `A^k / (k + 1)!`, the left Jacobian where `A = ad_xi`.
fn jacobian_series<const N: usize>(matrix: SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let (mut term, mut sum) = (SMatrix::<f64, N, N>::identity(), SMatrix::<f64, N, N>::identity());
    for k in 1..40_u32 {
        term = term * matrix / f64::from(k + 1);
        sum += term;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_are_right_where_the_answer_is_known() {
        let quarter_turn = skew(&Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        let expected = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        assert!((exponential_series(quarter_turn) - expected).amax() < 1e-14);
    }
}
