//! Laws of the models that local planners plan for: their derivatives are those of their steps.

use super::{LawViolation, broken_unless, require};
use crate::belief::ModelBelief;
use crate::local::{Array2, InformativeModel, KINEMATICS, Kinematics, StepDerivatives};
use core::fmt::Debug;
use nalgebra::SVector;
use tumble_lie::Manifold;

/// Where a model is looked at.
#[derive(Clone, Debug)]
pub struct ModelSample<S, const X: usize, const U: usize, const P: usize> {
    /// A state.
    pub state: S,
    /// Its sensitivities, of the size they have on the way: nonzero.
    pub sensitivity: Array2<P, X>,
    /// The input held over the step.
    pub input: [f64; U],
}

/// The end of a step from a state with an input, over so many seconds, of the body at these coordinates of the parameters:
/// another way to make the step than the model's own.
pub type StepAt<'a, S, const U: usize, const P: usize> = &'a dyn Fn(&S, &[f64; U], f64, &[f64; P]) -> Option<S>;

/// Half width of the difference quotients, in units of each coordinate.
const WIDTH: f64 = 1e-3;

/// Derivative at zero by central differences of fourth order.
fn quotient<const N: usize>(width: f64, at: &dyn Fn(f64) -> Option<[f64; N]>) -> Option<[f64; N]> {
    let (far, near) = ((at(2.0 * width)?, at(-2.0 * width)?), (at(width)?, at(-width)?));
    Some(core::array::from_fn(|i| (8.0 * (near.0[i] - near.1[i]) - (far.0[i] - far.1[i])) / (12.0 * width)))
}

fn largest<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> f64 {
    numbers.into_iter().fold(0.0, |most: f64, number| most.max(number.abs()))
}

/// Largest difference; infinite where something is no number.
fn error<const N: usize>(found: &[f64; N], expected: &[f64; N]) -> f64 {
    found.iter().zip(expected).fold(0.0, |most: f64, (a, b)| {
        let difference = (a - b).abs();
        if difference.is_nan() { f64::INFINITY } else { most.max(difference) }
    })
}

fn column<const R: usize, const C: usize>(matrix: &Array2<R, C>, j: usize) -> [f64; R] {
    core::array::from_fn(|i| matrix[i][j])
}

fn axis<const N: usize>(j: usize, amount: f64) -> [f64; N] {
    core::array::from_fn(|i| if i == j { amount } else { 0.0 })
}

fn moved<const N: usize>(x: &[f64; N], j: usize, amount: f64) -> [f64; N] {
    core::array::from_fn(|i| x[i] + if i == j { amount } else { 0.0 })
}

fn nowhere<const X: usize, const U: usize, const P: usize>() -> StepDerivatives<X, U, P> {
    StepDerivatives {
        by_state: [[f64::NAN; X]; X],
        by_input: [[f64::NAN; U]; X],
        sensitivity_by_state: [[[f64::NAN; X]; X]; P],
        sensitivity_by_input: [[[f64::NAN; U]; X]; P],
    }
}

/// A value, or the law that there is one.
fn given<T>(value: Option<T>, inputs: &dyn Debug) -> Result<T, LawViolation> {
    let law = "there is a step";
    require(law, inputs, &"an end", &value.is_some(), broken_unless(value.is_some()), 0.0)?;
    value.ok_or_else(|| LawViolation {
        law,
        inputs: format!("{inputs:?}"),
        expected: String::new(),
        found: String::new(),
        error: f64::INFINITY,
        tolerance: 0.0,
    })
}

