//! When a fault acts.

use tumble_identification::noise::Gaussian;

/// Earliest and latest time at which something begins to go wrong, s.
const BEGIN_S: [f64; 2] = [10.0, 15.0];
/// Largest part of a flight before that.
const LATEST_BEGIN: f64 = 0.25;
/// Part of a flight after which nothing is wrong any more, but for what stays.
const LATEST_END: f64 = 0.6;

/// From one time to another, mission time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub from_ns: i64,
    /// Not part of it.
    pub until_ns: i64,
}

/// Saturates; what is no number is zero.
#[allow(clippy::cast_possible_truncation)] // saturation is meant
pub(super) fn nanoseconds(seconds: f64) -> i64 {
    libm::round(seconds * 1e9) as i64
}

impl Window {
    /// Begins at a random time between 10 and 15 s, earlier in flights of less than a minute, and lasts `length_s`, or until 60 % of
    /// the flight.
    pub fn draw(random: &mut Gaussian, duration_s: f64, length_s: f64) -> Self {
        let duration_s = duration_s.max(0.0);
        let [earliest_s, latest_s] = BEGIN_S;
        let latest_s = latest_s.min(LATEST_BEGIN * duration_s);
        let earliest_s = earliest_s.min(latest_s * earliest_s / BEGIN_S[1]);
        let begin_s = earliest_s + (latest_s - earliest_s) * random.uniform();
        let end_s = (begin_s + length_s).min(LATEST_END * duration_s);
        Self { from_ns: nanoseconds(begin_s), until_ns: nanoseconds(end_s) }
    }

    /// The same, and never over.
    pub fn for_good(random: &mut Gaussian, duration_s: f64) -> Self {
        Self { until_ns: i64::MAX, ..Self::draw(random, duration_s, 0.0) }
    }

    /// A part that begins at a random time, as long as wanted if there is room.
    pub fn part(self, random: &mut Gaussian, length_s: f64) -> Self {
        let length_ns = nanoseconds(length_s).clamp(0, (self.until_ns - self.from_ns).max(0));
        let room_ns = (self.until_ns - self.from_ns - length_ns).max(0);
        let from_ns = self.from_ns + nanoseconds(room_ns as f64 * 1e-9 * random.uniform());
        Self { from_ns, until_ns: from_ns + length_ns }
    }

    /// The first so many seconds of it.
    pub fn first_s(self, length_s: f64) -> Self {
        Self { until_ns: self.until_ns.min(self.from_ns.saturating_add(nanoseconds(length_s))), ..self }
    }

    pub fn contains(&self, time_ns: i64) -> bool {
        self.from_ns <= time_ns && time_ns < self.until_ns
    }

    /// Time since it began, s.
    pub fn since_s(&self, time_ns: i64) -> f64 {
        time_ns.saturating_sub(self.from_ns) as f64 * 1e-9
    }

    pub fn begin_s(&self) -> f64 {
        self.from_ns as f64 * 1e-9
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_lie_between_the_start_and_sixty_percent() {
        for seed in 0..200 {
            let mut random = Gaussian::from_seed(seed);
            for (duration_s, earliest_s, latest_s) in [(170.0, 10.0, 15.0), (60.0, 10.0, 15.0), (30.0, 5.0, 7.5)] {
                let window = Window::draw(&mut random, duration_s, 10.0);
                assert!(window.begin_s() >= earliest_s && window.begin_s() <= latest_s, "{window:?}");
                let length_s = window.since_s(window.until_ns);
                assert!(length_s <= 10.0 + 1e-8 && window.until_ns as f64 * 1e-9 <= 0.6 * duration_s + 1e-8);
                assert!(duration_s < 50.0 || (length_s - 10.0).abs() < 1e-8);
                let part = window.part(&mut random, 2.0);
                assert!(part.from_ns >= window.from_ns && part.until_ns <= window.until_ns);
                assert!((part.since_s(part.until_ns) - 2.0).abs() < 1e-8);
                assert!(window.contains(window.from_ns) && !window.contains(window.until_ns));
            }
            let stays = Window::for_good(&mut random, 100.0);
            assert!(stays.begin_s() >= 10.0 && stays.contains(i64::MAX - 1));
        }
        for duration_s in [0.0, -1.0, f64::NAN] {
            let none = Window::draw(&mut Gaussian::from_seed(1), duration_s, 5.0);
            assert!(none.until_ns <= none.from_ns, "{none:?}");
        }
    }
}
