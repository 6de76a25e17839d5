//! What the tube of the original research code is worth: the numbers of its released set beside the true ones.

use tumble_planning::control::{
    AdditiveTube, ConvexSet, OriginalErrors, OriginalWeights, RakovicSet, SymmetricBox, force_gain,
    original_disturbance,
};
use tumble_planning::nalgebra::{Matrix2, Vector2};

const LIMIT_N: f64 = 0.15;

fn fixed() -> SymmetricBox<2> {
    SymmetricBox(Vector2::new(0.02, 0.002))
}

fn tube(mass_kg: f64, weights: &OriginalWeights, disturbance: SymmetricBox<2>) -> AdditiveTube {
    let gain = force_gain(mass_kg, 1.0, weights.ancillary).unwrap();
    AdditiveTube::try_new(mass_kg, 1.0, gain, disturbance, LIMIT_N).unwrap()
}

/// A number printed with so many decimals.
fn is_printed(number: f64, printed: f64, decimals: i32) -> bool {
    (number - printed).abs() <= 0.5001 * f64::powi(10.0, -decimals)
}

/// Mass and variance; the printed `alpha`, released half-widths and force left; true ones; largest face ratio of the released set.
struct Row {
    body: (f64, f64),
    alpha: f64,
    released: ([f64; 2], f64),
    real: ([f64; 2], f64),
    ratio: f64,
}

fn check(weights: &OriginalWeights, rows: &[Row], decimals: &[[i32; 4]]) {
    for (row, decimals) in rows.iter().zip(decimals) {
        let (mass_kg, variance) = row.body;
        let disturbance =
            if variance > 0.0 { original_disturbance(mass_kg, variance, LIMIT_N).unwrap() } else { fixed() };
        let tube = tube(mass_kg, weights, disturbance);
        let set = tube.truncated(2);
        assert!(is_printed(set.alpha, row.alpha, 2), "{:?}: {}", row.body, set.alpha);
        let widths = [set.support(&Vector2::x()), set.support(&Vector2::y())];
        let real = tube.largest_errors().unwrap();
        for axis in 0..2 {
            assert!(is_printed(widths[axis], row.released.0[axis], decimals[axis]), "{:?}: {widths:?}", row.body);
            assert!(is_printed(real[axis], row.real.0[axis], decimals[2 + axis]), "{:?}: {real}", row.body);
        }
        let left = (tube.force_left_by_n(&set), tube.force_left_n().unwrap());
        assert!(is_printed(left.0, row.released.1, 3) && is_printed(left.1, row.real.1, 3), "{:?}: {left:?}", row.body);
        let ratio = set.polygon().invariance_ratio(tube.closed_loop(), &disturbance);
        assert!(is_printed(ratio, row.ratio, 2), "{:?}: {ratio}", row.body);
        // what is released here refuses such a set
        let normals = [Vector2::x(), -Vector2::x(), Vector2::y(), -Vector2::y()];
        assert!(RakovicSet::with_terms(*tube.closed_loop(), disturbance, &normals, 2).is_err());
    }
}

#[test]
fn released_and_true_sets_with_the_weights_of_the_configuration() {
    let row = |body, alpha, released, real, ratio| Row { body, alpha, released, real, ratio };
    check(
        &OriginalWeights::DEFAULT,
        &[
            row((9.58, 0.0), 1.86, ([0.047, 0.0063], 0.092), ([0.105, 0.0266], 0.053), 1.64),
            row((9.58, 1.0), 2.89, ([0.0037, 0.0034], 0.130), ([0.036, 0.0137], 0.087), 2.22),
            row((9.58, 0.03), 2.89, ([0.0005, 0.0005], 0.147), ([0.0051, 0.0020], 0.141), 2.22),
            row((20.0, 1.0), 3.49, ([0.0006, 0.0006], 0.145), ([0.0139, 0.0036], 0.124), 2.74),
            row((15.0, 15.0), 3.27, ([0.0083, 0.0076], 0.094), ([0.138, 0.042], -0.100), 2.55),
        ],
        &[[3, 4, 3, 4], [4, 4, 3, 4], [4, 4, 4, 4], [4, 4, 4, 4], [4, 4, 3, 3]],
    );
}

