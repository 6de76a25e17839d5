//! Rank, what cannot be told apart, and estimates of what can: from the data alone.

use super::layout::ParameterLayout;
use super::link_information::LinkInformation;
use super::singular_values::SingularValues;
use super::words::{BaseParameter, IndistinguishableChange};
use crate::error::IdentificationError;
use crate::square_root_information::RANK_TOLERANCE;
use nalgebra::{DMatrix, DVector, Matrix3};

/// A combination with more than this fraction of its length in undetermined directions is undetermined.
///
/// The directions themselves are known to rounding over the smallest singular value that counts.
const UNDETERMINED: f64 = 1e-6;

/// Pivots that differ by less are equal, and rounding must not choose between them.
const SAME_PIVOT: f64 = 1e-6;

/// What the rows determine of the unknowns: the base parameters, with covariance; and what they do not.
///
/// Directions are compared in like units, see [`ParameterLayout::magnitudes`]. Nothing here knows of a prior or of
/// physical consistency.
///
/// # Source
/// Base parameters by elimination: the null space of the regressor in reduced row echelon form names, for each dependent
/// column, the independent ones that it repeats.
#[derive(Debug, Clone, PartialEq)]
pub struct BaseParameters {
    layout: ParameterLayout,
    rank: usize,
    singular_values: DVector<f64>,
    /// Right singular vectors, like units; those of the undetermined directions last.
    right: DMatrix<f64>,
    /// Uᵀz of the determined directions.
    projected_rhs: DVector<f64>,
    indistinguishable: Vec<IndistinguishableChange>,
    base: Vec<BaseParameter>,
    residual_sum_of_squares: f64,
    rows: usize,
}

/// A linear function of the unknowns that the data determine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearValue {
    /// Its least-squares estimate.
    pub value: f64,
    /// Its variance, for rows whitened with their true standard deviations.
    pub variance: f64,
}

impl BaseParameters {
    /// Judges `information` with [`RANK_TOLERANCE`], right for exact regressors.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`].
    pub fn new(information: &LinkInformation, layout: &ParameterLayout) -> Result<Self, IdentificationError> {
        Self::with_tolerance(information, layout, RANK_TOLERANCE)
    }

    /// Counts a direction as undetermined below `tolerance` times the strongest: the relative noise of the regressor.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`].
    pub fn with_tolerance(
        information: &LinkInformation,
        layout: &ParameterLayout,
        tolerance: f64,
    ) -> Result<Self, IdentificationError> {
        Self::judged(information, layout, |values| tolerance * values.max())
    }

    /// Counts a direction as undetermined below this signal-to-noise ratio: the inverse of its standard deviation in
    /// units of the body's size. At one, a direction must be known better than the body's size.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`].
    pub fn with_signal_to_noise(
        information: &LinkInformation,
        layout: &ParameterLayout,
        smallest: f64,
    ) -> Result<Self, IdentificationError> {
        Self::judged(information, layout, |values| smallest.max(RANK_TOLERANCE * values.max()))
    }

    fn judged(
        information: &LinkInformation,
        layout: &ParameterLayout,
        smallest: impl Fn(&DVector<f64>) -> f64,
    ) -> Result<Self, IdentificationError> {
        layout.require_length(information.unknowns())?;
        let magnitudes = layout.magnitudes();
        let mut scaled = information.factor().clone();
        for (mut column, size) in scaled.column_iter_mut().zip(magnitudes.iter()) {
            column *= *size;
        }
        let SingularValues { values, right, images } = SingularValues::of(scaled);
        let least = if values.is_empty() { 0.0 } else { smallest(&values) };
        let rank = values.iter().filter(|&&value| value > least).count();
        let mut misfit = information.rhs().clone();
        let projected_rhs = DVector::from_fn(rank, |i, _| images.column(i).dot(information.rhs()) / values[i]);
        for (i, projection) in projected_rhs.iter().enumerate() {
            misfit.axpy(-projection / values[i], &images.column(i), 1.0);
        }
        let mut base = Self {
            layout: layout.clone(),
            rank,
            singular_values: values,
            right,
            projected_rhs,
            indistinguishable: Vec::new(),
            base: Vec::new(),
            residual_sum_of_squares: information.residual_sum_of_squares() + misfit.norm_squared(),
            rows: information.rows(),
        };
        base.put_into_words();
        Ok(base)
    }

