//! Models of motion for searches that propagate: what inputs do to states.

mod double_integrator;

pub use double_integrator::{DoubleIntegrator, Propagation};

use crate::error::PlanningError;
use crate::global::MotionLimits;
use crate::motion::{BodyArc, COEFFICIENTS, TranslationState};
use crate::state_space::StateSpace;
use core::fmt::Debug;
use nalgebra::UnitQuaternion;
use tumble_dynamics::AlignedBox;

/// An input held for a time: one edge of a search tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Primitive<U> {
    /// The input.
    pub input: U,
    /// How long it is held, s.
    pub duration_s: f64,
}

/// A robot whose states follow from inputs, usable as `dyn`.
///
/// # Laws
/// `laws::check_kinodynamic_model`.
///
/// # Example
/// ```
/// use tumble_planning::dynamics::{AlignedBox, InertialParameters};
/// use tumble_planning::nalgebra::Vector3;
/// use tumble_planning::{DoubleIntegrator, KinodynamicModel, Propagation, TranslationState};
///
/// let room = AlignedBox::between(Vector3::repeat(-2.0), Vector3::repeat(2.0));
/// let (speed, force) = (Vector3::repeat(0.5), Vector3::repeat(1.0));
/// let robot = DoubleIntegrator::try_new(room, speed, force, 1.0, Propagation::Exact)?;
/// assert_eq!(robot.primitives().len(), 7); // each way along three axes, and none
/// let body = InertialParameters::solid_box(4.0, [0.3; 3]);
/// let pushed = robot.propagate(&TranslationState::at_rest(Vector3::zeros()), &Vector3::x(), &body, 2.0);
/// assert_eq!((pushed.position.x, pushed.velocity.x), (0.5, 0.5));
/// # Ok::<(), tumble_planning::PlanningError>(())
/// ```
/// Tutorial: [a robot of your own to plan for](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_robot_plan.rs).
pub trait KinodynamicModel: StateSpace {
    /// What is held over an edge.
    type Input: Clone + Debug;
    /// What is believed about the body and may change between plans.
    type Parameters: ?Sized;

    /// The state after holding `input` for a time, s.
    fn propagate(
        &self,
        state: &Self::State,
        input: &Self::Input,
        parameters: &Self::Parameters,
        duration_s: f64,
    ) -> Self::State;

    /// The edges tried from every state.
    fn primitives(&self) -> &[Primitive<Self::Input>];
}

/// A kinodynamic model whose edges are exact motions of a body, so that a collision world can follow them.
///
/// # Laws
/// `laws::check_body_motion`.
///
/// # Example
/// ```
/// use tumble_planning::dynamics::{AlignedBox, InertialParameters};
/// use tumble_planning::nalgebra::Vector3;
/// use tumble_planning::{BodyMotion, DoubleIntegrator, KinodynamicModel, Propagation, TranslationState};
///
/// let room = AlignedBox::between(Vector3::repeat(-2.0), Vector3::repeat(2.0));
/// let (speed, force) = (Vector3::repeat(0.5), Vector3::repeat(1.0));
/// let robot = DoubleIntegrator::try_new(room, speed, force, 1.0, Propagation::Exact)?;
/// let (start, body) = (TranslationState::at_rest(Vector3::zeros()), InertialParameters::solid_box(4.0, [0.3; 3]));
/// let arc = robot.arc(&start, &Vector3::x(), &body, 2.0);
/// assert_eq!(arc.translation(2.0).0, robot.propagate(&start, &Vector3::x(), &body, 2.0));
/// assert!(robot.contains_arc(&arc) && !robot.contains_arc(&robot.arc(&start, &Vector3::x(), &body, 3.0)));
/// # Ok::<(), tumble_planning::PlanningError>(())
/// ```
/// Tutorial: [a robot of your own to plan for](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_robot_plan.rs).
pub trait BodyMotion: KinodynamicModel + Sized {
    /// The same robot, kept within `limits` as well as its own, starting with `attitude`.
    ///
    /// # Errors
    /// Limits that leave nothing, or that do not bound what has to be sampled.
    fn within(&self, limits: &MotionLimits, attitude: &UnitQuaternion<f64>) -> Result<Self, PlanningError>;

    /// The state with this translation and nothing else going on.
    fn state_at(&self, translation: &TranslationState) -> Self::State;

    /// The translation of a state.
    fn translation(&self, state: &Self::State) -> TranslationState;

    /// The motion of the body while `input` is held.
    fn arc(&self, state: &Self::State, input: &Self::Input, parameters: &Self::Parameters, duration_s: f64) -> BodyArc;

    /// Whether a motion certainly stays among the states of this model all the way.
    fn contains_arc(&self, arc: &BodyArc) -> bool;
}

