//! `cargo xtask python`: the Python module, built as a wheel into a virtual environment, tested and measured there.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use crate::command::{Outcome, cargo, line, programs_as_tested, root, shell, target_dir};

/// Where it is set, a Python that is not at hand is a failure.
const REQUIRED: &str = "TUMBLE_REQUIRE_PYTHON";

/// What is installed beside the wheel.
const PACKAGES: [&str; 3] = ["maturin>=1.7,<2", "numpy", "matplotlib"];

/// Optimised as users build it, with figures of time and size.
pub fn main() -> ExitCode {
    match optimised() {
        Outcome::Ok => ExitCode::SUCCESS,
        Outcome::Skipped(reason) => {
            println!("skipped: {reason}");
            ExitCode::SUCCESS
        }
        Outcome::Failed(reason) => {
            eprintln!("failed: {reason}");
            ExitCode::FAILURE
        }
    }
}

/// The same as a step of CI.
pub fn optimised() -> Outcome {
    run(Profile::Release)
}

/// The shorter step of CI: against the program as tests are built, which calculates the same bits.
pub fn step() -> Outcome {
    run(Profile::Test)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Profile {
    Release,
    Test,
}

fn run(profile: Profile) -> Outcome {
    let folder = target_dir().join("python");
    let python = match environment(&folder.join("venv")) {
        Ok(python) => python,
        Err(reason) if std::env::var_os(REQUIRED).is_some() => return Outcome::Failed(reason),
        Err(reason) => return Outcome::Skipped(reason),
    };
    let built = program(profile).and_then(|program| Ok((program, wheel(profile, &python, &folder)?)));
    let (program, wheel) = match built {
        Ok(built) => built,
        Err(reason) => return Outcome::Failed(reason),
    };
    let tests = root().join("python").join("tests");
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--no-deps", "--force-reinstall"]).arg(&wheel);
    let mut test = Command::new(&python);
    test.args(["-m", "unittest", "discover", "--start-directory"]).arg(&tests).current_dir(&folder);
    test.env("TUMBLE_PROGRAM", &program);
    let mut commands = vec![install, test];
    commands.push(cargo("fmt --check --manifest-path python/Cargo.toml"));
    if profile == Profile::Release {
        let mut measure = Command::new(&python);
        measure.arg(root().join("python").join("measure.py")).arg(&program).arg(&wheel).current_dir(&folder);
        let mut clippy = cargo("clippy --quiet --manifest-path python/Cargo.toml --target-dir");
        clippy.arg(&folder).args(["--", "-D", "warnings"]).env("PYO3_PYTHON", &python);
        commands.extend([measure, clippy]);
    }
    shell(&mut commands)
}

/// The command line to compare with.
fn program(profile: Profile) -> Result<PathBuf, String> {
    let folder = match profile {
        Profile::Test => programs_as_tested()?,
        Profile::Release => {
            let mut build = cargo("build --quiet --release --package tumble");
            println!("$ {}", line(&build));
            if !build.status().is_ok_and(|status| status.success()) {
                return Err("`tumble` does not build".into());
            }
            target_dir().join("release")
        }
    };
    Ok(folder.join("tumble").with_extension(std::env::consts::EXE_EXTENSION))
}

/// The interpreter of a virtual environment that has what the build needs.
fn environment(place: &Path) -> Result<PathBuf, String> {
    let python =
        if cfg!(windows) { place.join("Scripts").join("python.exe") } else { place.join("bin").join("python") };
    let mut ready = Command::new(&python);
    ready.args(["-c", "import maturin, matplotlib, numpy"]);
    if is_done(&mut ready) {
        return Ok(python);
    }
    let mut make = Command::new("python3");
    make.args(["-m", "venv", "--clear"]).arg(place);
    if !is_done(&mut make) {
        return Err("no python3 with venv and pip is at hand".into());
    }
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--retries", "1"]).args(PACKAGES);
    if !is_done(&mut install) {
        return Err(format!("{} cannot be installed by pip; is there a network?", PACKAGES.join(", ")));
    }
    Ok(python)
}

/// Whether a program could be started and was content; what it says is not of interest.
fn is_done(command: &mut Command) -> bool {
    command.output().is_ok_and(|output| output.status.success())
}

/// Builds the wheel; the only one of its folder.
fn wheel(profile: Profile, python: &Path, folder: &Path) -> Result<PathBuf, String> {
    let wheels = folder.join("wheels");
    if wheels.exists() {
        std::fs::remove_dir_all(&wheels).map_err(|error| format!("{}: {error}", wheels.display()))?;
    }
    let mut build = Command::new(python);
    build.args(["-m", "maturin", "build", "--quiet", "--locked", "--interpreter"]).arg(python);
    build.arg("--manifest-path").arg(root().join("python").join("Cargo.toml")).arg("--out").arg(&wheels);
    build.env("CARGO_TARGET_DIR", folder);
    if profile == Profile::Release {
        build.arg("--release");
    }
    println!("$ {}", line(&build));
    if !build.status().is_ok_and(|status| status.success()) {
        return Err("the wheel does not build".into());
    }
    let built = std::fs::read_dir(&wheels).into_iter().flatten().flatten().map(|entry| entry.path());
    built.into_iter().find(|path| path.extension().is_some_and(|kind| kind == "whl")).ok_or("there is no wheel".into())
}
