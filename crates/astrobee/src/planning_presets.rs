//! Numbers of RATTLE's planners, and the problems of its runs.
//!
//! Provenance of every number: rattle-iros-2022 (93d2f99), global and local planner; thesis 6.2.1, 6.2.2.

use crate::flight_modes::FlightMode;
use crate::worlds::{ROBOT_RADIUS_M, WorldPreset};
use tumble_dynamics::AlignedBox;
use tumble_dynamics::nalgebra::Vector3;
use tumble_planning::collision::BodyShape;
use tumble_planning::global::{EdgeCheck, GoalRegion, MotionLimits, PrimitiveRrt, PrimitiveRrtSettings};
use tumble_planning::local::{
    CovarianceWeighting, ExponentialWeighting, FixedWeighting, InformationWeighting, StepWeighting,
};
use tumble_planning::{DoubleIntegrator, PlanningError, Propagation};

/// Where the planner lets the station's robot be, m.
pub const ISS_POSITION_M: [[f64; 3]; 2] = [[10.3, -9.8, 4.2], [11.2, -7.5, 5.3]];
/// Where it lets the robot on the table be in x and y, m.
pub const GRANITE_POSITION_M: [f64; 2] = [-0.8, 0.8];
/// Largest speed along each axis, m/s.
pub const SPEED_M_S: f64 = 0.05;
/// Force of a primitive along its axis, N.
pub const FORCE_N: f64 = 0.1;
/// Length of every primitive, s.
pub const PRIMITIVE_S: f64 = 2.0;
/// Step of its Euler propagation, s.
pub const EULER_STEP_S: f64 = 0.05;
/// Share of samples that are the goal.
pub const GOAL_BIAS: f64 = 0.05;
/// Most samples.
pub const ITERATIONS: u64 = 10_000;
/// Weights of position (per m) and velocity (per m/s), and the tolerance of the goal in that metric: station.
pub const ISS_METRIC: [f64; 3] = [1.0, 0.01, 0.2];
/// The same on the table.
pub const GRANITE_METRIC: [f64; 3] = [30.0, 1.0, 5.0];
/// Torque limit of the local planner about each axis, N m (thesis table 6.7 has 0.05; the code 0.015).
pub const TORQUE_N_M: f64 = 0.015;

/// Largest information weights on the station: mass, Ixx, Iyy, Izz.
pub const ISS_INFORMATION: [f64; 4] = [50.0, 20.0, 20.0, 20.0];
/// The same on the table: mass, Izz, centre of mass x, y.
pub const GRANITE_INFORMATION: [f64; 4] = [30.0, 10.0, 3.0, 3.0];
/// Variances that are wanted: kg^2, then (kg m^2)^2. On the table the original holds them against the quantities of the table in
/// this order.
pub const TARGET_VARIANCE: [f64; 4] = [0.03, 1e-4, 1e-4, 1e-4];
/// Variance that stands for each quantity before the first estimate.
pub const VARIANCE_BEFORE_ESTIMATE: f64 = 1e4;
/// `alpha` and `beta` of Algorithm 1.
pub const COVARIANCE_WEIGHTING: [f64; 2] = [2.2, 5.0];
/// Share of the plan's time until which a factor holds, and the factor.
pub const STEP_WEIGHTING: [(f64, f64); 3] = [(0.25, 1.0), (0.5, 0.8), (0.75, 0.4)];
/// Rate of decay over the plan's time, and the factor below which the weight is zero.
pub const EXPONENTIAL_WEIGHTING: [f64; 2] = [8.0, 0.1];
/// Weight of the mass where only the mass counts.
pub const ONLY_MASS_INFORMATION: f64 = 75.0;

/// The rules of the original, or those with exact propagation and whole edges checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PrimitiveRules {
    /// As the code has them: Euler steps, end states checked. **Unsafe**, for comparison.
    Original,
    /// The same primitives, metrics and biases, exactly propagated and continuously checked.
    Continuous,
}

/// RATTLE's numbers for a place; `None` where it was not flown.
fn metric(place: WorldPreset) -> Option<[f64; 3]> {
    match place {
        WorldPreset::Iss => Some(ISS_METRIC),
        WorldPreset::Granite => Some(GRANITE_METRIC),
        WorldPreset::Mgtf | WorldPreset::Open => None,
    }
}

/// What RATTLE's planner keeps within at a place, for a start at this height (on the table it stays there); the turning rate,
/// which it does not use, is that of the nominal flight mode. `None` where it was not flown.
pub fn rattle_limits(place: WorldPreset, start_world: &Vector3<f64>) -> Option<MotionLimits> {
    metric(place)?;
    let flat = f64::from(u8::from(!place.is_planar()));
    let position = if place.is_planar() {
        let [least, largest] = GRANITE_POSITION_M;
        AlignedBox::between(Vector3::new(least, least, start_world.z), Vector3::new(largest, largest, start_world.z))
    } else {
        AlignedBox::between(ISS_POSITION_M[0].into(), ISS_POSITION_M[1].into())
    };
    Some(MotionLimits {
        position,
        speed_m_s: Vector3::new(SPEED_M_S, SPEED_M_S, SPEED_M_S * flat),
        force_n: Vector3::new(FORCE_N, FORCE_N, FORCE_N * flat),
        torque_n_m: Vector3::repeat(TORQUE_N_M),
        rate_rad_s: FlightMode::Nominal.limits(place.site()).rate_rad_s,
    })
}