    /// Gauss-Jordan elimination with full pivoting among the null directions: singular vectors of equal singular values
    /// are arbitrary mixtures, and a mixture explains nothing. The pivots are the dependent columns.
    fn put_into_words(&mut self) {
        let unknowns = self.layout.unknowns();
        let mut null: Vec<DVector<f64>> = self.null_space().column_iter().map(nalgebra::Matrix::into_owned).collect();
        let mut dependent = Vec::new();
        for row in 0..null.len() {
            let (mut candidate, mut pivot, mut largest) = (row, 0, 0.0_f64);
            // From the last unknown on: where two would do, the outer body's depends on the inner one's.
            for k in (0..unknowns).rev().filter(|k| !dependent.contains(k)) {
                for (i, direction) in null.iter().enumerate().skip(row) {
                    if direction[k].abs() > largest * (1.0 + SAME_PIVOT) {
                        (candidate, pivot, largest) = (i, k, direction[k].abs());
                    }
                }
            }
            dependent.push(pivot);
            null.swap(row, candidate);
            let value = null[row][pivot];
            null[row] /= value;
            let eliminator = null[row].clone();
            for (i, direction) in null.iter_mut().enumerate() {
                if i != row {
                    let weight = direction[pivot];
                    direction.axpy(-weight, &eliminator, 1.0);
                }
            }
        }
        let layout = &self.layout;
        // column_k = −Σ n_j column_j over the independent j, so that x_j carries −n_j x_k with it.
        let independent = (0..unknowns).filter(|column| !dependent.contains(column));
        self.base = independent
            .map(|j| {
                let mut functional = DVector::zeros(unknowns);
                functional[j] = 1.0;
                for (direction, &k) in null.iter().zip(&dependent) {
                    functional[k] = -direction[j];
                }
                BaseParameter::new(layout, &functional, j)
            })
            .collect();
        let mut changes: Vec<(usize, DVector<f64>)> = dependent.into_iter().zip(null).collect();
        changes.sort_by_key(|change| change.0);
        self.indistinguishable =
            changes.iter().map(|(pivot, change)| IndistinguishableChange::new(layout, change, *pivot)).collect();
    }

    /// What the columns mean.
    pub fn layout(&self) -> &ParameterLayout {
        &self.layout
    }

    /// Number of determined directions, and of base parameters.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Singular values in like units, descending: for whitened rows, signal-to-noise ratios.
    pub fn singular_values(&self) -> &DVector<f64> {
        &self.singular_values
    }

    /// Largest over smallest singular value of the determined directions.
    pub fn condition_number(&self) -> f64 {
        match self.rank.checked_sub(1) {
            Some(last) => self.singular_values[0] / self.singular_values[last],
            None => 1.0,
        }
    }

    /// Changes of the unknowns that no measurement notices, each with as few unknowns as possible.
    pub fn indistinguishable_changes(&self) -> &[IndistinguishableChange] {
        &self.indistinguishable
    }

    /// The regrouping: independent unknowns, each with all that hides behind it.
    pub fn base_parameters(&self) -> &[BaseParameter] {
        &self.base
    }

    /// Least-squares estimates of [`base_parameters`](Self::base_parameters), SI.
    pub fn estimates(&self) -> DVector<f64> {
        self.functionals() * self.least_squares()
    }

    /// Covariance of [`estimates`](Self::estimates), SI, for rows whitened with their true standard deviations.
    pub fn covariance(&self) -> DMatrix<f64> {
        let deviations = self.deviations(&self.functionals());
        &deviations * deviations.transpose()
    }

    /// Estimate and variance of `functional`·x; `None` where it is not determined by the data.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`].
    pub fn linear_value(&self, functional: &[f64]) -> Result<Option<LinearValue>, IdentificationError> {
        self.layout.require_length(functional.len())?;
        let row = DMatrix::from_row_slice(1, functional.len(), functional);
        Ok(self
            .covariance_of(&row)?
            .map(|covariance| LinearValue { value: (row * self.least_squares())[0], variance: covariance[(0, 0)] }))
    }

