//! One program for all tests of this crate that need no process of their own.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod added_layers;
mod allocate_command;
mod arms;
mod bad_inputs;
mod beside_the_wrench;
mod campaign_command;
mod check_command;
mod commanded_nozzles;
mod convert_command;
mod corruption_sweep;
mod documented_names;
mod drawn_missions;
mod dry_run;
mod environment;
mod excite_command;
mod fault_campaign;
mod flight_log;
mod flown_sensing;
mod fly_command;
mod identify_arm_command;
mod identify_command;
mod identify_recordings;
mod kept_results;
mod mission_report;
mod plan_command;
mod plan_local_command;
mod poor_logs;
#[allow(dead_code, reason = "shared with the fuzz targets")]
mod promises;
mod readme;
mod second_robot;
mod sensing_check_command;
mod simulate_command;
mod simulate_control;
mod support;