/// Whether the body's origin certainly stays in a box (closed) all along a motion.
///
/// From the polynomial's control points, which enclose it, halved until they decide; false where they do not.
pub fn stays_in_box(arc: &BodyArc, bounds: &AlignedBox) -> bool {
    const HALVINGS: u32 = 16;
    (0..3).all(|axis| {
        let (lower, upper) = (bounds.lower_world[axis], bounds.upper_world[axis]);
        stays_between(control_points(arc, axis), lower, upper, HALVINGS)
    })
}

/// Control points over the whole arc of one coordinate: `b_i = sum_j C(i, j) / C(5, j) c_j T^j`.
fn control_points(arc: &BodyArc, axis: usize) -> [f64; COEFFICIENTS] {
    const SHARES: [[f64; COEFFICIENTS]; COEFFICIENTS] = [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1.0, 0.2, 0.0, 0.0, 0.0, 0.0],
        [1.0, 0.4, 0.1, 0.0, 0.0, 0.0],
        [1.0, 0.6, 0.3, 0.1, 0.0, 0.0],
        [1.0, 0.8, 0.6, 0.4, 0.2, 0.0],
        [1.0; COEFFICIENTS],
    ];
    let mut scaled = [0.0; COEFFICIENTS];
    let mut power = 1.0;
    for (value, coefficient) in scaled.iter_mut().zip(&arc.position) {
        *value = coefficient[axis] * power;
        power *= arc.duration_s;
    }
    SHARES.map(|row| row.iter().zip(&scaled).map(|(share, value)| share * value).sum())
}

fn stays_between(points: [f64; COEFFICIENTS], lower: f64, upper: f64, halvings: u32) -> bool {
    let is_inside = |value: &f64| lower <= *value && *value <= upper;
    if points.iter().all(is_inside) {
        return true;
    }
    // the first and the last control point lie on the curve
    let [first, .., last] = points;
    if halvings == 0 || !is_inside(&first) || !is_inside(&last) {
        return false;
    }
    let (mut left, mut right) = (points, points);
    for level in 1..COEFFICIENTS {
        for i in (level..COEFFICIENTS).rev() {
            left[i] = 0.5 * (left[i - 1] + left[i]);
        }
        for i in 0..COEFFICIENTS - level {
            right[i] = 0.5 * (right[i] + right[i + 1]);
        }
    }
    stays_between(left, lower, upper, halvings - 1) && stays_between(right, lower, upper, halvings - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn along_x(coefficients: [f64; COEFFICIENTS], duration_s: f64) -> BodyArc {
        let start = TranslationState::at_rest(Vector3::zeros());
        let mut arc = BodyArc::accelerated(duration_s, &start, Vector3::zeros(), UnitQuaternion::identity());
        arc.position = coefficients.map(|value| Vector3::new(value, 0.0, 0.0));
        arc
    }

    /// Against the extremes found by dense sampling, for polynomials of every degree.
    #[test]
    fn a_motion_stays_in_the_box_exactly_where_its_extremes_do() {
        let motions = [
            along_x([0.1, 0.3, -0.2, 0.0, 0.0, 0.0], 2.0),
            along_x([0.0, -1.0, 0.9, 0.1, 0.0, 0.0], 1.5),
            along_x([0.2, 0.0, 1.0, -2.0, 0.7, 0.1], 1.0),
            along_x([0.3, 0.0, 0.0, 0.0, 0.0, 0.0], 4.0),
        ];
        for arc in motions {
            let (mut least, mut largest) = (f64::INFINITY, f64::NEG_INFINITY);
            for step in 0..=10_000 {
                let x = arc.translation(arc.duration_s * f64::from(step) / 1e4).0.position.x;
                (least, largest) = (least.min(x), largest.max(x));
            }
            let bounds = |wider: f64| {
                let corner = Vector3::new(least - wider, 0.0, 0.0);
                AlignedBox::between(corner, Vector3::new(largest + wider, 0.0, 0.0))
            };
            assert!(stays_in_box(&arc, &bounds(1e-6)), "{least} {largest}");
            let narrower = AlignedBox { lower_world: Vector3::new(least + 1e-6, 0.0, 0.0), ..bounds(1.0) };
            assert!(!stays_in_box(&arc, &narrower), "{least}");
            let narrower = AlignedBox { upper_world: Vector3::new(largest - 1e-6, 0.0, 0.0), ..bounds(1.0) };
            assert!(!stays_in_box(&arc, &narrower), "{largest}");
        }
    }

    #[test]
    fn nothing_that_is_not_a_number_stays_anywhere() {
        let everywhere = AlignedBox::between(Vector3::repeat(f64::NEG_INFINITY), Vector3::repeat(f64::INFINITY));
        assert!(!stays_in_box(&along_x([f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0), &everywhere));
    }
}
