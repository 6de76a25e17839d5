//! From cycles of a periodic motion to the parameters: averaging, Fourier fit, harmonic selection, estimation.

mod cramer_rao;
mod cycles;
mod fit;
mod identify_periodic;
mod joint_information;
mod least_squares;
mod likelihood;
mod periodic_record;
mod saturation;
mod selection;
mod settings;
mod warning;

pub use cramer_rao::{CramerRao, cramer_rao};
pub use cycles::{Cycles, average_cycles};
pub use fit::FourierFit;
pub use identify_periodic::{HarmonicIdentification, Periodic, identify_periodic};
pub use least_squares::PeriodicLeastSquares;
pub use likelihood::{PeriodicLikelihood, maximum_likelihood};
pub use periodic_record::PeriodicRecord;
pub use saturation::saturated_share;
pub use selection::{HarmonicCandidate, LARGEST_WORK, SelectionRule, likeliest_harmonics, select_harmonics};
pub use settings::{HarmonicEstimator, HarmonicSettings};
pub use warning::HarmonicWarning;
