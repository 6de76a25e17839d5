//! Attitude as smooth functions of time: coordinates, and how their derivatives make angular velocity.

use crate::lie::EulerZyx;
use nalgebra::{Quaternion, SMatrix, UnitQuaternion, Vector3, Vector4};

/// Coordinates in which an attitude is a Fourier series.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum AttitudeChart {
    /// Roll, pitch and yaw: three channels, good while pitch stays away from a quarter turn. The thesis's.
    #[default]
    EulerZyx,
    /// The four components `[x, y, z, w]` of a quaternion of any length: good for all attitudes, with more harmonics.
    Quaternion,
}

/// Angular velocity per coordinate rate, `w = map * rate`: as many columns as the chart has channels, the rest zero.
pub(super) type RateMap = SMatrix<f64, 3, 4>;

/// Attitude at one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attitude {
    pub world_from_body: UnitQuaternion<f64>,
    /// Angular velocity per coordinate rate and its first two derivatives by time. The map also carries coordinate
    /// changes to rotations in body axes.
    pub map: [RateMap; 3],
}

impl AttitudeChart {
    /// Number of coordinates.
    pub fn channels(self) -> usize {
        match self {
            Self::EulerZyx => 3,
            Self::Quaternion => 4,
        }
    }

    /// The coordinates of an attitude; of the two quaternions the one nearer to `near`.
    pub fn coordinates(self, world_from_body: &UnitQuaternion<f64>, near: &Vector4<f64>) -> Vector4<f64> {
        match self {
            Self::EulerZyx => {
                let angles = EulerZyx::from_rotation(world_from_body);
                // The turns that keep roll and yaw continuous.
                let unwrapped = |angle: f64, near: f64| {
                    angle + core::f64::consts::TAU * ((near - angle) / core::f64::consts::TAU).round()
                };
                Vector4::new(unwrapped(angles.roll, near.x), angles.pitch, unwrapped(angles.yaw, near.z), 0.0)
            }
            Self::Quaternion => {
                let components = world_from_body.coords;
                if components.dot(near) < 0.0 { -components } else { components }
            }
        }
    }

    /// Attitude from coordinates and their derivatives by time; `None` at the quaternion zero.
    pub(super) fn attitude(
        self,
        x: &Vector4<f64>,
        rate: &Vector4<f64>,
        acceleration: &Vector4<f64>,
    ) -> Option<Attitude> {
        match self {
            Self::EulerZyx => Some(euler(x, rate, acceleration)),
            Self::Quaternion => quaternion(x, rate, acceleration),
        }
    }
}

fn euler(x: &Vector4<f64>, rate: &Vector4<f64>, acceleration: &Vector4<f64>) -> Attitude {
    let ((sr, cr), (sp, cp)) = (x.x.sin_cos(), x.y.sin_cos());
    let (r1, p1, r2, p2) = (rate.x, rate.y, acceleration.x, acceleration.y);
    // Columns: the axes of roll, pitch and yaw in body axes.
    let columns = |pitch_axis: Vector3<f64>, yaw_axis: Vector3<f64>, roll_axis: Vector3<f64>| {
        let mut map = RateMap::zeros();
        map.set_column(0, &roll_axis);
        map.set_column(1, &pitch_axis);
        map.set_column(2, &yaw_axis);
        map
    };
    // First and second derivatives of the products that make up the yaw axis.
    let (cs, cc) = (cp * sr, cp * cr);
    let (ss, sc) = (sp * sr, sp * cr);
    let squares = r1 * r1 + p1 * p1;
    let map = [
        columns(Vector3::new(0.0, cr, -sr), Vector3::new(-sp, cs, cc), Vector3::x()),
        columns(
            Vector3::new(0.0, -sr * r1, -cr * r1),
            Vector3::new(-cp * p1, cc * r1 - ss * p1, -cs * r1 - sc * p1),
            Vector3::zeros(),
        ),
        columns(
            Vector3::new(0.0, -sr * r2 - cr * r1 * r1, -cr * r2 + sr * r1 * r1),
            Vector3::new(
                -cp * p2 + sp * p1 * p1,
                cc * r2 - ss * p2 - cs * squares - 2.0 * sc * r1 * p1,
                -cs * r2 - sc * p2 - cc * squares + 2.0 * ss * r1 * p1,
            ),
            Vector3::zeros(),
        ),
    ];
    Attitude { world_from_body: EulerZyx::new(x.x, x.y, x.z).to_rotation(), map }
}

/// `2 [w I + S(v)^T, -v]` of a quaternion `(v, w)`: twice the vector part of `conj(q) o dq`, linear in q.
fn twice_left(q: &Vector4<f64>) -> RateMap {
    RateMap::new(
        q.w, q.z, -q.y, -q.x, //
        -q.z, q.w, q.x, -q.y, //
        q.y, -q.x, q.w, -q.z,
    ) * 2.0
}

fn quaternion(x: &Vector4<f64>, rate: &Vector4<f64>, acceleration: &Vector4<f64>) -> Option<Attitude> {
    let world_from_body = UnitQuaternion::try_new(Quaternion::from(*x), f64::MIN_POSITIVE)?;
    // One over the squared length, and its derivatives.
    let square = x.norm_squared();
    let first = 2.0 * x.dot(rate);
    let second = 2.0 * (rate.norm_squared() + x.dot(acceleration));
    let inverse = 1.0 / square;
    let inverse_first = -first * inverse * inverse;
    let inverse_second = (2.0 * first * first * inverse - second) * inverse * inverse;
    let [l0, l1, l2] = [twice_left(x), twice_left(rate), twice_left(acceleration)];
    let map = [
        l0 * inverse,
        l1 * inverse + l0 * inverse_first,
        l2 * inverse + l1 * (2.0 * inverse_first) + l0 * inverse_second,
    ];
    Some(Attitude { world_from_body, map })
}
