//! Rules that hold the documents and the data files to the code.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::Tree;
use super::manifests::manifests;
use super::source::code;

/// Every README is included by a crate as documentation, so that its code is compiled and run.
pub fn readme_doctests(tree: &Tree) -> Vec<String> {
    let mut tested = BTreeSet::new();
    for (path, text) in tree.under("crates/", "src/lib.rs") {
        for (_, rest) in text.match_indices("include_str!(\"").map(|(at, start)| (at, &text[at + start.len()..])) {
            tested.insert(resolve(path, rest.split('"').next().unwrap_or_default()));
        }
    }
    let packages = manifests(tree);
    let published = packages.iter().filter(|manifest| manifest.is_published);
    let mut wanted: Vec<String> = published.map(|manifest| format!("{}README.md", manifest.folder)).collect();
    wanted.push("README.md".into());
    let mut found = Vec::new();
    for path in wanted {
        if !tree.files.contains_key(&path) {
            found.push(format!("{path} is missing"));
        } else if !tested.iter().any(|read| tree.text(read) == tree.text(&path)) {
            found.push(format!("{path}: no lib.rs says #![doc = include_str!(..)], so its code is not tested"));
        }
    }
    found
}

/// Sources and pages, by their ending.
fn is_prose(path: &str) -> bool {
    Path::new(path).extension().is_some_and(|kind| kind == "rs" || kind == "md")
}

/// Where the files of the repository are to be read.
pub const FILES: &str = "https://github.com/tumble-robotics/tumble/blob/main/";

/// Links from the documentation to files of the repository, which rustdoc cannot check.
pub fn repository_links(tree: &Tree) -> Vec<String> {
    let mut found = Vec::new();
    for (path, text) in tree.under("", "").filter(|(path, _)| is_prose(path)) {
        for (at, _) in text.match_indices(FILES) {
            let rest = &text[at + FILES.len()..];
            let is_path = |c: char| c.is_ascii_alphanumeric() || "/_.-".contains(c);
            let target = rest[..rest.find(|c| !is_path(c)).unwrap_or(rest.len())].trim_end_matches('.');
            if !target.is_empty() && !tree.files.contains_key(target) {
                found.push(format!("{path}: links to {target}, which is not there"));
            }
        }
    }
    found
}

/// A path relative to the folder of a file.
fn resolve(file: &str, relative: &str) -> String {
    let mut parts: Vec<&str> = file.split('/').collect();
    parts.pop();
    for part in relative.split('/') {
        if part == ".." {
            parts.pop();
        } else if part != "." {
            parts.push(part);
        }
    }
    parts.join("/")
}

/// `docs/equations.md` against the code, both ways.
pub fn equation_index(tree: &Tree) -> Vec<String> {
    const PAGE: &str = "docs/equations.md";
    let Some(page) = tree.text(PAGE) else { return vec![format!("{PAGE} is missing")] };
    let defined = definitions(tree);
    let mut found = Vec::new();
    let mut listed = BTreeSet::new();
    let rows = rows(page, ["equation", "item", "test"]);
    if rows.is_empty() {
        found.push(format!("{PAGE}: no table with the columns equation, item, test"));
    }
    for (number, [equation, item, test]) in rows {
        let place = format!("{PAGE}:{number}");
        let numbers = equations(equation);
        if numbers.is_empty() {
            found.push(format!("{place}: `{equation}` names no equation such as (5.18)"));
        }
        listed.extend(numbers);
        for (kind, cell) in [("item", item), ("test", test)] {
            let names = quoted_names(cell);
            if names.is_empty() {
                found.push(format!("{place}: names no {kind} in backticks"));
            }
            for name in names {
                if !exists(tree, &defined, kind == "test", name) {
                    found.push(format!("{place}: the {kind} `{name}` does not exist"));
                }
            }
        }
    }
    for (place, cited) in sources(tree) {
        for number in cited.difference(&listed) {
            found.push(format!("{place}: cites ({number}), which {PAGE} does not list"));
        }
    }
    found
}

/// What the code defines: name to "is it a test".
type Definitions = BTreeMap<String, bool>;

fn definitions(tree: &Tree) -> Definitions {
    const KEYWORDS: &[&str] =
        &["fn", "struct", "enum", "trait", "type", "const", "static", "mod", "macro_rules!", "union"];
    let mut all = Definitions::new();
    for (_, text) in tree.under("crates/", ".rs").chain(tree.under("xtask/", ".rs")) {
        let mut after_test = false;
        for line in code(text).lines() {
            after_test |= line.contains("#[test]");
            let words: Vec<&str> = line
                .split(|c: char| !(c.is_alphanumeric() || "_!".contains(c)))
                .filter(|word| !word.is_empty())
                .collect();
            for pair in words.windows(2).filter(|pair| KEYWORDS.contains(&pair[0]) && !KEYWORDS.contains(&pair[1])) {
                let is_function = pair[0] == "fn";
                *all.entry(pair[1].to_owned()).or_default() |= is_function && after_test;
                after_test &= !is_function;
            }
        }
    }
    all
}

