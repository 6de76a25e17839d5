//! A designed motion, what it can tell and how it was flown.

use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::DMatrix;
use tumble_identification::excitation::{Execution, Utilization};
use tumble_identification::fourier::FourierMotion;
use tumble_identification::harmonics::CramerRao;

/// Steps of one period in which peaks are found.
const FINE_STEPS: usize = 4000;

/// A design without the number of parameters in its type.
pub(super) struct Designed {
    pub(super) motion: FourierMotion,
    pub(super) cost: f64,
    pub(super) cost_per_start: Vec<Option<f64>>,
    pub(super) utilization: Vec<Utilization>,
    pub(super) duration_s: f64,
}

/// What the motion can tell, flown exactly and with the harmonics left free that tracking may add.
pub(super) struct Bounds {
    pub(super) exact: CramerRao,
    pub(super) free: CramerRao,
    pub(super) free_harmonics: usize,
}

/// A simulated flight.
pub(super) struct Flight {
    pub(super) truth: InertialParameters<f64>,
    pub(super) payload_kg: f64,
    pub(super) execution: Execution,
    /// Root mean square of the distance from the motion, m, and of the angle, rad.
    pub(super) tracking_rms: (f64, f64),
}

/// One period in fine steps, its end included: what peaks are found in and pictures drawn from.
pub(super) struct FinePeriod {
    pub(super) times_s: Vec<f64>,
    /// Values, rates and accelerations of the six channels.
    pub(super) channels: [DMatrix<f64>; 3],
    /// `[torque; force]` that the body without payload needs.
    pub(super) wrenches: DMatrix<f64>,
}

impl FinePeriod {
    pub(super) fn of(motion: &FourierMotion, body: &InertialParameters<f64>) -> Self {
        let times_s: Vec<f64> =
            (0..=FINE_STEPS).map(|i| motion.basis().period_s() * i as f64 / FINE_STEPS as f64).collect();
        let channels = motion.basis().table(&times_s).map(|functions| functions * motion.coefficients());
        let parameters = body.to_vector();
        let mut wrenches = DMatrix::zeros(times_s.len(), 6);
        for (row, instant) in times_s.iter().map(|&time_s| motion.at(time_s)).enumerate() {
            if let Some(instant) = instant {
                wrenches.row_mut(row).copy_from(&(instant.regressor() * parameters).transpose());
            }
        }
        Self { times_s, channels, wrenches }
    }

    pub(super) fn largest_torque(&self) -> f64 {
        self.wrenches.columns(0, 3).amax()
    }

    pub(super) fn largest_force(&self) -> f64 {
        self.wrenches.columns(3, 3).amax()
    }
}
