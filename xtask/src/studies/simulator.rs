//! Problem `simulator`: control periods of 0.016 s with hardware, drag and nominal sensors, log off and on.

use std::time::Instant;

use tumble_astrobee::flight_log::Recorder;
use tumble_astrobee::scenario::{Flight, ScenarioSource};

use crate::Failure;
use crate::bench::{Bench, Goal, Row, quantile};

const PROBLEM: &str = "simulator";
/// Control periods between two readings of the clock.
const BETWEEN_LOOKS: usize = 500;
/// 16 ms in 5000 and in 2000 times less.
const TARGETS_NS: (f64, f64) = (3200.0, 8000.0);

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    timed(bench, "period_log_off", TARGETS_NS.0, false)?;
    timed(bench, "period_log_on", TARGETS_NS.1, true)
}

fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::TargetMissed(format!("{PROBLEM}: {error}"))
}

fn timed(bench: &Bench, item: &'static str, target_ns: f64, with_log: bool) -> Result<(), Failure> {
    if !bench.wants(PROBLEM, item) {
        return Ok(());
    }
    let calibration_ns = bench.calibrate();
    let mut source = ScenarioSource::find("iss-payload").map_err(failed)?;
    source.scenario.duration_s = 80_000.0;
    source.scenario.propulsion.drag = true;
    let mut flight: Flight = source.flight().map_err(failed)?;
    let path = std::env::temp_dir().join(format!("tumble-bench-{}.csv", std::process::id()));
    let file = std::fs::File::create(&path).map_err(|error| Failure::file(&path, error))?;
    let mut recorder = Recorder::new(std::io::BufWriter::with_capacity(1 << 16, file)).map_err(failed)?;
    let looks = bench.sweeps.clamp(10, 400);
    let mut times = Vec::with_capacity(looks);
    let mut largest_m = 0.0_f64;
    for _ in 0..looks {
        let clock = Instant::now();
        for _ in 0..BETWEEN_LOOKS {
            let Some(measured) = flight.step().map_err(failed)? else { break };
            if with_log {
                recorder.record(&measured, flight.simulator.estimates()).map_err(failed)?;
            }
        }
        times.push(clock.elapsed().as_nanos() as f64 / BETWEEN_LOOKS as f64);
        largest_m = largest_m.max(flight.simulator.state().twist_body.linear.norm());
    }
    let (rows, _) = recorder.finish().map_err(failed)?;
    std::fs::remove_file(&path).map_err(|error| Failure::file(&path, error))?;
    times.sort_by(f64::total_cmp);
    let median_ns = quantile(&times, 0.5);
    bench.report(&Row {
        problem: PROBLEM,
        item,
        median_ns,
        p99_ns: quantile(&times, 0.99),
        n: looks * BETWEEN_LOOKS,
        quality: vec![("times_real_time", 16e6 / median_ns), ("rows", rows as f64), ("largest_speed_m_s", largest_m)],
        goal: Goal { target_ns: Some(target_ns), peer: None },
        calibration_ns,
    });
    Ok(())
}
