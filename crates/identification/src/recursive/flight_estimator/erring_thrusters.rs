//! Thrusters that do not give quite what they are told: which errors of a wrench that makes.

use crate::error::IdentificationError;
use crate::lie::Wrench;
use nalgebra::{SMatrix, SVector, Vector3, Vector6};

/// Thrusters of a robot at most.
pub const THRUSTERS: usize = 12;

/// Squared singular values below this share of the largest are none.
const NO_PUSH: f64 = 1e-9;

/// One thruster that errs by a constant share of its thrust.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErringThruster {
    /// What a thrust of one newton makes, body axes, torque about the origin; zero for a thruster that does not exist.
    pub push_body: Wrench<f64>,
    /// Standard deviation of the relative error of its thrust, of this one alone.
    pub relative: f64,
    /// Thrusters of one number cancel where they all give the same, and of every wrench the least of them gives nothing. One that is alone with its
    /// number may push either way.
    pub group: usize,
    /// Thrusters of one number draw on one supply: one of them that stands open or shut takes from the others or gives to them, and they fail together
    /// with it.
    pub supply: usize,
}

impl ErringThruster {
    /// A thruster that does not exist, of which a robot with fewer has the rest.
    pub const NONE: Self = Self {
        push_body: Wrench { torque: Vector3::new(0.0, 0.0, 0.0), force: Vector3::new(0.0, 0.0, 0.0) },
        relative: 0.0,
        group: 0,
        supply: 0,
    };

    /// Six thrusters of a robot that pushes along and turns about each body axis by a maker of its own, either way, each off by `relative`.
    pub fn along_axes(relative: f64) -> [Self; THRUSTERS] {
        let push = |axis: usize| if axis < 6 { Vector6::ith(axis, 1.0) } else { Vector6::zeros() };
        core::array::from_fn(|axis| Self { push_body: push(axis).into(), relative, group: axis, supply: 0 })
    }

    /// Twelve thrusters in six opposite pairs: four push along each axis, to either side of the middle by `arm_m`, so that the difference of
    /// two of them turns. Each errs by `relative`, independently.
    pub fn in_pairs(relative: f64, arm_m: f64) -> [Self; THRUSTERS] {
        core::array::from_fn(|k| {
            // Pairs along x lie apart along y, those along y along z, those along z along x.
            let (axis, side, sense) = (k / 4, (k / 2) % 2, k % 2);
            let sign = |odd: usize| if odd == 0 { 1.0 } else { -1.0 };
            let position = Vector3::ith((axis + 1) % 3, sign(side) * arm_m);
            let force = Vector3::ith(axis, sign(sense));
            Self { push_body: Wrench::new(position.cross(&force), force), relative, group: k / 2, supply: 0 }
        })
    }

    /// What an error of one standard deviation of each thruster adds to a wrench (N m, N; torque before force, body axes, about the origin): one column
    /// per thruster.
    pub fn errors_of(thrusters: &[Self; THRUSTERS], wrench_body: &Vector6<f64>) -> SMatrix<f64, 6, THRUSTERS> {
        let contributions = ThrustShares::new(thrusters).contributions(wrench_body);
        SMatrix::from_fn(|i, k| contributions[(i, k)] * thrusters[k].relative)
    }

    /// # Errors
    /// What is not finite, a negative deviation.
    pub fn check(&self) -> Result<(), IdentificationError> {
        let push = self.push_body.to_vector();
        if let Some(value) = push.iter().copied().find(|value| !value.is_finite()) {
            return Err(IdentificationError::ImpossibleSensing { what: "wrench of a thruster", value });
        }
        if !(self.relative >= 0.0 && self.relative.is_finite()) {
            let what = "standard deviation of a thruster's thrust";
            return Err(IdentificationError::ImpossibleSensing { what, value: self.relative });
        }
        Ok(())
    }

    pub(super) fn exists(&self) -> bool {
        self.push_body.to_vector() != Vector6::zeros()
    }
}

/// What may have failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Suspect {
    /// The thruster at this place.
    Thruster(usize),
    /// All thrusters of this supply.
    Supply(usize),
}

impl Suspect {
    /// All that motion can tell apart: each thruster, and each supply of several that is not the supply of all.
    pub(super) fn all(thrusters: &[ErringThruster; THRUSTERS]) -> impl Iterator<Item = Self> + '_ {
        let errs = |thruster: &ErringThruster| thruster.exists() && thruster.relative > 0.0;
        let erring = move || thrusters.iter().filter(move |thruster| errs(thruster));
        let supplies = (0..THRUSTERS).filter(move |k| {
            let those = erring().filter(|other| other.supply == thrusters[*k].supply).count();
            let is_first = thrusters[..*k].iter().all(|before| before.supply != thrusters[*k].supply);
            is_first && (2..erring().count()).contains(&those)
        });
        let single = (0..THRUSTERS).filter(move |k| errs(&thrusters[*k]));
        single.map(Self::Thruster).chain(supplies.map(|k| Self::Supply(thrusters[k].supply)))
    }

    /// The supply that it is, or draws on.
    pub(super) fn supply(self, thrusters: &[ErringThruster; THRUSTERS]) -> usize {
        match self {
            Self::Thruster(thruster) => thrusters[thruster].supply,
            Self::Supply(supply) => supply,
        }
    }
}

