//! Whether the wrench answers to the noise of the measurements.
//!
//! A controller turns noise of what it is told into wrench. Where much of the wrench is made so, what moves the body follows what its motion is
//! compared with, and every estimate is biased: that of the likelihood by as much as its standard deviation where noise alone excites the body,
//! since its trajectory is fitted to the very noise that made it; that of a regression by many.
//!
//! Third differences of what is measured are noise where samples follow each other fast. Where they do not, motion is left in them, and a smooth
//! wrench follows from it. But motion tells of a wrench from both sides in time and noise from one only: what the measurements *after* a wrench
//! explain is taken off.

use super::timeline::Timeline;
use crate::BodyScale;
use crate::lie::LieGroup;
use crate::motion::MotionSample;
use nalgebra::{DMatrix, DVector, Vector3};

/// Measurements before a wrench that may have made it, and as many after it that cannot.
const LAGS: usize = 20;
/// Measurements in a third difference: the first one after a wrench that holds none from before it ends this much later.
const SPAN: usize = 4;
/// Shortest step between them, s: together they reach further back than loops of control are late.
const STEP_S: f64 = 0.016;
/// Wrenches looked at, at most.
const MOST: usize = 4096;
/// Fewest of them per unknown.
const FEWEST: usize = 10;
/// Third differences are noise where their root mean square is this much larger than what the wrench moves.
const STANDS_OUT: f64 = 10.0;

/// What a third difference is taken of, in the axes of the wrench that answers to it.
#[derive(Clone, Copy)]
enum Stream {
    Position,
    Velocity,
    Attitude,
    Rate,
}

/// Third difference that ends at a sample, from samples `stride` apart: no motion is left in it.
fn third_difference(record: &[MotionSample], stream: Stream, end: usize, stride: usize) -> Option<Vector3<f64>> {
    let sample = |back: usize| record.get(end.checked_sub(back * stride)?);
    let combined = |value: &dyn Fn(&MotionSample) -> Option<Vector3<f64>>| {
        Some(value(sample(0)?)? - value(sample(1)?)? * 3.0 + value(sample(2)?)? * 3.0 - value(sample(3)?)?)
    };
    let turn = |back: usize| {
        let (from, to) = (sample(back + 1)?.world_from_body?, sample(back)?.world_from_body?);
        Some((from.rotation.inverse() * to.rotation).log())
    };
    match stream {
        Stream::Position => combined(&|sample| Some(sample.world_from_body?.translation.vector)),
        Stream::Velocity => combined(&|sample| sample.velocity_origin_world),
        Stream::Rate => combined(&|sample| sample.rate_body),
        Stream::Attitude => Some(turn(0)? - turn(1)? * 2.0 + turn(2)?),
    }
}

/// The larger of two shares: of the mean square of the force that the noise of positions and velocities before it explains more of than what
/// comes after it, and of the torque that the noise of attitudes and rates does.
pub(super) fn share(record: &[MotionSample], timeline: &Timeline, scale: BodyScale) -> f64 {
    let stride = crate::likelihood::whole(STEP_S / timeline.median_step_s()).max(1);
    let step_s = timeline.median_step_s() * stride as f64;
    let ends: Vec<usize> = (0..timeline.len()).step_by(stride).take(MOST).collect();
    let force_world = |sample: &MotionSample| {
        let wrench = sample.wrench_body?;
        Some(sample.world_from_body?.rotation * wrench.force)
    };
    let inertia = scale.mass_kg() * scale.length_m() * scale.length_m();
    let wrench = |of: &dyn Fn(&MotionSample) -> Option<Vector3<f64>>| -> Vec<Option<Vector3<f64>>> {
        ends.iter().map(|&end| record.get(end).and_then(of)).collect()
    };
    let noise = |stream: Stream| -> Vec<Option<Vector3<f64>>> {
        let seen = |end: usize| end >= 3 * stride && timeline.without_gap(end - 3 * stride, end);
        ends.iter().map(|&end| seen(end).then(|| third_difference(record, stream, end, stride)).flatten()).collect()
    };
    let of = |wrench: &[Option<Vector3<f64>>], streams: [Stream; 2], mobility: f64| {
        let [first, second] = [differences(wrench, 1), differences(wrench, 2)];
        let moved = [first * mobility * step_s * step_s, second * mobility * step_s];
        let noises: Vec<_> = streams
            .into_iter()
            .zip(moved)
            .map(|(stream, moved)| (noise(stream), moved))
            .filter(|(noise, moved)| root_mean_square(noise.iter().flatten()) > STANDS_OUT * moved)
            .map(|(noise, _)| noise)
            .collect();
        let of = |reach| explained(wrench, &noises, reach);
        (of(Reach::Before) - of(Reach::After)).max(0.0)
    };
    let of_force = of(&wrench(&force_world), [Stream::Position, Stream::Velocity], 1.0 / scale.mass_kg());
    let torque = |sample: &MotionSample| Some(sample.wrench_body?.torque);
    let of_torque = of(&wrench(&torque), [Stream::Attitude, Stream::Rate], 1.0 / inertia);
    of_force.max(of_torque)
}

fn root_mean_square<'a>(values: impl Iterator<Item = &'a Vector3<f64>>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0_f64), |(sum, count), value| (sum + value.norm_squared(), count + 1.0));
    (sum / count.max(1.0)).sqrt()
}

