//! Executable laws for everyone's bodies, forces, actuators and integrators (feature `testing`).
//!
//! Each `check_*` returns the first broken law by name with its inputs.

pub mod actuators;
pub mod forces;
pub mod inertia;
pub mod integration;
pub mod multibody;
pub mod wrenches;

pub use actuators::{Held, check_actuation, check_momentum_storage, check_stateful_actuation, check_total_momentum};
pub use forces::{check_gyrostat, check_inverse_dynamics, check_system};
pub use inertia::{InertiaOperations, InertiaSamples, check_inertia};
pub use integration::{
    ModelSample, StepSample, check_energy, check_equivariance, check_momentum_map, check_order, check_parametric_model,
    check_reversible, check_stays_on_group, check_symplectic, check_symplectic_lagrangian, check_units, step_samples,
};
pub use multibody::{TreeMotion, TreeOperations, check_multibody};
pub use tumble_lie::laws::{LawViolation, require};
pub use wrenches::{
    WrenchModelIn, WrenchNature, check_drag, check_gravity, check_gravity_of_points, check_wrench_model,
    check_wrench_sum,
};