/// The goal region around a point: RATTLE's tolerance as a radius (0.2 m, 0.167 m), at any speed within its limits.
pub fn rattle_goal(place: WorldPreset, position_world: &Vector3<f64>) -> Option<GoalRegion> {
    let [position_weight, _, tolerance] = metric(place)?;
    let axes = if place.is_planar() { 2.0 } else { 3.0 };
    Some(GoalRegion {
        position: *position_world,
        radius_m: tolerance / position_weight,
        speed_m_s: SPEED_M_S * f64::sqrt(axes) * (1.0 + 1e-12),
        attitude: None,
    })
}

/// The thesis's planner with RATTLE's numbers; `None` where it was not flown.
pub fn rattle_rrt(
    place: WorldPreset,
    rules: PrimitiveRules,
) -> Option<Result<PrimitiveRrt<DoubleIntegrator>, PlanningError>> {
    let [position_weight, velocity_weight, goal_tolerance] = metric(place)?;
    let everywhere = AlignedBox::between(Vector3::repeat(f64::NEG_INFINITY), Vector3::repeat(f64::INFINITY));
    let flat = f64::from(u8::from(!place.is_planar()));
    let along = |value: f64| Vector3::new(value, value, value * flat);
    let (propagation, edge_check) = match rules {
        PrimitiveRules::Original => (Propagation::Euler { step_s: EULER_STEP_S }, EdgeCheck::EndState),
        PrimitiveRules::Continuous => (Propagation::Exact, EdgeCheck::Continuous),
    };
    let settings = PrimitiveRrtSettings {
        goal_bias: GOAL_BIAS,
        iterations: ITERATIONS,
        position_weight,
        velocity_weight,
        goal_tolerance,
        edge_check,
    };
    let model = DoubleIntegrator::try_new(everywhere, along(SPEED_M_S), along(FORCE_N), PRIMITIVE_S, propagation);
    Some(model.and_then(|model| PrimitiveRrt::try_new(model, settings)))
}

/// How RATTLE's local planner weighs information.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RattleWeighting {
    /// By the variances: Algorithm 1.
    Covariance,
    /// In steps over the plan's time.
    Step,
    /// Decaying over the plan's time.
    Exponential,
    /// Always the same.
    Fixed,
    /// Only the mass, always the same.
    OnlyMass,
    /// Only Izz, always the same.
    OnlyIzz,
}

/// RATTLE's information weighting for mass, Ixx, Iyy, Izz on the station, or mass, Izz and centre of mass x, y on the table;
/// `None` where it was not flown.
///
/// # Source
/// Thesis 6.2.2, Algorithm 1.
/// # Deviation
/// The original weighs the inverse of one plus each squared sensitivity at every instant, not variances, so its numbers
/// say little about plans that minimise (6.9). On the table its covariance weighting reads the variances in the order of
/// the station, whereby that of Izz is always zero and its weight off; here each quantity meets its own variance.
pub fn rattle_weighting(
    place: WorldPreset,
    weighting: RattleWeighting,
) -> Option<Result<Box<dyn InformationWeighting<4>>, PlanningError>> {
    let (base, izz) = match place {
        WorldPreset::Iss => (ISS_INFORMATION, 3),
        WorldPreset::Granite => (GRANITE_INFORMATION, 1),
        WorldPreset::Mgtf | WorldPreset::Open => return None,
    };
    let [alpha, beta] = COVARIANCE_WEIGHTING;
    let [rate, least] = EXPONENTIAL_WEIGHTING;
    Some(match weighting {
        RattleWeighting::Covariance => CovarianceWeighting::try_new(base, TARGET_VARIANCE, alpha, beta).map(boxed),
        RattleWeighting::Step => StepWeighting::try_new(base, STEP_WEIGHTING.to_vec()).map(boxed),
        RattleWeighting::Exponential => ExponentialWeighting::try_new(base, rate, least).map(boxed),
        RattleWeighting::Fixed => FixedWeighting::try_new(base).map(boxed),
        RattleWeighting::OnlyMass => FixedWeighting::only(0, ONLY_MASS_INFORMATION).map(boxed),
        RattleWeighting::OnlyIzz => FixedWeighting::only(izz, base[izz]).map(boxed),
    })
}

fn boxed<W: InformationWeighting<4> + 'static>(weighting: W) -> Box<dyn InformationWeighting<4>> {
    Box::new(weighting)
}

