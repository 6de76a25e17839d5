//! Laws of state spaces, kinodynamic models and the motions of their edges.

use super::{LawViolation, broken_unless, require};
use crate::kinodynamic::{BodyMotion, KinodynamicModel};
use crate::state_space::StateSpace;
use core::fmt::Debug;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// How many others each state is compared with, so that the work stays linear.
const OTHERS: usize = 3;

fn other<S>(states: &[S], index: usize, step: usize) -> &S {
    &states[(index + step) % states.len()]
}

/// The laws of state spaces, on `count` states drawn with `seed`.
///
/// "samples are contained", "the same chance gives the same sample", "samples differ"; "a state is at no distance from
/// itself", "distances are not negative", "distances are symmetric", "the triangle inequality"; "interpolation has its
/// ends", "interpolation goes from one to the other" (no detour). `tolerance` is relative to the distances.
///
/// # Errors
/// The first broken law.
pub fn check_state_space<S>(space: &S, seed: u64, count: usize, tolerance: f64) -> Result<(), LawViolation>
where
    S: StateSpace + ?Sized,
{
    let draw = || -> Vec<S::State> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| space.sample(&mut rng)).collect()
    };
    let (states, again) = (draw(), draw());
    for (state, other) in states.iter().zip(&again) {
        let law = "samples are contained";
        require(law, &seed, &"a contained state", state, broken_unless(space.contains(state)), 0.0)?;
        let (one, two) = (format!("{state:?}"), format!("{other:?}"));
        require("the same chance gives the same sample", &seed, state, other, broken_unless(one == two), 0.0)?;
    }
    let first = states.first();
    let differ = first.is_none_or(|first| states.iter().any(|state| space.distance(first, state).abs() > 0.0));
    require("samples differ", &seed, &"distances", &first, broken_unless(count < 2 || differ), 0.0)?;

    for (index, a) in states.iter().enumerate() {
        let itself = space.distance(a, a);
        require("a state is at no distance from itself", a, &0.0, &itself, itself.abs(), tolerance)?;
        for step in 1..=OTHERS {
            let (b, c) = (other(&states, index, step), other(&states, index, 2 * step + 1));
            let (ab, ba, bc, ac) =
                (space.distance(a, b), space.distance(b, a), space.distance(b, c), space.distance(a, c));
            let size = tolerance * (ab.abs() + bc.abs() + ac.abs());
            require("distances are not negative", &(a, b), &"zero or more", &ab, -ab, 0.0)?;
            require("distances are symmetric", &(a, b), &ab, &ba, (ab - ba).abs(), size)?;
            require("the triangle inequality", &(a, b, c), &(ab + bc), &ac, ac - (ab + bc), size)?;
        }
    }
    for (index, a) in states.iter().enumerate() {
        for step in 1..=OTHERS {
            let b = other(&states, index, step);
            let ab = space.distance(a, b);
            let size = tolerance * ab;
            for (fraction, end) in [(0.0, a), (1.0, b)] {
                let found = space.interpolate(a, b, fraction);
                let error = space.distance(&found, end);
                require("interpolation has its ends", &(a, b, fraction), end, &found, error, size)?;
            }
            for fraction in [0.25, 0.5, 0.9] {
                let found = space.interpolate(a, b, fraction);
                let (before, after) = (space.distance(a, &found), space.distance(&found, b));
                let error = (before - fraction * ab).abs().max((after - (1.0 - fraction) * ab).abs());
                let law = "interpolation goes from one to the other";
                require(law, &(a, b, fraction), &ab, &(before, after), error, size)?;
            }
        }
    }
    Ok(())
}

/// The laws of models that propagate, on `count` states drawn with `seed` and every primitive.
///
/// "there are primitives", "primitives take time", "primitives are inside the limits" (`excess` of an input is by how much it
/// is too large); "no time changes nothing"; "propagation composes in time", over `parts` equal parts of a primitive (for
/// Euler steps: whole numbers of them). `tolerance` is a distance of the space.
///
/// # Errors
/// The first broken law.
pub fn check_kinodynamic_model<M>(
    model: &M,
    parameters: &M::Parameters,
    excess: &dyn Fn(&M::Input) -> f64,
    (seed, count): (u64, usize),
    parts: u32,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    M: KinodynamicModel + ?Sized,
{
    let primitives = model.primitives();
    require("there are primitives", &"", &"one or more", &0, broken_unless(!primitives.is_empty()), 0.0)?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for primitive in primitives {
        let takes_time = primitive.duration_s.is_finite() && primitive.duration_s > 0.0;
        require(
            "primitives take time",
            primitive,
            &"more than 0 s",
            &primitive.duration_s,
            broken_unless(takes_time),
            0.0,
        )?;
        let law = "primitives are inside the limits";
        require(law, primitive, &"no excess", &excess(&primitive.input), excess(&primitive.input), 0.0)?;
        for _ in 0..count {
            let state = model.sample(&mut rng);
            let held = |state: &M::State, time_s| model.propagate(state, &primitive.input, parameters, time_s);
            let found = held(&state, 0.0);
            require("no time changes nothing", &state, &state, &found, model.distance(&state, &found), tolerance)?;
            let whole = held(&state, primitive.duration_s);
            let part_s = primitive.duration_s / f64::from(parts);
            let pieced = (0..parts).fold(state.clone(), |state, _| held(&state, part_s));
            let error = model.distance(&whole, &pieced);
            require("propagation composes in time", &(state, primitive), &whole, &pieced, error, tolerance)?;
        }
    }
    Ok(())
}

/// The laws of models whose edges are motions, on `count` states drawn with `seed` and every primitive.
///
/// "a state is its translation" (there and back); "the motion begins at the state", "the motion goes where the model goes"
/// (at `parts` times of the primitive); "a motion inside has its states inside" at a hundred times. `tolerance` is in m and
/// m/s.
///
/// # Errors
/// The first broken law.
pub fn check_body_motion<M>(
    model: &M,
    parameters: &M::Parameters,
    (seed, count): (u64, usize),
    parts: u32,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    M: BodyMotion,
    M::Input: Debug,
{
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for primitive in model.primitives() {
        for _ in 0..count {
            let state = model.sample(&mut rng);
            let start = model.translation(&state);
            let found = model.translation(&model.state_at(&start));
            let error = (found.position - start.position).amax().max((found.velocity - start.velocity).amax());
            require("a state is its translation", &state, &start, &found, error, tolerance)?;

            let arc = model.arc(&state, &primitive.input, parameters, primitive.duration_s);
            let at = |time_s| arc.translation(time_s).0;
            let error = (at(0.0).position - start.position).amax();
            require("the motion begins at the state", &state, &start, &at(0.0), error, tolerance)?;
            for part in 1..=parts {
                let time_s = primitive.duration_s * f64::from(part) / f64::from(parts);
                let expected = model.translation(&model.propagate(&state, &primitive.input, parameters, time_s));
                let (p, v) = (at(time_s).position - expected.position, at(time_s).velocity - expected.velocity);
                let law = "the motion goes where the model goes";
                require(law, &(&state, primitive, time_s), &expected, &at(time_s), p.amax().max(v.amax()), tolerance)?;
            }
            if model.contains_arc(&arc) {
                for step in 0..=100 {
                    let inside = model.state_at(&at(primitive.duration_s * f64::from(step) / 100.0));
                    let law = "a motion inside has its states inside";
                    let error = broken_unless(model.contains(&inside));
                    require(law, &(&state, primitive, step), &"a contained state", &inside, error, 0.0)?;
                }
            }
        }
    }
    Ok(())
}
