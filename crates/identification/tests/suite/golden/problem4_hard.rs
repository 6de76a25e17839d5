//! Reader of `problem4_hard.csv`, shared by tests and benches.

use nalgebra::{SMatrix, SVector};
use tumble_identification::{BodyScale, PseudoInertiaCone, SquareRootInformation};

/// The updates of the recursion at which the constraint binds.
pub fn problems() -> Vec<SquareRootInformation<10>> {
    include_str!("problem4_hard.csv")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let mut numbers = line.split(',').skip(1).map(|cell| cell.parse::<f64>().expect("a number"));
            let mut factor = SMatrix::<f64, 10, 10>::zeros();
            for i in 0..10 {
                for j in i..10 {
                    factor[(i, j)] = numbers.next().expect("55 entries of R");
                }
            }
            let rhs = SVector::<f64, 10>::from_iterator(numbers);
            SquareRootInformation::from_square_root(&factor, &rhs).expect("finite numbers")
        })
        .collect()
}

/// P(p) ≥ 1e-6 I about a body of a few kilograms and half a metre.
pub fn cone() -> PseudoInertiaCone {
    PseudoInertiaCone::with_absolute_floor(BodyScale::try_new(5.0, 0.8).expect("a valid scale"), 1e-6)
}
