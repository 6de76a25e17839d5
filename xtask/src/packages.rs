//! `cargo xtask ci --only packages`: what would be published, unpacked and used as a stranger would.
//!
//! The packages lie side by side in a workspace of their own in which each stands for its namesake of the registry, so that they
//! find one another before the first of them is published.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::{Outcome, cargo, root, shell, target_dir};

/// A package that would be published.
struct Package {
    name: String,
    /// `name-version`.
    folder: String,
    /// Features that its tests ask for, as `name/feature`.
    of_tests: Vec<String>,
}

/// Type-checks library, tests, examples and benches of every unpacked package, with the laws and without.
pub fn check() -> Outcome {
    with_unpacked(|place, packages| {
        shell(&mut [
            unpacked(place, "check --quiet --workspace --lib --profile test"),
            unpacked(place, &format!("check --quiet --workspace --all-targets --features {}", features(packages))),
        ])
    })
}

/// Runs the tests of every unpacked package.
pub fn test() -> Outcome {
    with_unpacked(|place, packages| {
        shell(&mut [unpacked(place, &format!("test --quiet --workspace --features {}", features(packages)))])
    })
}

/// Compares the public interface with the newest one that was published.
pub fn semver() -> Outcome {
    if !crate::command::is_installed("cargo", "semver-checks") {
        return Outcome::Skipped("cargo-semver-checks is not installed".into());
    }
    let published = cargo("info --quiet tumble-lie --registry crates-io").output();
    if !published.is_ok_and(|answer| answer.status.success()) {
        return Outcome::Skipped("the registry cannot be reached, or holds nothing to compare with yet".into());
    }
    shell(&mut [cargo("semver-checks --workspace")])
}

fn with_unpacked(work: impl FnOnce(&Path, &[Package]) -> Outcome) -> Outcome {
    let packed = shell(&mut [cargo("package --workspace --no-verify --allow-dirty --quiet")]);
    if let Outcome::Failed(_) = packed {
        return packed;
    }
    let place = target_dir().join("unpacked");
    match unpack(&place) {
        Ok(packages) => work(&place, &packages),
        Err(reason) => Outcome::Failed(reason),
    }
}

/// A command in the workspace of the unpacked packages, which shares what is built of the registry's crates.
fn unpacked(place: &Path, arguments: &str) -> Command {
    let mut command = cargo(arguments);
    command.current_dir(place).env("CARGO_TARGET_DIR", target_dir());
    command
}

/// What the tests of all of them ask for.
fn features(packages: &[Package]) -> String {
    let all: Vec<&str> = packages.iter().flat_map(|package| &package.of_tests).map(String::as_str).collect();
    all.join(",")
}

/// Unpacks what would be published into a workspace of its own, with the checkout's lock file.
fn unpack(place: &Path) -> Result<Vec<Package>, String> {
    let said = |error: &dyn std::fmt::Display| error.to_string();
    if place.exists() {
        std::fs::remove_dir_all(place).map_err(|error| said(&error))?;
    }
    std::fs::create_dir_all(place).map_err(|error| said(&error))?;
    let mut packages = Vec::new();
    for folder in published(&root())? {
        let package = package(&folder)?;
        let file = target_dir().join("package").join(format!("{}.crate", package.folder));
        let mut tar = Command::new("tar");
        tar.arg("-xzf").arg(&file).arg("-C").arg(place);
        if !tar.status().is_ok_and(|status| status.success()) {
            return Err(format!("cannot unpack {}", file.display()));
        }
        for licence in ["LICENSE-MIT", "LICENSE-APACHE"] {
            let read = |folder: &Path| std::fs::read_to_string(folder.join(licence)).unwrap_or_default();
            if read(&place.join(&package.folder)) != read(&root()) {
                return Err(format!("{} does not hold the text of {licence}", package.name));
            }
        }
        packages.push(package);
    }
    let mut manifest = "[workspace]\nresolver = \"3\"\nmembers = [".to_owned();
    for package in &packages {
        let _ = write!(manifest, "\"{}\", ", package.folder);
    }
    manifest += "]\n\n[patch.crates-io]\n";
    for package in &packages {
        let _ = writeln!(manifest, "{} = {{ path = \"{}\" }}", package.name, package.folder);
    }
    // The profile is part of what a built crate is known by: the same one, the same crates.
    let workspace: toml::Table = read(&root().join("Cargo.toml"))?;
    if let Some(profiles) = workspace.get("profile") {
        let profiles: toml::Table = [("profile".to_owned(), profiles.clone())].into_iter().collect();
        let _ = write!(manifest, "\n{profiles}");
    }
    std::fs::write(place.join("Cargo.toml"), manifest).map_err(|error| said(&error))?;
    std::fs::copy(root().join("Cargo.lock"), place.join("Cargo.lock")).map_err(|error| said(&error))?;
    Ok(packages)
}

fn read(path: &Path) -> Result<toml::Table, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    text.parse().map_err(|error| format!("{}: {error}", path.display()))
}

/// Folders of the members that may be published.
fn published(root: &Path) -> Result<Vec<PathBuf>, String> {
    let manifest = read(&root.join("Cargo.toml"))?;
    let members =
        manifest.get("workspace").and_then(|workspace| workspace.get("members")).and_then(toml::Value::as_array);
    let mut folders = Vec::new();
    for member in members.into_iter().flatten().filter_map(toml::Value::as_str) {
        let folder = root.join(member);
        let manifest = read(&folder.join("Cargo.toml"))?;
        let publish = manifest.get("package").and_then(|package| package.get("publish")).and_then(toml::Value::as_bool);
        if publish != Some(false) {
            folders.push(folder);
        }
    }
    Ok(folders)
}

fn package(folder: &Path) -> Result<Package, String> {
    let (manifest, workspace) = (read(&folder.join("Cargo.toml"))?, read(&root().join("Cargo.toml"))?);
    let text = |value: Option<&toml::Value>| value.and_then(toml::Value::as_str).map(str::to_owned);
    let name = text(manifest.get("package").and_then(|package| package.get("name"))).unwrap_or_default();
    let shared = workspace.get("workspace").and_then(|workspace| workspace.get("package"));
    let version = text(shared.and_then(|package| package.get("version"))).unwrap_or_default();
    // A package that depends on itself for its tests loses this line when it is packed.
    let itself = manifest.get("dev-dependencies").and_then(|all| all.get(&name)).and_then(|own| own.get("features"));
    let features = itself.and_then(toml::Value::as_array).into_iter().flatten().filter_map(toml::Value::as_str);
    let of_tests = features.map(|feature| format!("{name}/{feature}")).collect();
    Ok(Package { folder: format!("{name}-{version}"), name, of_tests })
}
