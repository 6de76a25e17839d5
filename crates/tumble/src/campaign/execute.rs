//! Flies the rows of a shard on several threads; whoever flies a mission, its row is the same.

use super::journal::Journal;
use super::row::{Row, Status};
use super::{CampaignPlan, MissionRunner, PlannedMission, Shard};
use crate::TumbleError;
use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

/// How far a campaign is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Rows that an earlier run had flown.
    pub resumed: u64,
    /// Rows that this run has flown.
    pub flown: u64,
    /// Rows of the shard.
    pub all: u64,
}

/// Flies what is missing in `rows` of a shard with `jobs` threads, writes each row down as it comes, and answers with all rows of the
/// shard in order.
///
/// # Errors
/// [`FormatsError::Unwritable`](tumble_formats::FormatsError::Unwritable): without a journal nothing more is flown.
pub fn execute(
    plan: &CampaignPlan,
    shard: Shard,
    jobs: usize,
    runner: &impl MissionRunner,
    (journal, mut rows): (&mut Journal, BTreeMap<u64, Row>),
    mut tell: impl FnMut(Progress),
) -> Result<Vec<Row>, TumbleError> {
    let range = shard.rows(plan.rows());
    let is_planned = |row: &Row| plan.mission(row.number).is_some_and(|mission| row.is_of(&mission));
    rows.retain(|number, row| range.contains(number) && is_planned(row));
    let missing: Vec<PlannedMission> =
        range.clone().filter(|number| !rows.contains_key(number)).filter_map(|number| plan.mission(number)).collect();
    let mut progress = Progress { resumed: rows.len() as u64, flown: 0, all: range.end - range.start };
    tell(progress);
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, missing.len().max(1)) {
            let sender = sender.clone();
            let (next, stop, missing) = (&next, &stop, &missing);
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    let Some(mission) = missing.get(next.fetch_add(1, Ordering::Relaxed)) else { return };
                    if sender.send(fly(runner, mission)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for row in receiver {
            journal.write(&row).inspect_err(|_| stop.store(true, Ordering::Relaxed))?;
            rows.insert(row.number, row);
            progress.flown += 1;
            tell(progress);
        }
        journal.sync()
    })?;
    Ok(rows.into_values().collect())
}

/// One mission, whatever happens in it.
fn fly(runner: &impl MissionRunner, mission: &PlannedMission) -> Row {
    // The runner is shared and not written to: nothing half done can be seen after a panic.
    match catch_unwind(AssertUnwindSafe(|| runner.run(mission))) {
        Ok(Ok(Some(summary))) => {
            let message = summary.warnings.first().or(summary.fallbacks.first().map(|fallback| &fallback.reason));
            Row::new(mission, Status::Flown, Some(&summary), message.map_or("", String::as_str))
        }
        Ok(Ok(None)) => Row::new(mission, Status::Planned, None, ""),
        Ok(Err(error)) => Row::new(mission, Status::Error, None, &format!("{}: {error}", error.code())),
        Err(panic) => Row::new(mission, Status::Panic, None, said(panic.as_ref())),
    }
}

/// What a panic said.
fn said(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}
