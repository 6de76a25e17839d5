//! Which parameters are unknown, how well they are known, and how the body changes with them.

use super::arrays::{M3, V3};
use super::step::{Body, Direction};
use super::turning::Rotor;
use crate::belief::ModelBelief;
use crate::error::{PlanningError, finite, not_negative, positive};
use crate::local::knowledge::{QUANTITIES, whitened};
use crate::local::model::Knowledge;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use tumble_dynamics::{DynamicsError, InertialParameters, LogCholesky, PARAMETERS};

/// Which inertial parameters are unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BodyParameters {
    /// Mass and the three moments of inertia about the centre of mass, body axes: four, each over its prior standard deviation.
    /// The others are taken for what is believed of them.
    Principal,
    /// Mass, centre of mass and inertia: ten. The coordinates are those of [`LogCholesky`], each over its prior standard
    /// deviation, so that every point is a body.
    Full,
}

/// What is unknown about the actuators. Axes are 0 to 2, body axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Nuisance {
    /// The force on this axis is `1 + s` times the one commanded.
    ForceScale(usize),
    /// The torque about this axis is `1 + s` times the one commanded.
    TorqueScale(usize),
    /// A constant force on this axis, N.
    ForceBias(usize),
    /// A constant torque about this axis, about the body origin, N m.
    TorqueBias(usize),
}

/// Rows of mass and moments of inertia among the ten quantities `[m, c, I_xx, I_xy, I_xz, I_yy, I_yz, I_zz]`.
const PRINCIPAL: [usize; 4] = [0, 4, 7, 9];

impl BodyParameters {
    /// How many.
    pub fn count(self) -> usize {
        match self {
            Self::Principal => PRINCIPAL.len(),
            Self::Full => PARAMETERS,
        }
    }
}

impl Nuisance {
    fn axis(self) -> usize {
        match self {
            Self::ForceScale(axis) | Self::TorqueScale(axis) | Self::ForceBias(axis) | Self::TorqueBias(axis) => axis,
        }
    }

    fn name_and_unit(self) -> (&'static str, &'static str) {
        let (names, unit) = match self {
            Self::ForceScale(_) => (["force scale x", "force scale y", "force scale z"], "1"),
            Self::TorqueScale(_) => (["torque scale x", "torque scale y", "torque scale z"], "1"),
            Self::ForceBias(_) => (["force bias x", "force bias y", "force bias z"], "N"),
            Self::TorqueBias(_) => (["torque bias x", "torque bias y", "torque bias z"], "N m"),
        };
        (names.get(self.axis()).copied().unwrap_or_default(), unit)
    }
}

/// Checks that a body's parameters and nuisances are `P` together and make sense.
///
/// # Errors
/// [`PlanningError::WrongCount`], [`PlanningError::OutOfRange`], [`PlanningError::NotPositive`].
pub fn check<const P: usize>(parameters: BodyParameters, nuisances: &[(Nuisance, f64)]) -> Result<(), PlanningError> {
    let given = parameters.count() + nuisances.len();
    if given != P {
        return Err(PlanningError::WrongCount { what: "parameters and nuisances of the body", given, expected: P });
    }
    for (nuisance, sigma) in nuisances {
        positive("the prior standard deviation of a nuisance", *sigma)?;
        let axis = nuisance.axis();
        if axis > 2 {
            let (value, lower, upper) = (axis as f64, 0.0, 2.0);
            return Err(PlanningError::OutOfRange { what: "the axis of a nuisance", value, lower, upper });
        }
    }
    Ok(())
}

type Vector10 = SVector<f64, PARAMETERS>;
type Matrix10 = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// The ten quantities of a body: mass, centre of mass, inertia about it.
fn quantities(body: &InertialParameters<f64>) -> Vector10 {
    let (first_moment, inertia_about_origin) = (body.center_of_mass(), body.inertia_about_com());
    InertialParameters { mass: body.mass, first_moment, inertia_about_origin }.to_vector()
}

