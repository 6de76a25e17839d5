use crate::convergence::Rest;
use crate::discrete_lagrangian::{DiscreteLagrangian, GroupOf, VelocityOf};
use crate::error::DynamicsError;
use crate::state::LagrangianState;
use crate::system::{Integrator, MechanicalSystem};
use num_dual::{Dual64, HyperDual64};
use tumble_lie::{Coordinates, LieGroup, Scalar, real};

/// Iterations after which a step counts as too long.
const MAX_ITERATIONS: u32 = 50;

/// The variational integrator of any [`DiscreteLagrangian`], of order 2 for a symmetric one.
///
/// One-step form: the velocity of the state is that of the discrete Legendre momentum `mu`. A step solves
/// `-D1 L_d(g_k, g_{k+1}) = mu_k + (h/2) F_k` for `g_{k+1}` by Newton's method, then
/// `mu_{k+1} = D2 L_d(g_k, g_{k+1}) + (h/2) F_{k+1}`. First derivatives come from dual, second ones from hyper-dual
/// numbers; the derivatives are left-trivialised.
/// # Source
/// Thesis (2.44)-(2.51).
#[derive(Clone, Copy, Debug, Default)]
pub struct Variational;

impl<S> Integrator<S> for Variational
where
    S: DiscreteLagrangian,
    S: MechanicalSystem<State: LagrangianState<Group = GroupOf<S, f64>, Scalar = f64>>,
{
    fn order(&self) -> u32 {
        2
    }
    fn step(
        &self,
        system: &S,
        state: &S::State,
        input: &S::Input,
        time_s: f64,
        step_s: f64,
    ) -> Result<S::State, DynamicsError> {
        let half_step_s = 0.5 * step_s;
        let (from, velocity) = (state.configuration(), state.velocity());
        let force = system.force(time_s, &from, &velocity, input);
        let momentum = momentum_of(system, &from, &velocity) + force * half_step_s;
        let to = solve_start_equation(system, &from, &momentum, &(velocity * step_s), step_s)?;

        // What rounding left of the start equation is carried on, or momentum would walk away step by step.
        let left = start_momentum(system, &from, &to, step_s) - momentum;
        let carried = to.between(&from).coadjoint() * left;
        let unforced = VelocityOf::<S, f64>::from_fn(|i| {
            let to = perturbed::<S, _>(&to, i, Dual64::new(0.0, 1.0));
            system.discrete_lagrangian(&S::lift(&from), &to, real(step_s)).eps
        }) - carried;
        let force_at =
            |velocity: &VelocityOf<S, f64>| system.force(time_s + step_s, &to, velocity, input) * half_step_s;
        let velocity = velocity_of(system, &to, &unforced, force_at, &velocity, step_s)?;
        Ok(S::State::from_parts(to, velocity))
    }
}

fn not_converged(step_s: f64, residual: f64) -> DynamicsError {
    DynamicsError::StepNotConverged { step_s, residual, iterations: MAX_ITERATIONS }
}

/// `g exp(amount e_i)`
fn perturbed<S: DiscreteLagrangian, T: Scalar>(g: &GroupOf<S, f64>, i: usize, amount: T) -> GroupOf<S, T> {
    S::lift::<T>(g).compose(&<GroupOf<S, T> as LieGroup>::exp(&basis::<T, VelocityOf<S, T>>(i, amount)))
}

fn basis<T: Scalar, V: Coordinates<T>>(i: usize, amount: T) -> V {
    V::from_fn(|k| if k == i { amount } else { T::zero() })
}

/// The velocity `v + amount e_i` over the scalar `T`.
fn perturbed_velocity<S: DiscreteLagrangian, T: Scalar>(
    v: &VelocityOf<S, f64>,
    i: usize,
    amount: T,
) -> VelocityOf<S, T> {
    VelocityOf::<S, T>::from_fn(|k| real::<T>(v[k]) + if k == i { amount } else { T::zero() })
}

/// `dL/dv`
fn momentum_of<S: DiscreteLagrangian>(
    system: &S,
    g: &GroupOf<S, f64>,
    velocity: &VelocityOf<S, f64>,
) -> VelocityOf<S, f64> {
    VelocityOf::<S, f64>::from_fn(|i| {
        system.lagrangian(&S::lift(g), &perturbed_velocity::<S, _>(velocity, i, Dual64::new(0.0, 1.0))).eps
    })
}

