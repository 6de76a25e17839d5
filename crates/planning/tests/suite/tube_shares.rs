//! How much of the input is left for the plan, and how large the tube is, by how well the mass is known.

use tumble_planning::PlanningError;
use tumble_planning::control::{
    AxisGain, AxisLimits, AxisRequest, AxisTemplate, AxisTube, ConvexSet, MassInterval, MinimalInvariantSet,
    SymmetricBox, Terminal, TubeDisturbance, TubeWeights, Zonotope, discrete_lqr,
};
use tumble_planning::nalgebra::{Matrix2, SMatrix, Vector2};

/// Mass before anything is learned, kg.
pub const MASS_KG: f64 = 9.58;
/// The limit of the force on each axis, N.
pub const FORCE_N: f64 = 0.15;
/// Speed limit and half of the room, m/s, m.
const SPEED_M_S: f64 = 0.05;
const HALF_ROOM_M: f64 = 0.45;
/// Jumps of position and velocity that the tube holds, m, m/s.
pub const JUMP: [f64; 2] = [1e-4, 2e-4];
/// Weights of position, velocity and input in the original's two presets.
const ORIGINAL_WEIGHTS: [[f64; 3]; 2] = [[5.0, 10.0, 2.0], [5.0, 2.0, 0.5]];
const TOLERANCE: f64 = 1e-12;

/// Gains of the second table: stiffness, damping.
pub const GAINS: [[f64; 2]; 5] =
    [[0.25, 2.0], [0.5, 2.5], [1.0, 4.0], [0.25, 1.0], [2.91367 / 9.5838, 7.52974 / 9.5838]];
/// Half-widths of the mass interval, as shares.
pub const HALF_WIDTHS: [f64; 5] = [0.1, 0.2, 0.3, 0.4, 0.5];

/// Input left for the plan, as shares of the limit, with the mass known to a share of itself and nothing else disturbing.
#[derive(Clone, Copy, Debug)]
pub struct ShareRow {
    pub half_width: f64,
    /// The original's form: its feedback at 1 s, centred in the mass, the disturbance a box around what the input can do.
    pub original: [f64; 2],
    /// Disturbance along the input, damped gain, centred in the mass.
    pub centered_in_mass: f64,
    /// The same, centred in the inverse of the mass.
    pub centered_in_inverse: f64,
    /// Acceleration left of what the limit gives the largest mass: with the least set, and with the template's faces.
    pub of_physical: f64,
    pub of_physical_by_template: f64,
}

/// What a gain makes of disturbances.
#[derive(Clone, Copy, Debug)]
pub struct GainRow {
    pub gain: [f64; 2],
    /// Per 1 m/s^2 along the input: acceleration of the feedback, position, velocity.
    pub matched: [f64; 3],
    /// Acceleration of the feedback for jumps of 1 mm, and of 1 mm/s.
    pub jumps: [f64; 2],
    /// Share of the input left where the mass is known to half of itself.
    pub share: f64,
}

/// One axis at 0.15 N.
#[derive(Clone, Copy, Debug)]
pub struct LimitRow {
    pub mass_kg: [f64; 2],
    pub center_kg: f64,
    pub uncertainty: f64,
    /// Nominal acceleration, and what the limit gives the largest mass, m/s^2.
    pub acceleration_m_s2: f64,
    pub physical_m_s2: f64,
    /// Half-width of the tube in position at scale one and at rest, m, and in velocity at scale one and at the least scale, m/s.
    pub position_tube_m: [f64; 2],
    pub velocity_tube_m_s: [f64; 2],
    pub rows: usize,
}

fn support<W: ConvexSet<2>>(closed_loop: Matrix2<f64>, set: W, row: &Vector2<f64>) -> Result<f64, PlanningError> {
    Ok(MinimalInvariantSet::try_new(closed_loop, set)?.support(row, TOLERANCE).upper)
}

fn gain_of([stiffness, damping]: [f64; 2]) -> AxisGain {
    AxisGain { stiffness, damping, step_s: 0.2 }
}

/// Acceleration of the feedback per 1 m/s^2 along the input; at least one, whatever the gain.
pub fn matched_input(gain: [f64; 2]) -> Result<f64, PlanningError> {
    let gain = gain_of(gain);
    support(gain.closed_loop(), gain.matched_disturbance(), &gain.feedback())
}

