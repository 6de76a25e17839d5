//! `cargo xtask ci`: every check beyond `cargo test --workspace`.
//!
//! The steps share what they build. Commands that need the crates compiled say `--workspace`, because cargo then picks the same
//! features of every dependency as the test command did; permutations of features are only type-checked.

use std::fmt::Write as _;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode};
use std::time::Instant;

use crate::command::{
    Outcome, PROGRAMS, cargo, is_installed, line, programs_as_tested, root, shell, shell_together, studies, target_dir,
};
use crate::{cluster, fuzz, mutants, packages, python, tidy};

/// When a step runs without being named.
#[derive(Clone, Copy, PartialEq, Eq)]
enum When {
    Always,
    /// As always, beside the others: programs that are built already do not wait for compilers, which seldom use every core.
    Beside,
    Full,
}

struct Step {
    name: &'static str,
    about: &'static str,
    when: When,
    run: fn() -> Outcome,
}

const fn always(name: &'static str, about: &'static str, run: fn() -> Outcome) -> Step {
    Step { name, about, when: When::Always, run }
}

const fn beside(name: &'static str, about: &'static str, run: fn() -> Outcome) -> Step {
    Step { name, about, when: When::Beside, run }
}

const fn full(name: &'static str, about: &'static str, run: fn() -> Outcome) -> Step {
    Step { name, about, when: When::Full, run }
}

/// Cheap steps first, so that a slip shows early.
const STEPS: &[Step] = &[
    always("format", "cargo fmt", || shell(&mut [cargo("fmt --all --check")])),
    always("tidy", "the rules a machine can hold", tidy::step),
    always("clippy", "all targets, warnings are errors", || {
        shell(&mut [cargo("clippy --workspace --all-targets -- -D warnings")])
    }),
    full("clippy-features", "the same with all features", || {
        shell(&mut [cargo("clippy --workspace --all-targets --all-features -- -D warnings")])
    }),
    always("docs", "rustdoc, warnings are errors", docs),
    always("examples", "build and run every example", examples),
    full("feature-tests", "tests behind features that are off by default", feature_tests),
    full("python", "the Python module in a virtual environment, against the command line to the bit", python::step),
    full("python-wheel", "the same as users build it, with its lints, its size and its speed", python::optimised),
    full("servicer", "the tutorial package outside of the workspace, as a user would build and test it", servicer),
    always(
        "no-std",
        "those that promise it type-check without features, and nothing turns the standard library on",
        no_std,
    ),
    beside("studies", "the studies of identification, of RATTLE, of faults, reduced", reduced_studies),
    beside(
        "missions",
        "ninety missions with drawn payloads and beliefs, with three kinds of sensors: all arrive, touch nothing and are not doubted",
        drawn_missions,
    ),
    full("pages", "a page of every kind in a real browser, where one is at hand", crate::report_check::step),
    beside("cluster", "a campaign in sixteen parts, one killed, is the campaign flown at once", cluster::step),
    full("packages", "what would be published, unpacked: it and its tests compile", packages::check),
    always("deny", "bans, licences, sources", deny),
    beside("real-data", "measured throws, payloads and flights meet their targets", || {
        real_data(&["--without", "crazyflie_brushless_mocap"])
    }),
    full("real-data-all", "the same with the flights of a quadrotor that a camera saw, three minutes more", || {
        real_data(&[])
    }),
    full("other-studies", "the studies of chapter 4, of actuation, of control, of arms, reduced", other_studies),
    beside(
        "determinism",
        "long tumbles, plans, a flight and missions are, as tests are built, the bytes that were frozen as users build them",
        determinism,
    ),
    full("panic-free", "the link proves that the hot paths cannot panic, and refuses a control that can", panic_free),
    full("package-verify", "every package builds from what would be published", || {
        shell(&mut [cargo("package --workspace --allow-dirty")])
    }),
    full("packages-tests", "the tests of the unpacked packages pass", packages::test),
    full("semver", "the public interfaces against those last published", packages::semver),
    full("determinism-all", "the same bytes unoptimised, optimised, and with all that this processor can do", || {
        built(&[UNOPTIMISED, OPTIMISED, NATIVE]).map_or_else(Outcome::Failed, |folders| frozen(&folders))
    }),
    full("study-tests", "the tests of the studies themselves", || {
        shell(&mut [cargo("test --package studies --bin studies --release")])
    }),
    full(
        "powerset",
        "type-check without features, with each alone and beside the default, and with all together",
        powerset,
    ),
    full("tests-alone", "the tests of each crate, built without the others' features", tests_alone),
    full("tests-release", "all tests, optimised", || shell(&mut [cargo("test --workspace --release")])),
    full("benches", "every benchmark compiles", || shell(&mut [cargo("bench --workspace --no-run")])),
    full("minimum-rust", "the stated minimum compiler", minimum_rust),
    full("fuzz", "every parser, half a minute of a fuzzer's bytes", || fuzz::run(30, &[])),
    full("mutants", "every planted source change is caught", || match mutants::run("") {
        Ok(true) => Outcome::Ok,
        Ok(false) => Outcome::Failed("see the table above".into()),
        Err(error) => Outcome::Failed(error.to_string()),
    }),
];

