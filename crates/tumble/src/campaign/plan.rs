//! Which mission a row is: scenarios, options and seeds as a full factorial in one stated order.

use super::factors::value_name;
use super::seeds::mission_seed;
use crate::TumbleError;
use crate::mission::{FaultChoice, FlyOptions, LayerNames, ModelChoice, WeightingChoice};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Most rows of a campaign.
const MOST_ROWS: u64 = 1_000_000;
/// Most shards of a campaign.
const MOST_SHARDS: u64 = 100_000;

/// All that decides the rows of a campaign, and nothing else: not who computes them, nor where.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignConfiguration {
    /// Version of the format: 1.
    pub format: u32,
    /// Version of the program.
    pub version: String,
    /// What it was built from: a commit, or else a hash of the program.
    pub build: String,
    /// All seeds follow from it.
    pub master_seed: u64,
    /// Seeds; each combination of options flies with each of them.
    pub missions: u64,
    /// Whether payload and belief are drawn by each mission's seed, and how far beyond a factor of two the belief may then be off, as
    /// a share.
    pub draw: Option<f64>,
    /// Layers of all missions that are not the scenarios'.
    #[serde(default, skip_serializing_if = "LayerNames::are_usual")]
    pub layers: LayerNames,
    /// Sensors that are flown with instead of the scenarios', as they were named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensing: Option<String>,
    /// Whether nothing is flown.
    pub dry_run: bool,
    /// Scenarios.
    pub scenarios: Vec<ScenarioEntry>,
    /// Faults.
    pub faults: Vec<Option<FaultChoice>>,
    /// What the robot is taken for at the start.
    pub models: Vec<ModelChoice>,
    /// Whether estimates reach planners and controller.
    pub feedbacks: Vec<bool>,
    /// What information is worth.
    pub weightings: Vec<WeightingChoice>,
}

/// A scenario as it was named, and what its text and files were.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioEntry {
    /// A file, or the name of an embedded scenario.
    pub name: String,
    /// Hash of its text and of the files it names.
    pub hash: String,
}

/// One mission of a campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedMission {
    /// Number of the row, from zero.
    pub row: u64,
    /// Number of the seed, from zero.
    pub k: u64,
    /// Number of the combination of scenario and options, from zero.
    pub combination: usize,
    /// Scenario, its index in [`CampaignConfiguration::scenarios`].
    pub scenario: usize,
    /// Its name as it was given.
    pub scenario_name: String,
    /// Whether payload and belief are drawn by the seed, and how far beyond a factor of two the belief may then be off.
    pub draw: Option<f64>,
    /// Sensors instead of the scenario's, as they were named.
    pub sensing: Option<String>,
    /// Options, the seed among them.
    pub options: FlyOptions,
}

impl PlannedMission {
    /// The command that flies this mission again.
    pub fn replay(&self) -> String {
        let draw = match self.draw {
            None => String::new(),
            Some(outside) if outside > 0.0 => format!(" --draw --outside {outside}"),
            Some(_) => " --draw".to_owned(),
        };
        let sensing = self.sensing.as_ref().map_or_else(String::new, |name| format!(" --sensing {}", shell_word(name)));
        format!("tumble fly {} {}{draw}{sensing}", shell_word(&self.scenario_name), fly_arguments(&self.options))
    }
}

/// A word as a shell takes it.
fn shell_word(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// The rows of a campaign.
///
/// Rows are counted with the seed outermost, then scenario, fault, model, feedback, weighting: row = k * combinations + combination.
/// So each seed meets every combination, and what differs between two combinations is not the seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct CampaignPlan {
    configuration: CampaignConfiguration,
    combinations: usize,
}

impl CampaignPlan {
    /// Lays the campaign out.
    ///
    /// # Errors
    /// [`TumbleError::BadOption`]: no mission, too many, or a level that stands twice.
    pub fn try_new(configuration: CampaignConfiguration) -> Result<Self, TumbleError> {
        let bad = |message: String| Err(TumbleError::BadOption { message });
        let c = &configuration;
        let names: Vec<&str> = c.scenarios.iter().map(|scenario| scenario.name.as_str()).collect();
        let twice = [
            ("scenario", repeats(&names)),
            ("--fault", repeats(&c.faults)),
            ("--model", repeats(&c.models)),
            ("--feedback", repeats(&c.feedbacks)),
            ("--weighting", repeats(&c.weightings)),
        ];
        if let Some((factor, _)) = twice.iter().find(|(_, twice)| *twice) {
            return bad(format!("a value of `{factor}` is empty or stands twice; each would be flown once"));
        }
        let levels = [c.scenarios.len(), c.faults.len(), c.models.len(), c.feedbacks.len(), c.weightings.len()];
        let combinations = levels.iter().fold(1_usize, |product, count| product.saturating_mul(*count));
        let rows = (combinations as u64).saturating_mul(c.missions);
        if rows == 0 || rows > MOST_ROWS {
            return bad(format!(
                "`--missions {}`: with {combinations} combinations of scenarios and options these are {rows} missions; at least one \
                 and at most {MOST_ROWS}",
                c.missions
            ));
        }
        Ok(Self { configuration, combinations })
    }

    /// What it was laid out from.
    pub fn configuration(&self) -> &CampaignConfiguration {
        &self.configuration
    }

    /// Number of combinations of scenario and options.
    pub fn combinations(&self) -> usize {
        self.combinations
    }

    /// Number of rows.
    pub fn rows(&self) -> u64 {
        self.combinations as u64 * self.configuration.missions
    }

