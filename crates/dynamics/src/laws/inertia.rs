//! Laws of inertial parameters, tested against rigid clouds of point masses.

use crate::error::DynamicsError;
use crate::inertia::{InertialParameters, from_pseudo_inertia, pseudo_inertia};
use crate::laws::{LawViolation, require};
use crate::parameter_vector::PARAMETERS;
use tumble_lie::Pose;
use tumble_lie::nalgebra::{Matrix3, Matrix4, SVector, Vector3};

type Body = InertialParameters<f64>;

/// A rigid cloud of point masses (kg) at positions (m).
pub type Cloud = Vec<(f64, Vector3<f64>)>;

/// The operations under test; the default is this crate's, replace those that are yours.
///
/// A type of your own enters by closures without captures that convert to and from [`InertialParameters`].
#[derive(Clone, Copy, Debug)]
pub struct InertiaOperations {
    /// Whether a body with these parameters exists (closed set).
    pub is_consistent: fn(&Body) -> bool,
    /// Whether it exists and has extent in every direction (open set).
    pub is_strictly_consistent: fn(&Body) -> bool,
    /// The pseudo-inertia about the origin.
    pub pseudo_inertia: fn(&Body) -> Matrix4<f64>,
    /// The body in frame a from its description in frame b, `(body_b, a_from_b)`.
    pub transformed_by: fn(&Body, &Pose<f64>) -> Body,
    /// Robot and payload together, `(robot, payload, robot_from_payload)`.
    pub with_payload: fn(&Body, &Body, &Pose<f64>) -> Body,
    /// The payload, `(combined, robot, robot_from_payload)`.
    pub payload_beside: fn(&Body, &Body, &Pose<f64>) -> Body,
    /// `[m, h_x, h_y, h_z, J11, J12, J13, J22, J23, J33]`.
    pub pack: fn(&Body) -> SVector<f64, PARAMETERS>,
    /// Inverse of `pack`.
    pub unpack: fn(&SVector<f64, PARAMETERS>) -> Body,
    /// The nearest consistent body in the Euclidean norm of the packed parameters.
    pub nearest_consistent: fn(&Body) -> Result<Body, DynamicsError>,
}

impl Default for InertiaOperations {
    fn default() -> Self {
        Self {
            is_consistent: Body::is_consistent,
            is_strictly_consistent: Body::is_strictly_consistent,
            pseudo_inertia,
            transformed_by: Body::transformed_by,
            with_payload: Body::with_payload,
            payload_beside: Body::payload_beside,
            pack: Body::to_vector,
            unpack: Body::from_vector,
            nearest_consistent: Body::nearest_consistent,
        }
    }
}

/// What the laws are tested on; see [`crate::strategies`] for good draws.
#[derive(Clone, Debug, Default)]
pub struct InertiaSamples {
    /// Clouds; those of one to three points are bodies without extent in some direction.
    pub clouds: Vec<Cloud>,
    /// Sets of ten numbers that may or may not be bodies.
    pub candidates: Vec<Body>,
    /// Changes of frame.
    pub poses: Vec<Pose<f64>>,
}

/// Eigenvalues of a symmetric matrix by cyclic Jacobi rotations (shares nothing with the code under test).
fn eigenvalues_by_jacobi(matrix: &Matrix3<f64>) -> Vector3<f64> {
    let mut a = *matrix;
    for _ in 0..30 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[(p, q)] == 0.0 {
                continue;
            }
            let theta = (a[(q, q)] - a[(p, p)]) / (2.0 * a[(p, q)]);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let c = 1.0 / t.hypot(1.0);
            let mut rotation = Matrix3::identity();
            (rotation[(p, p)], rotation[(q, q)]) = (c, c);
            (rotation[(p, q)], rotation[(q, p)]) = (t * c, -t * c);
            a = rotation.transpose() * a * rotation;
        }
    }
    a.diagonal()
}

