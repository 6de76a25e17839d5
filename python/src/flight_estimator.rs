//! Motion and body in flight: measurements in, belief out.

use crate::arrays::{Row, Rows, bad_argument, matrix, numbers, of_matrix, of_vector, rotation, time_ns, wrench_of};
use crate::error::{of_identification, raised};
use crate::identification::Sigma;
use numpy::{PyArray1, PyArray2};
use program::TumbleError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tumble_dynamics::nalgebra::{Matrix3, SVector, Vector3};
use tumble_dynamics::{InertialParameters, RigidBodyState};
use tumble_identification::estimator::{Acted, Doubt, EstimatorError, Gauss, Measurement, StateEstimator};
use tumble_identification::recursive::{FlightEstimatorSettings, MotionNoise, grasp_or_release};
use tumble_identification::{BodyScale, Estimate, recursive};
use tumble_lie::{Pose, Twist};

/// The ten numbers of a body: mass, first moments x y z, inertia about the body origin xx xy xz yy yz zz; of mass (kg), centre of mass
/// (m, body axes) and inertia about it (kg m^2, off the diagonal minus the products of inertia).
#[pyfunction]
#[pyo3(signature = (mass, center_of_mass, inertia))]
pub fn parameters<'py>(
    py: Python<'py>,
    mass: f64,
    center_of_mass: Row<'py>,
    inertia: Rows<'py>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let center = Vector3::from(numbers("center_of_mass", &center_of_mass)?);
    let inertia: Matrix3<f64> = matrix("inertia", &inertia)?;
    let body = InertialParameters::about_com(mass, center, inertia);
    let body = body.validated().map_err(|error| raised(&TumbleError::from(error)))?;
    Ok(of_vector(py, &body.to_vector()))
}

/// What is believed of the body.
#[pyclass(frozen, module = "tumble")]
pub struct Belief {
    estimate: Estimate,
}

#[pymethods]
impl Belief {
    /// Mass, kg.
    #[getter]
    fn mass(&self) -> f64 {
        self.estimate.parameters.mass
    }

    /// Centre of mass, body axes, m.
    #[getter]
    fn center_of_mass<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        of_vector(py, &self.estimate.parameters.center_of_mass())
    }

    /// Inertia about the centre of mass, body axes, kg m^2.
    #[getter]
    fn inertia<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_matrix(py, &self.estimate.parameters.inertia_about_com())
    }

    /// One standard deviation of each.
    #[getter]
    fn sigma(&self) -> Sigma {
        Sigma::of(&self.estimate, &[true; 10])
    }

    /// The ten numbers that `covariance` is of, as the function `parameters` gives them.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        of_vector(py, &self.estimate.parameters.to_vector())
    }

    /// (10, 10).
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_matrix(py, &self.estimate.covariance)
    }

    fn __repr__(&self) -> String {
        format!("Belief(mass={:.6}, sigma of it={:.2e})", self.estimate.parameters.mass, self.estimate.std.mass_kg)
    }
}

/// What was made of a measurement.
#[pyclass(frozen, module = "tumble")]
pub struct Reception {
    /// "used", "gated", "relocalised", "frozen", "too-old", "duplicate", "from-the-future" or "malformed".
    #[pyo3(get)]
    kind: &'static str,
    /// Normalised innovation squared, of one that was used or gated.
    #[pyo3(get)]
    nis: Option<f64>,
    /// What is wrong with one that is malformed.
    #[pyo3(get)]
    reason: Option<&'static str>,
}

#[pymethods]
impl Reception {
    fn __repr__(&self) -> String {
        format!("Reception({:?})", self.kind)
    }
}

impl From<recursive::Reception> for Reception {
    fn from(reception: recursive::Reception) -> Self {
        let plain = |kind| Self { kind, nis: None, reason: None };
        match reception {
            recursive::Reception::Used { nis } => Self { nis: Some(nis), ..plain("used") },
            recursive::Reception::Gated { nis } => Self { nis: Some(nis), ..plain("gated") },
            recursive::Reception::Relocalised => plain("relocalised"),
            recursive::Reception::Frozen => plain("frozen"),
            recursive::Reception::TooOld => plain("too-old"),
            recursive::Reception::Duplicate => plain("duplicate"),
            recursive::Reception::FromTheFuture => plain("from-the-future"),
            recursive::Reception::Malformed { what } => Self { reason: Some(what), ..plain("malformed") },
            _ => plain("other"),
        }
    }
}