/// How a wrench is shared among thrusters.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThrustShares {
    push: SMatrix<f64, 6, THRUSTERS>,
    /// Least thrusts of a wrench, before those of a group are made positive together.
    least: SMatrix<f64, THRUSTERS, 6>,
    /// For each thruster the next one of its group, round about; itself where it is alone or none.
    next_of_group: [usize; THRUSTERS],
}

impl ThrustShares {
    pub(super) fn new(thrusters: &[ErringThruster; THRUSTERS]) -> Self {
        let push = SMatrix::<f64, 6, THRUSTERS>::from_fn(|i, k| thrusters[k].push_body.to_vector()[i]);
        // The pseudo-inverse by the small symmetric side: Pᵀ (P Pᵀ)⁺.
        let eigen = (push * push.transpose()).symmetric_eigen();
        let none = NO_PUSH * eigen.eigenvalues.amax();
        let inverse = eigen.eigenvalues.map(|value| if value > none { 1.0 / value } else { 0.0 });
        let least =
            push.transpose() * eigen.eigenvectors * SMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose();
        let same = |k: usize, other: usize| {
            thrusters[k].exists() && thrusters[other].exists() && thrusters[k].group == thrusters[other].group
        };
        let next = |k: usize| (1..THRUSTERS).map(|step| (k + step) % THRUSTERS).find(|other| same(k, *other));
        Self { push, least, next_of_group: core::array::from_fn(|k| next(k).unwrap_or(k)) }
    }

    /// Thrust of each, N: the least that makes the wrench, none of a group negative.
    fn thrusts(&self, wrench: &Vector6<f64>) -> SVector<f64, THRUSTERS> {
        let least = self.least * wrench;
        SVector::from_fn(|k, _| {
            let (mut lowest, mut other) = (least[k], self.next_of_group[k]);
            if other == k {
                return least[k];
            }
            while other != k {
                lowest = lowest.min(least[other]);
                other = self.next_of_group[other];
            }
            least[k] - lowest
        })
    }

    /// What each contributes to a wrench, columns.
    pub(super) fn contributions(&self, wrench: &Vector6<f64>) -> SMatrix<f64, 6, THRUSTERS> {
        let thrusts = self.thrusts(wrench);
        SMatrix::from_fn(|i, k| self.push[(i, k)] * thrusts[k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thrusts_make_the_wrench_and_none_is_negative() {
        let shares = ThrustShares::new(&ErringThruster::in_pairs(0.01, 0.1));
        let wrench = Vector6::new(0.01, -0.02, 0.015, 0.3, -0.2, 0.1);
        let thrusts = shares.thrusts(&wrench);
        assert!((shares.push * thrusts - wrench).amax() < 1e-14);
        assert!(thrusts.min() >= 0.0 && thrusts.iter().filter(|thrust| **thrust == 0.0).count() == 6);
        assert!((shares.contributions(&wrench).column_sum() - wrench).amax() < 1e-14);
        // by hand: 0.3 N ahead and 0.015 N m about z from two lines that are 0.1 m to either side
        assert!((thrusts[0] - (0.15 - 0.075)).abs() < 1e-14 && (thrusts[2] - (0.15 + 0.075)).abs() < 1e-14);
    }

    #[test]
    fn along_axes_each_axis_errs_by_itself() {
        let shares = ThrustShares::new(&ErringThruster::along_axes(0.01));
        let wrench = Vector6::new(0.01, -0.02, 0.015, 0.3, -0.2, 0.1);
        let contributions = shares.contributions(&wrench);
        for (axis, contribution) in contributions.column_iter().enumerate() {
            let expected = if axis < 6 { Vector6::ith(axis, wrench[axis]) } else { Vector6::zeros() };
            assert!((contribution - expected).amax() < 1e-15, "{axis}: {contribution}");
        }
    }

    /// A supply of all is none that motion tells from a body, and one of a single thruster is that thruster.
    #[test]
    fn each_thruster_is_suspected_and_each_supply_of_several() {
        let mut thrusters = ErringThruster::along_axes(0.01);
        let count = |thrusters: &[ErringThruster; THRUSTERS]| Suspect::all(thrusters).count();
        assert_eq!(count(&thrusters), 6);
        for (k, thruster) in thrusters.iter_mut().enumerate() {
            thruster.supply = [7, 7, 7, 2, 2, 9, 0, 0, 0, 0, 0, 0][k];
        }
        let all: std::vec::Vec<_> = Suspect::all(&thrusters).collect();
        assert_eq!(all[..6], core::array::from_fn::<_, 6, _>(Suspect::Thruster));
        assert_eq!(all[6..], [Suspect::Supply(7), Suspect::Supply(2)]);
        assert_eq!([Suspect::Thruster(4), Suspect::Supply(9)].map(|suspect| suspect.supply(&thrusters)), [2, 9]);
    }

    #[test]
    fn thrusters_that_do_not_exist_give_nothing_and_one_alone_pushes_either_way() {
        let mut thrusters = [ErringThruster::NONE; THRUSTERS];
        thrusters[3].push_body = Wrench::new(Vector3::zeros(), Vector3::x());
        let shares = ThrustShares::new(&thrusters);
        let thrusts = shares.thrusts(&Vector6::new(0.0, 0.0, 0.1, -2.0, 1.0, 0.0));
        assert!((thrusts[3] + 2.0).abs() < 1e-15);
        assert_eq!(thrusts.iter().filter(|thrust| **thrust != 0.0).count(), 1);
    }
}
