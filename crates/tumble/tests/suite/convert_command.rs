//! `tumble convert`, as a user runs it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::support::scratch;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};
use tumble_formats::testing::{ROS2_LZ4, ROS2_MESSAGES};

fn tumble(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tumble")).args(line.split(' ')).current_dir(folder).output().unwrap()
}

fn succeeds(folder: &Path, line: &str) -> (String, String) {
    let output = tumble(folder, line);
    let (out, said) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "tumble {line}: {said}");
    (out.into_owned(), said.into_owned())
}

fn fails(folder: &Path, line: &str, code: &str) -> String {
    let output = tumble(folder, line);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "tumble {line}: {said}");
    assert!(said.contains(&format!("error[{code}]")), "tumble {line}: {said}");
    said
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Every cell by its column, numbers as their bits.
fn cells(text: &str) -> Vec<BTreeMap<String, String>> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let bits = |(name, cell): (&&str, &str)| {
        let number = cell.parse::<f64>().map(|number| format!("{:x}", number.to_bits()));
        ((*name).to_owned(), number.unwrap_or(cell.to_owned()))
    };
    lines.map(|line| header.iter().zip(line.split(',')).map(bits).collect()).collect()
}

const LOG: &str = "\
t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,w_x,w_y,w_z,f_x,f_y,f_z,tau_x,tau_y,tau_z,true_p_x,plan_revision,mode
1700000000.000000001,0.1,-0.0,1e-310,0.1,0.2,0.3,0.9273618495495703,1,2,3,0.5,0.25,0.125,1e-3,2e-3,3e-3,0.30000000000000004,3,nominal
1700000000.500000000,0.2,0.3,0.4,0,0,0,1,,,,,,,,,,7,3,
1700000001.6,1.7976931348623157e308,5e-324,0.4,0,0,0,1,0,0,0,1,,3,4,5,6,7,4,stop
";

#[test]
fn csv_through_mcap_keeps_every_number() {
    let folder = scratch("round-trip");
    std::fs::write(folder.join("log.csv"), LOG).unwrap();
    succeeds(&folder, "convert log.csv log.mcap");
    let (out, said) = succeeds(&folder, "convert log.mcap - --to csv");
    assert_eq!((cells(&out), said.as_str()), (cells(LOG), ""));
    // From here on the text itself no longer changes, nor do the bytes.
    std::fs::write(folder.join("again.csv"), &out).unwrap();
    succeeds(&folder, "convert again.csv again.mcap");
    assert_eq!(succeeds(&folder, "convert again.mcap - --to csv").0, out);
    succeeds(&folder, "convert log.csv log2.mcap");
    assert_eq!(std::fs::read(folder.join("log.mcap")).unwrap(), std::fs::read(folder.join("log2.mcap")).unwrap());
}

#[test]
fn a_cut_last_line_is_said() {
    let folder = scratch("cut");
    let pose = "0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1";
    for (name, text, line) in [("log.csv", LOG.trim_end(), 4), ("poses.tum", pose, 2)] {
        std::fs::write(folder.join(name), text).unwrap();
        let (_, said) = succeeds(&folder, &format!("convert {name} - --to csv"));
        assert!(said.contains(&format!("line {line} has no line end")), "{said}");
        std::fs::write(folder.join(name), format!("{text}\n")).unwrap();
        assert_eq!(succeeds(&folder, &format!("convert {name} - --to csv")).1, "");
    }
}

#[test]
fn tum_holds_poses_and_says_what_it_does_not() {
    let folder = scratch("tum");
    std::fs::write(folder.join("log.csv"), LOG).unwrap();
    let (out, said) = succeeds(&folder, "convert log.csv - --to tum");
    assert!(out.starts_with("1700000000.000000001 0.1 -0.0 1e-310 0.1 0.2 0.3 0.9273618495495703\n"), "{out}");
    assert!(said.contains("12 other columns are left out, `w_x` first"), "{said}");
    // Through every format and back.
    std::fs::write(folder.join("a.tum"), format!("# t x y z qx qy qz qw\n\n{out}")).unwrap();
    succeeds(&folder, "convert a.tum b.csv");
    succeeds(&folder, "convert b.csv c.mcap");
    let (back, said) = succeeds(&folder, "convert c.mcap - --to tum");
    assert_eq!((back, said.as_str()), (out, ""));
    // A time without a detour through a float, negative too.
    std::fs::write(folder.join("d.tum"), "-0.5 1 2 3 0 0 0 1\n").unwrap();
    assert!(succeeds(&folder, "convert d.tum - --to csv").0.ends_with("\n-0.500000000,1.0,2.0,3.0,0.0,0.0,0.0,1.0\n"));
    let said = fails(&folder, "convert d.tum d.mcap", "T031");
    assert!(said.contains("d.mcap: MCAP cannot hold times before zero"), "{said}");
}

