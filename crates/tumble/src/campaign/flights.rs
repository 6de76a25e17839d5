//! Missions that are flown by the simulator.

use super::plan::ScenarioEntry;
use super::{MissionRunner, PlannedMission};
use crate::TumbleError;
use crate::mission::{MissionSummary, NoHooks, fly};
use crate::scenario::{ScenarioSource, draw_mission};
use std::io::Read as _;
use tumble_formats::FormatsError;
use tumble_formats::{Robots, text_file};

/// What matters on a table; an error of anything else there says nothing.
const IN_PLANE: [&str; 4] = ["mass", "com_x", "com_y", "inertia_zz"];

/// Flies scenarios.
pub struct SimulatedFlights {
    sources: Vec<ScenarioSource>,
    /// Whether the sensors are not those of the scenarios.
    is_sensed_by: bool,
}

impl SimulatedFlights {
    /// The scenarios of these names, flown among these robots, with other sensors where they are named.
    ///
    /// # Errors
    /// As [`ScenarioSource::find`] and [`ScenarioSource::sensed_by`].
    pub fn find(names: &[String], sensing: Option<&str>, robots: &Robots) -> Result<Self, TumbleError> {
        let source = |name: &String| {
            let source = ScenarioSource::find(name)?.among(robots);
            sensing.map_or(Ok(source.clone()), |sensing| source.sensed_by(sensing))
        };
        Ok(Self {
            sources: names.iter().map(source).collect::<Result<_, TumbleError>>()?,
            is_sensed_by: sensing.is_some(),
        })
    }

    /// What the campaign remembers of its scenarios: names and hashes of the texts, of the files that they name and of sensors that are
    /// not theirs.
    ///
    /// # Errors
    /// [`FormatsError::Unreadable`].
    pub fn entries(&self, names: &[String]) -> Result<Vec<ScenarioEntry>, TumbleError> {
        let entry = |(name, source): (&String, &ScenarioSource)| {
            Ok(ScenarioEntry { name: name.clone(), hash: fingerprint(source, self.is_sensed_by)? })
        };
        names.iter().zip(&self.sources).map(entry).collect()
    }

    /// Name of the first scenario, as it calls itself.
    pub fn name(&self) -> &str {
        self.sources.first().map_or("", |source| source.scenario.name.as_str())
    }
}

impl MissionRunner for SimulatedFlights {
    fn run(&self, mission: &PlannedMission) -> Result<Option<MissionSummary>, TumbleError> {
        let missing = || TumbleError::NoSuchScenario { name: mission.scenario_name.clone(), nearest: String::new() };
        let source = self.sources.get(mission.scenario).ok_or_else(missing)?;
        let drawn = mission.draw.map(|outside| draw_mission(source, mission.options.seed, outside)).transpose()?;
        let record = fly(drawn.as_ref().unwrap_or(source), &mission.options, &mut NoHooks)?;
        let mut summary = record.summary;
        if record.planar {
            summary.parameters.retain(|parameter| IN_PLANE.contains(&parameter.name.as_str()));
        }
        Ok(Some(summary))
    }
}

/// FNV-1a, 64 bits, of the scenario's text, of the files it names and, where they are not its own, of its sensors.
fn fingerprint(source: &ScenarioSource, is_sensed_by: bool) -> Result<String, TumbleError> {
    let scenario = &source.scenario;
    let mut bytes = source.text.clone().into_bytes();
    for file in source.files() {
        let path = source.folder().join(file);
        // lengths keep what stands in one file from passing for what stands in the next
        bytes.extend(bytes.len().to_le_bytes());
        let read = text_file::open_regular(&path).and_then(|mut file| file.read_to_end(&mut bytes));
        read.map_err(|source| FormatsError::Unreadable { path, source })?;
    }
    if is_sensed_by {
        bytes.extend(bytes.len().to_le_bytes());
        bytes.extend(format!("{:?}", scenario.sensing).into_bytes());
    }
    let hash = bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3));
    Ok(format!("fnv1a64:{hash:016x}"))
}
