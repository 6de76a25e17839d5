//! The flight of a recording as rows of named columns.

use super::flight::FlightReader;
use super::rows::{Cell, RowSink};
use crate::{FormatsError, Robots};
use std::path::Path;
use tumble_lie::nalgebra::Vector3;

/// Streams the flight of a robot from a recording; gives what a user should know about it.
///
/// # Errors
/// As [`FlightReader`], or from `sink`.
pub fn read_flight(
    path: &Path,
    robot: Option<&str>,
    robots: &Robots,
    sink: &mut dyn RowSink,
) -> Result<Vec<String>, FormatsError> {
    let mut flight = FlightReader::open(path, robot, robots)?;
    let held = flight.columns();
    let mut columns: Vec<String> = ["p_x", "p_y", "p_z", "q_x", "q_y", "q_z", "q_w"].map(str::to_owned).into();
    let vectors =
        [("v", held.velocity), ("w", held.rate), ("a", held.acceleration), ("f", held.wrench), ("tau", held.wrench)];
    for (name, _) in vectors.iter().filter(|(_, is_held)| *is_held) {
        columns.extend(["x", "y", "z"].map(|axis| format!("{name}_{axis}")));
    }
    let vector = |v: Option<Vector3<f64>>, is_held: bool| {
        let numbers = match v {
            Some(v) => [v.x, v.y, v.z].map(Cell::Number),
            None => [const { Cell::Empty }; 3],
        };
        numbers.into_iter().filter(move |_| is_held)
    };
    let mut cells = Vec::with_capacity(columns.len());
    let mut begun = false;
    while let Some(sample) = flight.next_sample()? {
        // Not before there is a row: without one there is no log.
        if !begun {
            sink.begin(&columns)?;
            begun = true;
        }
        let pose = sample.world_from_body.map_or([const { Cell::Empty }; 7], |pose| {
            let ([x, y, z], [i, j, k, w]) = (pose.translation.vector.into(), pose.rotation.coords.into());
            [x, y, z, i, j, k, w].map(Cell::Number)
        });
        cells.clear();
        cells.extend(pose);
        cells.extend(vector(sample.velocity_origin_world, held.velocity));
        cells.extend(vector(sample.rate_body, held.rate));
        cells.extend(vector(sample.acceleration_origin_body, held.acceleration));
        cells.extend(vector(sample.wrench_body.map(|wrench| wrench.force), held.wrench));
        cells.extend(vector(sample.wrench_body.map(|wrench| wrench.torque), held.wrench));
        sink.row(sample.time_ns, &cells)?;
    }
    Ok(flight.warnings())
}
