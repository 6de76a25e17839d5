//! Drawn missions that once went wrong, by their seeds; `tumble campaign --draw` flies them by the hundred.

#![allow(clippy::unwrap_used)]

use tumble::mission::{FlyOptions, LayerNames, MissionSummary, ModelChoice, NoHooks, WeightingChoice, fly};
use tumble::scenario::{ScenarioSource, draw_mission};

fn options(seed: u64) -> FlyOptions {
    FlyOptions {
        seed,
        weighting: WeightingChoice::default(),
        feedback: true,
        model: ModelChoice::default(),
        fault: None,
        layers: LayerNames::default(),
    }
}

fn flown(scenario: &str, seed: u64) -> MissionSummary {
    let source = draw_mission(&ScenarioSource::find(scenario).unwrap(), seed, 0.0).unwrap();
    let summary = fly(&source, &options(seed), &mut NoHooks).unwrap().summary;
    assert!(summary.arrived && summary.unsafe_because().is_none(), "{:?}", summary.warnings);
    summary
}

/// The belief is a body, but hardly: one moment is nearly the sum of the two others. The filter must not take that for certain.
#[test]
fn a_belief_that_can_hardly_be_is_an_uncertain_one() {
    for (scenario, seed) in [("iss-cargo", 8_903_449_791_686_989), ("granite-cargo", 4_741_893_909_617_753)] {
        let summary = flown(scenario, seed);
        assert!(summary.warnings.iter().all(|warning| !warning.contains("did not hold")), "{:?}", summary.warnings);
    }
}

/// Three healthy robots that were once taken for others: while they held their place their own answer to the noise of the gyroscope looked like
/// a body that does not obey, and passes that found no end were taken for the likeliest.
#[test]
fn who_is_healthy_is_not_doubted() {
    for seed in [2_508_306_949_206_206, 4_336_088_950_629_009, 8_198_567_907_303_811] {
        let summary = flown("iss-cargo", seed);
        assert!(summary.doubts.is_empty(), "{:?}", summary.doubts);
    }
}

/// The robot turns out a third heavier than it took itself for, and the old way does not do. The new one once took longer than there was time.
#[test]
fn a_new_way_takes_no_longer_than_there_is_time() {
    let source = ScenarioSource::find("iss-cargo-set2").unwrap();
    let summary = fly(&source, &options(1_556_254_343_779_117), &mut NoHooks).unwrap().summary;
    assert!(summary.arrived && summary.mission_s < 110.0 && summary.replans > 0, "{} s", summary.mission_s);
}

/// What a table does not show of a body is free: all measurements were once gone through again about bodies that differed in that, no two
/// passes agreed, and the moment about the vertical, known to a hundredth, was taken for unknown, or for a fifth smaller than it is.
#[test]
fn a_moment_that_is_known_stays_known_on_the_table() {
    for seed in [11, 14, 7_715_848_437_442_780] {
        let source = draw_mission(&ScenarioSource::find("granite-cargo").unwrap(), seed, 0.0).unwrap();
        let record = fly(&source, &options(seed), &mut NoHooks).unwrap();
        let truth = record.summary.parameters.iter().find(|row| row.name == "inertia_zz").unwrap().truth;
        let mut best = f64::INFINITY;
        let series = &record.series;
        for ((t_s, sigma), estimate) in
            series.t_s.iter().zip(&series.sigma).zip(&series.estimate).filter(|((t_s, _), _)| **t_s > 5.0)
        {
            best = best.min(sigma[6]);
            assert!(sigma[6] < 1.2 * best, "seed {seed}, {t_s} s: {} after {best} kg m^2", sigma[6]);
            let off = (estimate[6] - truth).abs();
            assert!(off < 4.0 * sigma[6], "seed {seed}, {t_s} s: off by {off} of {} kg m^2", sigma[6]);
        }
    }
}

/// Nine in ten of the standard deviations that plans promise for the ends of stretches are stated there, and what is stated of centres of mass and
/// products of inertia is what they err by: it was twice as much while bodies drifted by a share of a metre, half as much again while the wrench was
/// taken to be noisier than it is.
#[test]
fn plans_keep_what_they_promise_and_deviations_are_those_of_errors() {
    let (mut made, mut kept) = (0, 0);
    let mut scores = Vec::new();
    for (scenario, seed) in
        ["iss-cargo", "granite-cargo"].into_iter().flat_map(|name| (1..7).map(move |seed| (name, seed)))
    {
        let summary = fly(&ScenarioSource::find(scenario).unwrap(), &options(seed), &mut NoHooks).unwrap().summary;
        (made, kept) = (made + summary.promises.made, kept + summary.promises.kept);
        let told = ["com_x", "com_y", "com_z", "inertia_xy", "inertia_xz", "inertia_yz"];
        let rows = summary.parameters.iter().filter(|row| scenario == "iss-cargo" && told.contains(&row.name.as_str()));
        scores.extend(rows.map(|row| (row.estimate - row.truth) / row.sigma));
    }
    let mean_square = scores.iter().map(|score| score * score).sum::<f64>() / scores.len() as f64;
    assert!(scores.len() == 36 && (0.75..1.3).contains(&mean_square.sqrt()), "{} {}", scores.len(), mean_square.sqrt());
    assert!(made > 300 && kept * 10 >= made * 9, "{kept} of {made}");
}

/// Taken for nearly twice as heavy as it is, the robot first plans long stops, which stretches past obstacles have no room for.
#[test]
fn stops_get_shorter_as_the_body_is_known_to_be_lighter() {
    let summary = flown("iss-cargo", 5_620_371_767_339_669);
    assert!(summary.mission_s < 140.0, "{} s", summary.mission_s);
}
