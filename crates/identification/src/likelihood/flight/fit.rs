//! The iterations: sweep, eliminate, step, levels.

mod assemble;
mod coarse;
mod evidence;
mod judge_levels;
mod start;

use super::super::coordinates::Coordinates;
use super::super::flow::State;
use super::eliminate::{Chain, Form, Shape, Wandering};
use super::grid::{ATTITUDE, Grid, RATE, Row, STREAMS, whole};
use super::layout::{
    ACTING, BODY, CENTER, DELAYS, INERTIA, LOG_MASS, Layout, MOTION, NOISES, ROWS, SLOW, STATES, WRENCH,
};
use super::levels::{FoundLevels, jumps, white};
use super::sweep::{Sweep, Swept};
use super::thrusters::{Term, with_gains};
use super::unit::Unit;
use super::{FlightLikelihood, nodes};
use crate::error::{Column, IdentificationError};
use crate::sensing::InertialErrors;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Fewest segments that anything is made of.
pub(super) const FEWEST_SEGMENTS: usize = 16;
/// Sweeps after which a fit that still moves is given up.
const SWEEPS: usize = 40;
/// Sweeps after which half a step is taken: what still swings to and fro then comes to rest.
const FULL_STEPS: usize = 20;
/// Sweeps for a motion under a body that is told.
const HELD_SWEEPS: usize = 6;
/// Squared length of the last step in standard deviations: at first, and after [`FULL_STEPS`].
const SMALL_DECREMENT: [f64; 2] = [1e-3, 3e-2];
/// The same for a record that leaves something free.
const DRIFT: f64 = 10.0;
/// Sweep from which levels are judged: too narrow ones keep a fit from coming near.
const FIRST_ROUND: usize = 2;
/// Within so many squared standard deviations of rest outliers are told from misfit.
const NEAR: f64 = 1e4;
/// Rounds of levels: at least, and at most while they still change by more than a factor.
const ROUNDS: (usize, usize) = (3, 16);
const SETTLED: f64 = 1.1;
/// Those of the wrench while the last change moved the parameters by more than this, in squared standard deviations: where the record shows little
/// of it its level creeps on for long.
const STILL: f64 = 1e-3;
/// Bounds of the change of the square of a level of the wrench in a round.
const WRENCH_CHANGE: (f64, f64) = (0.1, 10.0);
/// Start and floor of the error of the wrench, by its root mean square: torque, force.
const WRENCH_START: [f64; 2] = [5e-4, 3e-4];
const WRENCH_FLOOR: [f64; 2] = [5e-5, 3e-5];
/// Where nothing is said of wander the search begins here: metres, radians, metres per second; seconds.
const WANDER_START: [f64; 3] = [0.02, 0.01, 2e-3];
const WANDER_TIME_S: f64 = 10.0;
/// Where nothing is said of the noise of the inertial unit the search begins at this share of what it shows.
const WIDE_START: f64 = 0.1;
/// Largest change of a delay in one sweep, s: one of which the record tells little swings farther than what is linear reaches.
const LARGEST_DELAY_STEP_S: f64 = 0.03;
/// Distances, in segments, over which what a filter that nobody describes leaves alike is counted, and how much of it at most.
const COLOURS: usize = 8;
const LARGEST_COLOUR: f64 = 16.0;
/// Time over which lasting errors of the wrench change, s, and their start as a share of its root mean square.
const LASTING_S: f64 = 4.0;
const LASTING_START: f64 = 1e-4;
/// They are believed where without them minus twice the logarithm of the likelihood is more by this.
const LASTING_SHOWN: f64 = 9.0;
/// Gates in standard deviations: of inertial rows, of drives of the wander.
const GATE: f64 = 4.5;
const WANDER_GATE: f64 = 5.0;
/// Medians of chi squared of one, two, three degrees of freedom.
const MEDIAN_CHI_SQUARE: [f64; 3] = [0.455, 1.386, 2.366];
/// White noise is not believed below this share of what its stream spans.
const SMALLEST_WHITE: f64 = 1e-7;
/// Precision of a first state of which nothing is known, and of one that the plane holds.
const UNKNOWN: f64 = 1e-10;
const HELD: f64 = 1e18;
/// Standard deviations of the damping: ln m, centre of mass in radii of gyration, inertia in its mean.
const DAMPING: [f64; 3] = [3.0, 1.0, 1.0];
/// A delay beyond so many steps moves its stream by whole rows.
const SHIFT: f64 = 0.6;
/// Sweeps in which streams may be moved.
const LAST_SHIFT: usize = 16;
/// What gravity a publisher may have added where nobody says, m/s^2.
const GRAVITY_SIGMA: f64 = 10.0;
/// Slope of a table: acceleration along it, m/s^2.
const SLOPE_SIGMA: f64 = 0.02;

