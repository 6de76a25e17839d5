//! Least times along one axis, and along the scaled length of a path.

/// Relative amount that every bound gives away to rounding.
const ROUNDING: f64 = 1e-12;

/// Least time in which a speed that is at most one, changes by no more than `acceleration` per second, and starts and ends
/// at no more than `first` and `last`, covers `length`.
///
/// Speeds are in units of the limit, so `length` is in seconds and `acceleration` in 1/s. The speed is at most
/// `min(1, first + a t, last + a (T - t))`; the distance under that curve grows with `T` and is inverted.
pub(super) fn least_time(length: f64, first: f64, last: f64, acceleration: f64) -> f64 {
    let (first, last) = (first.clamp(0.0, 1.0), last.clamp(0.0, 1.0));
    if length <= 0.0 {
        return 0.0;
    }
    if acceleration <= 0.0 {
        return length / first.min(last) * (1.0 - ROUNDING);
    }
    let peak_squared = acceleration * length + 0.5 * (first * first + last * last);
    let peak = f64::sqrt(peak_squared);
    let (slow, fast) = (first.min(last), first.max(last));
    let time = if peak >= 1.0 {
        let lost = ((1.0 - first) * (1.0 - first) + (1.0 - last) * (1.0 - last)) / (2.0 * acceleration);
        length + lost
    } else if peak >= fast {
        (2.0 * peak - first - last) / acceleration
    } else {
        // Too short to meet the faster end: only the slower one counts.
        (f64::sqrt(slow * slow + 2.0 * acceleration * length) - slow) / acceleration
    };
    time * (1.0 - ROUNDING)
}

/// The same from the velocity `first` (negative: the wrong way, which is stopped and made good first).
pub(super) fn least_time_from(length: f64, first: f64, last: f64, acceleration: f64) -> f64 {
    if first >= 0.0 || length <= 0.0 {
        return least_time(length, first, last, acceleration);
    }
    let back = first.max(-1.0);
    -back / acceleration * (1.0 - ROUNDING)
        + least_time(length + back * back / (2.0 * acceleration), 0.0, last, acceleration)
}

#[cfg(test)]
mod tests {
    use super::{least_time, least_time_from};

    /// Distance under the curve by fine sums.
    fn distance(time: f64, first: f64, last: f64, acceleration: f64) -> f64 {
        let steps = 20_000;
        let step = time / f64::from(steps);
        let speed = |t: f64| (first + acceleration * t).min(last + acceleration * (time - t)).min(1.0);
        (0..steps).map(|k| speed((f64::from(k) + 0.5) * step) * step).sum()
    }

    #[test]
    fn the_least_time_covers_exactly_the_length() {
        for length in [0.01, 0.3, 1.0, 4.0, 30.0] {
            for first in [0.0, 0.2, 0.9, 1.0] {
                for last in [0.0, 0.5, 1.0] {
                    for acceleration in [0.1, 0.235, 2.0] {
                        let time = least_time(length, first, last, acceleration);
                        let covered = distance(time, first, last, acceleration);
                        assert!((covered - length).abs() < 1e-6 * length, "{length} {first} {last} {acceleration}");
                    }
                }
            }
        }
    }

    #[test]
    fn going_the_wrong_way_costs_its_stop_and_its_way_back() {
        // Stop: 1 s over 0.25; back over 0.25 + 0.75 with a peak below the limit: 2 sqrt(1 / 0.5).
        let time = least_time_from(0.75, -0.5, 0.0, 0.5);
        assert!((time - (1.0 + 2.0 * f64::sqrt(2.0))).abs() < 1e-9);
        assert!(least_time(1.0, 0.0, 0.0, 0.0).is_infinite());
    }
}
