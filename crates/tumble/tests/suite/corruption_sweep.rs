//! Damaged and hostile CSV and TOML files: never a panic, no memory for an unchecked length, what is intact is read, and the
//! line that is not is named.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::promises::{TARGETS, Target};
use std::fmt::Write as _;
use std::fs;
use std::io::{Read, Write as _};
use std::path::{Path, PathBuf};
use tumble::TumbleError;
use tumble::cli::{allocate, realize};
use tumble::scenario::{EMBEDDED, ScenarioSource, read_wrenches};
use tumble_astrobee::propulsion::{AreaTable, PositivityShift};
use tumble_formats::FormatsError;
use tumble_formats::log::{LogReader, TEMPLATE};
use tumble_formats::testing::corruption::{Damage, sweep};
use tumble_formats::testing::scratch_file;
use tumble_formats::wheel_throw::{parse_throw, read_calibration};
use tumble_formats::{body_file, excitation_file::ExcitationFile};
use tumble_identification::MotionSample;

/// Seeds of the fuzz targets, and whatever a fuzzer found once.
fn seeds() -> Vec<(&'static str, Target, PathBuf)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/seeds");
    let of = |(name, target): (&'static str, Target)| {
        let files = fs::read_dir(folder.join(name)).unwrap();
        files.map(move |file| (name, target, file.unwrap().path())).collect::<Vec<_>>()
    };
    TARGETS.into_iter().flat_map(of).collect()
}

#[test]
fn every_seed_keeps_the_promises_of_its_target() {
    for (name, target, path) in seeds() {
        println!("{name}: {}", path.display());
        target(&fs::read(path).unwrap());
    }
    assert!(TARGETS.iter().all(|(name, _)| seeds().iter().any(|(with_seed, ..)| with_seed == name)));
}

#[test]
fn damaged_seeds_keep_the_promises_of_their_targets() {
    for (_, target, path) in seeds() {
        let bytes = fs::read(path).unwrap();
        let checked = sweep(&bytes[..bytes.len().min(2000)], |damaged, _| target(damaged));
        assert!(checked >= 3 * bytes.len().min(2000), "{checked}");
    }
}

/// The samples before the first error, and the error.
fn read_log(bytes: impl Read) -> (Vec<MotionSample>, Option<FormatsError>) {
    let mut samples = Vec::new();
    let outcome = LogReader::from_reader(bytes, Path::new("log.csv"), false).and_then(|mut reader| {
        while let Some(sample) = reader.next_sample()? {
            samples.push(sample);
        }
        Ok(())
    });
    (samples, outcome.err())
}

/// Line of a byte, from one.
fn line_of(bytes: &[u8], at: usize) -> usize {
    bytes[..at].split(|byte| *byte == b'\n').count()
}

/// The line that a message names.
fn line_named(message: &str) -> Option<usize> {
    let (_, rest) = message.split_once("line ").or_else(|| message.split_once("line: "))?;
    rest.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
}

/// A table of numbers: everything before the damage is read, and an error is the damaged line's or its neighbour's.
fn check_table<T: PartialEq + std::fmt::Debug>(
    reference: &[u8],
    damage: Damage,
    whole: &[T],
    found: &[T],
    error: Option<String>,
) {
    let line = line_of(reference, damage.intact_bytes());
    // lines before the damaged one, without the header
    let intact = line.saturating_sub(2);
    if let Some(message) = error {
        match line_named(&message) {
            Some(named) => assert!((line..=line + 1).contains(&named), "{message}: line {line} is damaged"),
            None => {
                assert!(line == 1 && message.contains("column") || damage == Damage::Cut { length: 0 }, "{message}");
            }
        }
    } else {
        assert!(line > 1 || damage != Damage::Cut { length: 0 });
        assert!(found.len() + 2 >= whole.len() || matches!(damage, Damage::Cut { .. }));
        assert_eq!(found[..intact.min(found.len())], whole[..intact], "{damage:?}");
    }
}

#[test]
fn a_damaged_log_is_read_up_to_the_damage() {
    let mut text = TEMPLATE.to_owned();
    for row in 2..5 {
        let _ = writeln!(text, "0.0{row},1,2.5,-3,0,0,0,1,0,0,0,0,0,0,0.0104,0,0,0.{row},0,0,0,0.002,0");
    }
    let (whole, error) = read_log(text.as_bytes());
    assert!(whole.len() == 5 && error.is_none(), "{error:?}");
    sweep(text.as_bytes(), |damaged, damage| {
        let (found, error) = read_log(damaged);
        // a streaming reader hands out what it read before the error
        let intact = line_of(text.as_bytes(), damage.intact_bytes()).saturating_sub(2);
        if error.is_some() && intact > 0 {
            assert_eq!(found[..intact], whole[..intact]);
        }
        check_table(text.as_bytes(), damage, &whole, &found, error.map(|error| error.to_string()));
    });
}