#[test]
fn released_and_true_sets_with_the_weights_flown() {
    let gain = force_gain(9.58, 1.0, OriginalWeights::PERMISSIVE.ancillary).unwrap();
    assert!(is_printed(gain.x, -2.085, 3) && is_printed(gain.y, -6.457, 3), "{gain}");
    let row = |body, alpha, released, real, ratio| Row { body, alpha, released, real, ratio };
    check(
        &OriginalWeights::PERMISSIVE,
        &[
            row((9.58, 0.0), 2.69, ([0.023, 0.0042], 0.108), ([0.074, 0.026], 0.017), 1.96),
            row((9.58, 1.0), 2.26, ([0.0053, 0.0047], 0.113), ([0.0205, 0.0114], 0.082), 1.79),
            row((20.0, 1.0), 2.97, ([0.0007, 0.0007], 0.142), ([0.0076, 0.0029], 0.123), 2.30),
            row((15.0, 15.0), 2.71, ([0.0105, 0.0095], 0.055), ([0.077, 0.034], -0.115), 2.07),
        ],
        &[[3, 4, 3, 3], [4, 4, 4, 4], [4, 4, 4, 4], [4, 4, 3, 3]],
    );
}

#[test]
fn the_fixed_box_needs_seven_terms_and_six_with_the_weights_flown() {
    let configured = tube(9.58, &OriginalWeights::DEFAULT, fixed());
    for (terms, alpha, decimals) in [(7, 0.87, 2), (8, 0.59, 2), (10, 0.21, 2), (20, 0.014, 3)] {
        let found = configured.truncated(terms).alpha;
        assert!(is_printed(found, alpha, decimals), "{terms}: {found}");
    }
    assert!(configured.truncated(6).alpha > 1.0);
    let flown = tube(9.58, &OriginalWeights::PERMISSIVE, fixed());
    assert!(flown.truncated(5).alpha > 1.0 && is_printed(flown.truncated(6).alpha, 0.61, 2));
    // enough terms make it invariant, and close to the true set
    let set = configured.truncated(20);
    assert!(set.polygon().invariance_ratio(configured.closed_loop(), &fixed()) <= 1.0 + 1e-9);
    assert!((set.support(&Vector2::x()) / configured.largest_errors().unwrap().x - 1.0).abs() < 0.02);
    let digits = configured.truncated(2).polygon().invariance_ratio(configured.closed_loop(), &fixed());
    assert!(is_printed(digits, 1.638, 3), "{digits}");
}

#[test]
fn the_stored_set_leaves_itself_without_any_disturbance() {
    let stored = OriginalErrors::stored().unwrap();
    assert!(is_printed(stored.gain.x, -1.1594, 4) && is_printed(stored.gain.y, -4.9716, 4), "{}", stored.gain);
    let widths = [stored.errors.support(&Vector2::x()), stored.errors.support(&Vector2::y())];
    assert!(is_printed(widths[0], 0.0185, 4) && is_printed(widths[1], 0.0132, 4), "{widths:?}");
    assert!(is_printed(stored.force_left_n, 0.0704, 4), "{}", stored.force_left_n);
    assert_eq!(stored.errors.polygon().vertices().len(), 8);
    let nothing = SymmetricBox(Vector2::zeros());
    for (step_s, expected) in [(1.0, 1.41), (0.2, 1.12)] {
        let input = Vector2::new(0.5 * step_s * step_s, step_s) / 9.58;
        let closed_loop = Matrix2::new(1.0, step_s, 0.0, 1.0) + input * stored.gain.transpose();
        let ratio = stored.errors.polygon().invariance_ratio(&closed_loop, &nothing);
        assert!(is_printed(ratio, expected, 2), "{step_s}: {ratio}");
    }
}

#[test]
fn where_no_force_is_left_the_box_is_halved_and_then_the_stored_set_serves() {
    let weights = OriginalWeights::DEFAULT.ancillary;
    let of = |share: f64| OriginalErrors::of_box(9.58, weights, SymmetricBox(fixed().0 * share), LIMIT_N).unwrap();
    let (one, three, ten) = (of(1.0), of(3.0), of(10.0));
    assert!(!one.is_stored && is_printed(one.force_left_n, 0.092, 3));
    assert!(!three.is_stored && (three.force_left_n - (LIMIT_N - 1.5 * (LIMIT_N - one.force_left_n))).abs() < 1e-12);
    assert_eq!(ten, OriginalErrors::stored().unwrap());
}
