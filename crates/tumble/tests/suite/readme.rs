//! The console lines of the README and of the pages in docs, pasted one after the other into an empty folder.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::{scratch, stderr, tumble_in};
use std::fs;
use std::path::Path;

const README: &str = include_str!("../../WORKSPACE.md");

/// Runs the lines of a text's console blocks that begin with a program's name, as a shell would in a folder; a comment may say the exit code. How
/// many there were.
fn paste(text: &str, program: &str, folder: &Path) -> usize {
    let blocks = text.split("```console\n").skip(1).map(|block| block.split("```").next().unwrap());
    let lines: Vec<&str> = blocks.flat_map(str::lines).filter_map(|line| line.strip_prefix(program)).collect();
    for line in &lines {
        let (line, comment) = line.split_once('#').unwrap_or((line, ""));
        let code = comment.split_once("exit code ").map_or(0, |(_, code)| i32::from(code.as_bytes()[0] - b'0'));
        let (words, into) = line.split_once(" > ").map_or((line, None), |(words, into)| (words, Some(into.trim())));
        let words: Vec<String> = words.split_whitespace().flat_map(|word| expanded(word, folder)).collect();
        let output = tumble_in(folder, &words.iter().map(String::as_str).collect::<Vec<_>>());
        assert_eq!(output.status.code(), Some(code), "tumble {line}: {}", stderr(&output));
        if let Some(into) = into {
            fs::write(folder.join(into), &output.stdout).unwrap();
        }
    }
    lines.len()
}

/// The names that a word with one star stands for, in their order; the word itself without a star.
fn expanded(word: &str, folder: &Path) -> Vec<String> {
    let Some((begin, end)) = word.split_once('*') else { return vec![word.to_owned()] };
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| name.starts_with(begin) && name.ends_with(end)).collect();
    names.sort();
    names
}

#[test]
fn every_line_that_calls_the_program_runs_when_pasted() {
    let folder = scratch("pasted");
    let ran = ["cargo run --release -- ", "tumble "].map(|program| paste(README, program, &folder));
    assert!(ran[0] >= 2 && ran[1] >= 18, "{ran:?}");
}

/// Blocks of other languages hold lines that take long or ask for files of one's own.
#[test]
fn every_console_line_of_the_pages_runs_when_pasted() {
    let Ok(pages) = fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs")) else {
        println!("skipped: a published package has no pages");
        return;
    };
    let mut ran = 0;
    for page in pages.map(|page| page.unwrap().path()).filter(|path| path.extension().is_some_and(|end| end == "md")) {
        let folder = scratch(&format!("pasted-{}", page.file_stem().unwrap().to_str().unwrap()));
        ran += paste(&fs::read_to_string(&page).unwrap(), "tumble ", &folder);
        fs::remove_dir_all(folder).unwrap();
    }
    assert!(ran >= 26, "{ran}");
}
