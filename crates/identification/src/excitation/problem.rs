//! What is asked of a designed motion.

use super::channel::Channel;
use super::limits::{ChannelLimits, WrenchLimits};
use crate::error::IdentificationError;
use crate::fourier::FourierBasis;
use nalgebra::Vector6;

/// Where the limits of a design hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum LimitsHold {
    /// At all times.
    #[default]
    Everywhere,
    /// At the samples of the problem only.
    AtSamples,
}

/// A periodic motion to be found, from rest to rest, for `P` parameters: ten in space, four in the plane.
///
/// # Source
/// Thesis 4.2, the problem below (4.15).
#[derive(Clone, Debug, PartialEq)]
pub struct ExcitationProblem<const P: usize> {
    pub(super) basis: FourierBasis,
    pub(super) channels: Vec<(Channel, ChannelLimits)>,
    /// Which of the ten.
    pub(super) parameters: [usize; P],
    pub(super) samples: usize,
    pub(super) standard_deviation: Vector6<f64>,
    pub(super) wrench_limits: Option<WrenchLimits>,
    pub(super) limits_hold: LimitsHold,
}

/// All six channels move; all ten parameters are asked for, in the order of
/// [`InertialParameters::to_vector`](crate::dynamics::InertialParameters::to_vector).
pub type SpaceExcitation = ExcitationProblem<10>;

/// x, y and yaw move; mass, first moments along x and y and the inertia about z are asked for.
pub type PlanarExcitation = ExcitationProblem<4>;

impl SpaceExcitation {
    /// A motion in space, judged by its wrenches at `samples` equal steps per period, of unit standard deviation.
    ///
    /// `limits` in the order of [`Channel::ALL`].
    ///
    /// # Errors
    /// [`IdentificationError::NoFreeCoefficients`] below two harmonics; [`IdentificationError::TooManyHarmonics`] unless there
    /// are more than two samples per harmonic; [`IdentificationError::NoMotionWithinLimit`];
    /// [`IdentificationError::UnlimitedChannel`].
    pub fn try_new(
        basis: FourierBasis,
        limits: &[ChannelLimits; 6],
        samples: usize,
    ) -> Result<Self, IdentificationError> {
        let parameters = core::array::from_fn(|i| i);
        Self::of_channels(basis, &Channel::ALL, limits, parameters, samples)
    }
}

impl PlanarExcitation {
    /// A motion in the plane; `limits` in the order of [`Channel::PLANAR`].
    ///
    /// # Errors
    /// As of a [`SpaceExcitation`].
    pub fn try_new(
        basis: FourierBasis,
        limits: &[ChannelLimits; 3],
        samples: usize,
    ) -> Result<Self, IdentificationError> {
        Self::of_channels(basis, &Channel::PLANAR, limits, [0, 1, 2, 9], samples)
    }
}

impl<const P: usize> ExcitationProblem<P> {
    fn of_channels(
        basis: FourierBasis,
        channels: &[Channel],
        limits: &[ChannelLimits],
        parameters: [usize; P],
        samples: usize,
    ) -> Result<Self, IdentificationError> {
        let harmonics = basis.harmonics();
        if harmonics < 2 {
            return Err(IdentificationError::NoFreeCoefficients { harmonics });
        }
        if samples <= 2 * harmonics {
            return Err(IdentificationError::TooManyHarmonics { harmonics, samples });
        }
        for (channel, limits) in channels.iter().zip(limits) {
            limits.validated(*channel)?;
        }
        Ok(Self {
            basis,
            channels: channels.iter().copied().zip(limits.iter().copied()).collect(),
            parameters,
            samples,
            standard_deviation: Vector6::repeat(1.0),
            wrench_limits: None,
            limits_hold: LimitsHold::Everywhere,
        })
    }

    /// With wrench noise of this standard deviation per sample, `[torque; force]`, N m and N.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`].
    pub fn with_wrench_noise(mut self, standard_deviation: Vector6<f64>) -> Result<Self, IdentificationError> {
        for (index, &value) in standard_deviation.iter().enumerate() {
            if !(value.is_finite() && value > 0.0) {
                return Err(IdentificationError::NotPositive { index, value });
            }
        }
        self.standard_deviation = standard_deviation;
        Ok(self)
    }

    /// With limits on the wrench that a given body needs.
    pub fn with_wrench_limits(mut self, limits: WrenchLimits) -> Self {
        self.wrench_limits = Some(limits);
        self
    }

    /// With limits that hold there.
    pub fn with_limits_holding(mut self, limits_hold: LimitsHold) -> Self {
        self.limits_hold = limits_hold;
        self
    }

    /// Period and harmonics.
    pub fn basis(&self) -> &FourierBasis {
        &self.basis
    }

    /// The channels that move, and their limits.
    pub fn channels(&self) -> &[(Channel, ChannelLimits)] {
        &self.channels
    }

    /// Samples per period.
    pub fn samples(&self) -> usize {
        self.samples
    }
}