    /// Covariance of several linear functions, one a row; `None` where the data leave one of them free.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`].
    pub fn covariance_of(&self, functionals: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>, IdentificationError> {
        self.layout.require_length(functionals.ncols())?;
        let scaled = functionals * DMatrix::from_diagonal(&self.layout.magnitudes());
        let free = &scaled * self.null_space();
        let determined = |(part, row): (f64, f64)| part <= UNDETERMINED * row;
        let lengths = |a: &DMatrix<f64>| a.row_iter().map(|row| row.norm()).collect::<Vec<f64>>();
        if !lengths(&free).into_iter().zip(lengths(&scaled)).all(determined) {
            return Ok(None);
        }
        let deviations = self.deviations(functionals);
        Ok(Some(&deviations * deviations.transpose()))
    }

    /// Variance of a body's mass, kg²; `None` where the data leave it free.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`] for a body that is none of the layout's.
    pub fn mass_variance(&self, body: usize) -> Result<Option<f64>, IdentificationError> {
        let column = self.column_of(body)?;
        let functional = DMatrix::from_fn(1, self.layout.unknowns(), |_, j| f64::from(u8::from(j == column)));
        Ok(self.covariance_of(&functional)?.map(|covariance| covariance[(0, 0)]))
    }

    /// Covariance of a body's centre of mass h / m, m², linearised at `unknowns`; `None` where the data leave it free.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`] for a body that is none of the layout's or unknowns of another number.
    pub fn center_of_mass_covariance(
        &self,
        body: usize,
        unknowns: &DVector<f64>,
    ) -> Result<Option<Matrix3<f64>>, IdentificationError> {
        self.layout.require_length(unknowns.len())?;
        let column = self.column_of(body)?;
        let mass = unknowns[column];
        let gradient = DMatrix::from_fn(3, unknowns.len(), |i, j| match j.checked_sub(column) {
            Some(0) => -unknowns[column + 1 + i] / (mass * mass),
            Some(k) if k == i + 1 => 1.0 / mass,
            _ => 0.0,
        });
        Ok(self.covariance_of(&gradient)?.map(|covariance| covariance.fixed_view::<3, 3>(0, 0).into_owned()))
    }

    /// Number of scalar rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Least Σ|H x − y|² over all rows.
    pub fn residual_sum_of_squares(&self) -> f64 {
        self.residual_sum_of_squares
    }

    /// Residual sum of squares per degree of freedom: one where the stated standard deviations are right.
    ///
    /// # Errors
    /// [`IdentificationError::NoResidual`] with no more rows than base parameters.
    pub fn residual_variance(&self) -> Result<f64, IdentificationError> {
        if self.rows <= self.rank {
            return Err(IdentificationError::NoResidual { rows: self.rows, parameters: self.rank });
        }
        Ok(self.residual_sum_of_squares / (self.rows - self.rank) as f64)
    }

    /// Orthonormal basis of the determined directions, like units.
    pub(super) fn row_space(&self) -> DMatrix<f64> {
        self.right.columns(0, self.rank).into_owned()
    }

    /// Orthonormal basis of the undetermined directions, like units.
    pub fn null_space(&self) -> DMatrix<f64> {
        self.right.columns(self.rank, self.right.ncols() - self.rank).into_owned()
    }

    /// Determined part of least length of the unknowns in like units.
    pub(super) fn scaled_least_squares(&self) -> DVector<f64> {
        self.row_space() * self.projected_rhs.component_div(&self.singular_values.rows(0, self.rank))
    }

    /// Rows Σ Vᵀ and right-hand side Uᵀz: all that the data determine, unknowns in like units.
    pub(super) fn determined_rows(&self) -> (DMatrix<f64>, &DVector<f64>) {
        let weights = DMatrix::from_diagonal(&self.singular_values.rows(0, self.rank).into_owned());
        (weights * self.row_space().transpose(), &self.projected_rhs)
    }

    /// ½|R x − z|² above its least, unknowns in like units.
    pub(crate) fn scaled_misfit(&self, scaled: &DVector<f64>) -> f64 {
        let (rows, rhs) = self.determined_rows();
        0.5 * (rows * scaled - rhs).norm_squared()
    }

    /// Gradient of [`scaled_misfit`](Self::scaled_misfit).
    #[cfg(feature = "testing")]
    pub(crate) fn misfit_gradient(&self, scaled: &DVector<f64>) -> DVector<f64> {
        let (rows, rhs) = self.determined_rows();
        rows.transpose() * (&rows * scaled - rhs)
    }

    fn least_squares(&self) -> DVector<f64> {
        self.scaled_least_squares().component_mul(&self.layout.magnitudes())
    }

    fn functionals(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.rank, self.layout.unknowns(), |i, j| self.base[i].factors()[j])
    }

    /// A square root of the covariance of linear functions, one a row.
    fn deviations(&self, functionals: &DMatrix<f64>) -> DMatrix<f64> {
        let mut deviations = functionals * DMatrix::from_diagonal(&self.layout.magnitudes()) * self.row_space();
        for (mut column, value) in deviations.column_iter_mut().zip(self.singular_values.iter()) {
            column /= *value;
        }
        deviations
    }

    fn column_of(&self, body: usize) -> Result<usize, IdentificationError> {
        let (column, expected) = (self.layout.body_column(body), self.layout.unknowns());
        if body < self.layout.bodies().len() {
            Ok(column)
        } else {
            Err(IdentificationError::UnknownCount { given: column + super::layout::BODY, expected })
        }
    }
}
