//! Bodies, integrators and trees of bodies, in one program.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod actuators;
mod custom_actuator;
mod custom_arm;
mod custom_body;
mod custom_integrator;
mod custom_lagrangian;
mod custom_system;
mod custom_wrench_model;
mod integrators;
mod lagrangian_systems;
mod multibody;
mod physical_consistency;
mod planted_defects_bodies;
mod planted_defects_multibody;
mod planted_defects_steps;
