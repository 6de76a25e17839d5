//! From records of a tree's motion to its unknown parts.

use super::base_parameters::BaseParameters;
use super::consistent_links::{ConsistentLinks, LinkPrior, LinksEstimate};
use super::finding::{DynEstimator, DynFinding};
use super::layout::{BODY, LinkNuisance, ParameterLayout, UnknownBody};
use super::link_information::LinkInformation;
use super::momentum_rows::{VelocityNoise, momentum_rows};
use super::torque_rows::{Drive, JointNuisance, torque_rows};
use super::tree_part::{TreePart, completed, known_part};
use super::tree_sample::TreeSample;
use crate::body_scale::BodyScale;
use crate::dynamics::{InertialParameters, Multibody};
use crate::error::IdentificationError;
use crate::estimator::{EstimatorError, StandardDeviations, standard_deviations};
use crate::lie::{LieGroup, Pose, Wrench};
use nalgebra::{DMatrix, DVector, Translation3, Vector6};
use num_traits::AsPrimitive;

/// Passes over the data at most; the fitted velocities and currents settle within a few.
const MAX_PASSES: usize = 100;
/// A pass that changes the fit by less than this share of a standard deviation is the last.
const SETTLED: f64 = 1e-2;
/// Where motion is hardly more than noise, the fit creeps: after all passes this share will do.
const CREEPING: f64 = 0.1;

/// Proven distance from the best consistent bodies, in units of half a chi-square: far below what noise does.
const NEGLIGIBLE_GAP: f64 = 1e-3;

/// One run of a log, and whether the payloads were grasped in it.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeRecord {
    /// In the order of time.
    pub samples: Vec<TreeSample>,
    /// Whether the payloads among the parts were carried.
    pub grasped: bool,
}

/// The momentum form: what the total momentum was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentumForm {
    /// Noise of the measured velocities.
    pub noise: VelocityNoise,
    /// Momentum about the inertial origin at the first sample of each record, inertial axes; `None` where it is not
    /// known (it then is asked for, and the scale of all masses is lost).
    pub known: Option<Wrench<f64>>,
}

/// The torque form: what the motors were.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueForm {
    /// Forces or currents.
    pub drive: Drive,
    /// What each joint has besides.
    pub nuisances: Vec<JointNuisance>,
    /// Standard deviation of each motor's force (N m, N) or current (A); found from the residuals unless given.
    pub std: Option<Vec<f64>>,
    /// Standard deviations of torque and force on the base, where the wrench there is used.
    pub base_wrench_std: Option<(f64, f64)>,
    /// How an asked gain is regressed.
    pub gain_regression: GainRegression,
}

/// Where the noise of a current is taken to be when its gain is asked for.
///
/// The two plain directions bracket the truth: a noisy current as regressor pulls gains towards zero; the errors in
/// variables are the consistent treatment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum GainRegression {
    /// In the currents, which the regressor therefore takes from the fit: consistent.
    #[default]
    ErrorsInVariables,
    /// Ordinary least squares with measured currents as regressors, all rows alike: gains come out too small.
    CurrentAsRegressor,
}

/// What is asked, of which tree.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeEstimator {
    /// The tree: geometry, springs, and the bodies that are known.
    pub tree: Multibody<f64>,
    /// The parts that are not.
    pub parts: Vec<TreePart>,
    /// Momentum balance, if it is to be used.
    pub momentum: Option<MomentumForm>,
    /// Motor and base forces, if they are to be used.
    pub torque: Option<TorqueForm>,
    /// Errors are taken as dependent within stretches of this length, s; zero for independent ones. Friction that the model
    /// does not know is dependent over seconds.
    pub dependence_s: f64,
}

