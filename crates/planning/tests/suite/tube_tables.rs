//! What is left of the input by how well the mass is known: the figures of the design, to its digits.

use crate::tube_shares::{GAINS, HALF_WIDTHS, MASS_KG, around, cruise_m_s, gain_row, leg_time_change, limits, shares};

/// A figure printed to so many decimals.
#[track_caller]
fn is_printed(found: f64, printed: f64, decimals: i32) {
    let half = 0.5 * 10.0_f64.powi(-decimals);
    assert!((found - printed).abs() <= half * (1.0 + 1e-9), "{found} is not {printed}");
}

#[test]
fn shares_of_the_input_left() {
    let table = [
        [0.824, 0.809, 0.878, 0.890, 0.989],
        [0.604, 0.571, 0.725, 0.780, 0.975],
        [0.321, 0.265, 0.528, 0.670, 0.956],
        [-0.056, -0.144, 0.266, 0.559, 0.932],
        [-0.584, -0.716, -0.102, 0.449, 0.898],
    ];
    for (half_width, printed) in HALF_WIDTHS.into_iter().zip(table) {
        let row = shares(half_width).unwrap();
        let found = [row.original[0], row.original[1], row.centered_in_mass, row.centered_in_inverse, row.of_physical];
        for (found, printed) in found.into_iter().zip(printed) {
            is_printed(found, printed, 3);
        }
    }
    // the faces that stand in the program cost a little, and leave more than was asked for
    let row = shares(0.5).unwrap();
    assert!(row.of_physical_by_template < row.of_physical && row.of_physical_by_template >= 0.85);
}

#[test]
fn what_gains_make_of_disturbances() {
    let table = [
        ([1.1017, 4.0, 0.90], [0.0011, 0.0054], 0.449),
        ([1.1285, 2.0, 0.72], [0.0018, 0.0055], 0.436),
        ([1.1113, 1.0, 0.47], [0.0024, 0.0053], 0.444),
        ([1.2905, 4.0, 1.52], [0.0019, 0.0063], 0.355),
        ([1.4665, 3.6, 1.79], [0.0027, 0.0072], 0.267),
    ];
    for (gain, (matched, jumps, share)) in GAINS.into_iter().zip(table) {
        let row = gain_row(gain).unwrap();
        is_printed(row.matched[0], matched[0], 4);
        is_printed(row.matched[1], matched[1], 1);
        is_printed(row.matched[2], matched[2], 2);
        is_printed(row.jumps[0], jumps[0], 4);
        is_printed(row.jumps[1], jumps[1], 4);
        is_printed(row.share, share, 3);
    }
}

#[test]
fn limits_at_the_small_force() {
    let table = [
        (0.5, 7.185, 0.500, 0.00793, 0.01044, [49.0, 13.0], 11.8, 227),
        (0.25, 8.981, 0.250, 0.01079, 0.01253, [24.0, 9.0], 5.6, 211),
        (0.1, 9.484, 0.100, 0.01282, 0.01423, [14.0, 8.0], 3.0, 203),
        (0.03, 9.571, 0.030, 0.01392, 0.01520, [9.0, 7.0], 1.9, 199),
    ];
    for (half_width, center_kg, uncertainty, acceleration, physical, position_mm, velocity_mm_s, rows) in table {
        let row = limits(around(half_width)).unwrap();
        is_printed(row.center_kg, center_kg, 3);
        is_printed(row.uncertainty, uncertainty, 3);
        is_printed(row.acceleration_m_s2, acceleration, 5);
        is_printed(row.physical_m_s2, physical, 5);
        is_printed(1e3 * row.position_tube_m[0], position_mm[0], 0);
        is_printed(1e3 * row.position_tube_m[1], position_mm[1], 0);
        is_printed(1e3 * row.velocity_tube_m_s[0], velocity_mm_s, 1);
        // two more than in the design: at rest when a stop ends, whatever the scale
        assert_eq!(row.rows, rows + 2);
    }
}

#[test]
fn what_is_lost_to_not_knowing() {
    let [unsure, sure] = [0.5, 0.03].map(|half_width| limits(around(half_width)).unwrap());
    let [fast, coasting] = cruise_m_s(&unsure);
    is_printed(fast, 0.038, 3);
    is_printed(coasting, 0.047, 3);
    is_printed(leg_time_change(&unsure, &sure), 0.325, 3);
    // half to twice the mass, and three masses learned to 3 %
    let prior = limits([0.5 * MASS_KG, 2.0 * MASS_KG]).unwrap();
    is_printed(prior.uncertainty, 0.6, 3);
    is_printed(prior.acceleration_m_s2, 0.0052, 4);
    for (factor, acceleration, decimals, change) in
        [(2.0, 0.00635, 5, -0.10), (1.0, 0.01392, 5, -0.39), (0.5, 0.029, 3, -0.58)]
    {
        let learned = limits(around(0.03).map(|mass| factor * mass)).unwrap();
        is_printed(learned.acceleration_m_s2, acceleration, decimals);
        is_printed(leg_time_change(&learned, &prior), change, 2);
    }
}
