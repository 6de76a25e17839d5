//! Periodic motions as truncated Fourier series: what excitation is designed as, and what the measured motion is fitted with.
//!
//! All scalars are `f64`, standard-library mathematics: this is work before and after the flight.

mod attitude;
mod basis;
mod extremes;
mod motion;

pub use attitude::AttitudeChart;
pub use basis::FourierBasis;
pub use extremes::ChannelExtremes;
pub use motion::{FourierMotion, MOTION_TERMS, MotionInstant};