/// The unknown parts of a tree.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeEstimate {
    /// What the data determine, and in words what they do not.
    pub base: BaseParameters,
    /// All unknowns, bodies made of mass, the silent directions from the nominal parts.
    pub links: LinksEstimate,
    /// Standard deviation of each motor's force or current, as given or found; empty without the torque form.
    pub motor_std: Vec<f64>,
    /// Passes over the data.
    pub passes: usize,
    /// Scalar equations.
    pub rows: usize,
    /// Covariance of the determined directions (like units), by blocks of dependent errors.
    determined_covariance: DMatrix<f64>,
}

impl TreeEstimate {
    /// A part as a body; `None` beyond the last.
    pub fn body(&self, part: usize) -> Option<InertialParameters<f64>> {
        self.links.body(part).map(|numbers| InertialParameters::from_vector(&numbers))
    }

    /// Covariance of linear functions of the unknowns, one a row; `None` where the data leave one of them free.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`].
    pub fn covariance_of(&self, functionals: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>, IdentificationError> {
        if self.base.covariance_of(functionals)?.is_none() {
            return Ok(None);
        }
        let scaled = functionals * DMatrix::from_diagonal(&self.base.layout().magnitudes()) * self.base.row_space();
        Ok(Some(&scaled * &self.determined_covariance * scaled.transpose()))
    }

    /// The estimate with the covariance of what the data determine.
    ///
    /// # Errors
    /// [`EstimatorError::Refused`] for numbers that are not finite.
    pub fn finding(&self) -> Result<DynFinding, EstimatorError> {
        let layout = self.base.layout();
        let mut point = DVector::zeros(layout.unknowns());
        for body in 0..layout.bodies().len() {
            if let Some(numbers) = self.links.body(body) {
                point.rows_mut(layout.body_column(body), BODY).copy_from(&numbers);
            }
        }
        for nuisance in 0..layout.nuisances().len() {
            point[layout.nuisance_column(nuisance)] = self.links.nuisance(nuisance).unwrap_or_default();
        }
        let covariance = self.determined_covariance.clone();
        DynFinding::try_new(point, self.base.row_space(), covariance, layout.magnitudes())
    }

    /// Standard deviations of a part; `None` where the data leave any of its ten numbers free.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`] for a part that there is not.
    pub fn body_std(&self, part: usize) -> Result<Option<StandardDeviations>, IdentificationError> {
        let layout = self.base.layout();
        let column = layout.body_column(part);
        let ten = DMatrix::from_fn(BODY, layout.unknowns(), |i, j| f64::from(u8::from(j == column + i)));
        let Some(numbers) = self.links.body(part) else {
            return Err(IdentificationError::UnknownCount { given: part, expected: layout.bodies().len() });
        };
        let covariance = self.covariance_of(&ten)?;
        Ok(covariance
            .map(|covariance| standard_deviations(&numbers, &covariance.fixed_view::<BODY, BODY>(0, 0).into_owned())))
    }

    /// Value and standard deviation of a nuisance by its name; `None` where there is none or the data leave it free.
    pub fn nuisance(&self, name: &str) -> Option<(f64, f64)> {
        let layout = self.base.layout();
        let index = layout.nuisances().iter().position(|nuisance| nuisance.name == name)?;
        let column = layout.nuisance_column(index);
        let row = DMatrix::from_fn(1, layout.unknowns(), |_, j| f64::from(u8::from(j == column)));
        let covariance = self.covariance_of(&row).ok()??;
        Some((self.links.nuisance(index)?, covariance[(0, 0)].max(0.0).sqrt()))
    }
}

/// Where the noisy factors of the unknowns come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Regressors {
    /// As measured.
    Measured,
    /// From the balance at the last estimate.
    Fitted,
}

/// Whitened rows of one instant.
pub(super) struct Rows {
    time_s: f64,
    coefficients: DMatrix<f64>,
    rhs: DVector<f64>,
    /// Whitened residual at the unknowns of this pass.
    pub(super) residual: DVector<f64>,
    /// Joint whose motor the row is about.
    pub(super) joints: Vec<Option<usize>>,
    /// What that motor gave, whitened; zero in other rows.
    pub(super) given: DVector<f64>,
}