/// A record in work.
pub(super) struct Fit<'a> {
    pub(super) of: &'a FlightLikelihood,
    pub(super) grid: Grid,
    pub(super) layout: Layout,
    pub(super) planar: bool,
    pub(super) samples: usize,
    pub(super) segments: usize,
    pub(super) eta: Vec<f64>,
    /// Columns of the free parameters, and their priors.
    pub(super) free: Vec<usize>,
    pub(super) prior: Vec<f64>,
    pub(super) mean: Vec<f64>,
    pub(super) levels: FoundLevels,
    raw: [Option<f64>; STREAMS],
    /// What white noise is never below.
    smallest: [f64; STREAMS],
    /// What white noise of the inertial unit is never above: all that it shows, however it is coloured.
    largest: [f64; STREAMS],
    /// Rows between two of a stream.
    spacing: [f64; STREAMS],
    floors: [f64; 2],
    pub(super) axes: [Vec<usize>; STREAMS],
    terms: Vec<Term>,
    /// Amounts of a row.
    width: usize,
    shift: [isize; DELAYS],
    rows: Vec<Row>,
    valid: Vec<[bool; STREAMS]>,
    jumped: Vec<bool>,
    counts: Vec<[f64; STREAMS]>,
    unit: Unit,
    sweep: Sweep,
    nodes: Vec<State>,
    errors: Vec<[f64; WRENCH]>,
    /// Lasting errors of the wrench after the last step, in units of one sigma.
    lasting: Vec<[f64; WRENCH]>,
    ratio: [f64; 2],
    pub(super) chain: Chain,
    /// Quadratic form of the first state, the parameters and one.
    form: Form,
    pub(super) information: DMatrix<f64>,
    pub(super) gradient: DVector<f64>,
    pub(super) sweeps: usize,
    pub(super) decrement: f64,
    /// The parameters had not come to rest.
    pub(super) drifts: bool,
    /// Residuals after the last step, states and noises taken out, in units of one sigma where they weigh.
    pub(super) left: Vec<[f64; ROWS]>,
    /// Degrees of freedom that the fit took of the rows, by stream, as last counted.
    pub(super) taken: [f64; STREAMS],
}

/// What a matrix that should be positive definite leaves of a right-hand side.
pub(super) fn solved(matrix: &DMatrix<f64>, right: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale: Vec<f64> = matrix.diagonal().iter().map(|d| 1.0 / d.abs().max(f64::MIN_POSITIVE).sqrt()).collect();
    let mut scaled = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        0.5 * (matrix[(i, j)] + matrix[(j, i)]) * scale[i] * scale[j]
    });
    let with = DMatrix::from_fn(right.nrows(), right.ncols(), |i, j| right[(i, j)] * scale[i]);
    let mut lift = 0.0_f64;
    while lift < 1e-3 {
        if let Some(factor) = scaled.clone().cholesky() {
            let x = factor.solve(&with);
            if x.iter().all(|x| x.is_finite()) {
                return Some(DMatrix::from_fn(x.nrows(), x.ncols(), |i, j| x[(i, j)] * scale[i]));
            }
        }
        let more = if lift == 0.0 { 1e-14 } else { 9.0 * lift };
        for i in 0..scaled.nrows() {
            scaled[(i, i)] += more;
        }
        lift += more;
    }
    None
}

/// Information of the parameters and what it says of a step, the first state eliminated from a form.
pub(super) fn without_state(form: &Form, shape: Shape) -> Option<(DMatrix<f64>, DVector<f64>, DMatrix<f64>)> {
    let (ny, p) = (shape.eliminated(), shape.parameters);
    let at = |i: usize, j: usize| form[i * ny + j];
    let states = DMatrix::from_fn(STATES, STATES, at);
    let cross = DMatrix::from_fn(STATES, p + 1, |i, j| at(i, STATES + j));
    let gone = solved(&states, &cross)?;
    let information = DMatrix::from_fn(p, p, |i, j| at(STATES + i, STATES + j))
        - cross.columns(0, p).transpose() * gone.columns(0, p);
    let information = (&information + information.transpose()) * 0.5;
    let gradient =
        DVector::from_fn(p, |i, _| at(STATES + i, STATES + p)) - cross.columns(0, p).transpose() * gone.column(p);
    Some((information, gradient, gone))
}

