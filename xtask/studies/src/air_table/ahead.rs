//! Where a model puts the satellite five seconds ahead, from where it was seen in the second before.

use super::{Row, VALVES};

/// Steps of the integration, s; seconds looked back on and ahead.
const STEP_S: f64 = 0.01;
const BACK_S: f64 = 1.0;
pub(super) const AHEAD_S: f64 = 5.0;
/// From the centre to a corner, m: there both places and yaw count.
const CORNER_M: f64 = 0.205;

/// A body in the plane and what its valves give.
pub(super) struct Model {
    pub(super) mass_kg: f64,
    pub(super) inertia_kg_m2: f64,
    pub(super) center_m: [f64; 2],
    pub(super) delay_s: f64,
    /// Share of thrust lost for each further open valve.
    pub(super) sag: f64,
    pub(super) scale: [f64; 8],
}

impl Model {
    /// Force, body axes, and torque about the centre of mass.
    fn pushed(&self, rows: &[Row], time_s: f64) -> [f64; 3] {
        let told = rows.partition_point(|row| row[0] <= time_s - self.delay_s).saturating_sub(1);
        let open = &rows[told][4..];
        let kept = 1.0 - self.sag * (open.iter().sum::<f64>() - 1.0).max(0.0);
        let mut pushed = [0.0; 3];
        for ((command, scale), (thrust_n, place, along)) in open.iter().zip(self.scale).zip(VALVES) {
            let thrust_n = command * scale * kept * thrust_n;
            let [x, y] = [place[0] - self.center_m[0], place[1] - self.center_m[1]];
            pushed[0] += thrust_n * along[0];
            pushed[1] += thrust_n * along[1];
            pushed[2] += thrust_n * (x * along[1] - y * along[0]);
        }
        pushed
    }

    /// Mean square of how far corners come from where they are put, m^2, within [`AHEAD_S`] of this time.
    pub(super) fn apart(&self, rows: &[Row], now_s: f64) -> f64 {
        let start_s = now_s - BACK_S;
        let pushed: Vec<[f64; 3]> = instants(start_s).map(|time_s| self.pushed(rows, time_s + 0.5 * STEP_S)).collect();
        let seen = |before: bool| {
            rows.iter().filter(move |row| {
                if before { (start_s..now_s).contains(&row[0]) } else { (now_s..now_s + AHEAD_S).contains(&row[0]) }
            })
        };
        let ran = |accelerations: Vec<f64>, place: usize, beside: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let mut motion = integrated(&accelerations);
            for (k, value) in motion.iter_mut().enumerate() {
                *value += beside(k);
            }
            let left = seen(true).map(|row| (row[0] - start_s, row[place] - at(&motion, row[0] - start_s)));
            let [offset, slope] = line(left);
            motion.iter().enumerate().map(|(k, value)| value + offset + slope * STEP_S * k as f64).collect()
        };
        let yaw = ran(pushed.iter().map(|pushed| pushed[2] / self.inertia_kg_m2).collect(), 3, &|_| 0.0);
        let world = |[x, y]: [f64; 2], angle: f64| {
            let (sin, cos) = angle.sin_cos();
            [cos * x - sin * y, sin * x + cos * y]
        };
        let places = [0, 1].map(|axis| {
            let accelerations = pushed.iter().zip(yaw.windows(2));
            let accelerations = accelerations
                .map(|(pushed, yaw)| world([pushed[0], pushed[1]], 0.5 * (yaw[0] + yaw[1]))[axis] / self.mass_kg);
            // The origin is seen, and the centre of mass moves.
            ran(accelerations.collect(), 1 + axis, &|k| -world(self.center_m, yaw[k])[axis])
        });
        let square = |row: &Row| {
            let since_s = row[0] - start_s;
            let [x, y] = [0, 1].map(|axis| row[1 + axis] - at(&places[axis], since_s));
            x * x + y * y + (CORNER_M * (row[3] - at(&yaw, since_s))).powi(2)
        };
        seen(false).map(square).sum::<f64>() / seen(false).count().max(1) as f64
    }
}