/// The laws of informative models.
///
/// Of the belief: "a belief is adopted", "the prior information is positive definite", "quantities are not lost".
/// Of changes: "retract and difference are inverse".
/// Of the step: "there is a step", "steps are those of the body" (`body_at` at zero), "step and differentiate agree", "every
/// derivative is written", "change by the state", "change by the input", "change by the parameters", "sensitivities are carried
/// by the state's change", "change of the sensitivities by the state", "change of the sensitivities by the input", "inert
/// coordinates do not matter", "inert coordinates move no others" (those before `FIRST_ACTIVE`).
/// Of the rest: "no error at the reference", "change of the residual" (each sample against the one before it), "change of the
/// kinematics", "acceleration by the input" (at the samples at rest, of which there must be one: "a sample is at rest").
///
/// Inputs change by a hundredth of the largest given, or one where all are zero. `tolerance` is relative to the largest entry
/// of what is compared: `1e-8` fits exact derivatives.
///
/// # Errors
/// The first broken law.
pub fn check_informative_model<M, const X: usize, const U: usize, const P: usize>(
    model: &mut M,
    belief: &ModelBelief,
    body_at: StepAt<'_, M::State, U, P>,
    samples: &[ModelSample<M::State, X, U, P>],
    step_s: f64,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    M: InformativeModel<X, U, P>,
{
    check_knowledge(model, belief, tolerance)?;
    let input_size: [f64; U] = core::array::from_fn(|j| {
        let size = largest(samples.iter().map(|sample| &sample.input[j]));
        if size > 0.0 { size } else { 1.0 }
    });
    let mut at_rest = 0;
    for (index, sample) in samples.iter().enumerate() {
        let judge = Judge { model: &*model, sample, step_s, tolerance, input_size };
        judge.changes()?;
        judge.steps(body_at)?;
        judge.inert()?;
        let reference = &samples[index.saturating_sub(1)].state;
        judge.residual(reference)?;
        judge.kinematics()?;
        let Kinematics { velocity_world, rate_body, .. } = model.kinematics(&sample.state);
        if velocity_world.amax() == 0.0 && rate_body.amax() == 0.0 {
            at_rest += 1;
            judge.acceleration()?;
        }
    }
    require("a sample is at rest", &samples.len(), &"one or more", &at_rest, broken_unless(at_rest > 0), 0.0)
}

fn check_knowledge<M, const X: usize, const U: usize, const P: usize>(
    model: &mut M,
    belief: &ModelBelief,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    M: InformativeModel<X, U, P>,
{
    let adopted = model.adopt(belief);
    let law = "a belief is adopted";
    require(law, &belief.revision, &"knowledge", &adopted, broken_unless(adopted.is_ok()), 0.0)?;
    let Ok(knowledge) = adopted else { return Ok(()) };
    let (information, quantities) = (&knowledge.information, &knowledge.quantities);
    let asymmetry = (information - information.transpose()).amax() / information.amax();
    let positive = information.cholesky().is_some() && asymmetry <= tolerance;
    let law = "the prior information is positive definite";
    require(law, &belief.revision, &"positive definite", information, broken_unless(positive), 0.0)?;
    // Q' Q of the quantities in units of their sizes
    let mut scaled = *quantities;
    for mut row in scaled.row_iter_mut() {
        let size = row.amax();
        row /= size;
    }
    let kept = (scaled.transpose() * scaled).cholesky().is_some();
    require("quantities are not lost", &belief.revision, &"of full rank", quantities, broken_unless(kept), 0.0)
}

struct Judge<'a, M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize> {
    model: &'a M,
    sample: &'a ModelSample<M::State, X, U, P>,
    step_s: f64,
    tolerance: f64,
    input_size: [f64; U],
}

impl<M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize> Judge<'_, M, X, U, P> {
    /// Columns of a matrix against those of another way, relative to the largest entry of both and to `size`.
    fn compare<const R: usize>(
        &self,
        law: &'static str,
        size: f64,
        columns: &[([f64; R], Option<[f64; R]>)],
    ) -> Result<(), LawViolation> {
        for (j, (found, expected)) in columns.iter().enumerate() {
            let expected = given(*expected, &(self.sample, j))?;
            let scale = columns.iter().flat_map(|(a, b)| a.iter().chain(b.iter().flatten()));
            let scale = largest(scale).max(size);
            let error = error(found, &expected);
            let error = if error > 0.0 { error / scale } else { error };
            require(law, &(self.sample, j), &expected, found, error, self.tolerance)?;
        }
        Ok(())
    }

    fn end(&self, state: &M::State, phi: &Array2<P, X>, input: &[f64; U]) -> Option<(M::State, Array2<P, X>)> {
        self.model.step(state, phi, input, self.step_s)
    }

    fn changes(&self) -> Result<(), LawViolation> {
        let state = &self.sample.state;
        for j in 0..X {
            let change: [f64; X] = core::array::from_fn(|i| if i == j { 0.3 } else { 0.01 });
            let found = self.model.difference(&self.model.retract(state, &change), state);
            let law = "retract and difference are inverse";
            require(law, &(state, change), &change, &found, error(&found, &change), self.tolerance)?;
        }
        Ok(())
    }

    fn steps(&self, body_at: StepAt<'_, M::State, U, P>) -> Result<(), LawViolation> {
        let ModelSample { state, sensitivity, input, .. } = self.sample;
        let (end, after) = given(self.end(state, sensitivity, input), self.sample)?;
        let from_end = |other: M::State| self.model.difference(&other, &end);
        let another = given(body_at(state, input, self.step_s, &[0.0; P]), self.sample)?;
        let away = from_end(another.clone());
        let law = "steps are those of the body";
        require(law, self.sample, &another, &end, error(&away, &[0.0; X]), self.tolerance)?;

        let mut derivatives = nowhere();
        let differentiated = self.model.differentiate(state, sensitivity, input, self.step_s, &mut derivatives);
        let (same_end, same_after) = given(differentiated, self.sample)?;
        let law = "step and differentiate agree";
        let away = from_end(same_end.clone());
        require(law, self.sample, &end, &same_end, error(&away, &[0.0; X]), self.tolerance)?;
        let size = largest(after.iter().flatten());
        for (one, other) in same_after.iter().zip(&after) {
            let error = error(one, other);
            let error = if error > 0.0 { error / size } else { error };
            require(law, self.sample, other, one, error, self.tolerance)?;
        }
        let StepDerivatives { by_state, by_input, sensitivity_by_state, sensitivity_by_input } = &derivatives;
        let by_state_numbers = sensitivity_by_state.iter().flatten().flatten();
        let mut numbers = by_state.iter().flatten().chain(by_input.iter().flatten()).chain(by_state_numbers);
        let written = numbers.all(|x| x.is_finite())
            && sensitivity_by_input.iter().flatten().flatten().all(|number| number.is_finite());
        let law = "every derivative is written";
        require(law, self.sample, &"numbers", &derivatives, broken_unless(written), 0.0)?;

        let none = [[0.0; X]; P];
        let columns: Vec<_> = (0..X)
            .map(|j| {
                let at = |t: f64| {
                    let start = self.model.retract(state, &axis(j, t));
                    Some(from_end(self.end(&start, &none, input)?.0))
                };
                (column(by_state, j), quotient(WIDTH, &at))
            })
            .collect();
        self.compare("change by the state", 0.0, &columns)?;
        let columns: Vec<_> = (0..U)
            .map(|j| {
                let size = self.input_size[j];
                let at = |t: f64| Some(from_end(self.end(state, &none, &moved(input, j, t * size))?.0));
                (column(by_input, j).map(|entry| entry * size), quotient(10.0 * WIDTH, &at))
            })
            .collect();
        self.compare("change by the input", 0.0, &columns)?;

        let (_, from_none) = given(self.end(state, &none, input), self.sample)?;
        let columns: Vec<_> = (0..P)
            .map(|c| {
                let at = |t: f64| Some(from_end(body_at(state, input, self.step_s, &axis(c, t))?));
                (from_none[c], quotient(10.0 * WIDTH, &at))
            })
            .collect();
        self.compare("change by the parameters", 0.0, &columns)?;
        let columns: Vec<_> = (0..P)
            .map(|c| {
                let carried = |i: usize| by_state[i].iter().zip(&sensitivity[c]).map(|(a, phi)| a * phi).sum::<f64>();
                (after[c], Some(core::array::from_fn(|i| from_none[c][i] + carried(i))))
            })
            .collect();
        self.compare("sensitivities are carried by the state's change", 0.0, &columns)?;

        for c in 0..P {
            let size = largest(&after[c]);
            let columns: Vec<_> = (M::FIRST_ACTIVE..X)
                .map(|j| {
                    let at = |t: f64| Some(self.end(&self.model.retract(state, &axis(j, t)), sensitivity, input)?.1[c]);
                    (column(&sensitivity_by_state[c], j), quotient(WIDTH, &at))
                })
                .collect();
            self.compare("change of the sensitivities by the state", size, &columns)?;
            let columns: Vec<_> = (0..U)
                .map(|j| {
                    let unit = self.input_size[j];
                    let at = |t: f64| Some(self.end(state, sensitivity, &moved(input, j, t * unit))?.1[c]);
                    let found = column(&sensitivity_by_input[c], j).map(|entry| entry * unit);
                    (found, quotient(10.0 * WIDTH, &at))
                })
                .collect();
            self.compare("change of the sensitivities by the input", size, &columns)?;
        }
        Ok(())
    }

    /// Coordinates before `FIRST_ACTIVE`.
    fn inert(&self) -> Result<(), LawViolation> {
        let ModelSample { state, sensitivity, input, .. } = self.sample;
        let derivatives_at = |state: &M::State| {
            let mut derivatives = nowhere();
            let after = self.model.differentiate(state, sensitivity, input, self.step_s, &mut derivatives);
            Some((after?.1, derivatives))
        };
        let (after, here) = given(derivatives_at(state), self.sample)?;
        for i in M::FIRST_ACTIVE..X {
            for j in 0..M::FIRST_ACTIVE.min(X) {
                let law = "inert coordinates move no others";
                let entry = here.by_state[i][j];
                require(law, &(self.sample, i, j), &0.0, &entry, entry.abs(), self.tolerance)?;
            }
        }
        for j in 0..M::FIRST_ACTIVE.min(X) {
            let elsewhere = self.model.retract(state, &axis(j, 0.5));
            let (other_after, there) = given(derivatives_at(&elsewhere), &(&elsewhere, input))?;
            let law = "inert coordinates do not matter";
            for i in 0..X {
                self.compare(law, 0.0, &[(there.by_state[i], Some(here.by_state[i]))])?;
                self.compare(law, largest(&here.by_state[i]), &[(there.by_input[i], Some(here.by_input[i]))])?;
            }
            for c in 0..P {
                let size = largest(&after[c]);
                self.compare(law, size, &[(other_after[c], Some(after[c]))])?;
                for i in 0..X {
                    let (found, expected) = (there.sensitivity_by_state[c][i], here.sensitivity_by_state[c][i]);
                    let active = |row: [f64; X]| {
                        core::array::from_fn::<f64, X, _>(|j| if j < M::FIRST_ACTIVE { 0.0 } else { row[j] })
                    };
                    self.compare(law, size, &[(active(found), Some(active(expected)))])?;
                    let (found, expected) = (there.sensitivity_by_input[c][i], here.sensitivity_by_input[c][i]);
                    self.compare(law, size, &[(found, Some(expected))])?;
                }
            }
        }
        Ok(())
    }

    fn residual(&self, reference: &M::State) -> Result<(), LawViolation> {
        let state = &self.sample.state;
        let (itself, _) = self.model.residual(state, state);
        let law = "no error at the reference";
        require(law, state, &[0.0; X], &itself, error(&itself, &[0.0; X]), self.tolerance)?;
        for reference in [reference, state] {
            let (_, by_state) = self.model.residual(state, reference);
            let columns: Vec<_> = (0..X)
                .map(|j| {
                    let at = |t: f64| Some(self.model.residual(&self.model.retract(state, &axis(j, t)), reference).0);
                    (column(&by_state, j), quotient(WIDTH, &at))
                })
                .collect();
            self.compare("change of the residual", 0.0, &columns)?;
        }
        Ok(())
    }

    fn kinematics(&self) -> Result<(), LawViolation> {
        let state = &self.sample.state;
        let (here, by_state) = (self.model.kinematics(state), self.model.kinematics_by_state(state));
        let columns: Vec<_> = (0..X)
            .map(|j| {
                let at = |t: f64| {
                    let there = self.model.kinematics(&self.model.retract(state, &axis(j, t)));
                    Some::<[f64; KINEMATICS]>(there.ominus(&here).into())
                };
                (column(&by_state, j), quotient(WIDTH, &at))
            })
            .collect();
        self.compare("change of the kinematics", 0.0, &columns)
    }

    /// Velocity gained from rest over shorter and shorter steps.
    fn acceleration(&self) -> Result<(), LawViolation> {
        let state = &self.sample.state;
        let found = self.model.acceleration_by_input();
        let here = self.model.kinematics(state);
        let mean = |j: usize, step_s: f64| {
            let input = axis(j, self.input_size[j]);
            let (end, _) = self.model.step(state, &[[0.0; X]; P], &input, step_s)?;
            let idle = self.model.step(state, &[[0.0; X]; P], &[0.0; U], step_s)?.0;
            let gained = self.model.kinematics(&end).ominus(&self.model.kinematics(&idle));
            let velocity = here.world_from_body.rotation.inverse_transform_vector(&gained.fixed_rows::<3>(3).into());
            let rate = gained.fixed_rows::<3>(9).into_owned();
            Some(SVector::<f64, 6>::from([velocity.x, velocity.y, velocity.z, rate.x, rate.y, rate.z]) / step_s)
        };
        let columns: Vec<_> = (0..U)
            .map(|j| {
                let limit = || {
                    let (long, short) = (mean(j, 1e-3)?, mean(j, 0.5e-3)?);
                    Some(<[f64; 6]>::from(mean(j, 0.25e-3)? * (8.0 / 3.0) - short * 2.0 + long / 3.0))
                };
                (column(&found, j).map(|entry| entry * self.input_size[j]), limit())
            })
            .collect();
        self.compare("acceleration by the input", 0.0, &columns)
    }
}
