//! The direct product of two groups: a pose and the joints of an arm, two bodies, a pose and a clock offset.

use crate::group::LieGroup;
use crate::scalar::{Coordinates, Scalar};
use core::ops::{Add, Index, IndexMut, Mul, Neg, Sub};

/// An element of the direct product: every operation acts on the two parts alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Product<G, H> {
    /// Element of the first group.
    pub first: G,
    /// Element of the second group.
    pub second: H,
}

/// Coordinates of the first part, then of the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stacked<A, B> {
    /// Leading coordinates.
    pub first: A,
    /// Trailing coordinates.
    pub second: B,
}

/// A linear map of [`Stacked`] coordinates that does not mix the parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockDiagonal<A, B> {
    /// Map of the leading coordinates.
    pub first: A,
    /// Map of the trailing coordinates.
    pub second: B,
}

impl<G, H> Product<G, H> {
    /// From the two parts.
    pub fn new(first: G, second: H) -> Self {
        Self { first, second }
    }
}

impl<A, B> Stacked<A, B> {
    /// From the two parts.
    pub fn new(first: A, second: B) -> Self {
        Self { first, second }
    }
}

impl<G: Mul<Output = G>, H: Mul<Output = H>> Mul for Product<G, H> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { first: self.first * other.first, second: self.second * other.second }
    }
}

macro_rules! part_by_part {
    ($name:ident: $($operator:ident $function:ident),*) => {$(
        impl<A: $operator<Output = A>, B: $operator<Output = B>> $operator for $name<A, B> {
            type Output = Self;
            fn $function(self, other: Self) -> Self {
                Self { first: self.first.$function(other.first), second: self.second.$function(other.second) }
            }
        }
    )*};
}
part_by_part!(Stacked: Add add, Sub sub);
part_by_part!(BlockDiagonal: Mul mul, Sub sub);

impl<A: Neg<Output = A>, B: Neg<Output = B>> Neg for Stacked<A, B> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { first: -self.first, second: -self.second }
    }
}
impl<T: Scalar, A: Mul<T, Output = A>, B: Mul<T, Output = B>> Mul<T> for Stacked<A, B> {
    type Output = Self;
    fn mul(self, factor: T) -> Self {
        Self { first: self.first * factor, second: self.second * factor }
    }
}
impl<T: Scalar, A, B> Index<usize> for Stacked<A, B>
where
    A: Coordinates<T> + Index<usize, Output = T>,
    B: Coordinates<T>,
{
    type Output = T;
    #[inline]
    #[allow(clippy::indexing_slicing, reason = "the parts answer for their own range")]
    fn index(&self, i: usize) -> &T {
        if i < A::DIM { &self.first[i] } else { &self.second[i - A::DIM] }
    }
}
impl<T: Scalar, A, B> IndexMut<usize> for Stacked<A, B>
where
    A: Coordinates<T> + Index<usize, Output = T>,
    B: Coordinates<T>,
{
    #[inline]
    #[allow(clippy::indexing_slicing, reason = "the parts answer for their own range")]
    fn index_mut(&mut self, i: usize) -> &mut T {
        if i < A::DIM { &mut self.first[i] } else { &mut self.second[i - A::DIM] }
    }
}
impl<T: Scalar, A, B> Coordinates<T> for Stacked<A, B>
where
    A: Coordinates<T> + Index<usize, Output = T>,
    B: Coordinates<T>,
{
    const DIM: usize = A::DIM + B::DIM;
    fn from_fn(mut component: impl FnMut(usize) -> T) -> Self {
        let first = A::from_fn(&mut component);
        Self { first, second: B::from_fn(|i| component(A::DIM + i)) }
    }
}

impl<A, B, C, D> Mul<Stacked<C, D>> for BlockDiagonal<A, B>
where
    A: Mul<C, Output = C>,
    B: Mul<D, Output = D>,
{
    type Output = Stacked<C, D>;
    fn mul(self, vector: Stacked<C, D>) -> Stacked<C, D> {
        Stacked { first: self.first * vector.first, second: self.second * vector.second }
    }
}

impl<T: Scalar, G, H> LieGroup for Product<G, H>
where
    G: LieGroup<Scalar = T>,
    H: LieGroup<Scalar = T>,
{
    type Scalar = T;
    type Tangent = Stacked<<G as LieGroup>::Tangent, <H as LieGroup>::Tangent>;
    type Jacobian = BlockDiagonal<G::Jacobian, H::Jacobian>;
    fn identity() -> Self {
        Self { first: G::identity(), second: H::identity() }
    }
    fn inverse(&self) -> Self {
        Self { first: self.first.inverse(), second: self.second.inverse() }
    }
    fn exp(xi: &Self::Tangent) -> Self {
        Self { first: G::exp(&xi.first), second: H::exp(&xi.second) }
    }
    fn log(&self) -> Self::Tangent {
        Stacked { first: self.first.log(), second: self.second.log() }
    }
    fn adjoint(&self) -> Self::Jacobian {
        BlockDiagonal { first: self.first.adjoint(), second: self.second.adjoint() }
    }
    fn coadjoint(&self) -> Self::Jacobian {
        BlockDiagonal { first: self.first.coadjoint(), second: self.second.coadjoint() }
    }
    fn bracket(a: &Self::Tangent, b: &Self::Tangent) -> Self::Tangent {
        Stacked { first: G::bracket(&a.first, &b.first), second: H::bracket(&a.second, &b.second) }
    }
    fn dual_bracket(a: &Self::Tangent, mu: &Self::Tangent) -> Self::Tangent {
        Stacked { first: G::dual_bracket(&a.first, &mu.first), second: H::dual_bracket(&a.second, &mu.second) }
    }
    fn right_jacobian(xi: &Self::Tangent) -> Self::Jacobian {
        BlockDiagonal { first: G::right_jacobian(&xi.first), second: H::right_jacobian(&xi.second) }
    }
    fn right_jacobian_inverse(xi: &Self::Tangent) -> Self::Jacobian {
        BlockDiagonal { first: G::right_jacobian_inverse(&xi.first), second: H::right_jacobian_inverse(&xi.second) }
    }
}
