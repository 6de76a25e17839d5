//! `identify` and `identify_file`: what `tumble identify` finds, of arrays and of files.

use crate::arrays::{Columns, Rows, bad_argument, record, times_ns};
use crate::commands::Options;
use crate::error::raised;
use crate::identification::Identification;
use crate::own_estimator::Own;
use program::cli::captured;
use program::cli::identify::{Found, IdentifyArgs, OwnEstimator};
use program::{TumbleError, robots};
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use std::path::PathBuf;
use tumble_formats::Robots;

/// Options that a log of any kind takes, as those of the command line.
struct Asked {
    method: Option<String>,
    wrench_timing: Option<String>,
    gravity: Option<[f64; 3]>,
    estimate: Option<Vec<String>>,
    prior: Option<PathBuf>,
    planar: Option<bool>,
    sensing: Option<PathBuf>,
    reference: Option<PathBuf>,
    holdout: Option<f64>,
}

impl Asked {
    /// Refuses what an estimator of one's own would not heed.
    fn beside(&self, own: Option<&Own>) -> PyResult<()> {
        let given = [
            (self.method.is_some(), "method"),
            (self.estimate.is_some(), "estimate"),
            (self.sensing.is_some(), "sensing"),
            (self.planar.is_some(), "planar"),
        ];
        match given.iter().find(|(is_given, _)| *is_given && own.is_some()) {
            Some((_, name)) => Err(bad_argument(&format!(
                "`{name}` is nothing to an estimator of one's own: leave it or `estimator` out"
            ))),
            None => Ok(()),
        }
    }

    fn options(&self) -> Options {
        let mut options = Options::default();
        options.value("method", self.method.as_ref());
        options.value("wrench", self.wrench_timing.as_ref());
        options.value("gravity", self.gravity.map(|[x, y, z]| format!("{x},{y},{z}")).as_ref());
        options.value("estimate", self.estimate.as_ref().map(|names| names.join(",")).as_ref());
        options.value("prior", self.prior.as_ref());
        options.flag("planar", self.planar == Some(true));
        options.flag("no-planar", self.planar == Some(false));
        options.value("sensing", self.sensing.as_ref());
        options.value("reference", self.reference.as_ref());
        options.value("holdout", self.holdout.map(|share| share.to_string()).as_ref());
        options
    }
}

/// Identifies without holding the interpreter; what an estimator of Python raises is the cause of the error.
fn identified(
    py: Python<'_>,
    options: Options,
    own: Option<Own>,
    find: impl FnOnce(&IdentifyArgs, &Robots, Option<OwnEstimator>) -> Result<Found, TumbleError> + Send,
) -> PyResult<Identification> {
    let fault = own.as_ref().map(|own| own.fault.clone());
    let own = own.map(Own::into_estimator);
    let work = move || {
        let args = IdentifyArgs::parse(options.words)?;
        // What the reader says on its way stands in the result's warnings.
        captured(|| find(&args, &robots::shipped(), own)).0
    };
    match py.detach(work) {
        Ok(found) => Identification::new(found),
        Err(error) => {
            let error = raised(&error);
            match fault.and_then(|fault| fault.take()) {
                // Ctrl-C in an estimator is no fault of its own.
                Some(end) if !end.is_instance_of::<PyException>(py) => return Err(end),
                Some(cause) => error.set_cause(py, Some(cause)),
                None => {}
            }
            Err(error)
        }
    }
}

/// The body that explains a motion, from arrays of one row per time.
///
/// `t`: s as floats, or ns as integers. `position` (N, 3): of the body origin, world axes, m. `quaternion` (N, 4): world_from_body,
/// x y z w. `wrench` (N, 6): force, then torque about the body origin, body axes, N and N m; all but gravity. Optional: `rate` (N, 3), body axes,
/// rad/s; `velocity` (N, 3) of the origin, world axes, m/s; `acceleration` (N, 3) of the origin, body axes, m/s^2; `stored_momentum` (N, 3) of
/// wheels, body axes, N m s. A row of NaN says that there was no measurement. `estimator` answers in place of a method: an object with
/// `estimate(problem) -> (parameters, covariance)`.
#[pyfunction]
#[pyo3(signature = (t, position, quaternion, wrench, *, rate=None, velocity=None, acceleration=None, stored_momentum=None, method=None,
    wrench_timing=None, gravity=None, estimate=None, prior=None, planar=None, sensing=None, reference=None, holdout=None, estimator=None))]
#[allow(clippy::too_many_arguments, reason = "keywords of Python")]
pub fn identify(
    py: Python<'_>,
    t: &Bound<'_, PyAny>,
    position: Rows<'_>,
    quaternion: Rows<'_>,
    wrench: Rows<'_>,
    rate: Option<Rows<'_>>,
    velocity: Option<Rows<'_>>,
    acceleration: Option<Rows<'_>>,
    stored_momentum: Option<Rows<'_>>,
    method: Option<String>,
    wrench_timing: Option<String>,
    gravity: Option<[f64; 3]>,
    estimate: Option<Vec<String>>,
    prior: Option<PathBuf>,
    planar: Option<bool>,
    sensing: Option<PathBuf>,
    reference: Option<PathBuf>,
    holdout: Option<f64>,
    estimator: Option<&Bound<'_, PyAny>>,
) -> PyResult<Identification> {
    let own = estimator.map(Own::of).transpose()?;
    let asked = Asked { method, wrench_timing, gravity, estimate, prior, planar, sensing, reference, holdout };
    asked.beside(own.as_ref())?;
    let columns = Columns {
        position: &position,
        quaternion: &quaternion,
        wrench: Some(&wrench),
        rate: rate.as_ref(),
        velocity: velocity.as_ref(),
        acceleration: acceleration.as_ref(),
        stored_momentum: stored_momentum.as_ref(),
    };
    let record = record(&times_ns(t)?, &columns)?;
    identified(py, asked.options(), own, move |args, robots, own| Found::of_record(args, record, robots, own))
}

/// The body that explains a log: CSV, ROS 1 bag or MCAP, as `tumble identify LOG` reads it.
#[pyfunction]
#[pyo3(signature = (path, *, method=None, wrench_timing=None, gravity=None, estimate=None, prior=None, planar=None, sensing=None,
    actuators=None, reference=None, holdout=None, reorder=false, robot=None, estimator=None))]
#[allow(clippy::too_many_arguments, reason = "keywords of Python")]
pub fn identify_file(
    py: Python<'_>,
    path: PathBuf,
    method: Option<String>,
    wrench_timing: Option<String>,
    gravity: Option<[f64; 3]>,
    estimate: Option<Vec<String>>,
    prior: Option<PathBuf>,
    planar: Option<bool>,
    sensing: Option<PathBuf>,
    actuators: Option<PathBuf>,
    reference: Option<PathBuf>,
    holdout: Option<f64>,
    reorder: bool,
    robot: Option<String>,
    estimator: Option<&Bound<'_, PyAny>>,
) -> PyResult<Identification> {
    let own = estimator.map(Own::of).transpose()?;
    let asked = Asked { method, wrench_timing, gravity, estimate, prior, planar, sensing, reference, holdout };
    asked.beside(own.as_ref())?;
    let mut options = asked.options();
    options.value("actuators", actuators.as_ref());
    options.flag("reorder", reorder);
    options.value("robot", robot.as_ref());
    options.operand(path);
    identified(py, options, own, Found::of_log)
}
