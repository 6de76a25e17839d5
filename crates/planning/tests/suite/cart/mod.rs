//! A cart on a rail along the x axis, pushed by a force, its mass unknown; and a patient planner for it that tries one
//! direction after the other, short enough to be right.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_planning::collision::Blocker;
use tumble_planning::lie::Pose;
use tumble_planning::local::{
    Array2, Barrier, CostParts, Guess, InformativeModel, KINEMATICS, Kinematics, Knowledge, LocalAnswer, LocalPlanner,
    LocalRequest, LocalSettings, LocalStatus, LocalTrajectory, Reference, StepDerivatives,
};
use tumble_planning::nalgebra::{SMatrix, UnitQuaternion, Vector3};
use tumble_planning::{Budget, ModelBelief, Plan, PlanningError, unit_interval};

/// Directions tried with one length of step.
const DIRECTIONS: usize = 200;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slide {
    pub x_m: f64,
    pub speed_m_s: f64,
}

impl Slide {
    pub fn at(x_m: f64) -> Self {
        Self { x_m, speed_m_s: 0.0 }
    }
}

#[derive(Clone, Debug)]
pub struct Cart {
    pub mass_kg: f64,
}

fn wrong(what: &'static str, value: f64) -> PlanningError {
    PlanningError::NotPositive { what, value }
}

impl InformativeModel<2, 1, 1> for Cart {
    type State = Slide;

    fn retract(&self, state: &Slide, change: &[f64; 2]) -> Slide {
        Slide { x_m: state.x_m + change[0], speed_m_s: state.speed_m_s + change[1] }
    }

    fn difference(&self, to: &Slide, from: &Slide) -> [f64; 2] {
        [to.x_m - from.x_m, to.speed_m_s - from.speed_m_s]
    }

    fn adopt(&mut self, belief: &ModelBelief) -> Result<Knowledge<1>, PlanningError> {
        let parameters = belief.parameters().validated()?;
        let variance = belief.estimate.covariance[(0, 0)];
        if !(variance > 0.0 && variance.is_finite()) {
            return Err(wrong("the variance of the mass", variance));
        }
        self.mass_kg = parameters.mass;
        Ok(Knowledge {
            information: SMatrix::from_element(1.0 / variance),
            quantities: SMatrix::identity(),
            names: ["mass"],
            units: ["kg"],
        })
    }

    fn residual(&self, state: &Slide, reference: &Slide) -> ([f64; 2], Array2<2, 2>) {
        (self.difference(state, reference), [[1.0, 0.0], [0.0, 1.0]])
    }

    fn kinematics(&self, state: &Slide) -> Kinematics {
        Kinematics {
            world_from_body: Pose::from_parts(Vector3::new(state.x_m, 0.0, 0.0).into(), UnitQuaternion::identity()),
            velocity_world: Vector3::new(state.speed_m_s, 0.0, 0.0),
            rate_body: Vector3::zeros(),
        }
    }

    fn kinematics_by_state(&self, _: &Slide) -> Array2<KINEMATICS, 2> {
        let mut by_state = [[0.0; 2]; KINEMATICS];
        by_state[0][0] = 1.0;
        by_state[3][1] = 1.0;
        by_state
    }

    fn acceleration_by_input(&self) -> Array2<6, 1> {
        [[1.0 / self.mass_kg], [0.0], [0.0], [0.0], [0.0], [0.0]]
    }

    fn step(
        &self,
        state: &Slide,
        sensitivity: &Array2<1, 2>,
        input: &[f64; 1],
        step_s: f64,
    ) -> Option<(Slide, Array2<1, 2>)> {
        let acceleration = input[0] / self.mass_kg;
        let by_mass = -acceleration / self.mass_kg;
        let [[x, v]] = *sensitivity;
        let next = Slide {
            x_m: state.x_m + state.speed_m_s * step_s + 0.5 * acceleration * step_s * step_s,
            speed_m_s: state.speed_m_s + acceleration * step_s,
        };
        let after = [[x + v * step_s + 0.5 * by_mass * step_s * step_s, v + by_mass * step_s]];
        (next.x_m.is_finite() && next.speed_m_s.is_finite()).then_some((next, after))
    }

