//! What of the parameters a record tells apart, in words.

use super::calibration::{Calibration, Nuisance};
use core::fmt;
use nalgebra::{DMatrix, DVector};

/// Eigenvalue of the information, scaled to a unit diagonal, below which a direction is not determined.
const SMALLEST_EIGENVALUE: f64 = 1e-9;
/// Squared component of an undetermined direction below which a quantity has no part in it.
const SMALLEST_SHARE: f64 = 1e-5;

/// Something that is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quantity {
    /// Mass.
    Mass,
    /// Centre of mass along a body axis.
    CenterOfMass(usize),
    /// Entry of the inertia about the centre of mass.
    Inertia(usize, usize),
    /// A nuisance.
    Nuisance(Nuisance),
    /// The factors between wrench and acceleration, where a delay is told without a body.
    Gains,
}

impl Quantity {
    fn of_column(column: usize, calibration: &Calibration) -> Self {
        match column {
            0 => Self::Mass,
            1..=3 => Self::CenterOfMass(column - 1),
            4..=9 => {
                let (i, j) = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)][column - 4];
                Self::Inertia(i, j)
            }
            _ => Self::Nuisance(calibration.nuisances()[column - 10]),
        }
    }

    /// The name that it shares with its other axes.
    fn kind(self) -> &'static str {
        match self {
            Self::Mass => "mass",
            Self::CenterOfMass(_) => "centre of mass",
            Self::Inertia(..) => "inertia",
            Self::Nuisance(nuisance) => nuisance.name(),
            Self::Gains => "the gains between wrench and motion",
        }
    }
}

/// Whether data determine a quantity beside the body, and if not, why.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Verdict {
    /// It does.
    Identifiable,
    /// It says less about it than a data sheet would.
    NotIdentifiable,
    /// Only together with these other quantities.
    NotSeparableFrom(Vec<Quantity>),
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Identifiable => f.write_str("identifiable"),
            Self::NotIdentifiable => f.write_str("not identifiable"),
            Self::NotSeparableFrom(others) => {
                f.write_str("not separable from ")?;
                names(f, others)
            }
        }
    }
}

/// Quantities that may change together without any measurement noticing; displayed, it says so in words.
#[derive(Clone, Debug, PartialEq)]
pub struct Exchange {
    /// Each with its part in the change, in units of what the record would tell about it alone; squares add up to one.
    pub parts: Vec<(Quantity, f64)>,
}

impl fmt::Display for Exchange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let quantities: Vec<Quantity> = self.parts.iter().map(|part| part.0).collect();
        names(f, &quantities)?;
        f.write_str(" are exchangeable")?;
        let has = |kind: &str| quantities.iter().any(|quantity| quantity.kind() == kind);
        if has("mass") && has("inertia") && has("force-scale") && has("torque-scale") {
            f.write_str(": the absolute wrench scale can never be known from motion alone")?;
        }
        Ok(())
    }
}

/// Each kind once.
fn names(f: &mut fmt::Formatter<'_>, quantities: &[Quantity]) -> fmt::Result {
    let mut kinds: Vec<&str> = Vec::new();
    for quantity in quantities {
        if !kinds.contains(&quantity.kind()) {
            kinds.push(quantity.kind());
        }
    }
    for (i, kind) in kinds.iter().enumerate() {
        f.write_str(if i == 0 {
            ""
        } else if i + 1 == kinds.len() {
            " and "
        } else {
            ", "
        })?;
        f.write_str(kind)?;
    }
    Ok(())
}

/// What the data alone say about the parameters, before any prior.
#[derive(Clone, Debug, Default)]
pub(crate) struct Identifiability {
    /// Of each nuisance, in the order of their columns.
    pub(crate) verdicts: Vec<Verdict>,
    pub(crate) exchanges: Vec<Exchange>,
}