impl TreeEstimator {
    /// Identifies the parts from all records together.
    ///
    /// # Errors
    /// [`IdentificationError`]: lists that do not fit the tree, numbers that are not finite, no usable rows, fewer instants than
    /// unknowns where the noise of motors is looked for, no convergence.
    pub fn identify(&self, records: &[TreeRecord]) -> Result<TreeEstimate, IdentificationError> {
        for record in records {
            for (index, sample) in record.samples.iter().enumerate() {
                sample.checked(index, &self.tree)?;
            }
        }
        let layout = self.layout(records)?;
        let known = known_part(&self.tree, &self.parts);
        let mut unknowns = self.nominal(&layout);
        let prior = LinkPrior::uniform(&layout, unknowns.as_slice(), 1.0)?;
        let mut motor_std = self.first_motor_std(records);
        // Below a billionth of what the motors give lies rounding: exact data must not be weighted without bound.
        let least_std: Vec<f64> = motor_std.iter().map(|std| 1e-8 * std).collect();
        let mut passes = 0;
        let (base, settled) = loop {
            passes += 1;
            // Fitted velocities and currents need a fit: the first pass takes the measured ones.
            let regressors = if passes == 1 || self.is_plain() { Regressors::Measured } else { Regressors::Fitted };
            let mut information = self.prior_information(&layout, regressors)?;
            let mut squares = vec![(0.0, 0_usize); motor_std.len()];
            self.each_instant(&known, &layout, records, (&unknowns, regressors), &motor_std, &mut |rows| {
                for (row, joint) in rows.joints.iter().enumerate() {
                    if let Some((sum, count)) = joint.and_then(|joint| squares.get_mut(joint)) {
                        *sum += rows.residual[row] * rows.residual[row];
                        *count += 1;
                    }
                }
                information.add_rows(rows.coefficients.transpose().as_slice(), rows.rhs.as_slice())
            })?;
            if information.rows() <= self.prior_rows() {
                return Err(IdentificationError::NoResidual { rows: 0, parameters: layout.unknowns() });
            }
            let base = BaseParameters::new(&information, &layout)?;
            let next = ConsistentLinks::new(&base, &prior)?.least_squares();
            let magnitudes = layout.magnitudes();
            let change = base.row_space().transpose() * (&next - &unknowns).component_div(&magnitudes);
            let change = change.component_mul(&base.singular_values().rows(0, base.rank())).norm();
            unknowns = next;
            let finding_noise = self.finds_noise() && passes > 1;
            let mut noise_change = 0.0_f64;
            if finding_noise {
                // A joint that alone fits every unknown would find its noise to be none.
                let fewest = squares.iter().map(|(_, count)| *count).filter(|count| *count > 0).min().unwrap_or(0);
                if fewest <= base.rank() {
                    return Err(IdentificationError::NoResidual { rows: fewest, parameters: base.rank() });
                }
                for ((std, least), (sum, count)) in motor_std.iter_mut().zip(&least_std).zip(&squares) {
                    let next = (*std * (sum / (*count).max(1) as f64).sqrt()).max(*least);
                    noise_change = noise_change.max((next / *std - 1.0).abs());
                    *std = next;
                }
            }
            let settled = change < SETTLED && noise_change < 1e-4 && passes > 2;
            let one_pass = self.momentum.is_none() && self.is_plain();
            if settled || one_pass {
                break (base, true);
            }
            if passes == MAX_PASSES {
                break (base, change < CREEPING && noise_change < 1e-4);
            }
        };
        if !settled {
            return Err(IdentificationError::NotConverged {
                iterations: passes,
                duality_gap: f64::NAN,
                tolerance: SETTLED,
            });
        }
        let links = ConsistentLinks::new(&base, &prior)?.with_gap_tolerance(NEGLIGIBLE_GAP).solve()?;
        let determined_covariance = self.covariance(&known, &layout, records, &unknowns, &motor_std, &base)?;
        let rows = base.rows();
        Ok(TreeEstimate { base, links, motor_std, passes, rows, determined_covariance })
    }

