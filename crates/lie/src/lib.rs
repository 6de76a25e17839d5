#![doc = include_str!("../README.md")]
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![cfg_attr(not(test), deny(clippy::indexing_slicing))]

pub use nalgebra;
#[cfg(feature = "dual")]
pub use num_dual;

mod error;
mod group;
mod scalar;
pub mod series;
mod skew;
mod spatial;

pub mod dual_quaternion;
mod euler;
mod increment_chart;
mod product;
pub mod quaternion;
pub mod se2;
pub mod se3;
pub mod so2;
pub mod so3;
pub mod translation;

#[cfg(feature = "testing")]
pub mod laws;
#[cfg(feature = "testing")]
pub mod strategies;

pub use dual_quaternion::{rate_from_twist_body, twist_body_from_rate};
pub use error::LieError;
pub use euler::EulerZyx;
pub use group::{GroupAction, LieGroup, Manifold};
pub use increment_chart::Increment;
pub use product::{BlockDiagonal, Product, Stacked};
pub use quaternion::{from_wxyz, from_xyzw};
pub use scalar::{Coordinates, Scalar, real, value};
pub use se3::Pose;
pub use skew::{skew, vee};
pub use so3::{rotation_jacobian, rotation_jacobian_inverse};
pub use spatial::{Twist, Wrench};
