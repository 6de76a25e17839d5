//! The log of a simulated flight with sensors.

use super::{push_numbers, push_pose, push_wrench};
use std::collections::VecDeque;
use std::fmt::Write as _;
use tumble_astrobee::sensing::{LocalizationEstimate, TrueMotion};
use tumble_astrobee::simulator::{CONTROL_PERIOD_NS, SimulatorMeasurement, extrapolated};
use tumble_lie::Wrench;

/// The columns of a simulated flight with sensors, measured ones first.
const RECORDER_HEADER: &str = "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,v_x,v_y,v_z,w_x,w_y,w_z,a_x,a_y,a_z,\
f_x,f_y,f_z,tau_x,tau_y,tau_z,\
true_p_x,true_p_y,true_p_z,true_q_x,true_q_y,true_q_z,true_q_w,\
true_v_x,true_v_y,true_v_z,true_w_x,true_w_y,true_w_z,true_a_x,true_a_y,true_a_z,\
true_f_x,true_f_y,true_f_z,true_tau_x,true_tau_y,true_tau_z,\
cmd_f_x,cmd_f_y,cmd_f_z,cmd_tau_x,cmd_tau_y,cmd_tau_z";
/// What comes after them where beliefs change.
const REVISIONS_HEADER: &str = ",plan_revision,belief_revision";
/// What comes between where the robot estimates its body: mass, centre of mass, inertia about it.
const ESTIMATE_HEADER: &str = ",est_m,est_c_x,est_c_y,est_c_z,est_J_xx,est_J_yy,est_J_zz,est_J_xy,est_J_xz,est_J_yz,\
sigma_m,sigma_c_x,sigma_c_y,sigma_c_z,sigma_J_xx,sigma_J_yy,sigma_J_zz,sigma_J_xy,sigma_J_xz,sigma_J_yz";

/// The body as the robot estimates it, and one standard deviation of each number.
pub type EstimateColumns = [[f64; 10]; 2];

/// No estimate arrives later than this after its stamp (latency and jitter have limits), ns.
const LATEST_ARRIVAL_NS: i64 = 3_200_000_000;
/// Control periods that are remembered for estimates that are still on their way: more than [`LATEST_ARRIVAL_NS`].
const REMEMBERED: usize = 256;

/// What is remembered of a control period.
#[derive(Clone, Copy)]
struct Period {
    start: TrueMotion,
    believed_wrench_body: Wrench<f64>,
    realized_wrench_body: Wrench<f64>,
    wanted_wrench_body: Wrench<f64>,
    /// Of what was believed and realised before, from the start of the flight.
    impulses: [Wrench<f64>; 2],
    revisions: Option<[u64; 2]>,
    estimate: Option<EstimateColumns>,
}

impl Period {
    /// Impulses up to a time in the period.
    fn impulses_at(&self, time_ns: i64) -> [Wrench<f64>; 2] {
        let since_s = (time_ns - self.start.time_ns) as f64 * 1e-9;
        let [believed, realized] = self.impulses;
        [believed + self.believed_wrench_body * since_s, realized + self.realized_wrench_body * since_s]
    }
}

/// Writes the log of a simulated flight: a row for each estimate, in order of their stamps.
///
/// Believed and realised wrenches are means until the next row, so that a row's impulse is what acted up to it, whatever is
/// lost or stamped late; of the last row, those of its control period, as are the wanted ones. An estimate that repeats a stamp, or whose stamp lies
/// outside the flight, is left out and counted.
pub struct Recorder<W: std::io::Write> {
    out: W,
    row: String,
    periods: VecDeque<Period>,
    /// Sorted by stamp.
    waiting: VecDeque<LocalizationEstimate>,
    /// The row that the next one ends.
    open: Option<(LocalizationEstimate, Period)>,
    rows: u64,
    left_out: u64,
    revisions: Option<[u64; 2]>,
    estimate: Option<EstimateColumns>,
}

