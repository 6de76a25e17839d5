use super::*;
use crate::mission::{ModelChoice, WeightingChoice};
use crate::scenario::{EMBEDDED, WeightingSettings};
use std::path::Path;
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_lie::Wrench;
use tumble_planning::Units;
use tumble_planning::collision::EllipsoidWorld;
use tumble_planning::global::{FlightPlanner, GlobalPlanner, GlobalRequest, Objective, Status, Until};

fn options(model: ModelChoice) -> FlyOptions {
    FlyOptions {
        seed: 7,
        weighting: WeightingChoice::Covariance,
        feedback: true,
        model,
        fault: None,
        layers: crate::mission::LayerNames::default(),
    }
}

fn missions() -> Vec<ScenarioSource> {
    let sources = EMBEDDED.map(|embedded| ScenarioSource::parse(Path::new(embedded.name), embedded.text).unwrap());
    sources.into_iter().filter(|source| source.scenario.fly.is_some()).collect()
}

fn embedded(name: &str) -> ScenarioSource {
    ScenarioSource::find(name).unwrap()
}

fn mission(name: &str, model: ModelChoice) -> MissionProblem {
    embedded(name).mission(&options(model)).unwrap()
}

/// A mission in open space with these lines and tables besides what it needs.
fn refusal(lines: &str) -> String {
    let text = format!(
        "format = 1\nname = \"m\"\nworld = \"iss\"\nduration_s = 90\n[start]\npoint = \"A\"\n[goal]\npoint = \"B\"\n{lines}"
    );
    let source = ScenarioSource::parse(Path::new("m.toml"), &text);
    source.and_then(|source| source.mission(&options(ModelChoice::Scenario)).map(drop)).unwrap_err().to_string()
}

#[test]
fn every_embedded_mission_is_one_with_every_model() {
    let sources = missions();
    assert_eq!(sources.len(), 12);
    for source in &sources {
        assert!(source.scenario.duration_s <= 150.0);
        for model in
            [ModelChoice::Scenario, ModelChoice::True, ModelChoice::Low, ModelChoice::High, ModelChoice::Payload]
        {
            let problem = source.mission(&options(model)).unwrap();
            let name = &problem.name;
            assert!(problem.prior.parameters.is_strictly_consistent(), "{name} {model:?}");
            assert!(problem.truth.is_strictly_consistent(), "{name}");
            assert_eq!(problem.planning.belief.estimate, problem.prior);
            assert_eq!(problem.seen_from_s.len(), problem.planning.world.obstacles.len());
            assert_eq!(problem.weighting.gamma0.len(), problem.unknowns.count());
            assert_eq!(problem.weighting.target_variance.len(), problem.unknowns.count());
            assert!((problem.stretch_s - 12.0).abs() < 1e-12);
            assert_eq!(problem.planar, name.starts_with("granite"));
            assert_eq!(problem.planning.margin_m.to_bits(), problem.margins_m.way.to_bits());
            let Margins { way, stretch, checked } = problem.margins_m;
            assert!(way > stretch && stretch > checked && checked > 0.0, "{name}");
        }
    }
    assert!(mission("iss-station", ModelChoice::Scenario).station_keeping());
    assert!(!mission("iss-cargo", ModelChoice::Scenario).station_keeping());
}

/// Within the limits of the mission there is a way that ends in time, whatever comes into view.
#[test]
fn every_embedded_mission_can_be_flown() {
    for source in missions() {
        let problem = source.mission(&options(ModelChoice::Scenario)).unwrap();
        let planning = &problem.planning;
        let world = EllipsoidWorld::new(&planning.world).unwrap();
        let request = GlobalRequest {
            world: &world,
            body: &planning.body,
            start: planning.start,
            attitude: planning.attitude,
            start_s: 0.0,
            goal: planning.goal,
            limits: planning.limits,
            belief: &planning.belief,
            objective: Objective::Duration,
            margin_m: planning.margin_m,
            until: Until::BudgetSpent,
            seed: 1,
        };
        let answer = FlightPlanner::default().plan(&request, &mut Units::new(4000)).unwrap();
        assert!(matches!(answer.status, Status::Feasible | Status::Optimal), "{} {:?}", problem.name, answer.status);
        let duration_s = answer.plan.unwrap().trajectory.duration_s();
        assert!(duration_s < 0.7 * problem.longest_s, "{}: {duration_s} s", problem.name);
    }
}

