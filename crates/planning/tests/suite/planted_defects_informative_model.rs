//! Every law of informative models catches a deliberately broken model, by name.

use crate::ten_parameters::{belief_about_com, wave};
use tumble_planning::laws::{LawViolation, ModelSample, check_informative_model};
use tumble_planning::local::{
    Array2, InformativeModel, KINEMATICS, Kinematics, Knowledge, PlanarBodyModel, PlanarState, StepDerivatives,
};
use tumble_planning::nalgebra::Vector2;
use tumble_planning::{ModelBelief, PlanningError};

const QUANTITIES: [f64; 10] = [9.5, 0.02, -0.03, 0.04, 0.15, 0.01, -0.02, 0.14, 0.005, 0.16];
const SIGMA: [f64; 10] = [1.0, 0.01, 0.012, 0.008, 0.02, 0.005, 0.006, 0.018, 0.004, 0.021];
/// Places of mass, inertia and centre of mass among the ten.
const PLACES: [usize; 4] = [0, 9, 1, 2];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Sound,
    Refuses,
    ForgetsPrior,
    SameQuantityTwice,
    NoStep,
    Retracts,
    StepsElsewhere,
    DifferentiatesElsewhere,
    DifferentiatesOtherSensitivities,
    LeavesInertColumns,
    ByState,
    ByInput,
    OtherUnits,
    CarriesTooMuch,
    SensitivityByState,
    SensitivityByInput,
    ErrorAtReference,
    LinearResidual,
    MirroredAttitude,
    TooStrong,
}

/// The planar body with a fault, which claims that its first `INERT` coordinates do not matter; where these are two, velocity
/// comes before position.
#[derive(Clone, Debug)]
struct Faulty<const INERT: usize> {
    sound: PlanarBodyModel<4>,
    fault: Fault,
}

impl<const INERT: usize> Faulty<INERT> {
    fn new(fault: Fault) -> Self {
        Self { sound: PlanarBodyModel::full(), fault }
    }

    fn has(&self, fault: Fault) -> bool {
        self.fault == fault
    }

    /// Position and velocity change places.
    fn order(i: usize) -> usize {
        if INERT == 2 { [2, 3, 0, 1, 4, 5][i] } else { i }
    }

    fn reordered<const N: usize>(rows: &Array2<N, 6>) -> Array2<N, 6> {
        rows.map(|row| core::array::from_fn(|i| row[Self::order(i)]))
    }

    /// What both kinds of step do to what they are given, and to what they give.
    fn given(&self, sensitivity: &Array2<4, 6>) -> Array2<4, 6> {
        let factor = if self.has(Fault::CarriesTooMuch) { 1.01 } else { 1.0 };
        Self::reordered(sensitivity).map(|row| row.map(|phi| factor * phi))
    }

    fn result(&self, (mut end, after): (PlanarState, Array2<4, 6>)) -> Option<(PlanarState, Array2<4, 6>)> {
        if self.has(Fault::StepsElsewhere) {
            end.position_world.x += 1e-4;
        }
        (!self.has(Fault::NoStep)).then(|| (end, Self::reordered(&after)))
    }
}

impl<const INERT: usize> InformativeModel<6, 3, 4> for Faulty<INERT> {
    type State = PlanarState;
    const FIRST_ACTIVE: usize = INERT;

    fn retract(&self, state: &PlanarState, change: &[f64; 6]) -> PlanarState {
        let [change] = Self::reordered(&[*change]);
        let factor = if self.has(Fault::Retracts) { 1.001 } else { 1.0 };
        self.sound.retract(state, &change.map(|change| factor * change))
    }

    fn difference(&self, to: &PlanarState, from: &PlanarState) -> [f64; 6] {
        let [difference] = Self::reordered(&[self.sound.difference(to, from)]);
        difference
    }

