//! From cycles of a periodic motion to the parameters: averaging, Fourier fit, harmonic selection, estimation.

mod periodic_record;

pub use periodic_record::PeriodicRecord;
