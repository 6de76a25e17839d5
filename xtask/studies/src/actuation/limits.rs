//! Table 6.7: the limits as data, and what of them the robot can reach.

use tumble_astrobee::propulsion::{ForceAllocation, ImpellerMode};
use tumble_identification::noise::Gaussian;
use tumble_lie::Wrench;

use super::flight::{PLANNER, PLANNER_CODE, TABLE_6_7, body};
use super::{Section, Size, csv, study};
use crate::Failure;

/// Names of components, in the order of wrenches.
pub const COMPONENTS: [&str; 6] = ["tx", "ty", "tz", "fx", "fy", "fz"];

/// Allocation at the robot's own centre of mass; wrenches about it, as commands are.
struct Reach(ForceAllocation);

impl Reach {
    fn of(mode: ImpellerMode) -> Self {
        Self(ForceAllocation::new(mode, body().center_of_mass()))
    }

    fn is_reached(&self, components: [f64; 6]) -> Result<bool, Failure> {
        let [tx, ty, tz, fx, fy, fz] = components;
        let about_com = Wrench::new([tx, ty, tz].into(), [fx, fy, fz].into());
        let steps = self.0.allocate_steps(&self.0.about_origin(&about_com)).map_err(study)?;
        Ok(!steps.limits.is_saturated())
    }

    /// The largest factor on `direction` that is still reached.
    fn largest(&self, direction: [f64; 6]) -> Result<f64, Failure> {
        let (mut low, mut high) = (0.0, 1e3);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.is_reached(direction.map(|c| c * middle))? { low = middle } else { high = middle }
        }
        Ok(low)
    }

    /// The largest factor on a box of which every corner is still reached.
    fn largest_box(&self, limits: [f64; 6]) -> Result<f64, Failure> {
        let corner = |bits: usize| -> [f64; 6] {
            std::array::from_fn(|i| if bits >> i & 1 == 1 { limits[i] } else { -limits[i] })
        };
        (0..64).try_fold(f64::INFINITY, |least: f64, bits| Ok(least.min(self.largest(corner(bits))?)))
    }

    /// The share of a box that is reached.
    fn share(&self, limits: [f64; 6], draws: usize, random: &mut Gaussian) -> Result<f64, Failure> {
        let mut reached = 0;
        for _ in 0..draws {
            let wrench = limits.map(|limit| limit * (2.0 * random.uniform() - 1.0));
            reached += usize::from(self.is_reached(wrench)?);
        }
        Ok(reached as f64 / draws as f64)
    }
}

/// One component, one direction.
fn along(component: usize, sign: f64) -> [f64; 6] {
    std::array::from_fn(|i| if i == component { sign } else { 0.0 })
}

