//! Bodies made of mass that explain the data as well as any, and are near a prior where the data are silent.

use super::base_parameters::BaseParameters;
use super::cone_program::{ConeProgram, ConeSolution, body_of, set_body};
use super::layout::{BODY, ParameterLayout};
use super::link_information::LinkInformation;
use super::reflections::{back_substitute, back_substitute_transposed, fold};
use crate::consistency::{FeasibleSet, PseudoInertiaCone, pulled_inside};
use crate::error::IdentificationError;
use core::f64::consts::FRAC_1_SQRT_2;
use nalgebra::{DMatrix, DVector, SVector};

/// Relative floor of each pseudo-inertia when none is asked for, as that of a single body.
const DEFAULT_FLOOR: f64 = 1e-6;

/// Weight of the prior beside the data where a constraint makes them meet.
const DEFAULT_PRIOR_WEIGHT: f64 = 1e-6;

/// Duality gap at which a solution is accepted, in units of half a chi-square.
const DEFAULT_GAP: f64 = 1e-7;

/// Squared part of an unknown's axis in undetermined directions below which data alone speak, and above one minus which
/// the prior alone.
const PURE: f64 = 1e-9;

/// What was believed of the unknowns before the data.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkPrior {
    nominal: DVector<f64>,
    /// In like units.
    deviations: DVector<f64>,
}

