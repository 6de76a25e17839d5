//! Executable laws for everyone's bodies, forces, actuators and integrators (feature `testing`).
//!
//! Each `check_*` returns the first broken law by name with its inputs.

pub mod forces;
pub mod inertia;
pub mod integration;
pub mod multibody;

pub use forces::{
    check_actuation, check_drag, check_gravity, check_inverse_dynamics, check_system, check_wrench_model,
    check_wrench_sum,
};
pub use inertia::{InertiaOperations, InertiaSamples, check_inertia};
pub use integration::{
    ModelSample, StepSample, check_energy, check_equivariance, check_momentum_map, check_order, check_parametric_model,
    check_reversible, check_stays_on_group, check_symplectic, check_symplectic_lagrangian, check_units, step_samples,
};
pub use multibody::{TreeMotion, TreeOperations, check_multibody};
pub use tumble_lie::laws::{LawViolation, require};
