//! Errors of the library as exceptions, with code and remedy.

use pyo3::exceptions::PyException;
use pyo3::prelude::*;

pyo3::create_exception!(
    tumble,
    TumbleError,
    PyException,
    "What Tumble refuses: `code` is explained in docs/errors.md, `remedy` says what to do, `message` what is wrong."
);

/// Code of options and values that do not fit.
pub const BAD_OPTION: &str = "T014";

/// An exception with these words.
pub fn refused(code: &str, message: &str, remedy: &str) -> PyErr {
    let error = TumbleError::new_err(format!("error[{code}]: {message}\n  remedy: {remedy}"));
    Python::attach(|py| {
        let value = error.value(py);
        let told = [("code", code), ("message", message), ("remedy", remedy)];
        match told.into_iter().try_for_each(|(name, text)| value.setattr(name, text)) {
            Ok(()) => error,
            Err(failed) => failed,
        }
    })
}

/// The same of an error of the program.
pub fn raised(error: &program::TumbleError) -> PyErr {
    refused(error.code(), &error.to_string(), error.remedy())
}

/// The same of an error of an estimator.
pub fn of_identification(error: tumble_identification::IdentificationError) -> PyErr {
    raised(&error.into())
}