/// Motion and body of a free flyer, step by step: say what `acted`, hand over what was `measured`, ask for `belief` and `state`.
///
/// `parameters` and `covariance` are what is known of the body at the start, as the function `parameters` orders it. The noises are one standard
/// deviation per axis: of attitude (rad), position (m), rate (rad/s), velocity (m/s), torque (N m) and force (N). `period` (s): how long a
/// wrench is held. Times are seconds.
#[pyclass(module = "tumble")]
pub struct FlightEstimator {
    filter: recursive::FlightEstimator,
    noise: MotionNoise,
}

fn of_estimator(error: EstimatorError) -> PyErr {
    match error {
        EstimatorError::Library(error) => of_identification(error),
        other => bad_argument(&other.to_string()),
    }
}

fn vector(name: &str, row: Option<&Row<'_>>) -> PyResult<Option<Vector3<f64>>> {
    row.map(|row| Ok(numbers(name, row)?.into())).transpose()
}

#[pymethods]
impl FlightEstimator {
    #[new]
    #[pyo3(signature = (parameters, covariance, *, t=0.0, position=None, quaternion=None, rate=None, velocity=None, attitude_noise=1e-3,
        position_noise=1e-3, rate_noise=1e-3, velocity_noise=1e-3, torque_noise=1e-4, force_noise=1e-3, period=0.016, planar=false))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn new(
        parameters: Row<'_>,
        covariance: Rows<'_>,
        t: f64,
        position: Option<Row<'_>>,
        quaternion: Option<Row<'_>>,
        rate: Option<Row<'_>>,
        velocity: Option<Row<'_>>,
        attitude_noise: f64,
        position_noise: f64,
        rate_noise: f64,
        velocity_noise: f64,
        torque_noise: f64,
        force_noise: f64,
        period: f64,
        planar: bool,
    ) -> PyResult<Self> {
        let prior = belief(&parameters, &covariance)?;
        let usual = FlightEstimatorSettings::of_poses(attitude_noise, position_noise, period);
        let noise = MotionNoise {
            rate_rad_s: rate_noise,
            velocity_m_s: velocity_noise,
            torque_n_m: torque_noise,
            force_n: force_noise,
            ..usual.noise
        };
        let settings = FlightEstimatorSettings { noise, planar, ..usual };
        let position = vector("position", position.as_ref())?.unwrap_or_default();
        let xyzw = quaternion.as_ref().map(|row| numbers("quaternion", row)).transpose()?;
        let rotation = rotation(xyzw.unwrap_or([0.0, 0.0, 0.0, 1.0]), || "`quaternion`".to_owned())?;
        let velocity = vector("velocity", velocity.as_ref())?.unwrap_or_default();
        let start = RigidBodyState {
            world_from_body: Pose::from_parts(position.into(), rotation),
            twist_body: Twist {
                angular: vector("rate", rate.as_ref())?.unwrap_or_default(),
                linear: rotation.inverse() * velocity,
            },
        };
        let start_ns = time_ns(t, || "`t`".to_owned())?;
        let filter =
            recursive::FlightEstimator::try_new(settings, start, start_ns, &prior).map_err(of_identification)?;
        Ok(Self { filter, noise })
    }

    /// What is believed to have acted in a span: force, then torque about the body origin, body axes, N and N m, without gravity; and the
    /// angular momentum of wheels, N m s. A later word of the same span replaces an earlier one.
    #[pyo3(signature = (since, until, wrench, *, stored_momentum=None))]
    fn acted(&mut self, since: f64, until: f64, wrench: Row<'_>, stored_momentum: Option<Row<'_>>) -> PyResult<()> {
        let acted = Acted {
            from_ns: time_ns(since, || "`since`".to_owned())?,
            until_ns: time_ns(until, || "`until`".to_owned())?,
            wrench_body: wrench_of(numbers("wrench", &wrench)?),
            stored_body: vector("stored_momentum", stored_momentum.as_ref())?.unwrap_or_default(),
        };
        if acted.until_ns <= acted.from_ns {
            return Err(bad_argument(&format!("`until` {until} does not come after `since` {since}")));
        }
        StateEstimator::acted(&mut self.filter, &acted);
        Ok(())
    }

    /// Takes what was measured at a time, all of which may be missing: position and velocity of the body origin in world axes, quaternion
    /// x y z w of world_from_body, rate in body axes. It may be late, out of order, doubled or absurd; the answer says what was made of it.
    #[pyo3(signature = (t, *, position=None, quaternion=None, rate=None, velocity=None))]
    fn measured(
        &mut self,
        t: f64,
        position: Option<Row<'_>>,
        quaternion: Option<Row<'_>>,
        rate: Option<Row<'_>>,
        velocity: Option<Row<'_>>,
    ) -> PyResult<Reception> {
        let xyzw = quaternion.as_ref().map(|row| numbers("quaternion", row)).transpose()?;
        let attitude = xyzw.map(|xyzw| rotation(xyzw, || "`quaternion`".to_owned())).transpose()?;
        let MotionNoise { attitude_rad, position_m, rate_rad_s, velocity_m_s, .. } = self.noise;
        let measurement = Measurement {
            stamp_ns: time_ns(t, || "`t`".to_owned())?,
            attitude: attitude.map(|value| Gauss::isotropic(value, attitude_rad)),
            position_world: vector("position", position.as_ref())?.map(|value| Gauss::isotropic(value, position_m)),
            rate_body: vector("rate", rate.as_ref())?.map(|value| Gauss::isotropic(value, rate_rad_s)),
            velocity_world: vector("velocity", velocity.as_ref())?.map(|value| Gauss::isotropic(value, velocity_m_s)),
            ..Measurement::default()
        };
        Ok(StateEstimator::measured(&mut self.filter, &measurement).into())
    }

    /// What is believed of the body now.
    fn belief(&self) -> Belief {
        Belief { estimate: self.filter.estimate() }
    }

    /// Motion at a time: `position`, `quaternion`, `rate`, `velocity`, as `measured` takes them.
    fn state<'py>(&self, py: Python<'py>, t: f64) -> PyResult<Bound<'py, PyDict>> {
        let state = self.filter.state_at(time_ns(t, || "`t`".to_owned())?);
        let pose = &state.world_from_body;
        let arrays = PyDict::new(py);
        arrays.set_item("position", of_vector(py, &pose.translation.vector))?;
        arrays.set_item("quaternion", of_vector(py, &pose.rotation.coords))?;
        arrays.set_item("rate", of_vector(py, &state.twist_body.angular))?;
        arrays.set_item("velocity", of_vector(py, &(pose.rotation * state.twist_body.linear)))?;
        Ok(arrays)
    }

    /// Whether the filter's own account of its errors still holds: `mean_nis`, `alarm_above`, `diverged`, `body_doubtful`.
    #[getter]
    fn health<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let health = self.filter.health();
        let told = PyDict::new(py);
        told.set_item("mean_nis", health.mean_nis)?;
        told.set_item("alarm_above", health.alarm_above)?;
        told.set_item("diverged", health.diverged)?;
        told.set_item("body_doubtful", health.body_doubtful)?;
        Ok(told)
    }

    /// How many measurements came to which end.
    #[getter]
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counts = self.filter.counts();
        let told = PyDict::new(py);
        let each = [
            ("used", counts.used),
            ("gated", counts.gated),
            ("relocalised", counts.relocalised),
            ("frozen", counts.frozen),
            ("too-old", counts.too_old),
            ("duplicate", counts.duplicate),
            ("from-the-future", counts.from_the_future),
            ("malformed", counts.malformed),
            ("replayed", counts.replayed),
        ];
        for (name, count) in each {
            told.set_item(name, count)?;
        }
        Ok(told)
    }

    /// Something was grasped or released: the body is known much less from now on.
    fn doubt_body(&mut self) {
        StateEstimator::doubt(&mut self.filter, &Doubt::Body(grasp_or_release()));
    }

    /// Actuators do not do what they are told.
    fn doubt_wrench(&mut self) {
        StateEstimator::doubt(&mut self.filter, &Doubt::Wrench);
    }

    /// Sets the body back to a prior, the motion kept.
    #[pyo3(signature = (parameters, covariance))]
    fn restart(&mut self, parameters: Row<'_>, covariance: Rows<'_>) -> PyResult<()> {
        let prior = belief(&parameters, &covariance)?;
        let scale = BodyScale::of(&prior.parameters.to_vector()).map_err(of_identification)?;
        let finding = prior.to_finding(scale).map_err(of_estimator)?;
        StateEstimator::restart(&mut self.filter, &finding).map_err(of_estimator)
    }
}

/// A body with its covariance.
fn belief(parameters: &Row<'_>, covariance: &Rows<'_>) -> PyResult<Estimate> {
    let point = SVector::<f64, 10>::from(numbers("parameters", parameters)?);
    let covariance = matrix("covariance", covariance)?;
    let scale = BodyScale::of(&point).map_err(of_identification)?;
    let finding =
        tumble_identification::estimator::Finding::of_covariance(point, &covariance, scale.parameter_magnitudes());
    Estimate::try_from(&finding.map_err(of_estimator)?).map_err(of_estimator)
}
