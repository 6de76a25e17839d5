//! What knowing the body saves where both sides arrive at the same time: each flies its own plan of least impulse.
//!
//! The slalom of [`super::scenario_one`]. A leg is straight: full acceleration, a coast, full braking, as hard as the tube of what
//! is known of the mass when the leg begins allows plans along the longest axis; the harder, the slower the coast and the less the
//! impulse. [`TubeController`] flies it on the estimator's state. Beliefs are offered every 2 s from the second leg on, or never.

use super::certificate::{certified, failed, settings, wide};
use super::scenario_one::{
    ATTITUDE, Flight, HOLD_S, LEGS, PLACES, STEP_NS, STEP_S, STEPS_PER_BELIEF, STEPS_PER_DECISION, Sensing, cut,
    leg_at, on_leg, prior, quintic,
};
use super::{Interval, each_seed, median};
use crate::Failure;
use crate::targets::Report;
use nalgebra::Vector3;
use serde_json::json;
use tumble_astrobee::control_presets::{THESIS_TORQUE_N_M, TUBE_SIGMAS};
use tumble_dynamics::PoseReference;
use tumble_lie::Wrench;
use tumble_planning::control::{
    Adoption, AttitudeController, AttitudeLaw, ControlRequest, Controller, MassInterval, ReferenceMotion,
    TubeController,
};
use tumble_planning::{ModelBelief, Plan};

/// Name, sensing, and by how much the flown impulse is to be lower at the fastest arrival.
const SENSING: [(&str, Sensing, f64); 2] =
    [("0.5 mm, 0.5 mm/s", [5e-4, 5e-4, 2e-3, 5e-4], 0.08), ("2 mm, 1 mm/s", [2e-3, 1e-3, 4e-3, 1e-3], 0.03)];
/// Lengths of a leg, s: the fastest that who knows nothing of the mass can be sure of, to half a second, and slower ones.
const LEG_S: [f64; 3] = [24.5, 27.0, 34.0];
const PLANNED_LOWER: f64 = 0.15;
const HIGHER_AT_MOST: f64 = 0.01;

/// Rest to rest over one in a time: full acceleration, a coast, full braking. Share of the way and its derivatives, 1/s and 1/s^2.
fn bang_coast_bang(t: f64, leg_s: f64, rise_s: f64) -> [f64; 3] {
    let speed = 1.0 / (leg_s - rise_s);
    let acceleration = speed / rise_s;
    let left_s = leg_s - t;
    if t <= 0.0 {
        [0.0; 3]
    } else if left_s <= 0.0 {
        [1.0, 0.0, 0.0]
    } else if t < rise_s {
        [0.5 * acceleration * t * t, acceleration * t, acceleration]
    } else if left_s < rise_s {
        [1.0 - 0.5 * acceleration * left_s * left_s, acceleration * left_s, -acceleration]
    } else {
        [speed * (t - 0.5 * rise_s), speed, 0.0]
    }
}

/// How long the acceleration of a leg lasts: its longest axis takes all there is; `None` where that is too little.
fn rise_s(leg: usize, leg_s: f64, acceleration: f64) -> Option<f64> {
    let distance = (Vector3::from(PLACES[leg + 1]) - Vector3::from(PLACES[leg])).amax();
    let square = leg_s * leg_s - 4.0 * distance / acceleration;
    (square >= 0.0).then(|| 0.5 * (leg_s - square.sqrt()))
}

/// The legs, as far as they are planned; those to come look like the last that is.
#[derive(Clone, Copy)]
struct Legs {
    leg_s: f64,
    rise_s: [f64; LEGS],
}

impl ReferenceMotion for Legs {
    fn at(&self, time_s: f64) -> PoseReference {
        let (leg, t) = leg_at(time_s, self.leg_s);
        on_leg(leg, bang_coast_bang(t, self.leg_s, self.rise_s[leg]), quintic(t, self.leg_s))
    }
}

