//! `cargo xtask report-check [FILE...]`: pages of results in a real browser that cannot reach anything; of every kind where none is named.
//!
//! The page has a mode in which it looks at itself; this program starts the browser, asks for the outcome in every window that
//! matters, and adds what only the browser knows: errors on its console, requests, and whether the picture differs in time.

mod browser;
mod web_socket;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use crate::command::{Outcome, cargo, target_dir};
use browser::{Browser, Page};

/// A window, and what its user asked for.
struct Setting {
    name: &'static str,
    width: u32,
    height: u32,
    scheme: &'static str,
    motion: &'static str,
}

const SETTINGS: [Setting; 4] = [
    Setting { name: "phone", width: 360, height: 740, scheme: "light", motion: "no-preference" },
    Setting { name: "phone-dark", width: 360, height: 740, scheme: "dark", motion: "reduce" },
    Setting { name: "tablet", width: 800, height: 1100, scheme: "light", motion: "no-preference" },
    Setting { name: "desktop-dark", width: 1366, height: 900, scheme: "dark", motion: "no-preference" },
];

/// Largest page, bytes.
const LARGEST: u64 = 1_500_000;

/// The commands that write a page of each kind, without their `--out`.
const KINDS: [(&str, &str); 10] = [
    ("identify", "identify --demo"),
    ("excite", "excite --fly"),
    ("plan", "plan iss-slalom"),
    ("no-plan", "plan iss-slalom --budget 1"),
    ("plan-local", "plan infoplan --local"),
    ("simulate", "simulate tube-slalom"),
    ("campaign", "campaign iss-cargo granite-cargo --missions 2"),
    ("fly", "fly iss-cargo"),
    ("fly-granite", "fly granite-cargo"),
    ("fly-doubted", "fly iss-cargo --fault nozzle:1"),
];

/// How long a page may take to look at itself.
const PATIENCE: Duration = Duration::from_secs(60);

pub fn main(arguments: &[String]) -> ExitCode {
    let (mut files, mut pictures) = (Vec::new(), None);
    let mut words = arguments.iter();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--screenshots" => pictures = words.next().map(PathBuf::from),
            option if option.starts_with('-') => {
                eprintln!("unknown option `{option}`: cargo xtask report-check [FILE...] [--screenshots DIR]");
                return ExitCode::from(2);
            }
            path => files.push(PathBuf::from(path)),
        }
    }
    match run(&files, pictures.as_deref()) {
        Outcome::Ok => ExitCode::SUCCESS,
        Outcome::Skipped(reason) => {
            println!("skipped: {reason}");
            ExitCode::SUCCESS
        }
        Outcome::Failed(reason) => {
            eprintln!("{reason}");
            ExitCode::FAILURE
        }
    }
}

/// As a step of continuous integration: every kind of page, where a browser is at hand.
pub fn step() -> Outcome {
    run(&[], None)
}

fn run(files: &[PathBuf], pictures: Option<&Path>) -> Outcome {
    let Some(program) = browser::find() else {
        let reason = "no browser (set TUMBLE_BROWSER, or install Chromium)".to_owned();
        let is_required = std::env::var_os("TUMBLE_REQUIRE_BROWSER").is_some_and(|value| value == "1");
        return if is_required { Outcome::Failed(reason) } else { Outcome::Skipped(reason) };
    };
    match check(&program, files, pictures) {
        Ok(findings) if findings.is_empty() => Outcome::Ok,
        Ok(findings) => Outcome::Failed(findings.join("\n")),
        Err(error) => Outcome::Failed(error),
    }
}

