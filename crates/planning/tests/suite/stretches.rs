//! Missions flown stretch by stretch as planned: arrival, limits, what is learned, and beliefs that are none.

mod flight;

use flight::{FORCE_N, Flown, Scene, TORQUE_N_M, at_rest, belief, fly, learned, room, slalom, surroundings, way};
use nalgebra::{SMatrix, Vector3};
use tumble_planning::dynamics::Environment;
use tumble_planning::local::{
    CovarianceWeighting, FixedWeighting, InformationWeighting, PlanarBodyModel, RigidBodyModel, WrenchSet,
};
use tumble_planning::mission::{
    InformativeStretch, StretchModel, StretchOutcome, StretchPlanner, StretchSettings, StretchTask,
};
use tumble_planning::{ModelBelief, PlanningError, Units};

/// Shares of mass and inertia, and m, that are not known.
const UNKNOWN: [f64; 3] = [0.1, 0.02, 0.33];
const PRINCIPAL: [usize; 4] = [0, 4, 7, 9];
const FULL: [usize; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9];
const PLANAR: [usize; 2] = [0, 9];
const PLANAR_COM: [usize; 4] = [0, 9, 1, 2];

/// Sizes of the quantities in these places: a weight is a number over the square of the size.
fn sizes<const P: usize>(belief: &ModelBelief, places: &[usize; P]) -> [f64; P] {
    let body = belief.parameters();
    let inertia = body.inertia_about_com().trace() / 3.0;
    let radius = f64::sqrt(1.5 * inertia / body.mass);
    places.map(|place| match place {
        0 => body.mass,
        1..=3 => radius,
        _ => inertia,
    })
}

fn fixed<const P: usize>(belief: &ModelBelief, places: &[usize; P], relative: f64) -> Box<dyn InformationWeighting<P>> {
    let weights = sizes(belief, places).map(|size| relative / (size * size));
    Box::new(FixedWeighting::try_new(weights).unwrap())
}

fn by_covariance<const P: usize>(belief: &ModelBelief, places: &[usize; P]) -> Box<dyn InformationWeighting<P>> {
    let sizes = sizes(belief, places);
    let (base, target) = (sizes.map(|size| 10.0 / (size * size)), sizes.map(|size| 1e-3 * size * size));
    Box::new(CovarianceWeighting::try_new(base, target, 2.2, 5.0).unwrap())
}

/// Flies it weightless, with fixed weights and with those that follow the belief; checks what must hold of each.
fn fly_all<M, const X: usize, const U: usize, const P: usize>(
    model: &M,
    scene: &Scene,
    belief: &ModelBelief,
    settings: &StretchSettings,
    places: &[usize; P],
) -> [Flown; 3]
where
    M: StretchModel<X, U, P> + Clone,
{
    let way = way(scene, belief, settings, 20_000, 1).expect("a way");
    let weightings = [fixed(belief, places, 0.0), fixed(belief, places, 10.0), by_covariance(belief, places)];
    weightings.map(|weighting| {
        let flown = fly(model.clone(), scene, &way, belief, settings, weighting, places, at_rest(scene.start));
        assert!(flown.arrived, "{flown:?}");
        // what the motion differs from the plan by, in steps of a tenth of a second
        assert!(flown.clearance_m >= settings.margin_m - 1e-4, "{flown:?}");
        assert!(flown.input <= 1.0 && flown.speed <= 1.0 && flown.rate <= 1.0, "{flown:?}");
        assert!(flown.arrival_s <= flown.way_s + 3.0, "{flown:?}");
        assert!(flown.end_m < 0.01 && flown.end_m_s < 0.005, "{flown:?}");
        flown
    })
}

#[test]
fn the_slalom_is_flown_by_bodies_light_and_heavy() {
    let (scene, settings) = (slalom(), StretchSettings::default());
    let offset = Vector3::new(1.0, 1.0, 1.0).normalize() * 0.1;
    for mass in [5.0, 9.58, 15.0, 20.0] {
        let belief = belief(mass, offset, UNKNOWN);
        fly_all(&RigidBodyModel::principal(), &scene, &belief, &settings, &PRINCIPAL);
    }
    fly_all(&RigidBodyModel::full(), &scene, &belief(9.58, offset, UNKNOWN), &settings, &FULL);
}