/// Share of the input that the original's form leaves, negative where it leaves none: linear-quadratic feedback for the middle
/// mass at 1 s, the least invariant set for a box that holds what the wrong mass does at the limit.
fn original(half_width: f64, [position, velocity, input]: [f64; 3]) -> Result<f64, PlanningError> {
    let (a, b) = (Matrix2::new(1.0, 1.0, 0.0, 1.0), Vector2::new(0.5, 1.0) / MASS_KG);
    let weight = Matrix2::from_diagonal(&Vector2::new(position, velocity));
    let (feedback, _) = discrete_lqr(&a, &b, &weight, &SMatrix::<f64, 1, 1>::new(input))?;
    let wrong = 1.0 / (1.0 - half_width) - 1.0;
    let taken = support(a + b * feedback, SymmetricBox(b.abs() * (wrong * FORCE_N)), &feedback.transpose())?;
    Ok(1.0 - taken / FORCE_N)
}

/// The mass known to a share of itself.
pub fn shares(half_width: f64) -> Result<ShareRow, PlanningError> {
    let gain = AxisGain::default();
    let matched = matched_input([gain.stiffness, gain.damping])?;
    let template = AxisTemplate::try_new(gain, &SymmetricBox(Vector2::zeros()))?;
    let mass = MassInterval::between(1.0 - half_width, 1.0 + half_width)?;
    let left = |matched: f64| 1.0 - mass.uncertainty() * matched;
    let physical = mass.center_kg() / mass.largest_kg();
    Ok(ShareRow {
        half_width,
        original: [original(half_width, ORIGINAL_WEIGHTS[0])?, original(half_width, ORIGINAL_WEIGHTS[1])?],
        centered_in_mass: 1.0 - (1.0 / (1.0 - half_width) - 1.0) * matched,
        centered_in_inverse: left(matched),
        of_physical: left(matched) / physical,
        of_physical_by_template: left(template.matched_input()) / physical,
    })
}

/// What a gain makes of disturbances.
pub fn gain_row(gain: [f64; 2]) -> Result<GainRow, PlanningError> {
    let axis = gain_of(gain);
    let closed_loop = axis.closed_loop();
    let of_matched = |row: &Vector2<f64>| support(closed_loop, axis.matched_disturbance(), row);
    let jump = |generator: Vector2<f64>| support(closed_loop, Zonotope(generator), &axis.feedback());
    let matched = [of_matched(&axis.feedback())?, of_matched(&Vector2::x())?, of_matched(&Vector2::y())?];
    let jumps = [jump(Vector2::new(1e-3, 0.0))?, jump(Vector2::new(0.0, 1e-3))?];
    Ok(GainRow { gain, matched, jumps, share: 1.0 - 0.5 * matched[0] })
}

/// One axis at 0.15 N with jumps of 0.1 mm and 0.2 mm/s.
pub fn limits(mass_kg: [f64; 2]) -> Result<LimitRow, PlanningError> {
    let template = AxisTemplate::try_new(AxisGain::default(), &SymmetricBox(Vector2::from(JUMP)))?;
    let mass = MassInterval::between(mass_kg[0], mass_kg[1])?;
    let tube = AxisTube::try_new(&AxisRequest {
        template: &template,
        mass,
        limits: AxisLimits { force_n: FORCE_N, speed_m_s: SPEED_M_S, walls_m: [-HALF_ROOM_M, HALF_ROOM_M] },
        shortfall: 0.0,
        disturbance: TubeDisturbance { position_m: 0.0, velocity_m_s: 0.0, force_n: 0.0, acceleration_m_s2: 0.0 },
        weights: TubeWeights::DEFAULT,
        steps: 25,
        terminal: Terminal::StopSet,
    })?;
    let problem = tube.problem();
    // the scale that holds the feedback for the jumps alone; the program keeps a little more
    let at_rest = problem.held_acceleration / problem.scaled_acceleration;
    let size = |face: usize, scale: f64| scale * problem.scaled[face] + problem.held[face];
    Ok(LimitRow {
        mass_kg,
        center_kg: mass.center_kg(),
        uncertainty: mass.uncertainty(),
        acceleration_m_s2: problem.acceleration_m_s2,
        physical_m_s2: FORCE_N / mass.largest_kg(),
        position_tube_m: [size(2, 1.0), size(2, at_rest)],
        velocity_tube_m_s: [size(3, 1.0), size(3, problem.least_scale)],
        rows: problem.equality.len(),
    })
}

/// The mass known to a share of itself, kg.
pub fn around(half_width: f64) -> [f64; 2] {
    [MASS_KG * (1.0 - half_width), MASS_KG * (1.0 + half_width)]
}

/// Shortest time of a leg, which goes with the inverse root of the acceleration, as a share of another's, less one.
pub fn leg_time_change(row: &LimitRow, before: &LimitRow) -> f64 {
    f64::sqrt(before.acceleration_m_s2 / row.acceleration_m_s2) - 1.0
}

/// How fast a plan may cruise at scale one and at the least scale, m/s.
pub fn cruise_m_s(row: &LimitRow) -> [f64; 2] {
    row.velocity_tube_m_s.map(|tube| SPEED_M_S - tube)
}
