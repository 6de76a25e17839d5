//! From cycles of a periodic motion to the parameters: averaging, Fourier fit, harmonic selection, estimation.
