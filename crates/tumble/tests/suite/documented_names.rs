//! What can be asked for by name stands on the page that lists it, and nothing else does.

use crate::support::{scratch, stderr, tumble_in};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

type Names = BTreeSet<String>;

fn names<'a>(words: impl IntoIterator<Item = &'a str>) -> Names {
    words.into_iter().map(|word| word.trim().to_owned()).collect()
}

/// What the program knows, from what it says to a name that it does not know, between `before` and the end of the line or a
/// bracket.
fn known(folder: &Path, words: &[&str], before: &str) -> Names {
    let output = tumble_in(folder, words);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{words:?}: {text}");
    let (_, listed) = text.split_once(before).unwrap_or_else(|| panic!("{words:?}: {text}"));
    names(listed.split([']', '\n']).next().unwrap().split(", "))
}

/// The names in the rows of a page's tables that begin with `key`: what stands in backticks, or ends what stands there, in small letters, digits
/// and hyphens alone.
fn listed(page: &str, key: &str) -> Names {
    let is_name = |word: &&str| {
        word.starts_with(|c: char| c.is_ascii_lowercase())
            && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-')
    };
    let rows = page.lines().filter(|line| line.starts_with(&format!("| `{key}")));
    let spans = rows.flat_map(|row| row.split('`').skip(1).step_by(2)).filter(|span| *span != key);
    names(spans.filter_map(|span| span.split(' ').next_back()).filter(is_name))
}

/// Each name must also be missed where it is taken off its page.
#[test]
fn pages_list_the_names_that_can_be_asked_for() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    if !docs.exists() {
        println!("skipped: a published package has no pages");
        return;
    }
    let folder = scratch("documented-names");
    let asked = |command: &[&str]| known(&folder, &[command, &["no-such-name"]].concat(), "[possible values: ");
    let held = String::from_utf8(tumble_in(&folder, &["scenario", "show", "iss-hold"]).stdout).unwrap();
    let unknown = held.replacen("controller = \"flown\"", "controller = \"no-such-name\"", 1);
    fs::write(folder.join("unknown.toml"), unknown).unwrap();
    let of_drives = known(&folder, &["simulate", "unknown.toml"], "known: ");
    // `auto` is told as what it chose, and one answer has a name that cannot be asked for.
    let mut methods = asked(&["identify", "--method"]);
    assert!(methods.remove("auto") && methods.insert(tumble_identification::WEAK_FORM.to_owned()));
    for (page, key, known) in [
        ("missions.md", "--estimator NAME", asked(&["fly", "--estimator"])),
        ("missions.md", "--planner NAME", asked(&["fly", "--planner"])),
        ("missions.md", "--local-planner NAME", asked(&["fly", "--local-planner"])),
        ("missions.md", "--controller NAME", asked(&["fly", "--controller"])),
        ("planning.md", "--planner", asked(&["plan", "iss-slalom", "--planner"])),
        ("scenarios.md", "controller", of_drives),
        ("identify-json.md", "method", methods),
    ] {
        let text = fs::read_to_string(docs.join(page)).unwrap();
        assert_eq!(listed(&text, key), known, "docs/{page}, `{key}`: on the page, and known to the program");
        for name in &known {
            let without = text.replace(&format!("{name}`"), "`");
            assert_ne!(listed(&without, key), known, "docs/{page}: {name}");
        }
    }
}