/// The body with these ten quantities.
fn body_of(quantities: &Vector10) -> InertialParameters<f64> {
    let InertialParameters { mass, first_moment, inertia_about_origin } = InertialParameters::from_vector(quantities);
    InertialParameters::about_com(mass, first_moment, inertia_about_origin)
}

/// Change of the ten quantities by [`InertialParameters::to_vector`].
fn quantities_by_parameters(body: &InertialParameters<f64>) -> Matrix10 {
    let c = body.center_of_mass();
    let column = |i: usize| {
        let change = InertialParameters::from_vector(&Vector10::ith(i, 1.0));
        let h = change.first_moment;
        let symmetric = h * c.transpose() + c * h.transpose() - Matrix3::identity() * (2.0 * c.dot(&h));
        let of_mass = (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * change.mass;
        InertialParameters {
            mass: change.mass,
            first_moment: (h - c * change.mass) / body.mass,
            inertia_about_origin: change.inertia_about_origin + symmetric + of_mass,
        }
        .to_vector()
    };
    Matrix10::from_columns(&core::array::from_fn::<Vector10, PARAMETERS, _>(column))
}

/// Change of the ten quantities by the coordinates of [`LogCholesky`].
fn quantities_by_chart(chart: &LogCholesky<f64>) -> Matrix10 {
    let body = chart.to_parameters();
    let (d, s) = (chart.log_extents.map(libm::exp), &chart.shears);
    let u = Matrix3::new(d.x, s.x, s.y, 0.0, d.y, s.z, 0.0, 0.0, d.z);
    let column = |i: usize| {
        let (mut mass, mut center, mut inertia) = (0.0, Vector3::zeros(), Matrix3::zeros());
        match i {
            0 => (mass, inertia) = (body.mass, body.inertia_about_com()),
            1..=3 => center = Vector3::ith(i - 1, 1.0),
            _ => {
                let mut u_change = Matrix3::zeros();
                match i {
                    4..=6 => u_change[(i - 4, i - 4)] = d[i - 4],
                    7 => u_change.m12 = 1.0,
                    8 => u_change.m13 = 1.0,
                    _ => u_change.m23 = 1.0,
                }
                let half = u_change * u.transpose() * body.mass;
                let second_moment = half + half.transpose();
                inertia = Matrix3::identity() * second_moment.trace() - second_moment;
            }
        }
        InertialParameters { mass, first_moment: center, inertia_about_origin: inertia }.to_vector()
    };
    Matrix10::from_columns(&core::array::from_fn::<Vector10, PARAMETERS, _>(column))
}

fn rows(m: &Matrix3<f64>) -> M3 {
    m.transpose().into()
}

/// The body believed, and its changes with the coordinates.
#[derive(Clone, Debug)]
pub struct Believed<const P: usize> {
    quantities: Vector10,
    chart: Option<LogCholesky<f64>>,
    /// Prior standard deviations of the coordinates.
    pub sigma: [f64; P],
    /// What a step needs of it.
    pub body: Body,
    /// One for each coordinate.
    pub directions: [Direction; P],
}

/// The coordinates of a body: what a unit of each does to the ten quantities, how large they are, and their covariance.
struct Coordinates {
    chart: Option<LogCholesky<f64>>,
    /// Rows among the ten quantities.
    of_interest: &'static [usize],
    quantities: Matrix10,
    size: Vector10,
    covariance: Matrix10,
}

impl Coordinates {
    fn new(
        parameters: BodyParameters,
        body: &InertialParameters<f64>,
        covariance: &Matrix10,
    ) -> Result<Self, PlanningError> {
        let by_parameters = quantities_by_parameters(body);
        let covariance = by_parameters * covariance * by_parameters.transpose();
        match parameters {
            BodyParameters::Principal => {
                // the four come first
                let mut picked = Matrix10::zeros();
                for (place, quantity) in PRINCIPAL.iter().enumerate() {
                    picked[(*quantity, place)] = 1.0;
                }
                let size = picked.transpose() * quantities(body);
                let covariance = picked.transpose() * covariance * picked;
                Ok(Self { chart: None, of_interest: &PRINCIPAL, quantities: picked, size, covariance })
            }
            BodyParameters::Full => {
                let chart = LogCholesky::try_from_parameters(body)?;
                let quantities = quantities_by_chart(&chart);
                let margin = body.consistency_margin();
                let inverse = quantities.try_inverse().ok_or(DynamicsError::NotRealizable { margin })?;
                // logarithms over one, lengths over the radius of gyration
                let inertia = body.inertia_about_com();
                let radius = f64::sqrt(inertia.trace() / (2.0 * body.mass));
                let mut size = Vector10::repeat(radius);
                for logarithm in [0, 4, 5, 6] {
                    size[logarithm] = 1.0;
                }
                let covariance = inverse * covariance * inverse.transpose();
                let of_interest = &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9];
                Ok(Self { chart: Some(chart), of_interest, quantities, size, covariance })
            }
        }
    }
}

