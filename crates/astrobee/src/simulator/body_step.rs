//! A body that changes at once, unannounced.

use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::Vector3;
use tumble_lie::Pose;

/// A body that changes at once, with what comes or goes moving as the robot does: the twist stays.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum BodyStep {
    /// All ten parameters times a factor: more or less of the same.
    Scaled(f64),
    /// A ball added to the robot.
    Lump {
        /// Its mass over that of the whole.
        mass_share: f64,
        /// Its centre, body axes, m.
        center_body: Vector3<f64>,
        /// Its radius, m; of uniform density.
        radius_m: f64,
    },
}

impl BodyStep {
    /// The robot after it; robot and payload weighed `whole_kg`.
    pub(super) fn of_robot(&self, robot: &InertialParameters<f64>, whole_kg: f64) -> InertialParameters<f64> {
        match *self {
            Self::Scaled(factor) => *robot * factor,
            Self::Lump { mass_share, center_body, radius_m } => {
                let ball = InertialParameters::solid_sphere(mass_share * whole_kg, radius_m);
                let [x, y, z] = center_body.into();
                robot.with_payload(&ball, &Pose::translation(x, y, z))
            }
        }
    }

    /// The payload after it, about the origin of its own frame.
    pub(super) fn of_payload(&self, payload: &InertialParameters<f64>) -> InertialParameters<f64> {
        match *self {
            Self::Scaled(factor) => *payload * factor,
            Self::Lump { .. } => *payload,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::{AstrobeeSimulator, Grasp, PayloadMotion, SimulatorSettings};
    use crate::worlds::WorldPreset;
    use tumble_dynamics::{Plant, RigidBodyState};
    use tumble_lie::{Twist, Wrench};

    fn flying() -> AstrobeeSimulator {
        let start = RigidBodyState {
            world_from_body: WorldPreset::Iss.pose("A").unwrap(),
            twist_body: Twist::new(Vector3::new(0.02, -0.03, 0.01), Vector3::new(0.01, 0.03, -0.02)),
        };
        let mut robot = AstrobeeSimulator::try_new(SimulatorSettings::ideal(WorldPreset::Iss, start)).unwrap();
        let payload = InertialParameters::solid_box(2.0, [0.2, 0.1, 0.1]);
        let grasp = Grasp { payload, robot_from_payload: Pose::translation(0.2, 0.05, 0.1) };
        robot.attach(grasp, PayloadMotion::WithRobot).unwrap();
        robot
    }

    /// The twist stays, and the push of a wrench is that of the new body.
    #[test]
    fn a_scaled_body_keeps_its_twist_and_answers_with_the_inverse_factor() {
        for factor in [0.5, 0.9, 1.1, 1.5] {
            let (mut same, mut other) = (flying(), flying());
            other.step_body(&BodyStep::Scaled(factor)).unwrap();
            assert_eq!(same.state(), other.state());
            assert!((other.body().mass - factor * same.body().mass).abs() < 1e-12);
            let push = Wrench::new(Vector3::new(0.01, -0.02, 0.015), Vector3::new(0.2, 0.1, -0.1));
            // a body of the same shape: free motion is the same, what a wrench adds is not
            let [none, pushed] = [Wrench::zero(), push].map(|wrench| {
                let (mut a, mut b) = (flying(), flying());
                b.step_body(&BodyStep::Scaled(factor)).unwrap();
                [a.advance(&wrench, 0.016).unwrap().start, b.advance(&wrench, 0.016).unwrap().start]
                    .map(|truth| truth.acceleration_origin_body)
            });
            let (added, added_after) = (pushed[0] - none[0], pushed[1] - none[1]);
            assert!((added_after * factor - added).amax() < 1e-12 && added.norm() > 0.01, "{factor}");
            // released, the payload has changed too
            assert!(
                (other.release().unwrap().payload.mass - factor * same.release().unwrap().payload.mass).abs() < 1e-12
            );
        }
    }

    #[test]
    fn a_lump_moves_the_center_of_mass_towards_itself() {
        let mut robot = flying();
        let before = robot.body();
        let center_body = Vector3::new(0.1, -0.12, 0.05);
        robot.step_body(&BodyStep::Lump { mass_share: 0.5, center_body, radius_m: 0.1 }).unwrap();
        let after = robot.body();
        assert!((after.mass - 1.5 * before.mass).abs() < 1e-12);
        let expected = (before.center_of_mass() + center_body * 0.5) / 1.5;
        assert!((after.center_of_mass() - expected).amax() < 1e-12);
        assert!((robot.release().unwrap().payload.mass - 2.0).abs() < 1e-15);
    }

    #[test]
    fn what_would_leave_no_body_is_refused_and_changes_nothing() {
        let mut robot = flying();
        let before = robot.body();
        let lump = BodyStep::Lump { mass_share: -0.9, center_body: Vector3::new(0.3, 0.0, 0.0), radius_m: 0.1 };
        for step in [BodyStep::Scaled(0.0), BodyStep::Scaled(-1.0), BodyStep::Scaled(f64::NAN), lump] {
            assert!(robot.step_body(&step).is_err(), "{step:?}");
            assert_eq!(robot.body(), before);
        }
    }
}
