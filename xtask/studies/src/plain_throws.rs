//! Plain least squares on wheel-driven throws, the yardstick of `delft_throws`: each throw filtered at 20 Hz without phase
//! (Butterworth of order four, there and back), differentiated, and its torque balance solved sample by sample, over the
//! same stretch of the fall as the estimator it is held against.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use tumble_formats::wheel_throw::CalibrationBodies;
use tumble_identification::wheel::{
    FreeFallEstimate, ThrowRecord, ThrowSettings, lever_arm_regressor, torque_regressor, wheel_torque,
};

const CUTOFF_HZ: f64 = 20.0;
/// Record mirrored before and after it, in cycles of the cutoff.
const MIRRORED_CYCLES: f64 = 2.0;
/// Quality of the two second-order sections of a Butterworth filter of order four.
const SECTIONS: [f64; 2] = [0.541_196_100_146_197, 1.306_562_964_876_377];

/// One throw by plain least squares: inertia in units of the wheel's and centre of mass, m.
struct Reading {
    inertia_ratio: Matrix3<f64>,
    com_m: Vector3<f64>,
}

/// A device calibrated by plain least squares.
pub struct PlainDevice {
    device: Reading,
    device_mass_kg: f64,
    wheel_inertia_kg_m2: f64,
    settings: ThrowSettings,
}

impl PlainDevice {
    /// By the means of the throws of the device alone and with the proof block; `None` where they determine nothing.
    pub fn calibrated(
        device: &[ThrowRecord],
        proof: &[ThrowRecord],
        bodies: &CalibrationBodies,
        settings: &ThrowSettings,
    ) -> Option<Self> {
        let (device, proof) = (mean(device, settings)?, mean(proof, settings)?);
        let block = bodies.proof_block().inertia_about_com();
        let added = block + joining(&device, &proof, bodies.device_mass_kg, bodies.proof_mass_kg);
        let ratio = proof.inertia_ratio - device.inertia_ratio;
        let wheel_inertia_kg_m2 = ratio.dot(&added) / ratio.norm_squared();
        Some(Self { device, device_mass_kg: bodies.device_mass_kg, wheel_inertia_kg_m2, settings: *settings })
    }

    /// Principal inertias of the object of one throw, ascending, kg m^2.
    pub fn principal_inertia(&self, throw: &ThrowRecord, mass_kg: f64) -> Option<Vector3<f64>> {
        let common = read(throw, &self.settings)?;
        let inertia = (common.inertia_ratio - self.device.inertia_ratio) * self.wheel_inertia_kg_m2
            - joining(&self.device, &common, self.device_mass_kg, mass_kg);
        let mut principal = inertia.symmetric_eigenvalues();
        principal.as_mut_slice().sort_by(f64::total_cmp);
        Some(principal)
    }
}

/// What joining device and object adds to their inertias: `mu (|d|^2 1 - d d^T)`, `d` between their centres of mass.
fn joining(device: &Reading, common: &Reading, device_kg: f64, object_kg: f64) -> Matrix3<f64> {
    let total_kg = device_kg + object_kg;
    let between = (common.com_m - device.com_m) * (total_kg / object_kg);
    let about = Matrix3::identity() * between.norm_squared() - between * between.transpose();
    about * (device_kg * object_kg / total_kg)
}

fn mean(throws: &[ThrowRecord], settings: &ThrowSettings) -> Option<Reading> {
    let readings = throws.iter().map(|throw| read(throw, settings)).collect::<Option<Vec<_>>>()?;
    let n = readings.len() as f64;
    (n > 0.0).then(|| Reading {
        inertia_ratio: readings.iter().map(|reading| reading.inertia_ratio).sum::<Matrix3<f64>>() / n,
        com_m: readings.iter().map(|reading| reading.com_m).sum::<Vector3<f64>>() / n,
    })
}

