//! What a motion did not show, and which simple motion would.

use crate::body_scale::BodyScale;
use crate::observability::{NullDirection, Observability};
use crate::regressors::{Regressor, newton_euler};
use crate::square_root_information::SquareRootInformation;
use core::fmt;
use nalgebra::{SVector, Vector3};

/// A body axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BodyAxis {
    /// First.
    X,
    /// Second.
    Y,
    /// Third.
    Z,
}

impl BodyAxis {
    /// All three.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    fn unit(self) -> Vector3<f64> {
        match self {
            Self::X => Vector3::x(),
            Self::Y => Vector3::y(),
            Self::Z => Vector3::z(),
        }
    }
}

impl fmt::Display for BodyAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        })
    }
}

/// A simple motion to add: rotating to and fro about a body axis, pushing to and fro along one, or both at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Remedy {
    /// Axis to rotate about.
    pub rotate_about: Option<BodyAxis>,
    /// Axis to push along.
    pub push_along: Option<BodyAxis>,
}

impl fmt::Display for Remedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.rotate_about, self.push_along) {
            (Some(turn), Some(push)) => write!(f, "rotate about body {turn} while pushing along body {push}"),
            (Some(turn), None) => write!(f, "rotate about body {turn}"),
            (None, Some(push)) => write!(f, "push along body {push}"),
            (None, None) => f.write_str("no simple motion helps"),
        }
    }
}

impl Remedy {
    /// The simple motions: one axis first, then two together.
    fn all() -> impl Iterator<Item = Self> {
        let single = |rotate_about, push_along| Self { rotate_about, push_along };
        let pushes = BodyAxis::ALL.map(|axis| single(None, Some(axis)));
        let turns = BodyAxis::ALL.map(|axis| single(Some(axis), None));
        let both = BodyAxis::ALL
            .into_iter()
            .flat_map(move |turn| BodyAxis::ALL.into_iter().map(move |push| single(Some(turn), Some(push))));
        pushes.into_iter().chain(turns).chain(both)
    }

    /// Regressors along the motion: a rotation to and fro with unit angular acceleration and rate, a push of `length_m` a
    /// second squared, out of step.
    pub fn regressors(self, length_m: f64) -> [Regressor<f64>; INSTANTS] {
        core::array::from_fn(|k| {
            let phase = core::f64::consts::TAU * k as f64 / INSTANTS as f64;
            let (sine, cosine) = nalgebra::ComplexField::sin_cos(phase);
            let second = nalgebra::ComplexField::cos(2.0 * phase + 0.5);
            let turn = self.rotate_about.map_or_else(Vector3::zeros, BodyAxis::unit);
            let push = self.push_along.map_or_else(Vector3::zeros, BodyAxis::unit);
            newton_euler(&(turn * sine), &(turn * cosine), &(push * (length_m * second)))
        })
    }
}

/// Instants at which a remedy is looked at.
const INSTANTS: usize = 8;

/// A direction of the ten parameters that the motion showed badly or not at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeakDirection {
    /// What is not excited, or exchangeable with what.
    pub direction: NullDirection,
    /// The motion that shows it best.
    pub remedy: Remedy,
}

impl WeakDirection {
    /// Finds the remedy for a direction.
    pub fn new(direction: NullDirection, scale: BodyScale) -> Self {
        Self { direction, remedy: remedy(&direction, scale) }
    }
}

impl fmt::Display for WeakDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.direction, self.remedy)
    }
}

/// What a motion did not show, with a remedy for each direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExcitationDiagnosis {
    weak: [Option<WeakDirection>; 10],
}

impl ExcitationDiagnosis {
    /// Judges whitened rows: a direction is weak below `tolerance` times the strongest (as in
    /// [`Observability::with_tolerance`]).
    ///
    /// The remedy is the simple motion that shows the direction most strongly; a motion of one axis is preferred to one of two
    /// that shows no more than twice as much.
    pub fn new(information: &SquareRootInformation<10>, scale: BodyScale, tolerance: f64) -> Self {
        let observability = Observability::with_tolerance(information, scale, tolerance);
        let mut weak = [None; 10];
        for (place, direction) in weak.iter_mut().zip(observability.null_directions()) {
            *place = Some(WeakDirection::new(*direction, scale));
        }
        Self { weak }
    }

    /// The weak directions, none where the motion showed everything.
    pub fn weak_directions(&self) -> impl Iterator<Item = &WeakDirection> {
        self.weak.iter().flatten()
    }
}

