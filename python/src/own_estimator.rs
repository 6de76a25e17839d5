//! An estimator that is written in Python.

use crate::arrays::{Row, Rows, bad_argument, matrix, numbers, of_rows, of_vector};
use crate::error::TumbleError;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods as _};
use program::cli::identify::OwnEstimator;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeSet;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use tumble_dynamics::nalgebra::SVector;
use tumble_identification::estimator::{Estimator, EstimatorError, Finding};
use tumble_identification::{MotionSample, WrenchRow};

/// What an estimator is told: equations `regressor @ parameters = wrench`, and the record that they are of.
#[pyclass(frozen, module = "tumble")]
pub struct Problem {
    posed: tumble_identification::Problem,
    rows: Vec<WrenchRow>,
    record: Vec<MotionSample>,
}

/// Of a row, in the order of Python's arrays: force before torque.
const FORCE_FIRST: [usize; 6] = [3, 4, 5, 0, 1, 2];

#[pymethods]
impl Problem {
    /// Time of each equation, s.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let time_s = |row: &WrenchRow| {
            self.record.get(row.index).map_or(f64::NAN, |sample| tumble_formats::log::seconds(sample.time_ns))
        };
        PyArray1::from_vec(py, self.rows.iter().map(time_s).collect())
    }

    /// (N, 6, 10): rows force x y z and torque x y z; columns mass, first moments x y z, inertia about the origin xx xy xz yy yz zz.
    #[getter]
    fn regressor<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let flat = self
            .rows
            .iter()
            .flat_map(|row| FORCE_FIRST.into_iter().flat_map(move |i| (0..10).map(move |j| row.regressor[(i, j)])));
        PyArray1::from_vec(py, flat.collect()).reshape([self.rows.len(), 6, 10])
    }

    /// (N, 6): force, then torque about the body origin, body axes, N and N m.
    #[getter]
    fn wrench<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_rows(py, self.rows.iter().map(|row| FORCE_FIRST.map(|i| row.wrench[i])))
    }

    /// Of how many neighbours the samples of one equation are shared: by so much its covariance is too small.
    #[getter]
    fn rows_alike(&self) -> f64 {
        self.posed.rows_alike()
    }

    /// Size of each parameter for a body of the size that the record shows.
    #[getter]
    fn magnitudes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        of_vector(py, &self.posed.scale.parameter_magnitudes())
    }

    /// The record: `t`, `position`, `quaternion`, `rate`, `velocity`, `acceleration`, `wrench`, as `identify` takes them.
    #[getter]
    fn record<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let arrays = PyDict::new(py);
        let each = || self.record.iter();
        let times = each().map(|sample| tumble_formats::log::seconds(sample.time_ns)).collect();
        arrays.set_item("t", PyArray1::from_vec(py, times))?;
        let missing = [f64::NAN; 3];
        let position =
            |sample: &MotionSample| sample.world_from_body.map_or(missing, |pose| pose.translation.vector.into());
        arrays.set_item("position", of_rows(py, each().map(position))?)?;
        let xyzw =
            |sample: &MotionSample| sample.world_from_body.map_or([f64::NAN; 4], |pose| pose.rotation.coords.into());
        arrays.set_item("quaternion", of_rows(py, each().map(xyzw))?)?;
        arrays.set_item("rate", of_rows(py, each().map(|sample| sample.rate_body.map_or(missing, Into::into)))?)?;
        let velocity = |sample: &MotionSample| sample.velocity_origin_world.map_or(missing, Into::into);
        arrays.set_item("velocity", of_rows(py, each().map(velocity))?)?;
        let acceleration = |sample: &MotionSample| sample.acceleration_origin_body.map_or(missing, Into::into);
        arrays.set_item("acceleration", of_rows(py, each().map(acceleration))?)?;
        let wrench = |sample: &MotionSample| {
            sample.wrench_body.map_or([f64::NAN; 6], |wrench| FORCE_FIRST.map(|i| wrench.to_vector()[i]))
        };
        arrays.set_item("wrench", of_rows(py, each().map(wrench))?)?;
        Ok(arrays)
    }
}