#[test]
fn a_damaged_throw_names_the_damage() {
    let mut text = "t_s,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2,wheel_rad_s\n".to_owned();
    for row in 1..6 {
        let _ = writeln!(text, "0.{row},1.5,-2,3e0,0.25,{row},6,700.{row}");
    }
    let whole = parse_throw(text.as_bytes(), Path::new("throw.csv")).unwrap();
    sweep(text.as_bytes(), |damaged, damage| {
        let (found, error) = match parse_throw(damaged, Path::new("throw.csv")) {
            Ok(record) => (record.samples().to_vec(), None),
            Err(error) => (Vec::new(), Some(error.to_string())),
        };
        check_table(text.as_bytes(), damage, whole.samples(), &found, error);
    });
}

const WRENCHES: &str = include_str!("../seeds/wrenches/steps.csv");
const WANTED: &str = include_str!("../seeds/allocate/wrenches.csv");
const OPENINGS: &str = include_str!("../seeds/realize/openings.csv");

/// The lines that a command writes to stdout before the first error, and the error.
fn allocated(input: impl Read) -> (Vec<String>, Option<TumbleError>) {
    let mut output = Vec::new();
    let (shift, areas, path) = (PositivityShift::AxisGroups, AreaTable::Full, Path::new("table.csv"));
    let outcome = allocate::table(shift, areas, path, input, &mut output, &mut std::io::sink());
    (String::from_utf8(output).unwrap().lines().map(str::to_owned).collect(), outcome.err())
}

/// As [`allocated`].
fn realized(input: impl Read) -> (Vec<String>, Option<TumbleError>) {
    let mut output = Vec::new();
    let outcome = realize::table(AreaTable::Full, Path::new("table.csv"), input, &mut output, &mut std::io::sink());
    (String::from_utf8(output).unwrap().lines().map(str::to_owned).collect(), outcome.err())
}

#[test]
fn a_damaged_table_is_answered_up_to_the_damage() {
    type Command = fn(&[u8]) -> (Vec<String>, Option<TumbleError>);
    let commands: [(&str, Command); 2] = [(WANTED, |bytes| allocated(bytes)), (OPENINGS, |bytes| realized(bytes))];
    for (text, run) in commands {
        let (whole, error) = run(text.as_bytes());
        assert!(whole.len() == text.lines().count() && error.is_none(), "{error:?}");
        sweep(text.as_bytes(), |damaged, damage| {
            let (found, error) = run(damaged);
            let line = line_of(text.as_bytes(), damage.intact_bytes());
            // what stood in whole lines before the damage, and the header of the answer, which comes with its first row
            let intact = if line <= 2 { 0 } else { line - 1 };
            assert!(intact == 0 || found.len() >= intact && found[..intact] == whole[..intact], "{damage:?}");
            match error.map(|error| error.to_string()) {
                Some(message) => match line_named(&message) {
                    Some(named) => assert!((line..=line + 1).contains(&named), "{message}: line {line} is damaged"),
                    None => assert!(line <= 2, "{message}"),
                },
                None => assert!(found.len() >= whole.len() - 1 || matches!(damage, Damage::Cut { .. }), "{damage:?}"),
            }
        });
    }
}

#[test]
fn a_damaged_table_of_wrenches_names_the_damage() {
    let read = |bytes: &[u8]| read_wrenches(bytes, Path::new("wrenches.csv"), 1_000_000_000_000);
    let whole = read(WRENCHES.as_bytes()).unwrap();
    assert_eq!(whole.len(), 3);
    sweep(WRENCHES.as_bytes(), |damaged, damage| {
        let line = line_of(WRENCHES.as_bytes(), damage.intact_bytes());
        match read(damaged) {
            // one line of these is a comment, so that the row behind a line is up to two on
            Ok(found) => {
                let intact = line.saturating_sub(2).saturating_sub(usize::from(line > 3));
                assert!(found.len() >= intact && found[..intact] == whole[..intact], "{damage:?}");
            }
            Err(error) => {
                let message = error.to_string();
                match line_named(&message) {
                    Some(named) => assert!((line..=line + 2).contains(&named), "{message}: line {line} is damaged"),
                    None => assert!(line <= 2, "{message}"),
                }
            }
        }
    });
}

