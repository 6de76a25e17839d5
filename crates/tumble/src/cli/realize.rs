//! `tumble realize`: from flap angles and impeller speeds to the thrust that the hardware gives.

use super::Outcome;
use super::columns::{Columns, NumberRow, Rows, Written, numbered, open, outcome};
use crate::TumbleError;
use clap::Args;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use tumble_astrobee::propulsion::constants::FLAP_TRAVEL_RAD;
use tumble_astrobee::propulsion::{AreaTable, InverseAllocation, Module};

const OPENINGS: [&str; 8] = ["pm", "N", "dtheta1", "dtheta2", "dtheta3", "dtheta4", "dtheta5", "dtheta6"];
/// By how much an angle may pass its stop, rad: tables of 32-bit numbers round it up.
const ROUNDING_RAD: f64 = 1e-6;

/// Options of `tumble realize`.
#[derive(Args)]
#[command(after_help = "\
Input: CSV with the columns pm,N,dtheta1,...,dtheta6 in any order; others are named on stderr and ignored. Each row is one module: pm is 1
(starboard, nozzles 1 to 6) or 2 (port, nozzles 7 to 12), N the speed of its impeller in rad/s, dtheta the angle of each nozzle's flaps
from the closed stop, 0 to 1.121025 rad.

Output: these columns, then the pressure coefficient cdp, the pressure dp in Pa, thrust1 to thrust6 in N and the module's wrench
fx,fy,fz,tx,ty,tz, N and N m in body axes, torque about the body origin. Physical values, each module with its own leak area: the flown
simulation multiplies thrust by 1.25 on top.

Example: printf 'pm,N,dtheta1,dtheta2,dtheta3,dtheta4,dtheta5,dtheta6\\n1,261.8,0.5,0,0,0,0,0\\n' | tumble realize -")]
pub struct RealizeArgs {
    /// Impeller speeds and flap angles (CSV), or - for standard input.
    openings: PathBuf,
    /// Cut the table of pressure over area at the largest thrust as the thesis does: overstates saturated commands.
    #[arg(long)]
    thesis_table: bool,
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input, naming its line; the rows before it are written.
pub fn run(args: &RealizeArgs) -> Result<Outcome, TumbleError> {
    let (path, input) = open(&args.openings)?;
    let areas = if args.thesis_table { AreaTable::Thesis } else { AreaTable::Full };
    table(areas, &path, input, std::io::stdout().lock(), &mut std::io::stderr())?;
    Ok(Outcome::Achieved)
}

/// From a table of openings to one of thrusts; `path` names the input in messages.
///
/// # Errors
/// As [`run`].
pub fn table(
    areas: AreaTable,
    path: &Path,
    input: impl Read,
    output: impl Write,
    warnings: &mut impl Write,
) -> Result<(), TumbleError> {
    let mut openings = Columns::new(input, path, &OPENINGS, warnings)?;
    let inverse = InverseAllocation { table: areas, ..InverseAllocation::default() };
    outcome(realize_rows(inverse, &mut openings, output))
}

fn realize_rows(
    inverse: InverseAllocation,
    openings: &mut Columns<impl Read, 8>,
    output: impl Write,
) -> Result<(), Written> {
    let names = OPENINGS.into_iter().chain(["cdp", "dp"]).map(str::to_owned).chain(numbered("thrust", 6));
    let names = names.chain(["fx", "fy", "fz", "tx", "ty", "tz"].map(str::to_owned));
    let mut rows = Rows::start(output, &names.collect::<Vec<_>>());
    let written = loop {
        match openings.next_row() {
            Ok(Some(row)) => {
                if let Err(error) = realize_row(inverse, &row, &mut rows) {
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

fn realize_row(inverse: InverseAllocation, row: &NumberRow<'_, 8>, rows: &mut Rows<impl Write>) -> Result<(), Written> {
    let [number, speed_rad_s, openings_rad @ ..] = row.values;
    let module = if number.total_cmp(&1.0).is_eq() {
        Module::Starboard
    } else if number.total_cmp(&2.0).is_eq() {
        Module::Port
    } else {
        return Err(row.out_of_range(0, "a module is 1 (starboard) or 2 (port)").into());
    };
    // beyond any impeller, and small enough that its square is a number
    if !(0.0..=1e6).contains(&speed_rad_s) {
        return Err(row.out_of_range(1, "an impeller's speed is 0 to 1e6 rad/s").into());
    }
    for (opening_rad, column) in openings_rad.iter().zip(2..) {
        if !(0.0..=FLAP_TRAVEL_RAD + ROUNDING_RAD).contains(opening_rad) {
            return Err(row.out_of_range(column, "a flap's angle is 0 (closed) to 1.121025 rad").into());
        }
    }
    let flow = inverse.module(module, speed_rad_s, &openings_rad);
    let wrench = module.wrench_of_thrusts(&flow.thrusts_n);
    for cell in row.texts() {
        rows.text(cell);
    }
    rows.numbers(&[flow.pressure_coefficient, flow.pressure_pa]);
    rows.numbers(&flow.thrusts_n);
    rows.numbers(wrench.force.as_slice());
    rows.numbers(wrench.torque.as_slice());
    rows.end_row()
}
