//! What the rows of a campaign say: rates, medians, and differences between options over the same seeds.

use super::CampaignPlan;
use super::row::{NO_DOUBT, PARAMETERS, Row, Status, column};
use super::statistics::{bound_of_none_95, median, median_interval_95, quantile, wilson_95};
use serde::Serialize;
use std::collections::BTreeMap;

/// `summary.json` of a campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Analysis {
    /// Version of the format: 1.
    pub format: u32,
    /// Seed of the campaign.
    pub seed: u64,
    /// Of all missions together.
    pub all: GroupSummary,
    /// Of each combination of scenario and options.
    pub combinations: Vec<GroupSummary>,
    /// Of pairs of combinations that differ in one factor.
    pub comparisons: Vec<Comparison>,
}

/// What a group of missions did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroupSummary {
    /// What of its options varies within the campaign.
    pub label: String,
    /// Rows.
    pub missions: u64,
    /// Flown to their end.
    pub flown: u64,
    /// Refused with an error.
    pub errors: u64,
    /// Ended by a panic.
    pub panics: u64,
    /// Came to rest at the goal; errors and panics did not.
    pub arrived: Rate,
    /// Touched something; of those flown.
    pub collisions: Rate,
    /// Passed a limit in one control period or more; of those flown.
    pub violations: Rate,
    /// Left the controller's main road; of those flown.
    pub fallbacks: Rate,
    /// Ended with a doubt of body, map or actuators; of those flown.
    pub doubted: Rate,
    /// Hours of all flights together.
    pub flown_h: f64,
    /// How often a body, the map and actuators were doubted in them; of healthy robots these are false alarms.
    pub alarms: [u64; 3],
    /// Standard deviations that stretches promised and that were stated at their ends to within a factor of 0.7 to 1.4.
    pub promises_kept: Rate,
    /// Least distance from anything, m.
    pub min_clearance_m: Option<Spread>,
    /// Time, s.
    pub mission_s: Option<Spread>,
    /// Integral of the force's magnitude, N s.
    pub impulse_n_s: Option<Spread>,
    /// Distance from what was to be flown, root mean square of each mission, m.
    pub rms_tracking_all_m: Option<Spread>,
    /// The same of the last quarter.
    pub rms_tracking_last_leg_m: Option<Spread>,
    /// Error of the mass, %.
    pub mass_error_percent: Option<Spread>,
    /// Largest error of the three moments of inertia, each in % of itself.
    pub inertia_error_percent: Option<Spread>,
    /// Distance between centre of mass and estimate, mm.
    pub com_error_mm: Option<Spread>,
    /// Of each parameter.
    pub parameters: Vec<ParameterSummary>,
}

/// How often something happened.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rate {
    /// Times.
    pub count: u64,
    /// Of so many.
    pub of: u64,
    /// Wilson's 95 % interval.
    pub low: Option<f64>,
    /// Its other end.
    pub high: Option<f64>,
    /// Where it never happened: 3/n, which with 95 % confidence it happens less often than.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_of_none: Option<f64>,
}

impl Rate {
    /// Of a count.
    pub fn new(count: u64, of: u64) -> Self {
        let interval = wilson_95(count, of);
        let bound_of_none = if count == 0 { bound_of_none_95(of) } else { None };
        Self { count, of, low: interval.map(|i| i.0), high: interval.map(|i| i.1), bound_of_none }
    }
}

/// Quantiles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Of so many values.
    pub n: u64,
    /// Least.
    pub min: f64,
    /// 5 % are below.
    pub p5: f64,
    /// Half are below.
    pub median: f64,
    /// 95 % are below.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    /// Of values in any order; `None` of nothing.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.into_iter().collect();
        let median = median(&mut values)?;
        let at = |share| quantile(&values, share);
        Some(Self { n: values.len() as u64, min: at(0.0)?, p5: at(0.05)?, median, p95: at(0.95)?, max: at(1.0)? })
    }
}

