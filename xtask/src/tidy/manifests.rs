//! Rules about manifests and what cargo resolves from them.

use toml::{Table, Value};

use super::Tree;

/// The only order in which one Tumble crate may use another; those of one floor do not know each other.
const ORDER: &[(&str, usize)] = &[
    ("tumble-lie", 0),
    ("tumble-dynamics", 1),
    ("tumble-identification", 2),
    ("tumble-planning", 3),
    ("tumble-astrobee", 4),
    ("tumble-formats", 4),
    ("tumble", 5),
];

const KINDS: &[&str] = &["dependencies", "dev-dependencies", "build-dependencies"];

pub struct Manifest<'a> {
    pub path: &'a str,
    /// The folder of the package, with a final `/`.
    pub folder: &'a str,
    pub name: String,
    pub is_published: bool,
    table: Table,
}

impl Manifest<'_> {
    /// Every dependency with its kind, those for one platform included.
    fn dependencies(&self) -> Vec<(&'static str, &str, &Value)> {
        let platforms = self.table.get("target").and_then(Value::as_table).into_iter().flat_map(Table::values);
        let holders = std::iter::once(&self.table).chain(platforms.filter_map(Value::as_table));
        let mut all = Vec::new();
        for holder in holders {
            for kind in KINDS {
                for (name, value) in holder.get(*kind).and_then(Value::as_table).into_iter().flatten() {
                    all.push((*kind, name.as_str(), value));
                }
            }
        }
        all
    }
}

/// The packages of the workspace; unreadable manifests are reported by [`arrows`].
pub fn manifests(tree: &Tree) -> Vec<Manifest<'_>> {
    tree.under("", "/Cargo.toml")
        .filter_map(|(path, text)| {
            let table: Table = text.parse().ok()?;
            let package = table.get("package")?;
            // a package that is its own workspace, like the fuzz targets, is none of this one's
            let is_alone =
                table.contains_key("workspace") && package.get("publish").and_then(Value::as_bool) == Some(false);
            if is_alone {
                return None;
            }
            Some(Manifest {
                path,
                folder: path.trim_end_matches("Cargo.toml"),
                name: package.get("name")?.as_str()?.to_owned(),
                is_published: package.get("publish").and_then(Value::as_bool).unwrap_or(true),
                table,
            })
        })
        .collect()
}

/// `lie <- dynamics <- identification <- planning <- {astrobee, formats} <- tumble`, and xtask depends on none.
pub fn arrows(tree: &Tree) -> Vec<String> {
    let mut found = Vec::new();
    for (path, text) in tree.under("", "Cargo.toml") {
        if let Err(error) = text.parse::<Table>() {
            found.push(format!("{path}: {error}"));
        }
    }
    for manifest in manifests(tree) {
        let place = |name: &str| ORDER.iter().find(|(known, _)| *known == name).map(|(_, floor)| *floor);
        match place(&manifest.name) {
            Some(own) => {
                for (kind, name, value) in manifest.dependencies() {
                    let is_local = name.starts_with("tumble") || value.get("path").is_some();
                    let allowed = match place(name) {
                        Some(other) => other < own || (name == manifest.name && kind == "dev-dependencies"),
                        None => !is_local || kind == "dev-dependencies",
                    };
                    if !allowed {
                        found.push(format!("{}: {} may not depend on {name}", manifest.path, manifest.name));
                    }
                }
            }
            None if manifest.is_published => {
                found.push(format!("{}: {} has no place in the order of crates", manifest.path, manifest.name));
            }
            None => {}
        }
        if manifest.name == "xtask" {
            for (_, name, _) in manifest.dependencies().into_iter().filter(|(_, name, _)| name.starts_with("tumble")) {
                found.push(format!("{}: xtask builds {name}", manifest.path));
            }
        }
    }
    found
}

/// Versions stand in `[workspace.dependencies]`, lints in `[workspace.lints]`.
pub fn inherited(tree: &Tree) -> Vec<String> {
    let mut found = Vec::new();
    for manifest in manifests(tree) {
        for (_, name, value) in manifest.dependencies() {
            if value.get("workspace").is_none() && value.get("path").is_none() {
                found.push(format!("{}: the version of {name} belongs in [workspace.dependencies]", manifest.path));
            }
        }
        let lints = manifest.table.get("lints").and_then(|lints| lints.get("workspace")).and_then(Value::as_bool);
        if lints != Some(true) {
            found.push(format!("{}: wants `[lints] workspace = true`", manifest.path));
        }
    }
    found
}

