//! Braking with all there is, where a gentle stop would hit something.

use super::motion::{MissionMotion, StopLimits};
use nalgebra::Vector3;
use tumble_dynamics::{InertialParameters, RigidBodyState};
use tumble_lie::{Twist, Wrench};

/// Within this time the brake would end a motion that is slow enough not to need all there is, s.
const SOFT_S: f64 = 0.1;
/// So many times as long as it should take, the brake brakes at most: for a body that is heavier than believed.
const PATIENCE: f64 = 2.0;

/// What a brake may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakeLimits {
    /// Largest force along each body axis, N; positive.
    pub force_n: Vector3<f64>,
    /// Largest norm of the torque about the body origin, N m; positive.
    pub torque_n_m: f64,
}

/// What the limits make of the wish to be at rest at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Braking {
    /// Body axes, torque about the body origin.
    pub wrench_body: Wrench<f64>,
    /// How long it lasts at this wrench until nothing moves, s.
    pub left_s: f64,
    /// Whether less than the limits would do.
    pub is_soft: bool,
    /// How hard it brakes.
    limits: StopLimits,
}

impl BrakeLimits {
    /// A force against the velocity of the centre of mass, so that it stays on its line, with the torque that lets this force turn
    /// nothing; what is left of the torque is against the rate.
    pub(super) fn braking(&self, body: &InertialParameters<f64>, twist_body: &Twist<f64>) -> Braking {
        let (center, inertia) = (body.center_of_mass(), body.inertia_about_com());
        let rate = twist_body.angular;
        let velocity = twist_body.linear + rate.cross(&center);
        let (momentum, spin) = (velocity * body.mass, inertia * rate);
        let wanted = -momentum / SOFT_S;
        let excess = wanted.abs().component_div(&self.force_n).max();
        let force = if excess > 1.0 { wanted / excess } else { wanted };
        let (held, _) = shortened(center.cross(&force), self.torque_n_m);
        let (turn, is_cut) = shortened(-spin / SOFT_S, self.torque_n_m - length(&held));
        // the gyroscopic part of so slow a turn is small, and does no work
        let (along_s, about_s) = (time_s(length(&momentum), length(&force)), time_s(length(&spin), length(&turn)));
        Braking {
            wrench_body: Wrench::new(held + turn, force),
            left_s: f64::max(along_s, about_s),
            is_soft: excess <= 1.0 && !is_cut,
            limits: StopLimits {
                acceleration_m_s2: length(&velocity) / along_s,
                angular_acceleration_rad_s2: length(&rate) / about_s,
            },
        }
    }
}

impl Braking {
    /// What it makes of a state.
    pub fn motion(&self, state: &RigidBodyState<f64>, time_s: f64) -> MissionMotion {
        MissionMotion::stopping_from(state, time_s, &self.limits)
    }

    /// When to give up, s.
    pub fn until_s(&self, time_s: f64) -> f64 {
        time_s + PATIENCE * self.left_s
    }
}

/// Time in which something is used up at a rate; none where there is nothing.
fn time_s(what: f64, rate: f64) -> f64 {
    if what > 0.0 { what / rate } else { 0.0 }
}

/// The vector, no longer than this, and whether it was.
fn shortened(vector: Vector3<f64>, most: f64) -> (Vector3<f64>, bool) {
    let norm = length(&vector);
    if norm > most { (vector * (most / norm), true) } else { (vector, false) }
}

fn length(vector: &Vector3<f64>) -> f64 {
    f64::sqrt(vector.norm_squared())
}
