//! `cargo xtask report-check [FILE]`: a mission report in a real browser that cannot reach anything.
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

/// How long a page may take to look at itself.
const PATIENCE: Duration = Duration::from_secs(60);

pub fn main(arguments: &[String]) -> ExitCode {
    let (mut file, mut pictures) = (None, None);
    let mut words = arguments.iter();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--screenshots" => pictures = words.next().map(PathBuf::from),
            option if option.starts_with('-') => {
                eprintln!("unknown option `{option}`: cargo xtask report-check [FILE] [--screenshots DIR]");
                return ExitCode::from(2);
            }
            path => file = Some(PathBuf::from(path)),
        }
    }
    match run(file.as_deref(), pictures.as_deref()) {
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

fn run(file: Option<&Path>, pictures: Option<&Path>) -> Outcome {
    let Some(program) = browser::find() else {
        let reason = "no browser (set TUMBLE_BROWSER, or install Chromium)".to_owned();
        let is_required = std::env::var_os("TUMBLE_REQUIRE_BROWSER").is_some_and(|value| value == "1");
        return if is_required { Outcome::Failed(reason) } else { Outcome::Skipped(reason) };
    };
    match check(&program, file, pictures) {
        Ok(findings) if findings.is_empty() => Outcome::Ok,
        Ok(findings) => Outcome::Failed(findings.join("\n")),
        Err(error) => Outcome::Failed(error),
    }
}

/// The files to look at: the one named, or reports of missions that were never flown, in space and on a table.
fn reports(file: Option<&Path>) -> Result<Vec<PathBuf>, String> {
    if let Some(path) = file {
        return Ok(vec![path.canonicalize().map_err(|error| format!("{}: {error}", path.display()))?]);
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
        written.push(path.canonicalize().map_err(|error| error.to_string())?);
    }
    Ok(written)
}

fn check(program: &Path, file: Option<&Path>, pictures: Option<&Path>) -> Result<Vec<String>, String> {
    let mut findings = Vec::new();
    let browser = Browser::start(program)?;
    for report in reports(file)? {
        for setting in &SETTINGS {
            let started = Instant::now();
            let mut page = browser.page()?;
            let name = format!("{} ({})", report.file_name().unwrap_or_default().to_string_lossy(), setting.name);
            let found = look(&mut page, &report, setting)?;
            if let Some(folder) = pictures {
                let stem = report.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                page.screenshot(&folder.join(format!("{stem}-{}.png", setting.name)))?;
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
