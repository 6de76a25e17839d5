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

/// Shares of a force that are asked for, until what that takes is there.
const GIVING_WAY: [f64; 9] = [1.0, 0.875, 0.75, 0.625, 0.5, 0.375, 0.25, 0.125, 0.0];

impl BrakeLimits {
    /// The wrench, cut to what there is.
    pub(super) fn within(&self, wrench_body: &Wrench<f64>) -> Wrench<f64> {
        let force = wrench_body.force.zip_map(&self.force_n, |force, most| force.clamp(-most, most));
        Wrench::new(shortened(wrench_body.torque, self.torque_n_m).0, force)
    }

    /// What to ask of actuators that are compensated for, cut to what there is: where it is not enough the force gives way to the torque. A force that is
    /// cut leaves the torque that was to hold against its side effects, and a robot that spins is lost. `None` where nothing is to be compensated.
    pub(super) fn giving_way(
        &self,
        wanted: &Wrench<f64>,
        compensated: impl Fn(&Wrench<f64>) -> Option<Wrench<f64>>,
    ) -> Option<Wrench<f64>> {
        let mut cut = None;
        for share in GIVING_WAY {
            let asked = compensated(&Wrench::new(wanted.torque, wanted.force * share))?;
            let within = self.within(&asked);
            cut = Some(within);
            if within == asked {
                break;
            }
        }
        cut
    }

    /// Shares of force and torque that are left where so much is needed to hold against what else acts: zero to one.
    pub(super) fn shares_left(&self, held: &Wrench<f64>) -> [f64; 2] {
        let force = held.force.abs().component_div(&self.force_n).max();
        let torque = length(&held.torque) / self.torque_n_m;
        [force, torque].map(|share| f64::max(0.0, 1.0 - share))
    }

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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use nalgebra::{Matrix3, UnitQuaternion};
    use tumble_dynamics::{FreeFlyer, Integrator, MuntheKaas4};
    use tumble_lie::Pose;

    const STEP_S: f64 = 0.016;
    const LIMITS: BrakeLimits = BrakeLimits { force_n: Vector3::new(0.45, 0.2, 0.25), torque_n_m: 0.02 };

    fn body(factor: f64) -> InertialParameters<f64> {
        let inertia = Matrix3::new(0.18, 0.01, -0.01, 0.01, 0.19, 0.005, -0.01, 0.005, 0.22);
        InertialParameters::about_com(12.0 * factor, Vector3::new(0.03, -0.02, 0.01), inertia * factor)
    }

