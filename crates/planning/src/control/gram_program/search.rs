//! The search for the active rows.

use super::ending::{GramSettings, GramStatus};
use super::workspace::{GramWorkspace, Side};
use crate::vectors::{dot, largest};

/// Square of the share of a row that is new to the active ones, below which it counts as one of their combinations.
const DEPENDENT: f64 = 1e-10;
/// Share of the tolerance at which a solution is not brought nearer to exactness.
const EXACT: f64 = 1e-2;
/// How often a solution is brought nearer to exactness.
pub(super) const REFINEMENTS: usize = 3;

/// A row beyond one of its bounds.
#[derive(Clone, Copy, Debug)]
struct Violation {
    row: usize,
    /// One above the upper bound, minus one below the lower.
    sign: f64,
}

/// What the search asks of a program. Rows are scaled to unit length in `H^-1`; vectors over the unknowns are filled up with zeros
/// to [`Self::room`].
pub(super) trait Programmed {
    /// Number of rows.
    fn rows(&self) -> usize;
    /// Number of unknowns.
    fn unknowns(&self) -> usize;
    /// Length of vectors over the unknowns.
    fn room(&self) -> usize;
    /// Of the Gram matrix: two programs that differ in it cannot share a factor.
    fn fingerprint(&self) -> u64;
    /// The rows that are equations.
    fn equations(&self) -> impl Iterator<Item = usize>;
    /// Whether a row is one.
    fn is_equation(&self, row: usize) -> bool;
    /// What a row was multiplied by.
    fn scale(&self, row: usize) -> f64;
    /// Product of two rows in `H^-1`.
    fn product(&self, row: usize, other: usize) -> f64;
    /// Value of a row.
    fn value(&self, row: usize, x: &[f64]) -> f64;
    /// Values of all rows.
    fn values(&self, x: &[f64], values: &mut [f64]);
    /// Adds `factor` times the column of `H^-1 A'` that belongs to a row.
    fn add_column(&self, row: usize, factor: f64, x: &mut [f64]);
    /// Adds `factor` times a row.
    fn add_normal(&self, row: usize, factor: f64, x: &mut [f64]);
    /// Writes `H^-1 x`.
    fn times_inverse(&self, x: &[f64], product: &mut [f64]);
    /// Writes `H x`.
    fn times_hessian(&self, x: &[f64], product: &mut [f64]);
}

pub(super) fn solve<P: Programmed>(
    program: &P,
    linear: &[f64],
    bounds: [&[f64]; 2],
    settings: &GramSettings,
    workspace: &mut GramWorkspace,
) -> GramStatus {
    let mut search = Search { program, linear, settings, workspace };
    let status = search.begin(bounds).unwrap_or_else(|| search.run());
    if status == GramStatus::Numerical {
        workspace.forget();
    }
    let unscaled = workspace.active.iter().zip(&workspace.multipliers);
    workspace.unscaled.clear();
    workspace.unscaled.extend(unscaled.map(|((row, _), multiplier)| multiplier * program.scale(*row)));
    status
}

pub(super) struct Search<'a, P> {
    pub(super) program: &'a P,
    linear: &'a [f64],
    settings: &'a GramSettings,
    pub(super) workspace: &'a mut GramWorkspace,
}