fn indefinite(parameters: usize) -> IdentificationError {
    IdentificationError::Indefinite { parameters }
}

impl<'a> Fit<'a> {
    pub(super) fn new(of: &'a FlightLikelihood, grid: Grid, planar: bool) -> Result<Self, IdentificationError> {
        let sensing = &of.sensing;
        let thrusters = of.thrusters.as_ref();
        let layout = Layout { thrusters: thrusters.map_or(0, |t| t.sigma.len()) };
        let samples = of.samples(grid.step_s);
        let segments = grid.len() / samples;
        if segments < FEWEST_SEGMENTS {
            return Err(IdentificationError::TooFewSamples { samples: grid.len(), needed: FEWEST_SEGMENTS * samples });
        }
        let axes: [Vec<usize>; STREAMS] = if planar {
            [vec![0, 1], vec![2], vec![0, 1], vec![2], vec![0, 1]]
        } else {
            core::array::from_fn(|_| vec![0, 1, 2])
        };
        let has: [bool; STREAMS] = core::array::from_fn(|stream| grid.valid.iter().any(|valid| valid[stream]));
        if !has[ATTITUDE] && !has[RATE] {
            return Err(IdentificationError::MissingColumn(Column::Attitude));
        }
        let mut grid = grid;
        if planar {
            for (torque, force) in grid.torque.iter_mut().zip(&mut grid.force) {
                (torque.x, torque.y, force.z) = (0.0, 0.0, 0.0);
            }
            // Who turns about one axis turns nothing along it that the table does not hold.
            grid.stored.fill(Vector3::zeros());
        }
        // What a table takes up is no thrust of a thruster either.
        let (mut terms, width) = thrusters.map_or((Vec::new(), 0), |t| (t.terms.clone(), t.width));
        if planar {
            terms = terms.into_iter().map(Term::in_plane).filter(Term::acts).collect();
        }
        let raw = white(&grid.rows, &grid.valid, &axes);
        let spacing = core::array::from_fn(|stream| {
            let seen = grid.valid.iter().filter(|valid| valid[stream]).count().max(1);
            grid.len() as f64 / seen as f64
        });
        let rms = |series: &[Vector3<f64>]| {
            (series.iter().map(Vector3::norm_squared).sum::<f64>() / (3 * series.len().max(1)) as f64).sqrt()
        };
        let (torque, force) = (rms(&grid.torque), rms(&grid.force));
        let drive = [torque.max(1e-3 * force).max(f64::MIN_POSITIVE), force.max(1e-3 * torque).max(f64::MIN_POSITIVE)];
        let floors = [drive[0] * WRENCH_FLOOR[0], drive[1] * WRENCH_FLOOR[1]];
        let jumped = jumps(&grid, &grid.valid);
        let lever = Vector3::from(sensing.lever_arm_body_m);
        let (gyro, accelerometer) = (sensing.rate.filter.as_ref(), sensing.acceleration.filter.as_ref());
        let unit = Unit::new(&grid, layout, (&terms, width), lever, gyro, accelerometer);
        let ratio_of = |errors: &InertialErrors| {
            errors
                .filter
                .as_ref()
                .map_or(1.0, |filter| filter.density_ratio(whole(grid.step_s / filter.step_s()).max(1), samples))
        };
        let ratio = [ratio_of(&sensing.rate), ratio_of(&sensing.acceleration)];
        let count = layout.count();
        let mut fit = Self {
            of,
            layout,
            planar,
            samples,
            segments,
            eta: vec![0.0; count],
            free: Vec::new(),
            prior: Vec::new(),
            mean: vec![0.0; count],
            levels: FoundLevels {
                white: [0.0; STREAMS],
                wander: [(0.0, WANDER_TIME_S); 3],
                wrench: [0.0; 2],
                lasting: [0.0; 2],
            },
            raw,
            smallest: [0.0; STREAMS],
            largest: [f64::INFINITY; STREAMS],
            spacing,
            floors,
            axes,
            terms,
            width,
            shift: [0; DELAYS],
            rows: Vec::new(),
            valid: Vec::new(),
            jumped,
            counts: Vec::new(),
            unit,
            sweep: Sweep::new(grid.len(), segments, layout),
            nodes: Vec::new(),
            errors: vec![[0.0; WRENCH]; segments],
            lasting: vec![[0.0; WRENCH]; segments],
            ratio,
            chain: Chain::new(
                0,
                Shape { parameters: 0, dynamic: 0 },
                &Wandering { decay: [0.0; SLOW], drive: [0.0; SLOW], sigma: [1.0; SLOW] },
                [0.0; MOTION],
            ),
            form: Form::new(),
            information: DMatrix::zeros(0, 0),
            gradient: DVector::zeros(0),
            sweeps: 0,
            decrement: f64::INFINITY,
            drifts: false,
            left: Vec::new(),
            taken: [0.0; STREAMS],
            grid,
        };
        fit.start_levels(drive);
        fit.start_parameters(has);
        fit.nodes = nodes::start(&fit.grid, samples, segments, planar);
        fit.sweep.rates = nodes::rates(&fit.grid, &fit.nodes, samples);
        fit.take_shift();
        Ok(fit)
    }

