//! Rules about Rust source.

use super::Tree;
use super::manifests::manifests;
use super::prose::FILES;

/// The code of a source file: comments, strings and characters are blanked, lines keep their numbers.
pub fn code(source: &str) -> String {
    let mut out = String::with_capacity(source.len());
    let mut rest = source;
    let mut in_word = false;
    while let Some(first) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            block_comment(rest)
        } else if first == '"' {
            quoted(rest, '"')
        } else if first == '\'' {
            // A lifetime has no closing quote two characters on.
            let mut ahead = rest.chars().skip(1);
            let is_character = matches!((ahead.next(), ahead.next()), (Some('\\'), _) | (Some(_), Some('\'')));
            if is_character { quoted(rest, '\'') } else { 0 }
        } else if !in_word {
            raw_string(rest)
        } else {
            0
        };
        if length == 0 {
            out.push(first);
            in_word = first.is_alphanumeric() || first == '_';
            rest = &rest[first.len_utf8()..];
        } else {
            out.extend(rest[..length].chars().filter(|c| *c == '\n'));
            out.push(' ');
            in_word = false;
            rest = &rest[length..];
        }
    }
    out
}

fn block_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < text.len() {
        let here = &text.as_bytes()[at..];
        if here.starts_with(b"/*") {
            depth += 1;
            at += 2;
        } else if here.starts_with(b"*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                return at;
            }
        } else {
            at += 1;
        }
    }
    text.len()
}

fn quoted(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        if escaped {
            escaped = false;
        } else if c == '\\' {
            escaped = true;
        } else if c == quote {
            return at + 1;
        }
    }
    text.len()
}

/// The length of `r"..."`, `r#"..."#`, `br"..."`; zero where none begins.
fn raw_string(text: &str) -> usize {
    let body = text.strip_prefix('b').unwrap_or(text);
    let Some(body) = body.strip_prefix('r') else { return 0 };
    let opened = body.trim_start_matches('#');
    let hashes = body.len() - opened.len();
    let Some(inside) = opened.strip_prefix('"') else { return 0 };
    let end = format!("\"{}", "#".repeat(hashes));
    let start = text.len() - inside.len();
    inside.find(&end).map_or(text.len(), |at| start + at + end.len())
}

/// What each published library says at its top.
pub fn attributes(tree: &Tree) -> Vec<String> {
    const NO_STD: &[&str] = &["tumble-lie", "tumble-dynamics", "tumble-identification"];
    let mut found = Vec::new();
    for manifest in manifests(tree).iter().filter(|manifest| manifest.is_published) {
        let path = format!("{}src/lib.rs", manifest.folder);
        let text: String = code(tree.text(&path).unwrap_or_default()).split_whitespace().collect();
        if !text.contains("#![forbid(unsafe_code)]") {
            found.push(format!("{path}: wants #![forbid(unsafe_code)]"));
        }
        // The string inside the attribute is blanked.
        if NO_STD.contains(&manifest.name.as_str()) && !text.contains("#![cfg_attr(not(feature=),no_std)]") {
            found.push(format!("{path}: wants #![cfg_attr(not(feature = \"std\"), no_std)]"));
        }
    }
    found
}

/// Nothing unfinished, switched off or left over from debugging.
pub fn unfinished(tree: &Tree) -> Vec<String> {
    const BANNED: &[&str] = &["todo!", "unimplemented!", "dbg!", "#[ignore"];
    search(tree, "", |line| {
        BANNED.iter().find(|banned| line.contains(**banned)).map(|banned| format!("holds {banned}"))
    })
}

/// Library code that switches a lint against panics off says why.
pub fn reasons(tree: &Tree) -> Vec<String> {
    const LINTS: &[&str] =
        &["unwrap_used", "expect_used", "clippy::panic", "unreachable", "indexing_slicing", "disallowed_methods"];
    let mut found = Vec::new();
    for (path, text) in tree.under("crates/", ".rs").filter(|(path, _)| path.contains("/src/")) {
        let library = text.split("#[cfg(test)]").next().unwrap_or_default();
        for (at, _) in library.match_indices("allow(").chain(library.match_indices("expect(")) {
            let inside = library[at..].split(']').next().unwrap_or_default();
            let is_attribute = library[..at].trim_end().ends_with(['[', ',']);
            if is_attribute && LINTS.iter().any(|lint| inside.contains(lint)) && !inside.contains("reason") {
                found.push(format!("{path}:{}: allows a lint without a reason", library[..at].lines().count()));
            }
        }
    }
    found
}

/// A public trait: where it is, its name, and its documentation from the last line up.
struct PublicTrait<'a> {
    place: String,
    name: &'a str,
    docs: Vec<&'a str>,
}