/// Packages that are published, each of which has a `--lib`, and whether they promise to build without the standard library.
const LIBRARIES: &[(&str, bool)] = &[
    ("lie", true),
    ("dynamics", true),
    ("identification", true),
    ("planning", false),
    ("astrobee", false),
    ("formats", false),
    ("tumble", false),
];

pub fn main(arguments: &[String]) -> ExitCode {
    let (mut long, mut only, mut list) = (false, Vec::new(), false);
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--full" => long = true,
            "--list" => list = true,
            "--only" => match rest.next().filter(|name| STEPS.iter().any(|step| step.name == name.as_str())) {
                Some(name) => only.push(name.as_str()),
                None => return bad_input("--only wants the name of a step"),
            },
            unknown => return bad_input(&format!("unknown argument `{unknown}`")),
        }
    }
    if list {
        for step in STEPS {
            println!("{:<16} {}{}", step.name, step.about, if step.when == When::Full { " (--full)" } else { "" });
        }
        return ExitCode::SUCCESS;
    }

    let wanted =
        |step: &&Step| if only.is_empty() { long || step.when != When::Full } else { only.contains(&step.name) };
    // Among the others of `--full` are some that build the same programs otherwise.
    let together = only.is_empty() && !long;
    let (besides, others): (Vec<&Step>, Vec<&Step>) =
        STEPS.iter().filter(wanted).partition(|step| together && step.when == When::Beside);
    let started = if besides.is_empty() { None } else { Some(start_beside(&besides)) };
    let mut rows: Vec<Row> = others.into_iter().map(run).collect();
    if let Some(started) = started {
        rows.extend(end_beside(&besides, started));
    }

    println!("\n{:<16} {:>8}  result", "step", "seconds");
    for row in &rows {
        println!("{:<16} {:>8.1}  {}", row.name, row.seconds, row.verdict);
    }
    if rows.iter().any(|row| row.verdict.starts_with(FAILED)) { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

/// How a step went.
#[derive(Debug, PartialEq)]
struct Row {
    name: String,
    seconds: f64,
    verdict: String,
}

const FAILED: &str = "FAILED";

fn run(step: &Step) -> Row {
    println!("\n=== {}: {}", step.name, step.about);
    let start = Instant::now();
    let outcome = (step.run)();
    let row = Row { name: step.name.to_owned(), seconds: start.elapsed().as_secs_f64(), verdict: verdict(&outcome) };
    println!("{}", row.line());
    row
}

impl Row {
    fn line(&self) -> String {
        format!("=== {}: {} ({:.1} s)", self.name, self.verdict, self.seconds)
    }

    /// Reads what `line` writes.
    fn of(line: &str) -> Option<Self> {
        let (name, rest) = line.strip_prefix("=== ")?.split_once(": ")?;
        let (verdict, seconds) = rest.strip_suffix(" s)")?.rsplit_once(" (")?;
        Some(Self { name: name.to_owned(), seconds: seconds.parse().ok()?, verdict: verdict.to_owned() })
    }
}

/// What the steps beside the others say until they end.
fn beside_log() -> PathBuf {
    target_dir().join("ci-beside.log")
}

/// Starts this program with these steps, once what they run is built.
fn start_beside(steps: &[&Step]) -> Result<Child, String> {
    let folder = programs_as_tested()?;
    let log = File::create(beside_log()).map_err(|error| error.to_string())?;
    let log_too = log.try_clone().map_err(|error| error.to_string())?;
    let mut command = Command::new(std::env::current_exe().map_err(|error| error.to_string())?);
    command.arg("ci").args(steps.iter().flat_map(|step| ["--only", step.name]));
    command.env(PROGRAMS, folder).stdout(log).stderr(log_too);
    println!(
        "beside what follows, into {}: {}",
        beside_log().display(),
        steps.iter().map(|step| step.name).collect::<Vec<_>>().join(", ")
    );
    command.spawn().map_err(|error| error.to_string())
}

/// Waits for them and prints what they said.
fn end_beside(steps: &[&Step], started: Result<Child, String>) -> Vec<Row> {
    let ended = started.and_then(|mut child| child.wait().map_err(|error| error.to_string()));
    // Without a start, what lies there is of another run.
    let said = ended.as_ref().ok().and_then(|_| std::fs::read(beside_log()).ok()).unwrap_or_default();
    let said = String::from_utf8_lossy(&said);
    print!("{said}");
    let mut rows: Vec<Row> = said.lines().filter_map(Row::of).collect();
    let reason = ended.map_or_else(|reason| reason, |status| format!("it did not end: {status}"));
    for step in steps {
        if rows.iter().all(|row| row.name != step.name) {
            let verdict = format!("{FAILED}: {reason}");
            rows.push(Row { name: step.name.to_owned(), seconds: 0.0, verdict });
        }
    }
    rows
}

fn bad_input(message: &str) -> ExitCode {
    eprintln!("{message}; `cargo xtask ci --list` names the steps");
    ExitCode::from(2)
}

fn verdict(outcome: &Outcome) -> String {
    match outcome {
        Outcome::Ok => "ok".into(),
        Outcome::Failed(reason) => format!("{FAILED}: {reason}"),
        Outcome::Skipped(reason) => format!("skipped: {reason}"),
    }
}

fn has(path: &str) -> bool {
    root().join(path).exists()
}

/// The package in a folder of `crates`.
fn package(folder: &str) -> String {
    if folder == "tumble" { folder.to_owned() } else { format!("tumble-{folder}") }
}

/// The libraries that exist: folder name, and whether they promise `no_std`.
fn libraries() -> impl Iterator<Item = (&'static str, bool)> {
    LIBRARIES.iter().copied().filter(|(name, _)| has(&format!("crates/{name}")))
}

fn docs() -> Outcome {
    let mut command = cargo("doc --workspace --no-deps --all-features");
    command.env("RUSTDOCFLAGS", "-D warnings");
    shell(&mut [command])
}

/// `crates/*/examples/*.rs`, by name.
fn example_names() -> Vec<String> {
    let mut names: Vec<String> = libraries()
        .filter_map(|(name, _)| std::fs::read_dir(root().join("crates").join(name).join("examples")).ok())
        .flatten()
        .flatten()
        .filter_map(|entry| Some(entry.file_name().to_str()?.strip_suffix(".rs")?.to_owned()))
        .collect();
    names.sort();
    names
}

fn examples() -> Outcome {
    // Run as they lie: `cargo run --example` would build them again.
    let folder = match programs_as_tested() {
        Ok(folder) => folder,
        Err(reason) => return Outcome::Failed(reason),
    };
    let run = |name: &String| {
        let mut command = Command::new(folder.join("examples").join(name));
        command.current_dir(root());
        command
    };
    shell(&mut example_names().iter().map(run).collect::<Vec<_>>())
}

/// Crate, feature, and the test program that wants it.
const FEATURE_TESTS: [(&str, &str, &str); 2] =
    [("identification", "clarabel-sdp", "lmi_against_clarabel"), ("planning", "parry", "parry_world")];

fn feature_tests() -> Outcome {
    // `--workspace` shares every dependency with the test command; naming the tests keeps the others from being built again.
    let mut test = cargo("test --workspace");
    for (library, feature, name) in FEATURE_TESTS {
        if !has(&format!("crates/{library}/tests/{name}.rs")) {
            return Outcome::Failed(format!("crates/{library}/tests/{name}.rs is missing"));
        }
        test.args(["--features", &format!("{}/{feature}", package(library)), "--test", name]);
    }
    shell(&mut [test])
}

/// In a folder of its own: its profile and its features are those of a stranger.
fn servicer() -> Outcome {
    let mut test = cargo("test --quiet --manifest-path examples/servicer/Cargo.toml --target-dir");
    test.arg(target_dir().join("servicer"));
    let lints = "clippy --quiet --all-targets --manifest-path examples/servicer/Cargo.toml --target-dir";
    let mut clippy = cargo(lints);
    clippy.arg(target_dir().join("servicer")).args(["--", "-D", "warnings"]);
    shell(&mut [test, clippy])
}

fn features_of(library: &str) -> Vec<String> {
    let manifest = std::fs::read_to_string(root().join("crates").join(library).join("Cargo.toml")).unwrap_or_default();
    let Ok(manifest) = manifest.parse::<toml::Table>() else { return Vec::new() };
    let features = manifest.get("features").and_then(toml::Value::as_table);
    features.into_iter().flat_map(toml::Table::keys).filter(|name| *name != "default").cloned().collect()
}

fn powerset() -> Outcome {
    let mut commands = Vec::new();
    for (library, _) in libraries() {
        commands.push(without_features(library));
        let check = format!("check --quiet --package {} --lib", package(library));
        for feature in features_of(library) {
            commands.push(cargo(&format!("{check} --no-default-features --features {feature}")));
            // As most users ask for it.
            commands.push(cargo(&format!("{check} --features {feature}")));
        }
        commands.push(cargo(&format!("{check} --all-features")));
    }
    shell(&mut commands)
}

fn without_features(library: &str) -> Command {
    cargo(&format!("check --quiet --package {} --lib --no-default-features", package(library)))
}

fn no_std() -> Outcome {
    let mut commands: Vec<Command> =
        libraries().filter(|(_, no_std)| *no_std).map(|(library, _)| without_features(library)).collect();
    if let Outcome::Failed(reason) = shell(&mut commands) {
        return Outcome::Failed(reason);
    }
    // The host has a standard library, so type-checking alone does not show that nothing asks for it.
    for (library, no_std) in libraries() {
        if no_std {
            let mut tree = cargo(&format!(
                "tree --package {} --no-default-features --edges normal,features --prefix none",
                package(library)
            ));
            println!("$ {}", line(&tree));
            let Ok(output) = tree.output() else { return Outcome::Failed("cargo tree does not start".into()) };
            if !output.status.success() {
                return Outcome::Failed(String::from_utf8_lossy(&output.stderr).into_owned());
            }
            let asking = std_features(&String::from_utf8_lossy(&output.stdout));
            if !asking.is_empty() {
                return Outcome::Failed(format!(
                    "{} without its default features uses {}",
                    package(library),
                    asking.join(", ")
                ));
            }
        }
    }
    Outcome::Ok
}

/// Lines of `cargo tree --edges features` that turn a standard library on.
fn std_features(tree: &str) -> Vec<String> {
    tree.lines().filter(|line| line.trim_end_matches(" (*)").ends_with("feature \"std\"")).map(str::to_owned).collect()
}

fn deny() -> Outcome {
    if !is_installed("cargo", "deny") {
        return Outcome::Skipped("cargo-deny is not installed".into());
    }
    shell(&mut [cargo("deny check bans licenses sources")])
}

/// `TUMBLE_DATA`, else the folder beside the checkout.
fn data_folder() -> Option<PathBuf> {
    let folder = std::env::var_os("TUMBLE_DATA").map_or_else(|| root().join("../shared/data"), PathBuf::from);
    folder.is_dir().then_some(folder)
}

fn real_data(arguments: &[&str]) -> Outcome {
    let set = |name: &str, value: &str| std::env::var(name).is_ok_and(|found| found == value);
    let Some(folder) = data_folder() else {
        return if set("CI", "true") || set("TUMBLE_REQUIRE_DATA", "1") {
            Outcome::Failed("measured data are required here: set TUMBLE_DATA".into())
        } else {
            Outcome::Skipped("no measured data: set TUMBLE_DATA".into())
        };
    };
    let mut command = match programs_as_tested() {
        Ok(folder) => Command::new(folder.join("studies")),
        Err(reason) => return Outcome::Failed(reason),
    };
    command.env("TUMBLE_REQUIRE_DATA", "1").args(["real-data", "--check", "--data"]).arg(folder).args(arguments);
    shell(&mut [command])
}

/// Few runs of every cell with the bands of their own number, every mission of RATTLE and every defect with one seed and white noise, every fault in two
/// severities on two missions, a log of each kind of sensors, each fault of a thruster once. The long studies are the same without the last two words.
fn reduced_studies() -> Outcome {
    let folder = match programs_as_tested() {
        Ok(folder) => folder,
        Err(reason) => return Outcome::Failed(reason),
    };
    let commands = [
        "study identification --runs 5",
        "reproduce rattle --seeds 1 --sensing ideal",
        "study faults --missions 56",
        "study real-sensors --seeds 1 --first 951",
        "study thruster-faults --seeds 1",
    ];
    let study = |arguments: &str| {
        let mut command = Command::new(folder.join("studies"));
        command.args(arguments.split(' '));
        command
    };
    // Most of them use one thread.
    shell_together(&mut commands.map(study))
}

/// Two loads with two motions of each criterion, two flights of each condition, forty missions of each series, twenty flights against each
/// certificate.
fn other_studies() -> Outcome {
    let mut chapter4 = studies("reproduce");
    chapter4.args(["reproduce", "chapter4", "--runs", "2"]);
    let mut actuation = studies("reproduce");
    actuation.args(["reproduce", "actuation", "--flights", "2"]);
    let (mut missions, mut attitude) = (studies("study"), studies("study"));
    missions.args(["study", "tube-missions", "--missions", "40"]);
    attitude.args(["study", "attitude-certificate", "--runs", "2020"]);
    let mut arms = studies("study");
    arms.args(["study", "arms", "--runs", "20", "--steps", "10000"]);
    shell(&mut [chapter4, actuation, missions, attitude, arms])
}

/// Exit code 0 says that all arrived, that nothing was touched and that no limit was passed; that no healthy robot was doubted stands in the rows.
fn drawn_missions() -> Outcome {
    let program = match programs_as_tested() {
        Ok(folder) => folder.join("tumble"),
        Err(reason) => return Outcome::Failed(reason),
    };
    let mut alarms = Vec::new();
    // those that do not learn show that ways keep within what the tube of the first belief follows
    for (sensing, feedback, missions) in
        [("ideal", "on", "20"), ("nominal", "on", "20"), ("thesis-flight", "on", "5"), ("ideal", "off", "10")]
    {
        let folder = target_dir().join(format!("drawn-missions-{sensing}-{feedback}"));
        let _ = std::fs::remove_dir_all(&folder);
        let mut campaign = Command::new(&program);
        campaign.args([
            "campaign",
            "iss-cargo",
            "granite-cargo",
            "--draw",
            "--sensing",
            sensing,
            "--feedback",
            feedback,
        ]);
        campaign.args(["--missions", missions, "--out"]).arg(&folder);
        if let Outcome::Failed(reason) = shell(&mut [campaign]) {
            return Outcome::Failed(reason);
        }
        match std::fs::read_to_string(folder.join("rows.csv")) {
            Ok(rows) => alarms
                .extend(doubted(&rows).into_iter().map(|seed| format!("{sensing}, feedback {feedback}, seed {seed}"))),
            Err(error) => return Outcome::Failed(format!("rows of the campaign under {sensing}: {error}")),
        }
    }
    if alarms.is_empty() {
        Outcome::Ok
    } else {
        Outcome::Failed(format!("healthy robots were doubted: {}", alarms.join("; ")))
    }
}

/// Scenario and seed of missions in which the body, the map or actuators were doubted.
fn doubted(rows: &str) -> Vec<String> {
    let mut lines = rows.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap_or_default();
    let at = |name: &str| header.iter().position(|column| *column == name);
    let doubts: Vec<usize> =
        ["doubts_of_body", "doubts_of_map", "doubts_of_actuators"].into_iter().filter_map(at).collect();
    let named = at("scenario").zip(at("seed")).filter(|_| doubts.len() == 3);
    let Some((scenario, seed)) = named else { return vec!["unknown: columns are missing".into()] };
    lines
        .filter(|row| doubts.iter().any(|doubt| row.get(*doubt) != Some(&"0")))
        .map(|row| format!("{} {}", row.get(seed).unwrap_or(&"?"), row.get(scenario).unwrap_or(&"?")))
        .collect()
}

/// The examples that print hashes: crate and example.
const HASHES: [(&str, &str); 4] =
    [("dynamics", "determinism"), ("planning", "same_plans"), ("astrobee", "same_bytes"), ("tumble", "same_missions")];

/// Name, cargo's folder and `RUSTFLAGS` of a way to build.
type Way = (&'static str, &'static str, &'static str);
const UNOPTIMISED: Way = ("opt-level-0", "debug", "");
const OPTIMISED: Way = ("opt-level-3", "release", "");
const NATIVE: Way = ("native", "release", "-C target-cpu=native");

/// What the examples print when they are built as users build them: `cargo xtask freeze` writes it.
fn frozen_hashes() -> PathBuf {
    root().join("xtask/hashes.txt")
}

/// The examples, built as tests are, print what was frozen.
fn determinism() -> Outcome {
    match programs_as_tested() {
        Ok(folder) => frozen(&[("as tests are built", folder.join("examples"))]),
        Err(reason) => Outcome::Failed(reason),
    }
}

fn frozen(folders: &[(&str, PathBuf)]) -> Outcome {
    let (frozen, found) = match (std::fs::read(frozen_hashes()), printed(folders)) {
        (Ok(frozen), Ok(found)) => (frozen, found),
        (Err(error), _) => return Outcome::Failed(format!("{}: {error}", frozen_hashes().display())),
        (_, Err(reason)) => return Outcome::Failed(reason),
    };
    match folders.iter().zip(found).find(|(_, found)| *found != frozen) {
        None => Outcome::Ok,
        Some(((way, _), _)) => Outcome::Failed(format!(
            "{way}, the bytes are not those of xtask/hashes.txt; where they were meant to change, `cargo xtask freeze` writes them anew"
        )),
    }
}

/// `cargo xtask freeze`: builds the examples as users build them and writes what they print.
pub fn freeze() -> ExitCode {
    let hashes = built(&[OPTIMISED]).and_then(|folders| printed(&folders));
    let written =
        hashes.and_then(|hashes| std::fs::write(frozen_hashes(), hashes.concat()).map_err(|error| error.to_string()));
    match written {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("{reason}");
            ExitCode::FAILURE
        }
    }
}

/// What the examples in each folder print.
fn printed(folders: &[(&str, PathBuf)]) -> Result<Vec<Vec<u8>>, String> {
    let mut printed = Vec::new();
    for (way, folder) in folders {
        let mut hashes = Vec::new();
        for (_, example) in HASHES {
            match Command::new(folder.join(example)).output() {
                Ok(output) if output.status.success() && !output.stdout.is_empty() => hashes.extend(output.stdout),
                Ok(output) => return Err(format!("{way}: {}", String::from_utf8_lossy(&output.stderr))),
                Err(error) => return Err(format!("{way}: {error}")),
            }
        }
        println!("{way}:\n{}", String::from_utf8_lossy(&hashes).trim_end());
        printed.push(hashes);
    }
    Ok(printed)
}

/// The folders of the examples, built in these ways below a folder of `target`.
fn built(ways: &[Way]) -> Result<Vec<(&'static str, PathBuf)>, String> {
    let place = target_dir().join("determinism");
    let package = package_of(&place).map_err(|error| error.to_string())?;
    let mut folders = Vec::new();
    for &(way, folder, flags) in ways {
        let target = place.join(way);
        let mut build = cargo("build --quiet --manifest-path");
        build.arg(package.join("Cargo.toml")).arg("--target-dir").arg(&target).env("RUSTFLAGS", flags);
        if folder == "release" {
            build.arg("--release");
        }
        if let Outcome::Failed(reason) = shell(&mut [build]) {
            return Err(reason);
        }
        folders.push((way, target.join(folder)));
    }
    Ok(folders)
}

/// A package around the examples, because examples of the crates would be built three times over with all their test dependencies. Its
/// lock file is the workspace's.
fn package_of(place: &Path) -> Result<PathBuf, Box<dyn std::error::Error>> {
    let (root, folder) = (root(), place.join("package"));
    std::fs::create_dir_all(&folder)?;
    std::fs::copy(root.join("Cargo.lock"), folder.join("Cargo.lock"))?;
    let mut manifest = "[package]\nname = \"determinism\"\nedition = \"2024\"\n\n[workspace]\n\n".to_owned();
    for (library, example) in HASHES {
        let path = root.join(format!("crates/{library}/examples/{example}.rs"));
        let _ = writeln!(manifest, "[[bin]]\nname = \"{example}\"\npath = '{}'\n", path.display());
    }
    manifest += "[profile.dev]\ndebug = false\n\n";
    for (library, features) in
        [("lie", ""), ("dynamics", ""), ("planning", ""), ("astrobee", ""), ("formats", ""), ("tumble", "\"astrobee\"")]
    {
        let path = root.join("crates").join(library);
        let _ = writeln!(
            manifest,
            "[dependencies.{}]\npath = '{}'\ndefault-features = false\nfeatures = [{features}]\n",
            package(library),
            path.display(),
        );
    }
    std::fs::write(folder.join("Cargo.toml"), manifest)?;
    Ok(folder)
}

/// Links the kernels, then the kernels and a function that can panic: that link must fail, and for this reason.
fn panic_free() -> Outcome {
    let build = |feature: &str| {
        let mut build = cargo(&format!("build --package panic-free --profile panic-free --features {feature}"));
        build.arg("--target-dir").arg(target_dir().join("panic-free"));
        build
    };
    if let Outcome::Failed(reason) = shell(&mut [build("check")]) {
        return Outcome::Failed(reason);
    }
    let mut control = build("control");
    println!("$ {} (must not link)", line(&control));
    let Ok(output) = control.output() else { return Outcome::Failed("cargo does not start".into()) };
    let said = String::from_utf8_lossy(&output.stderr);
    if output.status.success() {
        Outcome::Failed("a function that can panic was linked: the check proves nothing".into())
    } else if !said.contains("detected panic in function `control`") {
        Outcome::Failed(format!("the control failed for another reason: {said}"))
    } else {
        Outcome::Ok
    }
}

fn tests_alone() -> Outcome {
    let mut commands: Vec<Command> =
        libraries().map(|(name, _)| cargo(&format!("test --package {}", package(name)))).collect();
    shell(&mut commands)
}

fn minimum_rust() -> Outcome {
    let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap_or_default();
    let version = manifest.parse::<toml::Table>().ok().and_then(|manifest| {
        Some(manifest.get("workspace")?.get("package")?.get("rust-version")?.as_str()?.to_owned())
    });
    let Some(version) = version else { return Outcome::Failed("Cargo.toml states no rust-version".into()) };
    if !is_installed("cargo", &format!("+{version}")) {
        return Outcome::Skipped(format!("Rust {version} is not installed"));
    }
    let mut check = Command::new("cargo");
    check.current_dir(root()).arg(format!("+{version}")).args(["check", "--workspace", "--target-dir"]);
    check.arg(target_dir().join("minimum-rust"));
    shell(&mut [check])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_doubt_is_found_in_its_row_and_a_missing_column_is_one() {
        let header = "scenario,seed,doubts_of_body,doubts_of_map,doubts_of_actuators,message\n";
        assert!(doubted(&format!("{header}a,1,0,0,0,\n")).is_empty());
        assert_eq!(doubted(&format!("{header}a,1,0,0,0,\nb,2,0,1,0,\n")), ["2 b"]);
        assert_eq!(doubted("scenario,seed,doubts_of_body\na,1,0\n").len(), 1);
    }

    #[test]
    fn what_a_step_says_at_its_end_is_read_again() {
        let row = Row { name: "cluster".into(), seconds: 1.5, verdict: "FAILED: part 3 (of 16): lost (twice)".into() };
        assert_eq!(Row::of(&row.line()), Some(row));
        assert_eq!(Row::of("=== cluster: a campaign in parts"), None);
    }

    #[test]
    fn step_names_are_unique() {
        for (index, step) in STEPS.iter().enumerate() {
            assert!(STEPS[..index].iter().all(|other| other.name != step.name), "{}", step.name);
        }
    }

    #[test]
    fn a_failing_command_fails_its_step_and_the_next_one_still_runs() {
        let mut commands = [cargo("no-such-subcommand"), cargo("--version")];
        let Outcome::Failed(reason) = shell(&mut commands) else { panic!("a failing command passed") };
        assert_eq!(reason, "cargo no-such-subcommand");
    }

    #[test]
    fn of_commands_at_once_those_that_fail_are_named() {
        let together = |lines: &[&str]| shell_together(&mut lines.iter().map(|line| cargo(line)).collect::<Vec<_>>());
        assert!(matches!(together(&["--version", "--version"]), Outcome::Ok));
        let Outcome::Failed(reason) = together(&["--version", "no-such-subcommand"]) else {
            panic!("a failing command passed")
        };
        assert_eq!(reason, "cargo no-such-subcommand");
    }

    #[test]
    fn a_standard_library_in_the_tree_is_seen() {
        let tree = "nalgebra feature \"libm-force\"\nnalgebra feature \"std\" (*)\nsyn feature \"default\"";
        assert_eq!(std_features(tree), ["nalgebra feature \"std\" (*)"]);
        assert!(std_features("nalgebra feature \"macros\"").is_empty());
    }
}
