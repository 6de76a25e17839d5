//! Whether positions plainly wander, told without a body: they leave the integral of the velocities by more than white errors do.
//!
//! An answer that takes errors for white is then not worth the time that it takes.

use super::timeline::Timeline;
use crate::motion::MotionSample;
use nalgebra::Vector3;

/// Length of a block of samples, s.
const BLOCK_S: f64 = 1.0;
/// Samples that a block needs.
const FEWEST: usize = 8;
/// Blocks that are needed.
const BLOCKS: usize = 20;
/// Steps longer than this leave too much of the motion between two velocities, s.
const LONGEST_STEP_S: f64 = 0.1;
/// Mean square of what two blocks beside each other are apart, in units of what white errors make of it.
const PLAINLY: f64 = 10.0;

/// Tallies over all runs of samples.
#[derive(Default)]
struct Blocks {
    /// Squared differences from sample to sample of what is left, and how many.
    steps: (f64, usize),
    /// Squared changes of the velocity from sample to sample times the step, and how many.
    changes: (f64, usize),
    /// Squared third differences of the velocity, and how many.
    velocities: (f64, usize),
    /// Squared differences of the means of blocks, and how many.
    apart: (f64, usize),
    /// Their sum: an offset of the velocities moves all means alike.
    drifted: Vector3<f64>,
    /// Samples of all blocks, and how many blocks.
    samples: (usize, usize),
}

impl Blocks {
    /// Counts one run, mostly in steps of this length, s: time, s, position and velocity of each sample.
    fn count(&mut self, run: &[(f64, Vector3<f64>, Vector3<f64>)], step_s: f64) {
        let mut left = Vector3::zeros();
        let mut integral = Vector3::zeros();
        let (mut block, mut before): ((f64, Vector3<f64>, usize), Option<Vector3<f64>>) =
            ((f64::NEG_INFINITY, Vector3::zeros(), 0), None);
        for (k, (time_s, position, velocity)) in run.iter().enumerate() {
            if let Some((last_s, _, last)) = k.checked_sub(1).and_then(|last| run.get(last)) {
                integral += (last + velocity) * (0.5 * (time_s - last_s));
                let now = position - integral;
                self.steps.0 += (now - left).norm_squared();
                self.steps.1 += 1;
                self.changes.0 += ((velocity - last) * (time_s - last_s)).norm_squared();
                self.changes.1 += 1;
            }
            left = position - integral;
            if let [(from_s, _, a), (_, _, b), (_, _, c), (to_s, _, d)] =
                run.get(k.wrapping_sub(3)..=k).unwrap_or_default()
                && to_s - from_s < 3.5 * step_s
            {
                self.velocities.0 += (d - c * 3.0 + b * 3.0 - a).norm_squared();
                self.velocities.1 += 1;
            }
            if time_s - block.0 >= BLOCK_S {
                if block.2 >= FEWEST {
                    let mean = block.1 / block.2 as f64;
                    if let Some(before) = before {
                        self.apart.0 += (mean - before).norm_squared();
                        self.apart.1 += 1;
                        self.drifted += mean - before;
                    }
                    self.samples = (self.samples.0 + block.2, self.samples.1 + 1);
                    before = Some(mean);
                }
                block = (*time_s, Vector3::zeros(), 0);
            }
            block.1 += left;
            block.2 += 1;
        }
    }
}

