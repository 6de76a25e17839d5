//! One stream of noise per source, so that switching one off changes no other.

use tumble_identification::noise::{Gaussian, spread};

/// What draws numbers. The numbers are part of the results: never renumber.
#[derive(Clone, Copy)]
pub(super) enum Source {
    AccelerometerScale = 0,
    AccelerometerMisalignment = 1,
    AccelerometerNoise = 2,
    AccelerometerBias = 3,
    AccelerometerWalk = 4,
    AccelerometerFast = 5,
    GyroScale = 6,
    GyroMisalignment = 7,
    GyroNoise = 8,
    GyroBias = 9,
    GyroWalk = 10,
    GyroFast = 11,
    PositionNoise = 12,
    AttitudeNoise = 13,
    VelocityNoise = 14,
    PositionDrift = 15,
    AttitudeDrift = 16,
    VelocityDrift = 17,
    StampJitter = 18,
    ArrivalJitter = 19,
    DuplicateArrival = 20,
    Drops = 21,
    Bursts = 22,
    Duplicates = 23,
    Jumps = 24,
}

/// The streams of a triad.
pub(super) struct TriadSources {
    pub scale: Source,
    pub misalignment: Source,
    pub noise: Source,
    pub bias: Source,
    pub walk: Source,
    pub fast: Source,
}

impl Source {
    pub(super) const ACCELEROMETER: TriadSources = TriadSources {
        scale: Self::AccelerometerScale,
        misalignment: Self::AccelerometerMisalignment,
        noise: Self::AccelerometerNoise,
        bias: Self::AccelerometerBias,
        walk: Self::AccelerometerWalk,
        fast: Self::AccelerometerFast,
    };
    pub(super) const GYRO: TriadSources = TriadSources {
        scale: Self::GyroScale,
        misalignment: Self::GyroMisalignment,
        noise: Self::GyroNoise,
        bias: Self::GyroBias,
        walk: Self::GyroWalk,
        fast: Self::GyroFast,
    };
}

/// The stream of a source: seeds are spread so that neighbouring seeds and sources share nothing.
pub(super) fn stream(seed: u64, source: Source) -> Gaussian {
    let mixed = spread(seed) ^ (source as u64);
    Gaussian::from_seed(spread(mixed))
}