#[test]
fn wrenches_end_where_the_flight_does() {
    let mut text = "t_s,f_x,f_y,f_z,tau_x,tau_y,tau_z\n".to_owned();
    for time_s in 0..100 {
        let _ = writeln!(text, "{time_s},1,2,3,4,5,6");
    }
    let read = read_wrenches(text.as_bytes(), Path::new("w.csv"), 7_000_000_000).unwrap();
    assert_eq!((read.len(), read[6].0), (7, 6_000_000_000));
    // the time of a row is read to the nanosecond
    let text = "tau_x,tau_y,tau_z,f_x,f_y,f_z,t_s\n1,2,3,4,5,6,1.000000001\n";
    let read = read_wrenches(text.as_bytes(), Path::new("w.csv"), 7_000_000_000).unwrap();
    assert_eq!(read[0].0, 1_000_000_001);
    assert_eq!(read[0].1.to_vector().as_slice(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
}

#[test]
fn a_damaged_scenario_names_its_place() {
    let texts = EMBEDDED.iter().map(|embedded| embedded.text);
    for text in texts.chain([include_str!("../seeds/scenario/everything.toml")]) {
        ScenarioSource::parse(Path::new("scenario.toml"), text).unwrap().flight().unwrap();
        sweep(text.as_bytes(), |damaged, damage| {
            let Ok(text) = std::str::from_utf8(damaged) else { return };
            let Err(error) = ScenarioSource::parse(Path::new("scenario.toml"), text) else { return };
            let message = error.to_string();
            assert!(!message.contains(char::is_control), "{message:?}");
            let line = line_named(&message).unwrap();
            assert!((1..=text.lines().count() + 1).contains(&line), "{damage:?}: {message}");
        });
    }
}

/// What is said to a scenario that is one of the hostile.
fn scenario_refusal(text: &str) -> String {
    let source = ScenarioSource::parse(Path::new("scenario.toml"), text);
    let message = source.and_then(|source| source.flight()).err().unwrap().to_string();
    assert!(message.starts_with("scenario.toml, line ") && message.len() < 10_000, "{message}");
    assert!(!message.contains(char::is_control), "{message:?}");
    message
}

const SCENARIO: &str = "format = 1\nname = \"a\"\nworld = \"open\"\nduration_s = 9\n";
const START: &str = "[start]\nposition_m = [0, 0, 0]\n";

#[test]
fn hostile_scenarios_are_refused_briefly() {
    let depth = 10_000;
    scenario_refusal(&format!("format = {}1{}", "[".repeat(depth), "]".repeat(depth)));
    scenario_refusal(&format!("format = {}", "{a = ".repeat(depth)));
    scenario_refusal(&format!("[{}a]\n", "drive.".repeat(depth)));
    scenario_refusal(&format!("{}a = 1\n", "start.".repeat(depth)));
    // names and keys of a megabyte, and such as would tell the terminal what to do
    let long = "x".repeat(1 << 20);
    for name in [long.as_str(), "\\u001b[2J", "a\\u0007b", "\\u0000"] {
        scenario_refusal(&format!("\"{name}\" = 1"));
        scenario_refusal(&SCENARIO.replace("\"a\"", &format!("\"{name}\"")).replace("open", name));
        scenario_refusal(&format!("{}{START}", SCENARIO.replace("open", name)));
        scenario_refusal(&format!("{SCENARIO}flight_mode = \"{name}\"\n{START}"));
        scenario_refusal(&format!("{SCENARIO}[start]\npoint = \"{name}\"\n"));
        scenario_refusal(&format!("{SCENARIO}{START}[body]\npreset = \"{name}\"\n"));
        scenario_refusal(&format!("{SCENARIO}{START}[drive]\ncontroller = \"{name}\"\n"));
        scenario_refusal(&format!("{SCENARIO}{START}[sensing.settings.\"{name}\"]\n"));
    }
    // numbers beyond any, at every place that takes one
    for number in ["1e999", "-1e999", "inf", "nan", "-1", "18446744073709551616"] {
        scenario_refusal(&format!("{}{START}", SCENARIO.replace('9', number)));
        let triple = format!("[{number}, {number}, 1e999]");
        for table in [
            format!("[start]\nposition_m = {triple}"),
            format!("{START}rate_rad_s = {triple}"),
            format!("{START}[goal]\nposition_m = {triple}"),
            format!("{START}[limits]\nspeed_m_s = {number}").replace("18446744073709551616", "-2"),
            format!("{START}[body]\nmass_kg = 1\ninertia_about_com_kg_m2 = [{triple}, {triple}, {triple}]"),
            format!("{START}[drive.constant]\nforce_n = {triple}"),
            format!("{START}[[drive.waypoints]]\ntime_s = {number}\nposition_m = [0, 0, 0]"),
            format!("{START}[[obstacles]]\ncenter_m = {triple}\nsemi_axes_m = [1, 1, 1]"),
            format!("{START}[payload]\ngrasp_position_m = {triple}"),
        ] {
            scenario_refusal(&format!("{SCENARIO}{table}\n"));
        }
    }
    scenario_refusal(&format!(
        "{SCENARIO}{START}[drive.multisine]\nforce_n = [0, 0, 0]\ntorque_n_m = [0, 0, 0]\n\
         tones = 9223372036854775807\nlowest_hz = 0.1\nhighest_hz = 0.2\n"
    ));
}

#[test]
fn a_million_waypoints_are_flown() {
    let mut text = format!("{SCENARIO}{START}[drive]\nwaypoints = [\n");
    for i in 1..=1_000_000 {
        let _ = writeln!(text, "{{time_s={}e-6,position_m=[0,0,0]}},", 8 * i);
    }
    text += "]\n";
    let mut flight = ScenarioSource::parse(Path::new("scenario.toml"), &text).unwrap().flight().unwrap();
    assert!(flight.step().unwrap().is_some());
    // but not from a file, which nobody wrote
    let path = scratch_file("waypoints.toml", text.as_bytes());
    let message = ScenarioSource::find(path.to_str().unwrap()).unwrap_err().to_string();
    assert!(message.contains("longer than 1048576 bytes"), "{message}");
    fs::remove_file(&path).unwrap();
}

/// Endlessly the same bytes, and how many were taken.
struct Endless<'a> {
    pattern: &'a [u8],
    taken: usize,
}

impl Read for Endless<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        for byte in &mut *buffer {
            *byte = self.pattern[self.taken % self.pattern.len()];
            self.taken += 1;
        }
        Ok(buffer.len())
    }
}