    /// A record whose streams begin where they answer the wrench best: what a search begins with.
    pub(super) fn aligned(of: &'a FlightLikelihood, grid: Grid, planar: bool) -> Result<Self, IdentificationError> {
        let mut fit = Self::new(of, grid, planar)?;
        fit.align();
        Ok(fit)
    }

    fn set_inertia(&mut self, inertia: &Matrix3<f64>) {
        let entries = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        for (i, entry) in entries.into_iter().enumerate() {
            self.eta[INERTIA + i] = inertia[entry];
        }
    }

    pub(super) fn coordinates(&self) -> Coordinates {
        let e = &self.eta;
        let inertia = Matrix3::new(e[4], e[5], e[6], e[5], e[7], e[8], e[6], e[8], e[9]);
        Coordinates { log_mass: e[LOG_MASS], center: Vector3::new(e[1], e[2], e[3]), inertia }
    }

    /// The measurements as the present whole-row delays have them, and how many each segment holds.
    fn take_shift(&mut self) {
        let (rows, mut valid) = self.grid.shifted(&self.shift);
        // The masks of jumps go with the poses.
        for (k, valid) in valid.iter_mut().enumerate() {
            let from = k.checked_add_signed(self.shift[0]).and_then(|k| self.jumped.get(k));
            if from.copied().unwrap_or(false) {
                *valid = [false; STREAMS];
            }
        }
        self.counts = (0..self.segments)
            .map(|j| {
                let mut counts = [0.0; STREAMS];
                for valid in &valid[j * self.samples..(j + 1) * self.samples] {
                    for (count, valid) in counts.iter_mut().zip(valid) {
                        *count += if *valid { 1.0 } else { 0.0 };
                    }
                }
                counts
            })
            .collect();
        (self.rows, self.valid) = (rows, valid);
    }

    /// Segments left out as outliers, stream by stream: they hold measurements, none of which counts.
    pub(super) fn gated(&self) -> [usize; STREAMS] {
        let holds = |j: usize, stream: usize| {
            self.valid[j * self.samples..(j + 1) * self.samples].iter().any(|valid| valid[stream])
        };
        core::array::from_fn(|stream| {
            (0..self.segments).filter(|&j| self.counts[j][stream] == 0.0 && holds(j, stream)).count()
        })
    }

    /// Velocities are as old as the poses.
    fn shares_delay(&self) -> bool {
        self.of.sensing.velocity_delay.is_none()
    }

    /// Rates as the sensors publish them of the motion that is found, before gain and bias.
    pub(super) fn published_rates(&self) -> &[Vector3<f64>] {
        &self.sweep.published[..self.segments * self.samples]
    }

    pub(super) fn column_of(&self, parameter: usize) -> Option<usize> {
        self.free.iter().position(|column| *column == parameter)
    }

    /// Delay of a stream in all, s.
    pub(super) fn delay_s(&self, stream: usize) -> f64 {
        let stream = if stream == 1 && self.shares_delay() { 0 } else { stream };
        self.shift[stream] as f64 * self.grid.step_s + self.eta[self.layout.delay() + stream]
    }

