//! Figure 6.22 and table 6.6: what the allocation looks up, where the thesis's table ends and what that costs.

use nalgebra::Vector3;
use tumble_astrobee::propulsion::blower::{
    ALLOCATED_LEAK_AREA_M2, AREA_AT_LARGEST_THRUST_M2, LARGEST_THRUST_RATIO, POINTS, THRUST_POINTS,
    pressure_coefficient_of_area, pressure_coefficient_of_thrust, pressure_pa,
};
use tumble_astrobee::propulsion::constants::{
    AIR_DENSITY_KG_M3, FLAP_CLOSED_RAD, FLAP_INTAKE_HEIGHT_M, FLAP_LENGTH_M, FLAP_OPEN_RAD, IMPELLER_DIAMETER_M,
    IMPELLER_HEIGHT_M, LEAK_AREAS_M2, NOZZLES,
};
use tumble_astrobee::propulsion::inverse::ModuleFlow;
use tumble_astrobee::propulsion::{AreaTable, Belief, ForceAllocation, ImpellerMode, InverseAllocation};
use tumble_dynamics::Actuation;
use tumble_identification::noise::Gaussian;
use tumble_lie::Wrench;

use super::flight::{MODE, body};
use super::{Section, Size, csv, curve, study};
use crate::Failure;

/// Largest components of random commands, N and N m: those of NASA's vectors called saturated, and a quarter of them.
const BOXES: [(&str, [f64; 2]); 2] = [("to 0.5 N, 0.05 N m", [0.5, 0.05]), ("to 2 N, 0.2 N m", [2.0, 0.2])];

/// Where and by how much the cut table is wrong over random commands of one box and mode.
struct Cost {
    saturated: usize,
    past_end: usize,
    /// Among the saturated.
    largest_n: f64,
    mean_n: f64,
    largest_torque_n_m: f64,
    /// Largest error of commands that do not saturate.
    unsaturated_n: f64,
}

fn cost(mode: ImpellerMode, [force, torque]: [f64; 2], draws: usize, random: &mut Gaussian) -> Result<Cost, Failure> {
    let allocation = |table| ForceAllocation {
        inverse: InverseAllocation { belief: Belief::Allocation, table },
        ..ForceAllocation::new(mode, body().center_of_mass())
    };
    let (full, cut) = (allocation(AreaTable::Full), allocation(AreaTable::Thesis));
    let mut cost =
        Cost { saturated: 0, past_end: 0, largest_n: 0.0, mean_n: 0.0, largest_torque_n_m: 0.0, unsaturated_n: 0.0 };
    for _ in 0..draws {
        let mut draw = |size: f64| Vector3::from_fn(|_, _| size * (2.0 * random.uniform() - 1.0));
        let wrench = Wrench::new(draw(torque), draw(force));
        let steps = full.allocate_steps(&wrench).map_err(study)?;
        let (right, wrong) = (full.realize(&steps.flaps), cut.realize(&steps.flaps));
        let miss = wrong - right;
        if !steps.limits.is_saturated() {
            cost.unsaturated_n = cost.unsaturated_n.max(miss.force.norm());
            continue;
        }
        cost.saturated += 1;
        let flows = full.inverse.flow_of_openings([mode.speed_rad_s(); 2], &steps.flaps.openings_rad);
        cost.past_end += usize::from(flows.iter().any(ModuleFlow::is_past_largest_thrust));
        cost.largest_n = cost.largest_n.max(miss.force.amax());
        cost.largest_torque_n_m = cost.largest_torque_n_m.max(miss.torque.amax());
        cost.mean_n += miss.force.norm();
    }
    cost.mean_n /= cost.saturated.max(1) as f64;
    Ok(cost)
}

/// Steps of the drawn curves.
const STEPS: usize = 400;

