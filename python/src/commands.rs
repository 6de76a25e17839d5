//! `simulate`, `fly`, `plan`, `excite`, `sample`: the commands as functions.

use crate::arrays::bad_argument;
use crate::error::{raised, refused};
use numpy::PyArray1;
use program::cli::Outcome;
use program::{TumbleError, answer, robots};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use tumble_formats::FormatsError;

/// Options as the command line takes them.
#[derive(Default)]
pub struct Options {
    /// One after the other.
    pub words: Vec<OsString>,
}

impl Options {
    /// `--name=value`, where there is one.
    pub fn value(&mut self, name: &str, value: Option<&(impl AsRef<std::ffi::OsStr> + ?Sized)>) {
        if let Some(value) = value {
            let mut word = OsString::from(format!("--{name}="));
            word.push(value);
            self.words.push(word);
        }
    }

    /// The same of a number.
    fn number(&mut self, name: &str, value: Option<impl ToString>) {
        self.value(name, value.map(|value| value.to_string()).as_ref());
    }

    /// `--name`, where it is so.
    pub fn flag(&mut self, name: &str, is_so: bool) {
        if is_so {
            self.words.push(format!("--{name}").into());
        }
    }

    /// What the command is about; last, since nothing behind it is an option.
    pub fn operand(&mut self, value: impl Into<OsString>) {
        self.words.extend([OsString::from("--"), value.into()]);
    }
}

/// What a command gave: its summary, its series, and the files that it wrote to a temporary folder.
#[pyclass(frozen, module = "tumble")]
pub struct Run {
    summary: String,
    messages: String,
    is_achieved: bool,
    place: TemporaryFolder,
}

/// Removed with the object, or when Python ends.
struct TemporaryFolder(PathBuf);

impl TemporaryFolder {
    fn new(py: Python<'_>) -> PyResult<Self> {
        let path: PathBuf = py.import("tempfile")?.call_method1("mkdtemp", (py.None(), "tumble-"))?.extract()?;
        let remove = py.import("shutil")?.getattr("rmtree")?;
        py.import("atexit")?.call_method1("register", (remove, &path, true))?;
        Ok(Self(path))
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        // What cannot be removed is left to the system, which empties its temporary folder.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Tables of a command, the first one that is there its series.
const TABLES: [&str; 4] = ["log.csv", "local_plan.csv", "plan.csv", "motion.csv"];

/// Name of the command's folder in the temporary one.
const RESULT: &str = "result";

/// What of a summary says where the result was for a while.
const OF_THE_FOLDER: &str = "folder";

#[pymethods]
impl Run {
    /// The object that the command prints with `--json`, without the name of its folder.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let summary = py.import("json")?.call_method1("loads", (&self.summary,))?;
        summary.call_method1("pop", (OF_THE_FOLDER, py.None()))?;
        Ok(summary)
    }

    /// Whether what was asked for was achieved: exit code 0 of the command line.
    #[getter]
    fn achieved(&self) -> bool {
        self.is_achieved
    }

    /// What the command said beside its result.
    #[getter]
    fn messages(&self) -> Vec<&str> {
        self.messages.lines().filter(|line| !line.starts_with("wrote ")).collect()
    }

    /// Every column of the flight's log, of the plan or of the motion, by its name; NaN where a cell is empty.
    #[getter]
    fn series<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        match TABLES.iter().find(|name| self.folder().join(name).exists()) {
            Some(name) => self.table(py, name),
            None => Ok(PyDict::new(py)),
        }
    }

    /// The columns of one of the `files`, such as "motion.csv".
    fn table<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
        let path = self.own(name)?;
        let (names, columns) = py.detach(|| columns(&path)).map_err(|error| raised(&error))?;
        let arrays = PyDict::new(py);
        for (name, column) in names.iter().zip(columns) {
            arrays.set_item(name, PyArray1::from_vec(py, column))?;
        }
        Ok(arrays)
    }

    /// Names of all files that the command wrote.
    #[getter]
    fn files(&self) -> PyResult<Vec<String>> {
        let unreadable = |source| raised(&FormatsError::Unreadable { path: self.folder(), source }.into());
        let entries = fs::read_dir(self.folder()).map_err(unreadable)?;
        let mut names: Vec<String> =
            entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        Ok(names)
    }

    /// Writes the page of the flight to a new file.
    #[pyo3(signature = (path, *, force = false))]
    fn report(&self, path: PathBuf, force: bool) -> PyResult<()> {
        self.copied("report.html", &path, force)
    }

    /// Writes one of the `files` to a new file.
    #[pyo3(signature = (name, path, *, force = false))]
    fn save(&self, name: &str, path: PathBuf, force: bool) -> PyResult<()> {
        self.copied(name, &path, force)
    }

    fn __repr__(&self) -> String {
        format!(
            "Run(achieved={}, files={:?})",
            if self.is_achieved { "True" } else { "False" },
            self.files().unwrap_or_default()
        )
    }
}

