//! The tube of the original research code, to be compared with: its weights, its limits, and its set, which is not invariant.

use super::additive_tube::{AdditiveTube, force_gain, force_model, mass_disturbance};
use super::believed_body::{sound_reference, translation};
use super::cascade::{Cascade, TranslationDecision, TranslationLaw, TranslationRequest};
use super::{
    AttitudeController, AttitudeGains, AttitudeLaw, Fallback, FallbackReason, GramProgram, GramSettings, GramStatus,
    GramWorkspace, SymmetricBox, TruncatedSet,
};
use crate::belief::ModelBelief;
use crate::error::{PlanningError, positive};
use nalgebra::{Matrix2, Vector2, Vector3};
use tumble_dynamics::InertialParameters;

/// Time between the nodes of a prediction, s.
const NODES_S: f64 = 1.0;
/// Time between decisions, s.
const STEP_S: f64 = 0.2;
/// Steps of a prediction.
const STEPS: usize = 5;
/// The nominal error at the start, and the forces.
const UNKNOWNS: usize = 2 + STEPS;
/// Faces of the set of errors come in pairs.
const PAIRS: usize = 4;
const ROWS: usize = PAIRS + STEPS;
/// Terms of the sum that the original's iteration cap allows.
const TERMS: usize = 2;

/// A set of weights of the original.
///
/// # Source
/// Gain modes of the public research code (2022) of the thesis's flight experiments, 6.2.3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OriginalWeights {
    /// Of position, velocity and force at each node.
    pub node: [f64; 3],
    /// Of position and velocity at the last.
    pub last: [f64; 2],
    /// Of position, velocity and force in the ancillary feedback.
    pub ancillary: [f64; 3],
}

impl OriginalWeights {
    /// Of the configuration file.
    pub const DEFAULT: Self = Self { node: [50.0, 5.0, 0.1], last: [100.0, 10.0], ancillary: [5.0, 10.0, 2.0] };
    /// As flown in the full runs.
    pub const PERMISSIVE: Self = Self { node: [100.0, 5.0, 0.1], last: [1000.0, 50.0], ancillary: [5.0, 2.0, 0.5] };
    /// With dear forces.
    pub const STRICT: Self = Self { node: [100.0, 5.0, 10.0], last: [100.0, 10.0], ancillary: [5.0, 2.0, 10.0] };
    /// In between.
    pub const CAUTIOUS: Self = Self { node: [50.0, 2.0, 0.5], last: [100.0, 10.0], ancillary: [10.0, 5.0, 4.0] };
}

/// Which set of errors the original works with.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum OriginalDisturbance {
    /// The set stored with the code: without parameter feedback it serves for the whole run.
    Stored,
    /// That of a box of disturbances, half-widths in m and m/s.
    Fixed(SymmetricBox<2>),
    /// That of the mass of the newest belief, two standard deviations up and down; until the first belief the stored one.
    OfBelief,
}

impl OriginalDisturbance {
    /// The box of the fixed test.
    pub fn fixed() -> Self {
        Self::Fixed(SymmetricBox(Vector2::new(0.02, 0.002)))
    }
}

/// What the original is set to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OriginalSettings {
    /// Its weights.
    pub weights: OriginalWeights,
    /// Its set of errors.
    pub disturbance: OriginalDisturbance,
    /// Mass of the nominal motion, which no belief ever changes, kg.
    pub mass_kg: f64,
    /// Largest force along each axis, N.
    pub force_limit_n: f64,
}

impl Default for OriginalSettings {
    fn default() -> Self {
        Self {
            weights: OriginalWeights::DEFAULT,
            disturbance: OriginalDisturbance::Stored,
            mass_kg: 9.5,
            force_limit_n: 0.15,
        }
    }
}

/// The box of disturbances of the original for a mass and its variance.
///
/// # Errors
/// A mass that is not positive, a variance that is negative.
pub fn original_disturbance(
    mass_kg: f64,
    variance_kg2: f64,
    force_limit_n: f64,
) -> Result<SymmetricBox<2>, PlanningError> {
    let reach = 2.0 * f64::sqrt(crate::error::not_negative("the variance of the mass", variance_kg2)?);
    let least = if mass_kg - reach > 0.0 { mass_kg - reach } else { 1.0 };
    let below = mass_disturbance(mass_kg, least, NODES_S, force_limit_n)?;
    let above = mass_disturbance(mass_kg, mass_kg + reach, NODES_S, force_limit_n)?;
    Ok(SymmetricBox(below.0.sup(&above.0)))
}