/// Neither the default build nor the tests compile C or link a system library.
pub fn only_rust(tree: &Tree) -> Vec<String> {
    const BUILDERS: &[&str] = &["cc", "cmake", "pkg-config", "bindgen", "vcpkg", "autotools"];
    /// Crates called `-sys` that are Rust: declarations of an operating system, or a library written anew.
    const IN_RUST: &[&str] =
        &["windows-sys", "linux-raw-sys", "js-sys", "web-sys", "core-foundation-sys", "libbz2-rs-sys"];
    let mut found = Vec::new();
    for (build, lines) in [("default build", &tree.default_build), ("test build", &tree.test_build)] {
        for name in lines.lines().filter_map(|line| line.split_whitespace().next()) {
            if BUILDERS.contains(&name) || (name.ends_with("-sys") && !IN_RUST.contains(&name)) {
                found.push(format!("the {build} uses {name}"));
            }
        }
    }
    found.sort();
    found.dedup();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn package(name: &str, rest: &str) -> String {
        format!("[package]\nname = \"{name}\"\n{rest}\n[lints]\nworkspace = true\n")
    }

    #[test]
    fn an_arrow_the_wrong_way_is_seen() {
        let lie = package(
            "tumble-lie",
            "[dev-dependencies]\ntumble-dynamics.workspace = true\ntumble-lie = { path = \".\" }",
        );
        let dynamics = package("tumble-dynamics", "[dependencies]\ntumble-lie.workspace = true");
        let tree = Tree::planted(&[("crates/lie/Cargo.toml", &lie), ("crates/dynamics/Cargo.toml", &dynamics)]);
        assert_eq!(arrows(&tree), ["crates/lie/Cargo.toml: tumble-lie may not depend on tumble-dynamics"]);
    }

    #[test]
    fn an_arrow_for_one_platform_is_seen() {
        let lie = package("tumble-lie", "[target.'cfg(unix)'.dependencies]\ntumble-dynamics.workspace = true");
        assert_eq!(arrows(&Tree::planted(&[("crates/lie/Cargo.toml", &lie)])).len(), 1);
    }

    #[test]
    fn unpublished_crates_serve_tests_only() {
        let rest = |kind: &str| format!("[{kind}]\nshim = {{ path = \"../shim\" }}");
        let tree = |kind: &str| {
            Tree::planted(&[
                ("crates/lie/Cargo.toml", &package("tumble-lie", &rest(kind))),
                ("crates/shim/Cargo.toml", &package("shim", "publish = false")),
            ])
        };
        assert!(arrows(&tree("dev-dependencies")).is_empty());
        assert_eq!(arrows(&tree("dependencies")).len(), 1);
    }

    #[test]
    fn a_crate_outside_the_order_is_seen() {
        let tree = Tree::planted(&[("crates/extra/Cargo.toml", &package("tumble-extra", ""))]);
        assert_eq!(arrows(&tree).len(), 1);
    }

    #[test]
    fn an_unreadable_manifest_is_seen() {
        assert_eq!(arrows(&Tree::planted(&[("Cargo.toml", "[package")])).len(), 1);
    }

    #[test]
    fn the_robot_and_its_files_do_not_know_each_other() {
        let formats = package("tumble-formats", "[dependencies]\ntumble-astrobee.workspace = true");
        assert_eq!(arrows(&Tree::planted(&[("crates/formats/Cargo.toml", &formats)])).len(), 1);
        let tumble =
            package("tumble", "[dependencies]\ntumble-astrobee.workspace = true\ntumble-formats.workspace = true");
        assert!(arrows(&Tree::planted(&[("crates/tumble/Cargo.toml", &tumble)])).is_empty());
        let astrobee = package("tumble-astrobee", "[dependencies]\ntumble.workspace = true");
        assert_eq!(arrows(&Tree::planted(&[("crates/astrobee/Cargo.toml", &astrobee)])).len(), 1);
    }

    #[test]
    fn xtask_without_tumble_crates() {
        let rest = "publish = false\n[dependencies]\ntumble-lie.workspace = true";
        assert_eq!(arrows(&Tree::planted(&[("xtask/Cargo.toml", &package("xtask", rest))])).len(), 1);
    }

    #[test]
    fn only_an_unpublished_package_can_be_a_workspace_of_its_own() {
        let package =
            |more: &str| format!("[package]\nname = \"fuzz\"\n{more}\n[workspace]\n[dependencies]\nlibm = \"0.2\"\n");
        let found = |more: &str| inherited(&Tree::planted(&[("fuzz/Cargo.toml", &package(more))])).len();
        assert_eq!((found("publish = false"), found("")), (0, 2));
    }

    #[test]
    fn own_versions_and_own_lints_are_seen() {
        let tree = Tree::planted(&[(
            "crates/lie/Cargo.toml",
            "[package]\nname = \"tumble-lie\"\n[dependencies]\nlibm = \"0.2\"\ncsv.workspace = true\n",
        )]);
        let found = inherited(&tree);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].contains("libm") && found[1].contains("lints"));
    }

    #[test]
    fn c_in_the_tree_is_seen() {
        let clean = "tumble-lie v0.1.0\nwindows-sys v0.61.2\nlibm v0.2.16 (*)\n";
        let mut tree = Tree { default_build: clean.into(), test_build: clean.into(), ..Tree::default() };
        assert!(only_rust(&tree).is_empty());
        tree.default_build.push_str("cmake v0.1.50\nopenblas-sys v0.1.0\n");
        tree.test_build.push_str("cc v1.2.0\ncc v1.2.0 (*)\n");
        assert_eq!(
            only_rust(&tree),
            ["the default build uses cmake", "the default build uses openblas-sys", "the test build uses cc"]
        );
    }
}