#[test]
fn models_are_those_of_the_sources() {
    let believed = |name, model| mission(name, model).prior.parameters;
    let low = believed("iss-cargo", ModelChoice::Low);
    assert!((low.mass - 5.0).abs() < 1e-12 && (low.inertia_about_com()[(2, 2)] - 0.075).abs() < 1e-12);
    let high = believed("granite-cargo", ModelChoice::High);
    assert!((high.mass - 20.0).abs() < 1e-12 && (high.inertia_about_com()[(2, 2)] - 0.3).abs() < 1e-12);
    // Two bodies: robot of 19.0 kg with 0.25, payload of 11.8 kg with 0.015 kg m^2, 0.305 m apart along y.
    let part = |mass, y, moment| {
        InertialParameters::about_com(mass, Vector3::new(0.0, y, 0.0), Matrix3::from_diagonal_element(moment))
    };
    let both = part(19.0, 0.0, 0.25) + part(11.8, -0.305, 0.015);
    let payload = believed("granite-cargo", ModelChoice::Payload);
    assert!((payload.mass - both.mass).abs() < 1e-9);
    assert!((payload.center_of_mass() - both.center_of_mass()).norm() < 4e-3);
    assert!((payload.inertia_about_com() - both.inertia_about_com()).amax() < 4e-3);
    // What it is, and what the scenario takes it for: the robot alone.
    let problem = mission("iss-cargo", ModelChoice::True);
    assert!((problem.prior.parameters.to_vector() - problem.truth.to_vector()).amax() < 1e-12);
    assert!((problem.truth.mass - problem.place.body().mass - 3.0).abs() < 1e-12);
    let robot = problem.place.body();
    let center: Vector3<f64> = (robot.first_moment + Vector3::new(0.12, -0.06, 0.04) * 3.0) / (robot.mass + 3.0);
    assert!((problem.truth.center_of_mass() - center).norm() < 1e-12);
    assert!((believed("iss-cargo", ModelChoice::Scenario).mass - robot.mass).abs() < 1e-12);
}

#[test]
fn a_payload_of_the_way_is_in_the_truth_of_the_end_only() {
    for (name, mass_kg) in [("iss-grasp", 3.0), ("granite-grasp", 11.8)] {
        let mut problem = mission(name, ModelChoice::True);
        let robot = problem.place.body();
        assert!((problem.prior.parameters.mass - robot.mass).abs() < 1e-12);
        assert!((problem.truth.mass - robot.mass - mass_kg).abs() < 1e-12);
        let flight = &mut problem.flight;
        // 30 s, and the period that begins then
        for _ in 0..1875 {
            flight.push(&Wrench::zero()).unwrap();
        }
        assert!((flight.simulator.body().mass - robot.mass).abs() < 1e-12);
        flight.push(&Wrench::zero()).unwrap();
        assert!((flight.simulator.body().mass - robot.mass - mass_kg).abs() < 1e-12);
    }
}

/// On the table nothing that would tilt the body counts, in the truth and in the belief.
#[test]
fn on_the_table_bodies_are_what_counts_there() {
    let mut source = embedded("granite-cargo");
    source.scenario.payload.as_mut().unwrap().grasp_position_m = [0.1, -0.1, 0.07];
    for model in [ModelChoice::Scenario, ModelChoice::True] {
        let problem = source.mission(&options(model)).unwrap();
        for body in [problem.truth, problem.prior.parameters] {
            let inertia = body.inertia_about_origin;
            assert!(body.first_moment.z == 0.0 && inertia[(0, 2)] == 0.0 && inertia[(1, 2)] == 0.0);
        }
        assert!(problem.truth.is_strictly_consistent() && problem.truth.first_moment.x > 0.5);
        assert!(problem.planning.limits.force_n.z == 0.0);
    }
}

/// What planners push along world axes is no more than their share along body axes, however the robot is turned.
#[test]
fn shares_of_planners_hold_in_every_attitude() {
    let mut noise = tumble_identification::noise::Gaussian::from_seed(5);
    for name in ["iss-cargo", "granite-cargo"] {
        let problem = mission(name, ModelChoice::Scenario);
        let (force, share) = (problem.planning.limits.force_n, problem.plan_force_share);
        let mut largest = 0.0_f64;
        for _ in 0..20_000 {
            let turn = if problem.planar {
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 7.0 * noise.uniform())
            } else {
                UnitQuaternion::from_scaled_axis(noise.vector(2.0))
            };
            let corner = force.map(|limit| if noise.uniform() < 0.5 { -limit } else { limit });
            let body = (turn * corner).component_div(&problem.force_limit_n);
            largest = largest.max(if problem.planar { body.xy().amax() } else { body.amax() });
        }
        assert!(largest <= share * (1.0 + 1e-12) && largest > 0.95 * share, "{name}: {largest} of {share}");
    }
    // [plan] has the last word
    let mut source = embedded("iss-cargo");
    source.scenario.plan.as_mut().unwrap().force_limit_n = Some([0.02, 0.03, 0.04]);
    let problem = source.mission(&options(ModelChoice::Scenario)).unwrap();
    assert_eq!(problem.planning.limits.force_n, Vector3::new(0.02, 0.03, 0.04));
}

