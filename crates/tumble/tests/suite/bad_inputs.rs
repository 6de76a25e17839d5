//! Every command that reads a file, on every kind of file that is none of its own: an error with a code and a remedy, soon, in little memory,
//! and nothing written.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::scratch;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

/// `FILE` is the bad one, `LOG` a sound log, `OUT` what would be written.
const COMMANDS: [&str; 39] = [
    "identify FILE",
    "identify FILE --dry-run",
    "identify FILE --reorder --planar",
    "identify FILE --json --out OUT",
    "identify LOG --reference FILE",
    "identify LOG --prior FILE",
    "identify LOG --sensing FILE",
    "identify LOG --excitation FILE",
    "identify LOG --actuators FILE",
    "identify FILE --actuators actuators.toml",
    "identify FILE FILE",
    "identify LOG --model FILE",
    "identify FILE --model ur10e",
    "identify --wheel FILE --calibration FILE",
    "calibrate-wheel FILE --out OUT",
    "convert FILE OUT.csv",
    "convert FILE OUT.mcap",
    "convert FILE - --to tum",
    "convert FILE FILE OUT.csv",
    "sensing check FILE",
    "sensing check FILE FILE",
    "sensing show FILE",
    "arm show FILE",
    "arm excite FILE --out OUT",
    "scenario show FILE",
    "plan FILE --out OUT",
    "plan FILE --local --out OUT",
    "simulate FILE --out OUT",
    "simulate iss-hold --sensing FILE --out OUT",
    "fly FILE --out OUT",
    "fly iss-station --sensing FILE --out OUT",
    "campaign FILE --missions 1 --out OUT",
    "campaign merge FILE --out OUT",
    "replay FILE",
    "check FILE",
    "check FILE --repair OUT",
    "identify LOG --export OUT --patch FILE",
    "allocate FILE",
    "realize FILE",
];

/// What of these a command may take after all: a table is a table to `convert`, and sensors of which nothing is said are the usual ones.
const SOUND: [(&str, &[&str]); 4] = [
    ("check", &["robot.urdf"]),
    ("convert", &["header.csv", "one-row.csv", "back-in-time.csv", "quotes.csv"]),
    ("sensing show", &["format-only.toml"]),
    ("--sensing", &["format-only.toml"]),
];

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(bytes).unwrap();
    packed.finish().unwrap()
}

