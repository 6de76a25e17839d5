//! What a motion can and cannot tell apart, in words.

use crate::body_scale::BodyScale;
use crate::consistency::PseudoInertiaCone;
use crate::dynamics::PARAMETER_NAMES;
use crate::jacobi::singular_values;
use crate::square_root_information::{RANK_TOLERANCE, SquareRootInformation};
use core::fmt;
use nalgebra::SVector;

/// Components below this fraction of the largest are left out of the words.
const NEGLIGIBLE: f64 = 1e-3;

/// Rank, condition and undetermined directions of the ten parameters, compared in units of the body's own size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observability {
    rank: usize,
    singular_values: SVector<f64, 10>,
    directions: [NullDirection; 10],
}

/// A change of the ten parameters that no measurement of this motion notices.
///
/// Displayed, it says so in words.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NullDirection {
    scaled: SVector<f64, 10>,
    scale: BodyScale,
}

impl Observability {
    /// Judges `information` with [`RANK_TOLERANCE`], right for exact data.
    pub fn new(information: &SquareRootInformation<10>, scale: BodyScale) -> Self {
        Self::with_tolerance(information, scale, RANK_TOLERANCE)
    }

    /// Judges `information`, counting a direction as undetermined below `tolerance` times the strongest.
    ///
    /// Noise in the regressor makes every direction look a little excited; its relative size is the tolerance to use.
    pub fn with_tolerance(information: &SquareRootInformation<10>, scale: BodyScale, tolerance: f64) -> Self {
        let (singular_values, right) = singular_values(information.scaled_factor(&scale.parameter_magnitudes()));
        let rank = singular_values.iter().filter(|&&s| s > tolerance * singular_values[0]).count();
        let mut directions = [NullDirection { scaled: SVector::zeros(), scale }; 10];
        for (direction, column) in directions.iter_mut().zip(right.column_iter().skip(rank)) {
            direction.scaled.copy_from(&column);
        }
        let mut observability = Self { rank, singular_values, directions };
        observability.sparsify();
        observability
    }

    /// Number of determined directions.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Singular values of R diag(m, mℓ, mℓ²), descending: for whitened rows, signal-to-noise ratios.
    pub fn singular_values(&self) -> &SVector<f64, 10> {
        &self.singular_values
    }

    /// Ratio of the largest to the smallest singular value; infinite below full rank.
    pub fn condition_number(&self) -> f64 {
        if self.rank < 10 { f64::INFINITY } else { self.singular_values[0] / self.singular_values[9] }
    }

    /// The undetermined directions, each written with as few parameters as possible.
    pub fn null_directions(&self) -> &[NullDirection] {
        self.directions.get(..10 - self.rank).unwrap_or(&[])
    }

    /// Gauss-Jordan elimination with full pivoting among the null directions: singular vectors of equal singular values
    /// are arbitrary mixtures, and a mixture explains nothing.
    fn sparsify(&mut self) {
        let count = 10 - self.rank;
        let mut used = [false; 10];
        for row in 0..count {
            let mut pivot = (row, 0, 0.0_f64);
            for candidate in row..count {
                for (k, value) in self.directions[candidate].scaled.iter().enumerate() {
                    if !used[k] && value.abs() > pivot.2.abs() {
                        pivot = (candidate, k, *value);
                    }
                }
            }
            let (candidate, k, value) = pivot;
            used[k] = true;
            self.directions.swap(row, candidate);
            self.directions[row].scaled /= value;
            let eliminator = self.directions[row].scaled;
            for (other, direction) in self.directions.iter_mut().enumerate().take(count) {
                if other != row {
                    let weight = direction.scaled[k];
                    direction.scaled -= eliminator * weight;
                }
            }
        }
        for direction in self.directions.iter_mut().take(count) {
            direction.scaled /= direction.scaled.amax();
        }
    }
}

impl NullDirection {
    /// The direction in SI units, Newton-Euler order.
    pub fn parameters(&self) -> SVector<f64, 10> {
        self.scaled.component_mul(&self.scale.parameter_magnitudes())
    }

    /// The direction in units of the body's size, largest component ±1.
    pub fn scaled(&self) -> &SVector<f64, 10> {
        &self.scaled
    }

    /// Whether the direction is a multiple of some inertia tensor and touches neither mass nor first moment.
    fn is_factor_of_inertia(&self) -> bool {
        let cone = PseudoInertiaCone::with_relative_floor(self.scale, 0.0);
        let second_moments = cone.normalized(&self.parameters()).fixed_view::<3, 3>(0, 0).into_owned();
        let eigenvalues = second_moments.symmetric_eigenvalues();
        let carries_mass = self.scaled.rows(0, 4).amax() > NEGLIGIBLE;
        !carries_mass && (eigenvalues.min() > NEGLIGIBLE || eigenvalues.max() < -NEGLIGIBLE)
    }
}