pub fn section(size: Size) -> Result<Section, Failure> {
    let mut section = Section::default();
    constants(&mut section);

    let speed = MODE.speed_rad_s();
    let share = |k: usize| k as f64 / STEPS as f64;
    let left: Vec<(f64, f64)> = (0..=STEPS)
        .map(|k| {
            let ratio = -1.8e-5 + share(k) * (LARGEST_THRUST_RATIO + 1.8e-5);
            (ratio, pressure_coefficient_of_thrust(ratio))
        })
        .collect();
    let most_open =
        NOZZLES[6..].iter().map(|n| n.discharge_coefficient * n.area_m2(FLAP_OPEN_RAD - FLAP_CLOSED_RAD)).sum::<f64>();
    let right = |end: f64| -> Vec<(f64, f64)> {
        let pressure = |open: f64| {
            let area = (open + ALLOCATED_LEAK_AREA_M2).min(end);
            pressure_pa(speed, pressure_coefficient_of_area(area))
        };
        (0..=STEPS).map(|k| (2.0 * share(k) * most_open, pressure(share(k) * most_open))).collect()
    };
    let (full, cut) = (right(f64::INFINITY), right(AREA_AT_LARGEST_THRUST_M2));
    let end = AREA_AT_LARGEST_THRUST_M2 - ALLOCATED_LEAK_AREA_M2;
    let (closed, last) = (full[0].1, pressure_pa(speed, pressure_coefficient_of_area(AREA_AT_LARGEST_THRUST_M2)));
    let opened = full[STEPS].1;
    section.line(format!(
        "\nThe table from T/N^2 to Cdp has {THRUST_POINTS} of the curve's {POINTS} points and ends at T/N^2 = {LARGEST_THRUST_RATIO:.6e} \
         N s^2, Cdp = {:.6}; at T = 0 Cdp is {:.6}. T is the sum of thrust over discharge coefficient of a module. Mode 2: dP from \
         {closed:.3} Pa (closed) to {last:.3} Pa at the end of the table, T/dP = {:.7} m^2; six fully open nozzles of module 2 have T/dP \
         = {:.7} m^2 and {opened:.3} Pa, which the cut table takes for {last:.3} Pa: {:.0} % too much.",
        pressure_coefficient_of_thrust(LARGEST_THRUST_RATIO),
        pressure_coefficient_of_thrust(0.0),
        2.0 * end,
        2.0 * most_open,
        100.0 * (last / opened - 1.0),
    ));
    section.line(
        "\nThe public code of the thesis's authors lists 79 rows from 79.15 to 22.56 Pa: the same curve, cut at the same place.",
    );
    section.columns(&[
        "commands",
        "mode",
        "saturated",
        "of these past the end",
        "largest force error, N",
        "mean, N",
        "largest torque error, N m",
        "largest where unsaturated, N",
    ]);
    let mut random = Gaussian::from_seed(622);
    let (mut largest, mut unsaturated): (f64, f64) = (0.0, 0.0);
    for (about, components) in BOXES {
        for mode in &ImpellerMode::ALL[1..] {
            let cost = cost(*mode, components, size.draws, &mut random)?;
            largest = largest.max(cost.largest_n);
            unsaturated = unsaturated.max(cost.unsaturated_n);
            section.row(&[
                about.to_owned(),
                mode.number().to_string(),
                format!("{:.1} %", 100.0 * cost.saturated as f64 / size.draws as f64),
                format!("{:.1} %", 100.0 * cost.past_end as f64 / cost.saturated.max(1) as f64),
                format!("{:.4}", cost.largest_n),
                format!("{:.4}", cost.mean_n),
                format!("{:.4}", cost.largest_torque_n_m),
                format!("{:.1e}", cost.unsaturated_n),
            ]);
        }
    }
    section.line("");
    section.must(
        unsaturated < 1e-9,
        "without saturation the cut table and the whole one give the same wrench: the cut loses nothing there",
    );
    section.must(
        (0.045..0.1).contains(&largest),
        &format!(
            "saturated, the cut table overstates a force by up to {largest:.3} N (0.061 N over NASA's own vectors)"
        ),
    );
    section.printed(
        "holds with a gap",
        "\"the relation between the total thrust and the corresponding Cdp values is monotonic\": of the points used (T >= 0) yes; \
         past the largest thrust, where saturated flaps stand, thrust falls again and the printed table has no rows.",
    );
    section.tables.push(("figure_6_22_left.csv", csv("thrust_over_speed_squared_n_s2,cdp", pairs(&left))));
    section.tables.push((
        "figure_6_22_right.csv",
        csv(
            "thrust_over_pressure_m2,pressure_full_pa,pressure_thesis_pa",
            full.iter().zip(&cut).map(|(a, b)| vec![a.0, a.1, b.1]),
        ),
    ));
    let scaled = left.iter().map(|(x, y)| (1e6 * x, *y));
    section.draw("figure_6_22_left.svg", "T/N^2 to Cdp", ["T/N^2, 1e-6 N s^2", "Cdp"], vec![curve("Cdp", scaled)]);
    section.draw(
        "figure_6_22_right.svg",
        "T/dP to dP, mode 2",
        ["T/dP, 0.001 m^2", "dP, Pa"],
        vec![
            curve("thesis: held from the largest thrust on", cut.iter().map(|(x, y)| (1e3 * x, *y))),
            curve("whole table", full.iter().map(|(x, y)| (1e3 * x, *y))),
        ],
    );
    Ok(section)
}

