//! The flight of a recording as rows of named columns.

use super::flight::FlightReader;
use super::rows::{Cell, RowSink};
use super::topics::HeldColumns;
use super::{Container, container, ulog_flight};
use crate::{FormatsError, Robots};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use tumble_identification::MotionSample;
use tumble_lie::nalgebra::Vector3;

/// Streams the flight of a robot from a recording in one file or several; gives what a user should know about it. Of a ULog the commands
/// of the actuators are columns too.
///
/// # Errors
/// As [`FlightReader::open_all`], or from `sink`.
pub fn read_flight(
    paths: &[PathBuf],
    robot: Option<&str>,
    robots: &Robots,
    sink: &mut dyn RowSink,
) -> Result<Vec<String>, FormatsError> {
    if let [path] = paths
        && container(path)? == Some(Container::Ulog)
    {
        return read_ulog(path, robot, sink);
    }
    let mut flight = FlightReader::open_all(paths, robot, robots)?;
    let mut rows = Rows::new(flight.columns(), &[], sink);
    while let Some(sample) = flight.next_sample()? {
        rows.take(&sample, &[])?;
    }
    Ok(flight.warnings())
}

fn read_ulog(path: &Path, robot: Option<&str>, sink: &mut dyn RowSink) -> Result<Vec<String>, FormatsError> {
    let (survey, plan) = ulog_flight::open(path, robot)?;
    let mut rows = Rows::new(ulog_flight::columns(&survey.topics), &survey.commands, sink);
    let mut failure = None;
    let tally = ulog_flight::read(path, &survey, &survey.commands, false, &mut |sample| match rows
        .take(&sample.motion, &sample.commands)
    {
        Ok(()) => ControlFlow::Continue(()),
        Err(error) => {
            failure = Some(error);
            ControlFlow::Break(())
        }
    })?;
    failure.map_or_else(|| Ok(tally.warnings(&plan, &survey.topics)), Err)
}

/// Samples on their way to a sink.
struct Rows<'s> {
    held: HeldColumns,
    columns: Vec<String>,
    cells: Vec<Cell>,
    sink: &'s mut dyn RowSink,
    begun: bool,
}

impl<'s> Rows<'s> {
    fn new(held: HeldColumns, commands: &[String], sink: &'s mut dyn RowSink) -> Self {
        let mut columns: Vec<String> = ["p_x", "p_y", "p_z", "q_x", "q_y", "q_z", "q_w"].map(str::to_owned).into();
        let vectors = [
            ("v", held.velocity),
            ("w", held.rate),
            ("a", held.acceleration),
            ("f", held.wrench),
            ("tau", held.wrench),
        ];
        for (name, _) in vectors.iter().filter(|(_, is_held)| *is_held) {
            columns.extend(["x", "y", "z"].map(|axis| format!("{name}_{axis}")));
        }
        columns.extend_from_slice(commands);
        Self { held, cells: Vec::with_capacity(columns.len()), columns, sink, begun: false }
    }

    fn take(&mut self, sample: &MotionSample, commands: &[Option<f64>]) -> Result<(), FormatsError> {
        // Not before there is a row: without one there is no log.
        if !self.begun {
            self.sink.begin(&self.columns)?;
            self.begun = true;
        }
        let vector = |v: Option<Vector3<f64>>, is_held: bool| {
            let numbers = match v {
                Some(v) => [v.x, v.y, v.z].map(Cell::Number),
                None => [const { Cell::Empty }; 3],
            };
            numbers.into_iter().filter(move |_| is_held)
        };
        let pose = sample.world_from_body.map_or([const { Cell::Empty }; 7], |pose| {
            let ([x, y, z], [i, j, k, w]) = (pose.translation.vector.into(), pose.rotation.coords.into());
            [x, y, z, i, j, k, w].map(Cell::Number)
        });
        let (cells, held) = (&mut self.cells, self.held);
        cells.clear();
        cells.extend(pose);
        cells.extend(vector(sample.velocity_origin_world, held.velocity));
        cells.extend(vector(sample.rate_body, held.rate));
        cells.extend(vector(sample.acceleration_origin_body, held.acceleration));
        cells.extend(vector(sample.wrench_body.map(|wrench| wrench.force), held.wrench));
        cells.extend(vector(sample.wrench_body.map(|wrench| wrench.torque), held.wrench));
        cells.extend(commands.iter().map(|command| command.map_or(Cell::Empty, Cell::Number)));
        self.sink.row(sample.time_ns, cells)
    }
}
