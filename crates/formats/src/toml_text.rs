//! TOML into what it means, nothing of it passed over.

use crate::place;
use crate::text_file::printable;
use serde::{Serialize, de::DeserializeOwned};
use std::ops::Range;
use thiserror::Error;
use toml::Value;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, de};

/// Why a text is not what was to be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TomlError {
    /// No TOML, or not of this kind.
    #[error("{}", brief(&.0.to_string()))]
    Unlike(#[from] de::Error),
    /// An array is longer than what is read of it.
    #[error("line {line}, column {column}: {message}")]
    TooLong {
        /// Counted from one.
        line: usize,
        /// Counted from one.
        column: usize,
        /// Where it begins in the text.
        offset: usize,
        /// Key and lengths.
        message: String,
    },
}

impl TomlError {
    /// The byte of the text at which it is seen.
    pub fn offset(&self) -> usize {
        match self {
            Self::Unlike(error) => error.span().map_or(0, |span| span.start),
            Self::TooLong { offset, .. } => *offset,
        }
    }

    /// What is wrong there, without the place.
    pub fn message(&self) -> String {
        match self {
            Self::Unlike(error) => printable(error.message()),
            Self::TooLong { message, .. } => message.clone(),
        }
    }
}

/// What a terminal may show of a message, which quotes the line where it went wrong, however long that is, behind its number and a bar.
fn brief(message: &str) -> String {
    const LONGEST_LINE: usize = 200;
    let is_quoted = |line: &str| line.trim_start().starts_with(|c: char| c.is_ascii_digit() || c == '|');
    let line = |line: &str| match line.char_indices().nth(LONGEST_LINE) {
        Some((end, _)) if is_quoted(line) => format!("{} ...", line.get(..end).unwrap_or_default()),
        _ => line.to_owned(),
    };
    printable(&message.lines().map(line).collect::<Vec<_>>().join("\n"))
}

/// Reads a text.
///
/// An array of a fixed length passes over what follows its last number; here it is refused. What was read is written again for that, and
/// compared with the text.
///
/// # Errors
/// [`TomlError`].
///
/// # Example
/// ```
/// #[derive(serde::Serialize, serde::Deserialize)]
/// struct Start {
///     position_m: [f64; 3],
/// }
/// let start: Start = tumble_formats::toml_text::read("position_m = [1.0, 2.0, 3.0]").unwrap();
/// assert_eq!(start.position_m, [1.0, 2.0, 3.0]);
/// let error = tumble_formats::toml_text::read::<Start>("position_m = [1.0, 2.0, 3.0, 4.0]").map(|_| ()).unwrap_err();
/// assert_eq!(error.to_string(), "line 1, column 14: `position_m` holds 4, of which 3 would be read");
/// ```
pub fn read<T: DeserializeOwned + Serialize>(text: &str) -> Result<T, TomlError> {
    let read: T = toml::from_str(text)?;
    let (Ok(Value::Table(used)), Ok(written)) = (Value::try_from(&read), DeTable::parse(text)) else { return Ok(read) };
    for (name, value) in written.get_ref() {
        let name = name.get_ref();
        if let Some(longer) = used.get(name.as_ref()).and_then(|used| longer(name, value, used)) {
            let offset = longer.span.start;
            let (line, column) = place::of_offset(text, offset);
            let message =
                format!("`{}` holds {}, of which {} would be read", printable(&longer.key), longer.holds, longer.used);
            return Err(TomlError::TooLong { line, column, offset, message });
        }
    }
    Ok(read)
}

struct Longer {
    key: String,
    span: Range<usize>,
    holds: usize,
    used: usize,
}

/// The first array that is longer than what is used of it.
fn longer(key: &str, written: &Spanned<DeValue<'_>>, used: &Value) -> Option<Longer> {
    match (written.get_ref(), used) {
        (DeValue::Array(values), Value::Array(used)) if values.len() > used.len() => {
            Some(Longer { key: key.to_owned(), span: written.span(), holds: values.len(), used: used.len() })
        }
        (DeValue::Array(values), Value::Array(used)) => values
            .iter()
            .zip(used)
            .enumerate()
            .find_map(|(i, (value, used))| longer(&format!("{key}[{i}]"), value, used)),
        (DeValue::Table(values), Value::Table(used)) => values.iter().find_map(|(name, value)| {
            let name = name.get_ref();
            longer(&format!("{key}.{name}"), value, used.get(name.as_ref())?)
        }),
        _ => None,
    }
}
