//! `cargo xtask mutants`: planted source changes, each of which a test must catch.
//!
//! The changes are applied one at a time to a copy of the repository below `target/mutants`, never to the checkout; one build
//! folder serves them all, so each costs an incremental build.

use std::fmt::Display;
use std::fs;
use std::path::Path;
use std::process::{Child, ExitCode, Stdio};
use std::time::{Duration, Instant};

use crate::command::{cargo, root, target_dir};
use crate::tidy;

/// One planted change.
struct Mutant {
    name: String,
    file: String,
    /// Must occur exactly once in the file.
    original: String,
    replacement: String,
    /// The arguments of `cargo test` that must fail.
    test: String,
}

/// Where they are written down.
const LIST: &str = "xtask/mutants.toml";

/// All of them, in the order of the list.
fn planted() -> Result<Vec<Mutant>, Box<dyn std::error::Error>> {
    let text = fs::read_to_string(root().join(LIST)).map_err(|error| format!("{LIST}: {error}"))?;
    listed(&text).map_err(|reason| format!("{LIST}: {reason}").into())
}

fn listed(text: &str) -> Result<Vec<Mutant>, String> {
    const KEYS: [&str; 5] = ["name", "file", "original", "replacement", "test"];
    let list = text.parse::<toml::Table>().map_err(|error| error.to_string())?;
    let tables = list.get("mutant").and_then(toml::Value::as_array).ok_or("no `[[mutant]]`")?;
    tables
        .iter()
        .map(|table| {
            let table = table.as_table().ok_or("a mutant is a table")?;
            let text_of = |key: &str| table.get(key).and_then(toml::Value::as_str).map(str::to_owned);
            if let Some(unknown) = table.keys().find(|key| !KEYS.contains(&key.as_str())) {
                return Err(format!("`{unknown}` is none of {}", KEYS.join(", ")));
            }
            let [name, file, original, replacement, test] = KEYS.map(|key| {
                text_of(key).ok_or_else(|| format!("`{key}` is missing: {}", text_of("name").unwrap_or_default()))
            });
            Ok(Mutant { name: name?, file: file?, original: original?, replacement: replacement?, test: test? })
        })
        .collect()
}

/// A test that runs this long caught the change too: it does not end any more.
const PATIENCE: Duration = Duration::from_secs(600);

pub fn main(arguments: &[String]) -> ExitCode {
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["--list"] => {
            let list = planted().map(|mutants| {
                for mutant in mutants {
                    println!("{:<52} {}: cargo test {}", mutant.name, mutant.file, mutant.test);
                }
                true
            });
            exit_code(list)
        }
        [] => exit_code(run("")),
        ["--only", part] => exit_code(run(part)),
        _ => {
            eprintln!("cargo xtask mutants [--only TEXT] [--list]");
            ExitCode::from(2)
        }
    }
}