fn public_traits(tree: &Tree) -> Vec<PublicTrait<'_>> {
    let mut all = Vec::new();
    for (path, text) in tree.under("crates/", ".rs").filter(|(path, _)| path.contains("/src/")) {
        let lines: Vec<&str> = text.lines().map(str::trim_start).collect();
        for (at, line) in lines.iter().enumerate() {
            let Some(name) = line.strip_prefix("pub trait ") else { continue };
            let above = lines[..at].iter().rev().take_while(|line| line.starts_with("///") || line.starts_with("#["));
            let name = name.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default();
            all.push(PublicTrait { place: format!("{path}:{}", at + 1), name, docs: above.copied().collect() });
        }
    }
    all
}

/// Every public trait shows in an example how it is implemented or used.
pub fn trait_examples(tree: &Tree) -> Vec<String> {
    let mut found = Vec::new();
    for PublicTrait { place, name, docs } in public_traits(tree) {
        // From below: the code of the example comes before its heading.
        let heading = docs.iter().position(|line| *line == "/// # Example");
        if !heading.is_some_and(|at| docs[..at].contains(&"/// ```")) {
            found.push(format!("{place}: the trait {name} has no `# Example` with code"));
        }
    }
    found
}

/// Every public trait links a file of the repository that implements it as a user would.
pub fn trait_tutorials(tree: &Tree) -> Vec<String> {
    let mut found = Vec::new();
    for PublicTrait { place, name, docs } in public_traits(tree) {
        // A link may stand on two lines.
        let words = docs.iter().rev().flat_map(|line| line.trim_start_matches("///").split_whitespace());
        let text = words.collect::<Vec<_>>().join(" ");
        let target = text.split_once("Tutorial: [").and_then(|(_, link)| {
            let (_, target) = link.split_once(&format!("]({FILES}"))?;
            target.split_once(')').map(|(path, _)| path)
        });
        match target {
            None => found.push(format!("{place}: the trait {name} has no `Tutorial: [..]({FILES}..)`")),
            Some(path) if !tree.files.contains_key(path) => {
                found.push(format!("{place}: the tutorial of {name}, {path}, is not there"));
            }
            Some(_) => (),
        }
    }
    found
}

/// nalgebra's singular value decomposition with vectors is wrong on ordinary inputs; its methods take arguments, faer's take none.
pub fn singular_values(tree: &Tree) -> Vec<String> {
    const BANNED: &[&str] = &[".svd(", ".svd_unordered(", ".try_svd(", ".try_svd_unordered(", ".pseudo_inverse("];
    search(tree, "", |line| {
        let method = BANNED.iter().find(|banned| {
            line.match_indices(**banned).any(|(at, _)| !line[at + banned.len()..].trim_start().starts_with(')'))
        })?;
        Some(format!("calls {method}..): use symmetric_eigen or faer"))
    })
}

/// Only one crate knows a robot by name.
pub fn robot_name(tree: &Tree) -> Vec<String> {
    let mut found = Vec::new();
    for library in ["lie", "dynamics", "identification", "planning"] {
        for (path, text) in tree.under(&format!("crates/{library}/"), ".rs") {
            for (number, line) in (1..).zip(text.lines()) {
                if line.to_lowercase().contains("astrobee") {
                    found.push(format!("{path}:{number}: names a robot"));
                }
            }
        }
    }
    found
}

