//! A campaign with missions that are computed instead of flown.

use super::*;
use crate::mission::{
    DoubtOf, DoubtRow, FallbackRow, FaultChoice, FaultName, LayerNames, ModelChoice, ParameterRow, Promises,
    TrackingRms, WeightingChoice,
};
use row::PARAMETERS;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tumble_formats::FormatsError;
use tumble_formats::testing::scratch;
use tumble_identification::noise::Gaussian;

/// A made-up mission, in a few microseconds: the same seed and options give the same numbers.
pub(super) struct Fake;

impl MissionRunner for Fake {
    fn run(&self, mission: &PlannedMission) -> Result<Option<MissionSummary>, TumbleError> {
        match mission.k % 11 {
            7 => Err(TumbleError::BadOption { message: "a \"quoted\" text,\nin two lines".to_owned() }),
            9 if mission.options.feedback => panic!("as planned, {}", mission.k),
            _ => Ok(Some(fake_summary(mission))),
        }
    }
}

/// Makes another campaign of one.
type Change = fn(&mut CampaignConfiguration);

fn standing(what: DoubtOf, is_standing: bool) -> Vec<DoubtRow> {
    let text = "another body would move so".to_owned();
    vec![DoubtRow { what, since_s: 1.0, until_s: (!is_standing).then_some(2.0), text }]
}

fn fake_summary(mission: &PlannedMission) -> MissionSummary {
    let mut random = Gaussian::from_seed(mission.options.seed);
    let gain = if mission.options.weighting == WeightingChoice::None { 2.0 } else { 1.0 };
    let parameter = |(index, name): (usize, &&str)| {
        let truth = 1.0 + index as f64;
        let sigma = 0.01 * gain;
        let estimate = truth + sigma * random.normal();
        ParameterRow { name: (*name).to_owned(), unit: "SI".to_owned(), truth, initial: 1.3 * truth, estimate, sigma }
    };
    let parameters = PARAMETERS.iter().enumerate().map(parameter).collect();
    let clearance = 0.2 + 0.1 * random.normal();
    MissionSummary {
        format: 1,
        scenario: mission.scenario_name.clone(),
        seed: mission.options.seed,
        options: mission.options,
        layers: mission.options.layers.all(),
        arrived: mission.k != 3,
        no_way: None,
        mission_s: 60.0 + random.uniform(),
        min_clearance_m: (!mission.k.is_multiple_of(5)).then_some(clearance),
        limit_violations: 0,
        impulse_n_s: gain * (10.0 + random.uniform()),
        angular_impulse_n_m_s: 1e-7 * random.uniform(),
        rms_tracking_m: TrackingRms { all: 0.01 * random.uniform(), last_leg: 0.005 },
        parameters,
        replans: mission.k % 3,
        belief_revisions: 30,
        fallbacks: vec![FallbackRow { t_s: 1.0, reason: "a, \"b\"".to_owned() }; usize::from(mission.k == 4)],
        faults: BTreeMap::new(),
        information_shut_off_s: BTreeMap::from([("mass".to_owned(), 12.0)]),
        warnings: Vec::new(),
        doubts: standing(DoubtOf::Body, mission.k == 4),
        beyond_localization_s: 0.0,
        promises: Promises { made: 10, kept: mission.k.min(10) },
    }
}

pub(super) fn configuration(missions: u64) -> CampaignConfiguration {
    let scenario = |name: &str| ScenarioEntry { name: name.to_owned(), hash: "fnv1a64:0".to_owned() };
    CampaignConfiguration {
        format: 1,
        version: "0.1.0".to_owned(),
        build: "test".to_owned(),
        master_seed: 5,
        missions,
        draw: Some(0.0),
        layers: LayerNames::default(),
        sensing: None,
        dry_run: false,
        scenarios: vec![scenario("iss-slalom"), scenario("it's, \"mine\".toml")],
        faults: vec![None, Some(FaultChoice { name: FaultName::Drop, severity: 2 })],
        models: vec![ModelChoice::Scenario],
        feedbacks: vec![true, false],
        weightings: vec![WeightingChoice::Covariance, WeightingChoice::None, WeightingChoice::Mass],
    }
}