#[test]
fn the_heaviest_body_can_stop() {
    for name in ["iss-cargo", "granite-cargo"] {
        for model in [ModelChoice::Low, ModelChoice::Scenario] {
            let problem = mission(name, model);
            let [_, heaviest] = problem.mass_interval_share;
            let body = &problem.prior.parameters;
            let force = heaviest * body.mass * problem.stop.acceleration_m_s2;
            let weakest = if problem.planar { problem.force_limit_n.xy().min() } else { problem.force_limit_n.min() };
            assert!((force / weakest - 0.6).abs() < 1e-12, "{name} {force}");
            let torque = heaviest * body.inertia_about_com()[(2, 2)] * problem.stop.angular_acceleration_rad_s2;
            assert!(torque <= 0.6 * problem.torque_limit_n_m.z * (1.0 + 1e-12));
        }
    }
}

/// A factor between a half and two, its logarithm evenly distributed, has the deviation of the prior.
#[test]
fn the_prior_is_as_broad_as_what_a_belief_is_off_by() {
    let problem = mission("iss-cargo", ModelChoice::Scenario);
    let (body, prior) = (problem.prior.parameters, &problem.prior);
    let deviation = 2.0 * std::f64::consts::LN_2 / f64::sqrt(12.0);
    assert!((f64::sqrt(prior.covariance[(0, 0)]) / body.mass / deviation - 1.0).abs() < 0.01);
    assert!((prior.std.mass_kg / body.mass - 0.4).abs() < 1e-12);
    // p = m c, both unknown
    let (center, share) = (body.center_of_mass().x, 0.4);
    let deviation = body.mass * f64::sqrt(0.08 * 0.08 + center * center * share * share);
    assert!((f64::sqrt(prior.covariance[(1, 1)]) / deviation - 1.0).abs() < 1e-9);
    assert!(prior.covariance.cholesky().is_some());
    // written, it is what is written
    let mut source = embedded("iss-cargo");
    let table = toml::from_str("mass_sigma_kg = 0.5\ncom_sigma_m = 0.01\ninertia_sigma_share = 0.1").unwrap();
    source.scenario.fly.as_mut().unwrap().prior = Some(table);
    let prior = source.mission(&options(ModelChoice::Scenario)).unwrap().prior;
    assert!((prior.std.mass_kg - 0.5).abs() < 1e-12 && (prior.std.center_of_mass_m.x - 0.01).abs() < 1e-12);
    assert!((prior.std.inertia_about_com_kg_m2[(0, 0)] / body.inertia_about_com()[(0, 0)] - 0.1).abs() < 1e-9);
}

#[test]
fn information_is_worth_the_same_whatever_the_unit() {
    let problem = mission("iss-cargo", ModelChoice::Scenario);
    let body = problem.prior.parameters;
    let WeightingSettings { gamma0, target_variance, alpha, beta } = &problem.weighting;
    assert_eq!((gamma0.len(), *alpha, *beta), (10, 2.2, 5.0));
    assert!((gamma0[0] * body.mass * body.mass - 3.0).abs() < 1e-9);
    assert!((gamma0[9] * body.inertia_about_com()[(2, 2)].powi(2) - 3.0).abs() < 1e-9);
    // mass, centre of mass, inertia; on the table mass, Izz, centre of mass
    assert!(
        [(0, 0.1), (1, 0.003), (3, 0.003), (4, 0.004)]
            .iter()
            .all(|(i, sigma)| { (f64::sqrt(target_variance[*i]) - sigma).abs() < 1e-12 })
    );
    let table = mission("granite-cargo", ModelChoice::Scenario).weighting.target_variance;
    assert!((f64::sqrt(table[1]) - 0.004).abs() < 1e-12 && (f64::sqrt(table[2]) - 0.003).abs() < 1e-12);
}

#[test]
fn obstacles_are_seen_when_they_appear_or_later() {
    assert_eq!(mission("iss-astronaut", ModelChoice::Scenario).seen_from_s, [0.0, 0.0, 25.0]);
    let mut source = embedded("iss-astronaut");
    source.scenario.obstacles[0].seen_s = Some(31.5);
    assert_eq!(source.mission(&options(ModelChoice::Scenario)).unwrap().seen_from_s, [0.0, 0.0, 31.5]);
    assert_eq!(mission("iss-cargo", ModelChoice::Scenario).seen_from_s, [0.0, 0.0]);
}