    fn moving(twist_body: Twist<f64>) -> RigidBodyState<f64> {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.8, 1.1));
        RigidBodyState { world_from_body: Pose::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), turn), twist_body }
    }

    fn center(body: &InertialParameters<f64>, state: &RigidBodyState<f64>) -> [Vector3<f64>; 2] {
        let (pose, offset) = (&state.world_from_body, body.center_of_mass());
        let velocity = state.twist_body.linear + state.twist_body.angular.cross(&offset);
        [pose.translation.vector + pose.rotation * offset, pose.rotation * velocity]
    }

    /// Braked until that is soft, or so long; the state then, and the time.
    fn braked(believed: &InertialParameters<f64>, truth: &InertialParameters<f64>) -> (RigidBodyState<f64>, f64) {
        let mut state = moving(Twist::new(Vector3::new(0.02, -0.01, 0.03), Vector3::new(0.04, 0.03, -0.02)));
        let until_s = LIMITS.braking(believed, &state.twist_body).until_s(0.0);
        let mut time_s = 0.0;
        while time_s < until_s {
            let braking = LIMITS.braking(believed, &state.twist_body);
            let Wrench { torque, force } = braking.wrench_body;
            assert!(torque.norm() <= LIMITS.torque_n_m * (1.0 + 1e-12), "{torque}");
            assert!(force.abs().component_div(&LIMITS.force_n).max() <= 1.0 + 1e-12, "{force}");
            if braking.is_soft {
                break;
            }
            state = MuntheKaas4.step(&FreeFlyer::new(*truth), &state, &braking.wrench_body, 0.0, STEP_S).unwrap();
            time_s += STEP_S;
        }
        (state, time_s)
    }

    #[test]
    fn the_centre_of_mass_stays_on_its_line_and_stops_as_soon_as_the_force_allows() {
        let body = body(1.0);
        let start = moving(Twist::new(Vector3::new(0.02, -0.01, 0.03), Vector3::new(0.04, 0.03, -0.02)));
        let ([from, velocity], braking) = (center(&body, &start), LIMITS.braking(&body, &start.twist_body));
        let (state, time_s) = braked(&body, &body);
        let [to, left] = center(&body, &state);
        let (ahead, travelled) = (velocity.normalize(), to - from);
        assert!((travelled - ahead * ahead.dot(&travelled)).norm() < 1e-3, "{travelled} {ahead}");
        // all along its line the force is at its limit, which turns with the body by a degree or so
        let least_m = velocity.norm_squared() * body.mass / (2.0 * braking.wrench_body.force.norm());
        assert!(travelled.norm() < 1.05 * least_m, "{} {least_m}", travelled.norm());
        assert!(left.norm() < 0.1 * velocity.norm() && state.twist_body.angular.norm() < 0.01, "{left} {state:?}");
        assert!(time_s < 1.1 * braking.left_s, "{time_s} {}", braking.left_s);
    }

    #[test]
    fn a_force_beside_the_centre_of_mass_does_not_turn_the_body() {
        let (believed, start) = (body(1.0), moving(Twist::new(Vector3::zeros(), Vector3::new(0.05, 0.02, 0.0))));
        let Wrench { torque, force } = LIMITS.braking(&believed, &start.twist_body).wrench_body;
        assert!((torque - believed.center_of_mass().cross(&force)).norm() < 1e-12 && force.norm() > 0.1);
    }

    #[test]
    fn a_body_of_another_mass_is_braked_all_the_same() {
        for factor in [0.5, 2.0] {
            let (state, _) = braked(&body(1.0), &body(factor));
            assert!(state.twist_body.linear.norm() < 0.006, "{factor}: {state:?}");
        }
    }

    /// A force along x that also turns about z: half of it is all that can be held.
    #[test]
    fn a_force_gives_way_to_the_torque_that_holds_against_it() {
        let arm_m = 2.0 * LIMITS.torque_n_m / LIMITS.force_n.x;
        let held = |wrench: &Wrench<f64>| {
            let against = Vector3::new(0.0, 0.0, arm_m * wrench.force.x);
            Some(Wrench::new(wrench.torque - against, wrench.force))
        };
        let full = Wrench::new(Vector3::zeros(), Vector3::new(LIMITS.force_n.x, 0.0, 0.0));
        let asked = LIMITS.giving_way(&full, held).unwrap();
        assert_eq!((asked.force.x, asked.torque.z), (0.5 * LIMITS.force_n.x, -LIMITS.torque_n_m));
        let little = Wrench::new(Vector3::zeros(), full.force * 0.1);
        assert_eq!(LIMITS.giving_way(&little, held), held(&little));
        // a torque alone that is too large is cut
        let turn = Wrench::new(Vector3::new(0.0, 3.0 * LIMITS.torque_n_m, 0.0), full.force);
        let asked = LIMITS.giving_way(&turn, held).unwrap();
        assert!(asked.force == Vector3::zeros() && (asked.torque.y - LIMITS.torque_n_m).abs() < 1e-15, "{asked:?}");
        assert_eq!(LIMITS.giving_way(&full, |_| None), None);
    }

    #[test]
    fn what_hardly_moves_needs_no_brake() {
        let still = LIMITS.braking(&body(1.0), &Twist::zero());
        assert!(still.is_soft && still.left_s == 0.0 && still.wrench_body == Wrench::zero());
        let state = moving(Twist::new(Vector3::repeat(1e-3), Vector3::repeat(1e-3)));
        assert!(LIMITS.braking(&body(1.0), &state.twist_body).is_soft);
        let motion = still.motion(&moving(Twist::zero()), 5.0);
        assert!((motion.rest_s() - 5.0).abs() < 1e-12);
    }
}
