//! The targets of a study: what was found, and whether it is what was claimed.

use serde_json::json;

use crate::Failure;

/// A claim: what it says, whether it holds, and what was found.
pub struct Target {
    name: String,
    is_met: bool,
    found: String,
}

#[cfg(test)]
impl Target {
    pub fn is_met(&self) -> bool {
        self.is_met
    }
}

/// What a study found.
#[derive(Default)]
pub struct Report {
    pub targets: Vec<Target>,
    /// Lines shown before the targets.
    pub table: Vec<String>,
}

impl Report {
    pub fn target(&mut self, name: String, is_met: bool, found: String) {
        self.targets.push(Target { name, is_met, found });
    }

    /// A figure that must not exceed its target; NaN does.
    pub fn at_most(&mut self, name: &str, found: f64, most: f64) {
        self.target(format!("{name} <= {most}"), found <= most, format!("{found:.4}"));
    }

    pub fn at_least(&mut self, name: &str, found: f64, least: f64) {
        self.target(format!("{name} >= {least}"), found >= least, format!("{found:.4}"));
    }

    pub fn none(&mut self, name: &str, found: f64) {
        self.target(format!("{name}: none"), found == 0.0, format!("{found}"));
    }

    /// Prints the table and every target; an error where one was missed.
    pub fn finish(&self) -> Result<(), Failure> {
        for line in &self.table {
            eprintln!("{line}");
        }
        eprintln!();
        for Target { name, is_met, found } in &self.targets {
            println!("{}", json!({"block": "target", "name": name, "met": is_met, "found": found}));
            eprintln!("{} {name}: {found}", if *is_met { "met   " } else { "MISSED" });
        }
        let missed: Vec<&str> =
            self.targets.iter().filter(|target| !target.is_met).map(|one| one.name.as_str()).collect();
        if missed.is_empty() {
            return Ok(());
        }
        Err(Failure::TargetMissed(format!(
            "{} of {} targets missed: {}",
            missed.len(),
            self.targets.len(),
            missed.join("; ")
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What no run reaches is missed, NaN included, and exit code 3 follows.
    #[test]
    fn a_missed_target_is_a_failure() {
        let mut report = Report::default();
        report.at_most("time", 1.0, 1.0);
        report.at_least("share", 0.95, 0.95);
        report.none("faults", 0.0);
        assert!(report.finish().is_ok());
        for spoil in [
            |report: &mut Report| report.at_most("time", 1.001, 1.0),
            |report: &mut Report| report.at_most("time", f64::NAN, 1.0),
            |report: &mut Report| report.at_least("share", 0.949, 0.95),
            |report: &mut Report| report.none("faults", 1.0),
        ] {
            let mut spoilt = Report::default();
            spoil(&mut spoilt);
            assert!(matches!(spoilt.finish(), Err(Failure::TargetMissed(_))));
        }
    }
}