impl Legs {
    /// What the plan takes of a body that is pushed through its centre of mass, along the axes that turn with it, N s, of one leg.
    fn planned_n_s(&self, leg: usize, mass_kg: f64) -> f64 {
        let steps = (self.leg_s / STEP_S).round() as usize;
        let at = |k: usize| self.at(leg as f64 * self.leg_s + (k as f64 + 0.5) * STEP_S);
        let pushed = (0..steps).map(|k| at(k).acceleration.acceleration_origin_body.abs().sum());
        mass_kg * STEP_S * pushed.sum::<f64>()
    }
}

/// What became of a flight: of each leg, then what the controller met.
#[derive(Clone, Debug)]
struct Flown {
    planned_n_s: [f64; LEGS],
    /// Of the last leg the holding included: what is late is not free.
    impulse_n_s: [f64; LEGS],
    /// Root mean square distance from the plan in the last leg, m; largest in the flight.
    position_m: f64,
    farthest_m: f64,
    /// Distance from the goal at the arrival time, m.
    arrived_m: f64,
    decisions: u64,
    outside: u64,
    braking: u64,
    contradictions: u64,
    /// Whether the estimator ever lost the motion, or doubted the body; here nobody answers.
    is_lost: bool,
}

/// Flies a seed.
fn fly(seed: u64, sensing: &Sensing, leg_s: f64, is_told: bool) -> Result<Flown, Failure> {
    let wide = wide()?;
    let too_fast = || Failure::BadInput(format!("legs of {leg_s} s are not certified"));
    let planned = |leg: usize, mass: MassInterval| rise_s(leg, leg_s, certified(mass)?).ok_or_else(too_fast);
    let mut legs = Legs { leg_s, rise_s: [0.0; LEGS] };
    for leg in 0..LEGS {
        legs.rise_s[leg] = planned(leg, wide)?;
    }
    let mut flight = Flight::begin(seed, sensing, legs.at(0.0).state)?;
    let attitude = AttitudeController {
        law: AttitudeLaw::Geometric,
        gains: ATTITUDE,
        body: prior().parameters,
        torque_limit_n_m: f64::INFINITY,
    };
    let mut controller =
        TubeController::try_new(settings(wide), None, attitude, &prior().parameters).map_err(failed)?;
    let (mut known, mut revision, mut begun) = (wide, 0, 0);
    let (mut impulse_n_s, mut square, mut count) = ([0.0; LEGS], 0.0, 0.0);
    let (mut farthest_m, mut arrived_m) = (0.0_f64, f64::NAN);
    let mut is_lost = false;
    let end_s = LEGS as f64 * leg_s;
    for k in 0..((end_s + HOLD_S) / STEP_S).round() as usize {
        let (now_ns, t) = (k as i64 * STEP_NS, k as f64 * STEP_S);
        let leg = leg_at(t, leg_s).0;
        if k % STEPS_PER_DECISION == 0 {
            flight.look(now_ns);
        }
        if is_told && leg > 0 && (k % STEPS_PER_BELIEF == 0 || leg > begun) {
            revision += 1;
            let belief = ModelBelief { revision, estimate: flight.estimator.estimate() };
            let narrower = MassInterval::believed(&belief, TUBE_SIGMAS, &known).map_err(failed)?;
            if !matches!(controller.adopt(&belief).map_err(failed)?, Adoption::Contradicts { .. }) {
                known = narrower.unwrap_or(known);
            }
        }
        if leg > begun {
            begun = leg;
            for ahead in leg..LEGS {
                legs.rise_s[ahead] = planned(ahead, known)?;
            }
        }
        let shown = flight.estimator.state_at(now_ns);
        let plan: Plan<&dyn ReferenceMotion> = Plan { trajectory: &legs, model_revision: revision };
        let request = ControlRequest { time_s: t, state: &shown, plan: &plan };
        let wrench = controller.command(&request).map_err(failed)?.wrench_body;
        let torque = wrench.torque.zip_map(&THESIS_TORQUE_N_M.into(), cut);
        flight.act(now_ns, &Wrench::new(torque, wrench.force))?;
        impulse_n_s[leg] += wrench.force.abs().sum() * STEP_S;
        let place = |pose: &tumble_lie::Pose<f64>| pose.translation.vector;
        let wanted = place(&legs.at(t + STEP_S).state.world_from_body);
        let away_m = (place(&flight.state.world_from_body) - wanted).norm();
        farthest_m = farthest_m.max(away_m);
        let health = flight.estimator.health();
        is_lost |= health.diverged || health.body_doubtful;
        if leg == LEGS - 1 && t < end_s {
            (square, count) = (square + away_m * away_m, count + 1.0);
            arrived_m = away_m;
        }
    }
    let counts = controller.counts();
    Ok(Flown {
        planned_n_s: std::array::from_fn(|leg| legs.planned_n_s(leg, flight.body.mass)),
        impulse_n_s,
        position_m: f64::sqrt(square / count),
        farthest_m,
        arrived_m,
        decisions: counts.decisions,
        outside: counts.restarted,
        braking: counts.braking,
        contradictions: counts.contradictions,
        is_lost,
    })
}