fn endless(pattern: &[u8]) -> Endless<'_> {
    Endless { pattern, taken: 0 }
}

const THROW_HEADER: &str = "t_s,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2,wheel_rad_s\n";

#[test]
fn a_line_without_end_is_refused_after_a_few_kilobytes() {
    let limit = 1 << 20;
    for pattern in [b"0".as_slice(), b",", b"#", b"\"", b"a,", b"\0", b"\xff", b"1e999,", b" "] {
        let mut source = endless(pattern);
        let (_, error) = read_log(&mut source);
        let error = error.unwrap();
        assert!(matches!(error, FormatsError::RowTooLong { line: 1, .. }), "{pattern:?}: {error}");
        assert!(source.taken < limit, "{pattern:?}: {} bytes read", source.taken);

        let mut source = endless(pattern);
        let (samples, error) = read_log(TEMPLATE.as_bytes().chain(&mut source));
        let error = error.unwrap();
        assert!(matches!(error, FormatsError::RowTooLong { line: 4, .. }), "{pattern:?}: {error}");
        assert!(samples.len() == 2 && source.taken < limit);

        let header = WRENCHES.lines().next().unwrap().as_bytes();
        for begin in [b"".as_slice(), header, b"t_s,f_x,f_y,f_z,tau_x,tau_y,tau_z\n"] {
            let mut source = endless(pattern);
            let error = read_wrenches(begin.chain(&mut source), Path::new("w.csv"), i64::MAX).unwrap_err();
            assert!(matches!(error, TumbleError::File(FormatsError::RowTooLong { .. })), "{pattern:?}: {error}");
            assert!(source.taken < limit);
        }
        for (table, run) in [
            (WANTED, &(|source| allocated(source)) as &dyn Fn(Box<dyn Read>) -> _),
            (OPENINGS, &|source| realized(source)),
        ] {
            let begin: &'static [u8] = table.as_bytes();
            let endless_pattern: Vec<u8> = pattern.iter().copied().cycle().take(limit).collect();
            let (lines, error) = run(Box::new(begin.chain(std::io::Cursor::new(endless_pattern))));
            assert!(
                matches!(error, Some(TumbleError::File(FormatsError::RowTooLong { .. }))),
                "{pattern:?}: {error:?}"
            );
            assert_eq!(lines.len(), table.lines().count());
        }

        let mut source = endless(pattern);
        let error = parse_throw(THROW_HEADER.as_bytes().chain(&mut source), Path::new("throw.csv")).unwrap_err();
        assert!(error.to_string().contains("throw.csv, line 2: longer than 65536 bytes"), "{pattern:?}: {error}");
        assert!(source.taken < limit);
    }
}