fn pairs(points: &[(f64, f64)]) -> impl Iterator<Item = Vec<f64>> {
    points.iter().map(|(x, y)| vec![*x, *y])
}

/// Table 6.6 with the values it leaves out.
fn constants(section: &mut Section) {
    section.line("Table 6.6 with its values, as the code has them:");
    section.columns(&["symbol", "value", "meaning"]);
    let deg = f64::to_degrees;
    let speeds: Vec<String> = ImpellerMode::ALL.iter().map(|mode| format!("{:.5}", mode.speed_rad_s())).collect();
    let rows = [
        (
            "N",
            format!("{} rad/s", speeds.join(", ")),
            "impeller speed of modes 0 to 3; the thesis writes 293.12 RPM, it is rad/s",
        ),
        ("d", format!("{IMPELLER_DIAMETER_M} m"), "impeller diameter"),
        ("h", format!("{IMPELLER_HEIGHT_M:.8} m"), "height of its trailing edge"),
        ("rho", format!("{AIR_DENSITY_KG_M3} kg/m^3"), "air density"),
        (
            "A_0",
            format!("{}, {} m^2", LEAK_AREAS_M2[0], LEAK_AREAS_M2[1]),
            "leak area of modules 1, 2; the thesis lists one",
        ),
        ("H", format!("{FLAP_INTAKE_HEIGHT_M:.8} m"), "nozzle intake height per flap"),
        ("L", format!("{FLAP_LENGTH_M:.8} m"), "flap length"),
        (
            "theta",
            format!("{:.2} to {:.2} deg", deg(FLAP_CLOSED_RAD), deg(FLAP_OPEN_RAD)),
            "flap angle, closed to open",
        ),
    ];
    for (symbol, value, meaning) in rows {
        section.row(&[symbol.to_owned(), value, meaning.to_owned()]);
    }
    section.columns(&["nozzle", "air leaves", "position, m", "W, m", "C_d"]);
    for (i, nozzle) in NOZZLES.iter().enumerate() {
        let (direction, sign) = ["x", "y", "z"]
            .into_iter()
            .zip(nozzle.outflow_body)
            .find(|(_, component)| *component != 0.0)
            .map_or(("", ""), |(name, component)| (name, if component > 0.0 { "+" } else { "-" }));
        let position = nozzle.position_body_m.map(|c| format!("{c:.6}")).join(", ");
        section.row(&[
            format!("{} {}", i + 1, nozzle.name),
            format!("{sign}{direction}"),
            position,
            format!("{:.5}", nozzle.width_m),
            format!("{}", nozzle.discharge_coefficient),
        ]);
    }
}
