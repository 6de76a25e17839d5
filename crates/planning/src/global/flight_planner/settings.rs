//! How the planner searches.

/// How the planner searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightPlannerSettings {
    /// A plan whose cost exceeds the lower bound by no more than this share of it counts as optimal. Range: 0 to 1,
    /// default 1e-6.
    pub tolerance: f64,
    /// Longest duration of a plan of least impulse, s: the slower a motion, the less impulse it takes, without end. A plan
    /// that cannot be as fast is not refused. Range: positive, default 600.
    pub longest_s: f64,
}

impl Default for FlightPlannerSettings {
    fn default() -> Self {
        Self { tolerance: 1e-6, longest_s: 600.0 }
    }
}