pub(super) fn plan(missions: u64) -> CampaignPlan {
    CampaignPlan::try_new(configuration(missions)).unwrap()
}

/// All rows, flown by a few threads, without a folder that stays.
pub(super) fn rows_of(plan: &CampaignPlan) -> Vec<Row> {
    let base = scratch("rows");
    let (mut journal, begun) = Journal::open(&base).unwrap();
    let rows = execute(plan, Shard::WHOLE, 3, &Fake, (&mut journal, begun), |_| ()).unwrap();
    fs::remove_dir_all(base).unwrap();
    rows
}

/// Flies a part into its folder.
fn fly_part(plan: &CampaignPlan, shard: Shard, jobs: usize, parts: &Path) -> PathBuf {
    let place = parts.join(shard.name());
    let (mut folder, begun) = CampaignFolder::open(&place, plan.configuration(), shard, false).unwrap();
    let rows = execute(plan, shard, jobs, &Fake, (folder.journal(), begun), |_| ()).unwrap();
    folder.finish(&rows, |_| Ok(())).unwrap()
}

fn refusal(folders: &[PathBuf]) -> String {
    match merge(folders) {
        Err(error @ TumbleError::BadCampaign { .. }) => error.to_string(),
        other => panic!("{:?}", other.map(|(_, rows)| rows.len())),
    }
}

#[test]
fn every_sharding_gives_the_same_bytes() {
    let base = scratch("sharding");
    let plan = plan(7);
    let written = |folder: &Path| {
        let mut files: Vec<(String, Vec<u8>)> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read(&path).unwrap()))
            .collect();
        files.sort();
        files
    };
    let mut first = None;
    for count in [1, 2, 3, 7, 16, 100] {
        let parts = base.join(format!("parts-{count}"));
        // the last part first, and each with another number of threads
        for index in (0..count).rev() {
            fly_part(&plan, Shard { index, count }, 1 + usize::try_from(index).unwrap() % 4, &parts);
        }
        let (merged, rows) = merge(&[parts]).unwrap();
        assert_eq!(rows.len(), 168);
        let analysis = Analysis::new(&merged, &rows);
        let place = write_merged(&base.join(format!("merged-{count}")), &merged, &rows, &analysis, false).unwrap();
        let files = written(&place);
        assert!(files.iter().any(|(name, _)| name == "summary.json") && files.len() >= 6);
        let first = first.get_or_insert_with(|| files.clone());
        assert!(*first == files, "{count} parts");
    }
    // parts themselves merge with others that lie elsewhere
    let single = |index| base.join("parts-3").join(Shard { index, count: 3 }.name());
    assert_eq!(merge(&[single(2), single(0), single(1)]).unwrap().1.len(), 168);
}

#[test]
fn shards_are_blocks_without_gap() {
    for all in [1, 5, 16, 1000] {
        for count in [1, 2, 3, 7, 16, 2000] {
            let mut next = 0;
            for index in 0..count {
                let rows = Shard { index, count }.rows(all);
                assert_eq!(rows.start, next);
                assert!(rows.end - rows.start <= all / count + 1);
                next = rows.end;
            }
            assert_eq!(next, all);
        }
    }
    assert_eq!("3/16".parse(), Ok(Shard { index: 3, count: 16 }));
    for text in ["16/16", "3", "-1/2", "1/0", "a/b", "0/1000000", "1/2/3"] {
        assert!(text.parse::<Shard>().is_err(), "{text}");
    }
}