/// Checks that a matrix may be a covariance, as far as its entries tell.
fn check_covariance(covariance: &Matrix10) -> Result<(), PlanningError> {
    for entry in covariance.iter() {
        finite("an entry of the belief's covariance", *entry)?;
    }
    for variance in covariance.diagonal().iter() {
        not_negative("a variance of the belief", *variance)?;
    }
    if (covariance - covariance.transpose()).amax() > 1e-9 * covariance.amax() {
        return Err(PlanningError::Asymmetric { what: "the belief's covariance" });
    }
    Ok(())
}

impl<const P: usize> Believed<P> {
    /// What is believed of a body, and how well it is known.
    ///
    /// What is known exactly is taken to be known to a millionth of its size (of the radius of gyration for lengths).
    ///
    /// # Errors
    /// A body without extent in some direction; a matrix that is no covariance.
    pub fn new(
        belief: &ModelBelief,
        parameters: BodyParameters,
        nuisances: &[(Nuisance, f64)],
    ) -> Result<(Self, Knowledge<P>), PlanningError> {
        check::<P>(parameters, nuisances)?;
        let believed = belief.parameters().validated()?;
        if !believed.is_strictly_consistent() {
            return Err(DynamicsError::NotRealizable { margin: believed.consistency_margin() }.into());
        }
        check_covariance(&belief.estimate.covariance)?;
        let coordinates = Coordinates::new(parameters, &believed, &belief.estimate.covariance)?;
        let count = parameters.count();
        let covariance = SMatrix::<f64, P, P>::from_fn(|i, j| {
            if i < count && j < count {
                0.5 * (coordinates.covariance[(i, j)] + coordinates.covariance[(j, i)])
            } else if i == j {
                nuisances.get(i - count).map_or(0.0, |(_, prior)| prior * prior)
            } else {
                0.0
            }
        });
        let sizes = core::array::from_fn(|i| if i < count { coordinates.size[i] } else { 0.0 });
        let (sigma, information) = whitened(&covariance, &sizes, &["a variance of the belief"; P])?;
        let quantities_by_eta = SMatrix::<f64, P, P>::from_fn(|i, j| match coordinates.of_interest.get(i) {
            Some(row) if j < count => coordinates.quantities[(*row, j)] * sigma[j],
            None if i == j => sigma[j],
            _ => 0.0,
        });
        let mut names = [("", ""); P];
        let of_body = coordinates.of_interest.iter().map(|row| QUANTITIES[*row]);
        let of_actuators = nuisances.iter().map(|(nuisance, _)| nuisance.name_and_unit());
        for (place, name) in names.iter_mut().zip(of_body.chain(of_actuators)) {
            *place = name;
        }
        let (units, names) = (names.map(|(_, unit)| unit), names.map(|(name, _)| name));

        let body = kernel(&believed)?;
        let change = |i: usize| {
            let mut change = Vector10::zeros();
            if i < count {
                change = coordinates.quantities.column(i) * sigma[i];
            }
            let nuisance = i.checked_sub(count).and_then(|place| nuisances.get(place));
            direction(&believed, &body, &change, nuisance)
        };
        let directions = core::array::from_fn(change);
        let believed = Self { quantities: quantities(&believed), chart: coordinates.chart, sigma, body, directions };
        Ok((believed, Knowledge { information, quantities: quantities_by_eta, names, units }))
    }

