//! What the logged wrench is made of, and how each part of it may be off.

use crate::error::IdentificationError;
use nalgebra::Vector3;

/// One standard deviation of the scale of a thruster of which nothing is known.
const FREE: f64 = 1.0;

/// A thruster whose scale is further from one than this, in standard deviations, is a suspect.
pub(super) const SUSPECT: f64 = 4.0;

/// Torque and force along each axis, an amount each.
pub(super) const AXES: usize = 6;

/// A wrench per amount that a parameter adds to the logged one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Term {
    /// The parameter, and the amount of a sample that it takes.
    pub(super) parameter: usize,
    pub(super) amount: usize,
    pub(super) torque: Vector3<f64>,
    pub(super) force: Vector3<f64>,
}

impl Term {
    fn along(parameter: usize, amount: usize, axis: usize) -> Self {
        let unit = |from: usize| Vector3::from_fn(|i, _| if from + i == axis { 1.0 } else { 0.0 });
        Self { parameter, amount, torque: unit(0), force: unit(3) }
    }

    /// The same of a body that a table carries: what it takes up is no part of the wrench.
    pub(super) fn in_plane(mut self) -> Self {
        (self.torque.x, self.torque.y, self.force.z) = (0.0, 0.0, 0.0);
        self
    }

    pub(super) fn acts(&self) -> bool {
        self.torque != Vector3::zeros() || self.force != Vector3::zeros()
    }
}

/// Thrusts behind the logged wrench, whose scales may be off: each by itself, all alike, and each the more the more others are open.
#[derive(Clone, Debug, PartialEq)]
pub struct Thrusters {
    pub(super) terms: Vec<Term>,
    /// One standard deviation of each parameter: scales of thrusters, then the common one, then the sag.
    pub(super) sigma: Vec<f64>,
    /// Amounts in the order of the samples, all of one sample together: thrusts, then wrenches.
    amounts: Vec<f64>,
    /// Amounts of a sample.
    pub(super) width: usize,
    count: usize,
    pub(super) common: Option<usize>,
    pub(super) sag: Option<usize>,
    /// Parameters of thrusts that do not follow the command, and their thrusters.
    pub(super) constant: Vec<(usize, usize)>,
    /// What the body has lost by each sample, kg; empty where nothing.
    spent_kg: Vec<f64>,
}

impl Thrusters {
    /// Thrusters with these wrenches per thrust `[torque; force]` (m and 1, body axes, about the origin), relative errors of thrust with
    /// standard deviations `scale_sigma`, and the thrusts that the logged wrench is made of (N, over the step that begins at each sample):
    /// `thrusts[sample * thrusters + thruster]`.
    ///
    /// # Errors
    /// [`IdentificationError::RecordShape`] where the thrusts do not fill samples or the errors are not one per thruster;
    /// [`IdentificationError::ImpossibleSensing`] for numbers that are not finite or an error that is negative.
    pub fn try_new(
        wrench_per_thrust: &[[f64; 6]],
        scale_sigma: &[f64],
        thrusts: &[f64],
    ) -> Result<Self, IdentificationError> {
        let n = wrench_per_thrust.len();
        let samples = thrusts.len().checked_div(n).unwrap_or(0);
        if n == 0 || samples * n != thrusts.len() || scale_sigma.len() != n {
            return Err(IdentificationError::RecordShape {
                rows: samples,
                columns: scale_sigma.len(),
                expected_rows: samples,
                expected_columns: n,
            });
        }
        if let Some(value) = wrench_per_thrust.iter().flatten().chain(thrusts).find(|x| !x.is_finite()) {
            return bad("thrust or wrench of a thruster", *value);
        }
        for sigma in scale_sigma {
            check_sigma("standard deviation of a thruster's scale", *sigma)?;
        }
        let term = |(i, w): (usize, &[f64; 6])| Term {
            parameter: i,
            amount: i,
            torque: Vector3::new(w[0], w[1], w[2]),
            force: Vector3::new(w[3], w[4], w[5]),
        };
        Ok(Self {
            terms: wrench_per_thrust.iter().enumerate().map(term).collect(),
            sigma: scale_sigma.to_vec(),
            amounts: thrusts.to_vec(),
            width: n,
            count: n,
            common: None,
            sag: None,
            constant: Vec::new(),
            spent_kg: Vec::new(),
        })
    }

    /// The same where one factor of standard deviation `sigma` is common to all.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] for a standard deviation that is none.
    pub fn with_common_scale(mut self, sigma: f64) -> Result<Self, IdentificationError> {
        check_sigma("standard deviation of the common scale", sigma)?;
        if sigma > 0.0 {
            let wrenches = self.wrenches(|_| 1.0);
            self.common = Some(self.with_wrenches(sigma, &wrenches));
        }
        Ok(self)
    }

