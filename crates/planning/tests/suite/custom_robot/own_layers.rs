//! Layers of somebody else's: an estimator, planners of ways and of stretches, an office in a thread.
