//! No circles between the files of a crate: who uses what another file defines is not used by it, directly or round others.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::Tree;
use super::source::code;

/// The name of a module below the crate, `["mission", "record"]` for `src/mission/record.rs`; none for `lib.rs`.
type Module = Vec<String>;

/// What a file says about others.
#[derive(Default)]
struct File {
    path: String,
    /// Local name to path, for every `use`.
    imports: BTreeMap<String, Vec<String>>,
    /// What stands in the code: imports that are not passed on, and paths.
    mentions: BTreeSet<Vec<String>>,
    test_modules: BTreeSet<String>,
}

/// Used file to the items of it that are used.
type Uses<'a> = BTreeMap<&'a Module, BTreeSet<String>>;

/// Files that use each other's items. A `pub use` is no use; it is followed to the file that defines the item.
pub fn circles(tree: &Tree) -> Vec<String> {
    let mut crates: BTreeMap<&str, BTreeMap<Module, File>> = BTreeMap::new();
    for (path, text) in tree.under("crates/", ".rs") {
        let Some((name, inside)) = path["crates/".len()..].split_once("/src/") else { continue };
        let module = inside.trim_end_matches(".rs").split('/').filter(|part| *part != "lib");
        crates.entry(name).or_default().insert(module.map(str::to_owned).collect(), File::read(path, text));
    }
    crates.into_values().flat_map(|files| circles_of_crate(&files)).collect()
}

fn circles_of_crate(files: &BTreeMap<Module, File>) -> Vec<String> {
    let is_test = |module: &Module| {
        (1..=module.len()).any(|depth| {
            let parent = files.get(&module[..depth - 1]);
            parent.is_some_and(|parent| parent.test_modules.contains(&module[depth - 1]))
        })
    };
    let uses: BTreeMap<&Module, Uses> =
        files.keys().filter(|module| !is_test(module)).map(|module| (module, uses(files, module))).collect();
    let mut circles: Vec<Vec<&Module>> = uses.keys().filter_map(|module| shortest_circle(&uses, module)).collect();
    circles.sort_by_key(Vec::len);
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    for circle in circles {
        let steps: Vec<(&Module, &Module)> =
            circle.iter().copied().zip(circle.iter().copied().cycle().skip(1)).collect();
        // One that shares a step with a shorter one may be broken with it.
        if steps.iter().any(|step| seen.contains(step)) {
            continue;
        }
        let words = steps.iter().map(|(from, to)| {
            let items: Vec<&str> = uses[from][to].iter().map(String::as_str).collect();
            format!("{} uses {} of {}", files[*from].path, items.join(", "), files[*to].path)
        });
        found.push(words.collect::<Vec<_>>().join("; "));
        seen.extend(steps);
    }
    found
}

/// The files by which a module uses itself, the module first.
fn shortest_circle<'a>(uses: &BTreeMap<&'a Module, Uses<'a>>, module: &'a Module) -> Option<Vec<&'a Module>> {
    let mut before: BTreeMap<&Module, &Module> = BTreeMap::new();
    let mut open = VecDeque::from([module]);
    while let Some(from) = open.pop_front() {
        for to in uses[from].keys().copied() {
            if to == module {
                let mut circle: Vec<&Module> =
                    std::iter::successors(Some(from), |at| before.get(at).copied()).collect();
                circle.reverse();
                return Some(circle);
            }
            if !before.contains_key(to) {
                before.insert(to, from);
                open.push_back(to);
            }
        }
    }
    None
}

fn uses<'a>(files: &'a BTreeMap<Module, File>, module: &Module) -> Uses<'a> {
    let mut uses = Uses::new();
    for path in &files[module].mentions {
        if let Some((definer, item)) = definition(files, module, path.clone()).filter(|(definer, _)| *definer != module)
        {
            uses.entry(definer).or_default().insert(item);
        }
    }
    uses
}

/// The file that defines what a path names within a module, and the item; none for a module and outside of the crate.
fn definition<'a>(
    files: &'a BTreeMap<Module, File>,
    module: &Module,
    mut path: Vec<String>,
) -> Option<(&'a Module, String)> {
    let (mut at, mut is_relative) = (module.clone(), true);
    // Each step goes into a module or through an import; imports of each other would never end.
    for _ in 0..32 {
        if path.is_empty() {
            return None;
        }
        let name = path.remove(0);
        let (known, file) = files.get_key_value(&at)?;
        let below = [at.as_slice(), std::slice::from_ref(&name)].concat();
        match (name.as_str(), file.imports.get(&name)) {
            ("crate", _) => at.clear(),
            ("super", _) => drop(at.pop()?),
            ("self", _) => (),
            _ if files.contains_key(&below) => at = below,
            // A macro is passed on under its own name.
            (_, Some(import)) if *import != [name.as_str()] => {
                path.splice(..0, import.iter().cloned());
                is_relative = true;
                continue;
            }
            (_, import) => return (import.is_some() || !is_relative).then_some((known, name)),
        }
        is_relative = false;
    }
    None
}

