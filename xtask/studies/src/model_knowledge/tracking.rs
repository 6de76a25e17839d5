//! Updates of the model on against off, on one reference with one set of gains and the same seeds.

use super::scenario_one::{Flown, Knowledge, Seen, Sensing, fly};
use super::{Interval, each_seed, median};
use crate::Failure;
use crate::targets::Report;
use serde_json::json;
use tumble_astrobee::control_presets::{THESIS_FORCE_N, THESIS_TORQUE_N_M};
use tumble_identification::statistics::chi_square_quantile;

/// Position m, velocity m/s, attitude rad, rate rad/s.
const SENSING: [(&str, Sensing); 4] = [
    ("2 mm, 1 mm/s", [2e-3, 1e-3, 4e-3, 1e-3]),
    ("0.5 mm, 0.5 mm/s", [5e-4, 5e-4, 2e-3, 5e-4]),
    ("5 mm, 5 mm/s", [5e-3, 5e-3, 1e-2, 2e-3]),
    ("10 mm, 10 mm/s", [1e-2, 1e-2, 2e-2, 4e-3]),
];

/// By how much the pooled error is lower, as a share.
fn lower(pairs: &[[Flown; 4]], on: usize, figure: impl Fn(&Flown) -> f64) -> f64 {
    let sum = |which: usize| pairs.iter().map(|flown| figure(&flown[which]).powi(2)).sum::<f64>();
    1.0 - (sum(on) / sum(0)).sqrt()
}

/// Flies all.
pub fn run(report: &mut Report, seeds: usize) -> Result<(), Failure> {
    let limits = [THESIS_FORCE_N.into(), THESIS_TORQUE_N_M.into()];
    for (name, sensing) in &SENSING {
        for seen in [Seen::Measured, Seen::Filtered] {
            let flown = each_seed(seeds, |seed| {
                let fly = |knowledge| fly(seed, sensing, knowledge, seen, &limits);
                Ok([
                    fly(Knowledge::Prior)?,
                    fly(Knowledge::Learned)?,
                    fly(Knowledge::True)?,
                    fly(Knowledge::LearnedAtOnce)?,
                ])
            });
            let flown = flown.into_iter().collect::<Result<Vec<_>, Failure>>()?;
            judge(report, &format!("sensing {name}, state {seen:?}"), &flown, *name == SENSING[0].0);
        }
    }
    Ok(())
}

fn judge(report: &mut Report, name: &str, flown: &[[Flown; 4]], is_claimed: bool) {
    report.table.push(format!("\ntracking, last leg, {name}, seeds 0..{}", flown.len()));
    for (which, what) in ["updates off", "updates on", "true body", "on at once"].iter().enumerate() {
        let of = |figure: fn(&Flown) -> f64| median(flown.iter().map(|one| figure(&one[which])));
        let most = |figure: fn(&Flown) -> f64| flown.iter().map(|one| figure(&one[which])).fold(0.0, f64::max);
        report.table.push(format!(
            "  {what:12} position median {:6.2} mm (max {:6.2}), attitude {:6.3} deg (max {:6.3}), impulse {:.3} N s; state shown off by {:.2} mm, {:.2} mm/s",
            1e3 * of(|one| one.position_m),
            1e3 * most(|one| one.position_m),
            of(|one| one.attitude_rad).to_degrees(),
            most(|one| one.attitude_rad).to_degrees(),
            of(|one| one.impulse_n_s),
            1e3 * of(|one| one.shown[0]),
            1e3 * of(|one| one.shown[1]),
        ));
    }
    let learned = |k: usize| median(flown.iter().map(|one| one[1].errors[k]));
    let limit = chi_square_quantile(10.0, 0.99);
    let inside = flown.iter().filter(|one| one[1].nees <= limit).count();
    let diverged = flown.iter().filter(|one| one[1].diverged).count();
    report.table.push(format!(
        "  known at its start (median error): mass {:.2} %, centre of mass {:.2} mm, worst moment {:.1} %; sigma of the mass {:.2} %; 99 % set at its end {inside}/{}; diverged {diverged}",
        100.0 * learned(0),
        1e3 * learned(1),
        100.0 * learned(2),
        100.0 * median(flown.iter().map(|one| one[1].mass[0])),
        flown.len(),
    ));
    let position = Interval::of(flown, |pairs| lower(pairs, 1, |one| one.position_m));
    let attitude = Interval::of(flown, |pairs| lower(pairs, 1, |one| one.attitude_rad));
    let all_known = Interval::of(flown, |pairs| lower(pairs, 2, |one| one.position_m));
    let at_once = Interval::of(flown, |pairs| lower(pairs, 3, |one| one.position_m));
    let doubtful = |which: usize| flown.iter().filter(|one| one[which].doubtful).count();
    let lost = |which: usize| flown.iter().filter(|one| one[which].position_m > 0.05).count();
    report.table.push(format!(
        "  beliefs from the start on: position lower by {at_once}, flights lost (beyond 50 mm) {}; from the second leg on {}; body in doubt: off {}, on {}, at once {}",
        lost(3), lost(1), doubtful(0), doubtful(1), doubtful(3),
    ));
    let impulse = Interval::of(flown, |pairs| {
        let sum = |which: usize| pairs.iter().map(|one| one[which].impulse_n_s).sum::<f64>();
        sum(1) / sum(0)
    });
    report.table.push(format!("  lower by: position {position}, attitude {attitude}; impulse ratio {impulse}; all that knowledge can take off the position: {all_known}"));
    println!(
        "{}",
        json!({"block": "model-knowledge", "part": "tracking", "case": name, "n": flown.len(),
            "position_lower": [position.value, position.low, position.high],
            "attitude_lower": [attitude.value, attitude.low, attitude.high],
            "impulse_ratio": [impulse.value, impulse.low, impulse.high],
            "true_body_position_lower": [all_known.value, all_known.low, all_known.high],
            "in_99_percent_set": inside, "diverged": diverged,
            "at_once_position_lower": [at_once.value, at_once.low, at_once.high], "lost": [lost(1), lost(3)],
            "doubtful": [doubtful(0), doubtful(1), doubtful(3)]})
    );
    if is_claimed {
        for (what, found, least, least_low) in [("position", position, 0.55, 0.50), ("attitude", attitude, 0.75, 0.70)]
        {
            let holds = found.value >= least && found.low >= least_low;
            let claim = format!("{name}: {what} lower by >= {least}, lower limit >= {least_low}");
            report.target(claim, holds, found.to_string());
        }
    }
}