/// The robot as RATTLE's planner sees it: a sphere.
///
/// # Errors
/// None: the radius is positive.
pub fn rattle_shape() -> Result<BodyShape, PlanningError> {
    BodyShape::sphere(ROBOT_RADIUS_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_planning::ModelBelief;
    use tumble_planning::collision::{Blocker, Clearance, CollisionWorld, Contact};
    use tumble_planning::global::{GlobalPlanner, GlobalRequest, Objective, Status, Until};
    use tumble_planning::lie::Pose;
    use tumble_planning::{BodyArc, TranslationState, Units};

    struct Empty;
    impl CollisionWorld for Empty {
        type Body = BodyShape;
        fn clearance(&self, _: &BodyShape, _: &Pose<f64>, _: f64) -> Result<Clearance, PlanningError> {
            Ok(Clearance { distance_m: f64::INFINITY, nearest: None::<Blocker> })
        }
        fn first_contact(&self, _: &BodyShape, _: &BodyArc, _: f64, _: f64) -> Result<Option<Contact>, PlanningError> {
            Ok(None)
        }
        fn reach_m(&self, body: &BodyShape) -> f64 {
            body.bounding_radius_m()
        }
    }

    /// Set 3 of both places: both sets of rules get from A to B, with seven primitives in space and five on the table.
    #[test]
    fn the_presets_plan_where_nothing_stands() {
        for (place, primitives) in [(WorldPreset::Iss, 7), (WorldPreset::Granite, 5)] {
            let (a, b) = (place.pose("A").unwrap(), place.pose("B").unwrap());
            let belief = ModelBelief::certain(1, place.body());
            let shape = rattle_shape().unwrap();
            let goal = rattle_goal(place, &b.translation.vector).unwrap();
            for rules in [PrimitiveRules::Original, PrimitiveRules::Continuous] {
                let request = GlobalRequest {
                    world: &Empty,
                    body: &shape,
                    start: TranslationState::at_rest(a.translation.vector),
                    attitude: a.rotation,
                    start_s: 0.0,
                    goal,
                    limits: rattle_limits(place, &a.translation.vector).unwrap(),
                    belief: &belief,
                    objective: Objective::Duration,
                    margin_m: 0.0,
                    until: Until::FirstPlan,
                    seed: 1,
                };
                let mut planner = rattle_rrt(place, rules).unwrap().unwrap();
                let answer = planner.plan(&request, &mut Units::new(1_000_000)).unwrap();
                assert_eq!(answer.status, Status::Feasible, "{place:?} {rules:?}");
                assert_eq!(answer.units % primitives, 0, "{place:?} {rules:?}");
                let path = answer.plan.unwrap().trajectory;
                let end = path.arcs().last().unwrap().translation(PRIMITIVE_S).0;
                assert!((end.position - goal.position).norm() <= goal.radius_m + 1e-12);
                assert!(path.arcs().iter().all(|arc| arc.duration_s == PRIMITIVE_S));
            }
        }
        assert!(rattle_limits(WorldPreset::Open, &Vector3::zeros()).is_none());
    }
    /// At the start nothing is known and every weighting that weighs all weighs nearly fully; at the end, with all targets
    /// reached, those that can end have ended.
    #[test]
    fn rattle_weights_begin_full_and_end() {
        use tumble_planning::local::WeightingContext;
        use tumble_planning::nalgebra::{Matrix4, Vector4};
        let unknown = Matrix4::identity() * VARIANCE_BEFORE_ESTIMATE;
        let known = Matrix4::from_diagonal(&Vector4::from(TARGET_VARIANCE.map(|target| 2.0 * target)));
        let modes = [
            (RattleWeighting::Covariance, true),
            (RattleWeighting::Step, true),
            (RattleWeighting::Exponential, true),
            (RattleWeighting::Fixed, false),
            (RattleWeighting::OnlyMass, false),
            (RattleWeighting::OnlyIzz, false),
        ];
        for (place, base, izz) in
            [(WorldPreset::Iss, ISS_INFORMATION, 3), (WorldPreset::Granite, GRANITE_INFORMATION, 1)]
        {
            for (mode, ends) in modes {
                let mut weighting = rattle_weighting(place, mode).unwrap().unwrap();
                let mut at = |covariance, elapsed_s| {
                    let context = WeightingContext::try_new(covariance, unknown, elapsed_s, 100.0).unwrap();
                    weighting.weights(&context).unwrap()
                };
                let expected = match mode {
                    RattleWeighting::OnlyMass => [75.0, 0.0, 0.0, 0.0],
                    RattleWeighting::OnlyIzz => core::array::from_fn(|i| if i == izz { base[i] } else { 0.0 }),
                    _ => base,
                };
                let (start, end) = (at(unknown, 0.0), at(known, 80.0));
                assert!(start.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3 * base[0]), "{place:?} {mode:?}");
                assert_eq!(end.iter().all(|weight| *weight == 0.0), ends, "{place:?} {mode:?}");
            }
        }
        assert!(rattle_weighting(WorldPreset::Open, RattleWeighting::Fixed).is_none());
    }
}
