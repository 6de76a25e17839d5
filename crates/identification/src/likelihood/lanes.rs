//! Lanes of a tangent: which column of a row belongs to which unknown.

/// First lane of the wrench noise.
pub(crate) const NOISE: usize = 12;
/// First lane of the parameters: ln m; then the centre of mass and the inertia.
pub(crate) const PARAMETERS: usize = 18;
