//! A scenario with other sensors than its own.

use super::{ScenarioSource, SensingTable};
use crate::TumbleError;
use std::path::Path;
use tumble_astrobee::AstrobeeError;
use tumble_astrobee::sensing::{LocalizationSettings, SensingPreset};
use tumble_formats::log::shortened;
use tumble_formats::{place, sensing_file};
use tumble_identification::sensing::Sensing;

impl ScenarioSource {
    /// The same with the sensors of a preset, of a robot or of a file instead of its own; all of its table `[sensing]` is replaced.
    ///
    /// # Errors
    /// [`TumbleError::BadOption`] for a name that nobody bears; the errors of a file; [`TumbleError::SensingNotFlown`].
    pub fn sensed_by(mut self, name: &str) -> Result<Self, TumbleError> {
        let path = Path::new(name);
        let preset = SensingPreset::ALL.into_iter().find(|preset| preset.name() == name);
        self.scenario.sensing = match preset {
            _ if path.is_file() => self.flown(&sensing_file::read(path)?, path)?,
            Some(_) => SensingTable { preset, settings: None },
            None => match self.robots.sensing(name) {
                Ok(sensing) => self.flown(&sensing, path)?,
                Err(unknown) => {
                    let presets = SensingPreset::ALL.map(SensingPreset::name);
                    let others = unknown.known.iter().copied().filter(|known| !presets.contains(known));
                    let names: Vec<&str> = presets.into_iter().chain(others).collect();
                    let near = place::suggestion(name, names.iter().copied());
                    let (asked, names) = (shortened(name), names.join(", "));
                    let message = format!("`--sensing {asked}`: neither a file nor one of {names}{near}");
                    return Err(TumbleError::BadOption { message });
                }
            },
        };
        Ok(self)
    }

    fn flown(&self, sensing: &Sensing, path: &Path) -> Result<SensingTable, TumbleError> {
        let refused = |source: AstrobeeError| TumbleError::SensingNotFlown { path: path.into(), source };
        let mut settings = LocalizationSettings::try_from(sensing).map_err(refused)?;
        let place_m_s2 = self.place()?.gravity_m_s2();
        if ![[0.0; 3], place_m_s2].contains(&settings.gravity_world_m_s2) {
            let (key, accepted) = ("gravity_added_world_m_s2", "the gravity of the scenario's world, or none");
            return Err(refused(AstrobeeError::SensingNotFlown { key, accepted }));
        }
        settings.gravity_world_m_s2 = place_m_s2;
        Ok(SensingTable { preset: None, settings: Some(settings) })
    }
}
