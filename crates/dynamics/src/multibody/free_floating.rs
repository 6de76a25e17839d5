use super::Multibody;
use super::kinematics::ToolJacobian;
use super::storage::JointStorage;
use crate::error::DynamicsError;
use tumble_lie::nalgebra::{Matrix6, Vector3, Vector6};
use tumble_lie::{Scalar, Twist, Wrench};

impl<T: Scalar, S: JointStorage> Multibody<T, S> {
    /// The twist of a free-floating base (nothing acts on the tree) whose joints move at `rates`.
    ///
    /// `momentum_base` is that of the whole tree about the base origin, base axes: [`Multibody::base_momentum`].
    /// # Errors
    /// [`DynamicsError::JointCount`]; [`DynamicsError::NotFinite`] for a tree without inertia.
    pub fn floating_base_twist(
        &self,
        positions: &[T],
        rates: &[T],
        momentum_base: &Wrench<T>,
    ) -> Result<Twist<T>, DynamicsError> {
        let mass_matrix = self.mass_matrix(positions)?;
        self.check_joints(&[rates])?;
        let joints = mass_matrix.coupling.as_ref().iter().zip(rates);
        let own = joints.fold(momentum_base.to_vector(), |left, (column, rate)| left - column * *rate);
        let inertia = mass_matrix.composite.spatial_inertia().cholesky().ok_or(DynamicsError::NotFinite)?;
        Ok(Twist::from(inertia.solve(&own)))
    }

    /// Twist of a point of body `index` per unit of joint rate while the base floats without momentum: the generalised
    /// Jacobian, whose inverse steers a free-floating arm. Columns in base axes; `base` is left zero.
    ///
    /// # Errors
    /// Those of [`Multibody::tool_jacobian`]; [`DynamicsError::NotFinite`] for a tree without inertia.
    pub fn free_floating_jacobian(
        &self,
        positions: &[T],
        index: usize,
        point_body: &Vector3<T>,
    ) -> Result<ToolJacobian<T, S>, DynamicsError> {
        let mut jacobian = self.tool_jacobian(positions, index, point_body)?;
        let mass_matrix = self.mass_matrix(positions)?;
        let inertia = mass_matrix.composite.spatial_inertia().cholesky().ok_or(DynamicsError::NotFinite)?;
        for (column, coupling) in jacobian.joints.as_mut().iter_mut().zip(mass_matrix.coupling.as_ref()) {
            let recoil: Vector6<T> = inertia.solve(coupling);
            *column -= jacobian.base * recoil;
        }
        jacobian.base = Matrix6::zeros();
        Ok(jacobian)
    }
}
