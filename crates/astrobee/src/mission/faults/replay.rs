//! The one line that flies a mission again.

use crate::mission::options::FlyOptions;

/// What to type to fly a mission again: options that are as they are by default are left out.
pub fn replay_line(scenario: &str, options: &FlyOptions) -> String {
    format!("tumble fly {scenario} --seed {}", options.seed)
}