const FIRST: HyperDual64 = HyperDual64 { re: 0.0, eps1: 1.0, eps2: 0.0, eps1eps2: 0.0 };
const SECOND: HyperDual64 = HyperDual64 { re: 0.0, eps1: 0.0, eps2: 1.0, eps1eps2: 0.0 };

/// The velocity whose momentum is `unforced` and the impulse there, by Newton's method with the mass matrix at the guess.
///
/// One iteration for a quadratic kinetic energy, but for an impulse that depends on the velocity.
fn velocity_of<S: DiscreteLagrangian>(
    system: &S,
    g: &GroupOf<S, f64>,
    unforced: &VelocityOf<S, f64>,
    impulse_at: impl Fn(&VelocityOf<S, f64>) -> VelocityOf<S, f64>,
    guess: &VelocityOf<S, f64>,
    step_s: f64,
) -> Result<VelocityOf<S, f64>, DynamicsError> {
    let mass_matrix = square::<VelocityOf<S, f64>>(|i, j| {
        let mut v = perturbed_velocity::<S, _>(guess, i, FIRST);
        v[j] += SECOND;
        system.lagrangian(&S::lift(g), &v).eps1eps2
    });
    let mut velocity = *guess;
    let mut rest = Rest::new();
    for _ in 0..MAX_ITERATIONS {
        let residual = momentum_of(system, g, &velocity) - *unforced - impulse_at(&velocity);
        let next = velocity - newton_update(&mass_matrix, &residual);
        let rested = rest.reached(&velocity, &next);
        velocity = next;
        if rested {
            return Ok(velocity);
        }
    }
    Err(not_converged(step_s, rest.last_change()))
}

/// `-D1 L_d(from, to)`
fn start_momentum<S: DiscreteLagrangian>(
    system: &S,
    from: &GroupOf<S, f64>,
    to: &GroupOf<S, f64>,
    step_s: f64,
) -> VelocityOf<S, f64> {
    VelocityOf::<S, f64>::from_fn(|i| {
        let from = perturbed::<S, _>(from, i, Dual64::new(0.0, 1.0));
        -system.discrete_lagrangian(&from, &S::lift(to), real(step_s)).eps
    })
}

/// The configuration with `-D1 L_d(from, to) = momentum`.
fn solve_start_equation<S: DiscreteLagrangian>(
    system: &S,
    from: &GroupOf<S, f64>,
    momentum: &VelocityOf<S, f64>,
    guess: &VelocityOf<S, f64>,
    step_s: f64,
) -> Result<GroupOf<S, f64>, DynamicsError> {
    let mut increment = *guess;
    let mut to = from.compose(&LieGroup::exp(&increment));
    let mut rest = Rest::new();
    for _ in 0..MAX_ITERATIONS {
        let residual = start_momentum(system, from, &to, step_s) - *momentum;
        // Fresh each time: near the edge of the chart an old derivative would stop the iteration where nothing is solved.
        let derivative = square::<VelocityOf<S, f64>>(|i, j| {
            let (from, to) = (perturbed::<S, _>(from, i, FIRST), perturbed::<S, _>(&to, j, SECOND));
            -system.discrete_lagrangian(&from, &to, real(step_s)).eps1eps2
        });
        to = to.compose(&LieGroup::exp(&-newton_update(&derivative, &residual)));
        let next = LieGroup::log(&from.between(&to));
        let rested = rest.reached(&increment, &next);
        increment = next;
        if rested {
            // Products leave the group by their rounding, and what lies off it drives itself further: the chart leads back.
            return Ok(LieGroup::exp(&LieGroup::log(&to)));
        }
    }
    Err(not_converged(step_s, rest.last_change()))
}

/// The rows of a square matrix.
fn square<V: Coordinates<f64>>(entry: impl Fn(usize, usize) -> f64) -> Vec<V> {
    (0..V::DIM).map(|i| V::from_fn(|j| entry(i, j))).collect()
}

/// Solution of `J update = residual` by elimination with partial pivoting.
fn newton_update<V: Coordinates<f64>>(jacobian: &[V], residual: &V) -> V {
    let n = V::DIM;
    let mut rows: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| jacobian[i][j]).chain(core::iter::once(residual[i])).collect()).collect();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs())).unwrap_or(k);
        rows.swap(k, pivot);
        let pivot_row = rows[k].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|&(i, _)| i != k) {
            let factor = row[k] / pivot_row[k];
            for (entry, above) in row.iter_mut().zip(&pivot_row) {
                *entry -= factor * above;
            }
        }
    }
    V::from_fn(|i| rows[i][n] / rows[i][i])
}
