//! From cycles of a periodic motion to the parameters: averaging, Fourier fit, harmonic selection, estimation.

mod cramer_rao;
mod joint_information;
mod likelihood;
mod periodic_record;

pub use cramer_rao::{CramerRao, cramer_rao};
pub use likelihood::{PeriodicLikelihood, maximum_likelihood};
pub use periodic_record::PeriodicRecord;