    /// The body at these coordinates.
    ///
    /// # Errors
    /// Where there is none.
    pub fn body_at(&self, eta: &[f64; P]) -> Result<InertialParameters<f64>, PlanningError> {
        let moved = |i: usize| eta.get(i).zip(self.sigma.get(i)).map_or(0.0, |(eta, sigma)| eta * sigma);
        let body = if let Some(chart) = &self.chart {
            LogCholesky::from_vector(&(chart.to_vector() + Vector10::from_fn(|i, _| moved(i)))).to_parameters()
        } else {
            let mut quantities = self.quantities;
            for (place, quantity) in PRINCIPAL.iter().enumerate() {
                quantities[*quantity] += moved(place);
            }
            body_of(&quantities)
        };
        Ok(body.validated()?)
    }
}

/// What a step needs of a body.
fn kernel(body: &InertialParameters<f64>) -> Result<Body, PlanningError> {
    let inertia = body.inertia_about_com();
    let margin = body.consistency_margin();
    let inverse = inertia.try_inverse().ok_or(DynamicsError::NotRealizable { margin })?;
    Ok(Body {
        mass_inverse: 1.0 / body.mass,
        center_of_mass: body.center_of_mass().into(),
        rotor: Rotor::new(&rows(&inertia), &rows(&inverse)),
    })
}

/// The change of everything with a coordinate that changes the ten quantities and is perhaps a nuisance.
fn direction(
    believed: &InertialParameters<f64>,
    body: &Body,
    change: &Vector10,
    nuisance: Option<&(Nuisance, f64)>,
) -> Direction {
    let InertialParameters { mass, first_moment: center, inertia_about_origin: inertia } =
        InertialParameters::from_vector(change);
    let mut direction = Direction {
        mass_inverse: -mass / (believed.mass * believed.mass),
        center_of_mass: center.into(),
        rotor: body.rotor.change(&rows(&inertia)),
        torque_scale: [0.0; 3],
        torque_bias: [0.0; 3],
        force_scale: [0.0; 3],
        force_bias: [0.0; 3],
    };
    if let Some((nuisance, sigma)) = nuisance {
        let place: &mut V3 = match nuisance {
            Nuisance::ForceScale(_) => &mut direction.force_scale,
            Nuisance::TorqueScale(_) => &mut direction.torque_scale,
            Nuisance::ForceBias(_) => &mut direction.force_bias,
            Nuisance::TorqueBias(_) => &mut direction.torque_bias,
        };
        if let Some(entry) = place.get_mut(nuisance.axis()) {
            *entry = *sigma;
        }
    }
    direction
}

#[cfg(test)]
mod tests {
    use super::*;

    fn believed() -> InertialParameters<f64> {
        let inertia = Matrix3::new(0.15, 0.01, -0.02, 0.01, 0.14, 0.005, -0.02, 0.005, 0.16);
        InertialParameters::about_com(9.5, Vector3::new(0.02, -0.05, 0.1), inertia)
    }

    /// A belief whose ten parameters are correlated.
    fn belief() -> ModelBelief {
        let mut belief = ModelBelief::certain(3, believed());
        let size = believed().to_vector().map(|x| 0.2 * x.abs() + 0.003);
        let root = Matrix10::from_fn(|i, j| {
            size[i] * (libm::sin((7 * i + 3 * j * j + 1) as f64) + f64::from(u8::from(i == j)))
        });
        belief.estimate.covariance = root * root.transpose();
        belief
    }

