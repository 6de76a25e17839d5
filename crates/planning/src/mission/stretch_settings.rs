//! How stretches are planned.

use crate::error::{PlanningError, finite, not_negative, positive};
use crate::global::MotionLimits;
use crate::local::{Criterion, LocalSettings, SpeedLimits, WrenchSet};
use nalgebra::{SMatrix, SVector, Vector3};
use tumble_dynamics::AlignedBox;
use tumble_identification::recursive::{AxisErrors, ErringThruster, THRUSTERS};

/// What arriving means: the state at the end of a stretch, against the end of the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Largest distance, m.
    pub radius_m: f64,
    /// Largest speed, m/s.
    pub speed_m_s: f64,
    /// Largest angle, rad.
    pub angle_rad: f64,
    /// Largest rate, rad/s.
    pub rate_rad_s: f64,
}

/// How much of what stretches may do their way may ask for.
///
/// What is left is for excitation, for what the belief gets wrong, and for coming back to the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WayShares {
    /// Of the force. Range: 0 to 1, default 0.4: along all three axes at once it stays below seven tenths of the limit in
    /// every attitude.
    pub force: f64,
    /// Of the torque. Range: 0 to 1, default 0.2: turning a body about an origin far from its centre of mass takes force as
    /// well, and the way has little of it.
    pub torque: f64,
    /// Of the speed along an axis. Range: 0 to 1, default 0.7.
    pub speed: f64,
    /// Of the rate. Range: 0 to 1, default 0.33.
    pub rate: f64,
}

impl Default for WayShares {
    fn default() -> Self {
        Self { force: 0.4, torque: 0.2, speed: 0.7, rate: 0.33 }
    }
}

/// How stretches are planned, whatever the number of axes.
///
/// Of four numbers the first is for position, the second for velocity, the third for attitude, the fourth for rate.
#[derive(Clone, Debug, PartialEq)]
pub struct StretchSettings {
    /// Steps of a stretch.
    pub steps: usize,
    /// Length of a step, s.
    pub step_s: f64,
    /// Weights of the squared distance from the way, per SI unit squared.
    pub tracking: [f64; 4],
    /// The same at the end of a stretch.
    pub terminal: [f64; 4],
    /// Weights of squared torque and force, per SI unit squared.
    pub effort: [f64; 2],
    /// How fast it may go.
    pub speed: SpeedLimits,
    /// Standard deviations of what is measured, of one of [`StretchSettings::samples_per_step`] samples.
    pub measurement_sigma: [f64; 4],
    /// Independent samples per step.
    pub samples_per_step: f64,
    /// Variance that comes to each of them in a second from what neither the body nor the inputs do: forces that nobody knows of, a
    /// localisation that wanders. Zero where errors are white and thrust is exact.
    pub wander_per_s: [f64; 4],
    /// What makes the wrench, and how well it is known: what errs with it no motion teaches.
    pub thrusters: [ErringThruster; THRUSTERS],
    /// Errors of the gyroscope's axes: what they make of an inertia no motion teaches either.
    pub rate_axes: AxisErrors,
    /// What is to be small of the covariance.
    pub criterion: Criterion,
    /// Distance kept from obstacles, m.
    pub margin_m: f64,
    /// Length over which distances to obstacles are measured, m.
    pub length_scale_m: f64,
    /// Residual of the optimality conditions at which the search ends.
    pub tolerance: f64,
    /// Most iterations of a search.
    pub iterations: usize,
    /// What arriving means.
    pub arrival: Arrival,
    /// What the way may ask for.
    pub way: WayShares,
}

