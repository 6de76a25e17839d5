//! Estimators, their laws and their honesty, in one program; what must not allocate has a process of its own.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod calibration;
mod change_scenario;
mod custom_criterion;
mod custom_estimator;
mod custom_feasible_set;
mod custom_recursive_estimator;
mod custom_regressor;
mod custom_sensor;
mod custom_state_estimator;
mod custom_wrench_model;
mod environment;
mod estimation_laws;
mod estimator_laws;
mod exact_motion;
mod excitation_against_argmin;
mod excitation_design;
mod faulty_log;
mod filter_models;
mod fixed_lag;
mod flight_estimator;
mod flight_scenario;
mod identify_properties;
mod lapack_symbols;
mod maximum_likelihood;
mod periodic_bounds;
mod periodic_likelihood;
mod periodic_log;
mod periodic_motion;
mod periodic_tracking;
#[path = "golden/problem4_hard.rs"]
mod problem4_hard;
mod random;
mod recursive_changes;
mod recursive_identify;
mod recursive_laws;
mod regressor_orders;
mod signals;
mod state_estimator_laws;
mod state_space;
mod two_stage_coverage;
mod wheel_throws;
mod without_poses;
