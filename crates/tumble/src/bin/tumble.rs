//! The `tumble` command line with the robots that come with it.

use std::process::ExitCode;

fn main() -> ExitCode {
    tumble::run(std::env::args_os(), &tumble::robots::shipped())
}