#[test]
fn an_open_quote_swallows_nothing() {
    let rows = format!("{THROW_HEADER}\"0.1,1,2,3,4,5,6,7\n0.2,1,2,3,4,5,6,7\n");
    let message = parse_throw(rows.as_bytes(), Path::new("throw.csv")).unwrap_err().to_string();
    assert!(message.contains("line: 2") && message.contains("1 fields"), "{message}");
}

#[test]
fn a_throw_without_end_is_refused() {
    struct Rows(u64, Vec<u8>);
    impl Read for Rows {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            if self.1.is_empty() {
                self.0 += 1;
                self.1 = format!("{},1,2,3,4,5,6,7\n", self.0).into_bytes();
            }
            let count = self.1.len().min(buffer.len());
            buffer[..count].copy_from_slice(&self.1[..count]);
            self.1.drain(..count);
            Ok(count)
        }
    }
    let rows = THROW_HEADER.as_bytes().chain(Rows(0, Vec::new()));
    let error = parse_throw(rows, Path::new("throw.csv")).unwrap_err().to_string();
    assert!(error.contains("more than 1000000 rows"), "{error}");
}

#[test]
fn a_million_columns_are_refused() {
    let columns: Vec<String> = (0..1_000_000).map(|i| format!("c{i}")).collect();
    let (_, error) = read_log(columns.join(",").as_bytes());
    assert!(matches!(error, Some(FormatsError::RowTooLong { line: 1, .. })), "{error:?}");
    // as many as a line may hold are looked through at once, not each against each
    let few = columns[..9000].join(",");
    let (_, error) = read_log(few.as_bytes());
    assert!(matches!(&error, Some(FormatsError::MissingColumn { column, .. }) if column == "t_s"), "{error:?}");
    // a row of a million cells below a good header
    let row = vec!["1"; 1_000_000].join(",");
    let (samples, error) = read_log(format!("{TEMPLATE}{row}\n").as_bytes());
    assert!(matches!(error, Some(FormatsError::RowTooLong { line: 4, .. })), "{error:?}");
    assert_eq!(samples.len(), 2);
}

#[test]
fn cells_that_are_no_numbers_are_named() {
    let cells = [
        b"1e999".as_slice(),
        b"-1e999",
        b"\0",
        b"1\x002",
        b"\xff\xfe",
        b"\xed\xa0\x80", // a lone surrogate
        b"18446744073709551616e300",
        b"0x10",
        b"1_000",
        b"\x1b[2J",
    ];
    let row = TEMPLATE.lines().nth(2).unwrap();
    for cell in cells {
        for column in [0, 1, 4, 17] {
            let mut bytes = TEMPLATE.as_bytes().to_vec();
            for (i, good) in row.split(',').enumerate() {
                bytes.extend(if i == column { cell } else { good.as_bytes() });
                bytes.push(b',');
            }
            bytes.pop();
            let (samples, error) = read_log(bytes.as_slice());
            let message = error.unwrap().to_string();
            let name = TEMPLATE.split(',').nth(column).unwrap();
            assert!(message.contains("line 4") && message.contains(name), "{message}");
            assert!(!message.contains(char::is_control), "{message:?}");
            assert_eq!(samples.len(), 2);
        }
        let mut bytes = THROW_HEADER.as_bytes().to_vec();
        bytes.extend([b"0.1,1,2,3,4,5,6,", cell].concat());
        let message = parse_throw(bytes.as_slice(), Path::new("throw.csv")).unwrap_err().to_string();
        assert!(message.contains("line 2") || message.contains("record 1"), "{message}");
        assert!(!message.contains(char::is_control), "{message:?}");
    }
}

