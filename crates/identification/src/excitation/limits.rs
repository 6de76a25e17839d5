//! What a designed motion may not exceed.

use super::channel::{Channel, Limit};
use crate::dynamics::{InertialParameters, WrenchBox};
use crate::error::IdentificationError;
use nalgebra::{SVector, Vector6};

/// How far and how fast one channel may go; infinity where there is no limit.
///
/// # Units
/// m or rad, per second, per second squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelLimits {
    /// Lower end of the workspace, below zero: the motion starts at zero.
    pub lower: f64,
    /// Upper end of the workspace, above zero.
    pub upper: f64,
    /// Largest size of the rate.
    pub rate: f64,
    /// Largest size of the acceleration.
    pub acceleration: f64,
}

impl ChannelLimits {
    /// The same to both sides.
    pub fn symmetric(workspace: f64, rate: f64, acceleration: f64) -> Self {
        Self { lower: -workspace, upper: workspace, rate, acceleration }
    }

    /// A workspace, and no limit to rate and acceleration.
    pub fn within(workspace: f64) -> Self {
        Self::symmetric(workspace, f64::INFINITY, f64::INFINITY)
    }

    /// Lower and upper end of value, rate and acceleration.
    pub(super) fn intervals(&self) -> [[f64; 2]; 3] {
        [[self.lower, self.upper], [-self.rate, self.rate], [-self.acceleration, self.acceleration]]
    }

    /// Refuses what leaves no room, and what leaves the channel without a limit.
    pub(super) fn validated(&self, channel: Channel) -> Result<(), IdentificationError> {
        let sizes = [
            // Of a workspace that is the same to both sides the upper end is the number that was stated.
            (Limit::Upper, self.upper),
            (Limit::Lower, -self.lower),
            (Limit::Rate, self.rate),
            (Limit::Acceleration, self.acceleration),
        ];
        for (limit, size) in sizes {
            if size.is_nan() || size <= 0.0 {
                let value = if limit == Limit::Lower { self.lower } else { size };
                return Err(IdentificationError::NoMotionWithinLimit { channel, limit, value });
            }
        }
        let bounded = |[lower, upper]: [f64; 2]| lower.is_finite() && upper.is_finite();
        if self.intervals().into_iter().any(bounded) {
            Ok(())
        } else {
            Err(IdentificationError::UnlimitedChannel { channel })
        }
    }
}

/// Limits on the wrench that a known body needs to move so: `normal . [torque; force] <= bound` for each half-space.
///
/// # Frame
/// Body axes, torque about the body origin.
/// # Units
/// N m and N.
#[derive(Clone, Debug, PartialEq)]
pub struct WrenchLimits {
    parameters: SVector<f64, 10>,
    half_spaces: Vec<(Vector6<f64>, f64)>,
}

impl WrenchLimits {
    /// Of half-spaces that hold the zero wrench inside.
    ///
    /// # Errors
    /// [`IdentificationError::NoMotionWithinWrenchLimit`] for a bound that is not positive;
    /// [`IdentificationError::NotFinite`] naming the half-space with a normal that is not finite, or after the last one for a
    /// body that is not.
    pub fn try_new(
        body: &InertialParameters<f64>,
        half_spaces: Vec<(Vector6<f64>, f64)>,
    ) -> Result<Self, IdentificationError> {
        for (half_space, (normal, bound)) in half_spaces.iter().enumerate() {
            if !normal.iter().all(|component| component.is_finite()) {
                return Err(IdentificationError::NotFinite { row: half_space });
            }
            if bound.is_nan() || *bound <= 0.0 {
                return Err(IdentificationError::NoMotionWithinWrenchLimit { half_space, bound: *bound });
            }
        }
        let parameters = body.to_vector();
        if !parameters.iter().all(|parameter| parameter.is_finite()) {
            return Err(IdentificationError::NotFinite { row: half_spaces.len() });
        }
        // An infinite bound is none.
        let half_spaces = half_spaces.into_iter().filter(|(_, bound)| bound.is_finite()).collect();
        Ok(Self { parameters, half_spaces })
    }

    /// Of a box: half-spaces `[torque x, -torque x, torque y, .. -force z]`.
    ///
    /// # Errors
    /// As [`try_new`](Self::try_new).
    pub fn of_box(body: &InertialParameters<f64>, limits: &WrenchBox) -> Result<Self, IdentificationError> {
        let bounds = limits.torque_limit.iter().chain(&limits.force_limit);
        let sides = bounds.enumerate().flat_map(|(axis, &bound)| {
            [1.0, -1.0].map(|sign| (Vector6::from_fn(|i, _| if i == axis { sign } else { 0.0 }), bound))
        });
        Self::try_new(body, sides.collect())
    }

    /// The body's parameters.
    pub fn parameters(&self) -> &SVector<f64, 10> {
        &self.parameters
    }

    /// Normals over `[torque; force]` and bounds.
    pub fn half_spaces(&self) -> &[(Vector6<f64>, f64)] {
        &self.half_spaces
    }
}