#[test]
fn options_share_their_seeds() {
    let plan = plan(4);
    assert_eq!((plan.combinations(), plan.rows()), (24, 96));
    let missions: Vec<PlannedMission> = (0..96).map(|row| plan.mission(row).unwrap()).collect();
    for (row, mission) in (0_u64..).zip(&missions) {
        assert_eq!((mission.row, mission.k, mission.combination as u64), (row, row / 24, row % 24));
        assert_eq!(mission.options.seed, mission_seed(5, row / 24));
    }
    // the weighting turns fastest, the scenario slowest
    assert_eq!(missions[1].options.weighting, WeightingChoice::None);
    assert_eq!((missions[3].options.feedback, missions[3].options.weighting), (false, WeightingChoice::Covariance));
    assert!(missions[5].options.fault.is_none() && missions[6].options.fault.is_some());
    assert_eq!((missions[11].scenario, missions[12].scenario), (0, 1));
    let combinations: Vec<String> = missions[..24].iter().map(PlannedMission::replay).collect();
    let mut distinct = combinations.clone();
    distinct.sort();
    distinct.dedup();
    assert_eq!(distinct.len(), 24);
    assert!(plan.mission(96).is_none());
    assert_eq!(plan.label(8), "iss-slalom, drop:2, feedback on, weighting mass");
}

#[test]
fn a_row_says_how_to_fly_it_again() {
    let seed = mission_seed(5, 1);
    let mut mission = plan(2).mission(24 + 12 + 6 + 4).unwrap();
    assert_eq!(
        mission.replay(),
        format!(
            "tumble fly 'it'\\''s, \"mine\".toml' --seed {seed} --weighting none --feedback off --model scenario --fault drop:2 --draw"
        )
    );
    mission.sensing = Some("of the day.toml".to_owned());
    assert!(mission.replay().ends_with(" --draw --sensing 'of the day.toml'"));
    mission.options.layers = LayerNames { local_planner: Some("along-way"), ..LayerNames::default() };
    assert!(mission.replay().contains(" --fault drop:2 --local-planner along-way --draw"), "{}", mission.replay());
}

#[test]
fn rows_survive_csv() {
    let rows = rows_of(&plan(11));
    for row in &rows {
        let line = row.to_csv();
        assert!(!line.contains('\n'));
        assert_eq!(Row::from_csv(&line).as_ref(), Some(row), "{line}");
        // a reader of somebody else's agrees
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(line.as_bytes());
        let record = reader.records().next().unwrap().unwrap();
        assert_eq!(record.len(), COLUMNS.len());
        assert_eq!(record.get(3), Some(row.text(3)));
    }
    let status = row::column("status").unwrap();
    let message = row::column("message").unwrap();
    let of = |name: &str| rows.iter().filter(|row| row.text(status) == name).collect::<Vec<_>>();
    assert_eq!((of("error").len(), of("panic").len(), of("flown").len()), (24, 12, 264 - 36));
    assert_eq!(of("error")[0].text(message), "T014: a \"quoted\" text, in two lines");
    assert_eq!(of("panic")[0].text(message), "as planned, 9");
    assert_eq!(of("flown")[0].number(row::column("mass_shut_off_s").unwrap()), Some(12.0));
    assert_eq!(of("flown")[0].number(row::column("com_x_shut_off_s").unwrap()), None);
    let line = rows[0].to_csv();
    for torn in [&line[..line.len() / 2], "", "1,2,3", &format!("{line},1"), &line.replacen("0,", "00,", 1)] {
        assert_eq!(Row::from_csv(torn), None, "{torn}");
    }
}