#[test]
fn recordings_of_others_become_logs() {
    let folder = scratch("recordings");
    std::fs::write(folder.join("ros2.mcap"), ROS2_LZ4).unwrap();
    let (out, _) = succeeds(&folder, "convert ros2.mcap - --to csv");
    let values: Vec<serde_json::Value> =
        ROS2_MESSAGES.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let poses: Vec<_> = values.iter().filter(|line| line["topic"] == "/odom").collect();
    let rows = cells(&out);
    assert_eq!(rows.len(), poses.len());
    for (row, line) in rows.iter().zip(poses) {
        for (place, name) in ["p_x", "p_y", "p_z"].into_iter().enumerate() {
            let number: f64 = line["values"][place + 3].as_str().unwrap().parse().unwrap();
            assert_eq!(row[name], format!("{:x}", number.to_bits()), "{name}");
        }
    }
    assert!(out.lines().nth(1).unwrap().starts_with("1700000000.000000123,"));
}

#[test]
fn what_cannot_be_converted_leaves_nothing() {
    let folder = scratch("refused");
    std::fs::write(folder.join("log.csv"), LOG).unwrap();
    std::fs::write(folder.join("torn.csv"), format!("{LOG}1700000002,1,2\n")).unwrap();
    std::fs::write(folder.join("log.db3"), b"SQLite format 3\0 and so on").unwrap();
    std::fs::write(folder.join("wrench.csv"), "t_s,f_x\n0,1\n").unwrap();
    std::fs::write(folder.join("bad.tum"), "0 1 2 3 0 0 0 1\n1 1 2 x 0 0 0 1\n").unwrap();
    std::fs::write(folder.join("long.tum"), format!("0 1 2 3 0 0 0 1\n{}\n", "1 ".repeat(4000))).unwrap();
    std::fs::write(folder.join("there.csv"), "mine").unwrap();
    let before = names(&folder);
    let said = fails(&folder, "convert log.db3 out.csv", "T032");
    assert!(said.contains("ros2 bag convert") && said.contains("storage_id: mcap"), "{said}");
    for to in ["out.csv", "out.mcap", "out.tum"] {
        assert!(fails(&folder, &format!("convert torn.csv {to}"), "T006").contains("line 5"));
    }
    assert!(
        fails(&folder, "convert wrench.csv out.tum", "T031").contains("out.tum: TUM cannot hold a log without poses")
    );
    let said = fails(&folder, "convert bad.tum out.csv", "T005");
    assert!(said.contains("line 2, column `p_z`: `x`"), "{said}");
    fails(&folder, "convert long.tum out.csv", "T009");
    fails(&folder, "convert log.csv there.csv", "T010");
    fails(&folder, "convert log.csv out.xyz", "T018");
    fails(&folder, "convert log.csv - --to mcap", "T018");
    fails(&folder, "convert log.csv -", "T018");
    fails(&folder, "convert nowhere.csv out.csv", "T001");
    fails(&folder, "convert log.csv no/folder.csv", "T011");
    assert_eq!(names(&folder), before);
    assert_eq!(std::fs::read_to_string(folder.join("there.csv")).unwrap(), "mine");
    succeeds(&folder, "convert log.csv there.csv --force");
    assert_eq!(cells(&std::fs::read_to_string(folder.join("there.csv")).unwrap()), cells(LOG));
    assert_eq!(names(&folder), before);
}

#[test]
fn a_torn_recording_gives_its_beginning_and_says_so() {
    let folder = scratch("torn");
    std::fs::write(folder.join("log.csv"), LOG).unwrap();
    succeeds(&folder, "convert log.csv log.mcap");
    let whole = std::fs::read(folder.join("log.mcap")).unwrap();
    // The last of two chunks begins where the index says.
    let chunk = whole.windows(9).rposition(|part| part[0] == 6 && part[3..] == [0; 6]).unwrap();
    std::fs::write(folder.join("torn.mcap"), &whole[..chunk + 60]).unwrap();
    let (out, said) = succeeds(&folder, "convert torn.mcap - --to csv");
    assert_eq!(cells(&out).len(), 2, "{out}");
    assert!(said.contains("torn.mcap, byte") && said.contains("nothing after it is read"), "{said}");
}

/// The same motion, the same wrench: the same body, whichever file holds them.
#[test]
fn identify_reads_the_mcap_of_a_log_as_the_log() {
    let folder = scratch("identify");
    succeeds(&folder, "excite --period 4 --cycles 2 --rate 50 --harmonics 3 --starts 1 --fly --out flight");
    succeeds(&folder, "convert flight/log.csv log.mcap");
    let estimate = |path: &str| -> serde_json::Value {
        serde_json::from_str(&succeeds(&folder, &format!("identify {path} --json")).0).unwrap()
    };
    let (rows, messages) = (estimate("flight/log.csv"), estimate("log.mcap"));
    assert_eq!(rows["samples_used"], messages["samples_used"]);
    let close = |a: &serde_json::Value, b: &serde_json::Value| {
        let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
        assert!((a - b).abs() <= 1e-6 * a.abs(), "{a} {b}");
    };
    close(&rows["mass_kg"], &messages["mass_kg"]);
    for axis in 0..3 {
        close(&rows["com_m"][axis], &messages["com_m"][axis]);
    }
}
