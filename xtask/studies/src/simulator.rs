//! Problem `simulator`: control periods of 0.016 s with propulsion hardware and drag; alone, with nominal sensors and a controller,
//! and with the log as well.

use std::time::Instant;

use nalgebra::Vector3;
use tumble::flight_log::Recorder;
use tumble::scenario::{Flight, ScenarioSource};
use tumble_astrobee::air_drag::air_drag;
use tumble_astrobee::propulsion::{ImpellerMode, PropulsionSettings};
use tumble_astrobee::simulator::{Actuators, AstrobeeSimulator, CONTROL_PERIOD_S, Multisine, SimulatorSettings};
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::lie::{Twist, Wrench};
use tumble_dynamics::{Plant as _, RigidBodyState};

use crate::Failure;
use crate::bench::{Bench, Goal, Row, quantile};

const PROBLEM: &str = "simulator";
/// Control periods between two readings of the clock.
const BETWEEN_LOOKS: usize = 500;
/// 16 ms in 5000 and in 2000 times less.
const TARGETS_NS: (f64, f64) = (3200.0, 8000.0);

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    alone(bench)?;
    flown(bench, "period_sensors", TARGETS_NS.0, false)?;
    flown(bench, "period_sensors_log", TARGETS_NS.1, true)
}

/// Sensors and log off: sines in every axis, nobody looks.
fn alone(bench: &Bench) -> Result<(), Failure> {
    let item = "period";
    if !bench.wants(PROBLEM, item) {
        return Ok(());
    }
    let start = RigidBodyState {
        world_from_body: WorldPreset::Iss.pose("A").unwrap_or_default(),
        twist_body: Twist::new(Vector3::new(0.02, -0.03, 0.01), Vector3::zeros()),
    };
    let ideal = SimulatorSettings::ideal(WorldPreset::Iss, start);
    let mode = ImpellerMode::Nominal;
    let actuators = Actuators::hardware(mode, ideal.body.center_of_mass(), PropulsionSettings::PHYSICAL);
    let settings = SimulatorSettings { drag: Some(air_drag()), actuators, ..ideal };
    let mut robot = AstrobeeSimulator::try_new(settings).map_err(failed)?;
    let peak = Wrench::new(Vector3::new(0.02, 0.02, 0.02), Vector3::new(0.2, 0.1, 0.1));
    let sines = Multisine::new(&peak, 3, 0.04, 0.35, 7);
    timed(bench, item, TARGETS_NS.0, || {
        let wanted = sines.wrench(robot.time_ns() as f64 * 1e-9);
        let measured = robot.advance(&wanted, CONTROL_PERIOD_S).map_err(failed)?;
        Ok(measured.end.state.twist_body.linear.norm())
    })
}

fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::TargetMissed(format!("{PROBLEM}: {error}"))
}

/// The scenario `iss-payload`, its controller and its sensors.
fn flown(bench: &Bench, item: &'static str, target_ns: f64, with_log: bool) -> Result<(), Failure> {
    if !bench.wants(PROBLEM, item) {
        return Ok(());
    }
    let mut source = ScenarioSource::find("iss-payload").map_err(failed)?;
    source.scenario.duration_s = 80_000.0;
    source.scenario.propulsion.drag = true;
    let mut flight: Flight = source.flight().map_err(failed)?;
    let path = std::env::temp_dir().join(format!("tumble-bench-{}.csv", std::process::id()));
    let file = std::fs::File::create(&path).map_err(|error| Failure::file(&path, error))?;
    let mut recorder = Recorder::new(std::io::BufWriter::with_capacity(1 << 16, file)).map_err(failed)?;
    let timed = timed(bench, item, target_ns, || {
        let measured = flight.step().map_err(failed)?.ok_or_else(|| failed("the flight is over"))?;
        if with_log {
            recorder.record(&measured, flight.simulator.estimates()).map_err(failed)?;
        }
        Ok(measured.end.state.twist_body.linear.norm())
    });
    let (rows, _) = recorder.finish().map_err(failed)?;
    std::fs::remove_file(&path).map_err(|error| Failure::file(&path, error))?;
    if with_log == (rows == 0) {
        return Err(failed(format!("{item}: {rows} rows written")));
    }
    timed
}

/// Times control periods; each tells the speed of the body, m/s.
fn timed(
    bench: &Bench,
    item: &'static str,
    target_ns: f64,
    mut period: impl FnMut() -> Result<f64, Failure>,
) -> Result<(), Failure> {
    let calibration_ns = bench.calibrate();
    let looks = bench.sweeps.clamp(10, 400);
    let mut times = Vec::with_capacity(looks);
    let mut largest_m_s = 0.0_f64;
    for _ in 0..looks {
        let clock = Instant::now();
        for _ in 0..BETWEEN_LOOKS {
            largest_m_s = largest_m_s.max(period()?);
        }
        times.push(clock.elapsed().as_nanos() as f64 / BETWEEN_LOOKS as f64);
    }
    times.sort_by(f64::total_cmp);
    let median_ns = quantile(&times, 0.5);
    bench.report(&Row {
        problem: PROBLEM,
        item,
        median_ns,
        p99_ns: quantile(&times, 0.99),
        n: looks * BETWEEN_LOOKS,
        quality: vec![("times_real_time", 16e6 / median_ns), ("largest_speed_m_s", largest_m_s)],
        goal: Goal { target_ns: Some(target_ns), peer: None },
        calibration_ns,
    });
    Ok(())
}
