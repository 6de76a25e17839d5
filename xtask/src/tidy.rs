//! `cargo xtask tidy`: the rules of the repository that a machine can hold.
//!
//! A rule is a function from the tree of files to complaints. Each has a unit test that plants a violation.

mod circles;
mod manifests;
mod prose;
mod source;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::{Command, ExitCode};

use crate::command::{Outcome, cargo, root};

/// The files of the repository and what cargo resolves for them.
#[derive(Default)]
pub struct Tree {
    /// Text by path relative to the root, with `/`.
    files: BTreeMap<String, String>,
    /// `cargo tree` of the default build, one `name version` per line.
    default_build: String,
    /// `cargo tree` of everything `cargo test --workspace` builds.
    test_build: String,
}

/// A rule: its name and the function that finds violations.
type Rule = (&'static str, fn(&Tree) -> Vec<String>);

const RULES: &[Rule] = &[
    ("required files", required_files),
    ("file names", file_names),
    ("machine paths", machine_paths),
    ("dependency arrows", manifests::arrows),
    ("one place for versions and lints", manifests::inherited),
    ("no C in the dependency tree", manifests::only_rust),
    ("library attributes", source::attributes),
    ("unfinished code", source::unfinished),
    ("lint exceptions carry a reason", source::reasons),
    ("public traits have an example", source::trait_examples),
    ("public traits have a tutorial", source::trait_tutorials),
    ("files do not use each other", circles::circles),
    ("singular values", source::singular_values),
    ("robot's name", source::robot_name),
    ("README code is tested", prose::readme_doctests),
    ("equation index", prose::equation_index),
    ("links to the repository", prose::repository_links),
    ("error codes", prose::error_codes),
    ("architecture page is short", prose::architecture_length),
    ("golden files", prose::golden_files),
];

pub fn main() -> ExitCode {
    match step() {
        Outcome::Failed(reason) => {
            eprintln!("{reason}");
            ExitCode::FAILURE
        }
        _ => ExitCode::SUCCESS,
    }
}

/// Prints every violation.
pub fn step() -> Outcome {
    let violations = match Tree::of_checkout() {
        Ok(tree) => violations(&tree),
        Err(error) => return Outcome::Failed(error.to_string()),
    };
    for violation in &violations {
        println!("{violation}");
    }
    if violations.is_empty() { Outcome::Ok } else { Outcome::Failed(format!("{} violations", violations.len())) }
}

fn violations(tree: &Tree) -> Vec<String> {
    RULES.iter().flat_map(|(name, rule)| rule(tree).into_iter().map(move |found| format!("{name}: {found}"))).collect()
}

impl Tree {
    fn of_checkout() -> Result<Self, Box<dyn std::error::Error>> {
        let root = root();
        let files = repository_files(&root)?
            .into_iter()
            .filter_map(|path| {
                let bytes = std::fs::read(root.join(&path)).ok()?;
                Some((path, String::from_utf8_lossy(&bytes).into_owned()))
            })
            .collect();
        Ok(Self {
            files,
            default_build: resolved("--package tumble --edges normal,build")?,
            test_build: resolved("--workspace --edges normal,build,dev")?,
        })
    }

    fn text(&self, path: &str) -> Option<&str> {
        self.files.get(path).map(String::as_str)
    }

    /// Files whose path has this beginning and this end.
    fn under<'a>(&'a self, start: &'a str, end: &'a str) -> impl Iterator<Item = (&'a str, &'a str)> {
        self.files
            .iter()
            .filter(move |(path, _)| path.starts_with(start) && path.ends_with(end))
            .map(|(path, text)| (path.as_str(), text.as_str()))
    }

    #[cfg(test)]
    fn planted(files: &[(&str, &str)]) -> Self {
        let files = files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect();
        Self { files, ..Self::default() }
    }
}

/// What git tracks or would track, relative to the root; in a folder that is no checkout, everything that was not built.
pub fn repository_files(root: &Path) -> std::io::Result<BTreeSet<String>> {
    if root.join(".git").exists() {
        let listed = Command::new("git")
            .current_dir(root)
            .args(["ls-files", "--cached", "--others", "--exclude-standard", "-z"])
            .output();
        if let Some(output) = listed.ok().filter(|output| output.status.success()) {
            let paths = String::from_utf8_lossy(&output.stdout).into_owned();
            return Ok(paths.split('\0').filter(|path| !path.is_empty()).map(str::to_owned).collect());
        }
    }
    let mut paths = BTreeSet::new();
    walk(root, "", &mut paths)?;
    Ok(paths)
}

