//! Likelihood of linear-Gaussian state-space models with unknown inputs, and its maximum over what enters nonlinearly.
//!
//! A regression of a differentiated measurement on a noisy input has errors on both sides, and no filter cures that: the
//! two directions of the regression bracket the truth. Here the measurement is left as it is and the motion between
//! measurements is the model:
//!
//! `x[k+1] = F x[k] + U[k] [1; b] + process noise`, `y[k] = H x[k] + measurement noise`,
//!
//! where `b` holds what enters linearly (a reciprocal mass, a bias, the initial state) and `F`, `U` and the noise depend
//! on what does not (a delay, a lag, a drag, the noise levels). [`AugmentedKalmanFilter`] gives the likelihood with `b`
//! eliminated exactly, [`maximize_likelihood`] climbs it over the rest and puts the uncertainty of both together.
//!
//! # Source
//! The data and every column of `U` run through one Kalman filter: de Jong, "The diffuse Kalman filter", Annals of
//! Statistics 19 (1991).

mod augmented_filter;
mod likelihood_maximum;
mod signal;

pub use augmented_filter::{AugmentedKalmanFilter, Evidence, LinearEstimate};
pub use likelihood_maximum::{LikelihoodMaximum, Parameter, maximize_likelihood};
pub use signal::Signal;