impl LinkPrior {
    /// Nominal values, SI, and how far each may be off, as a fraction of its [magnitude](ParameterLayout::magnitudes).
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`], [`IdentificationError::NotFinite`], [`IdentificationError::NotPositive`].
    pub fn try_new(
        layout: &ParameterLayout,
        nominal: &[f64],
        relative_deviations: &[f64],
    ) -> Result<Self, IdentificationError> {
        layout.require_length(nominal.len())?;
        layout.require_length(relative_deviations.len())?;
        if let Some(row) = nominal.iter().position(|value| !value.is_finite()) {
            return Err(IdentificationError::NotFinite { row });
        }
        let usable = |value: f64| value.is_finite() && value > 0.0;
        if let Some((index, &value)) = relative_deviations.iter().enumerate().find(|(_, value)| !usable(**value)) {
            return Err(IdentificationError::NotPositive { index, value });
        }
        Ok(Self {
            nominal: DVector::from_column_slice(nominal),
            deviations: DVector::from_column_slice(relative_deviations),
        })
    }

    /// The same fraction for all.
    ///
    /// # Errors
    /// As [`try_new`](Self::try_new).
    pub fn uniform(
        layout: &ParameterLayout,
        nominal: &[f64],
        relative_deviation: f64,
    ) -> Result<Self, IdentificationError> {
        Self::try_new(layout, nominal, &vec![relative_deviation; layout.unknowns()])
    }
}

#[cfg(feature = "testing")]
impl LinkPrior {
    /// What the prior is overruled by at unknowns in like units: its ½ χ² above the least at their determined part.
    pub(crate) fn conditional_misfit(&self, base: &BaseParameters, scaled: &DVector<f64>) -> f64 {
        ConditionalPrior::new(base, self).misfit(scaled)
    }
}

/// Least squares over all bodies at once, each a body made of mass, each bounded nuisance above its bound.
///
/// Minimises ½|R x − z|² + ½ w |W (b − b̂(a))|²: a is what the data determine, b what they leave, b̂(a) the prior's most
/// probable b at that a, W its conditional square-root information. At the b that it likes best the prior costs nothing,
/// whatever a is: where no constraint binds, the answer is the least-squares a and the prior's b, for every weight w. Where
/// a constraint makes both meet, the prior moves the determined part by at most √(2 w d) standard deviations, d being the
/// prior's misfit ½|W (b − b̂(a))|² at the best consistent fit.
///
/// # Source
/// Thesis (5.34)-(5.38), one linear matrix inequality for each link.
#[derive(Debug, Clone, Copy)]
pub struct ConsistentLinks<'a> {
    base: &'a BaseParameters,
    prior: &'a LinkPrior,
    relative_floor: f64,
    prior_weight: f64,
    gap_tolerance: f64,
}

/// Bodies and nuisances, all strictly inside their constraints, with the proof of their quality.
#[derive(Debug, Clone, PartialEq)]
pub struct LinksEstimate {
    /// The unknowns, SI, in the order of the layout.
    pub unknowns: DVector<f64>,
    /// Smallest eigenvalue of each body's pseudo-inertia above the floor, free of units, see [`PseudoInertiaCone`].
    pub margins: Vec<f64>,
    /// What each body's constraint costs: half a chi-square for each unit of [`margins`](Self::margins); zero where free.
    pub body_multipliers: Vec<f64>,
    /// The same for each nuisance, for each magnitude of distance from its bound.
    pub nuisance_multipliers: Vec<f64>,
    /// Price of consistency: ½|R x − z|² above its least, in units of half a chi-square.
    pub misfit: f64,
    /// What the prior was overruled by: its ½ χ² above the least at this determined part, not weighted.
    pub prior_misfit: f64,
    /// Proven bound on `misfit + weight · prior_misfit` above its least; zero where nothing binds.
    pub duality_gap: f64,
    /// Iterations; zero where no constraint binds.
    pub iterations: usize,
    /// Squared part of each unknown's axis in undetermined directions.
    pub prior_shares: Vec<f64>,
}

/// Where the value of an unknown comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The data determine it.
    Data,
    /// The data determine combinations of it with others; the prior shares them out.
    Both,
    /// The data say nothing of it.
    Prior,
}

impl LinksEstimate {
    /// Whether a constraint cut off the unconstrained answer.
    pub fn is_active(&self) -> bool {
        self.iterations > 0
    }

    /// Ten numbers of a body, Newton-Euler order, about its origin; `None` beyond the last.
    pub fn body(&self, body: usize) -> Option<SVector<f64, 10>> {
        (body < self.margins.len()).then(|| SVector::from(body_of(&self.unknowns, body)))
    }

    /// Value of a nuisance; `None` beyond the last.
    pub fn nuisance(&self, nuisance: usize) -> Option<f64> {
        self.unknowns.get(BODY * self.margins.len() + nuisance).copied()
    }

    /// Whether a body lies on its floor: its constraint costs more than its margin could make good.
    pub fn is_at_floor(&self, body: usize) -> bool {
        self.margins.get(body).zip(self.body_multipliers.get(body)).is_some_and(|(margin, price)| price > margin)
    }

    /// Where an unknown's value comes from; `None` beyond the last.
    ///
    /// Where a body lies on its floor, consistency has a part in it besides.
    pub fn origin(&self, column: usize) -> Option<Origin> {
        let share = *self.prior_shares.get(column)?;
        Some(if share <= PURE {
            Origin::Data
        } else if share >= 1.0 - PURE {
            Origin::Prior
        } else {
            Origin::Both
        })
    }
}

impl<'a> ConsistentLinks<'a> {
    /// With a floor of 1e-6, weight 1e-6 of the prior where it meets the data, and a duality gap of 1e-7.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`] where the prior is of another layout.
    pub fn new(base: &'a BaseParameters, prior: &'a LinkPrior) -> Result<Self, IdentificationError> {
        base.layout().require_length(prior.nominal.len())?;
        let (relative_floor, prior_weight) = (DEFAULT_FLOOR, DEFAULT_PRIOR_WEIGHT);
        Ok(Self { base, prior, relative_floor, prior_weight, gap_tolerance: DEFAULT_GAP })
    }

    /// Pseudo-inertia of each body above this fraction of diag(mℓ², mℓ², mℓ², m).
    pub fn with_relative_floor(self, relative_floor: f64) -> Self {
        Self { relative_floor, ..self }
    }

    /// Another weight of the prior where it meets the data.
    pub fn with_prior_weight(self, prior_weight: f64) -> Self {
        Self { prior_weight, ..self }
    }

    /// Another duality gap, in units of half a chi-square; one of 1e-10 of the objective is accepted too, or of 1e-8 where rounding
    /// allows for no less, and [`LinksEstimate::duality_gap`] tells what was reached.
    pub fn with_gap_tolerance(self, gap_tolerance: f64) -> Self {
        Self { gap_tolerance, ..self }
    }

    /// The best consistent bodies.
    ///
    /// # Errors
    /// [`IdentificationError::NotConverged`] where the gap is not reached.
    pub fn solve(&self) -> Result<LinksEstimate, IdentificationError> {
        let prior = ConditionalPrior::new(self.base, self.prior);
        let unconstrained = prior.fill(&self.base.scaled_least_squares());
        if self.is_inside(&unconstrained) {
            return Ok(self.estimate(&unconstrained, &prior, None));
        }
        let solution = self.program(&prior)?.solve(self.gap_tolerance)?;
        let scaled = self.scaled_unknowns(&solution.primal);
        Ok(self.estimate(&scaled, &prior, Some(&solution)))
    }

    /// The least-squares answer where the data speak and the prior's where they do not, consistent or not.
    pub(super) fn least_squares(&self) -> DVector<f64> {
        let scaled = ConditionalPrior::new(self.base, self.prior).fill(&self.base.scaled_least_squares());
        scaled.component_mul(&self.layout().magnitudes())
    }

    fn layout(&self) -> &'a ParameterLayout {
        self.base.layout()
    }

    fn cones(&self) -> impl Iterator<Item = PseudoInertiaCone> {
        let floor = self.relative_floor;
        self.layout().bodies().iter().map(move |body| PseudoInertiaCone::with_relative_floor(body.scale, floor))
    }

    /// Columns of the bounded nuisances and their bounds in like units.
    fn bounds(&self) -> impl Iterator<Item = (usize, f64)> {
        let layout = self.layout();
        layout.nuisances().iter().enumerate().filter_map(|(index, nuisance)| {
            Some((layout.nuisance_column(index), nuisance.lower_bound? / nuisance.magnitude))
        })
    }

    fn is_inside(&self, scaled: &DVector<f64>) -> bool {
        self.margins(scaled).into_iter().all(|margin| margin > 0.0)
            && self.bounds().all(|(column, bound)| scaled[column] >= bound)
    }

    fn margins(&self, scaled: &DVector<f64>) -> Vec<f64> {
        let margin = |(body, cone): (usize, PseudoInertiaCone)| cone.margin(&parameters_of(scaled, body, &cone));
        self.cones().enumerate().map(margin).collect()
    }

    /// The problem in the unknowns X of P(p) = floor + D X D, and in distances from bounds.
    fn program(&self, prior: &ConditionalPrior) -> Result<ConeProgram, IdentificationError> {
        let unknowns = self.layout().unknowns();
        let (data, rhs) = self.base.determined_rows();
        let weight = self.prior_weight.sqrt();
        let mut rows = DMatrix::zeros(unknowns, unknowns);
        let mut outputs = DVector::zeros(unknowns);
        let rank = rhs.len();
        rows.rows_mut(0, rank).copy_from(&data);
        rows.rows_mut(rank, unknowns - rank).copy_from(&(&prior.rows * weight));
        outputs.rows_mut(0, rank).copy_from(rhs);
        outputs.rows_mut(rank, unknowns - rank).copy_from(&(&prior.outputs * weight));
        outputs -= &rows * self.scaled_unknowns_at_limits();
        let mut coefficients = Vec::with_capacity(unknowns * unknowns);
        for row in rows.row_iter() {
            let mut row = row.transpose();
            for body in 0..self.layout().bodies().len() {
                let normalized = normalized_row(&body_of(&row, body));
                set_body(&mut row, body, &normalized);
            }
            coefficients.extend_from_slice(row.as_slice());
        }
        let mut information = LinkInformation::new(unknowns);
        information.add_rows(&coefficients, outputs.as_slice())?;
        let bounded = self.bounds().map(|(column, _)| column).collect();
        Ok(ConeProgram { information, bodies: self.layout().bodies().len(), bounded })
    }

    /// Floors and bounds in like units; zero for what is free.
    fn scaled_unknowns_at_limits(&self) -> DVector<f64> {
        let mut limits = DVector::zeros(self.layout().unknowns());
        for (body, cone) in self.cones().enumerate() {
            let floor = cone.floor_parameters().component_div(&cone.magnitudes());
            set_body(&mut limits, body, &floor.data.0[0]);
        }
        for (column, bound) in self.bounds() {
            limits[column] = bound;
        }
        limits
    }

    /// Unknowns in like units, bodies strictly inside: an interior iterate can round onto the boundary.
    fn scaled_unknowns(&self, primal: &DVector<f64>) -> DVector<f64> {
        let mut scaled = primal.clone();
        for body in 0..self.layout().bodies().len() {
            let parameters = scaled_parameters(&body_of(primal, body));
            set_body(&mut scaled, body, &parameters);
        }
        scaled += self.scaled_unknowns_at_limits();
        for (body, cone) in self.cones().enumerate() {
            let (inside, _) = pulled_inside(&cone, parameters_of(&scaled, body, &cone));
            set_body(&mut scaled, body, &inside.component_div(&cone.magnitudes()).data.0[0]);
        }
        scaled
    }

    fn estimate(
        &self,
        scaled: &DVector<f64>,
        prior: &ConditionalPrior,
        solution: Option<&ConeSolution>,
    ) -> LinksEstimate {
        let layout = self.layout();
        let multiplier = |column: usize| solution.map_or(0.0, |solution| solution.dual[column]);
        let trace = |body: usize| [0, 4, 7, 9].map(|k| multiplier(layout.body_column(body) + k)).iter().sum();
        LinksEstimate {
            margins: self.margins(scaled),
            body_multipliers: (0..layout.bodies().len()).map(trace).collect(),
            nuisance_multipliers: (0..layout.nuisances().len())
                .map(|index| multiplier(layout.nuisance_column(index)))
                .collect(),
            misfit: solution.map_or(0.0, |_| self.base.scaled_misfit(scaled)),
            prior_misfit: solution.map_or(0.0, |_| prior.misfit(scaled)),
            duality_gap: solution.map_or(0.0, |solution| solution.duality_gap),
            iterations: solution.map_or(0, |solution| solution.iterations),
            prior_shares: self.base.null_space().row_iter().map(|row| row.norm_squared()).collect(),
            unknowns: scaled.component_mul(&layout.magnitudes()),
        }
    }
}

