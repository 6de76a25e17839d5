//! The wrenches that the nozzles give exactly, as half-spaces a planner can keep within.

use super::ImpellerMode;
use super::blower::{LARGEST_THRUST_RATIO, pressure_coefficient_of_thrust, pressure_pa};
use super::constants::{AXIS_GROUPS, FLAP_TRAVEL_RAD, NOZZLES, Nozzle};
use super::nozzle::{Module, thrusts_of_wrench, thrusts_to_wrench};
use nalgebra::{SVector, Vector3};
use tumble_lie::Wrench;
use tumble_planning::local::WrenchSet;

/// How much of the largest total thrust each module may give. Less leaves more pressure, so that single nozzles reach farther.
const SHARE_OF_TOTAL: f64 = 0.8;
/// Flaps stay this share before their stop.
const HAIR: f64 = 1e-9;

/// Wrenches about the body origin that [`ForceAllocation`](super::ForceAllocation) gives exactly; `None` with impellers off.
///
/// The more thrust a module gives, the lower its pressure, and the less each of its nozzles can give. The true set,
/// `T_i <= t_i(sum of T)` with the thrusts `T` after the shift, is convex, but it needs some 600 half-spaces to come near. These
/// are 164: each module's total is at most 0.8 of the largest, and each nozzle gives at most what it can at the pressure of
/// that total. Along a random direction they reach 76 % to 100 % as far as the true set, 85 % in the median.
/// # Frame
/// `[torque; force]`, body axes.
/// # Source
/// (6.14)-(6.20); the shift is the flown one, by axis groups.
pub fn nozzle_wrench_set(mode: ImpellerMode) -> Option<WrenchSet<6>> {
    if mode == ImpellerMode::Off {
        return None;
    }
    let speed_rad_s = mode.speed_rad_s();
    let total_n = SHARE_OF_TOTAL * LARGEST_THRUST_RATIO * (speed_rad_s * speed_rad_s);
    let ratio = SHARE_OF_TOTAL * LARGEST_THRUST_RATIO;
    let pressure_pa = pressure_pa(speed_rad_s, pressure_coefficient_of_thrust(ratio));
    let largest_n = |nozzle: &Nozzle| (1.0 - HAIR) * nozzle.thrust_n(nozzle.area_m2(FLAP_TRAVEL_RAD), pressure_pa);
    let largest_n = NOZZLES.each_ref().map(largest_n);

    let thrusts = thrusts_by_wrench();
    let mut half_spaces = Vec::new();
    for group in AXIS_GROUPS {
        // The thrust of a nozzle after the shift is its own less the least of its group.
        for nozzle in group {
            for least in group.into_iter().filter(|least| *least != nozzle) {
                half_spaces.push(((thrusts[nozzle] - thrusts[least]).into(), largest_n[nozzle]));
            }
        }
    }
    for module in Module::ALL {
        half_spaces.extend(totals(module, &thrusts).map(|normal| (normal, total_n)));
    }
    Some(WrenchSet { limit: box_around(&largest_n), half_spaces })
}

/// Row by row, what a wrench asks of each nozzle before the shift.
fn thrusts_by_wrench() -> [SVector<f64, 6>; 12] {
    let mut rows = [SVector::<f64, 6>::zeros(); 12];
    for component in 0..6 {
        let thrusts = thrusts_of_wrench(&wrench(&SVector::ith(component, 1.0)));
        for (row, thrust) in rows.iter_mut().zip(thrusts) {
            row[component] = thrust;
        }
    }
    rows
}

fn wrench(components: &SVector<f64, 6>) -> Wrench<f64> {
    Wrench::new(components.fixed_rows::<3>(0).into(), components.fixed_rows::<3>(3).into())
}

/// The sum of a module's thrusts over discharge coefficients, for each choice of the least nozzles of the three groups: it is
/// the largest of these.
fn totals(module: Module, thrusts: &[SVector<f64, 6>; 12]) -> impl Iterator<Item = [f64; 6]> {
    let is_own = move |nozzle: usize| (nozzle < 6) == (module == Module::Starboard);
    let share = move |group: [usize; 4], least: usize| {
        let own = group.into_iter().filter(move |nozzle| is_own(*nozzle));
        own.map(|nozzle| (thrusts[nozzle] - thrusts[least]) / NOZZLES[nozzle].discharge_coefficient)
            .fold(SVector::<f64, 6>::zeros(), |sum, part| sum + part)
    };
    let [x, y, z] = AXIS_GROUPS;
    x.into_iter().flat_map(move |a| {
        y.into_iter().flat_map(move |b| z.into_iter().map(move |c| (share(x, a) + share(y, b) + share(z, c)).into()))
    })
}