#[test]
fn the_room_is_flown_on_the_table() {
    // the goal is 14 mm from a wall
    let (scene, settings) = (room(), StretchSettings { margin_m: 0.005, ..StretchSettings::default() });
    let height_m = scene.start.translation.z;
    for mass in [12.0, 19.0] {
        let belief = belief(mass, Vector3::new(0.0, -0.1, 0.0), UNKNOWN);
        let model = PlanarBodyModel::mass_and_inertia().at_height(height_m);
        fly_all(&model, &scene, &belief, &settings, &PLANAR);
        let model = PlanarBodyModel::full().at_height(height_m);
        fly_all(&model, &scene, &belief, &settings, &PLANAR_COM);
    }
}

/// A body that turns only at the end of its way learns of the other two axes only by excitation.
#[test]
fn information_is_bought_with_torque_and_hardly_any_force() {
    let (scene, settings) = (slalom(), StretchSettings::default());
    let belief = belief(9.58, Vector3::zeros(), UNKNOWN);
    let [plain, fixed, covariance] = fly_all(&RigidBodyModel::principal(), &scene, &belief, &settings, &PRINCIPAL);
    let left = |flown: &Flown, quantity: usize| flown.sigma[..2].iter().map(|each| each[quantity]).product::<f64>();
    for quantity in [1, 2] {
        assert!(left(&plain, quantity) > 0.99, "{plain:?}");
        for informative in [&fixed, &covariance] {
            let variance = left(informative, quantity).powi(2);
            assert!(variance < 0.2, "{quantity} {informative:?}");
        }
    }
    for informative in [&fixed, &covariance] {
        assert!(left(informative, 0) < 1.02 * left(&plain, 0), "{informative:?}");
        assert!(informative.impulse[0] < 1.05 * plain.impulse[0], "{informative:?}");
    }
    assert!(fixed.impulse[1] > 2.0 * plain.impulse[1], "{fixed:?}");
}

fn planner(belief: &ModelBelief, settings: &StretchSettings) -> InformativeStretch<RigidBodyModel<4>, 12, 6, 4> {
    let limit = [TORQUE_N_M, TORQUE_N_M, TORQUE_N_M, FORCE_N, FORCE_N, FORCE_N];
    let wrench = WrenchSet { limit, half_spaces: Vec::new() };
    InformativeStretch::try_new(RigidBodyModel::principal(), settings, wrench, fixed(belief, &PRINCIPAL, 10.0)).unwrap()
}

/// A quantity that no motion teaches would keep the robot turning at its goal for ever.
#[test]
fn information_is_sought_only_while_there_is_a_way() {
    let (scene, settings) = (slalom(), StretchSettings::default());
    let believed = belief(9.58, Vector3::zeros(), UNKNOWN);
    let way = way(&scene, &believed, &settings, 20_000, 1).expect("a way");
    let around = surroundings(&scene, settings.margin_m);
    for (from_end_s, is_sought) in [(-2.0, true), (0.0, false), (5.0, false)] {
        let task = StretchTask {
            start: at_rest(scene.goal),
            start_s: 10.0 + way.duration_s() + from_end_s,
            asked_s: 10.0 + way.duration_s() + from_end_s,
            way: &way,
            way_start_s: 10.0,
            belief: &believed,
            environment: &Environment::default(),
            surroundings: &around,
            is_informative: true,
            elapsed_s: 0.0,
        };
        let planned = planner(&believed, &settings).plan(&task, &mut Units::new(u64::MAX)).unwrap().planned().unwrap();
        assert_eq!(planned.weights.iter().any(|weight| *weight > 0.0), is_sought, "{from_end_s}");
        assert!(is_sought || planned.is_last, "{from_end_s}");
    }
}

