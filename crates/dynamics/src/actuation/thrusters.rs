//! Thrusters that only push: cold gas, proportional or pulsed.

use super::Actuation;
use super::effectiveness::{finite, limited, row_sizes, spanning_columns};
use crate::error::DynamicsError;
use tumble_lie::Wrench;
use tumble_lie::nalgebra::{ComplexField, Matrix6, SMatrix, SVector, UnitVector3, Vector3, Vector6};

/// A nozzle that pushes the body one way.
/// # Frame
/// Body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thruster {
    /// Where it pushes, from the body origin, m.
    pub position_body: Vector3<f64>,
    /// Which way it pushes the body: opposite to its exhaust.
    pub direction_body: UnitVector3<f64>,
    /// Thrust when fully open, N; positive.
    pub largest_thrust_n: f64,
}

impl Thruster {
    /// Wrench at full thrust, torque about the body origin.
    pub fn wrench_body(&self) -> Wrench<f64> {
        let force = self.direction_body.into_inner() * self.largest_thrust_n;
        Wrench::new(self.position_body.cross(&force), force)
    }
}

/// `N` thrusters whose thrust can be set: every wrench within their limits is given exactly and with the least total
/// thrust; of any other, the largest part along its direction.
///
/// Its command is the thrust of each, N.
///
/// Allocation is a linear programme in the openings `u` and the part `s` of the wrench that is given: first the largest
/// `s <= 1` with `G u = s w`, `0 <= u <= 1`, then the least thrust for that `s`. All closed is a vertex of both, so the
/// bounded simplex method starts there; every vertex on its way is admissible, the smallest eligible index goes first
/// (Bland), and the number of exchanges is bounded.
/// # Frame
/// Body axes, torque about the body origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThrusterSet<const N: usize> {
    thrusters: [Thruster; N],
    /// Wrench per opening, each row divided by its largest entry.
    effectiveness: SMatrix<f64, 6, N>,
    /// Those largest entries.
    row_sizes: Vector6<f64>,
    /// Six independent thrusters, where the simplex method starts.
    basis: [usize; 6],
}

impl<const N: usize> ThrusterSet<N> {
    /// Thrusters that together can push and turn any way.
    ///
    /// # Errors
    /// [`DynamicsError::InvalidActuator`] for one whose thrust is not positive or whose numbers are not finite,
    /// [`DynamicsError::OutOfReach`] if some direction cannot be given.
    pub fn try_new(thrusters: [Thruster; N]) -> Result<Self, DynamicsError> {
        let mut effectiveness = SMatrix::<f64, 6, N>::zeros();
        for (index, thruster) in thrusters.iter().enumerate() {
            let wrench = thruster.wrench_body().to_vector();
            if !(wrench.iter().all(ComplexField::is_finite) && thruster.largest_thrust_n > 0.0) {
                return Err(DynamicsError::InvalidActuator { index });
            }
            effectiveness.set_column(index, &wrench);
        }
        let row_sizes = row_sizes(&effectiveness)?;
        for mut column in effectiveness.column_iter_mut() {
            column.component_div_assign(&row_sizes);
        }
        let set = Self { thrusters, effectiveness, row_sizes, basis: spanning_columns(&effectiveness)? };
        for component in 0..6 {
            for sign in [1.0, -1.0] {
                let axis = Vector6::from_fn(|row, _| if row == component { sign } else { 0.0 });
                let mut programme = Programme::new(&set, axis, f64::MAX);
                programme.solve(Objective::LargestPart);
                if programme.part < 1e-9 {
                    return Err(DynamicsError::OutOfReach { component });
                }
            }
        }
        Ok(set)
    }

    /// The thrusters.
    pub fn thrusters(&self) -> &[Thruster; N] {
        &self.thrusters
    }

    /// Openings 0 to 1.
    fn openings(&self, wrench_body: &Wrench<f64>) -> Result<SVector<f64, N>, DynamicsError> {
        let wanted = finite(finite(wrench_body.to_vector())?.component_div(&self.row_sizes))?;
        let size = wanted.amax();
        if size <= 0.0 {
            return Ok(SVector::zeros());
        }
        let mut programme = Programme::new(self, wanted / size, size);
        programme.solve(Objective::LargestPart);
        programme.solve(Objective::LeastThrust);
        Ok(programme.openings.map(|opening| opening.clamp(0.0, 1.0)))
    }

