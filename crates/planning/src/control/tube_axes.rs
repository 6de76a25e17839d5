//! The three axes of one revision: each for itself, or tied together by the planes of obstacles.

use super::{
    AxisPlan, AxisPlane, AxisProblem, AxisTube, CoupledAxes, EndAttitude, GramStatus, NominalPath, ObstaclePlanes,
    TrackedMotion,
};
use crate::collision::BodyShape;
use crate::error::PlanningError;
use crate::local::Barrier;
use nalgebra::{UnitQuaternion, Vector2, Vector3};

/// What a tube keeps off, and the body that does.
#[derive(Clone, Debug)]
pub struct TubeObstacles {
    /// The body.
    pub body: BodyShape,
    /// The obstacles.
    pub barriers: Vec<Barrier>,
    /// Largest rate at which references turn, rad/s.
    pub turn_rad_s: f64,
    /// What references do beyond the last node planned.
    pub end: EndAttitude,
    /// Largest angle between the body and its reference, rad.
    pub attitude_error_rad: f64,
}

/// Axes tied together by planes.
#[derive(Clone, Debug)]
pub(super) struct TiedAxes {
    axes: CoupledAxes,
    planes: ObstaclePlanes,
    world_from_axes: UnitQuaternion<f64>,
    turn_rad_s: f64,
    end: EndAttitude,
    attitude_error_rad: f64,
    positions: Vec<Vector3<f64>>,
    rows: Vec<AxisPlane>,
    cut: usize,
}

/// Three axes with their solver.
#[derive(Clone, Debug)]
pub(super) enum TubeAxes {
    Separate(Box<[AxisTube; 3]>),
    Tied(Box<TiedAxes>),
}

impl TubeAxes {
    pub fn try_new(
        problems: [AxisProblem; 3],
        obstacles: Option<&TubeObstacles>,
        tracked_body: &Vector3<f64>,
        world_from_axes: UnitQuaternion<f64>,
    ) -> Result<Self, PlanningError> {
        let Some(obstacles) = obstacles else {
            let [x, y, z] = problems;
            return Ok(Self::Separate(Box::new([AxisTube::of(x)?, AxisTube::of(y)?, AxisTube::of(z)?])));
        };
        let steps = problems[0].steps;
        Ok(Self::Tied(Box::new(TiedAxes {
            axes: CoupledAxes::try_new(problems)?,
            planes: ObstaclePlanes::try_new(&obstacles.body, tracked_body, &obstacles.barriers, steps)?,
            world_from_axes,
            turn_rad_s: obstacles.turn_rad_s,
            end: obstacles.end,
            attitude_error_rad: obstacles.attitude_error_rad,
            positions: Vec::with_capacity(steps + 1),
            rows: Vec::new(),
            cut: 0,
        })))
    }

    pub fn problem(&self, axis: usize) -> &AxisProblem {
        match self {
            Self::Separate(axes) => axes[axis].problem(),
            Self::Tied(tied) => &tied.axes.problems()[axis],
        }
    }

    pub fn plan(&self, axis: usize) -> &AxisPlan {
        match self {
            Self::Separate(axes) => axes[axis].plan(),
            Self::Tied(tied) => &tied.axes.plans()[axis],
        }
    }

    /// Planes of the last decision that obstacles moved beyond what the shifted plan keeps: recursion is not promised then.
    pub fn cut(&self) -> usize {
        match self {
            Self::Separate(_) => 0,
            Self::Tied(tied) => tied.cut,
        }
    }

    /// Before a first decision, or after plans were lost: everything begins where the body is.
    pub fn begin(&mut self, states: &[Vector2<f64>; 3]) {
        if let Self::Tied(tied) = self {
            tied.planes.forget();
            tied.axes.begin(states);
        }
    }

    /// One step on.
    pub fn advance(&mut self) {
        match self {
            Self::Separate(axes) => axes.iter_mut().for_each(AxisTube::advance),
            Self::Tied(tied) => {
                tied.axes.advance();
                tied.planes.advance();
            }
        }
    }

    /// Plans; the first status that is not solved, of all axes. Planes are chosen along `guess`, the plan of another revision, or
    /// along the own one.
    pub fn solve(&mut self, motion: &TrackedMotion, guess: Option<&Self>) -> GramStatus {
        match self {
            Self::Separate(axes) => {
                let mut first = GramStatus::Solved;
                for (axis, (state, reference)) in axes.iter_mut().zip(motion.states.iter().zip(&motion.references)) {
                    let status = axis.solve(state, reference);
                    if first == GramStatus::Solved {
                        first = status;
                    }
                }
                first
            }
            Self::Tied(tied) => tied.solve(motion, guess).unwrap_or(GramStatus::Numerical),
        }
    }
}

impl TiedAxes {
    fn solve(&mut self, motion: &TrackedMotion, guess: Option<&TubeAxes>) -> Result<GramStatus, PlanningError> {
        match guess {
            Some(TubeAxes::Tied(guess)) => guess.axes.positions(&mut self.positions),
            _ => self.axes.positions(&mut self.positions),
        }
        let step_s = self.axes.problems()[0].step_s;
        let path = NominalPath {
            start_s: motion.start_s,
            step_s,
            positions: &self.positions,
            tube_m: self.axes.tube_m(),
            world_from_axes: self.world_from_axes,
            attitudes: &motion.attitudes,
            turn_rad_s: self.turn_rad_s,
            end: self.end,
            attitude_error_rad: self.attitude_error_rad,
        };
        let reach = self.axes.reach(&motion.states);
        self.cut = self.planes.update(&path, &reach)?.cut;
        self.planes.rows(&path, &reach, &mut self.rows);
        self.axes.set_planes(&self.rows);
        let [x, y, z] = &motion.references;
        Ok(self.axes.solve(&motion.states, [x, y, z]))
    }
}
