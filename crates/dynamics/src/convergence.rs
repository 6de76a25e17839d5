//! When an iteration has done all that rounding allows.

use tumble_lie::{Coordinates, Scalar};

/// Watches an iteration until no component of its iterate comes closer any more.
///
/// Components carry different units, so each is judged against its own history and not against a tolerance.
pub(crate) struct Rest<V> {
    smallest: Option<V>,
    last: V,
}

impl<V> Rest<V> {
    pub(crate) fn new<T: Scalar>() -> Self
    where
        V: Coordinates<T>,
    {
        Self { smallest: None, last: V::zero() }
    }

    /// Whether the change from `old` to `new` is zero or rounding in every component.
    pub(crate) fn reached<T: Scalar>(&mut self, old: &V, new: &V) -> bool
    where
        V: Coordinates<T>,
    {
        let change = V::from_fn(|i| (new[i] - old[i]).abs());
        let largest = (0..V::DIM).fold(T::zero(), |largest, i| largest.max(new[i].abs()));
        // Growing changes are rest only where they are small: otherwise the iteration diverges.
        let small = largest * T::default_epsilon().sqrt();
        let rested = self.smallest.is_some_and(|smallest| {
            (0..V::DIM).all(|i| change[i] <= small && (change[i] >= smallest[i] || change[i] == T::zero()))
        });
        self.smallest = Some(match self.smallest {
            None => change,
            Some(smallest) => V::from_fn(|i| smallest[i].min(change[i])),
        });
        self.last = change;
        rested
    }

    pub(crate) fn last_change<T: Scalar>(&self) -> T
    where
        V: Coordinates<T>,
    {
        self.last.euclidean_norm()
    }
}