/// Root mean square of the first or second differences of a series.
fn differences(series: &[Option<Vector3<f64>>], order: usize) -> f64 {
    let of = |window: &[Option<Vector3<f64>>]| match (order, window) {
        (1, [a, b]) => Some((*b)? - (*a)?),
        (2, [a, b, c]) => Some((*c)? - (*b)? * 2.0 + (*a)?),
        _ => None,
    };
    let all: Vec<Vector3<f64>> = series.windows(order + 1).filter_map(of).collect();
    root_mean_square(all.iter())
}

/// Which noises a wrench is explained by.
#[derive(Clone, Copy)]
enum Reach {
    /// Those at it and before it.
    Before,
    /// Those that hold nothing from before it.
    After,
}

/// Share of the mean square of a series that linear functions of the noises before or after it explain, axis by axis, chance taken off.
fn explained(series: &[Option<Vector3<f64>>], noises: &[Vec<Option<Vector3<f64>>>], reach: Reach) -> f64 {
    let unknowns = noises.len() * LAGS;
    let (mut all, mut due) = (0.0, 0.0);
    for axis in 0..3 {
        let mut normal = DMatrix::<f64>::zeros(unknowns, unknowns);
        let mut right = DVector::<f64>::zeros(unknowns);
        let (mut square, mut count) = (0.0, 0_usize);
        let mut row = DVector::<f64>::zeros(unknowns);
        for (k, value) in series.iter().enumerate() {
            let end = match reach {
                Reach::Before => k + 1,
                Reach::After => k + SPAN + LAGS,
            };
            let beside = noises.iter().filter_map(|noise| noise.get(end.checked_sub(LAGS)?..end)).flatten();
            let mut filled = 0;
            for (place, noise) in row.iter_mut().zip(beside).filter_map(|(place, noise)| Some((place, noise.as_ref()?)))
            {
                *place = noise[axis];
                filled += 1;
            }
            let Some(value) = value.filter(|_| filled == unknowns) else { continue };
            normal.syger(1.0, &row, &row, 1.0);
            right.axpy(value[axis], &row, 1.0);
            square += value[axis] * value[axis];
            count += 1;
        }
        if unknowns == 0 || count < FEWEST * unknowns {
            continue;
        }
        normal.fill_upper_triangle_with_lower_triangle();
        let Some(found) = normal.cholesky() else { continue };
        all += square;
        let by_chance = square * unknowns as f64 / count as f64;
        due += (right.dot(&found.solve(&right)) - by_chance).max(0.0);
    }
    if all > 0.0 { due / all } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::share;
    use crate::BodyScale;
    use crate::identify::timeline::Timeline;
    use crate::lie::{Pose, Wrench};
    use crate::motion::MotionSample;
    use crate::noise::Gaussian;
    use nalgebra::{UnitQuaternion, Vector3};

    const MASS_KG: f64 = 12.0;

    /// A point that is pushed by a wanted force and by the answer of a controller, ten steps late, to what is measured with noise.
    fn flight(noise_m: f64, stiffness_n_m: f64, wanted_n: f64) -> f64 {
        flight_at(16, noise_m, stiffness_n_m, wanted_n)
    }

    fn flight_at(step_ms: u32, noise_m: f64, stiffness_n_m: f64, wanted_n: f64) -> f64 {
        let (step_s, step_ns) = (1e-3 * f64::from(step_ms), 1_000_000 * i64::from(step_ms));
        let mut dice = Gaussian::from_seed(7);
        let (mut place, mut speed) = (0.0, 0.0);
        let mut record: Vec<MotionSample> = Vec::new();
        for k in 0..3000_i64 {
            let time_s = k as f64 * step_s;
            let seen = place + noise_m * dice.normal();
            let speed_seen = speed + 0.5 * noise_m * dice.normal();
            let told = |back: usize| {
                let sample = &record[record.len() - back];
                let place = sample.world_from_body.map_or(0.0, |pose| pose.translation.vector.x);
                (place, sample.velocity_origin_world.map_or(0.0, |velocity| velocity.x))
            };
            let (old, old_speed) = if record.len() > 10 { told(10) } else { (0.0, 0.0) };
            let force = wanted_n * (0.8 * time_s).sin() - stiffness_n_m * (old + 2.0 * old_speed);
            record.push(MotionSample {
                time_ns: k * step_ns,
                world_from_body: Some(Pose::from_parts(
                    Vector3::new(seen, 0.0, 0.0).into(),
                    UnitQuaternion::identity(),
                )),
                velocity_origin_world: Some(Vector3::x() * speed_seen),
                wrench_body: Some(Wrench::new(Vector3::zeros(), Vector3::x() * force)),
                ..MotionSample::default()
            });
            place += speed * step_s + 0.5 * force / MASS_KG * step_s * step_s;
            speed += force / MASS_KG * step_s;
        }
        let timeline = Timeline::try_new(&record).unwrap();
        share(&record, &timeline, BodyScale::try_new(MASS_KG, 0.1).unwrap())
    }

    #[test]
    fn a_wrench_that_answers_to_noise_is_seen() {
        let holding = flight(2e-3, 6.0, 0.0);
        assert!(holding > 0.3, "station keeping: {holding}");
        let excited = flight(2e-3, 6.0, 0.4);
        assert!(excited < 0.1, "the same with an excitation that is large beside it: {excited}");
    }

    #[test]
    fn a_wrench_that_does_not_is_not_accused() {
        let open = flight(2e-3, 0.0, 0.4);
        assert!(open < 0.02, "no controller: {open}");
        let exact = flight(0.0, 6.0, 0.4);
        assert!(exact < 0.02, "a controller, no noise: {exact}");
        let seldom = flight_at(50, 1e-3, 0.0, 0.4);
        assert!(seldom < 0.05, "no controller, twenty samples a second: {seldom}");
    }
}
