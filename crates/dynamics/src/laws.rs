//! Executable laws for everyone's bodies, forces, actuators and integrators (feature `testing`).
//!
//! Each `check_*` returns the first broken law by name with its inputs.

pub mod integration;

pub use integration::{
    ModelSample, StepSample, check_energy, check_equivariance, check_momentum_map, check_order, check_parametric_model,
    check_reversible, check_stays_on_group, check_symplectic, check_symplectic_lagrangian, check_units, step_samples,
};
pub use tumble_lie::laws::{LawViolation, require};
