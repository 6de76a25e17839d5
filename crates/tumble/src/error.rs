//! Errors of the command line: each with a code, the place and the remedy. All codes stand in `docs/errors.md`.

use std::error::Error as _;
use std::path::PathBuf;
#[cfg(feature = "astrobee")]
use tumble_astrobee::AstrobeeError;
use tumble_formats::FormatsError;
use tumble_identification::IdentificationError;
use tumble_identification::estimator::EstimatorError;
use tumble_planning::PlanningError;

/// Of what is somebody else's.
const REMEDY_OF_A_PART: &str = "the part named says what it lacks: correct that, or do without it";

/// What can go wrong between a user's files and a result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TumbleError {
    /// A file that cannot be read or written.
    #[error(transparent)]
    File(#[from] FormatsError),
    /// The simulated robot refuses.
    #[cfg(feature = "astrobee")]
    #[error(transparent)]
    Robot(#[from] AstrobeeError),
    /// T025: sensors of a file that the simulated robot does not fly.
    #[cfg(feature = "astrobee")]
    #[error("{path}: {source}")]
    SensingNotFlown {
        /// The file, or the name of sensors.
        path: PathBuf,
        /// The key, and what would be flown.
        source: AstrobeeError,
    },
    /// T010: an output that exists already.
    #[error("{path} exists already")]
    OutputExists {
        /// The file or folder.
        path: PathBuf,
    },
    /// T020: `--force` on something that is not an earlier result.
    #[error("{path} is not a result folder of this program; `--force` replaces nothing else")]
    NotAResult {
        /// The file or folder.
        path: PathBuf,
    },
    /// T014: options that do not fit together or have no value.
    #[error("{message}")]
    BadOption {
        /// Which option, and why.
        message: String,
    },
    /// T015: the estimator refuses the data.
    #[error(transparent)]
    Identification(#[from] IdentificationError),
    /// T015, or T014 for a name that no method bears: an estimator of a program's own refuses, or gives what cannot be.
    #[error(transparent)]
    Estimator(EstimatorError),
    /// T016: the simulation behind the demo failed; T037: actuators from outside refuse.
    #[error(transparent)]
    Dynamics(#[from] tumble_dynamics::DynamicsError),
    /// T017: a picture cannot be drawn.
    #[error("cannot draw {path}: {message}")]
    Plot {
        /// The picture.
        path: PathBuf,
        /// What the drawing library said.
        message: String,
    },
    /// T021: a search that would not end in any time worth waiting for.
    #[error("`{option} {count}`: at most {most}, since {because}")]
    SearchTooLong {
        /// Option.
        option: &'static str,
        /// What was asked for.
        count: usize,
        /// Most that is searched.
        most: usize,
        /// What makes it long.
        because: &'static str,
    },
    /// T021: an excitation that cannot be designed or flown.
    #[error("no such excitation: {0}")]
    Excitation(#[source] IdentificationError),
    /// T026: a scenario that does not parse, or asks for something impossible.
    #[error("{path}, line {line}, column {column}: {message}")]
    BadScenario {
        /// The file, or the name of an embedded scenario.
        path: PathBuf,
        /// Line, counted from one.
        line: usize,
        /// Column, counted from one.
        column: usize,
        /// The key, and what is wrong with it.
        message: String,
    },
    /// T026: a scenario that neither exists as a file nor is embedded.
    #[error("there is no scenario `{name}`, neither as a file nor embedded{nearest}")]
    NoSuchScenario {
        /// What was asked for.
        name: String,
        /// "; did you mean ...", or nothing.
        nearest: String,
    },
    /// T033: a planning problem that cannot be posed.
    #[error("no plan can be asked for: {0}")]
    Planning(#[from] PlanningError),
    /// T034: a plan that does not hold what it promises.
    #[error("the planner contradicts itself: {reason}")]
    PlanContradiction {
        /// What does not hold, with its numbers.
        reason: String,
    },
    /// T035: a controller that refuses what it is given.
    #[error("the controller refuses: {0}")]
    Control(#[source] PlanningError),
    /// T040: parts or a folder of a campaign that do not belong together.
    #[error("{path}: {message}")]
    BadCampaign {
        /// The folder or file.
        path: PathBuf,
        /// What is missing, twice there, or other than the rest.
        message: String,
    },
    /// T041: a campaign's unfinished folder that another process writes to.
    #[error("{path}: another process flies this campaign now")]
    CampaignInUse {
        /// The unfinished folder.
        path: PathBuf,
    },
    /// T036: a page that is no mission report, or a damaged one.
    #[error("{path}, line {line}: {message}")]
    BadReport {
        /// The page.
        path: PathBuf,
        /// Line of the page, counted from one.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// T037: a hook or runner of missions from outside refuses.
    #[error("{by}: {source}")]
    Foreign {
        /// Its name.
        by: &'static str,
        /// What it says.
        source: tumble_dynamics::ForeignError,
    },
}

/// An error of the library's own estimators is one of identification.
impl From<EstimatorError> for TumbleError {
    fn from(error: EstimatorError) -> Self {
        match error {
            EstimatorError::Library(error) => Self::Identification(error),
            other => Self::Estimator(other),
        }
    }
}

impl From<tumble_formats::wheel_throw::WheelThrowError> for TumbleError {
    fn from(error: tumble_formats::wheel_throw::WheelThrowError) -> Self {
        Self::File(error.into())
    }
}

#[cfg(feature = "astrobee")]
impl From<tumble_astrobee::simulator::SimulatorError> for TumbleError {
    fn from(error: tumble_astrobee::simulator::SimulatorError) -> Self {
        Self::Robot(error.into())
    }
}

impl TumbleError {
    /// An error of somebody else's hook or runner of missions.
    pub fn foreign(by: &'static str, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Foreign { by, source: tumble_dynamics::ForeignError::made(source) }
    }

    /// What the command line says of options that it does not take.
    pub(crate) fn of_options(refusal: &clap::Error) -> Self {
        let text = refusal.render().to_string();
        let message = text.strip_prefix("error: ").unwrap_or(&text);
        let sentence = message.split("\n\n").next().unwrap_or(message);
        Self::BadOption { message: sentence.split_whitespace().collect::<Vec<_>>().join(" ") }
    }

    /// The code under which `docs/errors.md` explains this error.
    pub fn code(&self) -> &'static str {
        match self {
            Self::File(error) => error.code(),
            #[cfg(feature = "astrobee")]
            Self::Robot(error) | Self::SensingNotFlown { source: error, .. } => error.code(),
            Self::OutputExists { .. } => "T010",
            Self::NotAResult { .. } => "T020",
            Self::BadOption { .. } | Self::Estimator(EstimatorError::Unknown(_)) => "T014",
            Self::Identification(_) | Self::Estimator(_) => "T015",
            Self::Dynamics(tumble_dynamics::DynamicsError::Foreign { .. }) | Self::Foreign { .. } => "T037",
            Self::Dynamics(_) => "T016",
            Self::Plot { .. } => "T017",
            Self::Excitation(_) | Self::SearchTooLong { .. } => "T021",
            Self::BadScenario { .. } | Self::NoSuchScenario { .. } => "T026",
            Self::Planning(_) => "T033",
            Self::PlanContradiction { .. } => "T034",
            Self::Control(_) => "T035",
            Self::BadCampaign { .. } => "T040",
            Self::CampaignInUse { .. } => "T041",
            Self::BadReport { .. } => "T036",
        }
    }

    /// What the user can do about it.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::File(error) => error.remedy(),
            #[cfg(feature = "astrobee")]
            Self::Robot(error) | Self::SensingNotFlown { source: error, .. } => error.remedy(),
            Self::OutputExists { .. } => "name another place, or replace it with `--force`",
            Self::NotAResult { .. } => "name a new folder, or remove this one yourself",
            Self::PlanContradiction { .. } => {
                "nothing was written: report it with the scenario and the seed; numbers nearer to one another may do"
            }
            Self::BadOption { .. } | Self::Estimator(EstimatorError::Unknown(_)) => {
                "correct or leave out the option named; `tumble help COMMAND` explains each"
            }
            Self::Estimator(_) => "the estimator named says what it lacks: correct that, or ask for another `--method`",
            Self::Dynamics(tumble_dynamics::DynamicsError::Foreign { .. }) | Self::Foreign { .. } => REMEDY_OF_A_PART,
            // Errors of the library have no source: this one is somebody else's.
            Self::Identification(error) if error.source().is_some() => REMEDY_OF_A_PART,
            Self::Identification(error) => match error {
                IdentificationError::MissingColumn(_) => {
                    "`tumble identify --template` prints every column of a CSV log; `docs/recordings.md` says which topics of a recording \
                     give what"
                }
                IdentificationError::TooFewSamples { .. } | IdentificationError::NoResidual { .. } => {
                    "record more samples, in steps as equal as can be; of a held-out part, keep back a larger share"
                }
                IdentificationError::NotConverged { .. } => {
                    "the data contradict every body: check the sign and frame of the wrench and the units"
                }
                IdentificationError::LikelihoodNotConverged { .. } => {
                    "check the timing of the wrench, units and frames; ask for fewer quantities beside the body, or take a regression: \
                     `--method variational4`"
                }
                IdentificationError::InvalidPeriod { .. } | IdentificationError::PeriodNotWhole { .. } => {
                    "state the period that was flown with `--excitation` or `--period`, sampled a whole number of times"
                }
                IdentificationError::TooFewCycles { .. } => "fly more cycles, or state the period that was flown",
                IdentificationError::NoHarmonics => {
                    "state with `--harmonics` how many the reference motion has: one or more"
                }
                IdentificationError::TooManyHarmonics { .. } => "fewer harmonics, or a higher sampling rate",
                IdentificationError::UnequalSteps { .. } | IdentificationError::WrenchMissing { .. } => {
                    "averaging needs a wrench in every row at equal steps: leave out `--excitation` or `--period` for this log"
                }
                IdentificationError::NotPeriodic { .. } => {
                    "state the period that was flown; of a robot that turns on and on, leave out `--excitation` or `--period`"
                }
                _ => "check units, signs and frames; record motion and wrench about every axis",
            },
            Self::Dynamics(_) => "please report this with the seed",
            Self::Plot { .. } => "leave out `--out`, or report this",
            Self::SearchTooLong { .. } => {
                "a number within the bound; three starts and three to eight harmonics show almost all"
            }
            Self::Excitation(error) => match error {
                IdentificationError::TooManySamples { .. } => "a shorter `--period`, or a lower `--rate`",
                IdentificationError::PeriodNotWhole { .. } => "change `--period` or `--rate` to the values named",
                IdentificationError::TooManyHarmonics { .. } => "fewer `--harmonics`, or a higher `--rate`",
                IdentificationError::NoFreeCoefficients { .. } => "two `--harmonics` or more, such as 3",
                IdentificationError::NoMotionWithinLimit { .. } => "limits are positive, or inf",
                IdentificationError::UnlimitedChannel { .. } => {
                    "limit the workspace (`--position`, `--angle`), the rate or the acceleration"
                }
                IdentificationError::NoDesign { .. } => {
                    "more `--starts` or `--harmonics`; limits of the size of the robot's own: much tighter in one channel, or wider by \
                     orders of magnitude than in another, they leave numbers that cannot be compared"
                }
                _ => "more `--starts`, more `--harmonics`, or other limits",
            },
            Self::BadScenario { .. } => "correct the named key; `docs/scenarios.md` describes every one",
            Self::NoSuchScenario { .. } => {
                "`tumble scenario list` prints the embedded ones; `tumble scenario show NAME` prints one to start from"
            }
            Self::Planning(error) | Self::Control(error) if error.source().is_some() => {
                "the layer named says what it lacks: correct that, or ask for another of its kind"
            }
            Self::Planning(_) => {
                "correct `[plan]`, `[plan.local]`, `[start]` or `[goal]`; where a step is too long, make `plan.local.step_s` shorter or the limits of \
                 `[plan.local]` wider; `docs/planning.md` says what is asked of them"
            }
            Self::Control(_) => {
                "correct `[belief]`, `[drive.control]` or `[[drive.beliefs]]` of the scenario; `docs/scenarios.md` describes every key"
            }
            Self::BadCampaign { .. } => {
                "merge all parts of one campaign, flown by one version with the same options; an unfinished part is finished by the command \
                 that began it, another campaign needs another folder; `docs/campaigns.md`"
            }
            Self::CampaignInUse { .. } => "wait for it, end it, or name another folder with `--out`",
            Self::BadReport { .. } => {
                "name a `report.html` as `tumble fly` wrote it; with the seed and the options of its header the flight can be redone without it"
            }
        }
    }
}