    pub(super) fn is_plain(&self) -> bool {
        self.torque.as_ref().is_some_and(|torque| torque.gain_regression == GainRegression::CurrentAsRegressor)
    }

    fn finds_noise(&self) -> bool {
        !self.is_plain() && self.torque.as_ref().is_some_and(|torque| torque.std.is_none())
    }

    fn gains(&self) -> &[f64] {
        match &self.torque {
            Some(TorqueForm { drive: Drive::Current { gain, .. }, .. }) => gain,
            _ => &[],
        }
    }

    fn nuisances(&self) -> &[JointNuisance] {
        self.torque.as_ref().map_or(&[], |torque| &torque.nuisances)
    }

    fn unknown_momentum(&self) -> bool {
        self.momentum.is_some_and(|momentum| momentum.known.is_none())
    }

    /// Typical size of the motors' numbers in the records, as forces.
    fn motor_sizes(&self, records: &[TreeRecord]) -> Vec<f64> {
        let joints = self.tree.joints();
        let mut sums = vec![(0.0, 0_usize); joints];
        for motors in records.iter().flat_map(|r| &r.samples).filter_map(|s| s.motors.as_ref()) {
            for ((sum, count), motor) in sums.iter_mut().zip(motors) {
                *sum += motor * motor;
                *count += 1;
            }
        }
        let gain = |joint: usize| self.gains().get(joint).copied().unwrap_or(1.0).abs();
        let size = |(joint, (sum, count)): (usize, &(f64, usize))| {
            let size = gain(joint) * (sum / (*count).max(1) as f64).sqrt();
            if size > 0.0 { size } else { 1.0 }
        };
        sums.iter().enumerate().map(size).collect()
    }

    pub(super) fn layout(&self, records: &[TreeRecord]) -> Result<ParameterLayout, IdentificationError> {
        let bodies = self.parts.iter().map(|part| {
            let scale = BodyScale::of(&part.nominal.to_vector())?;
            Ok(UnknownBody { name: part.name.clone(), scale })
        });
        let bodies = bodies.collect::<Result<Vec<_>, IdentificationError>>()?;
        let sizes = self.motor_sizes(records);
        let mut nuisances = Vec::new();
        for nuisance in self.nuisances() {
            for (joint, size) in sizes.iter().enumerate() {
                nuisances.push(LinkNuisance {
                    name: format!("{} of joint {}", nuisance.name(), joint + 1),
                    unit: nuisance.unit().into(),
                    magnitude: *size,
                    lower_bound: nuisance.is_positive().then_some(0.0),
                });
            }
        }
        for (joint, gain) in self.gains().iter().enumerate() {
            nuisances.push(LinkNuisance {
                name: format!("drive gain of joint {}", joint + 1),
                unit: "N m/A".into(),
                magnitude: gain.abs(),
                lower_bound: Some(0.0),
            });
        }
        if self.unknown_momentum() {
            let mass = self.tree.mass();
            for record in 0..records.len() {
                for (half, unit) in [("angular", "N m s"), ("linear", "N s")] {
                    for axis in ["x", "y", "z"] {
                        let name = format!("{half} momentum {axis} of record {}", record + 1);
                        nuisances.push(LinkNuisance { name, unit: unit.into(), magnitude: mass, lower_bound: None });
                    }
                }
            }
        }
        ParameterLayout::try_new(bodies, nuisances)
    }

    /// Nominal bodies and gains, no friction, no momentum.
    fn nominal(&self, layout: &ParameterLayout) -> DVector<f64> {
        let mut unknowns = DVector::zeros(layout.unknowns());
        for (k, part) in self.parts.iter().enumerate() {
            unknowns.rows_mut(layout.body_column(k), BODY).copy_from(&part.nominal.to_vector());
        }
        let first_gain = self.gain_column(layout);
        for (joint, gain) in self.gains().iter().enumerate() {
            unknowns[first_gain + joint] = *gain;
        }
        unknowns
    }