/// The files to look at: those named, or one of each kind, and reports of missions that were never flown, in space and on a table.
fn reports(files: &[PathBuf]) -> Result<Vec<PathBuf>, String> {
    let whole = |path: &PathBuf| path.canonicalize().map_err(|error| format!("{}: {error}", path.display()));
    if !files.is_empty() {
        return files.iter().map(whole).collect();
    }
    let folder = target_dir().join("report-check");
    std::fs::create_dir_all(&folder).map_err(|error| error.to_string())?;
    let mut written = Vec::new();
    for kind in ["free", "planar"] {
        let path = folder.join(format!("{kind}.html"));
        let mut example = cargo("run --quiet --package tumble --example sample_report --");
        let status = example.arg(&path).arg(kind).status().map_err(|error| error.to_string())?;
        if !status.success() {
            return Err("the sample report cannot be written".into());
        }
        written.push(whole(&path)?);
    }
    for (kind, arguments) in KINDS {
        let out = folder.join(kind);
        let mut command = cargo("run --quiet --package tumble --");
        command.args(arguments.split(' ')).arg("--force").arg("--out").arg(&out);
        // What is asked for may not be achieved; the page says so.
        let ended = command.output().map_err(|error| error.to_string())?;
        if !matches!(ended.status.code(), Some(0 | 3)) {
            return Err(format!("tumble {arguments}: {}", String::from_utf8_lossy(&ended.stderr)));
        }
        // A name for each, by which findings and pictures are told apart.
        let path = folder.join(format!("{kind}.html"));
        std::fs::copy(out.join("report.html"), &path).map_err(|error| format!("tumble {arguments}: {error}"))?;
        written.push(whole(&path)?);
    }
    Ok(written)
}

/// What tells a page from the others: pages in folders of results have one name.
fn name_of(report: &Path) -> String {
    let stem = report.file_stem().unwrap_or_default();
    let named = if stem == "report" { report.parent().and_then(Path::file_name).unwrap_or(stem) } else { stem };
    named.to_string_lossy().into_owned()
}

fn check(program: &Path, files: &[PathBuf], pictures: Option<&Path>) -> Result<Vec<String>, String> {
    let mut findings = Vec::new();
    let browser = Browser::start(program)?;
    for report in reports(files)? {
        let bytes = std::fs::metadata(&report).map_err(|error| error.to_string())?.len();
        if bytes > LARGEST {
            findings.push(format!("{}: {bytes} bytes", report.display()));
        }
        for setting in &SETTINGS {
            let started = Instant::now();
            let mut page = browser.page()?;
            let name = format!("{} ({})", name_of(&report), setting.name);
            let found = look(&mut page, &report, setting)?;
            if let Some(folder) = pictures {
                page.screenshot(&folder.join(format!("{}-{}.png", name_of(&report), setting.name)))?;
            }
            println!(
                "{name}: {} in {:.1} s",
                if found.is_empty() { "good" } else { "BAD" },
                started.elapsed().as_secs_f64()
            );
            findings.extend(found.into_iter().map(|finding| format!("{name}: {finding}")));
        }
    }
    Ok(findings)
}

fn look(page: &mut Page, report: &Path, setting: &Setting) -> Result<Vec<String>, String> {
    page.prepare(setting.width, setting.height, setting.scheme, setting.motion)?;
    page.open(&format!("file://{}#self-test", report.display()))?;
    let started = Instant::now();
    let outcome = loop {
        let text = page.evaluate("(document.getElementById('self-test-outcome') || {textContent: ''}).textContent")?;
        if text.ends_with("end of self-test") {
            break text;
        }
        if started.elapsed() > PATIENCE {
            return Ok(vec![format!("the self-test does not end; so far: {:?}", page.troubles())]);
        }
        std::thread::sleep(Duration::from_millis(100));
    };
    let mut findings = page.troubles();
    if !outcome.starts_with(&format!("self-test at {} px: passed", setting.width)) {
        findings.extend(outcome.lines().filter(|line| *line != "end of self-test").map(str::to_owned));
    }
    if page.evaluate("typeof missionPage")? != "object" {
        return Ok(findings);
    }
    // Not by the page's own word: two moments must look different from outside as well.
    page.evaluate(
        "document.getElementById('self-test-outcome').remove(); document.getElementById('view').scrollIntoView(); missionPage.seek(0.2 * missionPage.end); ''",
    )?;
    let first = page.picture()?;
    page.evaluate("missionPage.seek(0.8 * missionPage.end); ''")?;
    if page.picture()? == first {
        findings.push("the page looks the same at two moments of the playback".into());
    }
    page.evaluate("missionPage.seek(0.35 * missionPage.end); ''")?;
    Ok(findings)
}
