//! Flags and options of a study.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::Failure;

/// What stood on the command line after the name of the study.
#[derive(Debug)]
pub struct Arguments {
    flags: Vec<String>,
    options: BTreeMap<String, String>,
}

impl Arguments {
    /// Accepts these flags (`--json`) and these options (`--data DIR`) and nothing else.
    pub fn parse(words: &[String], flags: &[&str], options: &[&str]) -> Result<Self, Failure> {
        let mut parsed = Self { flags: Vec::new(), options: BTreeMap::new() };
        let mut words = words.iter();
        while let Some(word) = words.next() {
            if flags.contains(&word.as_str()) {
                parsed.flags.push(word.clone());
            } else if options.contains(&word.as_str()) {
                let value = words.next().ok_or_else(|| Failure::BadInput(format!("{word} wants a value")))?;
                parsed.options.insert(word.clone(), value.clone());
            } else {
                return Err(Failure::BadInput(format!("unknown argument `{word}`")));
            }
        }
        Ok(parsed)
    }

    /// Whether the flag was given.
    pub fn has(&self, flag: &str) -> bool {
        self.flags.iter().any(|given| given == flag)
    }

    /// The value of an option.
    pub fn value(&self, option: &str) -> Option<&str> {
        self.options.get(option).map(String::as_str)
    }

    /// A number.
    pub fn number(&self, option: &str) -> Result<Option<usize>, Failure> {
        self.value(option)
            .map(|text| text.parse().map_err(|_| Failure::BadInput(format!("{option} wants a number, not `{text}`"))))
            .transpose()
    }

    /// The folder of an option, else the first of the usual ones that exists.
    pub fn folder(&self, option: &str, usual: &[&str]) -> Result<Option<PathBuf>, Failure> {
        match self.value(option).map(PathBuf::from) {
            Some(folder) if folder.is_dir() => Ok(Some(folder)),
            Some(folder) => Err(Failure::file(&folder, "is not a folder")),
            None => Ok(usual.iter().map(PathBuf::from).find(|folder| folder.is_dir())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Arguments, Failure> {
        let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        Arguments::parse(&words, &["--json"], &["--data", "--sweeps"])
    }

    #[test]
    fn flags_and_options_are_told_apart() {
        let arguments = parse("--json --sweeps 7").unwrap();
        assert!(arguments.has("--json"));
        assert_eq!(arguments.number("--sweeps").unwrap(), Some(7));
        assert_eq!(arguments.value("--data"), None);
    }

    #[test]
    fn slips_are_refused() {
        assert!(parse("--jsn").is_err());
        assert!(parse("--data").is_err());
        assert!(parse("--sweeps many").unwrap().number("--sweeps").is_err());
        assert!(parse("--data no/such/folder").unwrap().folder("--data", &[]).is_err());
    }
}