/// What became of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterSummary {
    /// Its name.
    pub name: &'static str,
    /// Magnitude of the error in its unit.
    pub error: Option<Spread>,
    /// Standard deviation stated at the end.
    pub sigma: Option<Spread>,
    /// Error at most twice the stated standard deviation.
    pub within_2_sigma: Rate,
}

/// Two combinations that differ in one factor, flown with the same seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The factor.
    pub factor: &'static str,
    /// The combination that is compared with: the first level.
    pub baseline: String,
    /// The other one.
    pub other: String,
    /// Seeds that both flew to the end.
    pub pairs: u64,
    /// What differs.
    pub differences: Vec<Difference>,
}

/// How much something differs over the same seeds: other less baseline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Column, or a name as in [`GroupSummary`].
    pub quantity: &'static str,
    /// Median of the baseline.
    pub baseline_median: f64,
    /// Median of the other.
    pub other_median: f64,
    /// Median of the differences.
    pub median: f64,
    /// 95 % interval of that median, by a seeded bootstrap over the seeds.
    pub low: Option<f64>,
    /// Its other end.
    pub high: Option<f64>,
}

type Measure = fn(&Columns, &Row) -> Option<f64>;

/// What is compared in pairs.
const MEASURES: [(&str, Measure); 10] = [
    ("mission_s", |c, row| row.number(c.mission_s)),
    ("min_clearance_m", |c, row| row.number(c.clearance)),
    ("impulse_n_s", |c, row| row.number(c.impulse)),
    ("rms_tracking_all_m", |c, row| row.number(c.rms_all)),
    ("rms_tracking_last_leg_m", |c, row| row.number(c.rms_last)),
    ("mass_error_percent", |c, row| c.relative_error(row, 0)),
    ("inertia_error_percent", Columns::inertia_error),
    ("com_error_mm", Columns::com_error_mm),
    ("mass_sigma", |c, row| row.number(c.of(0)?.sigma)),
    ("inertia_zz_sigma", |c, row| row.number(c.of(9)?.sigma)),
];

/// Where the moments of inertia stand among the parameters.
const MOMENTS: [usize; 3] = [4, 7, 9];

/// Columns of a parameter.
#[derive(Clone, Copy)]
struct OfParameter {
    truth: usize,
    estimate: usize,
    sigma: usize,
}

/// Where things stand in a row; looked up once.
struct Columns {
    status: usize,
    arrived: usize,
    collided: usize,
    violations: usize,
    fallbacks: usize,
    doubts: usize,
    alarms: [usize; 3],
    promises: [usize; 2],
    mission_s: usize,
    clearance: usize,
    impulse: usize,
    rms_all: usize,
    rms_last: usize,
    parameters: Vec<OfParameter>,
}

impl Columns {
    fn new() -> Self {
        // A name that is none would read nothing; `every_column_is_there` keeps that from happening.
        let at = |name: &str| column(name).unwrap_or(usize::MAX);
        let of = |name: &&str| OfParameter {
            truth: at(&format!("{name}_truth")),
            estimate: at(&format!("{name}_estimate")),
            sigma: at(&format!("{name}_sigma")),
        };
        Self {
            status: at("status"),
            arrived: at("arrived"),
            collided: at("collided"),
            violations: at("limit_violations"),
            fallbacks: at("fallbacks"),
            doubts: at("doubts_at_end"),
            alarms: ["doubts_of_body", "doubts_of_map", "doubts_of_actuators"].map(at),
            promises: ["promises_kept", "promises_made"].map(at),
            mission_s: at("mission_s"),
            clearance: at("min_clearance_m"),
            impulse: at("impulse_n_s"),
            rms_all: at("rms_tracking_all_m"),
            rms_last: at("rms_tracking_last_leg_m"),
            parameters: PARAMETERS.iter().map(of).collect(),
        }
    }

    fn of(&self, parameter: usize) -> Option<OfParameter> {
        self.parameters.get(parameter).copied()
    }