/// What the prior says of the undetermined part, the determined part given: ½|rows · y − outputs|², y in like units.
struct ConditionalPrior {
    rows: DMatrix<f64>,
    outputs: DVector<f64>,
    /// Orthonormal basis of the undetermined part, and the triangle of `rows` in it.
    null_space: DMatrix<f64>,
    factor: DMatrix<f64>,
}

impl ConditionalPrior {
    /// With T = diag(1 / σ), N the basis and T N = Q C: the gradient in N vanishes where Qᵀ T (y − y₀) does.
    fn new(base: &BaseParameters, prior: &LinkPrior) -> Self {
        let null_space = base.null_space();
        let precision = DMatrix::from_diagonal(&prior.deviations.map(f64::recip));
        let weighted = &precision * &null_space;
        let mut factor = DMatrix::zeros(null_space.ncols(), null_space.ncols());
        fold(&mut factor, weighted.clone());
        // Qᵀ T = C⁻ᵀ Nᵀ T².
        let mut rows = weighted.transpose() * precision;
        for mut column in rows.column_iter_mut() {
            let solved = back_substitute_transposed(&factor, column.clone_owned());
            column.copy_from(&solved);
        }
        let nominal = prior.nominal.component_div(&base.layout().magnitudes());
        let outputs = &rows * nominal;
        Self { rows, outputs, null_space, factor }
    }

