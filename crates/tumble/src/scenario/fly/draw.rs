//! Missions drawn at random, for campaigns.

use crate::TumbleError;
use crate::scenario::{BodyTable, PayloadTable, ScenarioSource};
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use tumble_identification::noise::Gaussian;

/// How far beyond a factor of two a belief may be off at most, as a share.
pub const LARGEST_OUTSIDE: f64 = 0.3;

/// Heaviest payload, kg.
const HEAVIEST_KG: f64 = 10.0;
/// A payload that weighs less is none, kg.
const LIGHTEST_KG: f64 = 0.05;
/// Farthest that a payload's centre of mass is from the body origin, m, in a smaller robot its radius: it bounds the common one's too.
const FARTHEST_M: f64 = 0.15;
/// Semi-axes of the ellipsoid that a payload is as heavy as everywhere, m.
const SEMI_AXES_M: (f64, f64) = (0.03, 0.15);
/// A belief is off by this factor at most, either way.
const FACTOR: f64 = 2.0;
/// A drawn mission may take so many times as long.
const LONGER: f64 = 2.0;
/// Trials of three moments before all are off by one factor.
const TRIALS: usize = 1000;
/// How much less than the two others together a believed moment is at least, as a share: a body of some thickness.
const THICKNESS: f64 = 1e-3;
/// What the seed of a draw differs by from that of the flight.
const DRAW: u64 = 0x6d69_7373_696f_6e73;

/// The mission that belongs to a scenario and a seed: a payload of 0 to 10 kg within the robot's sphere, and a belief without it
/// whose mass and moments are off by up to a factor of two either way, in logarithms evenly, and twice the time; with `outside` above zero the mass is
/// off by more than that, by up to this share of it. World, start, goal, noise and settings are those of the scenario; so is the
/// time at which a payload is taken hold of.
///
/// A pure function; the scenario's seed is this one without its highest bit, which TOML cannot write. Its text says all of it.
///
/// # Errors
/// Those of the scenario's body; [`TumbleError::BadOption`] for a share that is negative or above [`LARGEST_OUTSIDE`].
pub fn draw_mission(source: &ScenarioSource, seed: u64, outside: f64) -> Result<ScenarioSource, TumbleError> {
    if !(0.0..=LARGEST_OUTSIDE).contains(&outside) {
        let message = format!("a share of {outside} beyond a factor of two: 0 to {LARGEST_OUTSIDE}");
        return Err(TumbleError::BadOption { message });
    }
    let place = source.place()?;
    let robot = source.true_body(place, false)?;
    let mut random = Gaussian::from_seed(seed ^ DRAW);
    let reach_m = source.robot_radius_m()?.min(FARTHEST_M);
    let payload = payload(&mut random, reach_m, place.is_planar());
    let truth = payload.map_or(robot, |payload| robot + payload);
    let belief = belief(&mut random, &truth, robot.center_of_mass(), outside);

    let mut drawn = source.clone();
    let scenario = &mut drawn.scenario;
    scenario.description = Some(format!("Drawn from {} by the seed {seed}.", scenario.name));
    scenario.seed = seed & (u64::MAX >> 1);
    // up to four times as heavy as the robot, or taken for that, takes twice as long to push
    scenario.duration_s *= LONGER;
    scenario.belief = Some(BodyTable::of(&belief));
    scenario.payload = payload.map(|payload| {
        let BodyTable { mass_kg, inertia_about_com_kg_m2, .. } = BodyTable::of(&payload);
        let held = scenario.payload.take().unwrap_or_default();
        PayloadTable {
            mass_kg,
            inertia_about_com_kg_m2,
            grasp_position_m: payload.center_of_mass().into(),
            attach_s: held.attach_s,
            release_s: held.release_s,
            motion: held.motion,
            ..PayloadTable::default()
        }
    });
    let text = drawn.to_toml()?;
    Ok(ScenarioSource::parse(&source.path, &text)?.among(&source.robots))
}

fn between(random: &mut Gaussian, (least, most): (f64, f64)) -> f64 {
    least + (most - least) * random.uniform()
}