fn remedy(direction: &NullDirection, scale: BodyScale) -> Remedy {
    let parameters: SVector<f64, 10> = direction.parameters();
    // Torques count with the lever of the body's own size.
    let shown = |remedy: &Remedy| -> f64 {
        remedy
            .regressors(scale.length_m())
            .iter()
            .map(|regressor| {
                let wrench = regressor * parameters;
                let lever = scale.length_m() * scale.length_m();
                wrench.fixed_rows::<3>(0).norm_squared() / lever + wrench.fixed_rows::<3>(3).norm_squared()
            })
            .sum()
    };
    let mut best = Remedy { rotate_about: None, push_along: None };
    let mut most = 0.0;
    for candidate in Remedy::all() {
        let strength = shown(&candidate);
        let single = candidate.rotate_about.is_none() || candidate.push_along.is_none();
        if strength > if single { 1.0 } else { 2.0 } * most {
            (best, most) = (candidate, strength);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RANK_TOLERANCE;

    fn scale() -> BodyScale {
        BodyScale::try_new(5.0, 0.6).unwrap()
    }

    fn shown_by(remedies: &[Remedy]) -> SquareRootInformation<10> {
        let mut information = SquareRootInformation::new();
        for remedy in remedies {
            for regressor in remedy.regressors(scale().length_m()) {
                information.update(&regressor, &SVector::zeros()).unwrap();
            }
        }
        information
    }

    fn diagnose(remedies: &[Remedy]) -> Vec<WeakDirection> {
        let information = shown_by(remedies);
        ExcitationDiagnosis::new(&information, scale(), RANK_TOLERANCE).weak_directions().copied().collect()
    }

    const fn motion(rotate_about: Option<BodyAxis>, push_along: Option<BodyAxis>) -> Remedy {
        Remedy { rotate_about, push_along }
    }

    #[test]
    fn advice_in_words() {
        // A push along x leaves all but the mass and two first moments.
        let after_push = diagnose(&[motion(None, Some(BodyAxis::X))]);
        assert_eq!(after_push.len(), 7);
        let text: Vec<String> = after_push.iter().map(ToString::to_string).collect();
        let has = |start: &str, end: &str| text.iter().any(|t| t.starts_with(start) && t.ends_with(end));
        assert!(has("inertia J_xx", ": rotate about body x"), "{text:#?}");
        assert!(has("inertia J_zz", ": rotate about body z"), "{text:#?}");
        // Turning about the origin never shows the mass; which push is best does not matter, the first is named.
        let turns = BodyAxis::ALL.map(|axis| motion(Some(axis), None));
        let text: Vec<String> = diagnose(&turns).iter().map(ToString::to_string).collect();
        assert_eq!(text, ["mass is not excited (no acceleration of the body origin): push along body x"]);
        assert_eq!(
            motion(Some(BodyAxis::X), Some(BodyAxis::Y)).to_string(),
            "rotate about body x while pushing along body y"
        );
    }

    /// From any set of simple motions: what is advised raises the rank, and following all advice until none is left ends with
    /// everything shown.
    #[test]
    fn advice_helps_and_comes_to_an_end() {
        let all: Vec<Remedy> = Remedy::all().collect();
        assert_eq!(all.len(), 15);
        for first in 0..all.len() {
            for second in 0..=first {
                let mut motions = vec![all[first], all[second]];
                let mut rank = Observability::new(&shown_by(&motions), scale()).rank();
                for _ in 0..10 {
                    let weak = diagnose(&motions);
                    assert_eq!(weak.len(), 10 - rank);
                    let Some(advice) = weak.first() else { break };
                    motions.push(advice.remedy);
                    let raised = Observability::new(&shown_by(&motions), scale()).rank();
                    assert!(raised > rank, "{motions:?}: {advice}");
                    rank = raised;
                }
                assert_eq!(rank, 10, "{motions:?}");
            }
        }
    }

    #[test]
    fn weak_is_a_matter_of_the_tolerance() {
        // A hundredth of a turn about z beside a full programme.
        let mut information =
            shown_by(&[motion(Some(BodyAxis::X), Some(BodyAxis::Y)), motion(Some(BodyAxis::Y), Some(BodyAxis::Z))]);
        for regressor in motion(Some(BodyAxis::Z), None).regressors(scale().length_m()) {
            information.update(&(regressor * 0.01), &SVector::zeros()).unwrap();
        }
        let weak = |tolerance| {
            let diagnosis = ExcitationDiagnosis::new(&information, scale(), tolerance);
            diagnosis.weak_directions().map(|weak| weak.remedy).collect::<Vec<_>>()
        };
        assert!(weak(RANK_TOLERANCE).is_empty());
        assert_eq!(weak(0.02), [motion(Some(BodyAxis::Z), None)]);
    }
}