impl File {
    fn read(path: &str, text: &str) -> Self {
        let code = code(text);
        let tokens = tokens(&code);
        let mut file = Self { path: path.to_owned(), ..Self::default() };
        let mut at = 0;
        while at < tokens.len() {
            let rest = &tokens[at..];
            at += match rest[0] {
                "#" if is_for_tests(rest) => {
                    let item = &rest[..item_length(rest)];
                    if let [.., "mod", name, ";"] = item {
                        file.test_modules.insert((*name).to_owned());
                    }
                    item.len()
                }
                "use" => {
                    let length = rest.iter().position(|token| *token == ";").unwrap_or(rest.len());
                    // `pub`, or the end of `pub(super)`
                    let is_passed_on = at > 0 && matches!(tokens[at - 1], "pub" | ")");
                    file.import(&rest[1..length], &[], is_passed_on);
                    length
                }
                word if is_word(word) => {
                    let path = path_at(rest);
                    let length = 2 * path.len() - 1;
                    if at == 0 || tokens[at - 1] != "." {
                        file.mentions.insert(path);
                    }
                    length
                }
                _ => 1,
            };
        }
        file
    }

    /// Reads the tree of names after `use`.
    fn import(&mut self, tree: &[&str], before: &[String], is_passed_on: bool) {
        let own = path_at(tree);
        let rest = &tree[(2 * own.len()).saturating_sub(1)..];
        let mut path = [before, &own].concat();
        if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let name = match rest {
            [] => path.last().cloned(),
            ["as", name] => Some((*name).to_owned()),
            ["::", "{", branches @ .., "}"] => {
                let mut depth = 0;
                for branch in branches.split(|token| {
                    depth += i32::from(*token == "{") - i32::from(*token == "}");
                    depth == 0 && *token == ","
                }) {
                    self.import(branch, &path, is_passed_on);
                }
                None
            }
            _ => None,
        };
        if let Some(name) = name.filter(|_| !own.is_empty()) {
            if !is_passed_on {
                self.mentions.insert(path.clone());
            }
            self.imports.insert(name, path);
        }
    }
}

fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphanumeric() || c == '_')
}

/// Words, `::`, `..` and single characters.
fn tokens(code: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut rest = code.trim_start();
    while let Some(first) = rest.chars().next() {
        let length = if is_word(rest) {
            rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len())
        } else if rest.starts_with("::") || rest.starts_with("..") {
            2
        } else {
            first.len_utf8()
        };
        tokens.push(&rest[..length]);
        rest = rest[length..].trim_start();
    }
    tokens
}

/// The path `a::b::c` that begins here.
fn path_at(tokens: &[&str]) -> Vec<String> {
    let mut path = Vec::new();
    let mut rest = tokens;
    while let [word, after @ ..] = rest
        && is_word(word)
    {
        path.push((*word).to_owned());
        rest = after.strip_prefix(&["::"]).unwrap_or_default();
    }
    path
}

/// Whether an attribute begins here that leaves its item out of all builds but tests.
fn is_for_tests(tokens: &[&str]) -> bool {
    matches!(tokens, ["#", "[", "cfg", "(", "test", ")", ..] | ["#", "[", "cfg", "(", "all", "(", "test", ..])
}

