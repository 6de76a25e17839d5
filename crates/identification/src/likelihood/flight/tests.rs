//! Tests of the likelihood.