impl fmt::Display for NullDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_factor_of_inertia() {
            return f.write_str("the inertia is known up to a common factor only (no torque sets its scale)");
        }
        let largest = self.scaled.iamax();
        let mut others = self.scaled.iter().enumerate().filter(|&(k, value)| k != largest && value.abs() > NEGLIGIBLE);
        let what = match largest {
            0 => "",
            1..=3 => "first moment ",
            _ => "inertia ",
        };
        let name = PARAMETER_NAMES[largest];
        let Some(first) = others.next() else {
            let why = match largest {
                0 => "no acceleration of the body origin",
                1 => "no rotation about y or z and no acceleration along y or z",
                2 => "no rotation about x or z and no acceleration along x or z",
                3 => "no rotation about x or y and no acceleration along x or y",
                4 => "no rotation about x",
                5 => "no rotation about x or y",
                6 => "no rotation about x or z",
                7 => "no rotation about y",
                8 => "no rotation about y or z",
                _ => "no rotation about z",
            };
            return write!(f, "{what}{name} is not excited ({why})");
        };
        write!(f, "{what}{name} is exchangeable with")?;
        let scale = self.scale.parameter_magnitudes();
        let unit = self.scaled[largest] * scale[largest];
        for (k, value) in core::iter::once(first).chain(others) {
            write!(f, " {:+.3e} {}", value * scale[k] / unit, PARAMETER_NAMES[k])?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::strategies::body_d;
    use nalgebra::{SMatrix, Vector3};

    /// Newton-Euler regressor, rows [torque; force], written out here from equation (4.8).
    fn regressor(w: Vector3<f64>, wdot: Vector3<f64>, a: Vector3<f64>) -> SMatrix<f64, 6, 10> {
        let g = |w: Vector3<f64>| {
            SMatrix::<f64, 3, 6>::new(
                w.x, w.y, w.z, 0.0, 0.0, 0.0, 0.0, w.x, 0.0, w.y, w.z, 0.0, 0.0, 0.0, w.x, 0.0, w.y, w.z,
            )
        };
        let (sw, sdot) = (w.cross_matrix(), wdot.cross_matrix());
        let mut y = SMatrix::<f64, 6, 10>::zeros();
        y.fixed_view_mut::<3, 3>(0, 1).copy_from(&-a.cross_matrix());
        y.fixed_view_mut::<3, 6>(0, 4).copy_from(&(g(wdot) + sw * g(w)));
        y.fixed_view_mut::<3, 1>(3, 0).copy_from(&a);
        y.fixed_view_mut::<3, 3>(3, 1).copy_from(&(sdot + sw * sw));
        y
    }

    fn judge(
        rows: impl Fn(&SMatrix<f64, 6, 10>) -> SMatrix<f64, 6, 10>,
        rates: [f64; 3],
        accelerations: [f64; 3],
        scale: BodyScale,
    ) -> Observability {
        let mut information = SquareRootInformation::new();
        for k in 0..40 {
            let wave = |phase: f64| {
                Vector3::from_fn(|i, _| (0.7 * f64::from(k) * (1.0 + i as f64 * 0.37) + phase + i as f64).sin())
            };
            let (rates, accelerations) = (Vector3::from(rates), Vector3::from(accelerations));
            let block = regressor(
                wave(0.0).component_mul(&rates),
                wave(1.3).component_mul(&rates),
                wave(2.1).component_mul(&accelerations),
            );
            information.update(&rows(&block), &SVector::zeros()).unwrap();
        }
        Observability::new(&information, scale)
    }

    fn words(observability: &Observability) -> Vec<String> {
        let mut words: Vec<_> = observability.null_directions().iter().map(ToString::to_string).collect();
        words.sort();
        words
    }

    fn scale() -> BodyScale {
        BodyScale::try_new(5.0, 0.6).unwrap()
    }

    #[test]
    fn rich_motion_has_full_rank() {
        let all = judge(|b| *b, [1.0; 3], [1.0; 3], scale());
        assert_eq!(all.rank(), 10);
        assert!(all.null_directions().is_empty() && all.condition_number() < 100.0);
    }

    #[test]
    fn pure_translation_leaves_the_inertia() {
        let found = judge(|b| *b, [0.0; 3], [1.0; 3], scale());
        assert_eq!((found.rank(), found.condition_number()), (4, f64::INFINITY));
        let expected = [
            "inertia J_xx is not excited (no rotation about x)",
            "inertia J_xy is not excited (no rotation about x or y)",
            "inertia J_xz is not excited (no rotation about x or z)",
            "inertia J_yy is not excited (no rotation about y)",
            "inertia J_yz is not excited (no rotation about y or z)",
            "inertia J_zz is not excited (no rotation about z)",
        ];
        assert_eq!(words(&found), expected);
    }

    #[test]
    fn planar_motion_leaves_three_inertias() {
        let found = judge(|b| *b, [0.0, 0.0, 1.0], [1.0, 1.0, 0.0], scale());
        assert_eq!(found.rank(), 7);
        let expected = [
            "inertia J_xx is not excited (no rotation about x)",
            "inertia J_xy is not excited (no rotation about x or y)",
            "inertia J_yy is not excited (no rotation about y)",
        ];
        assert_eq!(words(&found), expected);
    }

    #[test]
    fn rotation_about_the_origin_leaves_the_mass() {
        let found = judge(|b| *b, [1.0; 3], [0.0; 3], scale());
        assert_eq!(found.rank(), 9);
        assert_eq!(words(&found), ["mass is not excited (no acceleration of the body origin)"]);
    }

    #[test]
    fn one_axis_of_translation_with_force_only_exchanges_nothing_it_measures() {
        // Force rows alone, constant acceleration along x, no rotation: only the mass.
        let found = judge(
            |b| {
                let mut b = *b;
                b.fixed_rows_mut::<3>(0).fill(0.0);
                b
            },
            [0.0; 3],
            [1.0, 0.0, 0.0],
            scale(),
        );
        assert_eq!(found.rank(), 1);
        assert_eq!(found.null_directions().len(), 9);
    }

    #[test]
    fn steady_spin_exchanges_mass_and_first_moment() {
        // The origin accelerates as if it circled a point 0.4 m away: a = −ω × (ω × c) with fixed c along x.
        let mut information = SquareRootInformation::new();
        for k in 1..20 {
            let w = Vector3::new(0.0, 0.0, 0.1 * f64::from(k));
            let a = Vector3::new(0.4 * w.z * w.z, 0.0, 0.0);
            information.update(&regressor(w, Vector3::zeros(), a), &SVector::zeros()).unwrap();
        }
        let found = Observability::new(&information, scale());
        let words = words(&found);
        assert!(words.iter().any(|w| w == "mass is exchangeable with +4.000e-1 h_x"), "{words:?}");
    }

    #[test]
    fn free_motion_leaves_two_scales() {
        // Accelerations of a free body satisfy γ p = 0 for the truth: free tumbling about the centre of mass.
        let body = body_d().to_vector();
        let at_origin = |w: Vector3<f64>| {
            // Solve the Newton-Euler equations for (ω̇, a) at zero wrench: linear in both.
            let offset = regressor(w, Vector3::zeros(), Vector3::zeros()) * body;
            let matrix = SMatrix::<f64, 6, 6>::from_fn(|i, j| {
                let unit = |j: usize, k: usize| if j == k { 1.0 } else { 0.0 };
                let wdot = Vector3::new(unit(j, 0), unit(j, 1), unit(j, 2));
                let a = Vector3::new(unit(j, 3), unit(j, 4), unit(j, 5));
                (regressor(Vector3::zeros(), wdot, a) * body)[i]
            });
            let rates = matrix.lu().solve(&-offset).unwrap();
            regressor(w, rates.fixed_rows::<3>(0).into(), rates.fixed_rows::<3>(3).into())
        };
        let mut information = SquareRootInformation::new();
        for k in 0..40 {
            let w = Vector3::from_fn(|i, _| (0.9 * f64::from(k) + i as f64).sin());
            information.update(&at_origin(w), &SVector::zeros()).unwrap();
        }
        let found = Observability::new(&information, scale());
        // Two scales are open: that of mass and first moment, and that of the inertia about the centre of mass.
        assert_eq!(found.rank(), 8);
        let words = words(&found);
        assert!(words.iter().any(|w| w.starts_with("mass is exchangeable with")), "{words:?}");
        assert!(words.iter().any(|w| w.starts_with("the inertia is known up to a common factor only")), "{words:?}");
        let (point_mass, inertia) = (mass_at_center(&body), body - mass_at_center(&body));
        for truth in [point_mass, inertia] {
            let basis = SMatrix::<f64, 10, 2>::from_columns(&[
                found.null_directions()[0].parameters(),
                found.null_directions()[1].parameters(),
            ]);
            let gram = basis.transpose() * basis;
            let fit = basis * gram.try_inverse().unwrap() * basis.transpose() * truth;
            assert!((fit - truth).amax() < 1e-11, "{:e}", (fit - truth).amax());
        }
    }

    /// All mass gathered in the centre of mass.
    fn mass_at_center(p: &SVector<f64, 10>) -> SVector<f64, 10> {
        let h = Vector3::new(p[1], p[2], p[3]);
        let j = (SMatrix::<f64, 3, 3>::identity() * h.norm_squared() - h * h.transpose()) / p[0];
        SVector::from([p[0], h.x, h.y, h.z, j[(0, 0)], j[(0, 1)], j[(0, 2)], j[(1, 1)], j[(1, 2)], j[(2, 2)]])
    }

    #[test]
    fn words_do_not_depend_on_units() {
        // Grams, millimetres and milliseconds describe the same planar motion.
        let si = judge(|b| *b, [0.0, 0.0, 1.0], [1.0, 1.0, 0.0], scale());
        let small = BodyScale::try_new(5e3, 0.6e3).unwrap();
        let other = judge(|b| *b, [0.0, 0.0, 1e-3], [1e-3, 1e-3, 0.0], small);
        assert_eq!(si.rank(), other.rank());
        assert_eq!(words(&si), words(&other));
    }
}