/// What an estimator raised, kept for the error that comes out of the library.
#[derive(Clone, Default)]
pub struct Fault(Arc<Mutex<Option<PyErr>>>);

impl Fault {
    /// What was raised, once.
    pub fn take(&self) -> Option<PyErr> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn keep(&self, error: PyErr) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
    }
}

/// An object with a method `estimate`, and its name.
pub struct Own {
    name: &'static str,
    object: Arc<Py<PyAny>>,
    /// What it raises.
    pub fault: Fault,
}

/// Names of estimators, which results keep for ever: one text for each.
static NAMES: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());

fn kept(name: &str) -> &'static str {
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = names.get(name) {
        return known;
    }
    let name: &'static str = Box::leak(name.to_owned().into_boxed_str());
    names.insert(name);
    name
}

impl Own {
    /// The estimator that an object is.
    ///
    /// # Errors
    /// One without a method `estimate`.
    pub fn of(object: &Bound<'_, PyAny>) -> PyResult<Self> {
        let name: String = match object.getattr_opt("name")? {
            Some(name) => name.extract()?,
            None => object.get_type().name()?.extract()?,
        };
        if !object.getattr_opt("estimate")?.is_some_and(|method| method.is_callable()) {
            return Err(bad_argument(&format!("the estimator `{name}` has no method `estimate(problem)`")));
        }
        Ok(Self { name: kept(&name), object: Arc::new(object.clone().unbind()), fault: Fault::default() })
    }

    /// As the library takes it.
    pub fn into_estimator(self) -> OwnEstimator {
        let Self { name, object, fault } = self;
        let make = move |problem: &tumble_identification::Problem| {
            let (object, fault, problem) = (object.clone(), fault.clone(), *problem);
            let estimator: Box<dyn Estimator<Record = [MotionSample]> + Send + Sync> =
                Box::new(InPython { name, object, fault, problem });
            Ok(estimator)
        };
        OwnEstimator { name, make: Box::new(make) }
    }
}

struct InPython {
    name: &'static str,
    object: Arc<Py<PyAny>>,
    fault: Fault,
    problem: tumble_identification::Problem,
}

/// What an exception says.
#[derive(Debug)]
struct Raised(String);

impl fmt::Display for Raised {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Raised {}

impl InPython {
    fn asked(
        &self,
        py: Python<'_>,
        problem: Problem,
    ) -> PyResult<([f64; 10], tumble_dynamics::nalgebra::SMatrix<f64, 10, 10>)> {
        let answer = self.object.bind(py).call_method1("estimate", (problem,))?;
        let Ok((parameters, covariance)) = answer.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>() else {
            let what = answer.get_type().name()?;
            return Err(bad_argument(&format!("`estimate` gave {what} in place of (parameters, covariance)")));
        };
        let parameters = numbers("parameters", &Row::extract(parameters.as_borrowed())?)?;
        Ok((parameters, matrix("covariance", &Rows::extract(covariance.as_borrowed())?)?))
    }
}

impl Estimator for InPython {
    type Record = [MotionSample];

    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        let problem = Problem { posed: self.problem, rows: self.problem.rows(record)?, record: record.to_vec() };
        let asked = Python::attach(|py| {
            self.asked(py, problem).map_err(|error| {
                let is_ours = error.is_instance_of::<TumbleError>(py);
                let message = error.value(py).getattr("message").and_then(|message| message.extract());
                let text = if is_ours { message.unwrap_or_default() } else { error.to_string() };
                self.fault.keep(error);
                EstimatorError::foreign(self.name, Raised(text))
            })
        });
        let (parameters, covariance) = asked?;
        Finding::of_covariance(SVector::from(parameters), &covariance, self.problem.scale.parameter_magnitudes())
    }
}
