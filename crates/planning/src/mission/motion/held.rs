//! The motion of a believed body under inputs that are held step by step.

use crate::local::MotionBounds;
use crate::motion::{BodyArc, COEFFICIENTS};
use nalgebra::{Unit, Vector3};
use tumble_dynamics::{FreeFlyer, InertialParameters, Integrator, MuntheKaas4, PoseReference, RigidBodyState};
use tumble_lie::{LieGroup, Wrench};

/// Steps are flown in pieces that are no longer than this, s.
const PIECE_S: f64 = 0.1;
/// Most pieces of a step.
const MOST_PIECES: f64 = 64.0;
/// Angle that a body may turn within a piece for the bound of [`HeldInputs::arc`] to hold, rad.
const LARGEST_TURN_RAD: f64 = 0.5;
/// Turns of less than this are none: what they are apart by is added to the error, rad.
const LEAST_TURN_RAD: f64 = 1e-9;

/// Inputs on a body, in pieces: the state at the start of each, and the wrench held over it.
#[derive(Clone, Debug)]
pub(super) struct HeldInputs {
    body: FreeFlyer<f64>,
    piece_s: f64,
    pieces: Vec<(RigidBodyState<f64>, Wrench<f64>)>,
    end: RigidBodyState<f64>,
}

/// A piece as an arc.
pub(super) struct Piece {
    /// The arc.
    pub arc: BodyArc,
    /// Farthest that the origin may be from it, m.
    pub apart_m: f64,
    /// Largest angle that the attitude may be from its, rad.
    pub apart_rad: f64,
}