    fn differentiate(
        &self,
        state: &Slide,
        sensitivity: &Array2<1, 2>,
        input: &[f64; 1],
        step_s: f64,
        derivatives: &mut StepDerivatives<2, 1, 1>,
    ) -> Option<(Slide, Array2<1, 2>)> {
        let (m, h) = (self.mass_kg, step_s);
        derivatives.by_state = [[1.0, h], [0.0, 1.0]];
        derivatives.by_input = [[0.5 * h * h / m], [h / m]];
        derivatives.sensitivity_by_state = [[[0.0; 2]; 2]];
        derivatives.sensitivity_by_input = [[[-0.5 * h * h / (m * m)], [-h / (m * m)]]];
        self.step(state, sensitivity, input, step_s)
    }
}

/// Tries steps in directions by chance, takes what is better, and halves the step where nothing is.
#[derive(Clone, Debug)]
pub struct Patient {
    pub cart: Cart,
    pub settings: LocalSettings<2, 1>,
    /// What it forgets to look at.
    pub careless: bool,
}

/// A motion with its price.
struct Tried {
    states: Vec<Slide>,
    covariances: Vec<SMatrix<f64, 1, 1>>,
    gathered: SMatrix<f64, 1, 1>,
    parts: CostParts,
    violation: f64,
}

impl Tried {
    /// First the violation, then the cost.
    fn rank(&self) -> (f64, f64) {
        (if self.violation > 0.0 { self.violation } else { 0.0 }, self.parts.total())
    }
}

