//! What every parser promises of any bytes, and what planning promises of any numbers. The promises lie with the tests of the crates
//! that make them, which replay the seeds.

#[path = "../../crates/tumble/tests/suite/promises.rs"]
mod files;
#[path = "../../crates/planning/tests/suite/promises.rs"]
mod planning;

pub use files::*;
pub use planning::planning_numbers;
