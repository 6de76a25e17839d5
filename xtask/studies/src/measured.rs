//! Tables of measured data, and what is reported of them.

use std::path::{Path, PathBuf};

use crate::Failure;

/// One line of the report of a set without configurations.
pub struct Measured<'a> {
    pub dataset: &'a str,
    pub file: &'a str,
    pub quantity: &'a str,
    pub estimate: f64,
    /// One standard deviation, where the method gives one.
    pub sigma: Option<f64>,
    /// What it should be, where that is known.
    pub reference: Option<f64>,
}

impl Measured<'_> {
    /// Prints it, as JSON or for the eye.
    pub fn print(&self, json: bool) {
        let error_percent = self.reference.map(|reference| 100.0 * (self.estimate / reference - 1.0));
        if json {
            let line = serde_json::json!({
                "dataset": self.dataset,
                "file": self.file,
                "quantity": self.quantity,
                "estimate": self.estimate,
                "sigma": self.sigma,
                "reference": self.reference,
                "error_percent": error_percent,
            });
            println!("{line}");
            return;
        }
        let Self { dataset, file, quantity, estimate, .. } = self;
        let sigma = self.sigma.map_or(String::new(), |sigma| format!(" +- {sigma:.2e}"));
        let error = error_percent.map_or(String::new(), |percent| format!("  error {percent:6.2} %"));
        println!("{dataset}  {file:<20} {quantity:<40} {estimate:11.4e}{sigma}{error}");
    }
}

/// The CSV files of a folder, by name.
pub fn tables(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let entries = std::fs::read_dir(folder).map_err(|error| Failure::file(folder, error))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "csv"));
    files.sort();
    Ok(files)
}

/// These columns of a table of numbers, row by row.
pub fn columns<const N: usize>(path: &Path, names: &[&str; N]) -> Result<Vec<[f64; N]>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| Failure::file(path, error))?;
    let mut lines = text.lines().zip(1..).filter(|(line, _)| !line.trim().is_empty());
    let header: Vec<&str> = lines.next().map_or(Vec::new(), |(line, _)| line.split(',').map(str::trim).collect());
    let mut places = [0; N];
    for (place, name) in places.iter_mut().zip(names) {
        *place = header
            .iter()
            .position(|column| column == name)
            .ok_or_else(|| Failure::file(path, format!("column `{name}` is missing")))?;
    }
    lines
        .map(|(line, number)| {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            let mut row = [0.0; N];
            for ((value, place), name) in row.iter_mut().zip(places).zip(names) {
                let cell = cells.get(place).copied().unwrap_or_default();
                *value = cell.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| {
                    Failure::file(path, format!("line {number}, column `{name}`: `{cell}` is not a finite number"))
                })?;
            }
            Ok(row)
        })
        .collect()
}