#[test]
fn times_that_cannot_be_are_named() {
    let row = TEMPLATE.lines().nth(2).unwrap().split_once(',').unwrap().1;
    for time in ["1e2147483647", "-1e-2147483648", "9223372036.854775808", "18446744073709551616", &"9".repeat(30_000)]
    {
        let (samples, error) = read_log(format!("{TEMPLATE}{time},{row}\n").as_bytes());
        // the second is zero, and comes too late
        let message = error.unwrap().to_string();
        assert!(message.contains("line 4") && samples.len() == 2, "{message}");
    }
}

/// What each reader of TOML says to this text.
fn refusals(name: &str, bytes: &[u8]) -> [String; 4] {
    let path = scratch_file(name, bytes);
    let said = [
        body_file::read(&path).unwrap_err().to_string(),
        body_file::read_prior(&path).unwrap_err().to_string(),
        ExcitationFile::read(&path).unwrap_err().to_string(),
        read_calibration(&path).unwrap_err().to_string(),
    ];
    fs::remove_file(&path).unwrap();
    for message in &said {
        assert!(message.contains(name), "{message}");
        assert!(!message.contains(|c: char| c != '\n' && c.is_control()), "{message:?}");
        assert!(message.len() < 100_000, "{} bytes of message", message.len());
    }
    said
}

#[test]
fn toml_of_any_size_is_refused_before_it_is_read() {
    // a terabyte that takes no place on the disk
    let path = scratch_file("sparse.toml", b"mass_kg = 1\n");
    let file = fs::OpenOptions::new().write(true).open(&path).unwrap();
    if file.set_len(1 << 40).is_err() {
        file.set_len(1 << 30).unwrap();
    }
    drop(file);
    for message in [
        body_file::read(&path).unwrap_err().to_string(),
        body_file::read_prior(&path).unwrap_err().to_string(),
        ExcitationFile::read(&path).unwrap_err().to_string(),
        read_calibration(&path).unwrap_err().to_string(),
    ] {
        assert!(message.contains("longer than 1048576 bytes"), "{message}");
    }
    fs::remove_file(&path).unwrap();
}

#[test]
fn deep_toml_is_refused() {
    let depth = 10_000;
    let arrays = format!("mass_kg = {}1{}\n", "[".repeat(depth), "]".repeat(depth));
    refusals("arrays.toml", arrays.as_bytes());
    refusals("open.toml", format!("mass_kg = {}", "[".repeat(depth)).as_bytes());
    let tables = format!("mass_kg = {}1{}\n", "{a = ".repeat(depth), "}".repeat(depth));
    refusals("tables.toml", tables.as_bytes());
    refusals("dotted.toml", format!("{}a = 1\n", "a.".repeat(depth)).as_bytes());
    refusals("header.toml", format!("[{}a]\nb = 1\n", "a.".repeat(depth)).as_bytes());
    let json = scratch_file("deep.json", "[".repeat(depth).as_bytes());
    assert!(body_file::read(&json).unwrap_err().to_string().contains("deep.json"));
    fs::remove_file(&json).unwrap();
}

#[test]
fn toml_that_is_no_text_is_refused_with_its_line() {
    for bytes in [b"mass_kg = 1\ncom_m = \xff".as_slice(), b"mass_kg = 1\n\xed\xa0\x80 = 2"] {
        for message in refusals("bytes.toml", bytes) {
            assert!(message.contains("line 2"), "{message}");
        }
    }
    // a lone surrogate written as an escape, a zero, an escape sequence for the terminal
    for text in ["mass_kg = \"\\ud800\"", "mass_kg = \"\0\"", "mass_kg = 1\0", "\u{1b}[2J = 1", "mass_kg = '\u{1b}[2J'"]
    {
        refusals("text.toml", text.as_bytes());
    }
}

#[test]
fn toml_numbers_beyond_any_are_refused() {
    let body = |mass: &str| {
        format!("mass_kg = {mass}\ncom_m = [0, 0, 0]\ninertia_about_com_kg_m2 = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n")
    };
    for mass in ["1e999", "-1e999", "inf", "nan", "18446744073709551616", "99999999999999999999999999"] {
        refusals("numbers.toml", body(mass).as_bytes());
    }
    let path = scratch_file("good.toml", body("1.0").as_bytes());
    assert!((body_file::read(&path).unwrap().mass - 1.0).abs() < 1e-15);
    fs::remove_file(&path).unwrap();
}

#[test]
fn toml_with_a_hundred_thousand_keys_is_refused() {
    let mut text = Vec::new();
    for i in 0..100_000 {
        writeln!(text, "k{i} = 1").unwrap();
    }
    refusals("keys.toml", &text[..1 << 20]);
}