impl<W: std::io::Write> Recorder<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// What the operating system said.
    pub fn new(out: W) -> std::io::Result<Self> {
        Self::begin(out, None, None)
    }

    /// Writes the header, with a column for the revision of the plan and one for that of the belief; zero until told.
    ///
    /// # Errors
    /// What the operating system said.
    pub fn with_revisions(out: W) -> std::io::Result<Self> {
        Self::begin(out, None, Some([0; 2]))
    }

    /// Writes the header, with columns for the estimate of the body and for both revisions; zero until told.
    ///
    /// # Errors
    /// What the operating system said.
    pub fn with_estimate(out: W) -> std::io::Result<Self> {
        Self::begin(out, Some([[0.0; 10]; 2]), Some([0; 2]))
    }

    fn begin(mut out: W, estimate: Option<EstimateColumns>, revisions: Option<[u64; 2]>) -> std::io::Result<Self> {
        let estimated = if estimate.is_some() { ESTIMATE_HEADER } else { "" };
        let more = if revisions.is_some() { REVISIONS_HEADER } else { "" };
        writeln!(out, "{RECORDER_HEADER}{estimated}{more}")?;
        Ok(Self {
            revisions,
            estimate,
            out,
            row: String::with_capacity(2048),
            periods: VecDeque::with_capacity(REMEMBERED),
            waiting: VecDeque::with_capacity(2 * REMEMBERED),
            open: None,
            rows: 0,
            left_out: 0,
        })
    }

    /// Revisions of plan and belief that the next periods are flown with; without their columns nothing happens.
    pub fn revise(&mut self, plan: u64, belief: u64) {
        self.revisions = self.revisions.map(|_| [plan, belief]);
    }

    /// The estimate of the body in the next periods; without its columns nothing happens.
    pub fn estimated(&mut self, estimate: &EstimateColumns) {
        self.estimate = self.estimate.map(|_| *estimate);
    }

    /// Takes a control period and the estimates that arrived in it.
    ///
    /// # Errors
    /// What the operating system said.
    pub fn record(&mut self, period: &SimulatorMeasurement, arrived: &[LocalizationEstimate]) -> std::io::Result<()> {
        let impulses = self.periods.back().map_or([Wrench::zero(); 2], |last| last.impulses_at(period.start.time_ns));
        if self.periods.len() == REMEMBERED {
            self.periods.pop_front();
        }
        self.periods.push_back(Period {
            impulses,
            start: period.start,
            believed_wrench_body: period.believed_wrench_body,
            realized_wrench_body: period.realized_wrench_body,
            wanted_wrench_body: period.wanted_wrench_body,
            revisions: self.revisions,
            estimate: self.estimate,
        });
        for estimate in arrived {
            let place = self.waiting.partition_point(|waiting| waiting.stamp_ns <= estimate.stamp_ns);
            self.waiting.insert(place, *estimate);
        }
        self.write_until(period.end.time_ns - LATEST_ARRIVAL_NS)
    }

    /// Writes what still waits; the rows written and the estimates left out.
    ///
    /// # Errors
    /// What the operating system said.
    pub fn finish(mut self) -> std::io::Result<(u64, u64)> {
        self.write_until(i64::MAX)?;
        if let Some((estimate, period)) = self.open.take() {
            self.write_row(&estimate, &period, [period.believed_wrench_body, period.realized_wrench_body])?;
        }
        self.out.flush()?;
        Ok((self.rows, self.left_out))
    }

    fn write_until(&mut self, stamp_ns: i64) -> std::io::Result<()> {
        while let Some(estimate) = self.waiting.front().copied().filter(|next| next.stamp_ns <= stamp_ns) {
            self.waiting.pop_front();
            match self.period_of(estimate.stamp_ns) {
                Some(period) if self.open.as_ref().is_none_or(|(last, _)| last.stamp_ns < estimate.stamp_ns) => {
                    if let Some((ended, of)) = self.open.replace((estimate, period)) {
                        let (from, to) = (of.impulses_at(ended.stamp_ns), period.impulses_at(estimate.stamp_ns));
                        let rate_hz = 1e9 / (estimate.stamp_ns - ended.stamp_ns) as f64;
                        let [believed, realized] = [0, 1].map(|i| (to[i] - from[i]) * rate_hz);
                        self.write_row(&ended, &of, [believed, realized])?;
                    }
                }
                _ => self.left_out += 1,
            }
        }
        Ok(())
    }

    fn write_row(
        &mut self,
        estimate: &LocalizationEstimate,
        period: &Period,
        wrenches: [Wrench<f64>; 2],
    ) -> std::io::Result<()> {
        self.rows += 1;
        self.row.clear();
        push_row(&mut self.row, estimate, period, wrenches);
        self.out.write_all(self.row.as_bytes())
    }

    /// The remembered period in which a time lies.
    fn period_of(&self, time_ns: i64) -> Option<Period> {
        let first_ns = self.periods.front()?.start.time_ns;
        let index = usize::try_from((time_ns - first_ns).div_euclid(CONTROL_PERIOD_NS)).ok()?;
        self.periods.get(index).copied()
    }
}

fn push_row(row: &mut String, estimate: &LocalizationEstimate, period: &Period, wrenches: [Wrench<f64>; 2]) {
    let [believed, realized] = wrenches;
    // Writing to a string cannot fail.
    let _ = write!(row, "{}.{:09}", estimate.stamp_ns / 1_000_000_000, estimate.stamp_ns % 1_000_000_000);
    push_pose(row, &estimate.world_from_body);
    push_numbers(row, &estimate.velocity_origin_world);
    push_numbers(row, &estimate.rate_body);
    push_numbers(row, &estimate.acceleration_origin_body);
    push_wrench(row, &believed);
    let truth = extrapolated(&period.start, estimate.stamp_ns - period.start.time_ns);
    push_pose(row, &truth.world_from_body);
    push_numbers(row, &(truth.world_from_body.rotation * truth.twist_body.linear));
    push_numbers(row, &truth.twist_body.angular);
    push_numbers(row, &period.start.acceleration_origin_body);
    push_wrench(row, &realized);
    push_wrench(row, &period.wanted_wrench_body);
    for numbers in period.estimate.iter().flatten() {
        push_numbers(row, numbers);
    }
    if let Some([plan, belief]) = period.revisions {
        let _ = write!(row, ",{plan},{belief}");
    }
    row.push('\n');
}