    fn is(&self, row: &Row, status: Status) -> bool {
        row.text(self.status) == status.name()
    }

    /// Estimate less truth.
    fn error(&self, row: &Row, parameter: usize) -> Option<f64> {
        let of = self.of(parameter)?;
        Some(row.number(of.estimate)? - row.number(of.truth)?)
    }

    /// Magnitude of the error in % of the truth.
    fn relative_error(&self, row: &Row, parameter: usize) -> Option<f64> {
        let truth = row.number(self.of(parameter)?.truth)?;
        Some(100.0 * (self.error(row, parameter)? / truth).abs())
    }

    fn inertia_error(&self, row: &Row) -> Option<f64> {
        MOMENTS.iter().filter_map(|moment| self.relative_error(row, *moment)).reduce(f64::max)
    }

    fn com_error_mm(&self, row: &Row) -> Option<f64> {
        let squares = [1, 2, 3].into_iter().filter_map(|axis| self.error(row, axis)).map(|error_m| error_m * error_m);
        Some(1000.0 * squares.reduce(|a, b| a + b)?.sqrt())
    }

    fn within_2_sigma(&self, row: &Row, parameter: usize) -> Option<bool> {
        Some(self.error(row, parameter)?.abs() <= 2.0 * row.number(self.of(parameter)?.sigma)?)
    }
}

impl Analysis {
    /// Of the rows of a campaign.
    pub fn new(plan: &CampaignPlan, rows: &[Row]) -> Self {
        let columns = Columns::new();
        let mut groups: Vec<BTreeMap<u64, &Row>> = vec![BTreeMap::new(); plan.combinations()];
        for row in rows {
            let Some(mission) = plan.mission(row.number) else { continue };
            if let Some(group) = groups.get_mut(mission.combination) {
                group.insert(mission.k, row);
            }
        }
        let combinations = (0..)
            .zip(&groups)
            .map(|(index, group)| GroupSummary::new(plan.label(index), &columns, &group.values().copied()))
            .collect();
        Self {
            format: 1,
            seed: plan.configuration().master_seed,
            all: GroupSummary::new("all".to_owned(), &columns, &rows.iter()),
            combinations,
            comparisons: comparisons(plan, &columns, &groups),
        }
    }

    /// Of the rows of a part: counts only.
    pub fn of_part(plan: &CampaignPlan, rows: &[Row]) -> Self {
        let all = GroupSummary::new("part".to_owned(), &Columns::new(), &rows.iter());
        let seed = plan.configuration().master_seed;
        Self { format: 1, seed, all, combinations: Vec::new(), comparisons: Vec::new() }
    }

    /// Whether every mission arrived, touched nothing and kept every limit.
    pub fn is_clean(&self) -> bool {
        let all = &self.all;
        all.arrived.count == all.missions && all.collisions.count == 0 && all.violations.count == 0
    }
}