impl Run {
    /// Where the files are.
    fn folder(&self) -> PathBuf {
        self.place.0.join(RESULT)
    }

    /// The place of a file that the command wrote.
    fn own(&self, name: &str) -> PyResult<PathBuf> {
        let files = self.files()?;
        if files.iter().any(|file| file == name) {
            return Ok(self.folder().join(name));
        }
        Err(refused("T014", &format!("this command wrote no `{name}`"), &format!("it wrote {}", files.join(", "))))
    }

    fn copied(&self, name: &str, path: &Path, force: bool) -> PyResult<()> {
        let own = self.own(name)?;
        let contents =
            fs::read(&own).map_err(|source| raised(&FormatsError::Unreadable { path: own.clone(), source }.into()))?;
        program::output::write_file(path, &contents, force).map_err(|error| raised(&error))
    }

    /// Runs a command into a folder that is removed with the result.
    fn of(py: Python<'_>, command: &str, options: Options) -> PyResult<Self> {
        let place = TemporaryFolder::new(py)?;
        let folder = place.0.join(RESULT);
        let mut words = vec![OsString::from("tumble"), command.into(), "--json".into()];
        let mut out = OsString::from("--out=");
        out.push(&folder);
        words.push(out);
        words.extend(options.words);
        let answer = py.detach(|| answer(words, &robots::shipped())).map_err(|error| raised(&error))?;
        Ok(Self {
            summary: answer.said.stdout,
            messages: answer.said.stderr,
            is_achieved: answer.outcome == Outcome::Achieved,
            place,
        })
    }
}

/// Names of the columns of a table of numbers, and what stands in each.
fn columns(path: &Path) -> Result<(Vec<String>, Vec<Vec<f64>>), TumbleError> {
    let text = fs::read_to_string(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<String> = lines.next().unwrap_or_default().split(',').map(str::to_owned).collect();
    let mut columns = vec![Vec::new(); names.len()];
    for line in lines {
        let mut cells = line.split(',');
        for column in &mut columns {
            column.push(cells.next().and_then(|cell| cell.parse().ok()).unwrap_or(f64::NAN));
        }
    }
    Ok((names, columns))
}

/// Flies a scenario, as `tumble simulate`: `series` are the columns of its log.
#[pyfunction]
#[pyo3(signature = (scenario, *, seed=None, duration=None, sensing=None))]
pub fn simulate(
    py: Python<'_>,
    scenario: PathBuf,
    seed: Option<u64>,
    duration: Option<f64>,
    sensing: Option<PathBuf>,
) -> PyResult<Run> {
    let mut options = Options::default();
    options.number("seed", seed);
    options.number("duration", duration);
    options.value("sensing", sensing.as_ref());
    options.operand(scenario);
    Run::of(py, "simulate", options)
}

/// Flies a mission by what the robot learns of itself, as `tumble fly`; `report(path)` writes its page.
#[pyfunction]
#[pyo3(signature = (scenario=None, *, seed=None, fault=None, sensing=None, weighting=None, feedback=true, model=None, draw=false))]
#[allow(clippy::too_many_arguments, reason = "keywords of Python")]
pub fn fly(
    py: Python<'_>,
    scenario: Option<PathBuf>,
    seed: Option<u64>,
    fault: Option<String>,
    sensing: Option<PathBuf>,
    weighting: Option<String>,
    feedback: bool,
    model: Option<String>,
    draw: bool,
) -> PyResult<Run> {
    let mut options = Options::default();
    options.number("seed", seed);
    options.value("fault", fault.as_ref());
    options.value("sensing", sensing.as_ref());
    options.value("weighting", weighting.as_ref());
    options.value("feedback", (!feedback).then_some("off"));
    options.value("model", model.as_ref());
    options.flag("draw", draw);
    if let Some(scenario) = scenario {
        options.operand(scenario);
    }
    Run::of(py, "fly", options)
}

/// A way from start to goal, as `tumble plan`; with `local` the first seconds of it in detail.
#[pyfunction]
#[pyo3(signature = (scenario, *, seed=None, objective=None, planner=None, budget=None, time_limit=None, obstacle_set=None, first=false,
    local=false, weighting=None, criterion=None, unknowns=None, steps=None))]
