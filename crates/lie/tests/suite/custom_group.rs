//! Tutorial: a group of your own.
//!
//! A warehouse shuttle moves in the plane and lifts a fork: `SE(2) x R`, built from two groups of the library. Implement
//! [`LieGroup`] once over any scalar, and `group_laws!` checks it, derivatives included.

use core::ops::{Mul, Sub};
use tumble_lie::nalgebra::{Isometry2, Matrix3, Vector2, Vector3, Vector4};
use tumble_lie::num_dual::Dual64;
use tumble_lie::strategies::{points, tangents};
use tumble_lie::{GroupAction, LieGroup, Manifold, Scalar, group_laws};

/// Pose of the shuttle on the floor and height of its fork, m.
#[derive(Clone, Copy, Debug)]
struct Shuttle<T: Scalar> {
    world_from_shuttle: Isometry2<T>,
    height_m: T,
}

/// A linear map of the tangents `[angular; linear; lift]`: block diagonal.
#[derive(Clone, Copy, Debug)]
struct ShuttleMap<T: Scalar> {
    floor: Matrix3<T>,
    lift: T,
}

fn parts<T: Scalar>(xi: &Vector4<T>) -> (Vector3<T>, T) {
    (Vector3::new(xi.x, xi.y, xi.z), xi.w)
}

fn tangent<T: Scalar>(floor: Vector3<T>, lift: T) -> Vector4<T> {
    Vector4::new(floor.x, floor.y, floor.z, lift)
}

impl<T: Scalar> Mul for ShuttleMap<T> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { floor: self.floor * other.floor, lift: self.lift * other.lift }
    }
}
impl<T: Scalar> Sub for ShuttleMap<T> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { floor: self.floor - other.floor, lift: self.lift - other.lift }
    }
}
impl<T: Scalar> Mul<Vector4<T>> for ShuttleMap<T> {
    type Output = Vector4<T>;
    fn mul(self, xi: Vector4<T>) -> Vector4<T> {
        let (floor, lift) = parts(&xi);
        tangent(self.floor * floor, self.lift * lift)
    }
}

impl<T: Scalar> Mul for Shuttle<T> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            world_from_shuttle: self.world_from_shuttle * other.world_from_shuttle,
            height_m: self.height_m + other.height_m,
        }
    }
}

impl<T: Scalar> LieGroup for Shuttle<T> {
    type Scalar = T;
    type Tangent = Vector4<T>;
    type Jacobian = ShuttleMap<T>;
    fn identity() -> Self {
        Self { world_from_shuttle: LieGroup::identity(), height_m: T::zero() }
    }
    fn inverse(&self) -> Self {
        Self { world_from_shuttle: self.world_from_shuttle.inverse(), height_m: -self.height_m }
    }
    fn exp(xi: &Vector4<T>) -> Self {
        let (floor, lift) = parts(xi);
        Self { world_from_shuttle: LieGroup::exp(&floor), height_m: lift }
    }
    fn log(&self) -> Vector4<T> {
        tangent(self.world_from_shuttle.log(), self.height_m)
    }
    fn adjoint(&self) -> ShuttleMap<T> {
        ShuttleMap { floor: self.world_from_shuttle.adjoint(), lift: T::one() }
    }
    fn coadjoint(&self) -> ShuttleMap<T> {
        ShuttleMap { floor: self.world_from_shuttle.coadjoint(), lift: T::one() }
    }
    fn bracket(a: &Vector4<T>, b: &Vector4<T>) -> Vector4<T> {
        tangent(Isometry2::bracket(&parts(a).0, &parts(b).0), T::zero())
    }
    fn right_jacobian(xi: &Vector4<T>) -> ShuttleMap<T> {
        ShuttleMap { floor: Isometry2::right_jacobian(&parts(xi).0), lift: T::one() }
    }
    fn right_jacobian_inverse(xi: &Vector4<T>) -> ShuttleMap<T> {
        ShuttleMap { floor: Isometry2::right_jacobian_inverse(&parts(xi).0), lift: T::one() }
    }
}

/// Where a point fixed to the fork is: floor coordinates and height.
impl<T: Scalar> GroupAction<Vector3<T>> for Shuttle<T> {
    fn act(&self, point: &Vector3<T>) -> Vector3<T> {
        let floor = self.world_from_shuttle.act(&Vector2::new(point.x, point.y));
        Vector3::new(floor.x, floor.y, point.z + self.height_m)
    }
}

// The first coordinate is an angle, the other three are lengths.
group_laws!(shuttle, Shuttle<f64>, tangents::<Vector4<f64>>(1), dual = Shuttle<Dual64>, points = points::<3>());

/// Generic code sees no difference between this group and those of the library.
fn midpoint<G: LieGroup<Scalar = f64>>(a: &G, b: &G) -> G {
    a.interpolate(b, 0.5)
}

#[test]
fn works_where_every_group_works() {
    let start = Shuttle::<f64>::identity();
    let end = start.oplus(&Vector4::new(1.0, 2.0, 0.0, 0.4));
    let half = midpoint(&start, &end);
    assert!((half.height_m - 0.2).abs() < 1e-15);
    assert!((half.world_from_shuttle.rotation.angle() - 0.5).abs() < 1e-15);
}
