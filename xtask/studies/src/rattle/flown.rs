//! Missions of the study: which are flown, and what is read from their records.

use std::fmt;

use tumble::TumbleError;
use tumble::mission::{FlyOptions, LayerNames, MissionRecord, ModelChoice, NoHooks, StretchRow, WeightingChoice, fly};
use tumble::scenario::ScenarioSource;

use super::bad;
use crate::Failure;
use crate::actuation::Section;
use crate::model_knowledge::{each_seed, median};

/// Places of mass and moments of inertia among the ten parameters of a summary.
pub const MASS: usize = 0;
pub const IXX: usize = 4;
pub const IYY: usize = 5;
pub const IZZ: usize = 6;
/// The parameters of the thesis.
pub const FOUR: [(usize, &str); 4] = [(MASS, "m"), (IXX, "Ixx"), (IYY, "Iyy"), (IZZ, "Izz")];

/// What the robot carries.
#[derive(Clone, Copy, PartialEq)]
pub enum Load {
    /// As the scenario has it.
    AsWritten,
    Nothing,
    /// Table 6.2's, held from the start on.
    Table62,
}

/// What is flown with every seed.
#[derive(Clone, Copy)]
pub struct Condition {
    pub scenario: &'static str,
    pub load: Load,
    pub weighting: WeightingChoice,
    pub feedback: bool,
    pub model: ModelChoice,
    /// Name of the sensors.
    pub sensing: &'static str,
}

impl Condition {
    /// RATTLE as it is meant: weights by covariance, updates on.
    pub fn rattle(scenario: &'static str, sensing: &'static str) -> Self {
        let (weighting, model) = (WeightingChoice::Covariance, ModelChoice::Scenario);
        Self { scenario, load: Load::AsWritten, weighting, feedback: true, model, sensing }
    }

    /// Without information weights.
    pub fn plain(self) -> Self {
        Self { weighting: WeightingChoice::None, ..self }
    }

    /// Estimates reach neither planners nor controller.
    pub fn without_updates(self) -> Self {
        Self { feedback: false, ..self }
    }

    pub fn source(self) -> Result<ScenarioSource, TumbleError> {
        let source = ScenarioSource::find(self.scenario)?.sensed_by(self.sensing)?;
        let payload = match self.load {
            Load::AsWritten => return Ok(source),
            Load::Nothing => None,
            Load::Table62 => {
                let mut payload = ScenarioSource::find("granite-grasp")?.scenario.payload;
                if let Some(payload) = &mut payload {
                    payload.attach_s = 0.0;
                }
                payload
            }
        };
        let mut changed = source.clone();
        changed.scenario.payload = payload;
        let text = changed.to_toml()?;
        ScenarioSource::parse(&source.path, &text)
    }

    pub fn options(self, seed: u64) -> FlyOptions {
        let Self { weighting, feedback, model, .. } = self;
        FlyOptions { seed, weighting, feedback, model, fault: None, layers: LayerNames::default() }
    }

    fn fly(self, seed: u64) -> Result<MissionRecord, TumbleError> {
        fly(&self.source()?, &self.options(seed), &mut NoHooks)
    }
}

/// Every condition with the seeds 1 to `seeds`: by condition, then seed.
pub fn fly_all<const N: usize>(conditions: [Condition; N], seeds: usize) -> Result<[Vec<MissionRecord>; N], Failure> {
    let flown = each_seed(N * seeds, |k| conditions[k as usize / seeds].fly(1 + k % seeds as u64));
    let mut flown = flown.into_iter().collect::<Result<Vec<_>, _>>().map_err(bad)?.into_iter();
    Ok(std::array::from_fn(|_| flown.by_ref().take(seeds).collect()))
}

/// Of so many missions: how many arrive, and how many touch nothing and keep every limit.
struct Safety {
    arrived: usize,
    sound: usize,
    count: usize,
    least_m: f64,
}

impl Safety {
    fn of(records: &[MissionRecord]) -> Self {
        Self {
            arrived: records.iter().filter(|one| one.summary.arrived).count(),
            sound: records.iter().filter(|one| one.summary.unsafe_because().is_none()).count(),
            count: records.len(),
            least_m: records.iter().filter_map(|one| one.summary.min_clearance_m).fold(f64::INFINITY, f64::min),
        }
    }
}

impl fmt::Display for Safety {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { arrived, sound, count, least_m } = self;
        write!(
            f,
            "{arrived} of {count} arrive, {sound} of {count} without contact or a limit passed; least clearance {least_m:.3} m"
        )
    }
}

/// What must be so of every mission: it arrives, touches nothing, keeps every limit.
pub fn must_arrive(section: &mut Section, name: &str, records: &[MissionRecord]) {
    let safety = Safety::of(records);
    let is_safe = safety.arrived == safety.count && safety.sound == safety.count;
    section.must(is_safe, &format!("{name}: {safety}"));
}

/// The same of missions that nobody promises anything of.
pub fn may_arrive(section: &mut Section, name: &str, records: &[MissionRecord]) {
    section.line(format!("- {name}: {}", Safety::of(records)));
}