/// A set of errors with its feedback, and what it leaves of the force.
#[derive(Clone, Debug, PartialEq)]
pub struct OriginalErrors {
    /// Force per error of position (N/m) and velocity (N s/m).
    pub gain: Vector2<f64>,
    /// Not invariant.
    pub errors: TruncatedSet,
    /// For the nominal forces, N.
    pub force_left_n: f64,
    /// Whether the stored set had to serve.
    pub is_stored: bool,
}

impl OriginalErrors {
    /// As the original computes it for a box; halved once where it leaves no force, the stored one where that does not help.
    ///
    /// # Errors
    /// A number that is not positive.
    pub fn of_box(
        mass_kg: f64,
        ancillary: [f64; 3],
        disturbance: SymmetricBox<2>,
        force_limit_n: f64,
    ) -> Result<Self, PlanningError> {
        let gain = force_gain(mass_kg, NODES_S, ancillary)?;
        for share in [1.0, 0.5] {
            let tube =
                AdditiveTube::try_new(mass_kg, NODES_S, gain, SymmetricBox(disturbance.0 * share), force_limit_n)?;
            let errors = tube.truncated(TERMS);
            let force_left_n = tube.force_left_by_n(&errors);
            if force_left_n > 0.0 {
                return Ok(Self { gain, errors, force_left_n, is_stored: false });
            }
        }
        Self::stored()
    }

    /// The set stored with the code: two terms for a box of 7.5 mm and 10 mm/s at 9.5 kg with the weights of the configuration file.
    ///
    /// # Deviation
    /// The box is found from the stored numbers: it gives all of them, which the tests compare.
    ///
    /// # Errors
    /// None in fact.
    pub fn stored() -> Result<Self, PlanningError> {
        let stored_box = SymmetricBox(Vector2::new(0.0075, 0.01));
        let gain = force_gain(9.5, NODES_S, OriginalWeights::DEFAULT.ancillary)?;
        let tube = AdditiveTube::try_new(9.5, NODES_S, gain, stored_box, 0.15)?;
        let errors = tube.truncated(TERMS);
        Ok(Self { gain, force_left_n: tube.force_left_by_n(&errors), errors, is_stored: true })
    }
}

/// The original's law of translation: nominal forces over five seconds from a nominal start near the measured state, plus
/// the ancillary feedback; along world axes.
#[derive(Clone, Debug)]
pub struct OriginalTube {
    settings: OriginalSettings,
    errors: OriginalErrors,
    program: GramProgram,
    workspaces: [GramWorkspace; 3],
    /// Across the faces of the set of errors, and how far these are.
    faces: [(Vector2<f64>, f64); PAIRS],
}

/// What errors and forces weigh at a node: there are none of the force at the last.
fn node_weight(weights: &OriginalWeights, node: usize) -> Matrix2<f64> {
    let [position, velocity] = if node == STEPS { weights.last } else { [weights.node[0], weights.node[1]] };
    Matrix2::from_diagonal(&Vector2::new(position, velocity))
}

impl OriginalTube {
    /// With these settings.
    ///
    /// # Errors
    /// A number that is not positive.
    pub fn try_new(settings: &OriginalSettings) -> Result<Self, PlanningError> {
        let OriginalSettings { weights, disturbance, mass_kg, force_limit_n } = *settings;
        positive("the nominal mass", mass_kg)?;
        positive("the force limit", force_limit_n)?;
        for weight in weights.node.into_iter().chain(weights.last) {
            positive("a weight of a prediction", weight)?;
        }
        let errors = match disturbance {
            OriginalDisturbance::Fixed(disturbance) => {
                OriginalErrors::of_box(mass_kg, weights.ancillary, disturbance, force_limit_n)?
            }
            OriginalDisturbance::Stored | OriginalDisturbance::OfBelief => OriginalErrors::stored()?,
        };
        Self::with_errors(*settings, errors)
    }

    /// The set of errors in use.
    pub fn errors(&self) -> &OriginalErrors {
        &self.errors
    }