    /// Adds to the determined part the most probable undetermined one.
    fn fill(&self, determined: &DVector<f64>) -> DVector<f64> {
        let missing = back_substitute(&self.factor, &self.outputs - &self.rows * determined);
        determined + &self.null_space * missing
    }

    fn misfit(&self, scaled: &DVector<f64>) -> f64 {
        0.5 * (&self.rows * scaled - &self.outputs).norm_squared()
    }
}

/// Ten numbers of a body, SI, from unknowns in like units.
fn parameters_of(scaled: &DVector<f64>, body: usize, cone: &PseudoInertiaCone) -> SVector<f64, BODY> {
    SVector::from(body_of(scaled, body)).component_mul(&cone.magnitudes())
}

/// Like units of a body from svec(X) over [1, x, y, z].
fn scaled_parameters(x: &[f64; BODY]) -> [f64; BODY] {
    let h = FRAC_1_SQRT_2;
    let (yy_zz, xx_zz, xx_yy) = (x[7] + x[9], x[4] + x[9], x[4] + x[7]);
    [x[0], h * x[1], h * x[2], h * x[3], yy_zz, -h * x[5], -h * x[6], xx_zz, -h * x[8], xx_yy]
}

/// The row on svec(X) that a row on like units becomes: the transpose of [`scaled_parameters`].
fn normalized_row(row: &[f64; BODY]) -> [f64; BODY] {
    let h = FRAC_1_SQRT_2;
    let (xx, yy, zz) = (row[7] + row[9], row[4] + row[9], row[4] + row[7]);
    [row[0], h * row[1], h * row[2], h * row[3], xx, -h * row[5], -h * row[6], yy, -h * row[8], zz]
}
