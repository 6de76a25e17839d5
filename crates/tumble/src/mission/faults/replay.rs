//! The one line that flies a mission again.

use crate::mission::options::{FlyOptions, ModelChoice};
use crate::mission::weighting::WeightingChoice;
use clap::ValueEnum;
use std::fmt::Write as _;

/// What to type to fly a mission again: options that are as they are by default are left out.
pub fn replay_line(scenario: &str, options: &FlyOptions) -> String {
    let FlyOptions { seed, weighting, feedback, model, fault, layers } = options;
    let mut line = format!("tumble fly {} --seed {seed}", quoted(scenario));
    // writing to a string does not fail
    if *weighting != WeightingChoice::default() {
        let _ = write!(line, " --weighting {}", name(weighting));
    }
    if !feedback {
        line.push_str(" --feedback off");
    }
    if *model != ModelChoice::default() {
        let _ = write!(line, " --model {}", name(model));
    }
    if let Some(fault) = fault {
        let _ = write!(line, " --fault {fault}");
    }
    line + &layers.arguments()
}

/// As it is typed.
fn name(choice: &impl ValueEnum) -> String {
    choice.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// As a shell reads it back: bare where that is safe.
fn quoted(text: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
    if !text.is_empty() && !text.starts_with('-') && text.chars().all(is_bare) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mission::LayerNames;

    fn options() -> FlyOptions {
        FlyOptions {
            seed: 7,
            weighting: WeightingChoice::Covariance,
            feedback: true,
            model: ModelChoice::Scenario,
            fault: None,
            layers: LayerNames::default(),
        }
    }

    #[test]
    fn only_what_is_not_the_default_is_typed() {
        assert_eq!(replay_line("iss-cargo", &options()), "tumble fly iss-cargo --seed 7");
        let all = FlyOptions {
            seed: u64::MAX,
            weighting: WeightingChoice::None,
            feedback: false,
            model: ModelChoice::High,
            fault: "late-obstacle:3".parse().ok(),
            layers: LayerNames::default(),
        };
        let expected = "tumble fly a/b.toml --seed 18446744073709551615 --weighting none --feedback off --model high \
                        --fault late-obstacle:3";
        assert_eq!(replay_line("a/b.toml", &all), expected);
    }

    #[test]
    fn names_that_a_shell_would_read_otherwise_are_quoted() {
        assert_eq!(replay_line("it's here.toml", &options()), r"tumble fly 'it'\''s here.toml' --seed 7");
        for odd in ["", "a b", "$(x)", "-x", "a;b", "a*"] {
            assert!(replay_line(odd, &options()).starts_with(&format!("tumble fly '{odd}'")), "{odd}");
        }
    }
}