impl Identifiability {
    /// # Source
    /// Eigenvectors of the information scaled to a unit diagonal.
    pub(crate) fn new(information: &DMatrix<f64>, calibration: &Calibration) -> Self {
        let (columns, count) = (calibration.columns(), calibration.nuisances().len());
        if count == 0 {
            return Self::default();
        }
        let unknown = |column: usize| calibration.nuisances()[column - 10].unknown_std();
        // Not even with everything else known.
        let seen: Vec<usize> =
            (0..columns).filter(|&i| i < 10 || information[(i, i)] * unknown(i).powi(2) > 1.0).collect();
        let root = |i: usize| information[(i, i)].max(f64::MIN_POSITIVE).sqrt();
        let scaled = DMatrix::from_fn(seen.len(), seen.len(), |a, b| {
            information[(seen[a], seen[b])] / (root(seen[a]) * root(seen[b]))
        });
        let eigen = scaled.symmetric_eigen();
        let mut exchanges = Vec::new();
        let mut projector = DMatrix::<f64>::zeros(columns, columns);
        let mut variance = DVector::<f64>::zeros(columns);
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value >= SMALLEST_EIGENVALUE {
                for (&i, part) in seen.iter().zip(vector.iter()) {
                    variance[i] += (part / root(i)).powi(2) / value;
                }
                continue;
            }
            let parts: Vec<(Quantity, f64)> = seen
                .iter()
                .zip(vector.iter())
                .filter(|(_, part)| part.powi(2) > SMALLEST_SHARE)
                .map(|(&i, part)| (Quantity::of_column(i, calibration), *part))
                .collect();
            if parts.iter().any(|(quantity, _)| matches!(quantity, Quantity::Nuisance(_))) {
                for (&i, a) in seen.iter().zip(vector.iter()) {
                    for (&j, b) in seen.iter().zip(vector.iter()) {
                        projector[(i, j)] += a * b;
                    }
                }
                exchanges.push(Exchange { parts });
            }
        }
        let lag_and_delay = [Nuisance::ActuatorLag, Nuisance::Delay];
        if calibration.is_without_lag() {
            let part = core::f64::consts::FRAC_1_SQRT_2;
            exchanges.push(Exchange {
                parts: vec![
                    (Quantity::Nuisance(Nuisance::ActuatorLag), part),
                    (Quantity::Nuisance(Nuisance::Delay), -part),
                ],
            });
        }
        let verdict = |column: usize| {
            let nuisance = calibration.nuisances()[column - 10];
            if calibration.is_without_lag() && lag_and_delay.contains(&nuisance) {
                let others = lag_and_delay.into_iter().filter(|other| *other != nuisance);
                return Verdict::NotSeparableFrom(others.map(Quantity::Nuisance).collect());
            }
            if !seen.contains(&column) {
                return Verdict::NotIdentifiable;
            }
            if projector[(column, column)] > SMALLEST_SHARE {
                let others = (0..columns).filter(|&other| {
                    let (here, there) = (projector[(column, column)], projector[(other, other)]);
                    other != column
                        && there > SMALLEST_SHARE
                        && projector[(column, other)].powi(2) > 1e-3 * here * there
                });
                return Verdict::NotSeparableFrom(
                    others.map(|other| Quantity::of_column(other, calibration)).collect(),
                );
            }
            if variance[column].sqrt() > unknown(column) { Verdict::NotIdentifiable } else { Verdict::Identifiable }
        };
        Self { verdicts: (10..columns).map(verdict).collect(), exchanges }
    }

    /// Adds priors, weak ones too where the data determine nothing: what is left undetermined stays where it is expected.
    pub(crate) fn hold(&self, calibration: &Calibration, information: &mut DMatrix<f64>, gradient: &mut DVector<f64>) {
        for (index, verdict) in self.verdicts.iter().enumerate() {
            let (pull, precision) = calibration.pull(index, *verdict != Verdict::Identifiable);
            information[(10 + index, 10 + index)] += precision;
            gradient[10 + index] += pull;
        }
    }
}

/// Factors by which estimating column `index` raises the standard deviations of mass, centre of mass and inertia.
pub(crate) fn inflation(information: &DMatrix<f64>, covariance: &DMatrix<f64>, index: usize) -> [f64; 3] {
    let known = information.clone().remove_row(index).remove_column(index);
    let Some(factor) = known.cholesky() else { return [f64::INFINITY; 3] };
    let known = factor.inverse();
    [0..1, 1..4, 4..10].map(|group| {
        let sum = |of: &DMatrix<f64>| group.clone().map(|i| of[(i, i)]).sum::<f64>();
        (sum(covariance) / sum(&known)).sqrt()
    })
}