    /// Wrench of openings 0 to 1.
    fn wrench_of(&self, openings: &SVector<f64, N>) -> Wrench<f64> {
        Wrench::from((self.effectiveness * openings).component_mul(&self.row_sizes))
    }
}

impl<const N: usize> Actuation for ThrusterSet<N> {
    type Command = SVector<f64, N>;

    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<SVector<f64, N>, DynamicsError> {
        let openings = self.openings(wrench_body)?;
        Ok(SVector::from_fn(|i, _| openings[i] * self.thrusters[i].largest_thrust_n))
    }

    fn realize(&self, command: &SVector<f64, N>) -> Wrench<f64> {
        let opening = |i: usize| limited(command[i] / self.thrusters[i].largest_thrust_n, 0.0, 1.0);
        self.wrench_of(&SVector::from_fn(|i, _| opening(i)))
    }
}

/// What the linear programme seeks.
#[derive(Clone, Copy)]
enum Objective {
    LargestPart,
    LeastThrust,
}

/// The linear programme `G u - s w = 0` with bounds on all variables; variable `N` is `s`.
struct Programme<'a, const N: usize> {
    set: &'a ThrusterSet<N>,
    wanted: Vector6<f64>,
    /// Bounds of `s`.
    part_bounds: (f64, f64),
    basis: [usize; 6],
    openings: SVector<f64, N>,
    part: f64,
}

/// Smaller numbers of the scaled problem count as zero.
const PIVOT_TOLERANCE: f64 = 1e-9;
/// Steps that differ by less are equally long.
const TIE_TOLERANCE: f64 = 1e-13;

impl<'a, const N: usize> Programme<'a, N> {
    fn new(set: &'a ThrusterSet<N>, wanted: Vector6<f64>, largest_part: f64) -> Self {
        let part_bounds = (0.0, largest_part);
        Self { set, wanted, part_bounds, basis: set.basis, openings: SVector::zeros(), part: 0.0 }
    }

    fn column(&self, variable: usize) -> Vector6<f64> {
        if variable < N { self.set.effectiveness.column(variable).into_owned() } else { -self.wanted }
    }

    fn bounds(&self, variable: usize) -> (f64, f64) {
        if variable < N { (0.0, 1.0) } else { self.part_bounds }
    }

    fn value(&self, variable: usize) -> f64 {
        if variable < N { self.openings[variable] } else { self.part }
    }

    fn set_value(&mut self, variable: usize, value: f64) {
        *(if variable < N { &mut self.openings[variable] } else { &mut self.part }) = value;
    }

    fn cost(&self, variable: usize, objective: Objective) -> f64 {
        match objective {
            Objective::LargestPart => -f64::from(u8::from(variable == N)),
            Objective::LeastThrust if variable < N => self.set.thrusters[variable].largest_thrust_n,
            Objective::LeastThrust => 0.0,
        }
    }

    /// Exchanges variables until nothing improves.
    fn solve(&mut self, objective: Objective) {
        if let Objective::LeastThrust = objective {
            self.part_bounds = (self.part, self.part);
        }
        let largest_cost = (0..=N).map(|variable| self.cost(variable, objective).abs()).fold(0.0, f64::max);
        for _ in 0..50 * (N + 1) {
            let columns = self.basis.map(|variable| self.column(variable));
            let Some(inverse) = Matrix6::from_columns(&columns).try_inverse() else { return };
            self.restore(&inverse);
            let costs = Vector6::from_iterator(self.basis.iter().map(|variable| self.cost(*variable, objective)));
            let prices = inverse.transpose() * costs;
            let tolerance = PIVOT_TOLERANCE * largest_cost;
            let entering = (0..=N).find_map(|variable| {
                let (lower, upper) = self.bounds(variable);
                if self.basis.contains(&variable) || lower >= upper {
                    return None;
                }
                let gain = self.cost(variable, objective) - prices.dot(&self.column(variable));
                let at_lower = self.value(variable) <= lower;
                let improves = if at_lower { gain < -tolerance } else { gain > tolerance };
                improves.then_some((variable, if at_lower { 1.0 } else { -1.0 }))
            });
            let Some((variable, sign)) = entering else { return };
            self.exchange(variable, &(inverse * self.column(variable) * -sign), sign);
        }
    }

