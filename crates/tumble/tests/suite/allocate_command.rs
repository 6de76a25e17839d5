//! `tumble allocate` and `tumble realize` as a user meets them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::float_cmp, missing_docs)]

use crate::support::stderr;
use std::fmt::Write as _;
use std::io::{Read as _, Write as _};
use std::process::{Command, Output, Stdio};
use tumble_astrobee::testing::{FLOWN_ALLOCATION as FLOWN, SIMULATED_THRUST as SIMULATED};

const WANTED: &str = "mode,fx,fy,fz,tx,ty,tz,comx,comy,comz";
const OPENINGS: &str = "pm,N,dtheta1,dtheta2,dtheta3,dtheta4,dtheta5,dtheta6";

/// Runs a command on text at its standard input.
fn tumble(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_tumble"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_owned();
    // a command that stops at an error reads no further
    let writer = std::thread::spawn(move || drop(stdin.write_all(input.as_bytes())));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    output
}

/// Header and rows of what a command that succeeded wrote.
fn table(output: &Output) -> (Vec<String>, Vec<Vec<f64>>) {
    assert_eq!(output.status.code(), Some(0), "{}", stderr(output));
    parse(std::str::from_utf8(&output.stdout).unwrap())
}

fn parse(text: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().unwrap().split(',').map(str::to_owned).collect();
    let number = |cell: &str| cell.parse().unwrap_or(f64::NAN);
    (header, lines.map(|line| line.split(',').map(number).collect()).collect())
}

