use super::*;

const GATE: f64 = 0.999_99;
const SIGMA: [f64; 10] = [0.1, 0.001, 0.001, 0.001, 0.002, 0.002, 0.002, 0.001, 0.001, 0.001];

fn body(mass_kg: f64) -> [f64; 10] {
    [mass_kg, 0.0, 0.0, 0.0, 0.15, 0.15, 0.15, 0.0, 0.0, 0.0]
}

/// Sees every tenth of a second of a span, at 62.5 measurements a second of which this share is refused.
fn flown(watch: &mut DoubtWatch, from_s: u32, until_s: u32, mass_kg: f64, refused: f64) {
    for tenth in 10 * from_s..10 * until_s {
        let time_s = 0.1 * f64::from(tenth);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small and positive
        let gated = (refused * 62.5 * (time_s - f64::from(from_s))) as u64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small and positive
        let used = (62.5 * time_s) as u64 - gated;
        let counts = ReceptionCounts { used, gated, ..ReceptionCounts::default() };
        watch.see(time_s, &FlightHealth::default(), &counts, &(body(mass_kg), SIGMA));
    }
}

/// What is believed while the estimator learns again is not held against what it comes to.
#[test]
fn a_body_that_is_being_learned_again_contradicts_nothing() {
    let off_kg = (CONTRADICTS + 1.0) * f64::hypot(0.1, 0.1);
    let flown_at_first = |relearning: bool| {
        let mut watch = DoubtWatch::new(0.0, GATE);
        let health = FlightHealth { relearning, ..FlightHealth::default() };
        for second in 0..12 {
            watch.see(f64::from(second), &health, &ReceptionCounts::default(), &(body(12.0 + off_kg), SIGMA));
        }
        flown(&mut watch, 12, 60, 12.0, 0.0);
        spells(watch)
    };
    assert_eq!(flown_at_first(true), []);
    assert_eq!(flown_at_first(false).len(), 1);
}

fn spells(watch: DoubtWatch) -> Vec<(DoubtOf, i64, Option<i64>)> {
    #[allow(clippy::cast_possible_truncation)] // seconds of a mission
    let whole = |time_s: f64| time_s.floor() as i64;
    watch.finish().iter().map(|row| (row.what, whole(row.since_s), row.until_s.map(whole))).collect()
}

#[test]
fn a_body_that_stays_what_it_is_is_not_doubted() {
    let mut watch = DoubtWatch::new(0.0, GATE);
    flown(&mut watch, 0, 60, 12.0, 0.0);
    flown(&mut watch, 60, 90, 12.0 + (CONTRADICTS - 1.0) * f64::hypot(0.1, 0.1), 0.0);
    assert_eq!(spells(watch), []);
}

#[test]
fn beliefs_that_cannot_both_be_right_are_a_doubt_until_they_agree_again() {
    let off_kg = (CONTRADICTS + 1.0) * f64::hypot(0.1, 0.1);
    let mut watch = DoubtWatch::new(0.0, GATE);
    flown(&mut watch, 0, 30, 12.0, 0.0);
    flown(&mut watch, 30, 40, 12.0 + off_kg, 0.0);
    let rows = watch.clone().finish();
    assert_eq!((rows.len(), rows[0].what, rows[0].until_s), (1, DoubtOf::Body, None));
    assert!(rows[0].text.starts_with("mass was 12.0000 ± 0.1000 at 8 s"), "{}", rows[0].text);
    // neither does the first few seconds' body count
    let mut late = DoubtWatch::new(0.0, GATE);
    flown(&mut late, 0, 7, 12.0 + off_kg, 0.0);
    flown(&mut late, 7, 60, 12.0, 0.0);
    assert_eq!(spells(late), []);
}