pub fn section(size: Size) -> Result<Section, Failure> {
    let mut section = Section::default();
    section.line(
        "Largest single components that no flap at its stop cuts, +/-, about the flight centre of mass, N and N m:",
    );
    section.columns(&["mode", "fx", "fy", "fz", "tx", "ty", "tz"]);
    let modes = [ImpellerMode::Quiet, ImpellerMode::Nominal, ImpellerMode::Aggressive];
    let mut reach = Vec::new();
    for mode in modes {
        let one = Reach::of(mode);
        let mut limits = [[0.0; 2]; 6];
        for (component, pair) in limits.iter_mut().enumerate() {
            *pair = [one.largest(along(component, 1.0))?, one.largest(along(component, -1.0))?];
        }
        let cells = [3, 4, 5, 0, 1, 2].map(|c: usize| format!("{:.4} / {:.4}", limits[c][0], limits[c][1]));
        section.row(&[vec![format!("{} ({:.0} rad/s)", mode.number(), mode.speed_rad_s())], cells.to_vec()].concat());
        reach.push(limits);
    }
    let printed = [3, 4, 5, 0, 1, 2].map(|c: usize| format!("{}", TABLE_6_7[c]));
    section.row(&[vec!["controller limits, table 6.7".to_owned()], printed.to_vec()].concat());
    let planner = [3, 4, 5, 0, 1, 2].map(|c: usize| format!("{}", PLANNER[c]));
    section.row(&[vec!["planner limits, table 6.7".to_owned()], planner.to_vec()].concat());
    let code = [3, 4, 5, 0, 1, 2].map(|c: usize| format!("{}", PLANNER_CODE[c]));
    section.row(&[vec!["planner limits, public code".to_owned()], code.to_vec()].concat());

    // At the origin as centre of mass, as the reference tabulates.
    let at_origin = Reach(ForceAllocation::new(ImpellerMode::Aggressive, nalgebra::Vector3::zeros()));
    let fx = [at_origin.largest(along(3, 1.0))?, at_origin.largest(along(3, -1.0))?];
    section
        .line(format!("\nWith the centre of mass at the origin mode 3 reaches fx = {:.4} / {:.4} N.\n", fx[0], fx[1]));
    section.must(
        (fx[0] - 0.3995).abs() < 1e-4 && (fx[1] - 0.4067).abs() < 1e-4,
        "these are the limits found by running NASA's allocation (+0.3995, -0.4067 N)",
    );
    let most = reach.iter().flat_map(|limits| limits[3]).fold(0.0, f64::max).max(fx[1]);
    section.printed(
        "cannot be",
        &format!("a controller limit of 0.452 N in x: the largest unsaturated fx of any mode is {most:.4} N, the limit never acts before the flaps do"),
    );
    for (component, name) in COMPONENTS.iter().enumerate() {
        let [nominal, aggressive] = [1, 2].map(|mode: usize| reach[mode][component][0].min(reach[mode][component][1]));
        let limit = TABLE_6_7[component];
        let reached = |most: f64| if limit <= most { "reachable" } else { "not reachable" };
        section.line(format!(
            "  - {name}: limit {limit}, mode 2 gives {nominal:.4} ({}), mode 3 {aggressive:.4} ({}); planner limit {}: {} in mode 2",
            reached(nominal),
            reached(aggressive),
            PLANNER[component],
            if PLANNER[component] <= nominal { "reachable" } else { "not reachable" },
        ));
    }
    section.line("\nAll components at once:");
    section.columns(&[
        "box",
        "mode",
        "share of the box that is reached",
        "largest factor on the box that is all reached",
    ]);
    let mut random = Gaussian::from_seed(67);
    let mut rows = Vec::new();
    for (about, limits) in
        [("controller, table 6.7", TABLE_6_7), ("planner, table 6.7", PLANNER), ("planner, public code", PLANNER_CODE)]
    {
        for mode in modes {
            let one = Reach::of(mode);
            let share = one.share(limits, size.draws, &mut random)?;
            let factor = one.largest_box(limits)?;
            let inside = one.share(limits.map(|limit| 0.999 * factor * limit), size.draws, &mut random)?;
            if inside < 1.0 {
                section.missed.push(format!("{about}, mode {}: corners do not bound the box", mode.number()));
            }
            section.row(&[
                about.to_owned(),
                mode.number().to_string(),
                format!("{:.1} %", 100.0 * share),
                format!("{factor:.3}"),
            ]);
            rows.push(vec![f64::from(mode.number()), share, factor]);
        }
    }
    section.line("");
    let safe = rows.iter().map(|row| row[2]).fold(0.0, f64::max);
    section.printed(
        "holds in part",
        &format!(
            "\"supplying tight actuation bounds via a controller could eliminate the need for the FAM inversion\": only much tighter \
             ones; of all boxes and modes above the best must shrink to {safe:.3} of its size before no combination saturates"
        ),
    );
    let header = "mode,component,limit_positive,limit_negative,controller_limit,planner_limit";
    let singles = reach.iter().zip(modes).flat_map(|(limits, mode)| {
        limits
            .iter()
            .enumerate()
            .map(move |(c, pair)| vec![f64::from(mode.number()), c as f64, pair[0], pair[1], TABLE_6_7[c], PLANNER[c]])
    });
    section.tables.push(("table_6_7_reach.csv", csv(header, singles)));
    section.tables.push(("table_6_7_boxes.csv", csv("mode,share_reached,largest_factor", rows)));
    Ok(section)
}