/// Tokens of the item that begins here with its attributes.
fn item_length(tokens: &[&str]) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate() {
        match *token {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth -= 1,
            _ => (),
        }
        let is_end = *token == ";" || *token == "}" && tokens.get(at + 1) != Some(&";");
        if depth < 0 || depth == 0 && is_end {
            return at + 1;
        }
    }
    tokens.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The complaints about a crate of these files and `lib.rs`.
    fn check(files: &[(&str, &str)]) -> Vec<String> {
        let files = [&[("lib.rs", "")], files].concat();
        let paths: Vec<String> = files.iter().map(|(path, _)| format!("crates/lie/src/{path}")).collect();
        let files: Vec<(&str, &str)> =
            paths.iter().zip(&files).map(|(path, (_, text))| (path.as_str(), *text)).collect();
        circles(&Tree::planted(&files))
    }

    const B: (&str, &str) = ("b.rs", "use crate::a::A;\npub struct B(A);");
    const BY_B: &str = "crates/lie/src/b.rs uses A of crates/lie/src/a.rs";

    #[test]
    fn two_files_that_use_each_other_are_seen() {
        let complaint = [format!("crates/lie/src/a.rs uses B of crates/lie/src/b.rs; {BY_B}")];
        for text in [
            "use super::b::B;\npub struct A;",
            "use crate::{b::{self, B as Other}, c};\npub struct A;",
            "use crate::b;\npub struct A(b::B);",
            "pub struct A(crate::b::B);",
            "#[cfg(not(test))]\nuse crate::b::B;\npub struct A;",
            "#[cfg(test)]\nfn f() -> [f64; 2] { g() }\nuse crate::b::B;\npub struct A;",
        ] {
            assert_eq!(check(&[("a.rs", text), B]), complaint, "{text}");
        }
        for text in [
            "use tumble_series::b::B;\npub struct A;",
            "use crate::b;\npub struct A;",
            "pub use crate::b::B;\npub struct A;",
            "/// [`B`](crate::b::B)\npub struct A { b: f64 }",
            "pub struct A;\n#[cfg(test)]\nmod tests { use crate::b::B; }",
            "#[cfg(test)]\nuse crate::b::{B};\npub struct A;",
            "pub struct A;\nfn f(of: A) -> f64 { of.b.B(of..b) }",
            "#[cfg(all(test, feature = \"std\"))]\nuse crate::b::B;\npub struct A;",
        ] {
            assert_eq!(check(&[("a.rs", text), B]), [""; 0], "{text}");
        }
        let tests = ("a/tests.rs", "use crate::b::B;");
        assert_eq!(check(&[("a.rs", "#[cfg(test)]\nmod tests;\npub struct A;"), tests, B]), [""; 0]);
    }

    #[test]
    fn a_parent_and_its_child_may_not_use_each_other() {
        let child = ("b/inside.rs", "use super::B;\npub struct Inside(B);");
        let check = |text: &str| check(&[("b.rs", text), child]);
        assert_eq!(check("mod inside;\npub use inside::Inside;\npub struct B;"), [""; 0]);
        let complaint = [
            "crates/lie/src/b.rs uses Inside of crates/lie/src/b/inside.rs; crates/lie/src/b/inside.rs uses B of crates/lie/src/b.rs",
        ];
        assert_eq!(check("mod inside;\nuse inside::Inside;\npub struct B;"), complaint);
        assert_eq!(check("mod inside;\npub struct B;\nfn f() -> inside::Inside;"), complaint);
        assert_eq!(check("mod inside;\npub use inside::Inside;\npub struct B;\nfn f() -> Inside;"), complaint);
    }

    #[test]
    fn what_is_passed_on_is_followed() {
        let root = ("lib.rs", "mod a;\nmod b;\nmod c;\npub use a::A;\npub use c::C;");
        let a = ("a.rs", "use crate::C;\npub struct A(C);");
        let c = ("c.rs", "pub(crate) use crate::b::B as C;");
        assert_eq!(
            check(&[root, a, ("b.rs", "pub struct B(crate::A);"), c]),
            [format!("crates/lie/src/a.rs uses B of crates/lie/src/b.rs; {BY_B}")]
        );
        assert_eq!(check(&[root, a, ("b.rs", "pub struct B;"), c]), [""; 0]);
        // Imports of each other do not go on for ever.
        assert_eq!(check(&[("a.rs", "use super::b::X;"), ("b.rs", "use super::a::X;")]), [""; 0]);
    }

    #[test]
    fn a_circle_round_others_is_told_once() {
        let files = [
            ("a.rs", "use crate::b::B;\npub struct A;"),
            ("b.rs", "use crate::c::{C, c};\npub struct B;"),
            ("c.rs", "use crate::a::A;\npub struct C;\npub fn c() {}"),
        ];
        let complaint = "crates/lie/src/a.rs uses B of crates/lie/src/b.rs; crates/lie/src/b.rs uses C, c of crates/lie/src/c.rs; \
                         crates/lie/src/c.rs uses A of crates/lie/src/a.rs";
        assert_eq!(check(&files), [complaint]);
        let other = ("crates/dynamics/src/a.rs", "use crate::b::B;\npub struct A;");
        assert_eq!(circles(&Tree::planted(&[other, ("crates/lie/src/b.rs", B.1)])), [""; 0], "of two crates");
    }
}