impl HeldInputs {
    /// From a state, inputs held for `step_s` each. Where the body has no finite state any more, it ends.
    pub fn new(
        start: RigidBodyState<f64>,
        inputs: impl ExactSizeIterator<Item = Wrench<f64>>,
        step_s: f64,
        body: &InertialParameters<f64>,
    ) -> Self {
        let body = FreeFlyer::new(*body);
        let per_step = libm::ceil(step_s / PIECE_S).clamp(1.0, MOST_PIECES);
        let piece_s = step_s / per_step;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 1 and 64, or not a number, which gives none"
        )]
        let count = per_step as usize;
        let is_length = piece_s > 0.0 && piece_s.is_finite();
        if !is_length {
            return Self { body, piece_s: 1.0, pieces: Vec::new(), end: start };
        }
        let mut held = Self { body, piece_s, pieces: Vec::with_capacity(inputs.len() * count), end: start };
        for wrench in inputs {
            for _ in 0..count {
                let Ok(next) = MuntheKaas4.step(&body, &held.end, &wrench, 0.0, piece_s) else { return held };
                held.pieces.push((held.end, wrench));
                held.end = next;
            }
        }
        held
    }

    pub fn duration_s(&self) -> f64 {
        self.piece_s * self.pieces.len() as f64
    }

    pub fn end(&self) -> &RigidBodyState<f64> {
        &self.end
    }

    /// Number of the piece that holds a time, and the time within it.
    pub fn place(&self, within_s: f64) -> (usize, f64) {
        let last = self.pieces.len().saturating_sub(1);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "what is beyond the pieces is cut to them"
        )]
        let place = (within_s / self.piece_s) as usize;
        let index = usize::min(place, last);
        (index, within_s - self.piece_s * index as f64)
    }

    /// State and acceleration: one step from the start of the piece; none where there are no pieces.
    pub fn at(&self, within_s: f64) -> Option<PoseReference> {
        let (index, within_s) = self.place(within_s);
        let (start, wrench) = self.pieces.get(index)?;
        let state = MuntheKaas4.step(&self.body, start, wrench, 0.0, within_s).unwrap_or(*start);
        Some(PoseReference { state, acceleration: self.body.forward(&state.twist_body, wrench) })
    }

    /// The pieces from one on, as arcs, each with the time since the start at which it begins.
    pub fn arcs(&self, from: usize) -> impl Iterator<Item = (f64, Piece)> {
        let ends = self.pieces.iter().skip(1).map(|(state, _)| state).chain([&self.end]);
        let pieces = self.pieces.iter().zip(ends).enumerate().skip(from);
        pieces.map(|(index, ((start, wrench), end))| (self.piece_s * index as f64, self.arc(start, end, wrench)))
    }

    /// The cubic with the positions and velocities of both ends, and a turn about one axis with their attitudes, and their rates
    /// about it.
    ///
    /// What it is apart from the motion: for the origin see [`MotionBounds`]. The attitude is the exponential of a vector `xi` in
    /// axes of the start; `xi` and the arc's vector are equal at both ends, so that they differ by no more than `step^2 / 8` times
    /// the largest second derivative of their difference, and the attitudes by no more than they do. For a body at the rate w and
    /// the angular acceleration a' that turns by no more than half a radian, `|xi''| <= 1.02 a' + 0.5 w^3 step`.
    fn arc(&self, start: &RigidBodyState<f64>, end: &RigidBodyState<f64>, wrench: &Wrench<f64>) -> Piece {
        let h = self.piece_s;
        let [p0, p1] = [start, end].map(|state| state.world_from_body.translation.vector);
        let [v0, v1] = [start, end].map(|state| state.world_from_body.rotation * state.twist_body.linear);
        let mut position = [Vector3::zeros(); COEFFICIENTS];
        position[0] = p0;
        position[1] = v0;
        position[2] = (p1 - p0) * (3.0 / (h * h)) - (v0 * 2.0 + v1) / h;
        position[3] = (p0 - p1) * (2.0 / (h * h * h)) + (v0 + v1) / (h * h);

        let attitude = start.world_from_body.rotation;
        let xi = LieGroup::log(&(attitude.inverse() * end.world_from_body.rotation));
        let turned = Unit::try_new_and_get(xi, LEAST_TURN_RAD);
        let (axis_body, turned_rad) = turned.unwrap_or((Vector3::z_axis(), 0.0));
        let mut angle = [0.0; COEFFICIENTS];
        if turned_rad > 0.0 {
            let [r0, r1] = [start, end].map(|state| axis_body.dot(&state.twist_body.angular));
            angle[1] = r0;
            angle[2] = turned_rad * (3.0 / (h * h)) - (r0 * 2.0 + r1) / h;
            angle[3] = (r0 + r1) / (h * h) - turned_rad * (2.0 / (h * h * h));
        }
        let arc = BodyArc { duration_s: h, position, attitude, axis_body, angle };

        let bounds = self.bounds(start, wrench);
        let (rate, squared) = (bounds.rate_rad_s, bounds.rate_rad_s * bounds.rate_rad_s);
        let turning = bounds.angular_acceleration_rad_s2 + 0.58 * squared;
        let of_motion = 1.02 * turning + 0.5 * squared * rate * h;
        let of_arc = 2.0 * f64::max(angle[2].abs(), (angle[2] + 3.0 * angle[3] * h).abs());
        let apart_rad = if rate * h <= LARGEST_TURN_RAD {
            f64::min(h * h / 8.0 * (of_motion + of_arc) + LEAST_TURN_RAD, core::f64::consts::PI)
        } else {
            core::f64::consts::PI
        };
        Piece { arc, apart_m: bounds.hermite_error_m(h, 0.0), apart_rad }
    }

    /// How fast the motion changes within a piece.
    ///
    /// The rate grows by no more than `a + 0.58 w^2`, with `a` from the torque, so that it stays below the least root of
    /// `w = w0 + step (a + 0.58 w^2)`; where there is none, nothing is known.
    fn bounds(&self, start: &RigidBodyState<f64>, wrench: &Wrench<f64>) -> MotionBounds {
        let still = self.body.forward(&tumble_lie::Twist::zero(), wrench);
        let angular_acceleration_rad_s2 = length(&still.angular_acceleration_body);
        let reached = length(&start.twist_body.angular) + self.piece_s * angular_acceleration_rad_s2;
        let root = 1.0 - 4.0 * 0.58 * self.piece_s * reached;
        let rate_rad_s = if root >= 0.0 { 2.0 * reached / (1.0 + f64::sqrt(root)) } else { f64::INFINITY };
        let parameters = self.body.parameters();
        MotionBounds {
            acceleration_m_s2: length(&wrench.force) / parameters.mass,
            rate_rad_s,
            angular_acceleration_rad_s2,
            center_of_mass_m: length(&parameters.center_of_mass()),
        }
    }
}

fn length(vector: &Vector3<f64>) -> f64 {
    f64::sqrt(vector.norm_squared())
}