#[allow(clippy::too_many_arguments, clippy::fn_params_excessive_bools, reason = "keywords of Python")]
pub fn plan(
    py: Python<'_>,
    scenario: PathBuf,
    seed: Option<u64>,
    objective: Option<String>,
    planner: Option<String>,
    budget: Option<u64>,
    time_limit: Option<f64>,
    obstacle_set: Option<u8>,
    first: bool,
    local: bool,
    weighting: Option<String>,
    criterion: Option<String>,
    unknowns: Option<String>,
    steps: Option<usize>,
) -> PyResult<Run> {
    let mut options = Options::default();
    options.number("seed", seed);
    options.value("objective", objective.as_ref());
    options.value("planner", planner.as_ref());
    options.number("budget", budget);
    options.number("time-limit", time_limit);
    options.number("obstacle-set", obstacle_set);
    options.flag("first", first);
    options.flag("local", local);
    options.value("weighting", weighting.as_ref());
    options.value("criterion", criterion.as_ref());
    options.value("unknowns", unknowns.as_ref());
    options.number("steps", steps);
    options.operand(scenario);
    Run::of(py, "plan", options)
}

/// A periodic motion that shows all ten parameters, as `tumble excite`; with `fly` its simulated flight, whose log is `series`.
#[pyfunction]
#[pyo3(signature = (*, period=None, harmonics=None, criterion=None, starts=None, seed=None, rate=None, cycles=None, position=None,
    angle=None, speed=None, angular_rate=None, acceleration=None, angular_acceleration=None, planar=false, body=None, force_limit=None,
    torque_limit=None, saturate=false, position_noise=None, attitude_noise=None, force_noise=None, torque_noise=None, fly=false,
    payload=None))]
#[allow(clippy::too_many_arguments, clippy::fn_params_excessive_bools, reason = "keywords of Python")]
pub fn excite(
    py: Python<'_>,
    period: Option<f64>,
    harmonics: Option<usize>,
    criterion: Option<String>,
    starts: Option<usize>,
    seed: Option<u64>,
    rate: Option<f64>,
    cycles: Option<usize>,
    position: Option<[f64; 3]>,
    angle: Option<f64>,
    speed: Option<f64>,
    angular_rate: Option<f64>,
    acceleration: Option<f64>,
    angular_acceleration: Option<f64>,
    planar: bool,
    body: Option<PathBuf>,
    force_limit: Option<f64>,
    torque_limit: Option<f64>,
    saturate: bool,
    position_noise: Option<f64>,
    attitude_noise: Option<f64>,
    force_noise: Option<f64>,
    torque_noise: Option<f64>,
    fly: bool,
    payload: Option<PathBuf>,
) -> PyResult<Run> {
    let mut options = Options::default();
    let numbers = [
        ("period", period),
        ("rate", rate),
        ("angle", angle),
        ("speed", speed),
        ("angular-rate", angular_rate),
        ("acceleration", acceleration),
        ("angular-acceleration", angular_acceleration),
        ("force-limit", force_limit),
        ("torque-limit", torque_limit),
        ("position-noise", position_noise),
        ("attitude-noise", attitude_noise),
        ("force-noise", force_noise),
        ("torque-noise", torque_noise),
    ];
    for (name, number) in numbers {
        options.number(name, number);
    }
    options.number("harmonics", harmonics);
    options.value("criterion", criterion.as_ref());
    options.number("starts", starts);
    options.number("seed", seed);
    options.number("cycles", cycles);
    options.value("position", position.map(|[x, y, z]| format!("{x},{y},{z}")).as_ref());
    options.flag("planar", planar);
    options.value("body", body.as_ref());
    options.flag("saturate", saturate);
    options.flag("fly", fly);
    options.value("payload", payload.as_ref());
    Run::of(py, "excite", options)
}

/// Writes files to try the other functions with, as `tumble sample`: "log", "bag" or "wrenches". Says what it wrote.
#[pyfunction]
#[pyo3(signature = (kind, folder, *, seed=None, force=false))]
pub fn sample(py: Python<'_>, kind: &str, folder: PathBuf, seed: Option<u64>, force: bool) -> PyResult<String> {
    if kind.starts_with('-') {
        return Err(bad_argument(&format!("`{kind}` is no kind of sample")));
    }
    let mut options = Options::default();
    options.number("seed", seed);
    options.flag("force", force);
    options.operand(kind);
    options.words.push(folder.into());
    let words = [OsString::from("tumble"), "sample".into()].into_iter().chain(options.words);
    let answer = py.detach(|| answer(words, &robots::shipped())).map_err(|error| raised(&error))?;
    Ok(answer.said.stderr.trim().to_owned())
}