/// The values under one column.
fn column(table: &(Vec<String>, Vec<Vec<f64>>), name: &str) -> Vec<f64> {
    let at = table.0.iter().position(|column| column == name).unwrap_or_else(|| panic!("no column {name}"));
    table.1.iter().map(|row| row[at]).collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_vectors_of_the_flown_software_are_valid_input() {
    let output = tumble(&["allocate", "-"], FLOWN);
    let (found, flown) = (table(&output), parse(FLOWN));
    assert!(stderr(&output).starts_with("columns ignored: case, raw1,"), "{}", stderr(&output));
    let mut header: Vec<String> = WANTED.split(',').map(str::to_owned).collect();
    let numbered = |prefix: &'static str, count: usize| (1..=count).map(move |i| format!("{prefix}{i}"));
    header.extend(numbered("thr", 12).chain(numbered("cdp", 2)).chain(numbered("dp", 2)));
    header.extend(numbered("dtheta", 12).chain(numbered("servof", 12)).chain(numbered("servo", 12)));
    header.extend(["rfx", "rfy", "rfz", "rtx", "rty", "rtz"].map(str::to_owned));
    assert_eq!(found.0, header);
    assert!(found.1.iter().flatten().all(|number| number.is_finite()));
    for name in
        header.iter().take(10).chain(header.iter().filter(|name| name.starts_with("servo") && !name.contains('f')))
    {
        assert_eq!(column(&found, name), column(&flown, name), "{name}");
    }
    for (prefix, count, tolerance) in [("cdp", 2, 1e-6), ("dp", 2, 1e-3), ("dtheta", 12, 1e-3), ("servof", 12, 0.3)] {
        for name in numbered(prefix, count) {
            assert!(largest_difference(&column(&found, &name), &column(&flown, &name)) < tolerance, "{name}");
        }
    }
    // impellers off: nothing is given; small wrenches: what is asked for, to a count of each nozzle
    let mode = column(&found, "mode");
    for component in ["fx", "fy", "fz", "tx", "ty", "tz"] {
        let given = column(&found, &format!("r{component}"));
        assert!(mode.iter().zip(&given).all(|(mode, given)| *mode > 0.0 || *given == 0.0));
        let wanted = column(&found, component);
        let off_by = |row: usize| (given[row] - wanted[row]).abs();
        let open = |row: usize| (1..=12).any(|i| column(&found, &format!("servo{i}"))[row] > 253.0);
        let worst = (0..mode.len()).filter(|row| mode[*row] > 0.0 && !open(*row)).map(off_by).fold(0.0, f64::max);
        assert!(worst < 0.005, "{component}: {worst}");
    }
}

#[test]
fn columns_in_any_order_give_the_same_and_one_command_feeds_the_other() {
    let forward = format!("{WANTED}\n2,0.1,0.02,-0.05,0.001,-0.002,0.003,0.01,0.02,0.03\n");
    let backward = "comz,comy,comx,tz,ty,tx,fz,fy,fx,mode\n0.03,0.02,0.01,0.003,-0.002,0.001,-0.05,0.02,0.1,2\n";
    let allocated = tumble(&["allocate", "-"], &forward);
    assert_eq!(allocated.stdout, tumble(&["allocate", "-"], backward).stdout);
    assert!(allocated.stderr.is_empty());
    // a byte order mark and Windows line ends change nothing
    let windows = format!("\u{feff}{}", forward.replace('\n', "\r\n"));
    assert_eq!(allocated.stdout, tumble(&["allocate", "-"], &windows).stdout);

    let allocated = table(&allocated);
    for (component, wanted, counts) in
        [("fx", 0.1, 2e-3), ("tx", 0.001, 3e-4), ("ty", -0.002, 3e-4), ("tz", 0.003, 3e-4)]
    {
        let given = column(&allocated, &format!("r{component}"))[0];
        assert!((given - wanted).abs() < counts, "{component}: {given}");
    }
    let mut openings = format!("{OPENINGS}\n");
    for module in 0..2 {
        write!(openings, "{},261.79938779914943", module + 1).unwrap();
        for i in 1..=6 {
            write!(openings, ",{}", column(&allocated, &format!("dtheta{}", 6 * module + i))[0]).unwrap();
        }
        openings.push('\n');
    }
    let realized = table(&tumble(&["realize", "-"], &openings));
    // the hardware's second module gives about 5 % more
    for i in 1..=6 {
        let thrust = column(&realized, &format!("thrust{i}"));
        for (module, gain) in [(0, 1.0), (1, 1.05)] {
            let wanted = column(&allocated, &format!("thr{}", 6 * module + i))[0];
            assert!((thrust[module] - gain * wanted).abs() < 1e-4 + 0.01 * wanted, "{i} {thrust:?} {wanted}");
        }
    }
}

#[test]
fn the_thrusts_of_the_flown_simulation_come_out_without_its_factor() {
    let output = tumble(&["realize", "-"], SIMULATED);
    let (found, flown) = (table(&output), parse(SIMULATED));
    assert!(stderr(&output).starts_with("columns ignored: cdp, dp, thrust_sim1"), "{}", stderr(&output));
    let added = "cdp,dp,thrust1,thrust2,thrust3,thrust4,thrust5,thrust6,fx,fy,fz,tx,ty,tz";
    assert_eq!(found.0.join(","), format!("{OPENINGS},{added}"));
    for (name, simulated, factor, tolerance) in (1..=6)
        .map(|i| (format!("thrust{i}"), format!("thrust_sim{i}"), 1.25, 1e-6))
        .chain(["fx", "fy", "fz", "tx", "ty", "tz"].map(|name| (name.into(), name.into(), 1.25, 1e-6)))
        .chain([("cdp".into(), "cdp".into(), 1.0, 1e-6), ("dp".into(), "dp".into(), 1.0, 1e-3)])
    {
        let scaled: Vec<f64> = column(&found, &name).iter().map(|value| value * factor).collect();
        assert!(largest_difference(&scaled, &column(&flown, &simulated)) < tolerance * factor, "{name}");
    }
}

#[test]
fn the_thesis_variants_are_options() {
    let wanted = format!("{WANTED}\n2,0.1,0.02,0.04,0,0,0,0,0,0\n");
    let given = |options: &[&str]| {
        let output = table(&tumble(&[&["allocate", "-"], options].concat(), &wanted));
        (column(&output, "rfx")[0], column(&output, "thr1")[0])
    };
    let (flown, thesis) = (given(&[]), given(&["--thesis-shift"]));
    assert!((flown.0 - 0.1).abs() < 0.003 && thesis.0 < 0.08, "{flown:?} {thesis:?}");
    assert!(flown.1 == 0.0 && (thesis.1 + 0.02).abs() < 1e-12);
    let open = format!("{OPENINGS}\n1,261.8,1.12,1.12,1.12,1.12,1.12,1.12\n");
    let thrust =
        |options: &[&str]| column(&table(&tumble(&[&["realize", "-"], options].concat(), &open)), "thrust1")[0];
    assert!(thrust(&["--thesis-table"]) > 1.2 * thrust(&[]));
}

#[test]
fn errors_name_code_place_and_remedy() {
    let row = "2,0.1,0,0,0,0,0,0,0,0\n";
    let wrench = |bad: &str| format!("{WANTED}\n{row}{bad}\n");
    let opening = |bad: &str| format!("{OPENINGS}\n1,200,0,0,0,0,0,1.12102497\n{bad}\n");
    let cases = [
        ("allocate", wrench("4,0,0,0,0,0,0,0,0,0"), "T022", "line 3, column `mode`: 4"),
        ("allocate", wrench("1.5,0,0,0,0,0,0,0,0,0"), "T022", "line 3, column `mode`: 1.5"),
        ("allocate", wrench("-1,0,0,0,0,0,0,0,0,0"), "T022", "line 3, column `mode`: -1"),
        ("allocate", wrench("1,0,0,0,0,1.7e308,0,0,0,0"), "T022", "line 3, column `ty`: 1.7e308"),
        ("allocate", wrench("1,0,nan,0,0,0,0,0,0,0"), "T005", "line 3, column `fy`: `nan`"),
        ("allocate", wrench("1,0,,0,0,0,0,0,0,0"), "T005", "line 3, column `fy`"),
        ("allocate", wrench("1,0,0,0,inf,0,0,0,0,0"), "T005", "line 3, column `tx`"),
        ("allocate", wrench("1,0,0"), "T006", "line 3: 3 cells, the header has 10"),
        ("allocate", WANTED.replace("comz", "com_z") + "\n" + row, "T003", "`comz`"),
        ("allocate", WANTED.replace("comz", "comz,fx") + "\n", "T004", "`fx`"),
        ("allocate", String::new(), "T002", "header"),
        ("allocate", format!("{WANTED}\n"), "T002", "data rows"),
        ("allocate", format!("{WANTED}\n{}", "1".repeat(100_000)), "T009", "line 2"),
        ("realize", opening("3,200,0,0,0,0,0,0"), "T022", "line 3, column `pm`: 3"),
        ("realize", opening("1,-1,0,0,0,0,0,0"), "T022", "line 3, column `N`: -1"),
        ("realize", opening("1,1e200,0,0,0,0,0,0"), "T022", "line 3, column `N`"),
        ("realize", opening("2,200,0,-0.1,0,0,0,0"), "T022", "line 3, column `dtheta2`: -0.1"),
        ("realize", opening("2,200,0,0,0,0,0,1.2"), "T022", "line 3, column `dtheta6`: 1.2"),
        ("realize", opening("2,200,0,0,0,0,0"), "T006", "line 3"),
        ("realize", OPENINGS.replace("dtheta4", "theta4") + "\n", "T003", "`dtheta4`"),
    ];
    for (command, input, code, place) in cases {
        let output = tumble(&[command, "-"], &input);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{input}: {said}");
        assert!(said.contains(&format!("error[{code}]: standard input")), "{input}: {said}");
        assert!(said.contains(place) && said.contains("remedy: "), "{input}: {said}");
        // the rows before the bad one are there
        let good = usize::from(place.contains("line 3"));
        let lines = String::from_utf8(output.stdout).unwrap().lines().count();
        assert!(lines.saturating_sub(1) == good, "{input}: {lines}");
    }
    let output = tumble(&["allocate", "no-such-file.csv"], "");
    assert!(stderr(&output).contains("error[T001]: cannot read no-such-file.csv"));
    assert!(stderr(&tumble(&["realize", env!("CARGO_MANIFEST_DIR")], "")).contains("T001"));
}

#[test]
fn a_table_begins_with_its_first_row_and_quoted_names_are_names() {
    for (command, header) in [("allocate", WANTED), ("realize", OPENINGS)] {
        let cells = header.split(',').count();
        let bad = tumble(&[command, "-"], &format!("{header}\n7{}\n", ",0".repeat(cells - 1)));
        assert_eq!((bad.status.code(), bad.stdout.len()), (Some(2), 0), "{}", stderr(&bad));
        assert!(stderr(&bad).contains(": 7, but "), "{}", stderr(&bad));
        let empty = tumble(&[command, "-"], &format!("{header}\n"));
        assert_eq!(empty.stdout.len(), 0);
        assert!(stderr(&empty).contains("`--help` of `allocate` and `realize`"), "{}", stderr(&empty));
        let row = format!("1{}\n", ",0".repeat(cells - 1));
        let plain = tumble(&[command, "-"], &format!("{header}\n{row}{row}"));
        let quoted: Vec<String> = header.split(',').map(|name| format!("\"{name}\"")).collect();
        let quoted = tumble(&[command, "-"], &format!("\u{feff}{}\n{row}{row}", quoted.join(",")));
        assert!(plain.status.success() && plain.stdout == quoted.stdout, "{}", stderr(&quoted));
        assert_eq!(String::from_utf8(plain.stdout).unwrap().lines().count(), 3);
    }
}

#[test]
fn a_reader_that_leaves_is_no_error() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_tumble"))
        .args(["allocate", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || {
        let rows = "2,0.1,0,0,0,0,0,0,0,0\n".repeat(1000);
        let _ = stdin.write_all(format!("{WANTED}\n").as_bytes());
        // it ends when nobody reads any more
        while stdin.write_all(rows.as_bytes()).is_ok() {}
    });
    let mut first = vec![0; 100_000];
    child.stdout.take().unwrap().read_exact(&mut first).unwrap();
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    assert_eq!((output.status.code(), stderr(&output)), (Some(0), String::new()));
}
