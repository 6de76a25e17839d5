//! What an identification found, as an object.

use crate::arrays::{of_matrix, of_rows, of_vector, shown, shown_inertia};
use crate::error::{BAD_OPTION, raised, refused};
use numpy::{PyArray1, PyArray2};
use program::cli::identify::Found;
use program::report;
use pyo3::ffi::c_str;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::path::PathBuf;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_formats::body_file;
use tumble_identification::Estimate;
use tumble_identification::estimator::Verdict;

/// One standard deviation of each quantity; NaN where the log does not determine it.
#[pyclass(frozen, module = "tumble")]
pub struct Sigma {
    /// Of the mass, kg.
    #[pyo3(get)]
    mass: f64,
    center_of_mass: Vector3<f64>,
    inertia: Matrix3<f64>,
}

#[pymethods]
impl Sigma {
    /// Of the centre of mass, body axes, m.
    #[getter]
    fn center_of_mass<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        of_vector(py, &self.center_of_mass)
    }

    /// Of the inertia about the centre of mass, body axes, kg m^2.
    #[getter]
    fn inertia<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_matrix(py, &self.inertia)
    }
}

impl Sigma {
    /// Of an estimate, of which these are known: mass, centre of mass, xx, yy, zz, xy, xz, yz.
    pub fn of(estimate: &Estimate, determined: &[bool; 10]) -> Self {
        Self {
            mass: if determined[0] { estimate.std.mass_kg } else { f64::NAN },
            center_of_mass: shown(&estimate.std.center_of_mass_m, &determined[1..4]),
            inertia: shown_inertia(&estimate.std.inertia_about_com_kg_m2, &determined[4..]),
        }
    }
}

/// What a log says of the body. Numbers that it does not determine are NaN, and `not_determined` says so in words.
#[pyclass(frozen, module = "tumble")]
pub struct Identification {
    found: Found,
    json: String,
    warnings: Vec<String>,
    determined: [bool; 10],
}

impl Identification {
    /// Of what the command line finds.
    ///
    /// # Errors
    /// Where a number has no JSON form.
    pub fn new(found: Found) -> PyResult<Self> {
        let json = found.json().map_err(|error| raised(&error))?;
        let warnings = report::warnings(&found.identification, &found.context());
        let determined = found.identification.determined();
        Ok(Self { found, json, warnings, determined })
    }

    /// The body, or the one that a weak prior completes.
    fn body(&self) -> Option<&Estimate> {
        self.found.identification.estimate.as_ref().or(self.found.identification.regularised.as_ref())
    }
}

#[pymethods]
impl Identification {
    /// Mass, kg.
    #[getter]
    fn mass(&self) -> f64 {
        self.body().filter(|_| self.determined[0]).map_or(f64::NAN, |body| body.parameters.mass)
    }

    /// Centre of mass, body axes, m.
    #[getter]
    fn center_of_mass<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let known = |body: &Estimate| shown(&body.parameters.center_of_mass(), &self.determined[1..4]);
        of_vector(py, &self.body().map_or(Vector3::repeat(f64::NAN), known))
    }

    /// Inertia about the centre of mass, body axes, kg m^2; off the diagonal minus the products of inertia.
    #[getter]
    fn inertia<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let known = |body: &Estimate| shown_inertia(&body.parameters.inertia_about_com(), &self.determined[4..]);
        of_matrix(py, &self.body().map_or(Matrix3::repeat(f64::NAN), known))
    }

    /// One standard deviation of each.
    #[getter]
    fn sigma(&self) -> Option<Sigma> {
        self.body().map(|body| Sigma::of(body, &self.determined))
    }

    /// Mass, first moments (x, y, z) and inertia about the body origin (xx, xy, xz, yy, yz, zz), which `covariance` is of; None where
    /// the log does not determine all ten.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let estimate = self.found.identification.estimate.as_ref()?;
        Some(of_vector(py, &estimate.parameters.to_vector()))
    }

    /// Covariance of `parameters`, (10, 10).
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let estimate = self.found.identification.estimate.as_ref();
        estimate.map(|estimate| of_matrix(py, &estimate.covariance)).transpose()
    }

    /// "identified", "doubtful", "not-determined" or "no-body-explains".
    #[getter]
    fn verdict(&self) -> &'static str {
        match self.found.identification.verdict {
            Verdict::Identified => "identified",
            Verdict::Doubtful(_) => "doubtful",
            Verdict::NoBodyExplains { .. } => "no-body-explains",
            _ => "not-determined",
        }
    }

    /// Whether the numbers may be used.
    #[getter]
    fn identified(&self) -> bool {
        self.found.identification.verdict.is_identified()
    }

    /// What the log does not tell, in words.
    #[getter]
    fn not_determined(&self) -> Vec<String> {
        self.found.identification.null_directions.iter().map(ToString::to_string).collect()
    }

    /// What a reader must know, in sentences.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Name of the method that answered.
    #[getter]
    fn method(&self) -> &'static str {
        self.found.identification.method
    }

    /// What the body leaves unexplained: `t` (s), `force` (N), `torque` (N m, about the body origin), body axes.
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let residuals = &self.found.identification.residuals;
        let arrays = PyDict::new(py);
        let times = residuals.iter().map(|residual| tumble_formats::log::seconds(residual.time_ns));
        arrays.set_item("t", PyArray1::from_vec(py, times.collect()))?;
        arrays.set_item("force", of_rows(py, residuals.iter().map(|residual| residual.force.into()))?)?;
        arrays.set_item("torque", of_rows(py, residuals.iter().map(|residual| residual.torque.into()))?)?;
        Ok(arrays)
    }

    /// The object that `tumble identify --json` prints.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (&self.json,))
    }

    /// The same as text.
    fn to_json(&self) -> &str {
        &self.json
    }

    /// The table that `tumble identify` prints.
    fn table(&self) -> String {
        report::table(&self.found.identification, &self.found.context())
    }

    /// Writes the body to a new file: .toml, .json, .urdf or .xml (MJCF).
    #[pyo3(signature = (path, *, force = false))]
    fn export(&self, path: PathBuf, force: bool) -> PyResult<()> {
        let Some(estimate) = &self.found.identification.estimate else {
            let remedy = "see `not_determined`, and record a motion that shows what is missing";
            return Err(refused(BAD_OPTION, "there is no body to export", remedy));
        };
        let text = body_file::export(&path, &estimate.parameters).map_err(|error| raised(&error.into()))?;
        program::output::write_file(&path, text.as_bytes(), force).map_err(|error| raised(&error))
    }

    /// Draws estimates with their intervals, and residuals, by matplotlib; gives its figure.
    fn plot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        if let Err(missing) = py.import("matplotlib") {
            let error =
                refused(BAD_OPTION, "`plot` needs matplotlib, which is not installed", "pip install matplotlib");
            error.set_cause(py, Some(missing));
            return Err(error);
        }
        let code = PyModule::from_code(py, c_str!(include_str!("plot.py")), c_str!("plot.py"), c_str!("tumble_plot"))?;
        code.call_method1("plot", PyTuple::new(py, [slf])?)
    }

    fn __repr__(&self) -> String {
        let (mass, verdict, method) = (self.mass(), self.verdict(), self.method());
        format!("Identification(mass={mass:.6}, verdict={verdict:?}, method={method:?})")
    }
}