/// An ellipsoid of even density somewhere in the robot's sphere, about the body origin; on a table in the plane of the origin.
fn payload(random: &mut Gaussian, reach_m: f64, is_planar: bool) -> Option<InertialParameters<f64>> {
    let mass_kg = HEAVIEST_KG * random.uniform();
    let mut direction = random.vector(1.0);
    if is_planar {
        direction.z = 0.0;
    }
    // evenly in the ball, or in the disc
    let share = random.uniform();
    let share = if is_planar { libm::sqrt(share) } else { libm::cbrt(share) };
    let center_m = direction * (reach_m * share / direction.norm());
    let [a, b, c] = [(); 3].map(|()| between(random, SEMI_AXES_M)).map(|axis| axis * axis);
    let moments = Vector3::new(b + c, a + c, a + b) * (mass_kg / 5.0);
    let [x, y, z, w] = [(); 4].map(|()| random.normal());
    let turn = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)).to_rotation_matrix();
    let inertia = turn.matrix() * Matrix3::from_diagonal(&moments) * turn.matrix().transpose();
    let inertia = (inertia + inertia.transpose()) * 0.5;
    (mass_kg >= LIGHTEST_KG).then(|| InertialParameters::about_com(mass_kg, center_m, inertia))
}

/// What the robot is taken for: wrong, but a body.
fn belief(
    random: &mut Gaussian,
    truth: &InertialParameters<f64>,
    center_m: Vector3<f64>,
    outside: f64,
) -> InertialParameters<f64> {
    let most = FACTOR * (1.0 + outside);
    let factor = |random: &mut Gaussian| libm::exp(libm::log(most) * between(random, (-1.0, 1.0)));
    let mass = if outside > 0.0 {
        let beyond = FACTOR * (1.0 + outside * (1.0 - random.uniform()));
        if random.uniform() < 0.5 { 1.0 / beyond } else { beyond }
    } else {
        factor(random)
    };
    let moments = truth.inertia_about_com().diagonal();
    let is_body = |moments: &Vector3<f64>| moments.max() * (2.0 + THICKNESS) < moments.sum();
    let mut believed = None;
    for _ in 0..TRIALS {
        let trial = moments.map(|moment| moment * factor(random));
        if is_body(&trial) {
            believed = Some(trial);
            break;
        }
    }
    let believed = believed.unwrap_or_else(|| moments * factor(random));
    InertialParameters::about_com(truth.mass * mass, center_m, Matrix3::from_diagonal(&believed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mission::{FlyOptions, LayerNames, ModelChoice, WeightingChoice};
    use std::path::Path;

    fn source(name: &str) -> ScenarioSource {
        ScenarioSource::find(name).unwrap()
    }

    /// Belief over truth of the mass, and of each moment about the centre of mass; the truth; the believed body.
    fn compared(drawn: &ScenarioSource) -> (f64, Vector3<f64>, InertialParameters<f64>, InertialParameters<f64>) {
        let place = drawn.place().unwrap();
        let (truth, belief) = (drawn.true_body(place, true).unwrap(), drawn.bodies(place).unwrap().1);
        let moments = |body: &InertialParameters<f64>| body.inertia_about_com().diagonal();
        (belief.mass / truth.mass, moments(&belief).component_div(&moments(&truth)), truth, belief)
    }

    #[test]
    fn draws_stay_in_their_bounds_and_fill_them() {
        const DRAWS: u32 = 1000;
        for name in ["iss-cargo", "granite-cargo"] {
            let source = source(name);
            let robot = source.true_body(source.place().unwrap(), false).unwrap();
            let (mut payloads, mut ratios, mut moments) = (Vec::new(), Vec::new(), Vec::new());
            let mut farthest_m = 0.0_f64;
            for seed in 0..u64::from(DRAWS) {
                let drawn = draw_mission(&source, seed, 0.0).unwrap();
                let (mass, moment, truth, belief) = compared(&drawn);
                assert!((0.5..=2.0).contains(&mass), "{name} {seed}: {mass}");
                assert!(
                    moment.min() >= 0.5 * (1.0 - 1e-9) && moment.max() <= 2.0 * (1.0 + 1e-9),
                    "{name} {seed}: {moment}"
                );
                assert!(truth.is_strictly_consistent() && belief.is_strictly_consistent(), "{name} {seed}");
                let payload = truth - robot;
                assert!(payload.mass < 10.0 + 1e-9, "{name} {seed}");
                assert!(truth.center_of_mass().norm() <= 0.15, "{name} {seed}");
                if payload.mass > LIGHTEST_KG {
                    assert!(payload.center_of_mass().norm() <= 0.15 + 1e-6, "{name} {seed}");
                    assert!(payload.is_strictly_consistent(), "{name} {seed}");
                    farthest_m = farthest_m.max(payload.center_of_mass().norm());
                    // no moment is that of a body larger than the ellipsoids
                    let largest = payload.inertia_about_com().symmetric_eigenvalues().max();
                    assert!(largest <= payload.mass / 5.0 * 2.0 * 0.15 * 0.15 * (1.0 + 1e-6), "{name} {seed}");
                }
                payloads.push(payload.mass);
                ratios.push(f64::ln(mass));
                moments.push(f64::ln(moment.z));
            }
            assert!(farthest_m > 0.145, "{farthest_m}");
            // Means within four standard errors of the middle; both ends are reached.
            let n = f64::from(DRAWS);
            let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
            let ends = |values: &[f64]| values.iter().fold((f64::MAX, f64::MIN), |e, v| (e.0.min(*v), e.1.max(*v)));
            let error = |width: f64| 4.0 * width / f64::sqrt(12.0 * n);
            let ln2 = std::f64::consts::LN_2;
            assert!((mean(&payloads) - 5.0).abs() < error(10.0) && mean(&ratios).abs() < error(2.0 * ln2));
            assert!(ends(&payloads).0 < 0.1 && ends(&payloads).1 > 9.9);
            assert!(ends(&ratios).0 < -0.97 * ln2 && ends(&ratios).1 > 0.97 * ln2);
            assert!(ends(&moments).0 < -0.9 * ln2 && ends(&moments).1 > 0.9 * ln2);
        }
    }

    #[test]
    fn beliefs_beyond_a_factor_of_two_are_off_by_a_third_more_at_most() {
        let source = source("iss-cargo");
        let (mut below, mut above) = (0, 0);
        for seed in 0..300 {
            let (mass, moment, _, belief) = compared(&draw_mission(&source, seed, 0.3).unwrap());
            assert!(belief.is_strictly_consistent());
            assert!(moment.min() >= 1.0 / 2.600_001 && moment.max() <= 2.600_001, "{moment}");
            let off = f64::max(mass, 1.0 / mass);
            assert!(off > 2.0 - 1e-9 && off <= 2.6 + 1e-9, "{off}");
            if mass < 1.0 { below += 1 } else { above += 1 }
        }
        assert!(below > 100 && above > 100, "{below} {above}");
        for outside in [-0.1, 0.31, f64::NAN] {
            assert!(matches!(draw_mission(&source, 1, outside), Err(TumbleError::BadOption { .. })));
        }
    }

    /// What is drawn is a scenario in full: read again it is the same, and it can be flown.
    #[test]
    fn a_draw_is_a_scenario_that_depends_on_its_seed_only() {
        for name in ["iss-cargo", "granite-cargo", "iss-grasp"] {
            let source = source(name);
            for seed in [0, 1, 2, 3, 40, u64::MAX] {
                let drawn = draw_mission(&source, seed, 0.0).unwrap();
                assert_eq!(drawn.text, draw_mission(&source, seed, 0.0).unwrap().text);
                assert_eq!(drawn.to_toml().unwrap(), drawn.text);
                let read = ScenarioSource::parse(Path::new("elsewhere.toml"), &drawn.text).unwrap();
                assert_eq!(read.scenario, drawn.scenario);
                let (model, weighting) = (ModelChoice::Scenario, WeightingChoice::Covariance);
                let options =
                    FlyOptions { seed, weighting, feedback: true, model, fault: None, layers: LayerNames::default() };
                let problem = read.mission(&options).unwrap();
                let (mass, ..) = compared(&read);
                assert!((problem.prior.parameters.mass / problem.truth.mass - mass).abs() < 1e-12);
                // what does not concern the bodies is the scenario's
                let (scenario, of) = (&read.scenario, &source.scenario);
                assert_eq!((&scenario.start, &scenario.goal, &scenario.plan), (&of.start, &of.goal, &of.plan));
                assert_eq!((&scenario.sensing, scenario.obstacle_set), (&of.sensing, of.obstacle_set));
                let attach_s = |s: &crate::scenario::Scenario| s.payload.as_ref().map_or(0.0, |held| held.attach_s);
                assert!(scenario.payload.is_none() || attach_s(scenario).to_bits() == attach_s(of).to_bits());
            }
            let text = |seed| draw_mission(&source, seed, 0.0).unwrap().text;
            assert_ne!(text(1), text(2));
        }
    }
}