/// Not told and told, of one seed.
type Pair = [Flown; 2];

/// By how much a sum over the seeds is lower where the body is learned, as a share.
fn lower(pairs: &[Pair], figure: impl Fn(&Flown) -> f64) -> f64 {
    let [not_told, told] = [0, 1].map(|which: usize| pairs.iter().map(|pair| figure(&pair[which])).sum::<f64>());
    1.0 - told / not_told
}

fn median_lower(pairs: &[Pair], figure: impl Fn(&Flown) -> f64) -> f64 {
    median(pairs.iter().map(|[not_told, told]| 1.0 - figure(told) / figure(not_told)))
}

/// Flies all.
pub fn run(report: &mut Report, seeds: usize) -> Result<(), Failure> {
    for (name, sensing, least) in &SENSING {
        for leg_s in LEG_S {
            let flown =
                each_seed(seeds, |seed| Ok([fly(seed, sensing, leg_s, false)?, fly(seed, sensing, leg_s, true)?]));
            let flown = flown.into_iter().collect::<Result<Vec<Pair>, Failure>>()?;
            judge(report, name, leg_s, *least, &flown);
        }
    }
    Ok(())
}

fn judge(report: &mut Report, name: &str, leg_s: f64, least: f64, pairs: &[Pair]) {
    const LAST: usize = LEGS - 1;
    report.table.push(format!("\nimpulse, {leg_s} s a leg, sensing {name}, seeds 0..{}", pairs.len()));
    for (which, what) in ["updates off", "updates on"].iter().enumerate() {
        let of = |figure: fn(&Flown) -> f64| median(pairs.iter().map(|pair| figure(&pair[which])));
        let most = |figure: fn(&Flown) -> f64| pairs.iter().map(|pair| figure(&pair[which])).fold(0.0, f64::max);
        let sum = |figure: fn(&Flown) -> u64| pairs.iter().map(|pair| figure(&pair[which])).sum::<u64>();
        report.table.push(format!(
            "  {what:11} last leg (medians): floor m*int|a|dt {:.3} N s, flown {:.3} N s, off the plan {:.2} mm; at most {:.1} mm off in the flight, {:.1} mm at the arrival; of {} decisions {} outside of the tube, {} braking; {} beliefs contradicted; estimator in trouble in {} flights",
            of(|one| one.planned_n_s[LAST]),
            of(|one| one.impulse_n_s[LAST]),
            1e3 * of(|one| one.position_m),
            1e3 * most(|one| one.farthest_m),
            1e3 * most(|one| one.arrived_m),
            sum(|one| one.decisions),
            sum(|one| one.outside),
            sum(|one| one.braking),
            sum(|one| one.contradictions),
            sum(|one| u64::from(one.is_lost)),
        ));
    }
    let planned = Interval::of(pairs, |pairs| lower(pairs, |one| one.planned_n_s[LAST]));
    let flown = Interval::of(pairs, |pairs| lower(pairs, |one| one.impulse_n_s[LAST]));
    let middle = Interval::of(pairs, |pairs| median_lower(pairs, |one| one.impulse_n_s[LAST]));
    let whole = Interval::of(pairs, |pairs| lower(pairs, |one| one.impulse_n_s.iter().sum()));
    report.table.push(format!(
        "  last leg lower by: planned {planned}, flown {flown} (median of the pairs {middle}); flown in all legs {whole}"
    ));
    println!(
        "{}",
        json!({"block": "model-knowledge", "part": "impulse", "sensing": name, "leg_s": leg_s, "n": pairs.len(),
            "planned_lower": [planned.value, planned.low, planned.high],
            "flown_lower": [flown.value, flown.low, flown.high],
            "median_flown_lower": [middle.value, middle.low, middle.high],
            "all_legs_lower": [whole.value, whole.low, whole.high]})
    );
    let case = format!("{leg_s} s a leg, sensing {name}: ");
    if leg_s > LEG_S[0] {
        report.at_least(&format!("{case}flown impulse lower by"), flown.value, -HIGHER_AT_MOST);
    } else {
        report.at_least(&format!("{case}planned impulse lower by"), planned.value, PLANNED_LOWER);
        report.target(format!("{case}flown impulse lower by >= {least}"), flown.value >= least, flown.to_string());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Speed and acceleration are slopes, the ends are met, and the impulse per mass is twice the speed of the coast.
    #[test]
    fn a_leg_accelerates_coasts_and_brakes() {
        let (leg_s, rise_s, h) = (24.5, 6.0, 1e-5);
        for k in 0..245 {
            let t = 0.05 + 0.1 * f64::from(k);
            let [before, at, after] = [t - h, t, t + h].map(|t| bang_coast_bang(t, leg_s, rise_s));
            for i in 0..2 {
                assert!(((after[i] - before[i]) / (2.0 * h) - at[1 + i]).abs() < 1e-6, "{t}");
            }
        }
        assert!(bang_coast_bang(leg_s - 1e-9, leg_s, rise_s)[0] > 1.0 - 1e-9);
        let legs = Legs { leg_s: 24.0, rise_s: [6.0; LEGS] };
        let way: f64 = (0..3).map(|i| (PLACES[1][i] - PLACES[0][i]).abs()).sum();
        assert!((legs.planned_n_s(0, 2.0) / (2.0 * 2.0 * way / 18.0) - 1.0).abs() < 1e-9);
    }

    /// The longest axis takes all the acceleration; more of it makes a shorter rise and a slower coast.
    #[test]
    fn a_rise_takes_what_there_is() {
        for (leg, acceleration) in [(0, 0.006), (1, 0.005), (2, 0.02)] {
            let rise = rise_s(leg, 30.0, acceleration).unwrap();
            let distance = (Vector3::from(PLACES[leg + 1]) - Vector3::from(PLACES[leg])).amax();
            assert!((distance * bang_coast_bang(0.5 * rise, 30.0, rise)[2] / acceleration - 1.0).abs() < 1e-12);
        }
        assert!(rise_s(2, 20.0, 0.005).is_none());
    }

    /// The fastest arrival is so to half a second; nobody could be sure of a faster one.
    #[test]
    fn the_fastest_legs_are_the_fastest_certified() {
        let acceleration = certified(wide().unwrap()).unwrap();
        let longest = |leg_s: f64| (0..LEGS).all(|leg| rise_s(leg, leg_s, acceleration).is_some());
        assert!(longest(LEG_S[0]) && !longest(LEG_S[0] - 0.5), "{acceleration}");
    }
}
