//! What cannot be told apart, and what can, in words.

use super::layout::ParameterLayout;
use core::fmt;
use nalgebra::DVector;

/// Components below this fraction of the largest, in like units, are left out of the words.
const NEGLIGIBLE: f64 = 1e-3;

/// Some amount of one unknown.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// Which unknown, from zero.
    pub column: usize,
    /// What it is called.
    pub label: String,
    /// Its unit.
    pub unit: String,
    /// How much of it, in that unit; in a [`BaseParameter`] its factor.
    pub amount: f64,
}

/// A change of the unknowns that no measurement notices.
///
/// Displayed, it says so in words.
#[derive(Debug, Clone, PartialEq)]
pub struct IndistinguishableChange {
    change: DVector<f64>,
    terms: Vec<Term>,
}

impl IndistinguishableChange {
    /// Of a change in like units, one unit of the unknown at `pivot` in SI.
    pub(super) fn new(layout: &ParameterLayout, scaled: &DVector<f64>, pivot: usize) -> Self {
        let magnitudes = layout.magnitudes();
        let change = scaled.component_mul(&magnitudes) / (scaled[pivot] * magnitudes[pivot]);
        let terms = terms(layout, scaled, &change, pivot);
        Self { change, terms }
    }

    /// The change of every unknown, SI; one unit of the first of [`terms`](Self::terms).
    pub fn change(&self) -> &DVector<f64> {
        &self.change
    }

    /// The unknowns that change together: first the one that the others can make up for.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }
}

impl fmt::Display for IndistinguishableChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some((first, others)) = self.terms.split_first() else { return Ok(()) };
        let Some((last, between)) = others.split_last() else {
            return write!(f, "`{}` is not excited: no measurement notices it", first.label);
        };
        write!(f, "`{}`", first.label)?;
        for term in between {
            write!(f, ", `{}`", term.label)?;
        }
        write!(f, " and `{}` cannot be told apart: ", last.label)?;
        write!(f, "+1 {} of `{}` is undone by", first.unit, first.label)?;
        for (i, term) in others.iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            write!(f, "{comma} {:+} {} `{}`", four_digits(term.amount), term.unit, term.label)?;
        }
        Ok(())
    }
}

/// A combination of unknowns that the data determine; displayed, it reads like a formula.
#[derive(Debug, Clone, PartialEq)]
pub struct BaseParameter {
    factors: DVector<f64>,
    terms: Vec<Term>,
}

impl BaseParameter {
    /// Of a functional of unknowns in like units, one at `pivot`.
    pub(super) fn new(layout: &ParameterLayout, scaled: &DVector<f64>, pivot: usize) -> Self {
        let magnitudes = layout.magnitudes();
        let factors = scaled.component_div(&magnitudes) * (magnitudes[pivot] / scaled[pivot]);
        let terms = terms(layout, scaled, &factors, pivot);
        Self { factors, terms }
    }

    /// The factor of every unknown, SI; its product with the unknowns is the base parameter.
    pub fn factors(&self) -> &DVector<f64> {
        &self.factors
    }

    /// First the unknown that stands for the combination, with factor one and the combination's unit.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }
}

impl fmt::Display for BaseParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, term) in self.terms.iter().enumerate() {
            let (amount, label) = (four_digits(term.amount), &term.label);
            let sign = if amount < 0.0 { " - " } else { " + " };
            f.write_str(if i == 0 { "" } else { sign })?;
            let size = amount.abs();
            if (size - 1.0).abs() < f64::EPSILON { write!(f, "`{label}`") } else { write!(f, "{size} `{label}`") }?;
        }
        Ok(())
    }
}

/// The parts that matter, the pivot first.
fn terms(layout: &ParameterLayout, scaled: &DVector<f64>, amounts: &DVector<f64>, pivot: usize) -> Vec<Term> {
    let least = NEGLIGIBLE * scaled.amax();
    let others = (0..scaled.len()).filter(|&column| column != pivot && scaled[column].abs() > least);
    core::iter::once(pivot)
        .chain(others)
        .map(|column| Term {
            column,
            label: layout.label(column),
            unit: layout.unit(column).to_owned(),
            amount: amounts[column],
        })
        .collect()
}

/// Four significant digits, so that 0.30000000000000004 reads 0.3.
fn four_digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}
