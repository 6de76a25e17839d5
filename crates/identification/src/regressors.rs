//! Regressors of one rigid body.