/// Whether `a::Type::name`, `path/file.rs` or `path/file.rs::name` exists.
fn exists(tree: &Tree, defined: &Definitions, as_test: bool, name: &str) -> bool {
    let (file, path) = match name.find(".rs") {
        Some(at) => (Some(&name[..at + 3]), name[at + 3..].trim_start_matches("::")),
        None => (None, name),
    };
    let file_exists =
        file.is_none_or(|file| tree.files.keys().any(|path| path == file || path.ends_with(&format!("/{file}"))));
    let mut segments =
        path.split(['(', '<']).next().unwrap_or_default().rsplit("::").filter(|segment| !segment.is_empty());
    let last = match segments.next() {
        Some(last) => defined.get(last).is_some_and(|is_test| *is_test || !as_test),
        None => file.is_some() && !as_test,
    };
    let owner =
        segments.next().is_none_or(|owner| !owner.starts_with(char::is_uppercase) || defined.contains_key(owner));
    file_exists && last && owner
}

/// The names in backticks of a cell.
fn quoted_names(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).filter(|name| !name.is_empty()).collect()
}

/// The rows of every table that has these columns, with their line numbers.
fn rows<'a, const N: usize>(page: &'a str, columns: [&str; N]) -> Vec<(usize, [&'a str; N])> {
    let mut rows = Vec::new();
    let mut places: Option<[usize; N]> = None;
    for (number, line) in (1..).zip(page.lines()) {
        let line = line.trim();
        let Some(inside) = line.strip_prefix('|') else {
            places = None;
            continue;
        };
        let cells: Vec<&str> = inside.trim_end_matches('|').split('|').map(str::trim).collect();
        match places {
            None => {
                let found = columns.map(|column| {
                    cells.iter().position(|cell| cell.to_lowercase().split_whitespace().next() == Some(column))
                });
                if found.iter().all(Option::is_some) {
                    places = Some(found.map(Option::unwrap_or_default));
                }
            }
            Some(_) if cells.iter().all(|cell| cell.chars().all(|c| "-: ".contains(c))) => {}
            Some(places) => rows.push((number, places.map(|place| cells.get(place).copied().unwrap_or_default()))),
        }
    }
    rows
}

/// Equation numbers in parentheses: `(5.18)`, `(5.32, 5.33)`, `(5.13)-(5.15)`, `(A.1)`.
fn equations(text: &str) -> BTreeSet<String> {
    let mut numbers = BTreeSet::new();
    let mut last: Option<(String, u32, usize)> = None;
    let (mut depth, mut at) = (0_usize, 0);
    while let Some(c) = text[at..].chars().next() {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        let is_start = depth > 0
            && !text[..at].ends_with(|before: char| before.is_alphanumeric() || ".-_".contains(before))
            || depth > 0 && text[..at].ends_with('-') && last.as_ref().is_some_and(|(_, _, end)| end + 1 == at);
        if let Some((chapter, number, length)) = is_start.then(|| equation(&text[at..])).flatten() {
            if let Some((first_chapter, first, end)) = last.take() {
                let between = text[end..at].replace(['(', ')', ' '], "");
                if first_chapter == chapter && ["-", "–", "to"].contains(&between.as_str()) {
                    numbers.extend((first..number).map(|n| format!("{chapter}.{n}")));
                }
            }
            numbers.insert(format!("{chapter}.{number}"));
            at += length;
            last = Some((chapter, number, at));
        } else {
            at += c.len_utf8();
        }
    }
    numbers
}

/// Chapter, number and length of the equation number that begins here; a letter after it names a part.
fn equation(text: &str) -> Option<(String, u32, usize)> {
    let chapter = text.chars().next().filter(|c| c.is_ascii_digit() || ('A'..='D').contains(c))?;
    let digits: String = text.get(1..)?.strip_prefix('.')?.chars().take_while(char::is_ascii_digit).collect();
    let mut length = 2 + digits.len();
    if text[length..].starts_with(|c: char| c.is_ascii_lowercase()) {
        length += 1;
    }
    let ends = !text[length..].starts_with(|c: char| c.is_alphanumeric() || c == '.');
    Some((chapter.to_string(), digits.parse().ok().filter(|_| ends)?, length))
}

/// The equations each `# Source` section cites.
fn sources(tree: &Tree) -> Vec<(String, BTreeSet<String>)> {
    let mut all = Vec::new();
    for (path, text) in tree.under("crates/", ".rs") {
        let mut section: Option<(usize, String)> = None;
        for (number, line) in (1..).zip(text.lines().chain([""])) {
            let line = line.trim();
            let doc = line.strip_prefix("///").or_else(|| line.strip_prefix("//!")).map(str::trim);
            if let (Some((_, section)), Some(doc)) = (&mut section, doc.filter(|doc| !doc.starts_with("# "))) {
                section.push_str(doc);
                section.push(' ');
                continue;
            }
            if let Some((start, section)) = section.take() {
                all.push((format!("{path}:{start}"), equations(&section)));
            }
            if doc == Some("# Source") {
                section = Some((number, String::new()));
            }
        }
    }
    all
}

/// `T001` and the like: those of the errors of all crates are those in `docs/errors.md`.
pub fn error_codes(tree: &Tree) -> Vec<String> {
    const PAGE: &str = "docs/errors.md";
    let Some(page) = tree.text(PAGE) else { return vec![format!("{PAGE} is missing")] };
    let documented = codes(page);
    let used: BTreeSet<String> = tree.under("crates/", "src/error.rs").flat_map(|(_, text)| codes(text)).collect();
    let mut found: Vec<String> = used.difference(&documented).map(|code| format!("{code} is not in {PAGE}")).collect();
    found.extend(documented.difference(&used).map(|code| format!("{PAGE} lists {code}, which no code has")));
    if used.is_empty() {
        found.push("no crate has an error code".into());
    }
    found
}

/// Words of one letter, `T` or `E`, and three digits.
fn codes(text: &str) -> BTreeSet<String> {
    text.split(|c: char| !(c.is_alphanumeric() || c == '_'))
        .filter(|word| word.len() == 4 && word.starts_with(['T', 'E']) && word[1..].chars().all(|c| c.is_ascii_digit()))
        .map(str::to_owned)
        .collect()
}

/// Under two pages.
pub fn architecture_length(tree: &Tree) -> Vec<String> {
    const LINES: usize = 120;
    let lines = tree.text("ARCHITECTURE.md").unwrap_or_default().lines().count();
    if lines > LINES {
        vec![format!("ARCHITECTURE.md has {lines} lines, at most {LINES} are two pages")]
    } else {
        Vec::new()
    }
}

/// Golden tables say where they come from, and committed test data stay small.
pub fn golden_files(tree: &Tree) -> Vec<String> {
    const BYTES: usize = 200_000;
    // What a fuzzer begins with is bad input on purpose, no table of numbers.
    let is_seed = |path: &str| path.contains("/tests/seeds/");
    let mut found = Vec::new();
    for (path, text) in tree.under("crates/", ".csv").filter(|(path, _)| !is_seed(path)) {
        if !text.starts_with('#') {
            found.push(format!("{path}: the first line wants `# source, units, generator, date`"));
        }
    }
    // What writes data is none.
    let is_data = |path: &str| {
        let kind = path.rsplit('.').next().unwrap_or_default();
        !is_seed(path)
            && (kind == "csv" || (path.contains("/tests/") && !["rs", "proptest-regressions", "py"].contains(&kind)))
    };
    let total: usize = tree.under("crates/", "").filter(|(path, _)| is_data(path)).map(|(_, text)| text.len()).sum();
    if total > BYTES {
        found.push(format!("committed test data are {total} bytes, at most {BYTES} are allowed"));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIE: (&str, &str) = ("crates/lie/Cargo.toml", "[package]\nname = \"tumble-lie\"\n");

    #[test]
    fn dead_links_to_the_repository_are_seen() {
        let link = "//! [tutorial](https://github.com/tumble-robotics/tumble/blob/main/crates/lie/tests/suite/custom_group.rs).";
        let dead = Tree::planted(&[("crates/lie/src/group.rs", link)]);
        assert_eq!(repository_links(&dead).len(), 1);
        let alive = Tree::planted(&[("crates/lie/src/group.rs", link), ("crates/lie/tests/suite/custom_group.rs", "")]);
        assert!(repository_links(&alive).is_empty());
    }

    #[test]
    fn an_untested_readme_is_seen() {
        let own = "#![doc = include_str!(\"../README.md\")]";
        let both = "#![doc = include_str!(\"../README.md\")]\n#[doc = include_str!(\"../../../README.md\")]\nstruct R;";
        let check = |lib: &str| {
            let files = [LIE, ("README.md", "all"), ("crates/lie/README.md", "groups"), ("crates/lie/src/lib.rs", lib)];
            readme_doctests(&Tree::planted(&files)).len()
        };
        assert_eq!(check(both), 0);
        assert_eq!(check(own), 1);
        assert_eq!(check(""), 2);
        assert_eq!(readme_doctests(&Tree::planted(&[LIE])).len(), 2, "READMEs are required");
    }

    #[test]
    fn equation_numbers_are_read() {
        let read = |text: &str| equations(text).into_iter().collect::<Vec<_>>().join(" ");
        assert_eq!(read("thesis (5.18), not 5.19"), "5.18");
        assert_eq!(read("(5.13)-(5.15), (5.32, 5.33)"), "5.13 5.14 5.15 5.32 5.33");
        assert_eq!(read("(5.13)–(5.15) and (5.36) to (5.38, corrected)"), "5.13 5.14 5.15 5.36 5.37 5.38");
        assert_eq!(read("(5.17-5.18) (A.1) (4.8b)"), "4.8 5.17 5.18 A.1");
        assert_eq!(read("(10.5) (v1.2.3) (5) (x)"), "");
    }

    const CODE: (&str, &str) = (
        "crates/dynamics/src/variational.rs",
        "/// One step.\n///\n/// # Source\n///\n/// Thesis (5.18).\n///\n/// # Units\n/// (5.99)\npub fn step() {}\npub struct Body;\n\
         impl Body { pub const fn mass() {} }\n#[cfg(test)]\nmod tests { #[test]\n fn golden_step() {}\n fn no_test() {} }\n",
    );

    fn index(rows: &str) -> Vec<String> {
        let page = format!("text\n\n| equation | item | test |\n|---|---|---|\n{rows}");
        equation_index(&Tree::planted(&[CODE, ("docs/equations.md", &page)]))
    }

    #[test]
    fn the_equation_index_is_checked_both_ways() {
        let good = "| (5.18) | `dynamics::step` | `golden_step` |\n";
        assert_eq!(index(good), Vec::<String>::new());
        assert_eq!(index("| (5.18) | `Body::mass()` | `variational.rs::golden_step` |\n"), Vec::<String>::new());
        let complaint = |rows: &str, part: &str| {
            let found = index(rows);
            assert!(found.len() == 1 && found[0].contains(part), "{rows}: {found:?}");
        };
        complaint("| (5.17) | `dynamics::step` | `golden_step` |\n", "cites (5.18)");
        complaint("| (5.18) | `dynamics::leap` | `golden_step` |\n", "item `dynamics::leap`");
        complaint("| (5.18) | `Spirit::mass` | `golden_step` |\n", "item `Spirit::mass`");
        complaint("| (5.18) | `step` | `no_test` |\n", "test `no_test`");
        complaint("| (5.18) | `step` | `elsewhere.rs::golden_step` |\n", "elsewhere.rs");
        complaint("| (5.18) | `step` | golden_step |\n", "no test in backticks");
        complaint(&format!("{good}| the step | `step` | `golden_step` |\n"), "names no equation");
    }

    #[test]
    fn a_missing_index_is_seen() {
        assert_eq!(equation_index(&Tree::default()).len(), 1);
        assert_eq!(equation_index(&Tree::planted(&[("docs/equations.md", "nothing")])).len(), 1);
    }

    #[test]
    fn undocumented_and_stale_error_codes_are_seen() {
        let check = |source: &str, page: &str| {
            error_codes(&Tree::planted(&[("crates/astrobee/src/error.rs", source), ("docs/errors.md", page)]))
        };
        assert!(check("\"T001\"", "| T001 | empty file |").is_empty());
        assert_eq!(check("\"T001\" T002", "T001"), ["T002 is not in docs/errors.md"]);
        assert_eq!(check("T001", "T001 T003"), ["docs/errors.md lists T003, which no code has"]);
        assert_eq!(check("", "").len(), 1);
        assert_eq!(error_codes(&Tree::default()).len(), 1);
    }

    #[test]
    fn a_long_architecture_page_is_seen() {
        let check =
            |lines: usize| architecture_length(&Tree::planted(&[("ARCHITECTURE.md", &"x\n".repeat(lines))])).len();
        assert_eq!((check(120), check(121)), (0, 1));
    }

    #[test]
    fn bare_and_large_data_are_seen() {
        let check = |path: &str, text: &str| golden_files(&Tree::planted(&[(path, text)])).len();
        assert_eq!(check("crates/lie/tests/golden/exp.csv", "# equations.md a\nx,y\n"), 0);
        assert_eq!(check("crates/lie/tests/golden/exp.csv", "x,y\n"), 1);
        assert_eq!(check("crates/lie/tests/golden/exp.json", &"x".repeat(200_001)), 1);
        assert_eq!(check("crates/lie/tests/laws.rs", &"x".repeat(200_001)), 0);
    }
}
