//! Methods that others use on the same data, to be compared with: instrumental variables and total least squares.
//!
//! Finite differences are [`regressors::FiniteDifference`](crate::regressors::FiniteDifference), smoothing is
//! [`SavitzkyGolay`](crate::SavitzkyGolay).

mod instrumental_variables;
mod total_least_squares;

pub use instrumental_variables::instrumental_variables;
pub use total_least_squares::total_least_squares;
