//! What a reader of an identification from periodic motion must know.

use core::fmt;

/// Things a reader of the result must know.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum HarmonicWarning {
    /// Leading cycles differ from the later ones and were left out.
    TransientDropped {
        /// How many.
        cycles: usize,
    },
    /// Cycles still differ where only two are left.
    TransientRemains,
    /// Samples after the last whole cycle were left out.
    Remainder {
        /// How many.
        samples: usize,
    },
    /// Cycles differ at the harmonics by more than white noise: the motion is not quite periodic, or the noise wanders.
    Leakage {
        /// Standard deviation between cycles at the harmonics by that at other frequencies.
        ratio: f64,
    },
    /// The residual is least at the largest number of harmonics tried.
    MoreHarmonics {
        /// That number.
        harmonics: usize,
    },
    /// The best body explains too little of the wrench.
    PoorFit {
        /// Share of the wrench's mean square that is explained.
        explained: f64,
    },
    /// The unconstrained solution was not a body; the consistency constraint moved it.
    ConstraintActive,
    /// Actuators were at their limits for part of the time.
    Saturated {
        /// Share of time with any component of the wrench at its limit.
        share: f64,
    },
    /// The wrench asks for more than the fitted series holds: the motion has more harmonics than were tried, or something is not in
    /// the model.
    ShortSeries {
        /// Unexplained wrench, root mean square, by what noise lets expect.
        times: f64,
    },
    /// Least squares answers with a sigma that holds what it leaves unexplained too.
    Widened,
    /// So many samples and harmonics that the likelihood of the series would take minutes.
    SeriesTooLong {
        /// Harmonics that would have been next.
        harmonics: usize,
        /// Samples in a period.
        samples: usize,
    },
    /// The motion is no short Fourier series, by saturation or otherwise: the trajectory likelihood answers, from the whole record and the
    /// wrench that acted.
    TrajectoryLikelihood,
    /// The estimator asked for, or called for by saturation, gave no answer; least squares answers.
    LikelihoodFailed,
}

impl fmt::Display for HarmonicWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TransientDropped { cycles } => {
                write!(f, "transient: the first {cycles} cycle(s) differ from the later ones and are left out")
            }
            Self::TransientRemains => {
                write!(f, "transient: all cycles differ, the last two are averaged; record more cycles")
            }
            Self::Remainder { samples } => write!(f, "{samples} samples after the last whole cycle are left out"),
            Self::Leakage { ratio } => write!(
                f,
                "cycles differ at the harmonics {ratio:.1} times more than white noise does: the motion is not quite periodic or the \
                 noise wanders; the stated sigma holds these differences as independent from cycle to cycle"
            ),
            Self::MoreHarmonics { harmonics } => write!(
                f,
                "the residual still falls at {harmonics} harmonics, the most that were tried: the motion may have more"
            ),
            Self::PoorFit { explained } => write!(
                f,
                "the best body explains {:.0} % of the wrench: check period, start, timing and sign of the wrench, gravity, units",
                100.0 * explained
            ),
            Self::ConstraintActive => {
                write!(f, "the unconstrained solution is not a body; moved to the nearest consistent one")
            }
            Self::Saturated { share } => write!(f, "actuators at a limit for {:.1} % of the time", 100.0 * share),
            Self::ShortSeries { times } => write!(
                f,
                "the fitted motion leaves {times:.1} times more of the wrench unexplained than noise does: it has more harmonics than were \
                 fitted, or something is not in the model"
            ),
            Self::Widened => write!(
                f,
                "sigma of least squares is widened by its residual and by its difference from the likelihood: an estimate, no bound"
            ),
            Self::SeriesTooLong { harmonics, samples } => write!(
                f,
                "the likelihood of the series was left at {harmonics} harmonics of {samples} samples: too much work; state fewer \
                 harmonics or log at a lower rate to have it"
            ),
            Self::TrajectoryLikelihood => write!(
                f,
                "no short Fourier series answers for this record: the trajectory likelihood does, with the wrench that acted"
            ),
            Self::LikelihoodFailed => {
                write!(
                    f,
                    "the likelihood did not settle on this record; least squares on the Fourier series answers instead"
                )
            }
        }
    }
}
