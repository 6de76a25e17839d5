//! Rows of arrays to samples and back.

use crate::error::{BAD_OPTION, refused};
use numpy::ndarray::ArrayView2;
use numpy::{AllowTypeChange, PyArray1, PyArray2, PyArrayLike1, PyArrayLike2, PyArrayMethods as _};
use pyo3::prelude::*;
use tumble_dynamics::nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3, Vector6};
use tumble_formats::log::QUATERNION_NORM_TOLERANCE;
use tumble_identification::MotionSample;
use tumble_lie::{Pose, Wrench, from_xyzw};

/// Numbers of some rows, read where they lie.
pub type Rows<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;
/// Numbers of one row, read where they lie.
pub type Row<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;

const SHAPES: &str =
    "docs/python.md says what each array holds; NaN in all numbers of a row says that there was no measurement";

/// That an argument cannot be what it is.
pub fn bad_argument(message: &str) -> PyErr {
    refused(BAD_OPTION, message, SHAPES)
}

/// Times of rows, ns.
///
/// # Errors
/// Times that are not finite, or that are too large for 64 bit of ns.
pub fn times_ns(t: &Bound<'_, PyAny>) -> PyResult<Vec<i64>> {
    let array = t.py().import("numpy")?.call_method1("asarray", (t,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if kind == "i" || kind == "u" {
        let times: Vec<i64> = PyArrayLike1::<i64, AllowTypeChange>::extract(array.as_borrowed())?.as_array().to_vec();
        return match (times.first(), times.last()) {
            (Some(first), Some(last)) if times.len() > 1 && last.saturating_sub(*first) < NO_FLIGHT_NS => {
                Err(bad_argument(
                    "`t` holds integers, which are nanoseconds, and the rows would last less than a millisecond: give seconds as floats",
                ))
            }
            _ => Ok(times),
        };
    }
    let times = Row::extract(array.as_borrowed())?;
    times.as_array().iter().enumerate().map(|(row, time_s)| time_ns(*time_s, || format!("`t`, row {row}"))).collect()
}

/// Rows of integers that last no longer than this are seconds by mistake.
const NO_FLIGHT_NS: i64 = 1_000_000;

/// Nearest nanosecond.
///
/// # Errors
/// As [`times_ns`], by what `place` says.
pub fn time_ns(time_s: f64, place: impl FnOnce() -> String) -> PyResult<i64> {
    let time_ns = (time_s * 1e9).round();
    if time_ns.abs() < 9.2e18 {
        #[allow(clippy::cast_possible_truncation, reason = "whole and within 64 bit")]
        return Ok(time_ns as i64);
    }
    Err(bad_argument(&format!("{}: {time_s:e} is no time in seconds", place())))
}

/// An optional quantity of so many numbers, row by row.
struct Column<'a, const N: usize> {
    name: &'static str,
    rows: Option<ArrayView2<'a, f64>>,
}

impl<'a, const N: usize> Column<'a, N> {
    fn new(name: &'static str, rows: Option<&'a Rows<'_>>, count: usize) -> PyResult<Self> {
        let rows = rows.map(|rows| rows.as_array());
        match rows.as_ref().map(ArrayView2::shape) {
            None => {}
            Some([found, width]) if (*found, *width) == (count, N) => {}
            Some(shape) => {
                return Err(bad_argument(&format!(
                    "`{name}` has the shape {shape:?}; `t` has {count} rows, so that ({count}, {N}) is needed"
                )));
            }
        }
        Ok(Self { name, rows })
    }

    /// Nothing where all numbers of the row are NaN.
    fn at(&self, row: usize) -> PyResult<Option<[f64; N]>> {
        let Some(rows) = &self.rows else { return Ok(None) };
        let numbers: [f64; N] = std::array::from_fn(|column| rows.get([row, column]).copied().unwrap_or(f64::NAN));
        present(numbers)
            .map_err(|(column, value)| bad_argument(&format!("`{}`, row {row}: number {column} is {value}", self.name)))
    }
}

/// Nothing where all numbers are NaN; which one is not finite where some are not.
fn present<const N: usize>(numbers: [f64; N]) -> Result<Option<[f64; N]>, (usize, f64)> {
    if numbers.iter().all(|number| number.is_nan()) {
        return Ok(None);
    }
    match numbers.iter().position(|number| !number.is_finite()) {
        Some(column) => Err((column, numbers[column])),
        None => Ok(Some(numbers)),
    }
}

/// Columns of a record, as Python hands them over.
pub struct Columns<'a, 'py> {
    /// Position of the body origin, world axes, m.
    pub position: &'a Rows<'py>,
    /// `world_from_body`, x y z w.
    pub quaternion: &'a Rows<'py>,
    /// Force, torque about the body origin; body axes, N and N m.
    pub wrench: Option<&'a Rows<'py>>,
    /// Angular velocity, body axes, rad/s.
    pub rate: Option<&'a Rows<'py>>,
    /// Velocity of the body origin, world axes, m/s.
    pub velocity: Option<&'a Rows<'py>>,
    /// Acceleration of the body origin, body axes, m/s^2.
    pub acceleration: Option<&'a Rows<'py>>,
    /// Angular momentum of wheels relative to the body, body axes, N m s.
    pub stored_momentum: Option<&'a Rows<'py>>,
}

/// One sample a row.
///
/// # Errors
/// Shapes that do not fit, numbers that are not finite, quaternions that are none: by argument and row.
pub fn record(times_ns: &[i64], columns: &Columns<'_, '_>) -> PyResult<Vec<MotionSample>> {
    let count = times_ns.len();
    if count == 0 {
        return Err(bad_argument("`t` has no rows"));
    }
    let position = Column::<3>::new("position", Some(columns.position), count)?;
    let quaternion = Column::<4>::new("quaternion", Some(columns.quaternion), count)?;
    let wrench = Column::<6>::new("wrench", columns.wrench, count)?;
    let rate = Column::<3>::new("rate", columns.rate, count)?;
    let velocity = Column::<3>::new("velocity", columns.velocity, count)?;
    let acceleration = Column::<3>::new("acceleration", columns.acceleration, count)?;
    let stored = Column::<3>::new("stored_momentum", columns.stored_momentum, count)?;
    let sample = |(row, time_ns): (usize, &i64)| {
        let world_from_body = match (position.at(row)?, quaternion.at(row)?) {
            (Some(position), Some(xyzw)) => Some(Pose::from_parts(
                Vector3::from(position).into(),
                rotation(xyzw, || format!("`quaternion`, row {row}"))?,
            )),
            _ => None,
        };
        Ok(MotionSample {
            time_ns: *time_ns,
            world_from_body,
            velocity_origin_world: velocity.at(row)?.map(Vector3::from),
            rate_body: rate.at(row)?.map(Vector3::from),
            acceleration_origin_body: acceleration.at(row)?.map(Vector3::from),
            wrench_body: wrench.at(row)?.map(wrench_of),
            stored_momentum_body: stored.at(row)?.map(Vector3::from),
            ..MotionSample::default()
        })
    };
    times_ns.iter().enumerate().map(sample).collect()
}

/// Force before torque, as the columns of a log stand.
pub fn wrench_of([fx, fy, fz, tx, ty, tz]: [f64; 6]) -> Wrench<f64> {
    Wrench::from(Vector6::new(tx, ty, tz, fx, fy, fz))
}

/// A rotation, within the tolerance of a log.
///
/// # Errors
/// A quaternion that is none.
pub fn rotation([x, y, z, w]: [f64; 4], place: impl FnOnce() -> String) -> PyResult<UnitQuaternion<f64>> {
    from_xyzw(x, y, z, w, QUATERNION_NORM_TOLERANCE).map_err(|_| {
        let norm = Vector6::new(x, y, z, w, 0.0, 0.0).norm();
        bad_argument(&format!(
            "{}: its norm is {norm}; within {QUATERNION_NORM_TOLERANCE} of one it is normalised",
            place()
        ))
    })
}

/// So many finite numbers.
///
/// # Errors
/// Another count, numbers that are not finite.
pub fn numbers<const N: usize>(name: &str, row: &Row<'_>) -> PyResult<[f64; N]> {
    let row = row.as_array();
    if row.len() != N {
        return Err(bad_argument(&format!("`{name}` has {} numbers, {N} are needed", row.len())));
    }
    let numbers = std::array::from_fn(|at| row.get(at).copied().unwrap_or(f64::NAN));
    match numbers.iter().position(|number| !number.is_finite()) {
        Some(at) => Err(bad_argument(&format!("`{name}`: number {at} is {}", numbers[at]))),
        None => Ok(numbers),
    }
}

/// A square of finite numbers.
///
/// # Errors
/// As [`numbers`].
pub fn matrix<const N: usize>(name: &str, rows: &Rows<'_>) -> PyResult<SMatrix<f64, N, N>> {
    let rows = rows.as_array();
    if rows.shape() != [N, N] {
        return Err(bad_argument(&format!("`{name}` has the shape {:?}, ({N}, {N}) is needed", rows.shape())));
    }
    let matrix = SMatrix::<f64, N, N>::from_fn(|i, j| rows.get([i, j]).copied().unwrap_or(f64::NAN));
    match matrix.iter().position(|number| !number.is_finite()) {
        Some(at) => Err(bad_argument(&format!("`{name}`: row {}, column {} is {}", at % N, at / N, matrix[at]))),
        None => Ok(matrix),
    }
}

/// An array of one row.
pub fn of_vector<'py, const N: usize>(py: Python<'py>, vector: &SVector<f64, N>) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, vector.as_slice())
}