impl Patient {
    pub fn try_new(settings: &LocalSettings<2, 1>) -> Result<Self, PlanningError> {
        let positive = |what: &'static str, value: f64| {
            if value > 0.0 && value.is_finite() { Ok(()) } else { Err(wrong(what, value)) }
        };
        let not_negative = |what: &'static str, value: f64| {
            if value >= 0.0 && value.is_finite() { Ok(()) } else { Err(wrong(what, value)) }
        };
        positive("steps", settings.steps as f64)?;
        for value in
            [settings.step_s, settings.effort[0], settings.wrench.limit[0], settings.tolerance, settings.length_scale_m]
        {
            positive("a length, weight, limit or tolerance", value)?;
        }
        for value in settings.tracking.iter().chain(&settings.terminal).chain(&settings.acceleration) {
            not_negative("a weight", *value)?;
        }
        not_negative("the margin", settings.margin_m)?;
        for (normal, offset) in &settings.wrench.half_spaces {
            positive("an offset", *offset)?;
            not_negative("a normal", normal[0].abs())?;
        }
        for limit in settings.speed.speed_m_s.iter().chain(&settings.speed.rate_rad_s) {
            if limit.is_nan() || *limit <= 0.0 {
                return Err(wrong("a speed limit", *limit));
            }
        }
        let w = &settings.measurement;
        let determinant = w[(0, 0)] * w[(1, 1)] - w[(0, 1)] * w[(1, 0)];
        not_negative("a measurement", w[(0, 0)].min(w[(1, 1)]))?;
        not_negative("the determinant of a measurement", determinant)?;
        not_negative("the symmetry of a measurement", -(w[(0, 1)] - w[(1, 0)]).abs())?;
        Ok(Self { cart: Cart { mass_kg: 1.0 }, settings: settings.clone(), careless: false })
    }

    fn check(&self, request: &LocalRequest<'_, Slide, 1, 1>) -> Result<(), PlanningError> {
        let finite = |what: &'static str, value: f64| {
            if value.is_finite() { Ok(()) } else { Err(PlanningError::NotFinite { what, value }) }
        };
        let state = |state: &Slide| finite("a state", state.x_m + state.speed_m_s);
        finite("the start", request.start_s)?;
        state(request.start)?;
        match request.reference {
            Reference::Hold(reference) => state(reference)?,
            Reference::Nodes(nodes) => {
                nodes.iter().try_for_each(state)?;
                if nodes.len() != self.settings.steps + 1 {
                    return Err(wrong("the nodes of the reference", nodes.len() as f64));
                }
            }
            _ => return Err(wrong("the kind of the reference", f64::NAN)),
        }
        if let Some(region) = &request.terminal {
            finite("a region", region.position_world.sum() + region.radius_m + region.speed_m_s)?;
            if region.radius_m <= 0.0 || region.speed_m_s <= 0.0 {
                return Err(wrong("a region", region.radius_m));
            }
        }
        let weight = request.information[0];
        if !(weight >= 0.0 && weight.is_finite()) {
            return Err(wrong("a weight", weight));
        }
        if let Guess::Inputs(inputs) | Guess::Near(inputs) = request.guess {
            if inputs.len() != self.settings.steps {
                return Err(wrong("the inputs of a guess", inputs.len() as f64));
            }
            inputs.iter().try_for_each(|input| finite("a guess", input[0]))?;
        }
        Ok(())
    }

    /// How deep a point of the rail is in a box, m.
    fn depth(&self, request: &LocalRequest<'_, Slide, 1, 1>, x_m: f64) -> f64 {
        let mut depth = f64::NEG_INFINITY;
        for (_, barrier) in request.surroundings.barriers() {
            if let Barrier::Box(solid) = barrier {
                let margin = self.settings.margin_m;
                depth = depth.max((solid.upper_world.x + margin - x_m).min(x_m - solid.lower_world.x + margin));
            }
        }
        depth
    }

    fn tried(
        &self,
        request: &LocalRequest<'_, Slide, 1, 1>,
        knowledge: &Knowledge<1>,
        inputs: &[[f64; 1]],
    ) -> Option<Tried> {
        const LOOKS: u32 = 32;
        let settings = &self.settings;
        let (mut state, mut sensitivity) = (*request.start, [[0.0; 2]]);
        let mut tried = Tried {
            states: vec![state],
            covariances: Vec::new(),
            gathered: SMatrix::zeros(),
            parts: CostParts { tracking: 0.0, effort: 0.0, information: 0.0 },
            violation: 0.0,
        };
        let price = |node: usize, state: &Slide| {
            let reference = match request.reference {
                Reference::Hold(state) => state,
                Reference::Nodes(states) => &states[node],
                _ => return f64::INFINITY,
            };
            let weights = if node == settings.steps { &settings.terminal } else { &settings.tracking };
            let [x, v] = self.cart.difference(state, reference);
            weights[0] * x * x + weights[1] * v * v
        };
        let covariance = |gathered: &SMatrix<f64, 1, 1>| (knowledge.information + gathered).try_inverse();
        for (node, input) in inputs.iter().enumerate() {
            tried.parts.tracking += price(node, &state);
            let acceleration = input[0] / self.cart.mass_kg;
            tried.parts.effort +=
                settings.effort[0] * input[0] * input[0] + settings.acceleration[0] * acceleration * acceleration;
            tried.covariances.push(covariance(&tried.gathered)?);
            for (normal, offset) in &settings.wrench.half_spaces {
                tried.violation = tried.violation.max(normal[0] * input[0] / offset - 1.0);
            }
            let looks = if settings.on_segments { LOOKS } else { 1 };
            for look in 1..=looks {
                let since_s = settings.step_s * f64::from(look) / f64::from(looks);
                let (between, _) = self.cart.step(&state, &sensitivity, input, since_s)?;
                tried.violation = tried.violation.max(self.depth(request, between.x_m));
            }
            let (next, after) = self.cart.step(&state, &sensitivity, input, settings.step_s)?;
            (state, sensitivity) = (next, after);
            let limit = settings.speed.speed_m_s.x;
            tried.violation = tried.violation.max(state.speed_m_s.abs() / limit - 1.0);
            let phi = SMatrix::<f64, 2, 1>::new(sensitivity[0][0], sensitivity[0][1]);
            tried.gathered += phi.transpose() * settings.measurement * phi;
            tried.states.push(state);
        }
        if let Some(region) = &request.terminal {
            let away = (Vector3::new(state.x_m, 0.0, 0.0) - region.position_world).norm();
            let fast = state.speed_m_s.abs();
            tried.violation = tried.violation.max((away / region.radius_m).max(fast / region.speed_m_s) - 1.0);
        }
        tried.parts.tracking += price(settings.steps, &state);
        let last = covariance(&tried.gathered)?;
        tried.covariances.push(last);
        tried.parts.information = request.information[0] * last[(0, 0)];
        Some(tried)
    }
}