    /// The values of the basis from those of all others.
    fn restore(&mut self, inverse: &Matrix6<f64>) {
        let mut rest = Vector6::zeros();
        for variable in 0..=N {
            if !self.basis.contains(&variable) {
                rest -= self.column(variable) * self.value(variable);
            }
        }
        let values = inverse * rest;
        for (row, variable) in self.basis.into_iter().enumerate() {
            self.set_value(variable, values[row]);
        }
    }

    /// Moves `entering` until a variable meets its bound: itself, or one of the basis, whose place it then takes.
    fn exchange(&mut self, entering: usize, rates: &Vector6<f64>, sign: f64) {
        let (lower, upper) = self.bounds(entering);
        let (mut longest, mut leaving) = (upper - lower, None);
        for (row, variable) in self.basis.into_iter().enumerate() {
            let rate = rates[row];
            if rate.abs() <= PIVOT_TOLERANCE {
                continue;
            }
            let (lower, upper) = self.bounds(variable);
            let bound = if rate > 0.0 { upper } else { lower };
            let step = ((bound - self.value(variable)) / rate).max(0.0);
            let first = leaving.is_none_or(|(_, other, _)| variable < other);
            if step < longest - TIE_TOLERANCE || (step <= longest + TIE_TOLERANCE && first && leaving.is_some()) {
                (longest, leaving) = (step, Some((row, variable, bound)));
            }
        }
        self.set_value(entering, self.value(entering) + sign * longest);
        for (row, variable) in self.basis.into_iter().enumerate() {
            self.set_value(variable, self.value(variable) + rates[row] * longest);
        }
        match leaving {
            None => self.set_value(entering, if sign > 0.0 { upper } else { lower }),
            Some((row, variable, bound)) => {
                self.set_value(variable, bound);
                self.basis[row] = entering;
            }
        }
    }
}

/// How finely a valve can be timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseTiming {
    /// Valve clock ticks in a control period, the longest pulse; positive.
    pub ticks_per_period: u32,
    /// The shortest pulse that opens the valve, ticks.
    pub shortest_ticks: u32,
}

/// Thrusters that are open or closed: a thrust is given as one pulse per control period.
///
/// Its command is the pulse of each thruster in ticks; the wrench is the mean over the period. A pulse shorter than half
/// the shortest is left out, other short ones are lengthened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PulsedThrusters<const N: usize> {
    /// The thrusters and their sharing.
    pub thrusters: ThrusterSet<N>,
    /// Their valves.
    pub timing: PulseTiming,
}

impl<const N: usize> PulsedThrusters<N> {
    /// What a valve makes of a pulse.
    fn pulse(&self, ticks: u32) -> u32 {
        let PulseTiming { ticks_per_period, shortest_ticks } = self.timing;
        if ticks < shortest_ticks.div_ceil(2) { 0 } else { ticks.max(shortest_ticks).min(ticks_per_period) }
    }
}

impl<const N: usize> Actuation for PulsedThrusters<N> {
    type Command = [u32; N];

    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<[u32; N], DynamicsError> {
        let openings = self.thrusters.openings(wrench_body)?;
        let period = f64::from(self.timing.ticks_per_period);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to `ticks_per_period`
        let ticks = |opening: f64| ComplexField::round(opening * period) as u32;
        Ok(core::array::from_fn(|i| self.pulse(ticks(openings[i]))))
    }

    fn realize(&self, command: &[u32; N]) -> Wrench<f64> {
        let period = f64::from(self.timing.ticks_per_period.max(1));
        self.thrusters.wrench_of(&SVector::from_fn(|i, _| f64::from(self.pulse(command[i])) / period))
    }
}