impl Default for StretchSettings {
    /// Twelve seconds in forty steps, in SI units, for a body of some kilograms and some tenths of a newton.
    ///
    /// * The weights on the way let a body leave its attitude by some tenths of a radian to excite itself, its position by
    ///   millimetres; those at the end bring it back to the way within a millimetre and a millimetre per second, so that the next
    ///   stretch begins as if nothing had been.
    /// * The limit of rate is what lets obstacles be kept off on whole segments: the error of the interpolation between nodes
    ///   grows with its fourth power, and without a limit the torque could raise it until nothing is left of a narrow passage.
    /// * A residual of 1e-3 costs a hundredth of a percent; what is found after sixty iterations, whose cost is that to a percent,
    ///   is flown.
    fn default() -> Self {
        Self {
            steps: 40,
            step_s: 0.3,
            tracking: [10.0, 5.0, 1.0, 1.0],
            terminal: [1000.0, 10_000.0, 100.0, 1000.0],
            effort: [1.0, 1.0],
            speed: SpeedLimits { speed_m_s: Vector3::repeat(0.1), rate_rad_s: Vector3::repeat(0.3) },
            measurement_sigma: [0.01, 0.005, 0.01, 0.005],
            samples_per_step: 1.0,
            wander_per_s: [0.0; 4],
            thrusters: [ErringThruster::NONE; THRUSTERS],
            rate_axes: AxisErrors::NONE,
            criterion: Criterion::A,
            margin_m: 0.04,
            length_scale_m: 0.15,
            tolerance: 1e-3,
            iterations: 60,
            arrival: Arrival { radius_m: 0.01, speed_m_s: 0.002, angle_rad: 0.02, rate_rad_s: 0.005 },
            way: WayShares::default(),
        }
    }
}

impl StretchSettings {
    /// For a robot that sees where it is and not how fast it is, every `period_s`; everything else is usual.
    pub fn of_poses(attitude_rad: f64, position_m: f64, period_s: f64) -> Self {
        let usual = Self::default();
        Self {
            measurement_sigma: [position_m, f64::INFINITY, attitude_rad, f64::INFINITY],
            samples_per_step: usual.step_s / period_s,
            ..usual
        }
    }

    /// Length of a stretch, s.
    pub fn horizon_s(&self) -> f64 {
        self.step_s * self.steps as f64
    }

    /// What a way should keep within, for a body that stretches push by so much along and about each body axis; what is zero
    /// stays zero.
    pub fn way_limits(&self, position: AlignedBox, force_n: Vector3<f64>, torque_n_m: Vector3<f64>) -> MotionLimits {
        let WayShares { force, torque, speed, rate } = self.way;
        let SpeedLimits { speed_m_s, rate_rad_s } = self.speed;
        let moved = force_n.map(|limit| f64::from(u8::from(limit > 0.0)));
        MotionLimits {
            position,
            speed_m_s: speed_m_s.component_mul(&moved) * speed,
            force_n: force_n * force,
            torque_n_m: torque_n_m * torque,
            rate_rad_s: rate_rad_s.min() * rate,
        }
    }

    /// For a model whose state changes in positions, velocities, attitudes and rates as `groups` says, and whose inputs are
    /// torques where `is_torque` says so, forces elsewhere.
    ///
    /// # Errors
    /// Standard deviations that are not positive; the rest is checked by the planner.
    pub fn local<const X: usize, const U: usize>(
        &self,
        groups: &[usize; X],
        is_torque: &[bool; U],
        wrench: WrenchSet<U>,
    ) -> Result<LocalSettings<X, U>, PlanningError> {
        let of = |values: &[f64; 4]| groups.map(|group| values.get(group).copied().unwrap_or_default());
        for sigma in self.measurement_sigma.into_iter().filter(|sigma| *sigma != f64::INFINITY) {
            positive("a standard deviation of a measurement", sigma)?;
        }
        finite("the samples of a step", self.samples_per_step)?;
        for wander in self.wander_per_s {
            not_negative("the wander of a measurement", wander)?;
        }
        for thruster in &self.thrusters {
            thruster.check()?;
        }
        not_negative("the scale of a gyroscope's axes", self.rate_axes.scale)?;
        not_negative("the misalignment of a gyroscope's axes", self.rate_axes.misalignment)?;
        let seen: [Seen; 4] = core::array::from_fn(|group| {
            let sigma = self.measurement_sigma[group];
            Seen::steadily(sigma * sigma / self.samples_per_step, self.wander_per_s[group] * self.step_s)
        });
        let [torque, force] = self.effort;
        Ok(LocalSettings {
            steps: self.steps,
            step_s: self.step_s,
            tracking: of(&self.tracking),
            terminal: of(&self.terminal),
            effort: is_torque.map(|is_torque| if is_torque { torque } else { force }),
            acceleration: [0.0; 2],
            wrench,
            speed: self.speed,
            measurement: SMatrix::from_diagonal(&SVector::from(of(&seen.map(|seen| seen.information)))),
            retained: of(&seen.map(|seen| seen.retained)),
            criterion: self.criterion,
            margin_m: self.margin_m,
            length_scale_m: self.length_scale_m,
            on_segments: true,
            tolerance: self.tolerance,
            iterations: self.iterations,
        })
    }
}

