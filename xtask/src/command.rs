//! Programs that xtask starts.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// How a step ended.
pub enum Outcome {
    Ok,
    Failed(String),
    Skipped(String),
}

/// The root of the checkout.
pub fn root() -> PathBuf {
    // The parent of this package's folder; the fallback is where `cargo xtask` is normally run.
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().map_or_else(|| PathBuf::from("."), Path::to_path_buf)
}

/// Where cargo puts what it builds.
pub fn target_dir() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

/// `cargo <arguments>` at the root of the checkout; arguments are separated by spaces.
pub fn cargo(arguments: &str) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root()).args(arguments.split_whitespace());
    command
}

/// Whether a program (with its first argument) can be started.
pub fn is_installed(program: &str, argument: &str) -> bool {
    Command::new(program).arg(argument).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// The `studies` program, optimised, ready for its own arguments; it runs where xtask was started, so that relative paths mean
/// what they say. `bench` is built as criterion's benchmarks are, and for this machine's processor, in a folder of its own so
/// that the two builds do not evict each other.
pub fn studies(name: &str) -> Command {
    let profile = if name == "bench" { "bench" } else { "release" };
    let mut command = cargo("run --quiet --package studies --profile");
    command.arg(profile);
    command.arg("--manifest-path").arg(root().join("Cargo.toml"));
    if let Ok(folder) = std::env::current_dir() {
        command.current_dir(folder);
    }
    if name == "bench" {
        let flags = std::env::var("RUSTFLAGS").unwrap_or_default();
        command.env("RUSTFLAGS", format!("{flags} -C target-cpu=native"));
        command.arg("--target-dir").arg(target_dir().join("native"));
    }
    command.arg("--");
    command
}

/// Names the folder of `programs_as_tested` where they are built already: asking cargo would wait for other builds.
pub const PROGRAMS: &str = "TUMBLE_PROGRAMS";

/// The folder of `tumble`, `studies` and the examples as `cargo test --workspace` builds what they calculate with: nearly as fast, and
/// nothing is compiled again, because examples ask for the same features as tests.
pub fn programs_as_tested() -> Result<PathBuf, String> {
    if let Some(folder) = std::env::var_os(PROGRAMS) {
        return Ok(PathBuf::from(folder));
    }
    let built = cargo("build --quiet --workspace --examples --bin tumble --bin studies").status();
    if !built.is_ok_and(|status| status.success()) {
        return Err("the examples, `tumble` and `studies` do not build".into());
    }
    Ok(target_dir().join("debug"))
}

/// Runs a command and hands its exit code on.
pub fn forward(mut command: Command) -> ExitCode {
    match command.status() {
        Ok(status) => ExitCode::from(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)),
        Err(error) => {
            eprintln!("cannot start {}: {error}", line(&command));
            ExitCode::FAILURE
        }
    }
}

/// The command as one would type it, without the variables cargo sets for its own use.
pub fn line(command: &Command) -> String {
    let mut words: Vec<String> = command
        .get_envs()
        .filter_map(|(name, value)| Some(format!("{}='{}'", name.to_str()?, value?.to_str()?.trim())))
        .collect();
    let program = Path::new(command.get_program());
    words.push(program.file_stem().unwrap_or(command.get_program()).to_string_lossy().into_owned());
    words.extend(command.get_args().map(|word| {
        let word = word.to_string_lossy();
        if word.contains(' ') { format!("'{word}'") } else { word.into_owned() }
    }));
    words.join(" ")
}

/// Runs all commands, also after one failed.
pub fn shell(commands: &mut [Command]) -> Outcome {
    let mut failed = Vec::new();
    for command in commands {
        println!("$ {}", line(command));
        if !command.status().is_ok_and(|status| status.success()) {
            failed.push(line(command));
        }
    }
    if failed.is_empty() { Outcome::Ok } else { Outcome::Failed(failed.join("; ")) }
}

/// Runs all commands at once, and prints what each of them says when it has ended.
pub fn shell_together(commands: &mut [Command]) -> Outcome {
    let run = |command: &mut Command| (line(command), command.output());
    let ended: Vec<_> = std::thread::scope(|scope| {
        let running: Vec<_> = commands.iter_mut().map(|command| scope.spawn(move || run(command))).collect();
        running.into_iter().filter_map(|one| one.join().ok()).collect()
    });
    let mut failed = Vec::new();
    for (line, output) in &ended {
        println!("$ {line}");
        let is_done = output.as_ref().is_ok_and(|output| {
            print!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
            output.status.success()
        });
        if !is_done {
            failed.push(line.as_str());
        }
    }
    if failed.is_empty() && ended.len() == commands.len() { Outcome::Ok } else { Outcome::Failed(failed.join("; ")) }
}
