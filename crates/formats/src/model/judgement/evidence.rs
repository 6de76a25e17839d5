//! What the shapes of a link say of where its mass may be.

use crate::model::ModelLink;
use crate::model::solid::Filled;
use tumble_dynamics::nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// How much larger than drawn the shapes of a link are taken.
pub(super) const SLACK: f64 = 1.25;

/// The shapes of a link that are known in full.
pub(super) struct Evidence {
    pub(super) sets: Vec<(&'static str, Filled)>,
}

impl Evidence {
    pub(super) fn of(link: &ModelLink) -> Self {
        let sets = [("collision", &link.collision), ("visual", &link.visual)];
        let known = |(name, solids): (&'static str, &Option<Vec<_>>)| {
            solids.as_ref().and_then(|solids| Filled::of(solids)).map(|filled| (name, filled))
        };
        Self { sets: sets.into_iter().filter_map(known).collect() }
    }
}

/// Mean of x x^T of the mass about its centre, m^2.
pub(super) fn spread(inertia: &Matrix3<f64>, mass: f64) -> Matrix3<f64> {
    (Matrix3::identity() * (0.5 * inertia.trace()) - inertia) / mass
}

/// Whether mass with its centre there can spread so inside the shapes, taken larger by a factor: along no direction more than
/// (farthest - mean) (mean - nearest). The first direction along which it cannot otherwise, and the two spreads, m^2.
///
/// `None` too where the centre itself is outside: such shapes are not all of the link, and say nothing.
pub(super) fn excess(
    filled: &Filled,
    center_of_mass: &Vector3<f64>,
    spread: &Matrix3<f64>,
    slack: f64,
) -> Option<(Vector3<f64>, f64, f64)> {
    let own = SymmetricEigen::new(*spread).eigenvectors;
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let directions = axes.into_iter().chain((0..3).map(|k| own.column(k).into_owned()));
    let mut worst: Option<(Vector3<f64>, f64, f64)> = None;
    for direction in directions {
        let (low, high) = filled.interval(&direction);
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low) * slack);
        let from_middle = center_of_mass.dot(&direction) - middle;
        let allowed = half * half - from_middle * from_middle;
        if allowed <= 0.0 {
            return None;
        }
        let written = (direction.transpose() * spread * direction).x;
        let is_worse = worst.is_none_or(|(_, before, limit)| written / allowed > before / limit);
        if written > allowed && is_worse {
            worst = Some((direction, written, allowed));
        }
    }
    worst
}