    fn gain_column(&self, layout: &ParameterLayout) -> usize {
        layout.nuisance_column(self.nuisances().len() * self.tree.joints())
    }

    fn momentum_column(&self, layout: &ParameterLayout, record: usize) -> usize {
        self.gain_column(layout) + self.gains().len() + 6 * record
    }

    /// Gains known to some accuracy and parts that were weighed.
    fn prior_information(
        &self,
        layout: &ParameterLayout,
        regressors: Regressors,
    ) -> Result<LinkInformation, IdentificationError> {
        let mut information = LinkInformation::new(layout.unknowns());
        let mut add = |column: usize, value: f64, std: f64| {
            let mut row = vec![0.0; layout.unknowns()];
            row[column] = 1.0 / std;
            information.add_rows(&row, &[value / std])
        };
        if let Some(TorqueForm { drive: Drive::Current { gain, std }, .. }) = &self.torque {
            for (joint, (gain, std)) in gain.iter().zip(std).enumerate().filter(|(_, (_, std))| std.is_finite()) {
                add(self.gain_column(layout) + joint, *gain, std.max(1e-9 * gain.abs()))?;
            }
        }
        for (k, part) in self.parts.iter().enumerate() {
            if let Some((mass_kg, std_kg)) = part.weighed_kg {
                // least squares would rather shrink every gain than keep a mass that may give way: it is then held
                let std_kg = if regressors == Regressors::Measured { 1e-6 * mass_kg } else { std_kg };
                add(layout.body_column(k), mass_kg, std_kg)?;
            }
        }
        Ok(information)
    }

    fn prior_rows(&self) -> usize {
        let weighed = self.parts.iter().filter(|part| part.weighed_kg.is_some()).count();
        let gains = match &self.torque {
            Some(TorqueForm { drive: Drive::Current { std, .. }, .. }) => std.iter().filter(|s| s.is_finite()).count(),
            _ => 0,
        };
        weighed + gains
    }

    fn first_motor_std(&self, records: &[TreeRecord]) -> Vec<f64> {
        match &self.torque {
            None => Vec::new(),
            Some(_) if self.is_plain() => vec![1.0; self.tree.joints()],
            Some(torque) => torque.std.clone().unwrap_or_else(|| {
                let sizes = self.motor_sizes(records);
                let gain = |joint: usize| self.gains().get(joint).copied().unwrap_or(1.0).abs();
                sizes.iter().enumerate().map(|(joint, size)| 0.1 * size / gain(joint)).collect()
            }),
        }
    }

    /// Calls `visit` with the whitened rows of each instant, at these unknowns.
    pub(super) fn each_instant(
        &self,
        known: &Multibody<f64>,
        layout: &ParameterLayout,
        records: &[TreeRecord],
        (unknowns, regressors): (&DVector<f64>, Regressors),
        motor_std: &[f64],
        visit: &mut dyn FnMut(Rows) -> Result<(), IdentificationError>,
    ) -> Result<(), IdentificationError> {
        for (index, record) in records.iter().enumerate() {
            if let Some(torque) = &self.torque {
                for sample in &record.samples {
                    if let Some(rows) =
                        self.torque_instant(torque, known, layout, record, sample, (unknowns, regressors), motor_std)?
                    {
                        visit(rows)?;
                    }
                }
            }
            if let Some(form) = &self.momentum {
                self.momentum_instants(form, known, layout, (index, record), (unknowns, regressors), visit)?;
            }
        }
        Ok(())
    }