impl<P: Programmed> Search<'_, P> {
    /// Takes in bounds and linear part, and the set of rows to begin with; a status where that is the end.
    fn begin(&mut self, [lower, upper]: [&[f64]; 2]) -> Option<GramStatus> {
        let (program, workspace) = (self.program, &mut *self.workspace);
        workspace.iterations = 0;
        workspace.crossed = None;
        workspace.certificate.fill(0.0);
        workspace.violated.clear();
        let rows = program.rows();
        let are_lengths_right = [lower.len(), upper.len(), workspace.is_active.len()] == [rows; 3]
            && self.linear.len() == program.unknowns()
            && workspace.unknowns == program.unknowns()
            && workspace.x.len() == program.room();
        if !are_lengths_right {
            return Some(GramStatus::Numerical);
        }
        let tolerance = self.settings.tolerance;
        let mut are_bounds_right = true;
        let scaled = workspace.lower.iter_mut().zip(&mut workspace.upper);
        for (row, ((scaled_lower, scaled_upper), (lower, upper))) in scaled.zip(lower.iter().zip(upper)).enumerate() {
            let scale = program.scale(row);
            (*scaled_lower, *scaled_upper) = (lower * scale, upper * scale);
            let are_apart = *scaled_lower <= *scaled_upper + tolerance;
            are_bounds_right &= are_apart;
            are_bounds_right &= *scaled_lower < f64::INFINITY;
            are_bounds_right &= *scaled_upper > f64::NEG_INFINITY;
        }
        if !are_bounds_right {
            if lower.iter().chain(upper).any(|bound| bound.is_nan()) {
                return Some(GramStatus::Numerical);
            }
            let is_crossed = |row: &usize| {
                let (lower, upper) = (workspace.lower[*row], workspace.upper[*row]);
                lower > upper + tolerance || lower == f64::INFINITY || upper == f64::NEG_INFINITY
            };
            workspace.crossed = (0..rows).find(is_crossed);
            return Some(if workspace.crossed.is_some() { GramStatus::Infeasible } else { GramStatus::Numerical });
        }
        let is_equation = |row: usize| (workspace.upper[row] - workspace.lower[row]).abs() <= tolerance;
        if !program.equations().all(is_equation) {
            return Some(GramStatus::Numerical);
        }
        program.times_inverse(self.linear, &mut workspace.free_x);
        workspace.free_x.iter_mut().for_each(|x| *x = -*x);
        if !largest(&workspace.free_x).is_finite() {
            return Some(GramStatus::Numerical);
        }
        let is_bounded = |(row, side): &(usize, Side)| match side {
            Side::Lower => workspace.lower[*row].is_finite(),
            Side::Upper => workspace.upper[*row].is_finite(),
            Side::Both => true,
        };
        let is_factor_kept =
            workspace.fingerprint == Some(program.fingerprint()) && workspace.active.iter().all(is_bounded);
        if is_factor_kept {
            workspace.excesses.clear();
            for position in 0..self.workspace.active.len() {
                let (row, side) = self.workspace.active[position];
                let excess = self.excess(row, side, &self.workspace.free_x);
                self.workspace.excesses.push(excess);
            }
        } else {
            self.build();
        }
        None
    }

    /// Makes the active set anew: the equations, then what was active before and can be.
    fn build(&mut self) {
        let workspace = &mut *self.workspace;
        core::mem::swap(&mut workspace.active, &mut workspace.previous);
        core::mem::swap(&mut workspace.multipliers, &mut workspace.previous_multipliers);
        workspace.active.clear();
        workspace.multipliers.clear();
        workspace.excesses.clear();
        workspace.factor.clear();
        workspace.is_active.fill(false);
        workspace.fingerprint = Some(self.program.fingerprint());
        workspace.is_worn = false;
        let program = self.program;
        for row in program.equations() {
            self.append(row, Side::Both, 0.0);
        }
        for position in 0..self.workspace.previous.len() {
            let (row, side) = self.workspace.previous[position];
            let bound = match side {
                Side::Lower => self.workspace.lower.get(row),
                Side::Upper => self.workspace.upper.get(row),
                Side::Both => None,
            };
            let is_new = self.workspace.is_active.get(row) == Some(&false);
            if is_new && bound.is_some_and(|bound| bound.is_finite()) {
                self.append(row, side, self.workspace.previous_multipliers[position]);
            }
        }
    }

    fn run(&mut self) -> GramStatus {
        let mut is_rebuilt = false;
        loop {
            if !self.count() {
                return GramStatus::Capped;
            }
            if let Some(position) = self.step() {
                self.remove(position);
                continue;
            }
            self.place();
            match self.check() {
                None => {}
                // A factor from which rows were taken out has errors that a new one has not.
                Some(GramStatus::Numerical) if self.workspace.is_worn && !is_rebuilt => {
                    self.build();
                    is_rebuilt = true;
                }
                Some(status) => return status,
            }
        }
    }

    /// Takes in the row that is violated most; a status where there is none or where it cannot be.
    fn check(&mut self) -> Option<GramStatus> {
        let tolerance = self.settings.tolerance;
        let mut refinements = 0;
        loop {
            let worst = self.worst_again(tolerance).or_else(|| self.worst_of_all(tolerance));
            // A little work brings a solution far below what is asked for; then that counts which is asked for.
            let is_last = refinements == REFINEMENTS;
            match worst {
                None if self.is_exact(if is_last { tolerance } else { EXACT * tolerance }) => {
                    return Some(GramStatus::Solved);
                }
                None if is_last => return Some(GramStatus::Numerical),
                None => {}
                Some(Violation { row, sign }) => {
                    let side = self.side(row, sign);
                    if self.append(row, side, 0.0) {
                        return None;
                    }
                    // That it is violated may be rounding, where it is a combination of others that are not quite at their bounds.
                    if refinements > 0 {
                        return self.exchange(row, side, sign);
                    }
                    self.is_exact(0.0);
                }
            }
            self.refine();
            refinements += 1;
        }
    }

    /// Counts an iteration; false where there are no more.
    pub(super) fn count(&mut self) -> bool {
        if self.workspace.iterations == self.settings.iterations {
            return false;
        }
        self.workspace.iterations += 1;
        true
    }

    fn bound(&self, row: usize, side: Side) -> f64 {
        match side {
            Side::Lower => self.workspace.lower[row],
            Side::Upper => self.workspace.upper[row],
            Side::Both => 0.5 * (self.workspace.lower[row] + self.workspace.upper[row]),
        }
    }

    /// How far a row is above a bound of its.
    fn excess(&self, row: usize, side: Side, x: &[f64]) -> f64 {
        self.program.value(row, x) - self.bound(row, side)
    }

    /// Takes a row into the active ones, unless it is a combination of them: then `target` are its factors.
    pub(super) fn append(&mut self, row: usize, side: Side, multiplier: f64) -> bool {
        self.append_if_new(row, side, multiplier, DEPENDENT)
    }

    pub(super) fn append_if_new(&mut self, row: usize, side: Side, multiplier: f64, least: f64) -> bool {
        let (program, workspace) = (self.program, &mut *self.workspace);
        workspace.target.clear();
        workspace.target.extend(workspace.active.iter().map(|(other, _)| program.product(row, *other)));
        if !workspace.factor.append(&mut workspace.target, program.product(row, row), least) {
            return false;
        }
        workspace.active.push((row, side));
        workspace.multipliers.push(multiplier);
        workspace.is_active[row] = true;
        let excess = self.excess(row, side, &self.workspace.free_x);
        self.workspace.excesses.push(excess);
        true
    }

    pub(super) fn remove(&mut self, position: usize) {
        let workspace = &mut *self.workspace;
        let (row, _) = workspace.active.remove(position);
        workspace.multipliers.remove(position);
        workspace.excesses.remove(position);
        workspace.is_active[row] = false;
        workspace.factor.remove(position);
        workspace.is_worn = true;
    }

    /// Moves the multipliers towards those with which the active rows hold, until one reaches zero: that row is to leave.
    fn step(&mut self) -> Option<usize> {
        let workspace = &mut *self.workspace;
        workspace.target.clear();
        workspace.target.extend_from_slice(&workspace.excesses);
        workspace.factor.solve(&mut workspace.target);
        let (mut length, mut leaving, mut most) = (1.0, None, 0.0);
        for (position, (target, multiplier)) in workspace.target.iter().zip(&workspace.multipliers).enumerate() {
            let sign = workspace.active[position].1.sign();
            let (target, multiplier) = (sign * target, sign * multiplier);
            if target < 0.0 {
                let until = multiplier / (multiplier - target);
                if until < length || (until <= length && target < most) {
                    (length, leaving, most) = (until, Some(position), target);
                }
            }
        }
        for (target, multiplier) in workspace.target.iter().zip(&mut workspace.multipliers) {
            *multiplier += length * (target - *multiplier);
        }
        for ((_, side), multiplier) in workspace.active.iter().zip(&mut workspace.multipliers) {
            if side.sign() * *multiplier < 0.0 {
                *multiplier = 0.0;
            }
        }
        leaving
    }

    /// The solution of the multipliers.
    fn place(&mut self) {
        let workspace = &mut *self.workspace;
        workspace.x.copy_from_slice(&workspace.free_x);
        for ((row, _), multiplier) in workspace.active.iter().zip(&workspace.multipliers) {
            self.program.add_column(*row, -multiplier, &mut workspace.x);
        }
    }

    /// Of the rows found violated last, the one that is most.
    fn worst_again(&self, tolerance: f64) -> Option<Violation> {
        let (mut worst, mut most) = (None, tolerance);
        for row in &self.workspace.violated {
            if self.workspace.is_active[*row] {
                continue;
            }
            let value = self.program.value(*row, &self.workspace.x);
            let (above, below) = (value - self.workspace.upper[*row], self.workspace.lower[*row] - value);
            let excess = f64::max(above, below);
            if excess > most {
                (worst, most) = (Some(Violation { row: *row, sign: if above > below { 1.0 } else { -1.0 } }), excess);
            }
        }
        worst
    }

    /// Of all rows, the one violated most; notes all that are.
    fn worst_of_all(&mut self, tolerance: f64) -> Option<Violation> {
        let workspace = &mut *self.workspace;
        self.program.values(&workspace.x, &mut workspace.values);
        workspace.violated.clear();
        let bounds = workspace.lower.iter().zip(&workspace.upper);
        let (mut worst, mut most) = (None, tolerance);
        for (row, (value, (lower, upper))) in workspace.values.iter().zip(bounds).enumerate() {
            let (above, below) = (value - upper, lower - value);
            let excess = f64::max(above, below);
            if excess > tolerance && !workspace.is_active[row] {
                workspace.violated.push(row);
                if excess > most {
                    (worst, most) = (Some(Violation { row, sign: if above > below { 1.0 } else { -1.0 } }), excess);
                }
            }
        }
        worst
    }

    /// Whether the active rows hold and the gradient vanishes, both by the solution itself; `target` and `correction` become what
    /// is left of them.
    fn is_exact(&mut self, tolerance: f64) -> bool {
        let (program, workspace) = (self.program, &mut *self.workspace);
        program.times_hessian(&workspace.x, &mut workspace.gradient);
        for (gradient, linear) in workspace.gradient.iter_mut().zip(self.linear) {
            *gradient += linear;
        }
        for ((row, _), multiplier) in workspace.active.iter().zip(&workspace.multipliers) {
            program.add_normal(*row, *multiplier, &mut workspace.gradient);
        }
        program.times_inverse(&workspace.gradient, &mut workspace.correction);
        let square = dot(&workspace.gradient, &workspace.correction);
        // The gradient is a sum of rows times multipliers, and as exact as these are large.
        let of_gradient = tolerance * f64::max(1.0, largest(&workspace.multipliers));
        self.residuals();
        square <= of_gradient * of_gradient && largest(&self.workspace.target) <= tolerance
    }

    /// Writes how far the active rows are above their bounds.
    fn residuals(&mut self) {
        self.workspace.target.clear();
        for position in 0..self.workspace.active.len() {
            let (row, side) = self.workspace.active[position];
            let residual = self.excess(row, side, &self.workspace.x);
            self.workspace.target.push(residual);
        }
    }

    /// Corrects solution and multipliers by what is left of the conditions.
    fn refine(&mut self) {
        let workspace = &mut *self.workspace;
        for (x, correction) in workspace.x.iter_mut().zip(&workspace.correction) {
            *x -= correction;
        }
        self.residuals();
        let workspace = &mut *self.workspace;
        workspace.factor.solve(&mut workspace.target);
        for (position, change) in workspace.target.iter().enumerate() {
            workspace.multipliers[position] += change;
            self.program.add_column(workspace.active[position].0, -change, &mut workspace.x);
        }
    }

    fn side(&self, row: usize, sign: f64) -> Side {
        if self.program.is_equation(row) {
            Side::Both
        } else if sign > 0.0 {
            Side::Upper
        } else {
            Side::Lower
        }
    }
}