/// What was believed of a moment in the first twelve seconds is held against it where it is farther off, of the mass as later.
#[test]
fn moments_are_believed_less_surely_at_first() {
    let doubts_of = |index: usize, until_s: u32, sigmas: f64| {
        let mut watch = DoubtWatch::new(0.0, GATE);
        for second in 0..60 {
            let mut believed = body(12.0);
            believed[index] += if second < until_s { sigmas * SIGMA[index] } else { 0.0 };
            let (health, counts) = (FlightHealth::default(), ReceptionCounts::default());
            watch.see(f64::from(second), &health, &counts, &(believed, SIGMA));
        }
        spells(watch).len()
    };
    assert_eq!([(11, 9.0), (11, 14.0), (14, 9.0)].map(|(until_s, sigmas)| doubts_of(6, until_s, sigmas)), [0, 1, 1]);
    assert_eq!(doubts_of(0, 11, 9.0), 1);
}

#[test]
fn a_change_that_was_found_is_one_spell_and_is_lifted_when_nothing_contradicts_it() {
    let mut watch = DoubtWatch::new(0.0, GATE);
    flown(&mut watch, 0, 20, 12.0, 0.0);
    for time_s in [20.0, 24.0] {
        watch.answered(time_s, &Action::WidenBelief);
    }
    flown(&mut watch, 24, 60, 12.0, 0.0);
    assert_eq!(spells(watch), [(DoubtOf::Body, 20, Some(32))]);
}

#[test]
fn a_map_that_moves_again_and_again_is_one_spell() {
    let mut watch = DoubtWatch::new(0.0, GATE);
    flown(&mut watch, 0, 20, 12.0, 0.0);
    for second in 20..30 {
        watch.heard(f64::from(second), &Event::Relocalised);
        flown(&mut watch, second, second + 1, 12.0, 0.0);
    }
    let mut rows = watch.clone().finish();
    assert_eq!(rows.remove(0).text.matches("10 times").count(), 1);
    assert_eq!(spells(watch.clone()), [(DoubtOf::Map, 20, None)]);
    flown(&mut watch, 30, 50, 12.0, 0.0);
    assert_eq!(spells(watch), [(DoubtOf::Map, 20, Some(37))]);
}

#[test]
fn actuators_stay_in_doubt() {
    let mut watch = DoubtWatch::new(0.0, GATE);
    flown(&mut watch, 0, 20, 12.0, 0.0);
    watch.answered(20.0, &Action::DoubtWrench);
    flown(&mut watch, 20, 90, 12.0, 0.0);
    assert_eq!(spells(watch), [(DoubtOf::Actuators, 20, None)]);
}

/// Counted from one, as in the columns of a log.
#[test]
fn a_thruster_that_fails_is_named() {
    let text = |suspect: Option<Suspect>| {
        let mut watch = DoubtWatch::new(0.0, GATE);
        watch.answered(20.0, &Action::DoubtWrench);
        let health = FlightHealth { suspect, ..FlightHealth::default() };
        watch.see(21.0, &health, &ReceptionCounts::default(), &(body(12.0), SIGMA));
        watch.finish().pop().unwrap().text
    };
    assert_eq!(text(Some(Suspect::Thruster(10))), "thruster 11 does not give what it is told");
    assert_eq!(text(Some(Suspect::Supply(1))), "the thrusters of supply 2 do not give what they are told");
    assert!(text(None).contains("thrust is not what is asked for"));
}

#[test]
fn measurements_refused_far_more_often_than_gates_should_are_a_doubt() {
    let refusing = |share: f64| {
        let mut watch = DoubtWatch::new(0.0, GATE);
        flown(&mut watch, 0, 20, 12.0, 0.0);
        flown(&mut watch, 20, 60, 12.0, share);
        watch.finish()
    };
    // four of them in half a minute
    assert_eq!(refusing(0.002), []);
    let rows = refusing(0.02);
    assert_eq!((rows.len(), rows[0].what, rows[0].until_s), (1, DoubtOf::Body, None));
    assert!(rows[0].text.contains("measurements did not fit"), "{}", rows[0].text);
}