    #[allow(clippy::too_many_arguments, reason = "one instant needs all of the pass")]
    fn torque_instant(
        &self,
        torque: &TorqueForm,
        known: &Multibody<f64>,
        layout: &ParameterLayout,
        record: &TreeRecord,
        sample: &TreeSample,
        (unknowns, regressors): (&DVector<f64>, Regressors),
        motor_std: &[f64],
    ) -> Result<Option<Rows>, IdentificationError> {
        let found = torque_rows(known, &self.parts, record.grasped, &torque.nuisances, sample)?;
        let Some(found) = found else { return Ok(None) };
        let joints = self.tree.joints();
        let motors = sample.motors.as_deref().unwrap_or(&[]);
        let base_rows = found.base.as_ref().filter(|_| torque.base_wrench_std.is_some());
        let count = motors.len() + base_rows.map_or(0, |_| 6);
        let width = found.joints.ncols();
        let mut rows = Rows {
            time_s: sample.time_s,
            coefficients: DMatrix::zeros(count, layout.unknowns()),
            rhs: DVector::zeros(count),
            residual: DVector::zeros(count),
            joints: vec![None; count],
            given: DVector::zeros(count),
        };
        let gain_column = self.gain_column(layout);
        for (joint, motor) in motors.iter().enumerate().take(joints) {
            rows.joints[joint] = Some(joint);
            let mut row = rows.coefficients.row_mut(joint);
            row.columns_mut(0, width).copy_from(&found.joints.row(joint));
            let fitted = (found.joints.row(joint) * unknowns.rows(0, width))[0] + found.known[joint];
            let (rhs, residual, std) = match (&torque.drive, regressors) {
                (Drive::Force, _) => (motor - found.known[joint], fitted - motor, motor_std[joint]),
                (Drive::Current { .. }, Regressors::Fitted) => {
                    let gain = unknowns[gain_column + joint];
                    let fitted_current = fitted / gain;
                    row[gain_column + joint] = -fitted_current;
                    // K i - fitted, linearised about the fitted current
                    let rhs = gain * (motor - fitted_current) - found.known[joint];
                    (rhs, fitted - gain * motor, gain.abs() * motor_std[joint])
                }
                (Drive::Current { .. }, Regressors::Measured) => {
                    row[gain_column + joint] = -motor;
                    let gain = unknowns[gain_column + joint];
                    let std = if self.is_plain() { 1.0 } else { gain.abs() * motor_std[joint] };
                    (-found.known[joint], fitted - gain * motor, std)
                }
            };
            row /= std;
            rows.rhs[joint] = rhs / std;
            rows.residual[joint] = residual / std;
            rows.given[joint] = match &torque.drive {
                Drive::Force => motor / std,
                Drive::Current { .. } => unknowns[gain_column + joint] * motor / std,
            };
        }
        if let (Some((base, right)), Some((torque_std, force_std))) = (base_rows, torque.base_wrench_std) {
            for k in 0..6 {
                let std = if k < 3 { torque_std } else { force_std };
                let at = motors.len() + k;
                rows.coefficients.row_mut(at).columns_mut(0, width).copy_from(&(base.row(k) / std));
                rows.rhs[at] = right[k] / std;
                rows.residual[at] = ((base.row(k) * unknowns.rows(0, width))[0] - right[k]) / std;
            }
        }
        Ok(Some(rows))
    }

    fn momentum_instants(
        &self,
        form: &MomentumForm,
        known: &Multibody<f64>,
        layout: &ParameterLayout,
        (index, record): (usize, &TreeRecord),
        (unknowns, regressors): (&DVector<f64>, Regressors),
        visit: &mut dyn FnMut(Rows) -> Result<(), IdentificationError>,
    ) -> Result<(), IdentificationError> {
        let Some(first) = record.samples.first() else { return Ok(()) };
        // About a point near the robot, where noise of the velocity has a short arm.
        let near = Pose::from_parts(Translation3::from(-first.world_from_base.translation.vector), nalgebra::one());
        let numbers = unknowns.rows(0, BODY * self.parts.len()).into_owned();
        let estimate = completed(known, &self.parts, numbers.as_slice(), record.grasped);
        let column = self.momentum_column(layout, index);
        let start = match form.known {
            Some(known) => known.transformed_by(&near),
            None => Wrench::from(Vector6::from_iterator(unknowns.rows(column, 6).iter().copied())),
        };
        let mut impulse = Wrench::zero();
        let mut previous: Option<&TreeSample> = None;
        for sample in &record.samples {
            if let Some(before) = previous {
                impulse += impulse_between(before, sample, &near);
            }
            previous = Some(sample);
            let near_from_base = near * sample.world_from_base;
            let found = momentum_rows(
                &estimate,
                (&self.parts, numbers.as_slice()),
                record.grasped,
                sample,
                (&near_from_base, &form.noise),
                &(start + impulse),
                regressors == Regressors::Fitted,
            )?;
            let mut coefficients = DMatrix::zeros(6, layout.unknowns());
            coefficients.columns_mut(0, numbers.len()).copy_from(&found.regressor);
            let mut rhs = DVector::from_column_slice(found.right.as_slice());
            if form.known.is_none() {
                coefficients.columns_mut(column, 6).copy_from(&found.constant);
                rhs += found.constant * unknowns.rows(column, 6);
            }
            let residual = DVector::from_column_slice(found.residual.as_slice());
            let given = DVector::zeros(6);
            visit(Rows { time_s: sample.time_s, coefficients, rhs, residual, joints: vec![None; 6], given })?;
        }
        Ok(())
    }

