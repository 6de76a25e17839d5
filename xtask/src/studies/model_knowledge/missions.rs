//! Whole missions.

use crate::Failure;
use crate::targets::Report;

pub fn coverage(_report: &mut Report, _seeds: usize) -> Result<(), Failure> {
    Ok(())
}

pub fn informative(_report: &mut Report, _seeds: usize) -> Result<(), Failure> {
    Ok(())
}
