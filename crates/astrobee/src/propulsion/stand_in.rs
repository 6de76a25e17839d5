//! Stand-in until blower.rs is merged.
use super::constants::*;
use std::sync::OnceLock;
use tumble_dynamics::nalgebra::{ComplexField, Vector3};
use tumble_lie::Wrench;

fn table() -> &'static Vec<(f64, f64)> {
    static TABLE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    TABLE.get_or_init(|| {
        (0..334)
            .map(|i| {
                let q = f64::from(i) * 0.001;
                let cp = PRESSURE_POLYNOMIAL.iter().rev().fold(0.0, |sum, c| sum * q + c);
                (q * IMPELLER_DIAMETER_M * IMPELLER_HEIGHT_M / (2.0 * cp).sqrt(), cp)
            })
            .collect()
    })
}

pub(super) fn pressure_coefficient(area: f64) -> f64 {
    let t = table();
    let i = t.partition_point(|(a, _)| *a <= area).clamp(1, t.len() - 1);
    let ((a0, c0), (a1, c1)) = (t[i - 1], t[i]);
    c0 + (c1 - c0) * ((area - a0) / (a1 - a0)).clamp(0.0, 1.0)
}

pub(super) fn nozzle_area_m2(nozzle: &Nozzle, flap_rad: f64) -> f64 {
    FLAPS_PER_NOZZLE
        * nozzle.width_m
        * (FLAP_INTAKE_HEIGHT_M - FLAP_LENGTH_M * ComplexField::cos(FLAP_CLOSED_RAD + flap_rad))
}

pub(super) fn thrusts(module: usize, speed: f64, flaps: &[f64; 6]) -> [f64; 6] {
    let nozzles = &NOZZLES[6 * module..6 * module + 6];
    let areas: [f64; 6] = core::array::from_fn(|i| nozzle_area_m2(&nozzles[i], flaps[i]));
    let total = LEAK_AREAS_M2[module] + (0..6).map(|i| areas[i] * nozzles[i].discharge_coefficient).sum::<f64>();
    let pressure = AIR_DENSITY_KG_M3 * (speed * IMPELLER_DIAMETER_M).powi(2) * pressure_coefficient(total);
    core::array::from_fn(|i| 2.0 * pressure * nozzles[i].discharge_coefficient.powi(2) * areas[i])
}

pub(super) fn wrench(module: usize, thrusts: &[f64; 6]) -> Wrench<f64> {
    let mut sum = Wrench::zero();
    for (nozzle, thrust) in NOZZLES[6 * module..6 * module + 6].iter().zip(thrusts) {
        let force = Vector3::from(nozzle.outflow_body) * -*thrust;
        sum = sum + Wrench::new(Vector3::from(nozzle.position_body_m).cross(&force), force);
    }
    sum
}
