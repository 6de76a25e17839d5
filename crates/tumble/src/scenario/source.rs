//! A scenario and where it came from.

use super::embedded::EMBEDDED;
use super::written::{DriveTable, PropulsionName, Scenario};
use crate::{TumbleError, robots};
use std::fs;
use std::path::{Path, PathBuf};
use tumble_formats::FormatsError;
use tumble_formats::body_file::{self, BodyFile};
use tumble_formats::log::shortened;
use tumble_formats::text_file::{self, printable};
use tumble_formats::{ActuatorPreset, Robots, place, toml_text};

/// A scenario with the text it came from, so that errors can name line and column.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenarioSource {
    /// The file, or the name of an embedded scenario.
    pub path: PathBuf,
    /// The text.
    pub text: String,
    /// What it says.
    pub scenario: Scenario,
    /// The robots whose bodies and actuators it may name: those that come with the program, unless told.
    pub robots: Robots,
}

impl ScenarioSource {
    /// A file of this name, or else an embedded scenario.
    ///
    /// # Errors
    /// [`TumbleError::NoSuchScenario`], [`FormatsError::Unreadable`], [`TumbleError::BadScenario`].
    pub fn find(name: &str) -> Result<Self, TumbleError> {
        let path = Path::new(name);
        let embedded = EMBEDDED.iter().find(|embedded| embedded.name == name);
        // a folder of that name, such as one of results, hides nothing
        if !path.exists() || (path.is_dir() && embedded.is_some()) {
            return match embedded {
                Some(embedded) => Self::parse(path, embedded.text),
                None => Err(TumbleError::NoSuchScenario {
                    name: shortened(name),
                    nearest: place::suggestion(name, EMBEDDED.iter().map(|embedded| embedded.name)),
                }),
            };
        }
        let text = text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
        Self::parse(path, &text)
    }

    /// From text; `path` is for errors and for the files that the scenario names.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`] with line and column.
    pub fn parse(path: &Path, text: &str) -> Result<Self, TumbleError> {
        let scenario = toml_text::read(text).map_err(|error| {
            let (line, column) = place::of_offset(text, error.offset());
            let message = place::with_suggestion(&error.message());
            TumbleError::BadScenario { path: path.into(), line, column, message }
        })?;
        Ok(Self { path: path.into(), text: text.to_owned(), scenario, robots: robots::shipped() })
    }

    /// The same among these robots, whose bodies and actuators it may name.
    #[must_use]
    pub fn among(self, robots: &Robots) -> Self {
        Self { robots: robots.clone(), ..self }
    }

    /// What makes wrenches, in a few words.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`] for actuators that no robot has.
    pub fn describe_propulsion(&self) -> Result<&'static str, TumbleError> {
        Ok(match &self.scenario.propulsion.kind {
            PropulsionName::Plant => "nozzles, servos and impellers",
            PropulsionName::Limited => "whatever is wanted within limits",
            PropulsionName::Exact => "whatever is wanted",
            PropulsionName::Named(name) => self.actuators_named(name)?.sentence,
        })
    }

    /// The actuators of a robot.
    pub(super) fn actuators_named(&self, name: &str) -> Result<ActuatorPreset, TumbleError> {
        self.robots.actuators(name).map_err(|unknown| {
            let names = [&["plant", "limited", "exact"], unknown.known.as_slice()].concat();
            let near = place::suggestion(name, names.iter().copied());
            self.bad("propulsion.kind", &format!("`{}` is none of {}{near}", unknown.asked, names.join(", ")))
        })
    }

    /// The folder that files are relative to.
    pub(crate) fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// That a key has an impossible value.
    pub(super) fn bad(&self, key: &str, message: &str) -> TumbleError {
        let (line, column) = place::of_key(&self.text, key);
        let message = printable(&format!("`{key}`: {message}")).replace('\n', " ");
        TumbleError::BadScenario { path: self.path.clone(), line, column, message }
    }

    /// That a key in the `index`-th table of an array has an impossible value.
    pub(super) fn bad_in(&self, table: &str, index: usize, key: &str, message: &str) -> TumbleError {
        let (line, column) = place::of_key_in(&self.text, table, index, key);
        let message = printable(&format!("`{table}.{key}`: {message}")).replace('\n', " ");
        TumbleError::BadScenario { path: self.path.clone(), line, column, message }
    }

    /// The files that it names.
    pub fn files(&self) -> Vec<&Path> {
        let Scenario { body, belief, payload, drive, .. } = &self.scenario;
        let bodies = [body, belief].map(|body| body.as_ref().and_then(|body| body.file.as_deref()));
        let payload = payload.as_ref().and_then(|payload| payload.file.as_deref());
        let others = [payload, drive.excitation.as_deref(), drive.wrenches.as_deref()];
        bodies.into_iter().chain(others).flatten().collect()
    }

    /// The same without what drives a simulation, which a mission does not ask for.
    #[must_use]
    pub fn without_drive(&self) -> Self {
        let mut alone = self.clone();
        alone.scenario.drive = DriveTable::default();
        alone
    }

    /// The scenario as TOML that is valid wherever it lies: bodies in place of the files that hold them, the other files by their absolute paths.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`]; the errors of files that it names.
    pub fn to_toml(&self) -> Result<String, TumbleError> {
        let mut scenario = self.scenario.clone();
        let read = |file: &mut Option<PathBuf>| -> Result<Option<BodyFile>, TumbleError> {
            let path = file.take().map(|file| self.folder().join(file));
            Ok(path.as_deref().map(body_file::read_written).transpose()?)
        };
        for body in [&mut scenario.body, &mut scenario.belief].into_iter().flatten() {
            if let Some(BodyFile { mass_kg, com_m, inertia_about_com_kg_m2 }) = read(&mut body.file)? {
                (body.mass_kg, body.com_m) = (Some(mass_kg), Some(com_m));
                body.inertia_about_com_kg_m2 = Some(inertia_about_com_kg_m2);
            }
        }
        if let Some(body) = &mut scenario.payload
            && let Some(BodyFile { mass_kg, com_m, inertia_about_com_kg_m2 }) = read(&mut body.file)?
        {
            (body.mass_kg, body.com_m) = (Some(mass_kg), Some(com_m));
            body.inertia_about_com_kg_m2 = Some(inertia_about_com_kg_m2);
        }
        for file in [&mut scenario.drive.excitation, &mut scenario.drive.wrenches].into_iter().flatten() {
            let path = self.folder().join(&*file);
            *file = fs::canonicalize(&path).map_err(|source| FormatsError::Unreadable { path, source })?;
        }
        toml::to_string(&scenario).map_err(|error| self.bad("format", &error.to_string()))
    }
}