    /// The mission of a row; `None` beyond the last.
    pub fn mission(&self, row: u64) -> Option<PlannedMission> {
        if row >= self.rows() {
            return None;
        }
        let c = &self.configuration;
        let combinations = self.combinations as u64;
        let (k, combination) = (row / combinations, usize::try_from(row % combinations).ok()?);
        let mut rest = combination;
        let mut level = |count: usize| {
            let index = rest % count;
            rest /= count;
            index
        };
        // the last factor turns fastest
        let weighting = *c.weightings.get(level(c.weightings.len()))?;
        let feedback = *c.feedbacks.get(level(c.feedbacks.len()))?;
        let model = *c.models.get(level(c.models.len()))?;
        let fault = *c.faults.get(level(c.faults.len()))?;
        let scenario = level(c.scenarios.len());
        let options =
            FlyOptions { seed: mission_seed(c.master_seed, k), weighting, feedback, model, fault, layers: c.layers };
        let scenario_name = c.scenarios.get(scenario)?.name.clone();
        Some(PlannedMission {
            row,
            k,
            combination,
            scenario,
            scenario_name,
            draw: c.draw,
            sensing: c.sensing.clone(),
            options,
        })
    }

    /// Factors over which combinations are compared, scenarios aside: name, by how much one level moves the number of the combination,
    /// and how many levels there are.
    pub(super) fn compared_factors(&self) -> [(&'static str, usize, usize); 4] {
        let c = &self.configuration;
        let (weightings, feedbacks, models) = (c.weightings.len(), c.feedbacks.len(), c.models.len());
        [
            ("weighting", 1, weightings),
            ("feedback", weightings, feedbacks),
            ("model", weightings * feedbacks, models),
            ("fault", weightings * feedbacks * models, c.faults.len()),
        ]
    }

    /// Levels of the first factor that varies, with the combinations of each: what a picture shows.
    pub(super) fn drawn_levels(&self) -> Vec<(String, Vec<usize>)> {
        let c = &self.configuration;
        let names: [Vec<String>; 5] = [
            c.weightings.iter().map(value_name).collect(),
            c.feedbacks.iter().map(|on| format!("feedback {}", if *on { "on" } else { "off" })).collect(),
            c.models.iter().map(value_name).collect(),
            c.faults.iter().map(|fault| fault_name(*fault)).collect(),
            c.scenarios.iter().map(|scenario| scenario.name.clone()).collect(),
        ];
        let mut place = 1;
        for levels in names {
            let count = levels.len();
            if count > 1 {
                let of = |level: usize| (0..self.combinations).filter(|other| other / place % count == level).collect();
                return levels.into_iter().enumerate().map(|(level, name)| (name, of(level))).collect();
            }
            place *= count.max(1);
        }
        vec![("all".to_owned(), (0..self.combinations).collect())]
    }

    /// A combination in words: what of it varies within the campaign.
    pub fn label(&self, combination: usize) -> String {
        let Some(mission) = self.mission(combination as u64) else { return String::new() };
        let c = &self.configuration;
        let words = [
            (c.scenarios.len(), mission.scenario_name),
            (c.faults.len(), fault_name(mission.options.fault)),
            (c.models.len(), format!("model {}", value_name(&mission.options.model))),
            (c.feedbacks.len(), format!("feedback {}", if mission.options.feedback { "on" } else { "off" })),
            (c.weightings.len(), format!("weighting {}", value_name(&mission.options.weighting))),
        ];
        let varying: Vec<String> = words.into_iter().filter(|(levels, _)| *levels > 1).map(|(_, word)| word).collect();
        if varying.is_empty() { "all".to_owned() } else { varying.join(", ") }
    }
}

fn fault_name(fault: Option<FaultChoice>) -> String {
    fault.map_or("no fault".to_owned(), |fault| format!("{}:{}", value_name(&fault.name), fault.severity))
}

fn repeats<T: PartialEq>(levels: &[T]) -> bool {
    levels.is_empty()
        || levels.iter().enumerate().any(|(index, level)| levels.iter().take(index).any(|other| other == level))
}

/// One of several equal parts of a campaign, `index/count` with the index from zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    /// Which.
    pub index: u64,
    /// Of how many.
    pub count: u64,
}

impl Shard {
    /// The whole campaign.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Its rows: a block; blocks differ by one row at most and follow one another without a gap.
    pub fn rows(self, all: u64) -> Range<u64> {
        let bound = |index: u64| {
            let product = u128::from(index) * u128::from(all) / u128::from(self.count.max(1));
            u64::try_from(product).unwrap_or(all)
        };
        bound(self.index)..bound(self.index + 1)
    }

    /// Name of its folder.
    pub fn name(self) -> String {
        format!("part-{}-of-{}", self.index, self.count)
    }
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((index, count)) if index < count && count <= MOST_SHARDS => Ok(Self { index, count }),
            _ => Err(format!("INDEX/COUNT with the index from 0 to COUNT - 1, and at most {MOST_SHARDS} shards")),
        }
    }
}

/// Names of what differs between two configurations.
pub(super) fn differing_keys(a: &CampaignConfiguration, b: &CampaignConfiguration) -> String {
    let [a, b] = [a, b].map(|configuration| serde_json::to_value(configuration).unwrap_or_default());
    let keys = a.as_object().into_iter().flatten().filter(|(key, value)| b.get(key.as_str()) != Some(value));
    keys.map(|(key, _)| format!("`{key}`")).collect::<Vec<_>>().join(", ")
}

/// The options of a mission as `tumble fly` takes them, `--seed` first.
pub fn fly_arguments(options: &FlyOptions) -> String {
    let fault =
        options.fault.map_or(String::new(), |fault| format!(" --fault {}:{}", value_name(&fault.name), fault.severity));
    format!(
        "--seed {} --weighting {} --feedback {} --model {}{fault}{}",
        options.seed,
        value_name(&options.weighting),
        if options.feedback { "on" } else { "off" },
        value_name(&options.model),
        options.layers.arguments(),
    )
}