/// Beginnings of all steps.
fn instants(start_s: f64) -> impl Iterator<Item = f64> {
    let mut time_s = start_s;
    std::iter::from_fn(move || {
        let now_s = time_s;
        time_s += STEP_S;
        (now_s < start_s + BACK_S + AHEAD_S + STEP_S).then_some(now_s)
    })
}

/// From rest at zero, each acceleration held over its step.
fn integrated(accelerations: &[f64]) -> Vec<f64> {
    let (mut place, mut speed) = (0.0, 0.0);
    let mut motion = vec![0.0];
    for acceleration in accelerations {
        place += STEP_S * (speed + 0.5 * STEP_S * acceleration);
        speed += STEP_S * acceleration;
        motion.push(place);
    }
    motion
}

/// Straight between steps.
fn at(motion: &[f64], since_s: f64) -> f64 {
    let mut from_s = 0.0;
    for pair in motion.windows(2) {
        if since_s < from_s + STEP_S {
            return pair[0] + (pair[1] - pair[0]) * (since_s - from_s) / STEP_S;
        }
        from_s += STEP_S;
    }
    motion.last().copied().unwrap_or_default()
}

/// Offset and slope of the straight line through points, least squares.
fn line(points: impl Iterator<Item = (f64, f64)>) -> [f64; 2] {
    let (mut n, mut t, mut tt, mut y, mut ty) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (time, value) in points {
        n += 1.0;
        t += time;
        tt += time * time;
        y += value;
        ty += time * value;
    }
    let slope = (n * ty - t * y) / (n * tt - t * t);
    [(y - slope * t) / n, slope]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A valve that opens late turns and pushes a body about a centre of mass off the origin: the model that moves so has no error, others have.
    #[test]
    fn the_model_that_moves_so_predicts_it() {
        let scale = [1.0; 8];
        let truth =
            Model { mass_kg: 20.0, inertia_kg_m2: 0.3, center_m: [0.01, -0.04], delay_s: 0.12, sag: 0.05, scale };
        let mut rows: Vec<Row> = (0..140_usize)
            .map(|k| {
                let mut row = [0.0; 12];
                row[0] = 0.06 * k as f64;
                row[4 + (k / 9) % 8] = 1.0;
                row[4 + (k / 5) % 8] = 1.0;
                row
            })
            .collect();
        // Flown in steps of a tenth of a millisecond, not by the code above.
        let (mut place, mut speed, mut yaw, mut rate, mut next) = ([0.2, 0.1], [0.01, -0.02], 0.3_f64, 0.1, 0);
        let told = rows.clone();
        for k in 0..84_000 {
            let time_s = 1e-4 * f64::from(k);
            let (sin, cos) = yaw.sin_cos();
            let [x, y] = truth.center_m;
            if next < rows.len() && rows[next][0] <= time_s + 1e-9 {
                rows[next][1] = place[0] - (cos * x - sin * y);
                rows[next][2] = place[1] - (sin * x + cos * y);
                rows[next][3] = yaw;
                next += 1;
            }
            let [fx, fy, torque] = truth.pushed(&told, time_s);
            speed[0] += 1e-4 * (cos * fx - sin * fy) / truth.mass_kg;
            speed[1] += 1e-4 * (sin * fx + cos * fy) / truth.mass_kg;
            rate += 1e-4 * torque / truth.inertia_kg_m2;
            place = [place[0] + 1e-4 * speed[0], place[1] + 1e-4 * speed[1]];
            yaw += 1e-4 * rate;
        }
        let own = truth.apart(&rows, 2.0).sqrt();
        let others = [
            Model { delay_s: 0.0, ..truth },
            Model { inertia_kg_m2: 0.36, ..truth },
            Model { center_m: [0.0; 2], ..truth },
            Model { sag: 0.0, ..truth },
        ];
        for other in &others {
            assert!(other.apart(&rows, 2.0).sqrt() > 5.0 * own && own < 2e-3, "{own}");
        }
    }
}