#[test]
fn a_killed_campaign_goes_on_where_it_was() {
    let base = scratch("resume");
    let plan = plan(3);
    let whole = fs::read(fly_part(&plan, Shard::WHOLE, 2, &base.join("whole")).join("rows.csv")).unwrap();
    let place = base.join("killed");
    // flown to the end, but never finished
    let open = || CampaignFolder::open(&place, plan.configuration(), Shard::WHOLE, false);
    let (mut folder, begun) = open().unwrap();
    assert!(begun.is_empty());
    execute(&plan, Shard::WHOLE, 2, &Fake, (folder.journal(), begun), |_| ()).unwrap();
    assert!(matches!(open(), Err(TumbleError::CampaignInUse { .. })), "two at once");
    drop(folder);
    let journal = unfinished_place(&place).join("journal.csv");
    let full = fs::read(&journal).unwrap();
    // Ends in the middle of a row, of its checksum, of the header; and a row whose disk block was lost.
    let ends: Vec<usize> = full.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(at, _)| at + 1).collect();
    assert_eq!(ends.len(), 73);
    let mut holed = full[..ends[30]].to_vec();
    holed[ends[20] + 5..ends[20] + 40].fill(0);
    let cases = [
        (full[..ends[40] + 100].to_vec(), 40),
        (full[..ends[41] - 4].to_vec(), 40),
        (full[..ends[41] - 1].to_vec(), 41),
        (full[..20].to_vec(), 0),
        (Vec::new(), 0),
        (holed, 29),
        (full.clone(), 72),
    ];
    for (bytes, resumed) in cases {
        fs::write(&journal, &bytes).unwrap();
        let (mut folder, begun) = open().unwrap();
        assert_eq!(begun.len(), resumed, "{} bytes", bytes.len());
        let mut told = Vec::new();
        let rows =
            execute(&plan, Shard::WHOLE, 2, &Fake, (folder.journal(), begun), |progress| told.push(progress)).unwrap();
        assert_eq!(rows.len(), 72);
        let last = told.last().unwrap();
        assert_eq!((last.resumed, last.flown, last.all), (resumed as u64, 72 - resumed as u64, 72));
        drop(folder);
        // and the journal, torn and continued, is itself whole
        assert_eq!(open().unwrap().1.len(), 72);
    }
    let (mut folder, begun) = open().unwrap();
    let rows = execute(&plan, Shard::WHOLE, 2, &Fake, (folder.journal(), begun), |_| ()).unwrap();
    folder.finish(&rows, |_| Ok(())).unwrap();
    assert!(fs::read(place.join("rows.csv")).unwrap() == whole);
    assert!(!unfinished_place(&place).exists());
}

#[test]
fn another_campaign_is_refused_where_one_was_begun() {
    let base = scratch("other");
    let place = base.join("run");
    let begin = |configuration: &CampaignConfiguration, shard, force| {
        CampaignFolder::open(&place, configuration, shard, force).map(|(_, rows)| rows.len())
    };
    let first = configuration(3);
    begin(&first, Shard::WHOLE, false).unwrap();
    assert_eq!(Place::look(&place, &first, Shard::WHOLE), Place::Begun);
    let other = CampaignConfiguration { master_seed: 6, ..first.clone() };
    assert_eq!(Place::look(&place, &other, Shard::WHOLE), Place::Taken);
    let refused = begin(&other, Shard::WHOLE, false).unwrap_err().to_string();
    assert!(refused.contains("`master_seed`"), "{refused}");
    let shard = Shard { index: 1, count: 2 };
    let refused = begin(&first, shard, false).unwrap_err().to_string();
    assert!(refused.contains("part-0-of-1"), "{refused}");
    // a user's own file in the way is not touched
    fs::write(unfinished_place(&place).join("notes.txt"), "mine").unwrap();
    begin(&other, Shard::WHOLE, true).unwrap();
    assert_eq!(Place::look(&place, &other, Shard::WHOLE), Place::Begun);
    let (folder, _) = CampaignFolder::open(&place, &other, Shard::WHOLE, false).unwrap();
    folder.finish(&[], |_| Ok(())).unwrap();
    assert!(unfinished_place(&place).join("notes.txt").exists());
    assert_eq!(Place::look(&place, &other, Shard::WHOLE), Place::Complete);
    assert!(matches!(begin(&other, Shard::WHOLE, false), Err(TumbleError::OutputExists { .. })));
}