#[test]
fn a_plan_that_goes_on_is_begun_from_the_last_one() {
    let (scene, settings) = (slalom(), StretchSettings::default());
    let believed = belief(9.58, Vector3::zeros(), UNKNOWN);
    let way = way(&scene, &believed, &settings, 20_000, 1).expect("a way");
    let around = surroundings(&scene, settings.margin_m);
    let task = StretchTask {
        start: at_rest(scene.start),
        start_s: 0.0,
        asked_s: 0.0,
        way: &way,
        way_start_s: 0.0,
        belief: &believed,
        environment: &Environment::default(),
        surroundings: &around,
        is_informative: true,
        elapsed_s: 0.0,
    };
    let budget = || Units::new(u64::MAX);
    let mut first = planner(&believed, &settings);
    let answer = first.plan(&task, &mut budget()).unwrap().planned().unwrap();
    assert!(answer.quantities[0] == "mass" && answer.weights[0] > 0.0 && !answer.is_last, "{answer:?}");
    assert!((answer.sigma[0][0] - 0.958).abs() < 1e-3 && answer.sigma[0][1] < answer.sigma[0][0], "{answer:?}");
    assert!(answer.motion.start_s() == 0.0 && (answer.motion.end_s() - 12.0).abs() < 1e-12);
    assert_eq!(answer.arrival_s, None);

    let start_s = 4.0 * settings.step_s;
    let next =
        StretchTask { start: answer.motion.state_at(start_s), start_s, asked_s: start_s, elapsed_s: start_s, ..task };
    first.plan(&next, &mut budget()).unwrap().planned().unwrap();
    let warm = first.iterations();
    let mut second = planner(&believed, &settings);
    second.plan(&next, &mut budget()).unwrap().planned().unwrap();
    assert!(warm <= second.iterations() && warm < 10, "{warm} {}", second.iterations());

    let unimportant = StretchTask { is_informative: false, ..task };
    let answer = planner(&believed, &settings).plan(&unimportant, &mut budget()).unwrap().planned().unwrap();
    assert_eq!(answer.weights, [0.0; 4]);
    assert!(answer.sigma[1][1] > 0.99 * answer.sigma[1][0], "{answer:?}");

    // in the middle of a wall
    let mut start = at_rest(scene.start);
    start.world_from_body.translation.vector = Vector3::new(10.4, -8.5, 4.9);
    let refused = planner(&believed, &settings).plan(&StretchTask { start, ..task }, &mut budget()).unwrap();
    let refusal = refused.refused().expect("a start inside of a wall");
    assert!(refusal.violation > 0.1 && refusal.blocker.is_some(), "{refusal:?}");
    // nothing granted: nothing found, or what it began with
    let none = planner(&believed, &settings).plan(&task, &mut Units::new(0)).unwrap();
    assert!(none.planned().is_none_or(|answer| answer.sigma.len() == 4));
}

#[test]
fn beliefs_that_are_none_are_answers_or_errors() {
    let (scene, settings) = (slalom(), StretchSettings { iterations: 5, ..StretchSettings::default() });
    let believed = belief(9.58, Vector3::zeros(), UNKNOWN);
    let way = way(&scene, &believed, &settings, 20_000, 1).expect("a way");
    let around = surroundings(&scene, settings.margin_m);
    let plan = |belief: &ModelBelief| {
        let task = StretchTask {
            start: at_rest(scene.start),
            start_s: 0.0,
            asked_s: 0.0,
            way: &way,
            way_start_s: 0.0,
            belief,
            environment: &Environment::default(),
            surroundings: &around,
            is_informative: true,
            elapsed_s: 0.0,
        };
        planner(&believed, &settings).plan(&task, &mut Units::new(100_000))
    };
    let with = |change: &dyn Fn(&mut ModelBelief)| {
        let mut changed = believed.clone();
        change(&mut changed);
        plan(&changed)
    };
    let is_planned = |outcome| matches!(outcome, StretchOutcome::Planned(_));
    let covariance =
        |entry: f64| with(&|belief| belief.estimate.covariance = SMatrix::<f64, 10, 10>::identity() * entry);
    assert!(matches!(covariance(f64::NAN), Err(PlanningError::NotFinite { .. } | PlanningError::Negative { .. })));
    assert!(covariance(f64::INFINITY).is_err());
    assert!(matches!(covariance(-1.0), Err(PlanningError::Negative { .. })));
    assert!(with(&|belief| belief.estimate.covariance[(0, 4)] = 1e3).is_err());
    // nothing left to learn, or everything
    assert!(covariance(0.0).is_ok_and(is_planned));
    assert!(covariance(1e4).is_ok());
    assert!(covariance(1e-30).is_ok_and(is_planned));
    assert!(with(&|belief| belief.estimate.parameters.mass = -1.0).is_err());
    assert!(with(&|belief| belief.estimate.parameters.mass = f64::NAN).is_err());
    // so light that the limits of speed say nothing between the nodes
    assert!(with(&|belief| belief.estimate.parameters.mass = 1e-3).is_err());
    assert!(learned(&believed, &PRINCIPAL, &SMatrix::identity()).revision == 2);
}
