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

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_lie::nalgebra::Vector2;

    /// Iterations until rest, none within a thousand.
    fn iterations(start: Vector2<f64>, next: impl Fn(&Vector2<f64>) -> Vector2<f64>) -> Option<usize> {
        let (mut x, mut rest) = (start, Rest::new());
        (0..1000).find(|_| {
            let moved = next(&x);
            let rested = rest.reached(&x, &moved);
            x = moved;
            rested
        })
    }

    #[test]
    fn contractions_rest_whatever_their_units() {
        // Newton's method for square roots in two units twenty decades apart
        let root = |a: f64| move |x: f64| 0.5 * (x + a / x);
        let (large, small) = (root(2e20), root(3e-20));
        assert!(iterations(Vector2::new(1e10, 1e-10), |x| Vector2::new(large(x.x), small(x.y))).unwrap() < 12);
        assert!(iterations(Vector2::new(1.0, -3.0), |x| Vector2::new(0.5 * x.y + 1.0, 0.4 * x.x - 1.0)).unwrap() < 120);
    }

    #[test]
    fn divergence_and_cycles_never_rest() {
        assert_eq!(iterations(Vector2::new(1.0, 2.0), |x| x * 1.5), None);
        assert_eq!(iterations(Vector2::new(1.0, 2.0), |x| -x), None);
        assert_eq!(iterations(Vector2::new(1.0, f64::NAN), |x| x * 0.5), None);
    }
}