/// A box around all wrenches of thrusts up to these.
fn box_around(largest_n: &[f64; 12]) -> [f64; 6] {
    let to_wrench = thrusts_to_wrench(&Vector3::zeros());
    core::array::from_fn(|component| {
        let row = to_wrench.row(component);
        let reach = |sign: f64| -> f64 { row.iter().zip(largest_n).map(|(b, n)| f64::max(sign * b, 0.0) * n).sum() };
        f64::max(reach(1.0), reach(-1.0))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::propulsion::ForceAllocation;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng as _;
    use tumble_dynamics::Actuation as _;
    use tumble_identification::noise::signed_unit;

    /// How far a direction may be scaled.
    fn reach(set: &WrenchSet<6>, direction: &SVector<f64, 6>) -> f64 {
        let most = |(normal, offset): &([f64; 6], f64)| {
            let along = SVector::from(*normal).dot(direction);
            if along > 0.0 { offset / along } else { f64::INFINITY }
        };
        set.half_spaces.iter().map(most).fold(f64::INFINITY, f64::min)
    }

    /// Whether the flaps can do it, and by how much what they give then is wrong.
    fn given(allocation: &ForceAllocation, components: &SVector<f64, 6>) -> (bool, f64) {
        let wanted = wrench(components);
        let steps = allocation.allocate_steps(&wanted).unwrap();
        let error = (allocation.realize(&steps.flaps) - wanted).to_vector().amax();
        (!steps.limits.is_saturated(), error)
    }

    #[test]
    fn what_is_inside_is_given_and_what_is_far_outside_is_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut uniform = move || signed_unit(&mut rng);
        for mode in [ImpellerMode::Quiet, ImpellerMode::Nominal, ImpellerMode::Aggressive] {
            let set = nozzle_wrench_set(mode).unwrap();
            assert_eq!(set.half_spaces.len(), 164);
            let allocation = ForceAllocation::new(mode, Vector3::new(0.01, -0.02, 0.005));
            let mut shares = Vec::new();
            for round in 0..2000 {
                // Every third along few components, where the set has its corners.
                let keep = |value: f64, gate: f64| if round % 3 == 0 && gate < 0.0 { 0.0 } else { value };
                let mut direction = SVector::<f64, 6>::from_fn(|row, _| keep(uniform() * set.limit[row], uniform()));
                if direction.amax() == 0.0 {
                    direction[round % 6] = 1.0;
                }
                let most = reach(&set, &direction);
                for inside in [1.0, 0.5, 1e-3] {
                    let asked = direction * (most * inside);
                    let (is_given, error) = given(&allocation, &asked);
                    // Flaps open no less than rounding allows, which leaves 2e-5 N per nozzle.
                    assert!(is_given && error < 5e-5, "{mode:?} {inside} {asked:?}: {error}");
                    assert!((0..6).all(|row| asked[row].abs() <= set.limit[row]), "{asked:?}");
                }
                let (mut low, mut high) = (most, 4.0 * most);
                assert!(!given(&allocation, &(direction * high)).0, "{mode:?} {direction:?}");
                for _ in 0..40 {
                    let middle = 0.5 * (low + high);
                    if given(&allocation, &(direction * middle)).0 { low = middle } else { high = middle }
                }
                shares.push(most / low);
            }
            shares.sort_by(f64::total_cmp);
            assert!(shares[0] > 0.75 && shares[1000] > 0.84, "{mode:?} {} {}", shares[0], shares[1000]);
        }
        assert!(nozzle_wrench_set(ImpellerMode::Off).is_none());
    }

    #[test]
    fn the_set_grows_with_the_square_of_the_speed() {
        let [quiet, loud] =
            [ImpellerMode::Quiet, ImpellerMode::Aggressive].map(|mode| nozzle_wrench_set(mode).unwrap());
        let square = (2800.0 / 2000.0_f64).powi(2);
        for ((normal, offset), (other, larger)) in quiet.half_spaces.iter().zip(&loud.half_spaces) {
            assert!(normal.iter().zip(other).all(|(one, other)| one.to_bits() == other.to_bits()));
            assert!((larger / offset - square).abs() < 1e-12);
        }
    }
}
