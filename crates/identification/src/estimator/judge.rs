//! Whether a body is identified: by numbers that the judge computes itself.

use super::Finding;
use crate::error::IdentificationError;
use crate::jacobi::singular_values;
use crate::recursive::LinearObservation;
use crate::{BodyScale, FeasibleSet, PseudoInertiaCone};
use nalgebra::{ComplexField, SMatrix, SVector, Vector6};

/// What became of an identification.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Verdict {
    /// The numbers may be used.
    Identified,
    /// They exist, and one thing speaks against them.
    Doubtful(Why),
    /// The data leave directions free.
    NotDetermined {
        /// Directions that they show.
        rank: usize,
        /// Directions asked for.
        asked: usize,
    },
    /// No body explains the record.
    NoBodyExplains {
        /// Share of the wrench that the best one explains.
        share: f64,
    },
}

impl Verdict {
    /// Whether the numbers may be used.
    pub fn is_identified(&self) -> bool {
        *self == Self::Identified
    }

    /// What an error says of a record where it says no more than that the record leaves directions free; `None` for all others.
    pub fn of_refusal(error: &IdentificationError) -> Option<Self> {
        match *error {
            IdentificationError::NotExcited { rank, expected, .. } => {
                Some(Self::NotDetermined { rank, asked: expected })
            }
            // Of nine numbers all but the size of the inertia.
            IdentificationError::WheelNotSpinning { .. } => Some(Self::NotDetermined { rank: 8, asked: 9 }),
            _ => None,
        }
    }
}

/// What speaks against numbers; where several things do, the first of this order.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Why {
    /// The filter asked for lost its way, and a regression answers in its place.
    Diverged {
        /// Time of the sample at which it did, ns.
        time_ns: i64,
    },
    /// Noise that is alike from sample to sample biases the answer.
    Biased {
        /// By how many standard deviations the answer moves with other instruments.
        deviations: f64,
    },
    /// The errors of the poses wander as slowly as the robot moves.
    Wandering {
        /// Factor by which the stated standard deviations fall short.
        sigma_inflation: f64,
    },
    /// The poses are noisy, the likelihood that they need did not settle, and a regression answers in its place.
    StandIn,
    /// What was asked for beside the body can be exchanged with it.
    Exchangeable,
    /// A standard deviation is wide beside the body itself.
    Wide {
        /// Which of the parameters.
        parameter: usize,
        /// In units of the body's size.
        relative: f64,
    },
    /// Its own observations surprised it.
    Surprised {
        /// Mean normalised innovation squared; one where the model holds.
        mean_nis: f64,
    },
    /// It sees all where the second finding leaves directions free: linearised once too boldly, or truly better; nothing confirms it.
    Alone {
        /// Directions that the second finding sees.
        rank: usize,
    },
    /// The wrench answers to the noise of what the motion is measured by, and the answer follows that noise.
    Feedback {
        /// Share of the mean square of the wrench that noise before it explains.
        share: f64,
    },
    /// A controller that knows more of the motion than the record holds the body, and the record shows the body so little that this decides.
    Held {
        /// The widest standard deviation, in units of the body's size.
        relative: f64,
    },
    /// Another way to the same parameters comes to others.
    Disagrees {
        /// Squared distance in joint standard deviations, per parameter.
        chi_square: f64,
    },
    /// They are no body.
    NoBody {
        /// Signed distance from the cone.
        margin: f64,
    },
}

/// What is counted of a finding, whatever its number of parameters, in units of what they are of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Counted {
    /// Directions that the record shows.
    pub(crate) rank: usize,
    /// Directions asked for.
    pub(crate) asked: usize,
    /// The first standard deviation that is too wide, and whose.
    pub(crate) wide: Option<(usize, f64)>,
    /// Mean normalised square of what is left of the observations, where their noise was told.
    pub(crate) mean_nis: Option<f64>,
    /// Directions that a second finding shows.
    pub(crate) other_rank: Option<usize>,
    /// Squared distance of the second finding in joint standard deviations, per parameter.
    pub(crate) chi_square: Option<f64>,
    /// How far inside of what can be.
    pub(crate) margin: Option<f64>,
}

/// Judges findings. White innovations prove nothing about the body (an extended Kalman filter nine standard deviations
/// off had a mean square of 1.04), so that a second finding beside the first is asked for wherever there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judge {
    /// Units of the body.
    pub scale: BodyScale,
    /// Least share of the wrench that a body must explain.
    pub poor_fit: f64,
    /// Widest standard deviation in units of the body's size.
    pub known: f64,
    /// Largest factor by which wandering poses may make standard deviations too small.
    pub wandering: f64,
    /// Largest squared distance per parameter from another finding.
    pub chi_square: f64,
    /// Largest mean of the innovations squared.
    pub mean_nis: f64,
    /// Largest share of the wrench that may be a controller's answer to noise.
    pub feedback: f64,
}