/// Applies a search to every line of code.
fn search(tree: &Tree, folder: &str, complaint: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let mut found = Vec::new();
    for (path, text) in tree.under(folder, ".rs") {
        for (number, line) in (1..).zip(code(text).lines()) {
            if let Some(complaint) = complaint(line) {
                found.push(format!("{path}:{number}: {complaint}"));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_code_is_left() {
        let source = "a // dbg!\n/* b /* c */ dbg! */ d \"dbg!\\\" dbg!\" 'x' '\\'' &'a str r#\"dbg! \"\n dbg!\"# e";
        let left = code(source);
        assert!(!left.contains("dbg!"), "{left}");
        assert_eq!(left.split_whitespace().collect::<Vec<_>>(), ["a", "d", "&'a", "str", "e"]);
        assert_eq!(left.lines().count(), source.lines().count());
        assert_eq!(code("for_r\"x\""), "for_r ");
        assert_eq!(code("dbg!(1)"), "dbg!(1)");
    }

    const MANIFEST: (&str, &str) = ("crates/lie/Cargo.toml", "[package]\nname = \"tumble-lie\"\n");
    const TOP: &str = "#![cfg_attr(not(feature = \"std\"), no_std)]\n#![forbid(unsafe_code)]\n";

    #[test]
    fn missing_attributes_are_seen() {
        let check = |top: &str| attributes(&Tree::planted(&[MANIFEST, ("crates/lie/src/lib.rs", top)])).len();
        assert_eq!(check(TOP), 0);
        for line in TOP.lines() {
            assert_eq!(check(&TOP.replace(line, &format!("// {line}"))), 1, "{line}");
        }
        assert_eq!(attributes(&Tree::planted(&[MANIFEST])).len(), 2, "a library without lib.rs");
    }

    #[test]
    fn unfinished_code_is_seen() {
        for planted in ["todo!()", "unimplemented!()", "dbg!(x)", "#[ignore]", "#[ignore = \"slow\"]"] {
            let tree = Tree::planted(&[("crates/lie/tests/laws.rs", &format!("// todo!\nfn f() {{\n{planted}\n}}"))]);
            let found = unfinished(&tree);
            assert_eq!(found.len(), 1, "{planted}");
            assert!(found[0].starts_with("crates/lie/tests/laws.rs:3:"), "{}", found[0]);
        }
    }

    #[test]
    fn exceptions_without_a_reason_are_seen() {
        let check = |text: &str| reasons(&Tree::planted(&[("crates/lie/src/so3.rs", text)])).len();
        assert_eq!(check("#[allow(clippy::unwrap_used)]\nfn f() {}"), 1);
        assert_eq!(check("#![cfg_attr(test, allow(clippy::unwrap_used))]"), 1);
        assert_eq!(check("#[expect(clippy::indexing_slicing)]\nfn f() {}"), 1);
        assert_eq!(check("#[allow(clippy::unwrap_used, reason = \"the index is below N\")]\nfn f() {}"), 0);
        assert_eq!(check("#[cfg(test)]\nmod tests {\n#![allow(clippy::unwrap_used)]\n}"), 0);
        assert_eq!(check("#[allow(clippy::needless_pass_by_value)]\nfn f() {}"), 0);
    }

    #[test]
    fn a_trait_without_an_example_is_seen() {
        let check = |text: &str| trait_examples(&Tree::planted(&[("crates/lie/src/group.rs", text)]));
        let shown = "/// A group.\n///\n/// # Example\n/// ```\n/// f();\n/// ```\n#[cfg(feature = \"std\")]\npub trait Group<T>: Sized {}\n";
        assert!(check(shown).is_empty());
        let complaint = ["crates/lie/src/group.rs:8: the trait Group has no `# Example` with code"];
        assert_eq!(check(&shown.replace("# Example", "# Frame")), complaint);
        assert_eq!(check(&shown.replace("/// ```", "/// ")), complaint, "a heading without code");
        assert_eq!(check("/// A group.\npub trait Group {}\n").len(), 1);
        // The example of what stands before it is not its own.
        assert_eq!(check(&shown.replace("#[cfg", "pub struct S;\n#[cfg")).len(), 1);
        assert!(check(&shown.replace("pub trait", "pub(crate) trait").replace("# Example", "")).is_empty());
    }

    #[test]
    fn a_trait_without_a_tutorial_is_seen() {
        let tutorial = ("crates/lie/tests/suite/custom_group.rs", "");
        let check = |text: &str| trait_tutorials(&Tree::planted(&[tutorial, ("crates/lie/src/group.rs", text)]));
        let link = format!("/// Laws: none. Tutorial: [a group of your\n/// own]({FILES}{}).\n", tutorial.0);
        let shown = format!("/// A group.\n{link}#[cfg(feature = \"std\")]\npub trait Group<T>: Sized {{}}\n");
        assert_eq!(check(&shown), [""; 0]);
        let missing = format!("crates/lie/src/group.rs:5: the trait Group has no `Tutorial: [..]({FILES}..)`");
        assert_eq!(check(&shown.replace("Tutorial: ", "See ")), [missing.as_str()]);
        assert_eq!(check(&shown.replace(FILES, "https://example.org/")), [missing]);
        let elsewhere =
            "crates/lie/src/group.rs:5: the tutorial of Group, crates/lie/tests/custom_group.rs, is not there";
        assert_eq!(check(&shown.replace("tests/suite", "tests")), [elsewhere]);
        // That of what stands before it is not its own.
        assert_eq!(check(&shown.replace("#[cfg", "pub struct S;\n#[cfg")).len(), 1);
        assert!(check(&shown.replace("pub trait", "pub(crate) trait").replace("Tutorial: ", "")).is_empty());
    }

    #[test]
    fn the_banned_decomposition_is_seen() {
        let check = |text: &str| singular_values(&Tree::planted(&[("crates/lie/src/so3.rs", text)])).len();
        assert_eq!(check("let s = matrix.svd(true, true);"), 1);
        assert_eq!(check("let s = matrix.pseudo_inverse(1e-9);"), 1);
        assert_eq!(check("let s = matrix.svd();"), 0);
        assert_eq!(check("// matrix.svd(true, true)"), 0);
    }

    #[test]
    fn a_robot_in_a_library_is_seen() {
        let planted = ("crates/dynamics/src/inertia.rs", "/// As on the Astrobee.\n");
        let allowed = ("crates/astrobee/src/lib.rs", "//! Astrobee\n");
        assert_eq!(
            robot_name(&Tree::planted(&[planted, allowed])),
            ["crates/dynamics/src/inertia.rs:1: names a robot"]
        );
    }
}