impl LocalPlanner<1, 1> for Patient {
    type State = Slide;

    fn plan(
        &mut self,
        request: &LocalRequest<'_, Slide, 1, 1>,
        budget: &mut dyn Budget,
    ) -> Result<LocalAnswer<Slide, 1, 1>, PlanningError> {
        let knowledge = self.cart.adopt(request.belief)?;
        if !self.careless {
            self.check(request)?;
        }
        let wrench = self.settings.wrench.without(&request.reserved)?;
        let within = Self { settings: LocalSettings { wrench, ..self.settings.clone() }, ..self.clone() };
        within.plan_within(request, &knowledge, budget)
    }
}

impl Patient {
    fn plan_within(
        &self,
        request: &LocalRequest<'_, Slide, 1, 1>,
        knowledge: &Knowledge<1>,
        budget: &mut dyn Budget,
    ) -> Result<LocalAnswer<Slide, 1, 1>, PlanningError> {
        let (steps, limit) = (self.settings.steps, self.settings.wrench.limit[0]);
        let mut inputs: Vec<[f64; 1]> = match request.guess {
            Guess::Inputs(inputs) | Guess::Near(inputs) => inputs.to_vec(),
            // a guess is a hint: one that is not known is none
            _ => (0..steps).map(|k| [0.3 * limit * libm::sin(1.0 + 1.7 * k as f64)]).collect(),
        };
        for input in &mut inputs {
            input[0] = input[0].clamp(-limit, limit);
        }
        let nothing = || PlanningError::NotFinite { what: "the cost", value: f64::NAN };
        let mut best = self.tried(request, knowledge, &inputs).ok_or_else(nothing)?;
        let (mut step, mut units) = (0.5, 0);
        let mut chance = ChaCha8Rng::seed_from_u64(0);
        let mut is_over = false;
        while step > self.settings.tolerance && !is_over {
            let mut is_better = false;
            for _ in 0..DIRECTIONS {
                if !budget.spend(1) {
                    is_over = true;
                    break;
                }
                units += 1;
                let moved: Vec<[f64; 1]> = inputs
                    .iter()
                    .map(|input| {
                        let share = 2.0 * unit_interval(&mut chance) - 1.0;
                        [(input[0] + share * step * limit).clamp(-limit, limit)]
                    })
                    .collect();
                let Some(tried) = self.tried(request, knowledge, &moved) else { continue };
                if tried.rank() < best.rank() {
                    (best, inputs, is_better) = (tried, moved, true);
                }
            }
            if !is_better {
                step *= 0.5;
            }
        }
        let is_plan = best.violation <= 0.0;
        let status = match (is_plan, is_over) {
            (false, _) => LocalStatus::Infeasible { violation: best.violation, blocker: Some(Blocker::Obstacle(0)) },
            (true, true) => LocalStatus::Feasible,
            (true, false) => LocalStatus::Converged,
        };
        let trajectory = LocalTrajectory {
            start_s: request.start_s,
            step_s: self.settings.step_s,
            states: best.states,
            inputs,
            covariances: best.covariances,
            gathered: best.gathered,
        };
        let plan = Plan { trajectory, model_revision: request.belief.revision };
        Ok(LocalAnswer {
            status,
            plan: is_plan.then_some(plan),
            cost: is_plan.then_some(best.parts),
            optimality: step,
            violation: best.violation.max(0.0),
            iterations: 0,
            units,
            unobservable: Vec::new(),
        })
    }
}