    fn with_errors(settings: OriginalSettings, errors: OriginalErrors) -> Result<Self, PlanningError> {
        let mut hessian = [[0.0; UNKNOWNS]; UNKNOWNS];
        for (node, response) in responses(settings.mass_kg).iter().enumerate() {
            let weight = node_weight(&settings.weights, node);
            for (row, first) in hessian.iter_mut().zip(response) {
                for (entry, second) in row.iter_mut().zip(response) {
                    *entry += first.dot(&(weight * second));
                }
            }
        }
        for (index, row) in hessian.iter_mut().enumerate().skip(2) {
            row[index] += settings.weights.node[2];
        }
        let mut rows = [[0.0; UNKNOWNS]; ROWS];
        let mut faces = [(Vector2::zeros(), 0.0); PAIRS];
        let edges = errors.errors.generators.iter();
        for (row, (face, edge)) in rows.iter_mut().zip(faces.iter_mut().zip(edges)) {
            let normal = Vector2::new(-edge.y, edge.x);
            let length = f64::sqrt(normal.norm_squared());
            let normal = if length > 0.0 { normal / length } else { Vector2::x() };
            *face = (normal, super::ConvexSet::support(&errors.errors, &normal));
            (row[0], row[1]) = (normal.x, normal.y);
        }
        for (step, row) in rows.iter_mut().skip(PAIRS).enumerate() {
            row[2 + step] = 1.0;
        }
        let program = GramProgram::try_new(hessian.as_flattened(), rows.as_flattened(), &[false; ROWS])?;
        let workspace = GramWorkspace::new(&program);
        let workspaces = [workspace.clone(), workspace.clone(), workspace];
        Ok(Self { settings, errors, program, workspaces, faces })
    }

    /// Force along one axis, by the measured error from the reference at each node if nothing were done.
    fn axis_force(&mut self, axis: usize, errors: &[Vector2<f64>; STEPS + 1]) -> Result<f64, GramStatus> {
        // the first two unknowns: from the measured state to the nominal start
        let mut linear = [0.0; UNKNOWNS];
        for (node, (response, error)) in responses(self.settings.mass_kg).iter().zip(errors).enumerate() {
            let pull = node_weight(&self.settings.weights, node) * error;
            for (entry, response) in linear.iter_mut().zip(response) {
                *entry += response.dot(&pull);
            }
        }
        let mut upper = [self.errors.force_left_n; ROWS];
        for (bound, (_, offset)) in upper.iter_mut().zip(&self.faces) {
            *bound = *offset;
        }
        let lower = upper.map(|bound| -bound);
        let workspace = self.workspaces.get_mut(axis).ok_or(GramStatus::Numerical)?;
        workspace.forget();
        let status = self.program.solve(&linear, &lower, &upper, &GramSettings::default(), workspace);
        match (status, workspace.solution()) {
            (GramStatus::Solved, [position, velocity, force, ..]) => {
                // from the nominal start to the measured state
                Ok(force - self.errors.gain.dot(&Vector2::new(*position, *velocity)))
            }
            (GramStatus::Solved, _) => Err(GramStatus::Numerical),
            (status, _) => Err(status),
        }
    }
}

/// What each unknown adds to the state at each node.
fn responses(mass_kg: f64) -> [[Vector2<f64>; UNKNOWNS]; STEPS + 1] {
    let (motion, input) = force_model(mass_kg, NODES_S);
    let mut at_node = [Vector2::zeros(); UNKNOWNS];
    (at_node[0], at_node[1]) = (Vector2::x(), Vector2::y());
    let mut step = 0;
    [(); STEPS + 1].map(|()| {
        let now = at_node;
        at_node = at_node.map(|response| motion * response);
        if let Some(response) = at_node.get_mut(2 + step) {
            *response = input;
        }
        step += 1;
        now
    })
}

impl TranslationLaw for OriginalTube {
    fn step_s(&self) -> f64 {
        STEP_S
    }

    fn adopt(&mut self, belief: &ModelBelief) -> Result<(), PlanningError> {
        if self.settings.disturbance == OriginalDisturbance::OfBelief {
            let mass_kg = belief.parameters().mass;
            let OriginalSettings { weights, force_limit_n, .. } = self.settings;
            let disturbance = original_disturbance(mass_kg, belief.estimate.covariance[(0, 0)], force_limit_n)?;
            let errors = OriginalErrors::of_box(mass_kg, weights.ancillary, disturbance, force_limit_n)?;
            *self = Self::with_errors(self.settings, errors)?;
        }
        Ok(())
    }

