//! From a plan and a measured state to a wrench, with a bound on the error that holds.
//!
//! The way through: a [`Controller`] adopts a belief and answers each [`ControlRequest`] with a [`ControlCommand`].
//!
//! # Source
//! Thesis 2.4.2, 6.2.3.

mod controller;
mod coupled_axes;
mod mass_interval;
mod obstacle_planes;

pub use controller::{Adoption, ControlCommand, ControlRequest, Controller, Fallback, FallbackReason, ReferenceMotion};
pub use coupled_axes::AxisPlane;
pub use mass_interval::MassInterval;
pub use obstacle_planes::{EndAttitude, NominalPath, ObstaclePlane, ObstaclePlanes, PlaneUpdate, Reach, barriers_of};