    /// Covariance of the determined directions in like units: the sandwich over stretches of dependent errors.
    fn covariance(
        &self,
        known: &Multibody<f64>,
        layout: &ParameterLayout,
        records: &[TreeRecord],
        unknowns: &DVector<f64>,
        motor_std: &[f64],
        base: &BaseParameters,
    ) -> Result<DMatrix<f64>, IdentificationError> {
        let inverse = base.singular_values().rows(0, base.rank()).map(|value| 1.0 / value);
        if self.dependence_s <= 0.0 {
            return Ok(DMatrix::from_diagonal(&inverse.component_mul(&inverse)));
        }
        let space = base.row_space();
        let magnitudes = layout.magnitudes();
        let mut middle = DMatrix::zeros(base.rank(), base.rank());
        let regressors = if self.is_plain() { Regressors::Measured } else { Regressors::Fitted };
        let mut stretch: Option<i64> = None;
        let mut score = DVector::zeros(layout.unknowns());
        let mut stretches = 0_usize;
        let mut close = |score: &mut DVector<f64>| {
            let projected = space.transpose() * score.component_mul(&magnitudes);
            middle.ger(1.0, &projected, &projected, 1.0);
            score.fill(0.0);
            stretches += 1;
        };
        self.each_instant(known, layout, records, (unknowns, regressors), motor_std, &mut |rows| {
            let own: i64 = (rows.time_s / self.dependence_s).floor().as_();
            if stretch.is_some_and(|stretch| stretch != own) {
                close(&mut score);
            }
            stretch = Some(own);
            score += rows.coefficients.transpose() * &rows.residual;
            Ok(())
        })?;
        close(&mut score);
        // What the prior rows say enters as its own score would on average.
        let prior = self.prior_information(layout, regressors)?;
        let prior_rows = prior.factor() * DMatrix::from_diagonal(&magnitudes) * &space;
        middle += prior_rows.transpose() * prior_rows;
        let correction = stretches as f64 / (stretches.max(2) - 1) as f64;
        let bread = DMatrix::from_diagonal(&inverse.component_mul(&inverse));
        Ok(&bread * middle * bread * correction)
    }
}

/// What acts on the tree between two samples, about the inertial origin of `near`: the held wrench, at the middle pose.
fn impulse_between(before: &TreeSample, sample: &TreeSample, near: &Pose<f64>) -> Wrench<f64> {
    let step_s = sample.time_s - before.time_s;
    let middle = before.world_from_base.interpolate(&sample.world_from_base, 0.5);
    before.base_wrench.map_or(Wrench::zero(), |wrench| wrench.transformed_by(&(near * middle)) * step_s)
}

impl DynEstimator for TreeEstimator {
    type Record = [TreeRecord];

    fn estimate(&self, records: &[TreeRecord]) -> Result<DynFinding, EstimatorError> {
        self.identify(records)?.finding()
    }
}
