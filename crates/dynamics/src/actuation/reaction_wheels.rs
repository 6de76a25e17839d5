//! Reaction wheels: torque without force, as long as they can spin faster.

use super::Actuation;
use super::effectiveness::{finite, limited, right_inverse};
use crate::error::DynamicsError;
use tumble_lie::Wrench;
use tumble_lie::nalgebra::{SMatrix, SVector, UnitVector3, Vector3};

/// A flywheel and its motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReactionWheel {
    /// Spin axis, body axes.
    pub axis_body: UnitVector3<f64>,
    /// Largest motor torque either way, N m; positive.
    pub largest_torque_n_m: f64,
    /// Largest momentum either way relative to the body, that is inertia times largest speed, N m s; positive.
    pub largest_momentum_n_m_s: f64,
}

/// `N` wheels and the momentum they hold.
///
/// Its command is the torque of each motor on its wheel, N m, held for a control period; the body gets the opposite. A
/// motor gives no more than its limit, nor what would spin its wheel beyond its largest momentum within the period.
/// Wheels cannot push: the force of a wanted wrench is left to other actuators, and of
/// the laws of [`Actuation`] "what lies inside the limits is realised" speaks of wrenches without force.
///
/// The momentum is state: [`advance`](Self::advance) carries it on after each period. Beside what the motors do, spinning
/// wheels turn with the body, which costs [`gyroscopic_torque`](Self::gyroscopic_torque).
/// # Frame
/// Body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReactionWheels<const N: usize> {
    wheels: [ReactionWheel; N],
    period_s: f64,
    /// Body torque per motor torque.
    effectiveness: SMatrix<f64, 3, N>,
    /// Motor torques of least norm, each over its limit, per body torque.
    sharing: SMatrix<f64, N, 3>,
    momentum: SVector<f64, N>,
}

impl<const N: usize> ReactionWheels<N> {
    /// Wheels at rest whose motors are told anew every `period_s`.
    ///
    /// # Errors
    /// [`DynamicsError::NotPositive`] for the period, [`DynamicsError::InvalidActuator`] for a wheel whose limits are not
    /// positive and finite, [`DynamicsError::OutOfReach`] if the axes do not span all directions.
    pub fn try_new(wheels: [ReactionWheel; N], period_s: f64) -> Result<Self, DynamicsError> {
        if !(period_s > 0.0 && period_s.is_finite()) {
            return Err(DynamicsError::NotPositive { duration_s: period_s });
        }
        let valid = |limit: f64| limit > 0.0 && limit.is_finite();
        let fits = |wheel: &ReactionWheel| valid(wheel.largest_torque_n_m) && valid(wheel.largest_momentum_n_m_s);
        if let Some(index) = wheels.iter().position(|wheel| !fits(wheel)) {
            return Err(DynamicsError::InvalidActuator { index });
        }
        let effectiveness = SMatrix::from_fn(|row, i| -wheels[i].axis_body[row]);
        let at_limit = SMatrix::from_fn(|row, i| effectiveness[(row, i)] * wheels[i].largest_torque_n_m);
        let efforts: SMatrix<f64, N, 3> = right_inverse(&at_limit)?;
        let sharing = SMatrix::from_fn(|i, column| efforts[(i, column)] * wheels[i].largest_torque_n_m);
        Ok(Self { wheels, period_s, effectiveness, sharing, momentum: SVector::zeros() })
    }

    /// The wheels.
    pub fn wheels(&self) -> &[ReactionWheel; N] {
        &self.wheels
    }

    /// Momentum of each wheel about its axis relative to the body, N m s.
    pub fn momentum(&self) -> &SVector<f64, N> {
        &self.momentum
    }

    /// Momentum of all wheels relative to the body, body axes, N m s.
    pub fn momentum_body(&self) -> Vector3<f64> {
        -(self.effectiveness * self.momentum)
    }

    /// Torque on the body because it turns the spinning wheels with it, `h x w`, N m.
    pub fn gyroscopic_torque(&self, angular_velocity_body: &Vector3<f64>) -> Vector3<f64> {
        self.momentum_body().cross(angular_velocity_body)
    }

    /// Holds the command for one period: momentum moves from the body into the wheels.
    pub fn advance(&mut self, command: &SVector<f64, N>) {
        self.momentum += self.motor_torques(command) * self.period_s;
    }

    /// The least and the largest torque that a motor can hold for a period.
    fn torque_bounds(&self, i: usize) -> (f64, f64) {
        let ReactionWheel { largest_torque_n_m: torque, largest_momentum_n_m_s: momentum, .. } = self.wheels[i];
        let to_stop = |bound: f64| (bound - self.momentum[i]) / self.period_s;
        (to_stop(-momentum).max(-torque).min(0.0), to_stop(momentum).min(torque).max(0.0))
    }

    /// What the motors give of a command.
    fn motor_torques(&self, command: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::from_fn(|i, _| {
            let (least, largest) = self.torque_bounds(i);
            limited(command[i], least, largest)
        })
    }
}

impl<const N: usize> Actuation for ReactionWheels<N> {
    type Command = SVector<f64, N>;

    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<SVector<f64, N>, DynamicsError> {
        finite(wrench_body.to_vector())?;
        let torques = finite(self.sharing * wrench_body.torque)?;
        let part = |i: usize| {
            let (least, largest) = self.torque_bounds(i);
            let bound = if torques[i] > 0.0 { largest } else { least };
            if torques[i].abs() > bound.abs() { bound / torques[i] } else { 1.0 }
        };
        Ok(torques * (0..N).map(part).fold(1.0, f64::min))
    }

    fn realize(&self, command: &SVector<f64, N>) -> Wrench<f64> {
        Wrench::new(self.effectiveness * self.motor_torques(command), Vector3::zeros())
    }
}