/// What a record says of a point, whoever found it: counted on the library's rows, the same for every candidate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    applied: f64,
    left: f64,
    /// By how many standard deviations the answer moves with other instruments; zero where that is chance or of no consequence.
    pub shift: f64,
    /// Factor by which standard deviations fall short since what the poses leave unexplained is not white; zero where it is.
    pub colour: f64,
    /// Where the filter asked for lost its way, ns.
    pub diverged_ns: Option<i64>,
    /// A regression answers on noisy poses, in the place of a likelihood that did not settle.
    pub stand_in: bool,
    /// Something asked for beside the body can be exchanged with one of the ten.
    pub exchangeable: bool,
    /// Share of the mean square of force or torque, the larger of both, that the noise of the measurements before it explains.
    pub feedback: f64,
    /// The widest standard deviation where a controller holds the body and the motion shows little, in units of the body's size; zero elsewhere.
    pub held: f64,
    /// Squared distance of the bodies of both halves of the record, per parameter; zero where that is chance.
    pub halves: f64,
    /// A table holds the body, and what motion there shows is seen: four numbers are all there is to know.
    pub on_table: bool,
}

impl Evidence {
    /// Of sums of squares of the wrench applied and of what is left of it, torque counted at the body's length.
    #[cfg(feature = "std")]
    pub(crate) fn of_sums(applied: f64, left: f64) -> Self {
        Self { applied, left, ..Self::default() }
    }

    /// Counts a wrench `[torque; force]` and what a body leaves of it.
    pub fn count(&mut self, applied: &Vector6<f64>, left: &Vector6<f64>, length_m: f64) {
        let size = |w: &Vector6<f64>| {
            w.fixed_rows::<3>(0).norm_squared() / (length_m * length_m) + w.fixed_rows::<3>(3).norm_squared()
        };
        self.applied += size(applied);
        self.left += size(left);
    }

    /// Counts a row at a point.
    pub fn count_row(&mut self, row: &LinearObservation<6, 10>, point: &SVector<f64, 10>, length_m: f64) {
        self.count(&row.output, &(row.regressor * point - row.output), length_m);
    }

    /// Share of the wrench's mean square that the point explains; none where there was no wrench.
    pub fn explained(&self) -> Option<f64> {
        (self.applied > 0.0).then(|| 1.0 - self.left / self.applied)
    }
}

impl Judge {
    /// The usual levels.
    pub const fn new(scale: BodyScale) -> Self {
        Self { scale, poor_fit: 0.5, known: 1.0, wandering: 2.0, chi_square: 4.0, mean_nis: 1.2, feedback: 0.2 }
    }

    /// Directions that the data show of parameters of these sizes. In units of one sigma and of the body a direction is seen where its
    /// singular value exceeds one; a prior sees nothing.
    fn rank<const P: usize>(&self, found: &Finding<P>, sizes: &SVector<f64, P>) -> Result<usize, IdentificationError> {
        let (values, _) = singular_values(found.signal()?.scaled_factor(sizes));
        let strongest = values.max();
        let tolerance = if strongest > 0.0 { (1.0 / (self.known * strongest)).min(1.0) } else { 1.0 };
        Ok(values.iter().filter(|value| **value > tolerance * strongest).count())
    }

    /// The verdict on a finding, beside evidence of the record and perhaps another finding of the same.
    ///
    /// # Errors
    /// [`IdentificationError::NotFinite`] for a finding that is none.
    pub fn judge(
        &self,
        found: &Finding<10>,
        evidence: &Evidence,
        other: Option<&Finding<10>>,
    ) -> Result<Verdict, IdentificationError> {
        if let Some(verdict) = self.of_share(evidence) {
            return Ok(verdict);
        }
        let (cone, sizes) = (PseudoInertiaCone::new(self.scale), self.scale.parameter_magnitudes());
        let margin = |point: &SVector<f64, 10>| cone.margin(point);
        Ok(self.weigh(&self.count(found, &sizes, other, margin)?, evidence))
    }

