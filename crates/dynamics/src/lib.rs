#![doc = include_str!("../README.md")]
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

extern crate alloc;

pub use tumble_lie as lie;
pub use tumble_lie::nalgebra;

mod actuation;
mod composition;
mod convergence;
#[cfg(feature = "dual")]
mod differentiate;
#[cfg(feature = "dual")]
mod discrete_lagrangian;
mod error;
mod free_flyer;
mod gyrostat;
mod inertia;
mod integrators;
#[cfg(feature = "testing")]
pub mod laws;
mod log_cholesky;
mod momentum;
mod multibody;
mod oscillator;
mod parameter_vector;
mod pivoted_body;
mod planar;
mod plant;
mod projection;
mod solids;
mod state;
#[cfg(feature = "testing")]
pub mod strategies;
mod system;
mod tracker;
mod variational_free_flyer;
mod world;
mod wrench_model;

pub use actuation::{
    Actuation, ActuatorDrive, Driven, PulseTiming, PulseTrain, PulsedThrusters, ReactionWheel, ReactionWheels, Rotor,
    RotorSet, StatefulActuation, StatefulDrive, Thruster, ThrusterSet, WrenchBox,
};
#[cfg(feature = "dual")]
pub use differentiate::{
    FreeFlyerIntegrator, FreeFlyerStep, ParametricModel, StateTangent, StepLinearization, linearize,
};
#[cfg(feature = "dual")]
pub use discrete_lagrangian::{DiscreteLagrangian, GroupOf, VelocityOf};
pub use error::{DynamicsError, ForeignError};
pub use free_flyer::{BodyAcceleration, FreeFlyer, FreeFlyerIn};
pub use gyrostat::{Gyrostat, GyrostatInput};
pub use inertia::{InertialParameters, from_pseudo_inertia, pseudo_inertia};
#[cfg(feature = "dual")]
pub use integrators::Variational;
pub use integrators::{GaussLegendre4, LieEuler, MuntheKaas4, RungeKutta4};
pub use log_cholesky::LogCholesky;
pub use momentum::{
    body_momentum, discrete_lagrangian, discrete_spatial_momentum, kinetic_energy, momentum_at_end, momentum_at_start,
    spatial_momentum, twist_of_momentum,
};
pub use multibody::{
    Dynamic, Fixed, GeneralizedAcceleration, GeneralizedForce, GeneralizedMotion, Joint, JointAxis, JointStorage, Link,
    LinkPlacements, MassMatrix, MomentumRegressor, Multibody, ToolJacobian, TorqueRegressor,
};
#[cfg(feature = "dual")]
pub use multibody::{FixedMultibody, FreeConfiguration, FreeInput, FreeMultibody, JointedBodies, MultibodyStep};
pub use oscillator::Oscillator;
pub use parameter_vector::{PARAMETER_NAMES, PARAMETER_UNITS, PARAMETERS, ParameterOrder};
pub use pivoted_body::PivotedBody;
pub use planar::{PlanarAcceleration, PlanarBody, PlanarWrench};
pub use plant::{SimulatedBody, SimulatedGyrostat, SimulatedMeasurement};
pub use state::{GroupState, GroupTangent, LagrangianState, RigidBodyState};
pub use system::{Integrator, MechanicalSystem, Plant, RigidBody, ScalarOf, TangentOf, WrenchModel};
pub use tracker::{PoseReference, PoseTracker};
pub use variational_free_flyer::{VariationalFreeFlyer, variational_step};
pub use world::{AlignedBox, ObstacleEllipsoid, World};
pub use wrench_model::{
    ConstantBodyWrench, ConstantWorldWrench, Environment, GravityGradient, LinearDrag, QuadraticDrag, StoredMomentum,
    UniformGravity, WrenchFn,
};