fn read(throw: &ThrowRecord, settings: &ThrowSettings) -> Option<Reading> {
    let stretch = settings.start_s..=FreeFallEstimate::from_throw(throw, settings).ok()?.end_s;
    let samples = throw.samples();
    let last = samples.len().checked_sub(1)?;
    let step_s = (samples[last].time_s - samples[0].time_s) / last as f64;
    let measured: Vec<SVector<f64, 7>> = samples
        .iter()
        .map(|sample| {
            let (w, a) = (sample.rate_body, sample.specific_force_body);
            SVector::from([w.x, w.y, w.z, a.x, a.y, a.z, sample.wheel_speed_rad_s])
        })
        .collect();
    let filtered = zero_phase(&measured, step_s);

    let (mut information, mut output) = (SMatrix::<f64, 6, 6>::zeros(), SVector::<f64, 6>::zeros());
    let (mut com_information, mut com_output) = (Matrix3::zeros(), Vector3::zeros());
    for k in (1..last).filter(|k| stretch.contains(&samples[*k].time_s)) {
        let derivative = (filtered[k + 1] - filtered[k - 1]) / (samples[k + 1].time_s - samples[k - 1].time_s);
        let (rate, acceleration) = (vector(&filtered[k], 0), vector(&derivative, 0));
        let regressor = torque_regressor(&rate, &acceleration);
        information += regressor.transpose() * regressor;
        output += regressor.transpose() * wheel_torque(&rate, filtered[k][6], derivative[6]);
        let regressor = lever_arm_regressor(&rate, &acceleration);
        com_information += regressor.transpose() * regressor;
        com_output += regressor.transpose() * vector(&filtered[k], 3);
    }
    let x = information.cholesky()?.solve(&output);
    Some(Reading {
        inertia_ratio: Matrix3::new(x[0], x[1], x[2], x[1], x[3], x[4], x[2], x[4], x[5]),
        com_m: com_information.cholesky()?.solve(&com_output),
    })
}

fn vector(all: &SVector<f64, 7>, first: usize) -> Vector3<f64> {
    all.fixed_rows::<3>(first).into_owned()
}

/// The filter there and back over the record, which is continued by its own mirror image through the end points.
fn zero_phase(measured: &[SVector<f64, 7>], step_s: f64) -> Vec<SVector<f64, 7>> {
    let Some((first, last)) = measured.first().zip(measured.last()) else {
        return Vec::new();
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive whole number")]
    let mirrored = ((MIRRORED_CYCLES / CUTOFF_HZ / step_s).ceil() as usize).min(measured.len() - 1);
    let before = (1..=mirrored).rev().map(|k| first * 2.0 - measured[k]);
    let after = (1..=mirrored).map(|k| last * 2.0 - measured[measured.len() - 1 - k]);
    let mut signal: Vec<_> = before.chain(measured.iter().copied()).chain(after).collect();
    for _ in 0..2 {
        for quality in SECTIONS {
            second_order(&mut signal, quality, step_s);
        }
        signal.reverse();
    }
    signal[mirrored..signal.len() - mirrored].to_vec()
}

/// A second-order low pass by the bilinear transform, the cutoff kept; it starts at rest at the first value.
fn second_order(signal: &mut [SVector<f64, 7>], quality: f64, step_s: f64) {
    let warped = (std::f64::consts::PI * CUTOFF_HZ * step_s).tan();
    let square = warped * warped;
    let scale = 1.0 / (1.0 + warped / quality + square);
    let gain = square * scale;
    let (by_one, by_two) = (2.0 * (square - 1.0) * scale, (1.0 - warped / quality + square) * scale);
    let start = signal.first().copied().unwrap_or_default();
    let (mut input, mut output) = ([start; 2], [start; 2]);
    for value in signal {
        let next = (*value + input[0] * 2.0 + input[1]) * gain - output[0] * by_one - output[1] * by_two;
        (input, output) = ([*value, input[0]], [next, output[0]]);
        *value = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// There and back, Butterworth of order four passes `1 / (1 + (f / cutoff)^8)`, with no phase.
    #[test]
    fn the_filter_is_the_one_it_says() {
        let step_s = 5e-4;
        for hertz in [0.0, 5.0, 20.0, 40.0] {
            let at = |k: usize| (std::f64::consts::TAU * hertz * (k as f64 - 2000.0) * step_s).cos();
            let signal: Vec<SVector<f64, 7>> = (0..4001).map(|k| SVector::repeat(at(k))).collect();
            let filtered = zero_phase(&signal, step_s);
            let expected = 1.0 / (1.0 + (hertz / CUTOFF_HZ).powi(8));
            for k in [1950, 2000, 2013] {
                let error = filtered[k][3] - expected * at(k);
                assert!(error.abs() < 1e-3, "{hertz} Hz, sample {k}: {error}");
            }
        }
    }
}