    /// What is counted of a finding of parameters of these sizes, beside another of the same; `margin` is how far inside of what can be a
    /// point lies.
    pub(crate) fn count<const P: usize>(
        &self,
        found: &Finding<P>,
        sizes: &SVector<f64, P>,
        other: Option<&Finding<P>>,
        margin: impl Fn(&SVector<f64, P>) -> f64,
    ) -> Result<Counted, IdentificationError> {
        let counted = Counted { rank: self.rank(found, sizes)?, asked: P, ..Counted::default() };
        let Some(point) = found.point().filter(|_| counted.rank == P) else {
            return Ok(Counted { rank: counted.rank.min(P.saturating_sub(1)), ..counted });
        };
        let covariance = found.covariance()?;
        let relative = (0..P).map(|i| ComplexField::sqrt(covariance[(i, i)]) / sizes[i]);
        let other_rank = other.map(|other| self.rank(other, sizes)).transpose()?;
        let mut chi_square = None;
        if let Some((other, there)) =
            other.filter(|_| other_rank == Some(P)).and_then(|other| Some((other, other.point()?)))
        {
            let apart = (point - there).component_div(sizes);
            let joint = covariance + other.covariance()?;
            let joint = SMatrix::<f64, P, P>::from_fn(|i, j| joint[(i, j)] / (sizes[i] * sizes[j]));
            chi_square = Some(joint.cholesky().map_or(f64::INFINITY, |c| apart.dot(&c.solve(&apart)) / P as f64));
        }
        Ok(Counted {
            wide: self.first_wide(relative),
            mean_nis: found.surprise(),
            other_rank,
            chi_square,
            margin: Some(margin(point)),
            ..counted
        })
    }

    /// The first of standard deviations, in units of what they are of, that is too wide.
    pub(crate) fn first_wide(&self, relative: impl IntoIterator<Item = f64>) -> Option<(usize, f64)> {
        relative.into_iter().enumerate().find(|(_, relative)| relative.is_nan() || *relative >= self.known)
    }

    /// The verdict on what was counted, whatever the number of parameters.
    pub(crate) fn weigh(&self, counted: &Counted, evidence: &Evidence) -> Verdict {
        if let Some(verdict) = self.of_share(evidence) {
            return verdict;
        }
        let Counted { rank, asked, .. } = *counted;
        if rank < asked && !evidence.on_table {
            return Verdict::NotDetermined { rank, asked };
        }
        let of_numbers = || self.of_numbers(counted).filter(|_| rank == asked);
        let why = self.of_record(evidence).or_else(of_numbers).or(Self::of_halves(evidence));
        why.map_or(Verdict::Identified, Verdict::Doubtful)
    }

    /// A verdict beside evidence that came to light after it: what is identified is doubted where that speaks against it.
    pub fn again(&self, verdict: Verdict, evidence: &Evidence) -> Verdict {
        if !verdict.is_identified() {
            return verdict;
        }
        self.of_record(evidence).or(Self::of_halves(evidence)).map_or(Verdict::Identified, Verdict::Doubtful)
    }

    fn of_share(&self, evidence: &Evidence) -> Option<Verdict> {
        let share = evidence.explained().filter(|share| *share < self.poor_fit)?;
        Some(Verdict::NoBodyExplains { share })
    }

    fn of_halves(evidence: &Evidence) -> Option<Why> {
        (evidence.halves > 0.0).then_some(Why::Disagrees { chi_square: evidence.halves })
    }

    fn of_record(&self, evidence: &Evidence) -> Option<Why> {
        if let Some(time_ns) = evidence.diverged_ns {
            return Some(Why::Diverged { time_ns });
        }
        if evidence.shift > 0.0 {
            return Some(Why::Biased { deviations: evidence.shift });
        }
        if evidence.colour > self.wandering {
            return Some(Why::Wandering { sigma_inflation: evidence.colour });
        }
        if evidence.stand_in {
            return Some(Why::StandIn);
        }
        if evidence.exchangeable {
            return Some(Why::Exchangeable);
        }
        if evidence.feedback > self.feedback {
            return Some(Why::Feedback { share: evidence.feedback });
        }
        (evidence.held > 0.0).then_some(Why::Held { relative: evidence.held })
    }

    fn of_numbers(&self, counted: &Counted) -> Option<Why> {
        if let Some((parameter, relative)) = counted.wide {
            return Some(Why::Wide { parameter, relative });
        }
        if let Some(mean_nis) = counted.mean_nis.filter(|mean| mean.is_nan() || *mean > self.mean_nis) {
            return Some(Why::Surprised { mean_nis });
        }
        if let Some(rank) = counted.other_rank.filter(|rank| *rank < counted.asked) {
            return Some(Why::Alone { rank });
        }
        if let Some(chi_square) = counted.chi_square.filter(|chi_square| *chi_square > self.chi_square) {
            return Some(Why::Disagrees { chi_square });
        }
        counted.margin.filter(|margin| *margin <= 0.0).map(|margin| Why::NoBody { margin })
    }
}