/// What a steady Kalman filter of one coordinate makes of the measurement of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    /// Inverse variance of its innovations.
    information: f64,
    /// Share of a deviation that its update leaves.
    retained: f64,
}

impl Seen {
    /// Of a coordinate that is measured with this variance at each node and wanders by that one between them.
    fn steadily(white: f64, wander: f64) -> Self {
        if white == f64::INFINITY {
            return Self { information: 0.0, retained: 1.0 };
        }
        // p before an update: p = p w / (p + w) + q
        let before = 0.5 * (wander + f64::sqrt(wander * (wander + 4.0 * white)));
        let innovation = before + white;
        Self { information: 1.0 / innovation, retained: white / innovation }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "a share of one is exact")]
mod tests {
    use super::*;

    #[test]
    fn innovations_of_a_steady_filter() {
        assert_eq!(Seen::steadily(4.0, 0.0), Seen { information: 0.25, retained: 1.0 }, "nothing wanders");
        assert_eq!(Seen::steadily(f64::INFINITY, 1.0), Seen { information: 0.0, retained: 1.0 }, "nothing is measured");
        // against the recursion itself
        let (white, wander) = (0.3, 0.05);
        let (mut variance, mut gain) = (1.0, 0.0);
        for _ in 0..200 {
            let before: f64 = variance + wander;
            gain = before / (before + white);
            variance = (1.0 - gain) * before;
        }
        let seen = Seen::steadily(white, wander);
        assert!((seen.retained - (1.0 - gain)).abs() < 1e-12, "{seen:?}");
        assert!((1.0 / seen.information - (variance + wander + white)).abs() < 1e-12, "{seen:?}");
    }

    #[test]
    fn wander_costs_information_and_what_cannot_be_is_refused() {
        let wrench = || WrenchSet { limit: [1.0; 2], half_spaces: Vec::new() };
        let local = |settings: &StretchSettings| settings.local::<4, 2>(&[0, 1, 2, 3], &[false, true], wrench());
        let white = local(&StretchSettings::default()).unwrap();
        assert_eq!(white.retained, [1.0; 4]);
        let wanders = StretchSettings { wander_per_s: [1e-4, 0.0, 0.0, 0.0], ..StretchSettings::default() };
        let found = local(&wanders).unwrap();
        assert!(found.retained[0] < 1.0 && found.measurement[(0, 0)] < white.measurement[(0, 0)], "{found:?}");
        assert_eq!(found.retained[1..], [1.0; 3]);
        let bad = StretchSettings { wander_per_s: [-1.0, 0.0, 0.0, 0.0], ..StretchSettings::default() };
        assert!(local(&bad).is_err());
        let thrusters = ErringThruster::along_axes(-0.01);
        assert!(local(&StretchSettings { thrusters, ..StretchSettings::default() }).is_err());
    }
}