#[test]
fn merge_refuses_what_does_not_belong_together() {
    let base = scratch("refusals");
    let parts = base.join("parts");
    let three = |index| Shard { index, count: 3 };
    let plan_a = plan(3);
    let a: Vec<PathBuf> = (0..3).map(|index| fly_part(&plan_a, three(index), 2, &parts)).collect();
    assert!(merge(&a).is_ok());
    let [first, second, third] = [a[0].clone(), a[1].clone(), a[2].clone()];
    // a gap
    let said = refusal(&[first.clone(), third.clone()]);
    assert!(said.contains("1 of 3 parts are missing or unfinished: 1"), "{said}");
    // one twice
    let said = refusal(&[parts.clone(), second.clone()]);
    assert!(said.contains("twice"), "{said}");
    // another count
    let fourth = fly_part(&plan_a, Shard { index: 3, count: 4 }, 1, &base.join("four"));
    let said = refusal(&[parts.clone(), fourth]);
    assert!(said.contains("one of 4 parts"), "{said}");
    // other options, another version, another build
    let changes: [(&str, Change); 4] = [
        ("`models`", |c| c.models = vec![ModelChoice::Low]),
        ("`version`", |c| "0.2.0".clone_into(&mut c.version)),
        ("`build`", |c| "other".clone_into(&mut c.build)),
        ("`scenarios`", |c| "fnv1a64:1".clone_into(&mut c.scenarios[0].hash)),
    ];
    for (index, (key, change)) in changes.into_iter().enumerate() {
        let mut other = configuration(3);
        change(&mut other);
        let other = CampaignPlan::try_new(other).unwrap();
        let part = fly_part(&other, three(1), 1, &base.join(format!("other-{index}")));
        let said = refusal(&[first.clone(), part, third.clone()]);
        assert!(said.contains(key), "{said}");
    }
    // nothing of ours
    let empty = base.join("empty");
    fs::create_dir(&empty).unwrap();
    let said = refusal(std::slice::from_ref(&empty));
    assert!(said.contains("neither"), "{said}");
    assert!(matches!(merge(&[base.join("nowhere")]), Err(TumbleError::File(FormatsError::Unreadable { .. }))));
    fs::write(empty.join("run.json"), r#"{"format":1,"command":"simulate"}"#).unwrap();
    assert!(refusal(&[empty]).contains("no run record"));
    // a table that somebody edited
    let table = second.join("rows.csv");
    let text = fs::read_to_string(&table).unwrap();
    fs::write(&table, text.replacen("true", "false", 1)).unwrap();
    let said = refusal(&[parts]);
    assert!(said.contains("not the one that was written"), "{said}");
}

#[test]
fn merge_refuses_rows_of_another_part() {
    let base = scratch("rows-of-another");
    let plan = plan(2);
    let two = |index| Shard { index, count: 2 };
    let first = fly_part(&plan, two(0), 1, &base.join("parts"));
    let second = base.join("parts").join(two(1).name());
    let rows = Part::read(&first).unwrap().rows;
    for (rows, expected) in
        [(&rows[..], "where row 24 should be is row 0"), (&rows[1..], "23 rows, but this part has 24")]
    {
        let (folder, _) = CampaignFolder::open(&second, plan.configuration(), two(1), true).unwrap();
        folder.finish(rows, |_| Ok(())).unwrap();
        let said = refusal(&[base.join("parts")]);
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn the_summary_counts_what_happened() {
    let plan = plan(44);
    let rows = rows_of(&plan);
    let analysis = Analysis::new(&plan, &rows);
    let all = &analysis.all;
    // k = 7, 18, 29, 40 are errors; 9, 20, 31, 42 panics with feedback, k = 3 does not arrive
    assert_eq!((all.missions, all.errors, all.panics, all.flown), (1056, 96, 48, 912));
    assert_eq!((all.arrived.count, all.arrived.of), (912 - 24, 1056));
    assert_eq!((all.violations.count, all.violations.of), (0, 912));
    assert_eq!(all.violations.bound_of_none.map(f64::to_bits), Some((3.0_f64 / 912.0).to_bits()));
    assert_eq!(all.fallbacks.count, 24);
    assert_eq!((all.doubted.count, all.doubted.of), (24, 912));
    assert!(!analysis.is_clean());
    // by hand, from the made-up missions
    let flown: Vec<MissionSummary> = (0..1056)
        .map(|row| plan.mission(row).unwrap())
        .filter(|mission| mission.k % 11 != 7 && !(mission.k % 11 == 9 && mission.options.feedback))
        .map(|mission| fake_summary(&mission))
        .collect();
    let collided = flown.iter().filter(|s| s.min_clearance_m.is_some_and(|clearance| clearance < 0.0)).count();
    assert!(collided > 0 && all.collisions.count == collided as u64);
    let within = flown
        .iter()
        .filter(|s| (s.parameters[9].estimate - s.parameters[9].truth).abs() <= 2.0 * s.parameters[9].sigma);
    assert_eq!((all.parameters[9].name, all.parameters[9].within_2_sigma.count), ("inertia_zz", within.count() as u64));
    let worst = |s: &MissionSummary| {
        let percent = |i: usize| 100.0 * (s.parameters[i].estimate / s.parameters[i].truth - 1.0).abs();
        percent(4).max(percent(7)).max(percent(9))
    };
    let mut errors: Vec<f64> = flown.iter().map(worst).collect();
    errors.sort_by(f64::total_cmp);
    let spread = all.inertia_error_percent.unwrap();
    let middle = f64::midpoint(errors[455], errors[456]);
    assert!((spread.median - middle).abs() < 1e-9 && (spread.max - errors[911]).abs() < 1e-9);
    let distance = |s: &MissionSummary| {
        1000.0 * (1..4).map(|i| (s.parameters[i].estimate - s.parameters[i].truth).powi(2)).sum::<f64>().sqrt()
    };
    let largest = flown.iter().map(distance).fold(0.0, f64::max);
    assert!((all.com_error_mm.unwrap().max - largest).abs() < 1e-9);
}

#[test]
fn options_are_compared_over_the_same_seeds() {
    let plan = plan(44);
    let analysis = Analysis::new(&plan, &rows_of(&plan));
    // of 24 combinations: 2 of 3 weightings, 1 of 2 feedbacks, 1 of 2 faults are not the first level
    assert_eq!(analysis.comparisons.len(), 16 + 12 + 12);
    let first = &analysis.comparisons[0];
    assert_eq!((first.factor, first.pairs), ("weighting", 36));
    assert!(first.baseline.ends_with("weighting covariance") && first.other.ends_with("weighting none"));
    // twice the impulse at each seed: the difference is the baseline itself, unlike the difference of unpaired draws
    let impulse = first.differences.iter().find(|difference| difference.quantity == "impulse_n_s").unwrap();
    assert!((impulse.median - impulse.baseline_median).abs() < 1e-9);
    assert!((impulse.other_median - 2.0 * impulse.baseline_median).abs() < 1e-9);
    let (low, high) = (impulse.low.unwrap(), impulse.high.unwrap());
    assert!(low <= impulse.median && impulse.median <= high && high - low < 1.0);
    let feedback = analysis.comparisons.iter().find(|comparison| comparison.factor == "feedback").unwrap();
    // without feedback nothing panics, with it four seeds do
    assert_eq!(feedback.pairs, 36);
    assert!(feedback.differences.iter().all(|d| d.median.to_bits() == 0.0_f64.to_bits() && d.low == Some(0.0)));
    // the table names every combination and says what never happened
    let text = table(&analysis);
    assert!((0..24).all(|combination| text.contains(&plan.label(combination))));
    assert!(text.contains("0/912 (below 0.329 %)") && text.contains("28 more comparisons"), "{text}");
}

#[test]
fn levels_are_named_once_and_rows_are_bounded() {
    let refused = |change: fn(&mut CampaignConfiguration)| {
        let mut configuration = configuration(3);
        change(&mut configuration);
        CampaignPlan::try_new(configuration).unwrap_err().to_string()
    };
    assert!(refused(|c| c.missions = 0).contains("0 missions"));
    assert!(refused(|c| c.missions = u64::MAX).contains("at most"));
    assert!(refused(|c| c.feedbacks = vec![true, true]).contains("`--feedback`"));
    assert!(refused(|c| c.faults.push(None)).contains("`--fault`"));
    assert!(refused(|c| c.scenarios.clear()).contains("`scenario`"));
}