#[test]
fn options_seed_the_flight_and_the_limits_are_those_of_the_robot() {
    let first = |seed| {
        let options = FlyOptions { seed, ..options(ModelChoice::Scenario) };
        let mut problem = embedded("iss-cargo").mission(&options).unwrap();
        let estimates = (0..40).map(|_| problem.flight.step().unwrap().unwrap().estimate);
        estimates.flatten().last().unwrap().world_from_body.translation.vector
    };
    assert!(first(1) == first(1) && first(1) != first(2));
    let problem = mission("iss-cargo", ModelChoice::Scenario);
    assert_eq!(problem.force_limit_n, Vector3::new(0.452, 0.216, 0.257));
    assert_eq!(problem.torque_limit_n_m, Vector3::new(0.045, 0.022, 0.026));
    assert!((problem.speed_limit_m_s - 0.4).abs() < 1e-12 && (problem.rate_limit_rad_s - 0.52).abs() < 0.01);
}

#[test]
fn plans_keep_within_what_the_localisation_survives() {
    for name in ["iss-cargo", "granite-cargo"] {
        let free = mission(name, ModelChoice::Scenario);
        assert_eq!(free.planned_motion.survived, None);
        let thesis = embedded(name).sensed_by("thesis-flight").unwrap();
        let problem = thesis.mission(&options(ModelChoice::Scenario)).unwrap();
        let motion = problem.planned_motion;
        assert!((motion.rate_rad_s - 0.12).abs() < 1e-12 && (motion.acceleration_m_s2 - 0.024).abs() < 1e-12);
        let axes = if problem.planar { 1.0 } else { 3.0 };
        let all_axes = motion.rate_of_an_axis_rad_s(problem.planar) * f64::sqrt(axes);
        assert!((all_axes - motion.rate_rad_s).abs() < 1e-12, "{name}");
        let limits = &problem.planning.limits;
        assert!(limits.rate_rad_s < motion.rate_of_an_axis_rad_s(problem.planar), "{name}");
        assert!(limits.rate_rad_s < free.planning.limits.rate_rad_s, "{name}");
        let pushed = limits.force_n.norm() / problem.prior.parameters.mass;
        assert!(pushed < motion.acceleration_m_s2 + 1e-12, "{name} {pushed}");
    }
}

#[test]
fn errors_name_the_key_and_its_place() {
    for (lines, line, said) in [
        ("[fly]\nstep_ss = 0.3\n", 10, "did you mean `step_s`?"),
        ("[fly]\nstep_s = 0.0\n", 10, "`fly.step_s`"),
        ("[fly]\nplan_force_share = 1.5\n", 10, "`fly.plan_force_share`"),
        ("[fly]\nmass_interval_share = [1.1, 2.0]\n", 10, "`fly.mass_interval_share`"),
        ("[fly]\nmass_interval_share = [0.5, nan]\n", 10, "`fly.mass_interval_share`"),
        ("[fly]\nforce_limit_n = [0.1, -0.1, 0.1]\n", 10, "`fly.force_limit_n`"),
        ("[fly]\nunknowns = \"planar\"\n", 10, "`principal` or `full` in the world `iss`"),
        ("[fly]\nstretch_steps = 1\n", 10, "`fly.stretch_steps`"),
        ("[fly]\nstation_stretches = 101\n", 10, "`fly.station_stretches`"),
        ("[fly.arrival]\nfor_s = inf\n", 10, "`fly.arrival.for_s`"),
        ("[fly.arrival]\npositoin_m = 1\n", 10, "did you mean `position_m`?"),
        ("[fly.prior]\nmass_sigma_share = 0\n", 10, "`fly.prior.mass_sigma_share`"),
        ("[fly.prior]\nmass_sigma_kg = 1\nmass_sigma_share = 0.1\n", 11, "not both"),
        ("[fly.information]\ntarget_com_m = -1\n", 10, "`fly.information.target_com_m`"),
        ("[fly.estimator]\nforce_n = 0\n", 10, "`fly.estimator.force_n`"),
        ("[fly.computing]\nlocal_units = 0\n", 10, "`fly.computing.local_units`"),
        (
            "[[obstacles]]\ncenter_m = [11, -8, 4]\nsemi_axes_m = [0.1, 0.1, 0.1]\nseen_s = -1\n",
            12,
            "`obstacles.seen_s`",
        ),
        ("[flyy]\n", 9, "did you mean `fly`?"),
    ] {
        let message = refusal(lines);
        assert!(message.starts_with(&format!("m.toml, line {line}")), "{lines:?}: {message}");
        assert!(message.contains(said), "{lines:?}: {message}");
    }
}
