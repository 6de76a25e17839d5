//! Tutorial: bring your own feasible set. Three steps: implement, check the laws, solve.
//!
//! The set here is a box around three parameters, say two masses and a length known from a data sheet to a tolerance.
#![allow(clippy::unwrap_used)]

use nalgebra::{SMatrix, SVector};
use tumble_identification::laws::{check_constrained_solver, check_feasible_set};
use tumble_identification::{Barrier, BarrierNewton, ConstrainedLeastSquares, FeasibleSet, SquareRootInformation};

struct DataSheet {
    nominal: SVector<f64, 3>,
    tolerance: SVector<f64, 3>,
}

impl DataSheet {
    /// Distances to the upper and lower bound, in tolerances.
    fn slack(&self, p: &SVector<f64, 3>) -> (SVector<f64, 3>, SVector<f64, 3>) {
        let offset = (p - self.nominal).component_div(&self.tolerance);
        (offset.map(|x| 1.0 - x), offset.map(|x| 1.0 + x))
    }
}

// Step 1: say how far inside a point is, and give a barrier with its derivatives.
impl FeasibleSet<3> for DataSheet {
    fn margin(&self, p: &SVector<f64, 3>) -> f64 {
        let (above, below) = self.slack(p);
        above.min().min(below.min())
    }
    fn barrier(&self, p: &SVector<f64, 3>) -> Option<Barrier<3>> {
        let (above, below) = self.slack(p);
        (self.margin(p) > 0.0).then(|| Barrier {
            value: -above.iter().chain(below.iter()).map(|s| s.ln()).sum::<f64>(),
            gradient: SVector::from_fn(|i, _| (1.0 / above[i] - 1.0 / below[i]) / self.tolerance[i]),
            hessian: SMatrix::from_diagonal(&SVector::<f64, 3>::from_fn(|i, _| {
                (above[i].powi(-2) + below[i].powi(-2)) / self.tolerance[i].powi(2)
            })),
        })
    }
    fn barrier_parameter(&self) -> f64 {
        6.0 // half-spaces
    }
    fn interior_point(&self) -> SVector<f64, 3> {
        self.nominal
    }
    fn magnitudes(&self) -> SVector<f64, 3> {
        self.nominal
    }
}

#[test]
fn a_box_of_ones_own() {
    let set = DataSheet { nominal: SVector::from([10.0, 2.0, 0.5]), tolerance: SVector::from([1.0, 0.5, 0.01]) };

    // Step 2: the laws.
    let points = [[10.5, 2.1, 0.499], [13.0, 2.0, 0.5], [9.0, 1.0, 0.7]].map(SVector::from);
    check_feasible_set(&set, &points, 1e-5).unwrap();

    // Step 3: solve. The measurements are independent here, so that the answer is the clipped measurement.
    let mut information = SquareRootInformation::<3>::new();
    information.add_prior(&SVector::from([12.0, 2.2, 0.3]), &SVector::from([0.1, 0.1, 0.1])).unwrap();
    let solver = BarrierNewton::new(&set);
    check_constrained_solver(&solver, &set, &[information], 1e-6).unwrap();
    let estimate = solver.solve(&information).unwrap();
    assert!((estimate.parameters - SVector::from([11.0, 2.2, 0.49])).amax() < 1e-6);
    assert!(estimate.is_active());
}