    /// The same where thrust falls by a share of standard deviation `sigma` for each further thruster that is open: `further[sample]` says
    /// how many these are, zero where one or none is.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] for numbers that cannot be; [`IdentificationError::RecordShape`] where `further` is not one
    /// number per sample.
    pub fn with_sag(mut self, sigma: f64, further: &[f64]) -> Result<Self, IdentificationError> {
        check_sigma("standard deviation of the sag", sigma)?;
        let samples = self.samples();
        if further.len() != samples {
            return Err(IdentificationError::RecordShape {
                rows: further.len(),
                columns: 1,
                expected_rows: samples,
                expected_columns: 1,
            });
        }
        if let Some(value) = further.iter().find(|x| !(**x >= 0.0 && x.is_finite())) {
            return bad("number of further open thrusters", *value);
        }
        if sigma > 0.0 && further.iter().any(|x| *x > 0.0) {
            let wrenches = self.wrenches(|sample| -further[sample]);
            self.sag = Some(self.with_wrenches(sigma, &wrenches));
        }
        Ok(self)
    }

    /// The same where the body has lost `spent_kg[sample]` of its mass by each sample, everywhere alike.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] for a mass that is negative or not finite; [`IdentificationError::RecordShape`] where it is
    /// not one per sample.
    pub fn with_spent(mut self, spent_kg: &[f64]) -> Result<Self, IdentificationError> {
        let samples = self.samples();
        if spent_kg.len() != samples {
            return Err(IdentificationError::RecordShape {
                rows: spent_kg.len(),
                columns: 1,
                expected_rows: samples,
                expected_columns: 1,
            });
        }
        if let Some(value) = spent_kg.iter().find(|x| !(**x >= 0.0 && x.is_finite())) {
            return bad("propellant spent, kg", *value);
        }
        if spent_kg.iter().any(|x| *x > 0.0) {
            self.spent_kg = spent_kg.to_vec();
        }
        Ok(self)
    }

    pub(super) fn is_spent(&self) -> bool {
        !self.spent_kg.is_empty()
    }

    /// What the body has lost by a sample, kg; none where it loses nothing.
    pub(super) fn spent_kg(&self, sample: usize) -> Option<f64> {
        self.spent_kg.get(sample).copied()
    }

    /// The wrench of all thrusters, sample by sample, times a factor.
    fn wrenches(&self, factor: impl Fn(usize) -> f64) -> Vec<[f64; AXES]> {
        (0..self.samples())
            .map(|sample| {
                let amounts = self.of_sample(sample);
                let (mut torque, mut force) = (Vector3::zeros(), Vector3::zeros());
                for term in self.terms.iter().take(self.count) {
                    torque += term.torque * amounts[term.amount];
                    force += term.force * amounts[term.amount];
                }
                let f = factor(sample);
                core::array::from_fn(|i| f * if i < 3 { torque[i] } else { force[i - 3] })
            })
            .collect()
    }

    /// A parameter that adds these wrenches.
    fn with_wrenches(&mut self, sigma: f64, wrenches: &[[f64; AXES]]) -> usize {
        let parameter = self.sigma.len();
        let amounts = wrenches
            .iter()
            .enumerate()
            .flat_map(|(sample, wrench)| self.of_sample(sample).iter().copied().chain(*wrench).collect::<Vec<f64>>());
        self.amounts = amounts.collect();
        self.terms.extend((0..AXES).map(|axis| Term::along(parameter, self.width + axis, axis)));
        self.width += AXES;
        self.sigma.push(sigma);
        parameter
    }

    pub(super) fn of_sample(&self, sample: usize) -> &[f64] {
        self.amounts.get(sample * self.width..(sample + 1) * self.width).unwrap_or_default()
    }

