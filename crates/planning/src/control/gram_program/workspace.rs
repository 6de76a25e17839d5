//! What a solve works in and leaves behind.

use super::factor::ActiveFactor;

/// Which bound an active row is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Lower,
    Upper,
    /// Both: an equation, whose multiplier has either sign and which never leaves.
    Both,
}

impl Side {
    /// Sign that a multiplier has at this bound; none at both.
    pub(super) fn sign(self) -> f64 {
        match self {
            Self::Lower => -1.0,
            Self::Upper => 1.0,
            Self::Both => 0.0,
        }
    }
}

/// Memory of the solves of one [`GramProgram`](super::GramProgram): the last solution and the rows that were active in it.
#[derive(Clone, Debug)]
pub struct GramWorkspace {
    pub(super) unknowns: usize,
    /// Of the program the factor belongs to; none where it has to be built anew.
    pub(super) fingerprint: Option<u64>,
    pub(super) factor: ActiveFactor,
    /// Whether rows have been taken out of the factor.
    pub(super) is_worn: bool,
    /// Rows in the order of the factor, with bound and multiplier.
    pub(super) active: Vec<(usize, Side)>,
    pub(super) multipliers: Vec<f64>,
    /// Multipliers of the rows as they were given.
    pub(super) unscaled: Vec<f64>,
    /// Active rows and multipliers of which the next set is made.
    pub(super) previous: Vec<(usize, Side)>,
    pub(super) previous_multipliers: Vec<f64>,
    /// How far the active rows are beyond their bounds at the free minimum.
    pub(super) excesses: Vec<f64>,
    pub(super) is_active: Vec<bool>,
    /// Scaled bounds, filled up with infinity.
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
    /// Values of the scaled rows.
    pub(super) values: Vec<f64>,
    /// Rows found violated last.
    pub(super) violated: Vec<usize>,
    /// Solution and the one without rows, filled up with zeros.
    pub(super) x: Vec<f64>,
    pub(super) free_x: Vec<f64>,
    /// Gradient of the Lagrangian, and the step it asks for.
    pub(super) gradient: Vec<f64>,
    pub(super) correction: Vec<f64>,
    /// By position of an active row.
    pub(super) target: Vec<f64>,
    pub(super) changes: Vec<f64>,
    pub(super) certificate: Vec<f64>,
    pub(super) crossed: Option<usize>,
    pub(super) iterations: usize,
}

impl GramWorkspace {
    /// For so many unknowns and rows, each also filled up with zeros, and with memory for more rows.
    pub(super) fn with_room([unknowns, padded]: [usize; 2], [rows, padded_rows]: [usize; 2], room: usize) -> Self {
        let most = unknowns.min(room);
        let mut workspace = Self {
            unknowns,
            fingerprint: None,
            factor: ActiveFactor::new(most),
            is_worn: false,
            active: Vec::with_capacity(most + 1),
            multipliers: Vec::with_capacity(most + 1),
            unscaled: Vec::with_capacity(most + 1),
            previous: Vec::with_capacity(most + 1),
            previous_multipliers: Vec::with_capacity(most + 1),
            excesses: Vec::with_capacity(most + 1),
            is_active: Vec::with_capacity(room),
            lower: Vec::with_capacity(room),
            upper: Vec::with_capacity(room),
            values: Vec::with_capacity(room),
            violated: Vec::with_capacity(room),
            x: vec![0.0; padded],
            free_x: vec![0.0; padded],
            gradient: vec![0.0; padded],
            correction: vec![0.0; padded],
            target: Vec::with_capacity(most + 1),
            changes: Vec::with_capacity(most + 1),
            certificate: Vec::with_capacity(room),
            crossed: None,
            iterations: 0,
        };
        workspace.resize(rows, padded_rows);
        workspace
    }

    /// Makes room for another number of rows; what is known of those that stay has to be moved by [`Self::shift_rows`].
    pub(super) fn resize(&mut self, rows: usize, padded_rows: usize) {
        self.lower.clear();
        self.lower.resize(padded_rows, f64::NEG_INFINITY);
        self.upper.clear();
        self.upper.resize(padded_rows, f64::INFINITY);
        self.values.resize(padded_rows, 0.0);
        self.is_active.clear();
        self.is_active.resize(rows, false);
        self.certificate.resize(rows, 0.0);
        self.violated.clear();
        self.violated.reserve(rows);
        self.fingerprint = None;
    }

    /// The `x` of least value, after [`Solved`](super::GramStatus::Solved).
    pub fn solution(&self) -> &[f64] {
        &self.x[..self.unknowns]
    }

    /// Changes of the set of active rows in the last solve, and the solutions in between.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// The active rows with their multipliers: `H x + f + sum of multiplier times row = 0`; positive at upper bounds, negative at
    /// lower ones.
    pub fn multipliers(&self) -> impl ExactSizeIterator<Item = (usize, f64)> {
        self.active.iter().zip(&self.unscaled).map(|((row, _), multiplier)| (*row, *multiplier))
    }

    /// After [`Infeasible`](super::GramStatus::Infeasible), a factor `y` of each row: `A' y = 0` up to rounding, although the sum of
    /// `y` times the upper bound where positive, times the lower where negative, is below zero. All zero where a row alone cannot
    /// be fulfilled: [`Self::crossed_row`].
    ///
    /// # Source
    /// Boyd and Vandenberghe, Convex Optimization, 5.8.
    pub fn certificate(&self) -> &[f64] {
        &self.certificate
    }

    /// After [`Infeasible`](super::GramStatus::Infeasible), the row whose own bounds exclude each other, if that is the reason.
    pub fn crossed_row(&self) -> Option<usize> {
        self.crossed
    }

    /// Forgets which rows were active.
    pub fn forget(&mut self) {
        self.fingerprint = None;
        self.factor.clear();
        self.active.clear();
        self.multipliers.clear();
        self.unscaled.clear();
        self.is_active.fill(false);
    }

    /// Moves what is known of row `j` to row `map[j]`, or forgets it: the next solve begins with the rows that those active in
    /// the last one have become.
    pub fn shift(&mut self, map: &[Option<usize>]) {
        self.shift_rows(|row| map.get(row).copied().flatten());
    }

    /// The same with the new row of each.
    pub(in crate::control) fn shift_rows(&mut self, mut new: impl FnMut(usize) -> Option<usize>) {
        self.fingerprint = None;
        self.unscaled.clear();
        for (row, _) in &mut self.active {
            // A row that does not exist is left out when the factor is built.
            *row = new(*row).unwrap_or(usize::MAX);
        }
    }
}
