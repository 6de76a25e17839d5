//! A body that forces push about without turning it.

use super::{BodyMotion, KinodynamicModel, Primitive, stays_in_box};
use crate::error::{PlanningError, finite, not_negative, positive};
use crate::global::MotionLimits;
use crate::motion::{BodyArc, TranslationState};
use crate::state_space::StateSpace;
use crate::unit_interval;
use nalgebra::{UnitQuaternion, Vector3};
use rand_core::Rng;
use tumble_dynamics::{AlignedBox, InertialParameters};

/// How a state follows from a force.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Propagation {
    /// As the equations say.
    Exact,
    /// By explicit Euler steps of at most this length, all alike: the position falls behind by `a T h / 2`.
    ///
    /// The arc of an edge then is the parabola through the points of the steps; where edges meet, its velocity jumps by up to
    /// `a h`.
    Euler {
        /// Longest step, s.
        step_s: f64,
    },
}

/// Positions in a box, speeds in a box, a constant world force over each edge: `p'' = f / m`.
///
/// The input is the force on the body, world axes, N.
#[derive(Clone, Debug, PartialEq)]
pub struct DoubleIntegrator {
    position: AlignedBox,
    speed_m_s: Vector3<f64>,
    primitives: Vec<Primitive<Vector3<f64>>>,
    propagation: Propagation,
    attitude: UnitQuaternion<f64>,
}

impl DoubleIntegrator {
    /// Forces of `force_n` each way along every axis where it is not zero, and none, each held for `duration_s`: seven
    /// primitives in space, five on a table. Sides of the position box may be infinite where limits narrow them before
    /// anything is sampled.
    ///
    /// # Errors
    /// An empty box, a negative speed or force, a duration or step that is not positive, numbers that are none.
    pub fn try_new(
        position: AlignedBox,
        speed_m_s: Vector3<f64>,
        force_n: Vector3<f64>,
        duration_s: f64,
        propagation: Propagation,
    ) -> Result<Self, PlanningError> {
        for axis in 0..3 {
            let (lower, upper) = (position.lower_world[axis], position.upper_world[axis]);
            if lower > upper || lower.is_nan() || upper.is_nan() {
                return Err(PlanningError::EmptyBox { what: "the box of positions", axis, lower, upper });
            }
            not_negative("a largest speed", speed_m_s[axis])?;
            not_negative("a largest force", force_n[axis])?;
        }
        positive("the length of a primitive", duration_s)?;
        if let Propagation::Euler { step_s } = propagation {
            positive("the step of the propagation", step_s)?;
        }
        let mut primitives = Vec::with_capacity(7);
        for axis in (0..3).filter(|axis| force_n[*axis] > 0.0) {
            for sign in [1.0, -1.0] {
                let mut input = Vector3::zeros();
                input[axis] = sign * force_n[axis];
                primitives.push(Primitive { input, duration_s });
            }
        }
        primitives.push(Primitive { input: Vector3::zeros(), duration_s });
        Ok(Self { position, speed_m_s, primitives, propagation, attitude: UnitQuaternion::identity() })
    }
}

impl StateSpace for DoubleIntegrator {
    type State = TranslationState;

    /// Euclidean over position and velocity alike, m and m/s unweighted.
    fn distance(&self, from: &TranslationState, to: &TranslationState) -> f64 {
        let square = (to.position - from.position).norm_squared() + (to.velocity - from.velocity).norm_squared();
        f64::sqrt(square)
    }

    fn interpolate(&self, from: &TranslationState, to: &TranslationState, fraction: f64) -> TranslationState {
        let rest = 1.0 - fraction;
        TranslationState {
            position: from.position * rest + to.position * fraction,
            velocity: from.velocity * rest + to.velocity * fraction,
        }
    }

    fn contains(&self, state: &TranslationState) -> bool {
        (0..3).all(|axis| {
            let coordinate = state.position[axis];
            self.position.lower_world[axis] <= coordinate
                && coordinate <= self.position.upper_world[axis]
                && state.velocity[axis].abs() <= self.speed_m_s[axis]
        })
    }

    /// Uniform in both boxes.
    fn sample(&self, rng: &mut dyn Rng) -> TranslationState {
        let size = self.position.upper_world - self.position.lower_world;
        let position = Vector3::from_fn(|axis, _| self.position.lower_world[axis] + size[axis] * unit_interval(rng));
        let velocity = Vector3::from_fn(|axis, _| self.speed_m_s[axis] * (2.0 * unit_interval(rng) - 1.0));
        TranslationState { position: position.inf(&self.position.upper_world), velocity }
    }
}

impl KinodynamicModel for DoubleIntegrator {
    type Input = Vector3<f64>;
    type Parameters = InertialParameters<f64>;

    fn propagate(
        &self,
        state: &TranslationState,
        input: &Vector3<f64>,
        parameters: &InertialParameters<f64>,
        duration_s: f64,
    ) -> TranslationState {
        let end = self.arc(state, input, parameters, duration_s).translation(duration_s).0;
        // along the parabola of Euler's points only the position is Euler's
        let acceleration_world = input / parameters.mass;
        TranslationState { position: end.position, velocity: state.velocity + acceleration_world * duration_s }
    }

