//! Logs of any kind: rows or a recording.

use crate::log::LogReader;
use crate::recording::{self, flight::FlightReader};
use crate::{FormatsError, Robots};
use std::path::{Path, PathBuf};
use tumble_identification::MotionSample;

/// Streams the samples of a log of any kind.
#[non_exhaustive]
pub enum SampleReader {
    /// Rows of a CSV log.
    Rows(Box<LogReader>),
    /// A robot's flight in a ULog, or in bags and MCAP files.
    Flight(Box<FlightReader>),
}

impl SampleReader {
    /// Opens a log; what kind it is, its first bytes say. `reorder` is for rows (recordings are always put in order),
    /// `robot` for recordings.
    ///
    /// # Errors
    /// As [`LogReader::open`] and [`FlightReader::open`].
    pub fn open(path: &Path, reorder: bool, robot: Option<&str>, robots: &Robots) -> Result<Self, FormatsError> {
        Self::open_all(&[path.into()], reorder, robot, robots)
    }

    /// As [`SampleReader::open`], of one recording in several files, which are bags or MCAP files.
    ///
    /// # Errors
    /// As [`LogReader::open`] and [`FlightReader::open_all`].
    pub fn open_all(
        paths: &[PathBuf],
        reorder: bool,
        robot: Option<&str>,
        robots: &Robots,
    ) -> Result<Self, FormatsError> {
        let [path] = paths else {
            return Ok(Self::Flight(Box::new(FlightReader::open_all(paths, robot, robots)?)));
        };
        Ok(match (recording::container(path)?, robot) {
            (Some(_), _) => Self::Flight(Box::new(FlightReader::open(path, robot, robots)?)),
            (None, None) => Self::Rows(Box::new(LogReader::open(path, reorder)?)),
            (None, Some(_)) => {
                let message = "`--robot` chooses among the robots of a bag or an MCAP file".to_owned();
                return Err(FormatsError::BadOption { message });
            }
        })
    }

    /// The next sample in time, `None` at the end.
    ///
    /// # Errors
    /// As [`LogReader::next_sample`] and [`FlightReader::next_sample`].
    pub fn next_sample(&mut self) -> Result<Option<MotionSample>, FormatsError> {
        match self {
            Self::Rows(rows) => rows.next_sample(),
            Self::Flight(flight) => flight.next_sample(),
        }
    }

    /// Appends up to `limit` samples to `samples`; `false` when the log has ended.
    ///
    /// # Errors
    /// As [`SampleReader::next_sample`].
    pub fn read_chunk(&mut self, samples: &mut Vec<MotionSample>, limit: usize) -> Result<bool, FormatsError> {
        for _ in 0..limit {
            match self.next_sample()? {
                Some(sample) => samples.push(sample),
                None => return Ok(false),
            }
        }
        Ok(true)
    }

    /// Of a recording without any wrench of its robot, what would give one.
    pub fn lacks_wrench(&self) -> Option<String> {
        match self {
            Self::Rows(_) => None,
            Self::Flight(flight) => flight.lacks_wrench(),
        }
    }

    /// Whether the columns of a log say that its motion is in a plane.
    pub fn is_planar(&self) -> bool {
        matches!(self, Self::Rows(rows) if rows.is_planar())
    }

    /// What a recording holds and what of it is used, for people; empty for rows.
    pub fn contents(&self) -> String {
        match self {
            Self::Rows(_) => String::new(),
            Self::Flight(flight) => recording::topics::table(&flight.topics, &flight.plan),
        }
    }

    /// What a user should know about what has been read, complete at the end.
    pub fn warnings(&self) -> Vec<String> {
        match self {
            Self::Rows(rows) => rows.warnings(),
            Self::Flight(flight) => flight.warnings(),
        }
    }
}
