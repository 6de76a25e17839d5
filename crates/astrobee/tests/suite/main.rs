//! One program for all tests of this crate that need no process of their own.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod controller_laws;
mod propulsion;
mod propulsion_plant;
mod sensing;
mod simulator;
