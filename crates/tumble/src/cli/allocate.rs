//! `tumble allocate`: from wanted wrenches to what the propulsion modules are told, and what that gives.

use super::Outcome;
use super::columns::{Columns, NumberRow, Rows, Written, numbered, open, outcome};
use crate::TumbleError;
use clap::Args;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use tumble_astrobee::propulsion::{AreaTable, ForceAllocation, ImpellerMode, PositivityShift, QuantizedAllocation};
use tumble_dynamics::Actuation as _;
use tumble_dynamics::nalgebra::Vector3;
use tumble_lie::Wrench;

const WANTED: [&str; 10] = ["mode", "fx", "fy", "fz", "tx", "ty", "tz", "comx", "comy", "comz"];

/// Options of `tumble allocate`.
#[derive(Args)]
#[command(after_help = "\
Input: CSV with the columns mode,fx,fy,fz,tx,ty,tz,comx,comy,comz in any order; others are named on stderr and ignored. The mode
is that of the impellers, 0 off, 1 quiet, 2 nominal, 3 aggressive; force in N, torque in N m about the centre of mass, centre of mass
in m, body axes (x forward, y starboard, z down).

Output: these columns, then, of the twelve nozzles (1 to 6 on module 1, starboard) and the two modules: thrust thr, N; pressure
coefficient cdp; pressure dp, Pa; flap angle from the closed stop dtheta, rad; the same in counts servof; the byte sent servo. Last the
wrench rfx,rfy,rfz,rtx,rty,rtz that these bytes give, N and N m, torque about the centre of mass as asked for, if the impellers turn at
their mode's speed and both modules leak as module 1 does: what the allocation believes. What the hardware gives: `tumble realize`.

Example: printf 'mode,fx,fy,fz,tx,ty,tz,comx,comy,comz\\n2,0.1,0,0,0,0,0,0,0,0\\n' | tumble allocate -")]
pub struct AllocateArgs {
    /// Wanted wrenches (CSV), or - for standard input.
    wrenches: PathBuf,
    /// Make thrusts positive as the thesis prints it, which misses the wrench where a thrust stays negative.
    #[arg(long)]
    thesis_shift: bool,
    /// Cut the table of pressure over area at the largest thrust as the thesis does: overstates saturated commands.
    #[arg(long)]
    thesis_table: bool,
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input, naming its line; the rows before it are written.
pub fn run(args: &AllocateArgs) -> Result<Outcome, TumbleError> {
    let (path, input) = open(&args.wrenches)?;
    let shift = if args.thesis_shift { PositivityShift::Thesis } else { PositivityShift::AxisGroups };
    let areas = if args.thesis_table { AreaTable::Thesis } else { AreaTable::Full };
    table(shift, areas, &path, input, std::io::stdout().lock(), &mut std::io::stderr())?;
    Ok(Outcome::Achieved)
}

/// From a table of wrenches to one of allocations; `path` names the input in messages.
///
/// # Errors
/// As [`run`].
pub fn table(
    shift: PositivityShift,
    areas: AreaTable,
    path: &Path,
    input: impl Read,
    output: impl Write,
    warnings: &mut impl Write,
) -> Result<(), TumbleError> {
    let mut wrenches = Columns::new(input, path, &WANTED, warnings)?;
    outcome(allocate_rows(shift, areas, &mut wrenches, output))
}

fn allocate_rows(
    shift: PositivityShift,
    areas: AreaTable,
    wrenches: &mut Columns<impl Read, 10>,
    output: impl Write,
) -> Result<(), Written> {
    let names = WANTED.map(str::to_owned).into_iter();
    let names = names.chain(numbered("thr", 12)).chain(numbered("cdp", 2)).chain(numbered("dp", 2));
    let names = names.chain(numbered("dtheta", 12)).chain(numbered("servof", 12)).chain(numbered("servo", 12));
    let names = names.chain(["rfx", "rfy", "rfz", "rtx", "rty", "rtz"].map(str::to_owned));
    let mut rows = Rows::start(output, &names.collect::<Vec<_>>());
    let written = loop {
        match wrenches.next_row() {
            Ok(Some(row)) => {
                if let Err(error) = allocate_row(shift, areas, &row, &mut rows) {
                    break Err(error);
                }
            }
            Ok(None) => break Ok(()),
            Err(error) => break Err(error.into()),
        }
    };
    rows.finish()?;
    written
}

fn allocate_row(
    shift: PositivityShift,
    areas: AreaTable,
    row: &NumberRow<'_, 10>,
    rows: &mut Rows<impl Write>,
) -> Result<(), Written> {
    let [number, fx, fy, fz, tx, ty, tz, x, y, z] = row.values;
    let mode = ImpellerMode::ALL.into_iter().find(|mode| f64::from(mode.number()).total_cmp(&number).is_eq());
    let mode = mode.ok_or_else(|| row.out_of_range(0, "an impeller mode is 0, 1, 2 or 3"))?;
    let mut allocation = ForceAllocation::new(mode, Vector3::new(x, y, z));
    allocation.shift = shift;
    allocation.inverse.table = areas;
    let wanted = Wrench::new(Vector3::new(tx, ty, tz), Vector3::new(fx, fy, fz));
    let steps = allocation.allocate_steps(&allocation.about_origin(&wanted)).map_err(|_| {
        // the only numbers that are finite and have thrusts that are not
        let largest = (1..10).max_by(|a, b| row.values[*a].abs().total_cmp(&row.values[*b].abs()));
        row.out_of_range(largest.unwrap_or(1), "wrench and centre of mass must be small enough to compute thrusts with")
    })?;
    let realized = QuantizedAllocation(allocation).realize(&steps.bytes);
    let Wrench { torque, force } = allocation.about_center_of_mass(&realized);
    for cell in row.texts() {
        rows.text(cell);
    }
    rows.numbers(&steps.thrusts_n);
    rows.numbers(&steps.pressure_coefficients);
    rows.numbers(&steps.pressures_pa);
    rows.numbers(&steps.flaps.openings_rad);
    rows.numbers(&steps.counts);
    rows.numbers(&steps.bytes.nozzles.map(f64::from));
    rows.numbers(force.as_slice());
    rows.numbers(torque.as_slice());
    rows.end_row()
}