    fn adopt(&mut self, belief: &ModelBelief) -> Result<Knowledge<4>, PlanningError> {
        let mut belief = belief.clone();
        if self.has(Fault::OtherUnits) {
            belief.estimate.covariance *= 1.01;
        }
        let mut knowledge = self.sound.adopt(&belief)?;
        match self.fault {
            Fault::Refuses => return Err(PlanningError::NoBody),
            Fault::ForgetsPrior => knowledge.information[(2, 2)] = 0.0,
            Fault::SameQuantityTwice => {
                let first = knowledge.quantities.row(0).into_owned();
                knowledge.quantities.set_row(1, &first);
            }
            _ => {}
        }
        Ok(knowledge)
    }

    fn residual(&self, state: &PlanarState, reference: &PlanarState) -> ([f64; 6], Array2<6, 6>) {
        let (residual, by_state) = self.sound.residual(state, reference);
        let [mut residual] = Self::reordered(&[residual]);
        match self.fault {
            Fault::ErrorAtReference => residual[5] += 1e-6,
            Fault::LinearResidual => residual[4] = 2.0 * (0.5 * residual[4]).sin(),
            _ => {}
        }
        (residual, by_state)
    }

    fn kinematics(&self, state: &PlanarState) -> Kinematics {
        self.sound.kinematics(state)
    }

    fn kinematics_by_state(&self, state: &PlanarState) -> Array2<KINEMATICS, 6> {
        let mut by_state = Self::reordered(&self.sound.kinematics_by_state(state));
        if self.has(Fault::MirroredAttitude) {
            by_state[8][4] = -1.0;
        }
        by_state
    }

    fn acceleration_by_input(&self) -> Array2<6, 3> {
        let factor = if self.has(Fault::TooStrong) { 1.001 } else { 1.0 };
        self.sound.acceleration_by_input().map(|row| row.map(|entry| factor * entry))
    }

    fn step(
        &self,
        state: &PlanarState,
        sensitivity: &Array2<4, 6>,
        input: &[f64; 3],
        step_s: f64,
    ) -> Option<(PlanarState, Array2<4, 6>)> {
        self.result(self.sound.step(state, &self.given(sensitivity), input, step_s)?)
    }

    fn differentiate(
        &self,
        state: &PlanarState,
        sensitivity: &Array2<4, 6>,
        input: &[f64; 3],
        step_s: f64,
        derivatives: &mut StepDerivatives<6, 3, 4>,
    ) -> Option<(PlanarState, Array2<4, 6>)> {
        let result = self.sound.differentiate(state, &self.given(sensitivity), input, step_s, derivatives)?;
        let (mut end, mut after) = self.result(result)?;
        let square = |matrix: &Array2<6, 6>| Self::reordered(&core::array::from_fn(|i| matrix[Self::order(i)]));
        let wide = |matrix: &Array2<6, 3>| core::array::from_fn(|i| matrix[Self::order(i)]);
        let StepDerivatives { by_state, by_input, sensitivity_by_state, sensitivity_by_input } = derivatives;
        (*by_state, *by_input) = (square(by_state), wide(by_input));
        for (matrix, by_input) in sensitivity_by_state.iter_mut().zip(sensitivity_by_input.iter_mut()) {
            (*matrix, *by_input) = (square(matrix), wide(by_input));
        }
        match self.fault {
            Fault::DifferentiatesElsewhere => end.rate_rad_s += 1e-6,
            Fault::DifferentiatesOtherSensitivities => after[1][4] *= 1.001,
            Fault::LeavesInertColumns => sensitivity_by_state[2][3][0] = f64::NAN,
            Fault::ByState => by_state[3][4] *= 1.001,
            Fault::ByInput => by_input[4][0] *= 1.001,
            Fault::SensitivityByState => sensitivity_by_state[3][2][4] *= 1.001,
            Fault::SensitivityByInput => sensitivity_by_input[1][4][0] *= 1.001,
            _ => {}
        }
        Some((end, after))
    }
}