/// Median and extremes.
pub fn band(values: impl IntoIterator<Item = f64>) -> String {
    let values: Vec<f64> = values.into_iter().collect();
    if let [one] = values[..] {
        return format!("{one:.3}");
    }
    let [low, high] = extremes(&values);
    format!("{:.3} [{low:.3}, {high:.3}]", median(values))
}

pub fn extremes(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(*x), high.max(*x)])
}

/// Row of the series at a time.
pub fn row_at(record: &MissionRecord, time_s: f64) -> usize {
    record.series.t_s.partition_point(|t| *t <= time_s).saturating_sub(1)
}

/// Information about a parameter over time: inverse variances, the first of them taken away.
pub fn information(record: &MissionRecord, parameter: usize) -> Vec<(f64, f64)> {
    let of = |sigma: &[f64; 10]| sigma[parameter].powi(-2);
    let first = record.series.sigma.first().map_or(0.0, of);
    record.series.t_s.iter().zip(&record.series.sigma).map(|(t, sigma)| (*t, of(sigma) - first)).collect()
}

/// Information at a time.
pub fn information_at(record: &MissionRecord, parameter: usize, time_s: f64) -> f64 {
    information(record, parameter).get(row_at(record, time_s)).map_or(f64::NAN, |(_, information)| *information)
}

/// Relative error of the estimate of a parameter at a time.
pub fn error_at(record: &MissionRecord, parameter: usize, time_s: f64) -> f64 {
    let truth = record.summary.parameters.get(parameter).map_or(f64::NAN, |row| row.truth);
    let found = record.series.estimate.get(row_at(record, time_s)).map_or(f64::NAN, |ten| ten[parameter]);
    (found / truth - 1.0).abs()
}

/// Error of the last estimate in its own standard deviations.
pub fn score(record: &MissionRecord, parameter: usize) -> f64 {
    record.summary.parameters.get(parameter).map_or(f64::NAN, |row| ((row.estimate - row.truth) / row.sigma).abs())
}

/// Name that a stretch has for a parameter.
pub fn name_of(record: &MissionRecord, parameter: usize) -> &str {
    record.summary.parameters.get(parameter).map_or("", |row| &row.name)
}

/// Weight of a parameter in a stretch; zero where it has none.
pub fn weight(stretch: &StretchRow, name: &str) -> f64 {
    let index = stretch.quantities.iter().position(|quantity| quantity == name);
    index.and_then(|index| stretch.weights.get(index)).copied().unwrap_or(0.0)
}

/// Weights over time as steps, over the largest.
pub fn weights_over_time(record: &MissionRecord, name: &str) -> Vec<(f64, f64)> {
    let most = record.stretches.iter().map(|stretch| weight(stretch, name)).fold(0.0, f64::max);
    let of = |stretch: &StretchRow| if most > 0.0 { weight(stretch, name) / most } else { 0.0 };
    let ends = record.stretches.iter().skip(1).map(|next| next.start_s).chain([record.summary.mission_s]);
    let steps = record.stretches.iter().zip(ends);
    steps.flat_map(|(stretch, end_s)| [(stretch.start_s, of(stretch)), (end_s, of(stretch))]).collect()
}

/// Root mean square of the torque that acted within a span of time, N m.
pub fn torque_rms(record: &MissionRecord, from_s: f64, until_s: f64) -> f64 {
    let within =
        record.series.t_s.iter().zip(&record.series.torque_n_m).filter(|(t, _)| **t >= from_s && **t < until_s);
    let (count, sum) =
        within.fold((0.0, 0.0), |(count, sum), (_, [x, y, z])| (count + 1.0, sum + x * x + y * y + z * z));
    f64::sqrt(sum / count)
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact cases")]
mod tests {
    use super::*;

    #[test]
    fn a_band_is_the_median_between_the_extremes() {
        assert_eq!(band([3.0, 1.0, 2.0]), "2.000 [1.000, 3.000]");
        assert_eq!(band([0.5]), "0.500");
    }

    /// Held from the start, the payload of table 6.2 is a part of what flies; without a payload only the robot is.
    #[test]
    fn loads_are_carried() {
        let mass = |load: Load| {
            let condition = Condition { load, ..Condition::rattle("granite-cargo", "nominal") };
            condition.source().and_then(|source| source.mission(&condition.options(1))).unwrap().truth.mass
        };
        let robot = mass(Load::Nothing);
        assert!((mass(Load::AsWritten) - robot - 6.0).abs() < 1e-9);
        assert!((mass(Load::Table62) - robot - 11.8).abs() < 1e-9);
    }

    #[test]
    fn a_stretch_has_a_weight_for_what_it_names() {
        let stretch = |weight: f64| StretchRow {
            quantities: vec!["mass".to_owned()],
            weights: vec![weight],
            ..StretchRow::default()
        };
        assert_eq!(weight(&stretch(3.0), "mass"), 3.0);
        assert_eq!(weight(&stretch(3.0), "inertia_zz"), 0.0);
    }
}
