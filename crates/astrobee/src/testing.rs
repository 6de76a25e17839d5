//! Vectors of NASA's own code, for tests of what stands above this crate.

/// Wanted wrenches, and the nozzle bytes and thrusts that the flown allocation answered with; CSV.
pub const FLOWN_ALLOCATION: &str = include_str!("../tests/golden/astrobee_allocation.csv");
/// Flap openings, and the thrusts that the flown simulation makes of them; CSV.
pub const SIMULATED_THRUST: &str = include_str!("../tests/golden/astrobee_thrust.csv");
