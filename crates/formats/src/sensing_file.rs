//! Sensors as a file: what the columns of a log are of the true motion.

use crate::FormatsError;
use crate::text_file;
use crate::toml_text::{self, TomlError};
use serde::{Deserialize, Serialize};
use std::path::Path;
use tumble_identification::sensing::Sensing;

#[derive(Serialize, Deserialize)]
struct File {
    format: u32,
    #[serde(flatten)]
    sensing: toml::Table,
}

/// Reads and checks a file.
///
/// # Errors
/// [`FormatsError::Unreadable`], [`FormatsError::BadToml`] naming the key.
pub fn read(path: &Path) -> Result<Sensing, FormatsError> {
    let text = text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
    parse(&text, path)
}

/// From the text of the file `path`.
///
/// # Errors
/// As [`read`].
///
/// # Example
/// ```
/// use tumble_formats::sensing_file;
/// use tumble_identification::sensing::Sensing;
/// let text = sensing_file::text(&Sensing::default());
/// assert_eq!(sensing_file::parse(&text, "sensing.toml".as_ref())?, Sensing::default());
/// # Ok::<(), tumble_formats::FormatsError>(())
/// ```
pub fn parse(text: &str, path: &Path) -> Result<Sensing, FormatsError> {
    let bad = |message: String| FormatsError::BadToml { path: path.into(), message };
    let file: File = toml_text::read(text).map_err(|error| bad(error.to_string()))?;
    if file.format != 1 {
        return Err(bad(format!("`format = {}`; this version reads 1", file.format)));
    }
    for stream in ["position", "attitude", "velocity", "rate", "acceleration"] {
        for (key, size) in [("white", "0.001"), ("wander", "{ sigma = 0.01, time_s = 10.0 }")] {
            let stated = file.sensing.get(stream).and_then(|stream| stream.get(key));
            if stated.is_some_and(|stated| !says_how_known(stated)) {
                return Err(bad(format!(
                    "`{stream}.{key}`: write `\"unknown\"`, `{{ about = {size} }}` (the search begins there) or `{{ known = {size} }}`"
                )));
            }
        }
    }
    let sensing: Sensing = file.sensing.try_into().map_err(|error| bad(TomlError::from(error).to_string()))?;
    sensing.check().map_err(|error| bad(error.to_string()))?;
    Ok(sensing)
}

/// Whether a size of errors comes with how well it is known.
fn says_how_known(stated: &toml::Value) -> bool {
    match stated {
        toml::Value::String(word) => word == "unknown",
        toml::Value::Table(table) => table.len() == 1 && ["about", "known"].iter().any(|key| table.contains_key(*key)),
        _ => false,
    }
}

/// The text of a file with every key.
pub fn text(sensing: &Sensing) -> String {
    let keys = toml::to_string(sensing).unwrap_or_default();
    format!("format = 1\n{keys}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        parse(text, Path::new("sensing.toml")).unwrap_err().to_string()
    }

    #[test]
    fn impossible_values_are_named() {
        assert!(refused("format = 1\n[pose_delay]\nsigma_s = -1.0\n").contains("delay"));
        assert!(refused("format = 1\nlever_arm_body = [0.0, 0.0, 0.0]\n").contains("lever_arm_body"));
        assert!(refused("format = 3\n").contains("format"));
        assert!(refused("[position]\nwhite = { known = 0.1 }\n").contains("format"));
        // how well a size is known has to be said, and the refusal says how
        for (key, value) in [("white", "0.001"), ("white", "\"known\""), ("wander", "{ sigma = 0.01, time_s = 9.0 }")] {
            let said = refused(&format!("format = 1\n[position]\n{key} = {value}\n"));
            assert!(said.contains(&format!("`position.{key}`")) && said.contains("known = "), "{said}");
        }
    }
}
