//! The one scalar bound and the one tangent-vector bound of the workspace.

use core::fmt::Debug;
use core::ops::{Add, Index, IndexMut, Mul, Neg, Sub};
use nalgebra::{RealField, SVector};

/// A real number that may carry derivatives: `f32`, `f64`, dual numbers.
///
/// # Example
/// Written once, it runs on `f32`, on `f64`, and on dual numbers that carry derivatives along.
/// ```
/// use tumble_lie::Scalar;
///
/// fn hypotenuse<T: Scalar>(a: T, b: T) -> T {
///     (a * a + b * b).sqrt()
/// }
/// assert_eq!(hypotenuse(3.0_f32, 4.0), 5.0);
/// assert_eq!(hypotenuse(3.0_f64, 4.0), 5.0);
/// ```
/// Tutorial: [a group of your own, over any of them](https://github.com/tumble-robotics/tumble/blob/main/crates/lie/tests/suite/custom_group.rs).
pub trait Scalar: RealField + Copy {}
impl<T: RealField + Copy> Scalar for T {}

/// A literal in any scalar type.
#[inline(always)]
pub fn real<T: Scalar>(value: f64) -> T {
    nalgebra::convert(value)
}

/// The value of a scalar, without its derivatives, for decisions and reports.
#[inline(always)]
pub fn value<T: Scalar>(scalar: T) -> f64 {
    nalgebra::convert_unchecked(scalar)
}

/// A fixed number of real coordinates: the tangent vectors, inputs and parameters of the workspace.
///
/// # Example
/// ```
/// use tumble_lie::Coordinates;
/// use tumble_lie::nalgebra::Vector3;
///
/// let velocity = <Vector3<f64> as Coordinates<f64>>::from_fn(|i| [3.0, 4.0, 0.0][i]);
/// assert_eq!(velocity.euclidean_norm(), 5.0);
/// ```
/// Tutorial: [the coordinates of two things as one](https://github.com/tumble-robotics/tumble/blob/main/crates/lie/src/product.rs).
pub trait Coordinates<T: Scalar>:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + Mul<T, Output = Self>
    + Index<usize, Output = T>
    + IndexMut<usize>
{
    /// Number of coordinates.
    const DIM: usize;
    /// The vector whose coordinate `i` is `component(i)`.
    fn from_fn(component: impl FnMut(usize) -> T) -> Self;
    /// The zero vector.
    fn zero() -> Self {
        Self::from_fn(|_| T::zero())
    }
    /// Euclidean norm of the coordinates, whatever their units.
    fn euclidean_norm(&self) -> T {
        let mut sum = T::zero();
        for i in 0..Self::DIM {
            sum += self[i] * self[i];
        }
        sum.sqrt()
    }
}

impl<T: Scalar, const N: usize> Coordinates<T> for SVector<T, N> {
    const DIM: usize = N;
    fn from_fn(mut component: impl FnMut(usize) -> T) -> Self {
        SVector::from_fn(|i, _| component(i))
    }
}
