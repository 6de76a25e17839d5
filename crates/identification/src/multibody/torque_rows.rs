//! Forces of the motors and the wrench on the base, linear in the unknown parameters (4.8).

use super::layout::BODY;
use super::tree_part::TreePart;
use super::tree_sample::TreeSample;
use crate::dynamics::Multibody;
use crate::error::IdentificationError;
use nalgebra::{DMatrix, DVector, RowSVector};

/// What the log says of the motors.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Drive {
    /// Their forces or torques, N or N m.
    Force,
    /// Their currents, A.
    Current {
        /// Gain of each joint, N m/A or N/A, where it is known, and a guess where not.
        gain: Vec<f64>,
        /// Its standard deviation; infinite where it is asked for.
        std: Vec<f64>,
    },
}

/// What a joint needs besides moving its bodies, linear in a coefficient that is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum JointNuisance {
    /// Friction proportional to the rate.
    ViscousFriction,
    /// Friction with the sign of the rate.
    CoulombFriction,
    /// A constant.
    Offset,
    /// Inertia of the rotor seen through the gear.
    RotorInertia,
}

impl JointNuisance {
    /// All four.
    pub const ALL: [Self; 4] = [Self::ViscousFriction, Self::CoulombFriction, Self::Offset, Self::RotorInertia];

    /// What it is called in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::ViscousFriction => "viscous friction",
            Self::CoulombFriction => "Coulomb friction",
            Self::Offset => "offset",
            Self::RotorInertia => "rotor inertia",
        }
    }

    /// Unit of its coefficient, for a hinge.
    pub fn unit(self) -> &'static str {
        match self {
            Self::ViscousFriction => "N m s/rad",
            Self::CoulombFriction | Self::Offset => "N m",
            Self::RotorInertia => "kg m^2",
        }
    }

    /// Whether physics forbids a negative coefficient.
    pub fn is_positive(self) -> bool {
        self != Self::Offset
    }

    /// Force per unit of the coefficient.
    fn regressor(self, rate: f64, acceleration: f64) -> f64 {
        match self {
            Self::ViscousFriction => rate,
            Self::CoulombFriction if rate == 0.0 => 0.0,
            Self::CoulombFriction => rate.signum(),
            Self::Offset => 1.0,
            Self::RotorInertia => acceleration,
        }
    }
}

/// Rows of one sample, not yet whitened: bodies and nuisances in the order of the layout, without gains.
pub(super) struct TorqueRows {
    /// One row a joint.
    pub joints: DMatrix<f64>,
    /// Force of the known bodies, springs, dampers and rotors in each joint.
    pub known: Vec<f64>,
    /// Where the wrench on the base is known: its six rows and the right side.
    pub base: Option<(DMatrix<f64>, DVector<f64>)>,
}

/// The rows of one sample; `None` unless accelerations and motors are known.
pub(super) fn torque_rows(
    known: &Multibody<f64>,
    parts: &[TreePart],
    grasped: bool,
    nuisances: &[JointNuisance],
    sample: &TreeSample,
) -> Result<Option<TorqueRows>, IdentificationError> {
    let Some(motion) = sample.motion() else { return Ok(None) };
    let joints = known.joints();
    let columns = BODY * parts.len() + nuisances.len() * joints;
    let regressor = known.torque_regressor(&motion)?;
    let known_force = known.inverse_dynamics(&motion)?;
    let fill = |matrix: &mut DMatrix<f64>, row: usize, force: usize| {
        for (k, part) in parts.iter().enumerate().filter(|(_, part)| part.whole || grasped) {
            if let Some(block) = regressor.block(force, part.body) {
                let entries = RowSVector::<f64, BODY>::from(block) * part.body_from_part_parameters();
                matrix.fixed_view_mut::<1, BODY>(row, BODY * k).copy_from(&entries);
            }
        }
    };
    let mut rows = DMatrix::zeros(joints, columns);
    for joint in 0..joints {
        fill(&mut rows, joint, 6 + joint);
        for (k, nuisance) in nuisances.iter().enumerate() {
            rows[(joint, BODY * parts.len() + k * joints + joint)] =
                nuisance.regressor(motion.rates[joint], motion.accelerations[joint]);
        }
    }
    let base = sample.base_wrench.map(|wrench| {
        let mut rows = DMatrix::zeros(6, columns);
        (0..6).for_each(|row| fill(&mut rows, row, row));
        (rows, DVector::from_column_slice((wrench - known_force.base).to_vector().as_slice()))
    });
    Ok(Some(TorqueRows { joints: rows, known: known_force.joints, base }))
}