fn samples() -> Vec<ModelSample<PlanarState, 6, 3, 4>> {
    let moving = PlanarState {
        position_world: Vector2::new(0.3, -0.2),
        velocity_world: Vector2::new(0.05, 0.1),
        heading_rad: 2.5,
        rate_rad_s: 0.4,
    };
    let resting = PlanarState::at_rest(Vector2::new(0.1, 0.2), 0.3);
    let sample = |(i, (state, input)): (usize, (PlanarState, [f64; 3]))| ModelSample {
        state,
        sensitivity: core::array::from_fn(|c| core::array::from_fn(|j| 0.05 * wave(30 * i + 6 * c + j))),
        input,
    };
    [(moving, [0.03, -0.2, 0.15]), (resting, [0.01, 0.1, 0.2])].into_iter().enumerate().map(sample).collect()
}

/// The body of a belief whose quantities are off by so many prior standard deviations.
fn body_at(state: &PlanarState, input: &[f64; 3], step_s: f64, eta: &[f64; 4]) -> Option<PlanarState> {
    let mut quantities = QUANTITIES;
    for (place, eta) in PLACES.into_iter().zip(eta) {
        quantities[place] += eta * SIGMA[place];
    }
    let mut model = PlanarBodyModel::full();
    model.adopt(&belief_about_com(&quantities, &SIGMA)).ok()?;
    Some(model.step(state, &[[0.0; 6]; 4], input, step_s)?.0)
}

fn check<const INERT: usize>(fault: Fault, samples: &[ModelSample<PlanarState, 6, 3, 4>]) -> Result<(), LawViolation> {
    let belief = belief_about_com(&QUANTITIES, &SIGMA);
    check_informative_model(&mut Faulty::<INERT>::new(fault), &belief, &body_at, samples, 0.5, 1e-8)
}

#[test]
fn the_sound_model_keeps_every_law() {
    check::<4>(Fault::Sound, &samples()).unwrap();
    // nobody has to know which coordinates are inert
    check::<0>(Fault::Sound, &samples()).unwrap();
}

#[test]
fn every_defect_is_caught_by_its_law() {
    for (fault, law) in [
        (Fault::Refuses, "a belief is adopted"),
        (Fault::ForgetsPrior, "the prior information is positive definite"),
        (Fault::SameQuantityTwice, "quantities are not lost"),
        (Fault::NoStep, "there is a step"),
        (Fault::Retracts, "retract and difference are inverse"),
        (Fault::StepsElsewhere, "steps are those of the body"),
        (Fault::DifferentiatesElsewhere, "step and differentiate agree"),
        (Fault::DifferentiatesOtherSensitivities, "step and differentiate agree"),
        (Fault::LeavesInertColumns, "every derivative is written"),
        (Fault::ByState, "change by the state"),
        (Fault::ByInput, "change by the input"),
        (Fault::OtherUnits, "change by the parameters"),
        (Fault::CarriesTooMuch, "sensitivities are carried by the state's change"),
        (Fault::SensitivityByState, "change of the sensitivities by the state"),
        (Fault::SensitivityByInput, "change of the sensitivities by the input"),
        (Fault::ErrorAtReference, "no error at the reference"),
        (Fault::LinearResidual, "change of the residual"),
        (Fault::MirroredAttitude, "change of the kinematics"),
        (Fault::TooStrong, "acceleration by the input"),
    ] {
        assert_eq!(check::<4>(fault, &samples()).expect_err("not caught").law, law, "{fault:?}");
    }
}

#[test]
fn false_claims_of_inert_coordinates_are_caught() {
    let law = |outcome: Result<(), LawViolation>| outcome.expect_err("not caught").law;
    // the heading does matter
    assert_eq!(law(check::<5>(Fault::Sound, &samples())), "inert coordinates do not matter");
    // the velocity does not, and yet it moves the position
    assert_eq!(law(check::<2>(Fault::Sound, &samples())), "inert coordinates move no others");
}

#[test]
fn a_model_is_not_judged_without_a_sample_at_rest() {
    assert_eq!(check::<4>(Fault::Sound, &samples()[..1]).expect_err("not caught").law, "a sample is at rest");
}