    fn quotient(f: impl Fn(&Vector10) -> Vector10, at: &Vector10) -> Matrix10 {
        let column = |i: usize| {
            let width = Vector10::ith(i, 1e-5 * at[i].abs().max(0.01));
            (f(&(at + width)) - f(&(at - width))) / (2.0 * width[i])
        };
        Matrix10::from_columns(&core::array::from_fn::<Vector10, PARAMETERS, _>(column))
    }

    #[test]
    fn derivatives_of_the_quantities_are_difference_quotients() {
        let body = believed();
        let by_parameters = quotient(|p| quantities(&InertialParameters::from_vector(p)), &body.to_vector());
        assert!((quantities_by_parameters(&body) - by_parameters).amax() < 1e-9);
        let chart = LogCholesky::try_from_parameters(&body).unwrap();
        let by_chart = quotient(|v| quantities(&LogCholesky::from_vector(v).to_parameters()), &chart.to_vector());
        assert!((quantities_by_chart(&chart) - by_chart).amax() < 1e-8);
        assert!((body_of(&quantities(&body)).to_vector() - body.to_vector()).amax() < 1e-15);
    }

    #[test]
    fn what_is_known_of_the_quantities_is_what_is_believed_of_the_parameters() {
        let belief = belief();
        let by_parameters =
            quotient(|p| quantities(&InertialParameters::from_vector(p)), &belief.parameters().to_vector());
        let expected = by_parameters * belief.estimate.covariance * by_parameters.transpose();
        let relative = |i: usize, j: usize, found: f64| {
            (found - expected[(i, j)]).abs() / f64::sqrt(expected[(i, i)] * expected[(j, j)])
        };

        let (_, knowledge) = Believed::<10>::new(&belief, BodyParameters::Full, &[]).unwrap();
        let covariance = knowledge.information.try_inverse().unwrap();
        let covariance = knowledge.quantities * covariance * knowledge.quantities.transpose();
        for i in 0..10 {
            for j in 0..10 {
                assert!(relative(i, j, covariance[(i, j)]) < 1e-7, "{i} {j}");
            }
        }

        let nuisances = [(Nuisance::TorqueBias(2), 0.25)];
        let (_, knowledge) = Believed::<5>::new(&belief, BodyParameters::Principal, &nuisances).unwrap();
        let covariance = knowledge.information.try_inverse().unwrap();
        let covariance = knowledge.quantities * covariance * knowledge.quantities.transpose();
        for (a, i) in PRINCIPAL.into_iter().enumerate() {
            for (b, j) in PRINCIPAL.into_iter().enumerate() {
                assert!(relative(i, j, covariance[(a, b)]) < 1e-7, "{i} {j}");
            }
            assert!(covariance[(a, 4)].abs() < 1e-18);
        }
        assert!((covariance[(4, 4)] - 0.0625).abs() < 1e-16);
        assert_eq!(knowledge.names, ["mass", "inertia_xx", "inertia_yy", "inertia_zz", "torque bias z"]);
        assert_eq!(knowledge.units, ["kg", "kg m^2", "kg m^2", "kg m^2", "N m"]);
    }

    #[test]
    fn the_body_moves_with_the_coordinates_as_its_quantities_do() {
        let belief = belief();
        let (believed, knowledge) = Believed::<10>::new(&belief, BodyParameters::Full, &[]).unwrap();
        let at = |eta: &Vector10| quantities(&believed.body_at(&(*eta).into()).unwrap());
        assert!((at(&Vector10::zeros()) - quantities(belief.parameters())).amax() < 1e-14);
        assert!((quotient(at, &Vector10::zeros()) - knowledge.quantities).amax() < 1e-6);
        // every point is a body, however far
        for seed in 0..50 {
            let eta = Vector10::from_fn(|i, _| 5.0 * libm::sin((11 * seed + 3 * i) as f64));
            assert!(believed.body_at(&eta.into()).unwrap().is_strictly_consistent());
        }
        let (believed, knowledge) = Believed::<4>::new(&belief, BodyParameters::Principal, &[]).unwrap();
        let body = believed.body_at(&[0.1, -0.2, 0.3, 0.05]).unwrap();
        let moved = quantities(&body) - quantities(belief.parameters());
        for (place, eta) in [0.1, -0.2, 0.3, 0.05].into_iter().enumerate() {
            assert!((moved[PRINCIPAL[place]] - eta * knowledge.quantities[(place, place)]).abs() < 1e-14);
        }
        assert!(matches!(
            believed.body_at(&[0.0, 1e3, 0.0, 0.0]),
            Err(PlanningError::Dynamics(DynamicsError::NotRealizable { .. }))
        ));
    }