/// The definition: how far the principal moments about the centre of mass are inside the triangle inequalities, as a
/// share of their trace; zero where that is below the rounding of the ten numbers; `None` without a positive mass.
pub fn triangle_margin(body: &Body) -> Option<f64> {
    if body.mass.is_nan() || body.mass <= 0.0 {
        return None;
    }
    let c = body.first_moment / body.mass;
    let inertia_about_com =
        body.inertia_about_origin - (Matrix3::identity() * c.dot(&c) - c * c.transpose()) * body.mass;
    let j = eigenvalues_by_jacobi(&inertia_about_com);
    let size = j.map(f64::abs).sum().max(f64::MIN_POSITIVE);
    let least = (j.sum() - 2.0 * j.max()).min(j.min());
    if least.abs() <= 64.0 * f64::EPSILON * body.inertia_about_origin.amax() { Some(0.0) } else { Some(least / size) }
}

fn magnitude(bodies: &[&Body]) -> f64 {
    bodies.iter().map(|body| body.to_vector().amax()).fold(f64::MIN_POSITIVE, f64::max)
}

fn distance(a: &Body, b: &Body) -> f64 {
    let inertia = (a.inertia_about_origin - b.inertia_about_origin).amax();
    (a.mass - b.mass).abs().max((a.first_moment - b.first_moment).amax()).max(inertia)
}

/// Sums written out, as the oracle.
fn sums_of(cloud: &Cloud) -> (Body, Matrix4<f64>) {
    let mut body =
        InertialParameters { mass: 0.0, first_moment: Vector3::zeros(), inertia_about_origin: Matrix3::zeros() };
    let mut second_moment = Matrix4::zeros();
    for (mass, x) in cloud {
        body.mass += mass;
        body.first_moment += x * *mass;
        body.inertia_about_origin += (Matrix3::identity() * x.dot(x) - x * x.transpose()) * *mass;
        second_moment += x.push(1.0) * x.push(1.0).transpose() * *mass;
    }
    (body, second_moment)
}

/// The laws of inertial parameters.
///
/// "packing round trip", "packing order", "pseudo-inertia is the second moment", "pseudo-inertia is linear", "existing
/// bodies are consistent", "bodies without extent are not strictly consistent", "consistent exactly when a body
/// exists", "moved frame moves the points", "composition is the union of points", "payload is combined minus robot",
/// "projection gives a body", "projection keeps bodies", "projection is nearest".
///
/// `tolerance` is relative to the largest of the numbers involved; verdicts are compared with the definition where
/// its margin exceeds 1e-9.
/// # Errors
/// The first broken law.
pub fn check_inertia(
    operations: &InertiaOperations,
    samples: &InertiaSamples,
    tolerance: f64,
) -> Result<(), LawViolation> {
    for (i, cloud) in samples.clouds.iter().enumerate() {
        let next = &samples.clouds[(i + 1) % samples.clouds.len()];
        check_cloud(operations, cloud, next, tolerance)?;
        for pose in &samples.poses {
            check_frames(operations, cloud, next, pose, tolerance)?;
        }
    }
    for candidate in &samples.candidates {
        check_candidate(operations, candidate, tolerance)?;
    }
    Ok(())
}

fn check_cloud(op: &InertiaOperations, cloud: &Cloud, next: &Cloud, tolerance: f64) -> Result<(), LawViolation> {
    let (body, second_moment) = sums_of(cloud);
    let size = magnitude(&[&body]);

    let packed = (op.pack)(&body);
    let back = (op.unpack)(&packed);
    require("packing round trip", cloud, &body, &back, distance(&back, &body) / size, tolerance)?;
    let (h, j) = (body.first_moment, body.inertia_about_origin);
    let order = SVector::from([body.mass, h.x, h.y, h.z, j.m11, j.m12, j.m13, j.m22, j.m23, j.m33]);
    require("packing order", cloud, &order, &packed, (packed - order).amax() / size, tolerance)?;

    let found = (op.pseudo_inertia)(&body);
    let error = (found - second_moment).amax() / size;
    require("pseudo-inertia is the second moment", cloud, &second_moment, &found, error, tolerance)?;
    let other = sums_of(next).0;
    let sum = (op.pseudo_inertia)(&(body * 2.0 - other));
    let parts = found * 2.0 - (op.pseudo_inertia)(&other);
    let error = (sum - parts).amax() / magnitude(&[&body, &other]);
    require("pseudo-inertia is linear", &(cloud, next), &parts, &sum, error, tolerance)?;

    let verdict = (op.is_consistent)(&body);
    require("existing bodies are consistent", cloud, &true, &verdict, f64::from(u8::from(!verdict)), 0.0)?;
    if cloud.len() <= 3 {
        let verdict = (op.is_strictly_consistent)(&body);
        let law = "bodies without extent are not strictly consistent";
        require(law, cloud, &false, &verdict, f64::from(u8::from(verdict)), 0.0)?;
    }
    Ok(())
}

