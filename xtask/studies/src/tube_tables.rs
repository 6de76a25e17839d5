//! What is left of the input, by how well the mass is known: `cargo xtask study tube-tables [--json]`.

use serde_json::json;
use tumble_planning::PlanningError;

use crate::Failure;
use crate::arguments::Arguments;
use crate::tube_shares::{
    GAINS, GainRow, HALF_WIDTHS, LimitRow, MASS_KG, ShareRow, around, cruise_m_s, gain_row, leg_time_change, limits,
    shares,
};

#[allow(clippy::needless_pass_by_value)] // given to `map_err`
fn failed(error: PlanningError) -> Failure {
    Failure::BadInput(format!("tube-tables: {error}"))
}

/// Names and mass intervals of the table of limits, kg.
fn intervals() -> Vec<(String, [f64; 2])> {
    let known = [0.5, 0.25, 0.1, 0.03].map(|share| (format!("+-{:.0} %", 100.0 * share), around(share)));
    let learned =
        [2.0, 1.0, 0.5].map(|factor| (format!("{factor} x, +-3 %"), around(0.03).map(|mass_kg| factor * mass_kg)));
    let prior = [("0.5 to 2 x".to_owned(), [0.5 * MASS_KG, 2.0 * MASS_KG])];
    known.into_iter().chain(prior).chain(learned).collect()
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let as_json = arguments.has("--json");
    let share_rows: Result<Vec<ShareRow>, _> = HALF_WIDTHS.into_iter().map(shares).collect();
    let gain_rows: Result<Vec<GainRow>, _> = GAINS.into_iter().map(gain_row).collect();
    let named = intervals();
    let limit_rows: Result<Vec<LimitRow>, _> = named.iter().map(|(_, mass_kg)| limits(*mass_kg)).collect();
    let (share_rows, gain_rows, limit_rows) =
        (share_rows.map_err(failed)?, gain_rows.map_err(failed)?, limit_rows.map_err(failed)?);
    if as_json {
        for row in &share_rows {
            println!(
                "{}",
                json!({
                    "block": "share", "half_width": row.half_width, "original": row.original,
                    "centered_in_mass": row.centered_in_mass, "centered_in_inverse": row.centered_in_inverse,
                    "of_physical": row.of_physical, "of_physical_by_template": row.of_physical_by_template,
                })
            );
        }
        for row in &gain_rows {
            println!(
                "{}",
                json!({"block": "gain", "gain": row.gain, "matched": row.matched, "jumps": row.jumps, "share": row.share})
            );
        }
        for ((name, _), row) in named.iter().zip(&limit_rows) {
            println!(
                "{}",
                json!({
                    "block": "limits", "interval": name, "mass_kg": row.mass_kg, "center_kg": row.center_kg,
                    "uncertainty": row.uncertainty, "acceleration_m_s2": row.acceleration_m_s2,
                    "physical_m_s2": row.physical_m_s2, "position_tube_m": row.position_tube_m,
                    "velocity_tube_m_s": row.velocity_tube_m_s, "cruise_m_s": cruise_m_s(row), "rows": row.rows,
                })
            );
        }
        return Ok(());
    }
    println!("share of the input left for the plan, mass known to a share of itself, nothing else disturbing");
    println!(
        "{:>6} {:>16} {:>12} {:>12} {:>14} {:>14}",
        "share", "original's form", "in the mass", "in 1 / mass", "of physical", "by five faces"
    );
    for row in &share_rows {
        println!(
            "{:>6.2} {:>7.3} / {:>6.3} {:>12.3} {:>12.3} {:>14.3} {:>14.3}",
            row.half_width,
            row.original[0],
            row.original[1],
            row.centered_in_mass,
            row.centered_in_inverse,
            row.of_physical,
            row.of_physical_by_template
        );
    }
    println!("\nwhat a gain makes of 1 m/s^2 along the input, and of jumps of 1 mm and 1 mm/s");
    println!(
        "{:>6} {:>6} {:>9} {:>9} {:>9} {:>9} {:>9} {:>8}",
        "1/s^2", "1/s", "input", "pos. s^2", "vel. s", "1 mm", "1 mm/s", "share"
    );
    for row in &gain_rows {
        let ([stiffness, damping], [input, position, velocity], [jump, kick]) = (row.gain, row.matched, row.jumps);
        println!(
            "{stiffness:>6.3} {damping:>6.3} {input:>9.4} {position:>9.3} {velocity:>9.3} {jump:>9.5} {kick:>9.5} {:>8.3}",
            row.share
        );
    }
    println!("\none axis at 0.15 N, 9.58 kg, jumps of 0.1 mm and 0.2 mm/s");
    println!(
        "{:<12} {:>8} {:>6} {:>9} {:>9} {:>15} {:>15} {:>16} {:>5} {:>9}",
        "interval", "centre", "+-", "nominal", "physical", "tube, mm", "tube, mm/s", "cruise, mm/s", "rows", "leg time"
    );
    for ((name, _), row) in named.iter().zip(&limit_rows) {
        let pair = |numbers: [f64; 2]| format!("{:.1} / {:.1}", 1e3 * numbers[0], 1e3 * numbers[1]);
        let change = limit_rows.get(4).map_or(f64::NAN, |prior| leg_time_change(row, prior));
        println!(
            "{name:<12} {:>8.3} {:>6.3} {:>9.5} {:>9.5} {:>15} {:>15} {:>16} {:>5} {:>8.1}%",
            row.center_kg,
            row.uncertainty,
            row.acceleration_m_s2,
            row.physical_m_s2,
            pair(row.position_tube_m),
            pair(row.velocity_tube_m_s),
            pair(cruise_m_s(row)),
            row.rows,
            100.0 * change
        );
    }
    println!("leg time: shortest, against the interval of 0.5 to 2 x");
    Ok(())
}