/// Whether the positions wander beyond doubt.
pub(super) fn is_plain(record: &[MotionSample], timeline: &Timeline) -> bool {
    let step_s = timeline.median_step_s();
    if !(step_s > 0.0 && step_s <= LONGEST_STEP_S) {
        return false;
    }
    let (mut blocks, mut run) = (Blocks::default(), Vec::<(f64, Vector3<f64>, Vector3<f64>)>::new());
    for (k, sample) in record.iter().enumerate() {
        let seen = sample.world_from_body.zip(sample.velocity_origin_world);
        let time_s = timeline.time_ns(k) as f64 * 1e-9;
        // Rows that are lost here and there leave little of the motion between two velocities.
        let goes_on = seen.is_some() && run.last().is_none_or(|(last_s, ..)| time_s - last_s <= LONGEST_STEP_S);
        if !goes_on {
            blocks.count(&run, step_s);
            run.clear();
        }
        if let Some((pose, velocity)) = seen {
            run.push((time_s, pose.translation.vector, velocity));
        }
    }
    blocks.count(&run, step_s);
    let Blocks { steps, changes, velocities, apart, drifted, samples } = blocks;
    if apart.1 < BLOCKS {
        return false;
    }
    let mean = |(sum, count): (f64, usize)| sum / count.max(1) as f64;
    let per_block = samples.0 as f64 / samples.1 as f64;
    // Means of white errors, a walk of the integral of white errors of the velocity, and what the straight lines of that integral leave out.
    let walk = 2.0 / 3.0 * per_block * mean(velocities) / 20.0 * step_s * step_s;
    let white = mean(steps) / per_block + walk + mean(changes) / 36.0;
    let drift = drifted / apart.1 as f64;
    mean(apart) - drift.norm_squared() > PLAINLY * white
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;
    use nalgebra::{Isometry3, UnitQuaternion};

    /// Standard deviations of what a record is off by, and the offset of its velocities.
    #[derive(Clone, Copy)]
    struct Errors {
        position_m: f64,
        velocity_m_s: f64,
        wander_m: f64,
        wander_s: f64,
        offset_m_s: f64,
    }

    const WHITE: Errors =
        Errors { position_m: 2e-3, velocity_m_s: 1e-3, wander_m: 0.0, wander_s: 15.0, offset_m_s: 0.0 };
    const WANDERING: Errors = Errors { wander_m: 0.02, ..WHITE };

    /// Two minutes of a motion.
    fn record(seed: u64, step_ns: i64, errors: Errors) -> Vec<MotionSample> {
        let (mut noise, mut wander) = (Gaussian::from_seed(seed), Vector3::zeros());
        let kept = (-1e-9 * step_ns as f64 / errors.wander_s).exp();
        wander += noise.vector(errors.wander_m);
        (0..120_000_000_000 / step_ns)
            .map(|k| {
                let (time_ns, at_s) = (k * step_ns, 1e-9 * (k * step_ns) as f64);
                wander = wander * kept + noise.vector(errors.wander_m * (1.0 - kept * kept).sqrt());
                let of = |i: f64| 0.2 + 0.1 * i;
                let position = Vector3::new(0.0, 1.0, 2.0).map(|i| 0.3 * (of(i) * at_s).sin());
                let velocity = Vector3::new(0.0, 1.0, 2.0).map(|i| 0.3 * of(i) * (of(i) * at_s).cos());
                let measured = position + wander + noise.vector(errors.position_m);
                MotionSample {
                    time_ns,
                    world_from_body: Some(Isometry3::from_parts(measured.into(), UnitQuaternion::identity())),
                    velocity_origin_world: Some(
                        velocity + noise.vector(errors.velocity_m_s) + Vector3::x() * errors.offset_m_s,
                    ),
                    ..MotionSample::default()
                }
            })
            .collect()
    }

    fn is_plain(record: &[MotionSample]) -> bool {
        super::is_plain(record, &Timeline::try_new(record).unwrap())
    }

    #[test]
    fn wander_is_told_and_white_errors_are_not() {
        for seed in 0..20 {
            for step_ns in [4_000_000, 16_000_000, 50_000_000] {
                assert!(!is_plain(&record(seed, step_ns, WHITE)), "{seed}, {step_ns}");
                assert!(is_plain(&record(seed, step_ns, WANDERING)), "{seed}, {step_ns}");
            }
            // Below what is plain the likelihoods decide.
            assert!(!is_plain(&record(seed, 16_000_000, Errors { wander_m: 1e-4, ..WHITE })));
            // Nor are velocities so noisy that their integral walks, or off by an offset, wander of the position.
            let loud = Errors { position_m: 1e-4, velocity_m_s: 0.05, ..WHITE };
            assert!(!is_plain(&record(seed, 16_000_000, loud)), "{seed}");
            // What no error is in does not wander.
            let exact = Errors { position_m: 0.0, velocity_m_s: 0.0, ..WHITE };
            assert!(!is_plain(&record(seed, 16_000_000, exact)), "{seed}");
            assert!(!is_plain(&record(seed, 16_000_000, Errors { offset_m_s: 0.02, ..WHITE })), "{seed}");
        }
    }

    #[test]
    fn rows_that_are_lost_change_nothing() {
        for seed in 0..20 {
            let thinned = |errors: Errors| -> Vec<MotionSample> {
                let kept = |k: &usize| !k.is_multiple_of(7) && k % 11 > 1;
                record(seed, 16_000_000, errors)
                    .into_iter()
                    .enumerate()
                    .filter(|(k, _)| kept(k))
                    .map(|(_, s)| s)
                    .collect()
            };
            assert!(!is_plain(&thinned(WHITE)), "{seed}");
            assert!(is_plain(&thinned(WANDERING)), "{seed}");
            let loud = Errors { position_m: 1e-4, velocity_m_s: 0.05, ..WHITE };
            assert!(!is_plain(&thinned(loud)), "{seed}");
            assert!(!is_plain(&thinned(Errors { position_m: 0.0, velocity_m_s: 0.0, ..WHITE })), "{seed}");
        }
    }

    #[test]
    fn what_does_not_suffice_is_not_plain() {
        let whole = record(3, 16_000_000, WANDERING);
        assert!(!is_plain(&whole[..1000]));
        let mut poses = whole.clone();
        for sample in &mut poses {
            sample.velocity_origin_world = None;
        }
        assert!(!is_plain(&poses));
        assert!(!is_plain(&record(3, 200_000_000, WANDERING)));
    }
}