    pub(super) fn samples(&self) -> usize {
        self.amounts.len() / self.width
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// The same of a part of the record.
    pub(super) fn of_part(&self, samples: &core::ops::Range<usize>) -> Self {
        let amounts = self.amounts.get(samples.start * self.width..samples.end * self.width);
        let spent_kg = self.spent_kg.get(samples.clone()).unwrap_or_default().to_vec();
        Self { amounts: amounts.unwrap_or_default().to_vec(), spent_kg, ..self.clone() }
    }

    /// Takes a suspect's own scale for unknown.
    pub(super) fn free(&mut self, suspect: usize) {
        self.sigma[suspect] = FREE;
    }

    /// Takes a suspect for one that also gives a constant thrust of unknown size, as one that is stuck open does.
    pub(super) fn open(&mut self, suspect: usize) {
        let amounts = (0..self.samples()).flat_map(|sample| self.of_sample(sample).iter().copied().chain([1.0]));
        let amounts = amounts.collect();
        self.with_constant(suspect, self.largest_n());
        self.amounts = amounts;
        self.width += 1;
    }

    fn largest_n(&self) -> f64 {
        let all = (0..self.samples()).flat_map(|sample| self.of_sample(sample).iter().take(self.count));
        all.fold(0.0, |most, thrust| most.max(thrust.abs()))
    }

    /// A constant thrust of a thruster, which takes the amount that follows those of a sample.
    fn with_constant(&mut self, thruster: usize, sigma: f64) {
        let parameter = self.sigma.len();
        self.terms.push(Term { parameter, amount: self.width, ..self.terms[thruster] });
        self.sigma.push(sigma);
        self.constant.push((parameter, thruster));
    }

    /// The parameter of a thruster's constant thrust.
    pub(super) fn constant_of(&self, thruster: usize) -> Option<usize> {
        self.constant.iter().find(|(_, of)| *of == thruster).map(|(parameter, _)| *parameter)
    }

    /// These, without amounts, with every thruster free and open; each constant takes the amount that follows those of a sample, which is one.
    pub(super) fn all_suspect(&self) -> Self {
        let mut all = Self { amounts: Vec::new(), ..self.clone() };
        let largest_n = self.largest_n();
        for thruster in 0..self.count {
            all.free(thruster);
            if self.constant_of(thruster).is_none() {
                all.with_constant(thruster, largest_n);
            }
        }
        all.width += 1;
        all
    }
}

fn bad<T>(what: &'static str, value: f64) -> Result<T, IdentificationError> {
    Err(IdentificationError::ImpossibleSensing { what, value })
}

fn check_sigma(what: &'static str, sigma: f64) -> Result<(), IdentificationError> {
    if sigma >= 0.0 && sigma.is_finite() { Ok(()) } else { bad(what, sigma) }
}

/// These with every gain from the wrench to the wrench and a constant one beside, as more parameters; each takes the amounts of a sample that
/// follow theirs: the wrench's torque and force, and one.
pub(super) fn with_gains(of: Option<&Thrusters>) -> Thrusters {
    let none = Thrusters {
        terms: Vec::new(),
        sigma: Vec::new(),
        amounts: Vec::new(),
        width: 0,
        count: 0,
        common: None,
        sag: None,
        constant: Vec::new(),
        spent_kg: Vec::new(),
    };
    let mut all = of.map_or(none, |of| Thrusters { amounts: Vec::new(), ..of.clone() });
    let first = all.sigma.len();
    for from in 0..=AXES {
        for to in 0..AXES {
            all.terms.push(Term::along(first + AXES * from + to, all.width + from, to));
        }
    }
    all.sigma.extend([1.0; AXES * (AXES + 1)]);
    all.width += AXES + 1;
    all
}

/// A number that was found, and one standard deviation of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundFactor {
    /// Value.
    pub value: f64,
    /// One standard deviation.
    pub std: f64,
}

/// Scales of thrusters.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundThrusters {
    /// Each scale: the thrust is this times what the log says.
    pub scale: Vec<f64>,
    /// One standard deviation of each.
    pub std: Vec<f64>,
    /// By how many standard deviations each is off, judged by the record without its own prior; zero where it is not judged.
    pub deviations: Vec<f64>,
    /// Those that were suspects and are free since, in the order in which they were found.
    pub suspects: Vec<usize>,
    /// Thrust that each gives whatever it is told, N, where that was free: all of it of one that is stuck open.
    pub constant_n: Vec<Option<FoundFactor>>,
    /// Factor common to all, where it was free.
    pub common: Option<FoundFactor>,
    /// Share of thrust lost for each further open thruster, where it was free.
    pub sag: Option<FoundFactor>,
}

impl FoundThrusters {
    /// By errors of the parameters in their order, in units of their amounts; none is judged.
    pub(super) fn beside(told: &Thrusters, error: impl Fn(usize) -> FoundFactor) -> Self {
        let all: Vec<FoundFactor> = (0..told.sigma.len()).map(error).collect();
        let own = all.get(..told.len()).unwrap_or_default();
        let at = |parameter: Option<usize>| all.get(parameter?).copied();
        let mut constant_n = vec![None; own.len()];
        for (parameter, thruster) in &told.constant {
            constant_n[*thruster] = at(Some(*parameter));
        }
        Self {
            scale: own.iter().map(|found| 1.0 + found.value).collect(),
            std: own.iter().map(|found| found.std).collect(),
            deviations: vec![0.0; own.len()],
            suspects: Vec::new(),
            constant_n,
            common: at(told.common).map(|found| FoundFactor { value: 1.0 + found.value, ..found }),
            sag: at(told.sag),
        }
    }

    /// The worst of those that are not free yet, where it is a suspect.
    pub(super) fn worst(&self, freed: &[usize]) -> Option<usize> {
        let worst = (0..self.deviations.len())
            .filter(|i| !freed.contains(i))
            .max_by(|a, b| self.deviations[*a].abs().total_cmp(&self.deviations[*b].abs()))?;
        (self.deviations[worst].abs() > SUSPECT).then_some(worst)
    }
}
