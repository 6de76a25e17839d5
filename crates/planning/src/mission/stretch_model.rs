//! Models whose plans can be flown as stretches.

use super::motion::MissionMotion;
use crate::belief::ModelBelief;
use crate::local::{InformativeModel, Kinematics, LocalTrajectory, PlanarBodyModel, PlanarState, RigidBodyModel};
use nalgebra::{UnitQuaternion, Vector2};

/// A model whose states and plans are those of a body in space.
///
/// # Example
/// ```
/// use tumble_planning::local::{Kinematics, PlanarBodyModel};
/// use tumble_planning::mission::StretchModel;
/// use tumble_planning::lie::Pose;
///
/// let model = PlanarBodyModel::mass_and_inertia();
/// let flat = model.state_of(&Kinematics::at_rest(Pose::translation(1.0, 2.0, 3.0)));
/// assert_eq!((flat.position_world.x, flat.position_world.y, flat.heading_rad), (1.0, 2.0, 0.0));
/// ```
/// Tutorial: [stretches of any model](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/src/mission/informative_stretch.rs).
pub trait StretchModel<const X: usize, const U: usize, const P: usize>: InformativeModel<X, U, P> {
    /// Of each coordinate of a change of a state, what it belongs to: 0 position, 1 velocity, 2 attitude, 3 rate.
    const GROUPS: [usize; X];
    /// Which inputs are torques; the others are forces.
    const IS_TORQUE: [bool; U];

    /// The state of a body that moves so; what the model has no coordinates for is left out.
    fn state_of(&self, motion: &Kinematics) -> Self::State;

    /// The motion of a plan made with a belief.
    fn motion(&self, trajectory: &LocalTrajectory<Self::State, U, P>, belief: &ModelBelief) -> MissionMotion;
}

impl<const P: usize> StretchModel<12, 6, P> for RigidBodyModel<P> {
    const GROUPS: [usize; 12] = [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3];
    const IS_TORQUE: [bool; 6] = [true, true, true, false, false, false];

    fn state_of(&self, motion: &Kinematics) -> Kinematics {
        *motion
    }

    fn motion(&self, trajectory: &LocalTrajectory<Kinematics, 6, P>, belief: &ModelBelief) -> MissionMotion {
        MissionMotion::planned(trajectory, belief.parameters())
    }
}

impl<const P: usize> StretchModel<6, 3, P> for PlanarBodyModel<P> {
    const GROUPS: [usize; 6] = [0, 0, 1, 1, 2, 3];
    const IS_TORQUE: [bool; 3] = [true, false, false];

    fn state_of(&self, motion: &Kinematics) -> PlanarState {
        let (position, velocity) = (motion.position_world(), motion.velocity_world);
        PlanarState {
            position_world: Vector2::new(position.x, position.y),
            velocity_world: Vector2::new(velocity.x, velocity.y),
            heading_rad: heading_rad(&motion.world_from_body.rotation),
            rate_rad_s: motion.rate_body.z,
        }
    }

    fn motion(&self, trajectory: &LocalTrajectory<PlanarState, 3, P>, belief: &ModelBelief) -> MissionMotion {
        MissionMotion::planned_in_plane(trajectory, self.height_m(), belief.parameters())
    }
}

/// Angle of the turn about z in an attitude, rad.
fn heading_rad(attitude: &UnitQuaternion<f64>) -> f64 {
    2.0 * libm::atan2(attitude.k, attitude.w)
}
