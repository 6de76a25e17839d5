//! The log of a simulated flight with sensors.

use super::{push_numbers, push_pose, push_wrench};
use std::collections::VecDeque;
use std::fmt::Write as _;
use tumble_astrobee::sensing::{LocalizationEstimate, TrueMotion};
use tumble_astrobee::simulator::{CONTROL_PERIOD_NS, SimulatorMeasurement, extrapolated};
use tumble_dynamics::nalgebra::Vector3;
use tumble_lie::Wrench;

/// The columns of a simulated flight with sensors, measured ones first.
const RECORDER_HEADER: &str = "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,v_x,v_y,v_z,w_x,w_y,w_z,a_x,a_y,a_z,\
f_x,f_y,f_z,tau_x,tau_y,tau_z,\
true_p_x,true_p_y,true_p_z,true_q_x,true_q_y,true_q_z,true_q_w,\
true_v_x,true_v_y,true_v_z,true_w_x,true_w_y,true_w_z,true_a_x,true_a_y,true_a_z,\
true_f_x,true_f_y,true_f_z,true_tau_x,true_tau_y,true_tau_z,\
cmd_f_x,cmd_f_y,cmd_f_z,cmd_tau_x,cmd_tau_y,cmd_tau_z";
/// What comes after them where nozzles make the wrench: the thrust of each as the robot knows it, a share of the largest.
pub const NOZZLE_COLUMNS: [&str; 12] = [
    "cmd_nozzle_1",
    "cmd_nozzle_2",
    "cmd_nozzle_3",
    "cmd_nozzle_4",
    "cmd_nozzle_5",
    "cmd_nozzle_6",
    "cmd_nozzle_7",
    "cmd_nozzle_8",
    "cmd_nozzle_9",
    "cmd_nozzle_10",
    "cmd_nozzle_11",
    "cmd_nozzle_12",
];
/// What comes after them where wheels turn.
const STORED_HEADER: &str = ",stored_x,stored_y,stored_z";
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

/// Columns that not every flight has; without them, what they would hold is passed over.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MoreColumns {
    /// [`NOZZLE_COLUMNS`]: the thrust of each nozzle at a command of one, N.
    pub nozzles: Option<[f64; 12]>,
    /// The momentum of wheels.
    pub stored: bool,
    /// The estimate of the body, zero until told.
    pub estimate: bool,
    /// Revisions of plan and belief, zero until told.
    pub revisions: bool,
}

/// What is remembered of a control period.
#[derive(Clone, Copy)]
struct Period {
    start: TrueMotion,
    believed_wrench_body: Wrench<f64>,
    realized_wrench_body: Wrench<f64>,
    wanted_wrench_body: Wrench<f64>,
    /// As it begins and as it ends.
    stored_momentum_body: [Vector3<f64>; 2],
    /// Of what was believed and realised before, from the start of the flight.
    impulses: [Wrench<f64>; 2],
    believed_thrusts_n: [f64; 12],
    /// Of each nozzle before, as of the wrenches.
    nozzle_impulses_n_s: [f64; 12],
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

    /// Momentum of the wheels at a time in the period.
    fn stored_at(&self, time_ns: i64) -> Vector3<f64> {
        let [before, after] = self.stored_momentum_body;
        before.lerp(&after, (time_ns - self.start.time_ns) as f64 / CONTROL_PERIOD_NS as f64)
    }

    /// Impulses of the nozzles up to a time in the period, N s.
    fn nozzle_impulses_at(&self, time_ns: i64) -> [f64; 12] {
        let since_s = (time_ns - self.start.time_ns) as f64 * 1e-9;
        let mut impulses = self.nozzle_impulses_n_s;
        for (impulse, thrust_n) in impulses.iter_mut().zip(self.believed_thrusts_n) {
            *impulse += thrust_n * since_s;
        }
        impulses
    }
}

/// Writes the log of a simulated flight: a row for each estimate, in order of their stamps.
///
/// Believed and realised wrenches and thrusts of nozzles are means until the next row, so that a row's impulse is what acted up to it, whatever is
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
    /// Of a nozzle at a command of one, N.
    largest_thrusts_n: Option<[f64; 12]>,
    has_stored: bool,
    revisions: Option<[u64; 2]>,
    estimate: Option<EstimateColumns>,
}

impl<W: std::io::Write> Recorder<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// What the operating system said.
    pub fn new(out: W) -> std::io::Result<Self> {
        Self::with(out, MoreColumns::default())
    }

    /// Writes the header, with more columns.
    ///
    /// # Errors
    /// What the operating system said.
    pub fn with(mut out: W, more: MoreColumns) -> std::io::Result<Self> {
        out.write_all(RECORDER_HEADER.as_bytes())?;
        for column in NOZZLE_COLUMNS.iter().filter(|_| more.nozzles.is_some()) {
            write!(out, ",{column}")?;
        }
        let stored = if more.stored { STORED_HEADER } else { "" };
        let estimated = if more.estimate { ESTIMATE_HEADER } else { "" };
        let revised = if more.revisions { REVISIONS_HEADER } else { "" };
        writeln!(out, "{stored}{estimated}{revised}")?;
        Ok(Self {
            largest_thrusts_n: more.nozzles,
            has_stored: more.stored,
            revisions: more.revisions.then_some([0; 2]),
            estimate: more.estimate.then_some([[0.0; 10]; 2]),
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
        let nozzle_impulses_n_s =
            self.periods.back().map_or([0.0; 12], |last| last.nozzle_impulses_at(period.start.time_ns));
        if self.periods.len() == REMEMBERED {
            self.periods.pop_front();
        }
        self.periods.push_back(Period {
            impulses,
            start: period.start,
            believed_wrench_body: period.believed_wrench_body,
            realized_wrench_body: period.realized_wrench_body,
            wanted_wrench_body: period.wanted_wrench_body,
            stored_momentum_body: period.stored_momentum_body,
            believed_thrusts_n: period.believed_thrusts_n,
            nozzle_impulses_n_s,
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
            let wrenches = [period.believed_wrench_body, period.realized_wrench_body];
            self.write_row(&estimate, &period, wrenches, period.believed_thrusts_n)?;
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
                        let mut thrusts_n = period.nozzle_impulses_at(estimate.stamp_ns);
                        for (thrust_n, before) in thrusts_n.iter_mut().zip(of.nozzle_impulses_at(ended.stamp_ns)) {
                            *thrust_n = (*thrust_n - before) * rate_hz;
                        }
                        self.write_row(&ended, &of, [believed, realized], thrusts_n)?;
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
        mut thrusts_n: [f64; 12],
    ) -> std::io::Result<()> {
        self.rows += 1;
        self.row.clear();
        push_row(&mut self.row, estimate, period, wrenches);
        if let Some(largest_n) = self.largest_thrusts_n {
            for (thrust_n, largest_n) in thrusts_n.iter_mut().zip(largest_n) {
                // what is shut may come out below zero by rounding
                *thrust_n = (*thrust_n / largest_n).clamp(0.0, 1.0);
            }
            push_numbers(&mut self.row, &thrusts_n);
        }
        if self.has_stored {
            push_numbers(&mut self.row, &period.stored_at(estimate.stamp_ns));
        }
        push_told(&mut self.row, period);
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
}

/// Ends a row with what the layers told.
fn push_told(row: &mut String, period: &Period) {
    for numbers in period.estimate.iter().flatten() {
        push_numbers(row, numbers);
    }
    if let Some([plan, belief]) = period.revisions {
        let _ = write!(row, ",{plan},{belief}");
    }
    row.push('\n');
}