fn walk(root: &Path, folder: &str, paths: &mut BTreeSet<String>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(root.join(folder))? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let path = if folder.is_empty() { name.clone() } else { format!("{folder}/{name}") };
        if entry.file_type()?.is_dir() {
            if !["target", ".git", "tumble-out"].contains(&name.as_str()) {
                walk(root, &path, paths)?;
            }
        } else {
            paths.insert(path);
        }
    }
    Ok(())
}

fn resolved(selection: &str) -> Result<String, Box<dyn std::error::Error>> {
    let output = cargo(&format!("tree {selection} --prefix none")).output()?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(format!("cargo tree {selection}: {}", String::from_utf8_lossy(&output.stderr)).into())
    }
}

fn required_files(tree: &Tree) -> Vec<String> {
    const REQUIRED: &[&str] = &[
        ".ci/run",
        "README.md",
        "ARCHITECTURE.md",
        "CHANGELOG.md",
        "CITATION.cff",
        "LICENSE-APACHE",
        "LICENSE-MIT",
        "SECURITY.md",
        "deny.toml",
        "docs/equations.md",
        "docs/errors.md",
        "docs/notation.md",
        "docs/references.bib",
    ];
    REQUIRED.iter().filter(|path| !tree.files.contains_key(**path)).map(|path| format!("{path} is missing")).collect()
}

fn file_names(tree: &Tree) -> Vec<String> {
    const BANNED: &[&str] = &["utils.rs", "util.rs", "types.rs", "common.rs", "helpers.rs", "misc.rs"];
    let mut found = Vec::new();
    for (path, _) in tree.under("", ".rs") {
        let name = path.rsplit('/').next().unwrap_or(path);
        if BANNED.contains(&name) {
            found.push(format!("{path}: name the concept"));
        }
        if name == "mod.rs" && !path.contains("/tests/") {
            found.push(format!("{path}: a module is the file with its name"));
        }
    }
    found
}

fn machine_paths(tree: &Tree) -> Vec<String> {
    // In pieces, so that this file does not complain about itself.
    const PATHS: &[&str] =
        &[concat!("/wo", "rk/"), concat!("/ro", "ot/"), concat!("/ho", "me/"), concat!("/Us", "ers/")];
    let mut found = Vec::new();
    for (path, text) in tree.under("", "") {
        for (number, line) in (1..).zip(text.lines()) {
            for banned in PATHS {
                // The path must begin here: `https://example.org/work/` is somebody's page.
                let begins = |at: usize| !line[..at].ends_with(|c: char| c.is_alphanumeric() || "./-_}".contains(c));
                if line.match_indices(banned).any(|(at, _)| begins(at)) {
                    found.push(format!("{path}:{number}: names a path of one machine"));
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_repository_is_tidy() {
        let found = violations(&Tree::of_checkout().unwrap());
        assert!(found.is_empty(), "\n{}", found.join("\n"));
    }

    #[test]
    fn missing_files_are_seen() {
        assert!(required_files(&Tree::default()).contains(&"README.md is missing".to_owned()));
        let found = required_files(&Tree::planted(&[("README.md", "")]));
        assert!(!found.is_empty() && !found.contains(&"README.md is missing".to_owned()));
    }

    #[test]
    fn vague_file_names_are_seen() {
        let tree = Tree::planted(&[
            ("crates/lie/src/utils.rs", ""),
            ("crates/lie/src/groups/mod.rs", ""),
            ("crates/lie/tests/support/mod.rs", ""),
            ("crates/lie/src/series.rs", ""),
        ]);
        let found = file_names(&tree);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(
            found[0].starts_with("crates/lie/src/groups/mod.rs") && found[1].starts_with("crates/lie/src/utils.rs")
        );
    }

    #[test]
    fn machine_paths_are_seen() {
        let planted = format!("see `{}me/somebody/log.csv`\n", "/ho");
        let page = format!("https://example.org{}me/index.html\n", "/ho");
        let tree = Tree::planted(&[("README.md", &planted), ("docs/notation.md", &page)]);
        assert_eq!(machine_paths(&tree), ["README.md:1: names a path of one machine"]);
    }
}
