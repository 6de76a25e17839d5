//! Tumble as a Python module. `docs/python.md` says how it is used, `tumble.pyi` what its functions take.
//!
//! What a function answers is what the command line answers, by the same code; while it computes, other threads of Python run.

mod arrays;
mod commands;
mod error;
mod flight_estimator;
mod identification;
mod identify;
mod own_estimator;

/// Mass, centre of mass and inertia of free-flying robots, from their logs and in flight.
#[pyo3::pymodule]
mod tumble {
    #[pymodule_export]
    use crate::commands::{Run, excite, fly, plan, sample, simulate};
    #[pymodule_export]
    use crate::error::TumbleError;
    #[pymodule_export]
    use crate::flight_estimator::{Belief, FlightEstimator, Reception, parameters};
    #[pymodule_export]
    use crate::identification::{Identification, Sigma};
    #[pymodule_export]
    use crate::identify::{identify, identify_file};
    #[pymodule_export]
    use crate::own_estimator::Problem;

    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "the name is Python's")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