    #[test]
    fn what_is_known_exactly_keeps_a_finite_information() {
        let certain = ModelBelief::certain(1, believed());
        let (_, knowledge) = Believed::<4>::new(&certain, BodyParameters::Principal, &[]).unwrap();
        assert!(knowledge.information.is_identity(1e-15));
        assert!((knowledge.quantities[(0, 0)] - 9.5e-6).abs() < 1e-20);
        let (_, knowledge) = Believed::<10>::new(&certain, BodyParameters::Full, &[]).unwrap();
        assert!(knowledge.information.is_identity(1e-15));
        // known but for one parameter, and but for one combination
        let mut belief = certain.clone();
        belief.estimate.covariance[(0, 0)] = 1.0;
        let (_, knowledge) = Believed::<10>::new(&belief, BodyParameters::Full, &[]).unwrap();
        assert!(knowledge.information.cholesky().is_some());
        let direction = believed().to_vector() * 0.3;
        belief.estimate.covariance = direction * direction.transpose();
        let (_, knowledge) = Believed::<10>::new(&belief, BodyParameters::Full, &[]).unwrap();
        assert!(knowledge.information.cholesky().is_some());
    }

    #[test]
    fn what_is_refused() {
        let principal = |belief: &ModelBelief| Believed::<4>::new(belief, BodyParameters::Principal, &[]).map(|_| ());
        assert_eq!(principal(&belief()), Ok(()));
        let wrong = check::<6>(BodyParameters::Principal, &[(Nuisance::ForceBias(0), 1.0)]);
        assert!(matches!(wrong, Err(PlanningError::WrongCount { given: 5, expected: 6, .. })));
        let axis = check::<5>(BodyParameters::Principal, &[(Nuisance::ForceBias(3), 1.0)]);
        assert!(matches!(axis, Err(PlanningError::OutOfRange { .. })));
        for sigma in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(check::<11>(BodyParameters::Full, &[(Nuisance::TorqueScale(1), sigma)]).is_err(), "{sigma}");
        }

        let mut bad = belief();
        bad.estimate.covariance[(2, 2)] = f64::NAN;
        assert!(matches!(principal(&bad), Err(PlanningError::NotFinite { .. })));
        bad = belief();
        bad.estimate.covariance[(3, 3)] = -1.0;
        assert!(matches!(principal(&bad), Err(PlanningError::Negative { .. })));
        bad = belief();
        bad.estimate.covariance[(0, 3)] += 1.0;
        assert!(matches!(principal(&bad), Err(PlanningError::Asymmetric { .. })));
        bad = belief();
        let larger = 2.0 * f64::sqrt(bad.estimate.covariance[(4, 4)] * bad.estimate.covariance[(0, 0)]);
        (bad.estimate.covariance[(4, 0)], bad.estimate.covariance[(0, 4)]) = (larger, larger);
        assert!(matches!(principal(&bad), Err(PlanningError::NotPositive { value, .. }) if value < 0.0));
        bad = belief();
        bad.estimate.parameters.mass = -1.0;
        assert!(matches!(principal(&bad), Err(PlanningError::Dynamics(_))));
        // a plate has no extent across
        let plate = Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.3));
        bad = ModelBelief::certain(1, InertialParameters::about_com(1.0, Vector3::zeros(), plate));
        assert!(matches!(principal(&bad), Err(PlanningError::Dynamics(DynamicsError::NotRealizable { .. }))));
    }
}