/// An array of rows.
///
/// # Errors
/// Where there is no memory for it.
pub fn of_rows<const N: usize>(
    py: Python<'_>,
    rows: impl IntoIterator<Item = [f64; N]>,
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let flat: Vec<f64> = rows.into_iter().flatten().collect();
    let count = flat.len() / N;
    PyArray1::from_vec(py, flat).reshape([count, N])
}

/// An array of a matrix.
///
/// # Errors
/// Where there is no memory for it.
pub fn of_matrix<'py, const N: usize>(
    py: Python<'py>,
    matrix: &SMatrix<f64, N, N>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    of_rows::<N>(py, (0..N).map(|i| std::array::from_fn(|j| matrix[(i, j)])))
}

/// The three axes of a vector, NaN where they are not known.
pub fn shown(vector: &Vector3<f64>, determined: &[bool]) -> Vector3<f64> {
    Vector3::from_fn(|i, _| if determined.get(i).copied().unwrap_or(false) { vector[i] } else { f64::NAN })
}

/// The same of an inertia: xx, yy, zz, xy, xz, yz.
pub fn shown_inertia(inertia: &Matrix3<f64>, determined: &[bool]) -> Matrix3<f64> {
    const PLACES: [[usize; 3]; 3] = [[0, 3, 4], [3, 1, 5], [4, 5, 2]];
    let known = |i: usize, j: usize| determined.get(PLACES[i][j]).copied().unwrap_or(false);
    Matrix3::from_fn(|i, j| if known(i, j) { inertia[(i, j)] } else { f64::NAN })
}