    fn primitives(&self) -> &[Primitive<Vector3<f64>>] {
        &self.primitives
    }
}

impl BodyMotion for DoubleIntegrator {
    /// The intersection of the boxes; forces over a limit are cut to it.
    fn within(&self, limits: &MotionLimits, attitude: &UnitQuaternion<f64>) -> Result<Self, PlanningError> {
        let position = AlignedBox {
            lower_world: self.position.lower_world.sup(&limits.position.lower_world),
            upper_world: self.position.upper_world.inf(&limits.position.upper_world),
        };
        for axis in 0..3 {
            let (lower, upper) = (position.lower_world[axis], position.upper_world[axis]);
            finite("a side of the box of positions", lower)?;
            finite("a side of the box of positions", upper)?;
            if lower > upper {
                return Err(PlanningError::EmptyBox { what: "the box of positions", axis, lower, upper });
            }
            not_negative("a largest speed", limits.speed_m_s[axis])?;
            not_negative("a largest force", limits.force_n[axis])?;
        }
        let mut primitives = self.primitives.clone();
        for primitive in &mut primitives {
            primitive.input = primitive.input.inf(&limits.force_n).sup(&-limits.force_n);
        }
        let speed_m_s = self.speed_m_s.inf(&limits.speed_m_s);
        Ok(Self { position, speed_m_s, primitives, propagation: self.propagation, attitude: *attitude })
    }

    fn state_at(&self, translation: &TranslationState) -> TranslationState {
        *translation
    }

    fn translation(&self, state: &TranslationState) -> TranslationState {
        *state
    }

    fn arc(
        &self,
        state: &TranslationState,
        input: &Vector3<f64>,
        parameters: &InertialParameters<f64>,
        duration_s: f64,
    ) -> BodyArc {
        let acceleration_world = input / parameters.mass;
        let behind = match self.propagation {
            Propagation::Exact => Vector3::zeros(),
            Propagation::Euler { step_s } => {
                let steps = libm::ceil(duration_s / step_s - 1e-9).max(1.0);
                acceleration_world * (0.5 * duration_s / steps)
            }
        };
        let start = TranslationState { position: state.position, velocity: state.velocity - behind };
        BodyArc::accelerated(duration_s, &start, acceleration_world, self.attitude)
    }

    fn contains_arc(&self, arc: &BodyArc) -> bool {
        // the velocity is linear in time
        let is_slow = [0.0, arc.duration_s].iter().all(|time_s| {
            let velocity = arc.translation(*time_s).0.velocity;
            (0..3).all(|axis| velocity[axis].abs() <= self.speed_m_s[axis])
        });
        is_slow && stays_in_box(arc, &self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> AlignedBox {
        AlignedBox::between(Vector3::repeat(-1.0), Vector3::repeat(1.0))
    }

    fn body(mass_kg: f64) -> InertialParameters<f64> {
        InertialParameters::about_origin(mass_kg, Vector3::zeros(), nalgebra::Matrix3::identity())
    }

    #[test]
    fn euler_is_forty_steps_of_euler() {
        let (speed, force) = (Vector3::repeat(0.1), Vector3::repeat(0.2));
        let euler = Propagation::Euler { step_s: 0.05 };
        let model = DoubleIntegrator::try_new(cube(), speed, force, 2.0, euler).unwrap();
        let (body, input) = (body(8.0), Vector3::new(0.2, -0.1, 0.0));
        let start =
            TranslationState { position: Vector3::new(0.1, 0.2, 0.3), velocity: Vector3::new(0.0, 0.05, -0.02) };
        let (mut p, mut v) = (start.position, start.velocity);
        for step in 1..=40 {
            p += v * 0.05;
            v += input / 8.0 * 0.05;
            let time_s = 0.05 * f64::from(step);
            let on_the_arc = model.arc(&start, &input, &body, 2.0).translation(time_s).0.position;
            assert!((on_the_arc - p).amax() < 1e-15, "{step}");
        }
        let end = model.propagate(&start, &input, &body, 2.0);
        assert!((end.position - p).amax() < 1e-15 && (end.velocity - v).amax() < 1e-15);
    }

    #[test]
    fn there_are_seven_primitives_in_space_and_five_on_a_table() {
        let count = |force: Vector3<f64>| {
            DoubleIntegrator::try_new(cube(), force, force, 2.0, Propagation::Exact).unwrap().primitives().len()
        };
        assert_eq!((count(Vector3::repeat(0.1)), count(Vector3::new(0.1, 0.1, 0.0))), (7, 5));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let one = Vector3::repeat(1.0);
        let make = |position, speed, force, duration_s, propagation| {
            DoubleIntegrator::try_new(position, speed, force, duration_s, propagation).is_err()
        };
        let inside_out = AlignedBox { lower_world: one, upper_world: -one };
        assert!(make(inside_out, one, one, 2.0, Propagation::Exact));
        assert!(make(cube(), -one, one, 2.0, Propagation::Exact));
        assert!(make(cube(), one, one * f64::NAN, 2.0, Propagation::Exact));
        assert!(make(cube(), one, one, 0.0, Propagation::Exact));
        assert!(make(cube(), one, one, 2.0, Propagation::Euler { step_s: 0.0 }));
    }
}