fn exit_code<E: Display>(result: Result<bool, E>) -> ExitCode {
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Fate {
    Killed,
    Survived,
    /// The original text no longer occurs exactly once.
    Stale,
    /// The changed source does not compile, so no test judged it.
    DoesNotBuild,
    /// The test fails without the change.
    TestAlreadyFails,
}

/// Tries every mutant whose name holds `part`; true where all were killed.
pub fn run(part: &str) -> Result<bool, Box<dyn std::error::Error>> {
    let mut chosen = planted()?;
    chosen.retain(|mutant| mutant.name.contains(part));
    if chosen.is_empty() {
        return Err(format!("no mutant's name holds `{part}`").into());
    }
    let copy = target_dir().join("mutants/tree");
    synchronise(&root(), &copy)?;

    let mut baselines: Vec<(&str, bool)> = Vec::new();
    let mut fates = Vec::new();
    for mutant in &chosen {
        let known = baselines.iter().find(|(test, _)| *test == mutant.test).map(|(_, passes)| *passes);
        let passes = if let Some(passes) = known {
            passes
        } else {
            let passes = cargo_test(&copy, &mutant.test, Phase::Run)?;
            baselines.push((&mutant.test, passes));
            passes
        };
        let start = Instant::now();
        let fate = if passes { try_mutant(mutant, &copy)? } else { Fate::TestAlreadyFails };
        println!("{:<52} {fate:?} ({:.0} s)", mutant.name, start.elapsed().as_secs_f64());
        fates.push((mutant, fate));
    }

    let killed = fates.iter().filter(|(_, fate)| *fate == Fate::Killed).count();
    println!("\n{killed} of {} killed", fates.len());
    for (mutant, fate) in fates.iter().filter(|(_, fate)| *fate != Fate::Killed) {
        println!("{fate:?}: {} in {}, cargo test {}", mutant.name, mutant.file, mutant.test);
    }
    Ok(killed == fates.len())
}

fn try_mutant(mutant: &Mutant, copy: &Path) -> Result<Fate, Box<dyn std::error::Error>> {
    let path = copy.join(&mutant.file);
    let original = fs::read_to_string(&path).unwrap_or_default();
    let Some(changed) = apply(&original, &mutant.original, &mutant.replacement) else { return Ok(Fate::Stale) };
    fs::write(&path, changed)?;
    let fate = if !cargo_test(copy, &mutant.test, Phase::Build)? {
        Fate::DoesNotBuild
    } else if cargo_test(copy, &mutant.test, Phase::Run)? {
        Fate::Survived
    } else {
        Fate::Killed
    };
    fs::write(&path, original)?;
    Ok(fate)
}

/// The text with its one occurrence replaced.
fn apply(text: &str, original: &str, replacement: &str) -> Option<String> {
    (text.matches(original).count() == 1 && original != replacement).then(|| text.replacen(original, replacement, 1))
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    Build,
    Run,
}

/// Whether `cargo test` succeeds in the copy.
fn cargo_test(copy: &Path, test: &str, phase: Phase) -> std::io::Result<bool> {
    let mut command = cargo("test --quiet");
    command.current_dir(copy).args(test.split_whitespace());
    if phase == Phase::Build {
        command.arg("--no-run");
    }
    command.env("CARGO_TARGET_DIR", target_dir().join("mutants/target"));
    // A killed mutant would leave proptest's failing case behind, and the next run would find it first.
    command.env("PROPTEST_FAILURE_PERSISTENCE", "off");
    let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
    if phase == Phase::Build { within(child, Duration::MAX) } else { within(child, PATIENCE) }
}

/// Whether the child ends well, and in time.
fn within(mut child: Child, patience: Duration) -> std::io::Result<bool> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status.success());
        }
        if start.elapsed() > patience {
            child.kill()?;
            child.wait()?;
            return Ok(false);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Makes the copy equal to the checkout; files that are equal keep their time stamps, so cargo builds only what changed.
fn synchronise(from: &Path, to: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let wanted = tidy::repository_files(from)?;
    if to.exists() {
        for path in tidy::repository_files(to)? {
            if !wanted.contains(&path) {
                fs::remove_file(to.join(path))?;
            }
        }
    }
    for path in wanted {
        let Ok(bytes) = fs::read(from.join(&path)) else { continue };
        let target = to.join(path);
        if fs::read(&target).ok().as_ref() != Some(&bytes) {
            if let Some(folder) = target.parent() {
                fs::create_dir_all(folder)?;
            }
            fs::write(target, bytes)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_planted_change_still_applies() {
        let mut stale = planted().unwrap();
        stale.retain(|mutant| {
            let text = fs::read_to_string(root().join(&mutant.file)).unwrap_or_default();
            apply(&text, &mutant.original, &mutant.replacement).is_none()
        });
        let stale: Vec<String> = stale.into_iter().map(|mutant| mutant.name).collect();
        assert!(stale.is_empty(), "{stale:#?}");
    }

    #[test]
    fn names_are_unique() {
        let mutants = planted().unwrap();
        for (index, mutant) in mutants.iter().enumerate() {
            assert!(mutants[..index].iter().all(|other| other.name != mutant.name), "{}", mutant.name);
        }
    }

    #[test]
    fn a_list_that_is_none_names_what_is_wrong() {
        let whole = "[[mutant]]\nname = 'a'\nfile = 'b'\noriginal = 'c'\nreplacement = ''\ntest = 'd'\n";
        assert_eq!(listed(whole).unwrap().len(), 1);
        let refused = |text: &str| listed(text).map(|_| ()).unwrap_err();
        assert!(refused(&whole.replace("file", "place")).contains("`place` is none of"));
        assert_eq!(refused("[[mutant]]\nname = 'a'\n"), "`file` is missing: a");
        assert_eq!(refused(""), "no `[[mutant]]`");
    }

    #[test]
    fn only_a_single_occurrence_is_replaced() {
        assert_eq!(apply("a + b", "+", "-"), Some("a - b".to_owned()));
        assert_eq!(apply("a + b + c", "+", "-"), None);
        assert_eq!(apply("a + b", "*", "-"), None);
        assert_eq!(apply("a + b", "+", "+"), None);
    }

    #[test]
    fn a_test_that_does_not_end_is_stopped() {
        let child = cargo("--version").stdout(Stdio::null()).spawn().unwrap();
        assert!(within(child, Duration::from_secs(60)).unwrap());
        let child = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        assert!(!within(child, Duration::from_millis(100)).unwrap());
    }

    #[test]
    fn the_copy_follows_the_checkout() {
        let base = std::env::temp_dir().join(format!("tumble-mutants-{}", std::process::id()));
        let (from, to) = (base.join("from"), base.join("to"));
        fs::create_dir_all(from.join("src")).unwrap();
        fs::write(from.join("src/a.rs"), "a").unwrap();
        fs::write(from.join("src/b.rs"), "b").unwrap();
        synchronise(&from, &to).unwrap();
        let written = fs::metadata(to.join("src/a.rs")).unwrap().modified().unwrap();
        fs::remove_file(from.join("src/b.rs")).unwrap();
        fs::write(from.join("c.rs"), "c").unwrap();
        synchronise(&from, &to).unwrap();
        assert!(!to.join("src/b.rs").exists() && to.join("c.rs").exists());
        assert_eq!(fs::metadata(to.join("src/a.rs")).unwrap().modified().unwrap(), written);
        fs::remove_dir_all(base).unwrap();
    }
}