    fn decide(&mut self, request: &TranslationRequest<'_>) -> Result<TranslationDecision, PlanningError> {
        let mut errors = [[Vector2::zeros(); STEPS + 1]; 3];
        for node in 0..=STEPS {
            let after_s = node as f64 * NODES_S;
            let reference = translation(&sound_reference(request.plan, request.time_s + after_s)?.state);
            let position = request.state.position - reference.position + request.state.velocity * after_s;
            let velocity = request.state.velocity - reference.velocity;
            for (axis, errors) in errors.iter_mut().enumerate() {
                errors[node] = Vector2::new(position[axis], velocity[axis]);
            }
        }
        let (mut force_world, mut fallback) = (Vector3::zeros(), None);
        for (axis, errors) in errors.iter().enumerate() {
            match self.axis_force(axis, errors) {
                Ok(force) => force_world[axis] = force,
                Err(status) => {
                    let reason = match status {
                        GramStatus::Capped => FallbackReason::IterationCap,
                        GramStatus::Infeasible => FallbackReason::Infeasible,
                        GramStatus::Solved | GramStatus::Numerical => FallbackReason::Numerical,
                    };
                    force_world[axis] = self.errors.gain.dot(&errors[0]);
                    fallback = Some(Fallback::Restarted(reason));
                }
            }
        }
        Ok(TranslationDecision { force_world, fallback })
    }
}

/// The original's controller: [`OriginalTube`] around the flown attitude feedback.
pub type OriginalTubeController = Cascade<OriginalTube>;

impl OriginalTubeController {
    /// With these settings, and the flown gains and torque limit of the attitude.
    ///
    /// # Errors
    /// A body that cannot be, a number that is not positive.
    pub fn original(settings: &OriginalSettings, body: InertialParameters<f64>) -> Result<Self, PlanningError> {
        let attitude = AttitudeController {
            law: AttitudeLaw::Feedback,
            gains: AttitudeGains { stiffness_n_m: 0.1, damping_n_m_s: 0.2 },
            body,
            torque_limit_n_m: 0.015,
        };
        Self::try_new(OriginalTube::try_new(settings)?, attitude, Vector3::repeat(settings.force_limit_n))
    }
}

#[cfg(test)]
mod tests {
    use super::super::ConvexSet;
    use super::*;

    #[test]
    fn no_other_nominal_motion_costs_less() {
        let mut law = OriginalTube::try_new(&OriginalSettings::default()).unwrap();
        let start = Vector2::new(0.12, -0.03);
        // a reference at rest
        let errors: [_; STEPS + 1] =
            core::array::from_fn(|node| Vector2::new(start.x + start.y * node as f64, start.y));
        let force = law.axis_force(0, &errors).unwrap();
        let best = law.workspaces[0].solution().to_vec();
        let cost = |unknowns: &[f64]| {
            // flown anew, step by step
            let (mut error, mut sum) = (start + Vector2::new(unknowns[0], unknowns[1]), 0.0);
            for input in &unknowns[2..] {
                sum += 50.0 * error.x * error.x + 5.0 * error.y * error.y + 0.1 * input * input;
                let acceleration = input / 9.5;
                error = Vector2::new(error.x + error.y + 0.5 * acceleration, error.y + acceleration);
            }
            sum + 100.0 * error.x * error.x + 10.0 * error.y * error.y
        };
        let is_inside = |unknowns: &[f64]| {
            let off = Vector2::new(unknowns[0], unknowns[1]);
            let faces = law.errors.errors.polygon().normals();
            faces.iter().all(|normal| off.dot(normal) <= law.errors.errors.support(normal) * (1.0 + 1e-9))
                && unknowns[2..].iter().all(|force| force.abs() <= law.errors.force_left_n * (1.0 + 1e-9))
        };
        assert!(is_inside(&best));
        let (least, mut tried) = (cost(&best), 0);
        for index in 0..3_u32.pow(7) {
            let mut other = best.clone();
            let mut digits = index;
            for entry in &mut other {
                *entry += 1e-3 * (f64::from(digits % 3) - 1.0);
                digits /= 3;
            }
            if is_inside(&other) {
                tried += 1;
                assert!(cost(&other) >= least * (1.0 - 1e-12), "{other:?}");
            }
        }
        assert!(tried > 100, "{tried}");
        let feedback = law.errors.gain.dot(&-Vector2::new(best[0], best[1]));
        assert!((force - (best[2] + feedback)).abs() < 1e-15 && feedback != 0.0);
    }
}
