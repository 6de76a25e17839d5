//! The README's console lines, pasted one after the other into an empty folder.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::{scratch, stderr, tumble_in};
use std::fs;

const README: &str = include_str!("../../WORKSPACE.md");
/// What is in front of the arguments of the program.
const PROGRAM: &str = "cargo run --release -- ";

#[test]
fn every_line_that_calls_the_program_runs_when_pasted() {
    let folder = scratch("pasted");
    let mut ran = 0;
    for block in README.split("```console\n").skip(1) {
        let block = block.split("```").next().unwrap();
        for line in block.lines().filter_map(|line| line.strip_prefix(PROGRAM)) {
            let line = line.split('#').next().unwrap().trim();
            let (words, into) = line.split_once(" > ").map_or((line, None), |(words, into)| (words, Some(into)));
            let output = tumble_in(&folder, &words.split_whitespace().collect::<Vec<_>>());
            assert_eq!(output.status.code(), Some(0), "tumble {line}: {}", stderr(&output));
            if let Some(into) = into {
                fs::write(folder.join(into), &output.stdout).unwrap();
            }
            ran += 1;
        }
    }
    assert!(ran >= 18, "{ran}");
}
