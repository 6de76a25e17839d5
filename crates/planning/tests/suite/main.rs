//! Planners, controllers, worlds and missions, in one program; what must not allocate has a process of its own.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod attitude_loops;
mod bounds;
mod cart;
mod control_cases;
mod controller_laws;
mod controllers;
mod coordinator;
mod coupled_against_clarabel;
mod custom_collision_world;
mod custom_controller;
mod custom_informative_model;
mod custom_robot;
mod custom_robot_plan;
mod distances;
mod ellipsoid_pairs;
mod ellipsoid_world;
mod equivariance;
mod fixed_planes;
mod flight_planner;
mod flown_plans;
mod general_solver;
mod gram_against_clarabel;
mod hostile_numbers;
mod information_weighting;
mod informative_models;
mod invariant_sets;
mod known_gap;
mod local_barriers;
mod local_planner_laws;
mod measured_flight;
mod mission_motion;
mod obstacle_loop;
mod obstacle_planes;
mod obstacle_tube;
mod original_tube;
mod passing_sides;
mod planted_defects_collision;
mod planted_defects_controller;
mod planted_defects_informative_model;
mod planted_defects_invariant_set;
mod planted_defects_local_planner;
mod planted_defects_planners;
mod predicted_sigma;
mod primitive_rrt;
#[allow(dead_code, reason = "shared with the fuzz target")]
mod promises;
mod round_world;
mod slew;
mod steering;
mod stretches;
mod sweep_oracle;
mod sweeps;
mod ten_parameters;
mod tracking_loss;
mod tube_controller;
#[allow(dead_code, reason = "shared with the study")]
mod tube_flights;
mod tube_hostile;
mod tube_missions;
#[allow(dead_code, reason = "shared with the study")]
mod tube_plant;
mod tube_problems;
#[allow(dead_code, reason = "shared with the study")]
mod tube_shares;
mod tube_tables;
mod verdicts;