impl GroupSummary {
    fn new<'a>(label: String, columns: &Columns, rows: &(impl Iterator<Item = &'a Row> + Clone)) -> Self {
        let with = |status| rows.clone().filter(|row| columns.is(row, status)).count() as u64;
        let flown = || rows.clone().filter(|row| columns.is(row, Status::Flown));
        let (missions, errors, panics) = (rows.clone().count() as u64, with(Status::Error), with(Status::Panic));
        let planned = with(Status::Planned);
        let flown_count = with(Status::Flown);
        let times = |has: &dyn Fn(&Row) -> bool| flown().filter(|row| has(row)).count() as u64;
        let rate = |has: &dyn Fn(&Row) -> bool| Rate::new(times(has), flown_count);
        let some = |column: usize| move |row: &Row| row.number(column).is_some_and(|value| value > 0.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a sum of counts")]
        let total = |column: usize| flown().filter_map(|row| row.number(column)).sum::<f64>() as u64;
        let spread = |value: &dyn Fn(&Row) -> Option<f64>| Spread::of(flown().filter_map(value));
        let parameter = |(index, name): (usize, &&'static str)| {
            let judged = || flown().filter_map(|row| columns.within_2_sigma(row, index));
            let within = Rate::new(judged().filter(|within| *within).count() as u64, judged().count() as u64);
            ParameterSummary {
                name,
                error: spread(&|row| columns.error(row, index).map(f64::abs)),
                sigma: spread(&|row| row.number(columns.of(index)?.sigma)),
                within_2_sigma: within,
            }
        };
        Self {
            label,
            missions,
            flown: flown_count,
            errors,
            panics,
            arrived: Rate::new(times(&|row| row.flag(columns.arrived) == Some(true)), missions - planned),
            collisions: rate(&|row| row.flag(columns.collided) == Some(true)),
            violations: rate(&some(columns.violations)),
            fallbacks: rate(&some(columns.fallbacks)),
            doubted: rate(&|row| row.text(columns.doubts) != NO_DOUBT),
            flown_h: flown().filter_map(|row| row.number(columns.mission_s)).sum::<f64>() / 3600.0,
            alarms: columns.alarms.map(total),
            promises_kept: Rate::new(total(columns.promises[0]), total(columns.promises[1])),
            min_clearance_m: spread(&|row| row.number(columns.clearance)),
            mission_s: spread(&|row| row.number(columns.mission_s)),
            impulse_n_s: spread(&|row| row.number(columns.impulse)),
            rms_tracking_all_m: spread(&|row| row.number(columns.rms_all)),
            rms_tracking_last_leg_m: spread(&|row| row.number(columns.rms_last)),
            mass_error_percent: spread(&|row| columns.relative_error(row, 0)),
            inertia_error_percent: spread(&|row| columns.inertia_error(row)),
            com_error_mm: spread(&|row| columns.com_error_mm(row)),
            parameters: PARAMETERS.iter().enumerate().map(parameter).collect(),
        }
    }
}

/// Every combination against the one that has the first level of one factor and is otherwise the same.
fn comparisons(plan: &CampaignPlan, columns: &Columns, groups: &[BTreeMap<u64, &Row>]) -> Vec<Comparison> {
    let mut found = Vec::new();
    for (factor, place, levels) in plan.compared_factors() {
        for (other, rows) in groups.iter().enumerate() {
            let level = other / place % levels;
            if level == 0 {
                continue;
            }
            let baseline = other - level * place;
            let Some(baseline_rows) = groups.get(baseline) else { continue };
            let pairs: Vec<(&Row, &Row)> = rows
                .iter()
                .filter_map(|(k, row)| Some((*baseline_rows.get(k)?, *row)))
                .filter(|(a, b)| columns.is(a, Status::Flown) && columns.is(b, Status::Flown))
                .collect();
            let seed = (plan.configuration().master_seed).wrapping_add((other as u64) << 8);
            let differences = (0..)
                .zip(MEASURES)
                .filter_map(|(index, measure)| difference(measure, columns, &pairs, seed.wrapping_add(index)))
                .collect();
            found.push(Comparison {
                factor,
                baseline: plan.label(baseline),
                other: plan.label(other),
                pairs: pairs.len() as u64,
                differences,
            });
        }
    }
    found
}

fn difference(
    (quantity, measure): (&'static str, Measure),
    columns: &Columns,
    pairs: &[(&Row, &Row)],
    seed: u64,
) -> Option<Difference> {
    let (mut baseline, mut other): (Vec<f64>, Vec<f64>) =
        pairs.iter().filter_map(|(a, b)| Some((measure(columns, a)?, measure(columns, b)?))).unzip();
    let mut differences: Vec<f64> = baseline.iter().zip(&other).map(|(a, b)| b - a).collect();
    let interval = median_interval_95(&differences, seed);
    Some(Difference {
        quantity,
        median: median(&mut differences)?,
        baseline_median: median(&mut baseline)?,
        other_median: median(&mut other)?,
        low: interval.as_ref().map(|interval| *interval.start()),
        high: interval.as_ref().map(|interval| *interval.end()),
    })
}
