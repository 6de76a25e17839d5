//! Random numbers that are the same on every machine: a linear congruential generator of 64 bits (Knuth's constants).

/// Uniform in -1..1, a fixed sequence.
pub fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}
