//! Packing orders of the ten inertial parameters.

use tumble_lie::Scalar;
use tumble_lie::nalgebra::{SMatrix, SVector};

/// Number of inertial parameters of a rigid body.
pub const PARAMETERS: usize = 10;

/// Names in the packing order of [`InertialParameters::to_vector`](crate::InertialParameters::to_vector).
pub const PARAMETER_NAMES: [&str; PARAMETERS] =
    ["mass", "h_x", "h_y", "h_z", "J_xx", "J_xy", "J_xz", "J_yy", "J_yz", "J_zz"];

/// Units in the packing order of [`InertialParameters::to_vector`](crate::InertialParameters::to_vector).
pub const PARAMETER_UNITS: [&str; PARAMETERS] =
    ["kg", "kg m", "kg m", "kg m", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2"];

/// The order in which someone writes the same ten numbers: mass, first moment, inertia about the origin.
///
/// ```
/// use tumble_dynamics::{InertialParameters, ParameterOrder};
/// let sphere = InertialParameters::<f64>::solid_sphere(5.0, 0.2);
/// let chapter_5 = ParameterOrder::DualQuaternion.pack(&sphere.to_vector());
/// assert_eq!(chapter_5[9], 5.0); // the mass comes last there
/// assert_eq!(ParameterOrder::DualQuaternion.unpack(&chapter_5), sphere.to_vector());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ParameterOrder {
    /// `[m, h_x, h_y, h_z, J11, J12, J13, J22, J23, J33]`, used throughout. Thesis (4.9).
    NewtonEuler,
    /// `[J11, J12, J13, J22, J23, J33, h_x, h_y, h_z, m]`. Thesis (5.29).
    DualQuaternion,
    /// `[m, h_x, h_y, h_z, J11, J12, J22, J13, J23, J33]`, the triangle row by row, as Pinocchio's dynamic parameters.
    LowerTriangle,
    /// `[m, h_x, h_y, h_z, J11, J22, J33, J12, J13, J23]`, the order of MuJoCo's `fullinertia` and of the text of
    /// thesis chapter 5.
    DiagonalFirst,
}

impl ParameterOrder {
    /// Place `i` of this order holds entry `indices()[i]` of the Newton-Euler order.
    pub const fn indices(self) -> [usize; PARAMETERS] {
        match self {
            Self::NewtonEuler => [0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
            Self::DualQuaternion => [4, 5, 6, 7, 8, 9, 1, 2, 3, 0],
            Self::LowerTriangle => [0, 1, 2, 3, 4, 5, 7, 6, 8, 9],
            Self::DiagonalFirst => [0, 1, 2, 3, 4, 7, 9, 5, 6, 8],
        }
    }

    /// From the Newton-Euler order to this one.
    pub fn pack<T: Scalar>(self, newton_euler: &SVector<T, PARAMETERS>) -> SVector<T, PARAMETERS> {
        let indices = self.indices();
        SVector::from_fn(|i, _| newton_euler[indices[i]])
    }

    /// From this order to the Newton-Euler order.
    pub fn unpack<T: Scalar>(self, packed: &SVector<T, PARAMETERS>) -> SVector<T, PARAMETERS> {
        let mut newton_euler = SVector::zeros();
        for (i, &place) in self.indices().iter().enumerate() {
            newton_euler[place] = packed[i];
        }
        newton_euler
    }

    /// A covariance or information matrix from the Newton-Euler order to this one.
    pub fn pack_covariance<T: Scalar>(
        self,
        newton_euler: &SMatrix<T, PARAMETERS, PARAMETERS>,
    ) -> SMatrix<T, PARAMETERS, PARAMETERS> {
        let indices = self.indices();
        SMatrix::from_fn(|i, j| newton_euler[(indices[i], indices[j])])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_written_as_their_sources_write_them() {
        let p = SVector::<f64, 10>::from([5.0, 0.1, 0.2, 0.3, 11.0, 12.0, 13.0, 22.0, 23.0, 33.0]);
        let cases = [
            (ParameterOrder::NewtonEuler, [5.0, 0.1, 0.2, 0.3, 11.0, 12.0, 13.0, 22.0, 23.0, 33.0]),
            (ParameterOrder::DualQuaternion, [11.0, 12.0, 13.0, 22.0, 23.0, 33.0, 0.1, 0.2, 0.3, 5.0]),
            (ParameterOrder::LowerTriangle, [5.0, 0.1, 0.2, 0.3, 11.0, 12.0, 22.0, 13.0, 23.0, 33.0]),
            (ParameterOrder::DiagonalFirst, [5.0, 0.1, 0.2, 0.3, 11.0, 22.0, 33.0, 12.0, 13.0, 23.0]),
        ];
        for (order, expected) in cases {
            assert_eq!(order.pack(&p), SVector::from(expected), "{order:?}");
            assert_eq!(order.unpack(&order.pack(&p)), p, "{order:?}");
            let packed = order.pack_covariance(&(p * p.transpose()));
            assert_eq!(packed, order.pack(&p) * order.pack(&p).transpose(), "{order:?}");
        }
    }
}