fn check_frames(
    op: &InertiaOperations,
    cloud: &Cloud,
    payload_cloud: &Cloud,
    a_from_b: &Pose<f64>,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let moved = |cloud: &Cloud| -> Cloud {
        cloud.iter().map(|(m, x)| (*m, a_from_b.rotation * x + a_from_b.translation.vector)).collect()
    };
    let (body, expected) = (sums_of(cloud).0, sums_of(&moved(cloud)).0);
    let found = (op.transformed_by)(&body, a_from_b);
    let size = magnitude(&[&body, &expected]);
    let inputs = (cloud, a_from_b);
    require("moved frame moves the points", &inputs, &expected, &found, distance(&found, &expected) / size, tolerance)?;

    let payload = sums_of(payload_cloud).0;
    let mut union = cloud.clone();
    union.extend(moved(payload_cloud));
    let expected = sums_of(&union).0;
    let found = (op.with_payload)(&body, &payload, a_from_b);
    let size = magnitude(&[&payload, &expected]);
    let inputs = (cloud, payload_cloud, a_from_b);
    let error = distance(&found, &expected) / size;
    require("composition is the union of points", &inputs, &expected, &found, error, tolerance)?;
    let found = (op.payload_beside)(&expected, &body, a_from_b);
    // what is subtracted is as large as the robot seen from the payload
    let lever = 1.0 + a_from_b.translation.vector.norm();
    let error = distance(&found, &payload) / (size * lever * lever);
    require("payload is combined minus robot", &inputs, &payload, &found, error, tolerance)
}

fn check_candidate(op: &InertiaOperations, candidate: &Body, tolerance: f64) -> Result<(), LawViolation> {
    let margin = triangle_margin(candidate);
    let verdict = (op.is_consistent)(candidate);
    if margin.is_none_or(|margin| margin.abs() > 1e-9) {
        let exists = margin.is_some_and(|margin| margin > 0.0);
        let error = f64::from(u8::from(exists != verdict));
        require("consistent exactly when a body exists", candidate, &exists, &verdict, error, 0.0)?;
    }
    let law = "projection gives a body";
    let failed = |error: &DynamicsError| require(law, candidate, &"a body", error, f64::INFINITY, tolerance);
    let nearest = match (op.nearest_consistent)(candidate) {
        Ok(nearest) => nearest,
        Err(error) => return failed(&error),
    };
    let shortfall = -triangle_margin(&nearest).unwrap_or(if nearest.mass < 0.0 { -1.0 } else { 0.0 });
    require(law, candidate, &"triangle inequalities", &nearest, shortfall, tolerance)?;
    let size = magnitude(&[candidate]);
    if verdict {
        let error = distance(&nearest, candidate) / size;
        require("projection keeps bodies", candidate, candidate, &nearest, error, tolerance)?;
    }
    // onto a cone: the residual is orthogonal to the answer and in the polar cone, that is, its product with every
    // point mass is not positive
    let (target, answer) = (candidate.to_vector() / size, nearest.to_vector() / size);
    let residual = target - answer;
    let polar = Matrix4::from_fn(|i, j| {
        let mut basis = Matrix4::zeros();
        basis[(i, j)] += 0.5;
        basis[(j, i)] += 0.5;
        residual.dot(&from_pseudo_inertia(&basis).to_vector())
    });
    let gain = polar.symmetric_eigenvalues().max().max(residual.dot(&answer).abs());
    require("projection is nearest", candidate, &"no closer body", &nearest, gain, tolerance)
}