/// Names and contents that are no file of any kind.
fn bad_files() -> Vec<(&'static str, Vec<u8>)> {
    let text = |text: &str| text.as_bytes().to_vec();
    let header = "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,f_x,f_y,f_z,tau_x,tau_y,tau_z\n";
    let noise: Vec<u8> = (0..4096_u32).map(|k| k.wrapping_mul(2_654_435_761).to_le_bytes()[2]).collect();
    vec![
        ("empty", Vec::new()),
        ("empty.toml", Vec::new()),
        ("line-end.csv", text("\n")),
        ("blanks.csv", text(&" \t\r\n".repeat(100))),
        ("zeros.bin", vec![0; 5000]),
        ("noise.bin", noise.clone()),
        ("noise.bag", [b"#ROSBAG V2.0\n".as_slice(), &noise].concat()),
        ("noise.mcap", [b"\x89MCAP0\r\n".as_slice(), &noise].concat()),
        ("only-magic.mcap", b"\x89MCAP0\r\n".to_vec()),
        ("noise.ulg", [b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".as_slice(), &noise].concat()),
        ("only-header.ulg", b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec()),
        ("half-header.ulg", b"ULog\x01\x12\x35\x01".to_vec()),
        ("later.ulg", b"ULog\x01\x12\x35\x02\0\0\0\0\0\0\0\0".to_vec()),
        ("old.bag", text("#ROSBAG V1.2\n")),
        ("database.db3", text("SQLite format 3\0")),
        ("picture.png", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec()),
        ("noise.csv.gz", [[0x1f, 0x8b, 8, 0].as_slice(), &noise].concat()),
        ("cut.csv.gz", gzip(header.as_bytes())[..30].to_vec()),
        ("bomb.csv.gz", gzip(&vec![b'1'; 20_000_000])),
        ("nothing.csv.gz", gzip(b"")),
        ("wide.csv", header.encode_utf16().flat_map(u16::to_le_bytes).collect()),
        (
            "marked-wide.csv",
            [[0xff, 0xfe].to_vec(), header.encode_utf16().flat_map(u16::to_le_bytes).collect()].concat(),
        ),
        ("latin.toml", b"format = 1\nname = \"caf\xe9\"\n".to_vec()),
        ("mark.csv", text("\u{feff}")),
        ("header.csv", text(header)),
        ("one-row.csv", text(&format!("{header}0,0,0,0,0,0,0,1,0,0,0,0,0,0\n"))),
        ("words.csv", text(&format!("{header}{}\n", ["word"; 14].join(",")))),
        ("no-numbers.csv", text(&format!("{header}{}\n", ["nan"; 14].join(",")))),
        ("short-rows.csv", text(&format!("{header}0,1\n1\n"))),
        (
            "back-in-time.csv",
            text(&format!("{header}{}{}", "1,0,0,0,0,0,0,1,0,0,0,0,0,0\n", "0,0,0,0,0,0,0,1,0,0,0,0,0,0\n")),
        ),
        ("long-line.csv", [header.as_bytes(), &vec![b'9'; 300_000]].concat()),
        ("many-columns.csv", text(&(0..20_000).map(|k| format!("c{k}")).collect::<Vec<_>>().join(","))),
        ("quotes.csv", text("\"t_s\",\"p_x\n0,0\n")),
        ("format-2.toml", text("format = 2\nname = \"a\"\n")),
        ("format-only.toml", text("format = 1\n")),
        ("unknown-key.toml", text("format = 1\nname = \"a\"\nduration_s = 10.0\nwarp = 9\n")),
        ("not-a-number.toml", text("format = 1\nname = \"a\"\nduration_s = nan\nmass_kg = nan\n")),
        (
            "infinite.toml",
            text("mass_kg = inf\ncom_m = [inf, 0, 0]\ninertia_about_com_kg_m2 = [[1,0,0],[0,1,0],[0,0,1]]\n"),
        ),
        (
            "negative.toml",
            text("mass_kg = -1\ncom_m = [0, 0, 0]\ninertia_about_com_kg_m2 = [[1,0,0],[0,1,0],[0,0,1]]\n"),
        ),
        (
            "no-triangle.toml",
            text("mass_kg = 1\ncom_m = [0, 0, 0]\ninertia_about_com_kg_m2 = [[9,0,0],[0,1,0],[0,0,1]]\n"),
        ),
        (
            "long-array.toml",
            text("mass_kg = 1\ncom_m = [0, 0, 0, 0]\ninertia_about_com_kg_m2 = [[1,0,0],[0,1,0],[0,0,1]]\n"),
        ),
        ("dates.toml", text("format = 1979-05-27\n")),
        ("twice.toml", text("format = 1\nformat = 1\n")),
        ("deep.toml", text(&format!("a = {}{}\n", "[".repeat(20_000), "]".repeat(20_000)))),
        ("deep.json", text(&"[".repeat(100_000))),
        ("huge-number.toml", text("format = 1\nduration_s = 1e999\nseed = 99999999999999999999999\n")),
        ("large.toml", text(&"# nothing\n".repeat(200_000))),
        ("null.json", text("null")),
        ("robot.urdf", text("<robot name='a'><link name='b'/></robot>")),
        ("open.urdf", text("<robot name='a'><link name='b'>")),
        ("laughs.xml", text("<!DOCTYPE r [<!ENTITY a 'ha'><!ENTITY b '&a;&a;&a;&a;'>]><robot>&b;</robot>")),
        ("deep.xml", text(&format!("<mujoco><worldbody>{}", "<body>".repeat(60_000)))),
        (
            "closed-deep.xml",
            text(&format!(
                "<mujoco><worldbody>{}{}</worldbody></mujoco>",
                "<body>".repeat(60_000),
                "</body>".repeat(60_000)
            )),
        ),
        ("long-attribute.urdf", text(&format!("<robot name='{}'/>", "a".repeat(900_000)))),
        (
            "no-number.urdf",
            text(
                "<robot name='a'><link name='b'><inertial><mass value='nan'/><inertia ixx='1e999'/></inertial></link></robot>",
            ),
        ),
        ("page.html", text("<!doctype html><html><body>no record</body></html>")),
        ("record.html", text("<script type=\"application/json\" id=\"mission\">{\"summary\":null}</script>")),
        ("with \n a line end.csv", text("a,b\n1,2\n")),
    ]
}

#[test]
fn no_command_takes_what_is_no_file_of_its_kind() {
    let folder = scratch("bad-inputs");
    fs::create_dir(folder.join("files")).unwrap();
    let mut named: Vec<String> =
        ["absent.csv", "", ".", "/dev/null", "/dev/zero", "files/loop", "files/hanging"].map(String::from).to_vec();
    for (name, bytes) in bad_files() {
        let path = Path::new("files").join(name);
        fs::write(folder.join(&path), bytes).unwrap();
        named.push(path.to_str().unwrap().to_owned());
    }
    std::os::unix::fs::symlink("loop", folder.join("files/loop")).unwrap();
    std::os::unix::fs::symlink("nowhere", folder.join("files/hanging")).unwrap();
    let log = folder.join("log.csv");
    let template = Command::new(env!("CARGO_BIN_EXE_tumble")).args(["identify", "--template"]).output().unwrap();
    fs::write(&log, template.stdout).unwrap();
    let thruster = "format = 1\n[[thruster]]\ncolumn = \"actuator_motors.control[0]\"\nposition_m = [0, 0.1, 0]\ndirection = [1, 0, 0]\nthrust_n = 1.0\n";
    fs::write(folder.join("actuators.toml"), thruster).unwrap();
    let cases: Vec<(&str, &String)> =
        COMMANDS.iter().flat_map(|command| named.iter().map(move |file| (*command, file))).collect();
    let (next, wrong) = (AtomicUsize::new(0), std::sync::Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(2, usize::from) {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    let Some((command, file)) = cases.get(k) else { break };
                    if let Some(why) = misbehaves(&folder, command, file, k) {
                        wrong.lock().unwrap().push(format!("{command}, {file:?}: {why}"));
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
    assert!(cases.len() >= 1500, "{}", cases.len());
}

fn misbehaves(folder: &Path, command: &str, file: &str, number: usize) -> Option<String> {
    // Address space, not memory: 1.5 GB of it are enough for 0.5 GB. A panic ends with 101, a hang with 124.
    let script = "ulimit -v 1500000; exec timeout 10 \"$0\" \"$@\"";
    let out = format!("out-{number}");
    let words = command.split(' ').map(|word| match word {
        "FILE" => file.to_owned(),
        "LOG" => "log.csv".to_owned(),
        word => word.replace("OUT", &out),
    });
    let output = Command::new("sh")
        .args(["-c", script, env!("CARGO_BIN_EXE_tumble")])
        .args(words)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    let is_sound =
        |(part, files): &(&str, &[&str])| command.contains(part) && files.iter().any(|name| file.ends_with(name));
    if output.status.success() && SOUND.iter().any(is_sound) {
        return None;
    }
    if output.status.code() != Some(2) {
        return Some(format!("{}: {}", output.status, said.chars().take(300).collect::<String>()));
    }
    let is_told = said.contains("remedy:") || said.contains("error:");
    if !is_told || said.contains("panicked") {
        return Some(format!("no remedy: {said}"));
    }
    if said.len() > 20_000 {
        return Some(format!("{} bytes of message", said.len()));
    }
    let left: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .filter_map(|entry| entry.unwrap().file_name().into_string().ok())
        .filter(|name| name.starts_with(&format!("{out}.")) || *name == out)
        .collect();
    (!left.is_empty()).then(|| format!("left {left:?}"))
}
