//! Prints hashes of the first seconds of missions in closed loop: coordinator, estimator, planners, controller and simulator, as
//! `tumble fly` writes them to `log.csv`, and the record that becomes the report.
//!
//! The output must not depend on the optimisation level or the processor: `cargo xtask ci --only determinism` runs this program
//! as tests are built and compares with what it printed as users build it.

use std::io;
use tumble::TumbleError;
use tumble::flight_log::{MoreColumns, Recorder};
use tumble::mission::{FlownPeriod, FlyOptions, LayerNames, MissionHooks, ModelChoice, WeightingChoice, fly};
use tumble::scenario::ScenarioSource;
use tumble_astrobee::propulsion::{ImpellerMode, largest_thrusts_n};
use tumble_formats::FormatsError;

/// FNV-1a, 64 bits: where it starts, and how it goes on.
const START: u64 = 0xcbf2_9ce4_8422_2325;

fn absorb(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

fn main() -> Result<(), TumbleError> {
    mission("granite-cargo", 12.0)?;
    mission("iss-cargo", 12.0)
}

/// What is written to it, as a hash and a number of bytes.
struct Hashed(u64, usize);

impl io::Write for Hashed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        (self.0, self.1) = (absorb(self.0, bytes), self.1 + bytes.len());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

struct Log<'a>(Recorder<&'a mut Hashed>);

impl MissionHooks for Log<'_> {
    fn period(&mut self, period: &FlownPeriod<'_>) -> Result<(), TumbleError> {
        self.0.revise(period.plan_revision, period.belief_revision);
        self.0.estimated(&[period.estimate.0, period.estimate.1]);
        self.0.record(period.measured, period.estimates).map_err(unwritable)
    }
}

fn unwritable(source: io::Error) -> TumbleError {
    FormatsError::Unwritable { path: "log.csv".into(), source }.into()
}

/// The first seconds of a mission.
fn mission(name: &str, longest_s: f64) -> Result<(), TumbleError> {
    let mut source = ScenarioSource::find(name)?;
    source.scenario.duration_s = longest_s;
    let options = FlyOptions {
        seed: 3,
        weighting: WeightingChoice::Covariance,
        feedback: true,
        model: ModelChoice::Scenario,
        fault: None,
        layers: LayerNames::default(),
    };
    let mut written = Hashed(START, 0);
    let more = MoreColumns {
        nozzles: Some(largest_thrusts_n(ImpellerMode::Nominal)),
        estimate: true,
        revisions: true,
        stored: false,
    };
    let mut log = Log(Recorder::with(&mut written, more).map_err(unwritable)?);
    let record = fly(&source, &options, &mut log)?;
    log.0.finish().map_err(unwritable)?;
    let Hashed(hash, bytes) = written;
    let told = absorb(START, format!("{record:?}").as_bytes());
    let (beliefs, stretches) = (record.beliefs.len(), record.stretches.len());
    println!(
        "{name}: log.csv {hash:016x}, {bytes} bytes; record {told:016x}, {beliefs} beliefs, {stretches} stretches"
    );
    Ok(())
}
