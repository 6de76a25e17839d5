use crate::dynamics::{BodyAcceleration, GeneralizedMotion, Multibody};
use crate::error::IdentificationError;
use crate::lie::{Pose, Twist, Wrench};

/// What is known of a tree of bodies at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeSample {
    /// Time, s.
    pub time_s: f64,
    /// Pose of the base in the inertial frame; the identity on a fixed base.
    pub world_from_base: Pose<f64>,
    /// Measured twist of the base origin, base axes.
    pub base_twist: Twist<f64>,
    /// Joint positions, rad or m.
    pub positions: Vec<f64>,
    /// Measured joint rates, rad/s or m/s.
    pub rates: Vec<f64>,
    /// Accelerations, where they are known: the torque form needs them.
    pub accelerations: Option<TreeAcceleration>,
    /// Forces of the motors, N m or N, or their currents, A: see [`Drive`](super::Drive).
    pub motors: Option<Vec<f64>>,
    /// Wrench on the base besides gravity, base axes, held until the next sample; zero where nothing acts.
    pub base_wrench: Option<Wrench<f64>>,
}

/// Accelerations of the base and the joints.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeAcceleration {
    /// Of the base relative to free fall (what an ideal accelerometer at its origin reads), base axes.
    pub base: BodyAcceleration<f64>,
    /// Of the joints, rad/s^2 or m/s^2.
    pub joints: Vec<f64>,
}

impl TreeSample {
    /// The motion, where accelerations are known.
    pub(super) fn motion(&self) -> Option<GeneralizedMotion<'_, f64>> {
        self.accelerations.as_ref().map(|accelerations| GeneralizedMotion {
            base_twist: self.base_twist,
            base_acceleration: accelerations.base,
            positions: &self.positions,
            rates: &self.rates,
            accelerations: &accelerations.joints,
        })
    }

    /// Itself, if its lists fit the tree and every number is finite.
    pub(super) fn checked(&self, index: usize, tree: &Multibody<f64>) -> Result<&Self, IdentificationError> {
        let joints = tree.joints();
        let accelerations = self.accelerations.as_ref().map(|a| a.joints.as_slice());
        let lists = [Some(self.positions.as_slice()), Some(&self.rates), accelerations, self.motors.as_deref()];
        for list in lists.into_iter().flatten() {
            if list.len() != joints {
                return Err(IdentificationError::Dynamics(crate::dynamics::DynamicsError::JointCount {
                    expected: joints,
                    found: list.len(),
                }));
            }
            if !list.iter().all(|x| x.is_finite()) {
                return Err(IdentificationError::NotFinite { row: index });
            }
        }
        let base = self.base_twist.to_vector().sum() + self.world_from_base.translation.vector.sum();
        if base.is_finite() && self.time_s.is_finite() {
            Ok(self)
        } else {
            Err(IdentificationError::NotFinite { row: index })
        }
    }
}
