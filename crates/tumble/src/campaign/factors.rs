//! Levels of what a campaign varies, as one types them.

use crate::TumbleError;
use crate::mission::{FaultChoice, FaultName};
use clap::ValueEnum;

/// The name under which a choice is typed.
pub fn value_name<T: ValueEnum>(value: &T) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

/// Most severe.
const WORST: u8 = 3;

fn bad(text: &str, why: &str) -> TumbleError {
    TumbleError::BadOption { message: format!("`--fault {}`: {why}", tumble_formats::text_file::printable(text)) }
}

/// Levels of the factor fault: `none`, `NAME:SEVERITY`, `NAME` for all severities, `all:SEVERITY`, `all`.
///
/// # Errors
/// [`TumbleError::BadOption`].
pub fn parse_faults(text: &str) -> Result<Vec<Option<FaultChoice>>, TumbleError> {
    if text == "none" {
        return Ok(vec![None]);
    }
    let (name, severity) = match text.split_once(':') {
        Some((name, severity)) => (name, Some(severity)),
        None => (text, None),
    };
    let names: Vec<FaultName> = if name == "all" {
        FaultName::value_variants().to_vec()
    } else {
        let known = || FaultName::value_variants().iter().map(value_name).collect::<Vec<_>>().join(", ");
        vec![FaultName::from_str(name, false).map_err(|_| bad(text, &format!("none, all, or one of {}", known())))?]
    };
    let severities = match severity {
        None => 1..=WORST,
        Some(severity) => match severity.parse() {
            Ok(severity) if (1..=WORST).contains(&severity) => severity..=severity,
            _ => return Err(bad(text, "the severity is 1, 2 or 3")),
        },
    };
    Ok(names
        .into_iter()
        .flat_map(|name| severities.clone().map(move |severity| Some(FaultChoice { name, severity })))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_faults() {
        let one = |name, severity| Some(FaultChoice { name, severity });
        assert_eq!(parse_faults("none").unwrap(), [None]);
        assert_eq!(parse_faults("mass-step:2").unwrap(), [one(FaultName::MassStep, 2)]);
        assert_eq!(parse_faults("drop").unwrap(), [1, 2, 3].map(|severity| one(FaultName::Drop, severity)));
        let all = parse_faults("all").unwrap();
        assert_eq!(all.len(), 42);
        assert_eq!(all[3], one(FaultName::Delay, 1));
        assert_eq!(parse_faults("all:3").unwrap().len(), 14);
        for text in ["", "drop:0", "drop:4", "drop:", "Drop", "none:1", "all:x", "late"] {
            assert!(parse_faults(text).is_err(), "{text}");
        }
    }
}
