//! The flight of `tumble simulate`, and what is counted on the way.

use super::commanded_nozzles::CommandedNozzles;
use super::said::progress;
use super::simulate_control::{self, Tracked};
use crate::TumbleError;
use crate::flight_log::{MoreColumns, Recorder};
use crate::scenario::Flight;
use std::fs::File;
use std::io::{BufWriter, IsTerminal as _};
use std::path::Path;
use std::time::{Duration, Instant};
use tumble_astrobee::simulator::{CONTROL_PERIOD_S, SimulatorMeasurement, TimedEvent};
use tumble_dynamics::nalgebra::Vector3;
use tumble_formats::FormatsError;
use tumble_lie::LieGroup;

/// Control periods between two looks at the progress.
const BETWEEN_LOOKS: i64 = 20_000;

/// Time between two lines of progress where there is no terminal whose line could change.
const BETWEEN_LINES: Duration = Duration::from_secs(5);
/// Points of a curve in a picture.
const DRAWN: i64 = 2000;

/// What is counted and drawn while the robot flies.
pub(super) struct Flown {
    pub(super) periods: i64,
    pub(super) saturated: i64,
    pub(super) distance_m: f64,
    pub(super) top_speed_m_s: f64,
    pub(super) largest_force_error_n: f64,
    pub(super) impulse_n_s: f64,
    /// Every so many periods.
    pub(super) drawn: Vec<SimulatorMeasurement>,
    pub(super) tracked: Tracked,
}

/// Flies to the end and writes the log; how many rows it has, and how many estimates are in none.
pub(super) fn fly_to_log(
    flight: &mut Flight,
    nozzles: &CommandedNozzles,
    log: &Path,
) -> Result<(Flown, u64, u64), TumbleError> {
    let unwritable = |source| FormatsError::Unwritable { path: log.into(), source };
    let out = BufWriter::with_capacity(1 << 16, File::create(log).map_err(unwritable)?);
    let more = MoreColumns {
        nozzles: nozzles.largest_thrusts_n(),
        estimate: false,
        revisions: simulate_control::is_told(flight),
        stored: flight.simulator.stored_momentum_body().is_some(),
    };
    let mut recorder = Recorder::with(out, more).map_err(unwritable)?;
    let flown = fly(flight, |flight, measured| {
        // the way is laid out once, before the flight
        recorder.revise(1, flight.drive.account.model_revision());
        Ok(recorder.record(measured, flight.simulator.estimates()).map_err(unwritable)?)
    })?;
    let (rows, left_out) = recorder.finish().map_err(unwritable)?;
    Ok((flown, rows, left_out))
}

/// Flies to the end; `each` sees every control period.
fn fly(
    flight: &mut Flight,
    mut each: impl FnMut(&Flight, &SimulatorMeasurement) -> Result<(), TumbleError>,
) -> Result<Flown, TumbleError> {
    let periods = flight.duration_ns / tumble_astrobee::simulator::CONTROL_PERIOD_NS;
    let drawn_every = periods / DRAWN + 1;
    let mut flown = Flown {
        periods,
        saturated: 0,
        distance_m: 0.0,
        top_speed_m_s: 0.0,
        largest_force_error_n: 0.0,
        impulse_n_s: 0.0,
        drawn: Vec::new(),
        tracked: Tracked::new(flight),
    };
    let mut index = 0;
    let mut said = Instant::now();
    while let Some(measured) = flight.step()? {
        if index % BETWEEN_LOOKS == 0 {
            let text = format!("flying: {} of {} s ...", index * 2 / 125, periods * 2 / 125);
            progress(&text);
            if !std::io::stderr().is_terminal() && said.elapsed() >= BETWEEN_LINES {
                tell_line!("{text}");
                said = Instant::now();
            }
        }
        let [from, to] = [&measured.start, &measured.end].map(|motion| motion.state.world_from_body.translation.vector);
        flown.distance_m += (to - from).norm();
        flown.top_speed_m_s = flown.top_speed_m_s.max(measured.end.state.twist_body.linear.norm());
        flown.saturated += i64::from(measured.saturated);
        let force_error = (measured.realized_wrench_body.force - measured.believed_wrench_body.force).norm();
        flown.largest_force_error_n = flown.largest_force_error_n.max(force_error);
        flown.impulse_n_s += measured.realized_wrench_body.force.norm() * CONTROL_PERIOD_S;
        let is_drawn = index % drawn_every == 0;
        flown.tracked.see(flight, &measured.start, is_drawn);
        if is_drawn {
            flown.drawn.push(measured);
        }
        each(flight, &measured)?;
        index += 1;
    }
    flight.drive.account.end(flight.duration_ns);
    Ok(flown)
}

/// Distance and angle from the goal in the end.
pub(super) fn to_goal(flight: &Flight) -> Option<(f64, f64)> {
    let error = flight.goal?.inv_mul(&flight.simulator.state().world_from_body);
    let turn: Vector3<f64> = LieGroup::log(&error.rotation);
    Some((error.translation.vector.norm(), turn.norm()))
}

pub(super) fn seconds(event: &TimedEvent) -> f64 {
    event.time_ns as f64 / 1e9
}