    pub(super) fn wrench_errors(&self) -> impl Iterator<Item = [f64; WRENCH]> + '_ {
        let root = (self.samples as f64).sqrt();
        self.errors.iter().map(move |error| core::array::from_fn(|i| error[i] * self.levels.wrench[i / 3] / root))
    }

    /// Error of the wrench over each segment, lasting ones included.
    pub(super) fn all_wrench_errors(&self) -> impl Iterator<Item = [f64; WRENCH]> + '_ {
        let both = self.wrench_errors().zip(&self.lasting);
        both.map(|(error, lasting)| core::array::from_fn(|i| error[i] + lasting[i] * self.levels.lasting[i / 3]))
    }

    fn wandering(&self) -> Wandering {
        let segment_s = self.samples as f64 * self.grid.step_s;
        let mut out = Wandering { decay: [0.0; SLOW], drive: [0.0; SLOW], sigma: [0.0; SLOW] };
        let lasting = [(1.0, LASTING_S); 2];
        for (i, (sigma, time_s)) in lasting.into_iter().chain(self.levels.wander).enumerate() {
            let (decay, sigma) = ((-segment_s / time_s).exp(), sigma.max(1e-12));
            for axis in 3 * i..3 * i + 3 {
                out.decay[axis] = decay;
                out.drive[axis] = sigma * (1.0 - decay * decay).sqrt();
                out.sigma[axis] = sigma;
            }
        }
        out
    }

    /// All iterations.
    pub(super) fn run(&mut self) -> Result<(), IdentificationError> {
        let mut rounds = 0;
        let mut settled = self.is_all_known();
        let mut asked = false;
        for sweep in 0..SWEEPS {
            self.sweeps = sweep + 1;
            self.linearise();
            let (states, noises) = self.step()?;
            self.advance(&states, &noises);
            let moved = (1..LAST_SHIFT).contains(&sweep) && self.move_streams();
            if !settled && rounds < ROUNDS.1 && sweep >= FIRST_ROUND {
                rounds += 1;
                let [measured, wrench] = self.take_levels(&states, &noises, self.decrement < NEAR);
                let is_still = measured < SETTLED && (wrench < SETTLED || self.decrement < STILL);
                settled = rounds >= ROUNDS.0 && is_still;
                if (settled || rounds == ROUNDS.1) && !asked {
                    asked = true;
                    if self.forget_lasting() {
                        (settled, rounds) = (false, 0);
                    }
                }
                continue;
            }
            if self.decrement < SMALL_DECREMENT[usize::from(sweep >= FULL_STEPS)] && sweep >= 3 && !moved {
                return Ok(());
            }
        }
        // Where something is not determined it still drifts: within the scatter of ten parameters that is rest.
        self.drifts = true;
        if self.decrement < DRIFT { Ok(()) } else { Err(self.not_converged()) }
    }

    /// A body and values of other parameters that stay as they are, with these levels: the motion alone is fitted.
    pub(super) fn hold(
        &mut self,
        body: &Coordinates,
        values: impl Iterator<Item = (usize, f64)>,
        levels: &FoundLevels,
    ) -> Result<(), IdentificationError> {
        for (column, value) in values.filter(|(column, _)| *column >= BODY) {
            self.eta[column] = value;
            if let Some(stream) = column.checked_sub(self.layout.delay()).filter(|stream| *stream < DELAYS) {
                self.shift[stream] = nearest(value / self.grid.step_s);
                self.eta[column] -= self.shift[stream] as f64 * self.grid.step_s;
            }
        }
        if self.shares_delay() {
            self.shift[1] = self.shift[0];
        }
        self.eta[LOG_MASS] = body.log_mass;
        self.eta[CENTER..INERTIA].copy_from_slice(body.center.as_slice());
        self.set_inertia(&body.inertia);
        self.levels = *levels;
        (self.free, self.prior) = (Vec::new(), Vec::new());
        self.take_shift();
        for _ in 0..HELD_SWEEPS {
            self.linearise();
            let (states, noises) = self.step()?;
            self.advance(&states, &noises);
        }
        self.linearise();
        Ok(())
    }

    /// What the record says at the point where this fit came to rest if the wrench had gains and a constant beside it: the information of all
    /// free parameters with the priors of this fit, none for the gains, its gradient as one more column, and which parameters these are.
    pub(super) fn with_gains(&self) -> Result<(DMatrix<f64>, Vec<usize>), IdentificationError> {
        let told = self.of.thrusters.as_ref();
        let of = FlightLikelihood { thrusters: Some(with_gains(told)), ..self.of.clone() };
        let more = |k: usize| self.grid.torque[k].iter().chain(&self.grid.force[k]).copied().chain([1.0]).collect();
        let mut wide = self.beside(&of, more)?;
        let (mut information, mut gradient) = wide.says()?;
        for (free, prior) in self.free.iter().zip(&self.prior) {
            if let Some(i) = wide.column_of(self.place_in(&wide, *free)) {
                information[(i, i)] += prior;
                gradient[i] += prior * (self.eta[*free] - self.mean[*free]);
            }
        }
        let n = wide.free.len();
        let said = DMatrix::from_fn(n, n + 1, |i, j| if j < n { information[(i, j)] } else { gradient[i] });
        Ok((said, wide.free))
    }

    /// The same point with more parameters of the wrench, which take these amounts of each row after those told; linearised.
    fn beside<'b>(
        &self,
        of: &'b FlightLikelihood,
        more: impl Fn(usize) -> Vec<f64>,
    ) -> Result<Fit<'b>, IdentificationError> {
        let mut grid = self.grid.clone();
        grid.amounts = (0..grid.len())
            .flat_map(|k| {
                let told = &self.grid.amounts[k * self.width..(k + 1) * self.width];
                told.iter().copied().chain(more(k)).collect::<Vec<f64>>()
            })
            .collect();
        let mut wide = Fit::new(of, grid, self.planar)?;
        for (column, (value, mean)) in self.eta.iter().zip(&self.mean).enumerate() {
            let place = self.place_in(&wide, column);
            (wide.eta[place], wide.mean[place]) = (*value, *mean);
        }
        wide.levels = self.levels;
        wide.shift = self.shift;
        wide.take_shift();
        wide.counts.clone_from(&self.counts);
        wide.nodes.clone_from(&self.nodes);
        wide.errors.clone_from(&self.errors);
        wide.sweep.rates.clone_from(&self.sweep.rates);
        wide.linearise();
        Ok(wide)
    }

    /// Where a parameter stands in a fit with more of the wrench.
    pub(super) fn place_in(&self, wide: &Fit<'_>, column: usize) -> usize {
        let more = wide.layout.thrusters - self.layout.thrusters;
        if column < self.layout.slope() { column } else { column + more }
    }

    /// Information of the free parameters where the chain was linearised, without priors, and its gradient.
    fn says(&mut self) -> Result<(DMatrix<f64>, DVector<f64>), IdentificationError> {
        let form = self.chain.eliminate(0, self.segments, false);
        let (information, gradient, _) = without_state(&form, self.chain.shape).ok_or(indefinite(self.free.len()))?;
        Ok((information, gradient))
    }

    /// What segments ask for that the motion does not give, in squared standard deviations, once the motion alone is free.
    pub(super) fn cost(&mut self, segments: core::ops::Range<usize>) -> f64 {
        let form = self.chain.eliminate(segments.start, segments.end, false);
        let ny = self.chain.shape.eliminated();
        let at = |i: usize, j: usize| form[i * ny + j];
        let states = DMatrix::from_fn(STATES, STATES, at);
        let cross = DMatrix::from_fn(STATES, 1, |i, _| at(i, ny - 1));
        solved(&states, &cross).map_or(f64::INFINITY, |gone| at(ny - 1, ny - 1) - cross.dot(&gone))
    }

    /// The part of a delay that is whole rows, s; zero for what is no delay.
    pub(super) fn whole_row_delay_s(&self, column: usize) -> f64 {
        let stream = column.checked_sub(self.layout.delay()).filter(|stream| *stream < DELAYS);
        stream.map_or(0.0, |stream| self.shift[stream] as f64 * self.grid.step_s)
    }

    pub(super) fn not_converged(&self) -> IdentificationError {
        IdentificationError::LikelihoodNotConverged { iterations: self.sweeps, decrement: self.decrement }
    }

    fn is_all_known(&self) -> bool {
        let s = &self.of.sensing;
        let slow = [&s.position, &s.attitude, &s.velocity];
        slow.iter().all(|errors| errors.wander.is_known() && errors.white.is_known())
            && s.rate.white.is_known()
            && s.acceleration.white.is_known()
            && self.of.wrench_noise.is_some()
    }

    /// The chain about the present point.
    fn linearise(&mut self) {
        let shape = Shape {
            parameters: self.free.len(),
            dynamic: self.free.iter().filter(|&&column| column < self.layout.dynamic()).count(),
        };
        let mut first = [UNKNOWN; MOTION];
        if self.planar {
            for i in [0, 1, 3, 4, 8, 11] {
                first[i] = HELD;
            }
        }
        let wandering = self.wandering();
        if self.chain.segments() != self.segments || self.chain.shape.parameters != shape.parameters {
            self.chain = Chain::new(self.segments, shape, &wandering, first);
        }
        self.chain.wandering = wandering;
        self.chain.errors.clone_from(&self.errors);
        let body = self.coordinates().body();
        let rates = core::mem::take(&mut self.sweep.rates);
        self.unit.take_rates(&rates);
        if !self.grid.valid.iter().any(|valid| valid[RATE]) {
            // The publisher had a rate that the record lacks.
            for (row, rate) in self.rows.iter_mut().zip(&rates) {
                row.rate_beside = *rate;
            }
        }
        self.sweep.rates = rates;
        let errors: Vec<[f64; WRENCH]> = self.wrench_errors().collect();
        let read = Swept {
            grid: &self.grid,
            rows: &self.rows,
            valid: &self.valid,
            unit: &self.unit,
            layout: self.layout,
            terms: &self.terms,
            width: self.width,
            samples: self.samples,
            gravity: if self.planar { Vector3::zeros() } else { self.of.gravity_world },
        };
        self.sweep.run(&read, &self.nodes, &errors, &body, &self.eta);
        self.assemble(&body);
    }

    /// Solves, moves the parameters; states and noises that follow.
    #[allow(clippy::type_complexity)] // states and noises, segment by segment
    fn step(&mut self) -> Result<(Vec<[f64; STATES]>, Vec<[f64; NOISES]>), IdentificationError> {
        let p = self.free.len();
        let before = self.eta.clone();
        let form = self.chain.eliminate(0, self.segments, true);
        let (mut information, mut gradient, gone) = without_state(&form, self.chain.shape).ok_or(indefinite(p))?;
        for (i, (&column, prior)) in self.free.iter().zip(&self.prior).enumerate() {
            information[(i, i)] += prior;
            gradient[i] += prior * (self.eta[column] - self.mean[column]);
        }
        let coordinates = self.coordinates();
        let mass = coordinates.log_mass.exp();
        let mean_inertia = coordinates.inertia.trace() / 3.0;
        let length = (1.5 * mean_inertia / mass).sqrt();
        let mut damped = information.clone();
        for (i, &column) in self.free.iter().enumerate().filter(|(_, column)| **column < BODY) {
            let sigma = match column {
                LOG_MASS => DAMPING[0],
                c if c < INERTIA => DAMPING[1] * length,
                _ => DAMPING[2] * mean_inertia,
            };
            damped[(i, i)] += 1.0 / (sigma * sigma);
        }
        let plain = || {
            let step = solved(&damped, &DMatrix::from_column_slice(p, 1, (-&gradient).as_slice()))?;
            Some(DVector::from_column_slice(step.as_slice()))
        };
        let step = if p == 0 {
            DVector::zeros(0)
        } else if self.planar {
            let step = plain().ok_or(indefinite(p))?;
            self.move_planar(&step);
            step
        } else {
            // Scaled, so that what is measured in other units does not decide whether the matrix can be factored.
            let taken = coordinates.step(&damped, &-&gradient);
            let (next, step) = if let Some(taken) = taken {
                (taken.next, taken.step)
            } else {
                let step = plain().ok_or(indefinite(p))?;
                (coordinates.advanced(&step), step)
            };
            let difference = next.difference(&coordinates);
            for i in 0..BODY {
                self.eta[i] += difference[i];
            }
            step
        };
        let delays = self.layout.delay()..self.layout.delay() + DELAYS;
        for (&column, step) in self.free.iter().zip(step.iter()).filter(|(column, _)| **column >= BODY) {
            let is_delay = delays.contains(&column);
            self.eta[column] += if is_delay { step.clamp(-LARGEST_DELAY_STEP_S, LARGEST_DELAY_STEP_S) } else { *step };
        }
        self.decrement = step.dot(&(&information * &step));
        if !self.decrement.is_finite() {
            return Err(indefinite(p));
        }
        let one = DVector::from_iterator(p + 1, step.iter().copied().chain([1.0]));
        let first = -(&gone * one);
        let first: [f64; STATES] = core::array::from_fn(|i| first[i]);
        let (mut states, mut noises) = self.chain.forward(&first, step.as_slice());
        (self.information, self.gradient, self.form) = (information, gradient, form);
        self.left = self.residuals(&states, &noises, step.as_slice());
        for (lasting, state) in self.lasting.iter_mut().zip(&states) {
            lasting.copy_from_slice(&state[MOTION..ACTING]);
        }
        if self.sweeps > FULL_STEPS {
            for (eta, before) in self.eta.iter_mut().zip(before) {
                *eta = before + 0.5 * (*eta - before);
            }
            states.iter_mut().flatten().chain(noises.iter_mut().flatten()).for_each(|step| *step *= 0.5);
        }
        Ok((states, noises))
    }

    fn move_planar(&mut self, step: &DVector<f64>) {
        let before = self.coordinates();
        let mut ten = [0.0; BODY];
        for (&column, step) in self.free.iter().zip(step.iter()).filter(|(column, _)| **column < BODY) {
            ten[column] = *step;
        }
        // In one over mass and inertia where the step is a long one.
        let long = |relative: f64| if relative.abs() > 0.2 { 1.0 / (1.0 - relative.min(0.9)) } else { 1.0 + relative };
        let mass = if ten[0].abs() > 0.2 { long(ten[0]).ln() } else { ten[0] };
        self.eta[LOG_MASS] += mass;
        self.eta[CENTER] += ten[1];
        self.eta[CENTER + 1] += ten[2];
        let about = before.inertia[(2, 2)];
        // The other moments do not act; a ball is a body whatever its size.
        self.set_inertia(&(Matrix3::identity() * (about * long(ten[9] / about).max(1e-3))));
    }

    /// What is left of the rows after a step, the wander left in.
    fn residuals(&self, states: &[[f64; STATES]], noises: &[[f64; NOISES]], step: &[f64]) -> Vec<[f64; ROWS]> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        states
            .iter()
            .zip(noises)
            .enumerate()
            .map(|(j, (x, u))| {
                core::array::from_fn(|i| {
                    let row = self.chain.row(j, i);
                    dot(&row[..ACTING], &x[..ACTING])
                        + dot(&row[STATES..STATES + WRENCH], &u[..WRENCH])
                        + dot(&row[STATES + NOISES..], step)
                        + row[row.len() - 1]
                })
            })
            .collect()
    }

    fn advance(&mut self, states: &[[f64; STATES]], noises: &[[f64; NOISES]]) {
        for ((node, x), (error, u)) in self.nodes.iter_mut().zip(states).zip(self.errors.iter_mut().zip(noises)) {
            let step: [f64; MOTION] = core::array::from_fn(|i| x[i]);
            *node = node.retracted(&step);
            for (error, u) in error.iter_mut().zip(u) {
                *error += u;
            }
        }
    }

    /// Moves streams by whole rows where their delays ask for it.
    fn move_streams(&mut self) -> bool {
        let mut moved = false;
        let longest = nearest(LARGEST_DELAY_STEP_S / self.grid.step_s).max(1);
        let enough = if self.sweeps < LAST_SHIFT / 2 { SHIFT } else { 2.0 * SHIFT };
        for i in 0..DELAYS {
            let column = self.layout.delay() + i;
            if self.column_of(column).is_none() {
                continue;
            }
            let rows = self.eta[column] / self.grid.step_s;
            if rows.abs() > enough && rows.is_finite() {
                let by = nearest(rows).clamp(-longest, longest);
                self.shift[i] += by;
                self.eta[column] -= by as f64 * self.grid.step_s;
                self.mean[column] -= by as f64 * self.grid.step_s;
                moved |= by != 0;
            }
        }
        if self.shares_delay() {
            self.shift[1] = self.shift[0];
        }
        if moved {
            self.take_shift();
        }
        moved
    }

    /// Covariance of the first state and the parameters, row by row.
    fn joint_covariance(&self) -> Option<Vec<f64>> {
        let shape = self.chain.shape;
        let (ny, n) = (shape.eliminated(), STATES + shape.parameters);
        let form = &self.form;
        let joint = DMatrix::from_fn(n, n, |i, j| {
            let prior = if i == j && i >= STATES { self.prior[i - STATES] } else { 0.0 };
            form[i * ny + j] + prior
        });
        let inverse = solved(&joint, &DMatrix::identity(n, n))?;
        Some((0..n * n).map(|at| 0.5 * (inverse[(at / n, at % n)] + inverse[(at % n, at / n)])).collect())
    }
}

/// The nearest whole number.
#[allow(clippy::cast_possible_truncation)] // saturates
fn nearest(value: f64) -> isize {
    value.round() as isize
}
