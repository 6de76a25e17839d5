//! A designed motion as a page.

use super::excite_motion::{Bounds, Designed, FinePeriod, Flight};
use super::excite_options::ExciteArgs;
use crate::page::chart::{Axis, Chart};
use crate::page::text::number;
use crate::page::{Page, Tone};
use tumble_dynamics::nalgebra::DMatrix;
use tumble_formats::excitation_file::LimitsTable;
use tumble_identification::StandardDeviations;

/// Every how many points of the fine period are drawn.
const DRAWN_EVERY: usize = 10;

/// One period: channels and wrench against their limits, and the path.
pub(super) fn charts(limits: &LimitsTable, period: &FinePeriod) -> Vec<Chart> {
    let [value, rate, acceleration] = &period.channels;
    let column = |table: &DMatrix<f64>, index: usize| -> Vec<[f64; 2]> {
        let values = table.column(index);
        period.times_s.iter().zip(values.iter()).map(|(t, value)| [*t, *value]).step_by(DRAWN_EVERY).collect()
    };
    let one = |[x, y, z]: [f64; 3]| Some(x).filter(|x| [y, z].iter().all(|other| other.to_bits() == x.to_bits()));
    let (xyz, angles) = (["x", "y", "z"], ["roll", "pitch", "yaw"]);
    let against_time =
        |(id, title, unit, table, first, names, limit): (_, _, _, &DMatrix<f64>, usize, [&'static str; 3], _)| {
            let curves = (first..).zip(names).map(|(index, name)| (name, column(table, index)));
            Chart::of_curves(id, title, unit, Axis::seconds(), curves).within(limit, "limit")
        };
    let mut charts: Vec<Chart> = [
        ("position", "Position", "m", value, 0, xyz, one(limits.position_m)),
        ("attitude", "Euler angles", "rad", value, 3, angles, Some(limits.angle_rad)),
        ("position_rate", "Velocity", "m/s", rate, 0, xyz, Some(limits.speed_m_s)),
        ("attitude_rate", "Euler rates", "rad/s", rate, 3, angles, Some(limits.angular_rate_rad_s)),
        ("position_acceleration", "Acceleration", "m/s²", acceleration, 0, xyz, Some(limits.acceleration_m_s2)),
        (
            "attitude_acceleration",
            "Euler accelerations",
            "rad/s²",
            acceleration,
            3,
            angles,
            Some(limits.angular_acceleration_rad_s2),
        ),
        ("force", "Force, body axes", "N", &period.wrenches, 3, xyz, Some(limits.force_n)),
        ("torque", "Torque, body axes", "N m", &period.wrenches, 0, xyz, Some(limits.torque_n_m)),
    ]
    .into_iter()
    .map(against_time)
    .collect();
    for (id, title, across, [right, up]) in
        [("path_xy", "Path: y over x", "x, m", [0, 1]), ("path_xz", "Path: z over x", "x, m", [0, 2])]
    {
        let (right, up) = (value.column(right), value.column(up));
        let points = right.iter().zip(up.iter()).map(|(x, y)| [*x, *y]).step_by(DRAWN_EVERY).collect();
        let curve = [("body origin", points)];
        charts.push(Chart::of_curves(id, title, "m", Axis::named(across, ""), curve).with_equal_scales());
    }
    charts
}

/// The largest of three.
fn largest(values: [f64; 3]) -> f64 {
    values.into_iter().fold(0.0, f64::max)
}

/// What a bound promises, in words.
fn promised(std: &StandardDeviations, mass_kg: f64) -> String {
    let inertia = &std.inertia_about_com_kg_m2;
    format!(
        "the mass to {} %, the centre of mass to {} mm and the moments of inertia to {} kg m²",
        number(100.0 * std.mass_kg / mass_kg, 2),
        number(1e3 * largest(std.center_of_mass_m.into()), 2),
        number(largest([inertia[(0, 0)], inertia[(1, 1)], inertia[(2, 2)]]), 2)
    )
}

/// The whole page.
pub(super) fn page(
    args: &ExciteArgs,
    designed: &Designed,
    bounds: &Bounds,
    mass_kg: f64,
    flight: Option<&Flight>,
    charts: &[Chart],
    table: &str,
) -> String {
    let room = <[f64; 3]>::from(args.position).map(|half| number(half, 3)).join(" × ");
    let asked = format!(
        "A motion of {} s with {} harmonics was asked for that shows {} best (criterion {}), inside ± {room} m and the limits of actuators and speeds.",
        args.period,
        args.harmonics,
        if args.planar { "what a table can show" } else { "all ten inertial parameters" },
        args.criterion.name()
    );
    let tightest = designed.utilization.iter().max_by(|a, b| a.share.total_cmp(&b.share));
    let ended = match tightest {
        Some(used) => format!(
            "The best of {} starts costs {}; it uses {} % of what its tightest limit allows ({} of {}), between samples too.",
            designed.cost_per_start.len(),
            number(designed.cost, 4),
            number(100.0 * used.share, 3),
            used.limit,
            used.channel
        ),
        None => format!("The best of {} starts costs {}.", designed.cost_per_start.len(), number(designed.cost, 4)),
    };
    let sure = format!(
        "Flown exactly for {} cycles it gives {} (one σ); where tracking adds harmonics that have to be found as well, {}.",
        args.cycles - 1,
        promised(&bounds.exact.std, mass_kg),
        promised(&bounds.free.std, mass_kg)
    );
    let (tone, verdict) = if args.planar || bounds.exact.observability.rank() == 10 {
        (Tone::Good, "A motion inside its limits that shows what was asked for".to_owned())
    } else {
        (Tone::Doubted, format!("The motion shows {} of 10 directions", bounds.exact.observability.rank()))
    };
    let mut page = Page::new("excitation", "Designed motion", tone, &verdict, [&asked, &ended, &sure]);
    if let Some(flight) = flight {
        page.tiles(&[
            ("Flown with a payload of", format!("{} kg", number(flight.payload_kg, 4)), "log.csv, truth.toml".into()),
            ("Tracking, RMS", format!("{} mm", number(1e3 * flight.tracking_rms.0, 3)), String::new()),
            ("Attitude, RMS", format!("{} mrad", number(1e3 * flight.tracking_rms.1, 3)), String::new()),
            (
                "At a limit of the actuators",
                format!("{} %", number(100.0 * flight.execution.saturation.any, 3)),
                "of the time".into(),
            ),
        ]);
    }
    page.section("motion", "One period", "Each channel and the wrench that the body without payload needs, with their limits where these fit the picture.");
    page.charts(&[], charts);
    page.section(
        "numbers-heading",
        "In numbers",
        "As the command prints them; summary.json holds the same for programs.",
    );
    page.folded("table", "The table", table);
    page.finish()
}
