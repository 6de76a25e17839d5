//! Trees of rigid bodies: ten numbers for each unknown body, nuisances beside them, and data that never tell all.
//!
//! Rows come in as slices, whoever forms them; a [`ParameterLayout`] says what their columns mean. [`LinkInformation`] keeps
//! all that the rows say in one triangle. [`BaseParameters`] says in words what they cannot tell apart and estimates what they
//! can. [`ConsistentLinks`] finds bodies made of mass: where the data are silent a prior speaks, and nowhere else.
//!
//! All scalars are `f64`: decisions are made here, derivatives do not flow through.

mod base_parameters;
mod cone_program;
mod consistent_links;
mod finding;
mod joint_excitation;
mod joint_track;
mod layout;
mod link_information;
mod local_fit;
mod momentum_rows;
mod reflections;
mod singular_values;
#[cfg(test)]
#[cfg(feature = "testing")]
mod tests;
mod torque_rows;
mod tree_estimator;
mod tree_part;
mod tree_sample;
#[cfg(test)]
mod tree_tests;
mod tree_verdict;
mod words;

pub use base_parameters::{BaseParameters, LinearValue};
pub use consistent_links::{ConsistentLinks, LinkPrior, LinksEstimate, Origin};
pub use finding::{DynEstimator, DynFinding};
pub use joint_excitation::{ExcitedBase, JointDesign, JointExcitation, JointMotion, JointRange};
pub use joint_track::{JointTrack, with_accelerations};
pub use layout::{LinkNuisance, ParameterLayout, UnknownBody};
pub use link_information::LinkInformation;
pub use momentum_rows::VelocityNoise;
pub use torque_rows::{Drive, JointNuisance};
pub use tree_estimator::{GainRegression, MomentumForm, TorqueForm, TreeEstimate, TreeEstimator, TreeRecord};
pub use tree_part::TreePart;
pub use tree_sample::{TreeAcceleration, TreeSample};
pub use words::{BaseParameter, IndistinguishableChange, Term};
