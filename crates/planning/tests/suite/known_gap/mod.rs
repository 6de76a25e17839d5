//! Pairs of ellipsoids whose gap is known to 30 digits, by arithmetic and algorithms of its own.
//!
//! A pair is made to touch at a chosen point with a chosen normal and then moved to the wanted gap; as the numbers of the
//! pair are rounded, its true gap is then certified anew, by the plane from below and by a common point from above.
#![allow(dead_code, missing_docs, clippy::unwrap_used)]

use std::ops::{Add, Mul, Sub};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::noise::{signed_unit, unit_interval};
use tumble_planning::collision::{Ellipsoid, Separation};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// A number as the sum of two `f64`.
#[derive(Clone, Copy, Debug)]
pub struct Wide(pub f64, pub f64);

impl From<f64> for Wide {
    fn from(value: f64) -> Self {
        Self(value, 0.0)
    }
}

fn renormalised(large: f64, small: f64) -> Wide {
    let sum = large + small;
    let back = sum - large;
    Wide(sum, (large - (sum - back)) + (small - back))
}

impl Add for Wide {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (high, low) = (renormalised(self.0, other.0), renormalised(self.1, other.1));
        let once = renormalised(high.0, high.1 + low.0);
        renormalised(once.0, once.1 + low.1)
    }
}

impl Sub for Wide {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + Self(-other.0, -other.1)
    }
}

impl Mul for Wide {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let high = self.0 * other.0;
        let low = self.0.mul_add(other.0, -high);
        renormalised(high, low + self.0.mul_add(other.1, self.1 * other.0))
    }
}

impl Wide {
    pub fn reciprocal(self) -> Self {
        let mut guess = Self::from(1.0 / self.0);
        for _ in 0..2 {
            guess = guess + guess * (Self::from(1.0) - self * guess);
        }
        guess
    }

    pub fn root(self) -> Self {
        if self.0 <= 0.0 {
            return Self::from(0.0);
        }
        let mut guess = Self::from(self.0.sqrt());
        for _ in 0..2 {
            guess = (guess + self * guess.reciprocal()) * Self::from(0.5);
        }
        guess
    }
}

pub type WideVector = [Wide; 3];
pub type WideMatrix = [[Wide; 3]; 3];

pub fn wide_vector(vector: &Vector3<f64>) -> WideVector {
    [0, 1, 2].map(|i| vector[i].into())
}

/// By rows.
pub fn wide_matrix(matrix: &Matrix3<f64>) -> WideMatrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| matrix[(i, j)].into()))
}

pub fn dot(left: &WideVector, right: &WideVector) -> Wide {
    left[0] * right[0] + left[1] * right[1] + left[2] * right[2]
}

pub fn times(matrix: &WideMatrix, vector: &WideVector) -> WideVector {
    [0, 1, 2].map(|i| dot(&matrix[i], vector))
}

pub fn transposed(matrix: &WideMatrix) -> WideMatrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| matrix[j][i]))
}

pub fn product(left: &WideMatrix, right: &WideMatrix) -> WideMatrix {
    let columns = transposed(right);
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| dot(&left[i], &columns[j])))
}

fn length(vector: &WideVector) -> Wide {
    dot(vector, vector).root()
}

pub fn less(left: &WideVector, right: &WideVector) -> WideVector {
    [0, 1, 2].map(|i| left[i] - right[i])
}

/// By how much of their own size a plane with this normal keeps the solids apart; negative where it does not.
pub fn gap_along(a: &Ellipsoid, b: &Ellipsoid, normal: &Vector3<f64>) -> f64 {
    let normal = wide_vector(normal);
    let between = less(&wide_vector(b.center()), &wide_vector(a.center()));
    let reach = |solid: &Ellipsoid| length(&times(&transposed(&wide_matrix(solid.factor())), &normal));
    let both = reach(a) + reach(b);
    ((dot(&normal, &between) - both) * both.reciprocal()).0
}

/// How deep a point near `center of a + L_a of_a` and `center of b - L_b of_b` is in both as a share of their size: what is left
/// to both unit balls. The one of the solid that is thicker is corrected until both are the same point.
pub fn depth(a: &Ellipsoid, b: &Ellipsoid, of_a: &Vector3<f64>, of_b: &Vector3<f64>) -> f64 {
    let between = less(&wide_vector(b.center()), &wide_vector(a.center()));
    let ((thick, of_thick), (thin, of_thin)) =
        if a.semi_axes().min() > b.semi_axes().min() { ((a, of_a), (b, of_b)) } else { ((b, of_b), (a, of_a)) };
    let (factor, squares) = (wide_matrix(thick.factor()), thick.semi_axes().component_mul(thick.semi_axes()));
    let (mut of_thick, of_thin) = (wide_vector(of_thick), wide_vector(of_thin));
    let target = less(&between, &times(&wide_matrix(thin.factor()), &of_thin));
    for _ in 0..3 {
        let rest = less(&target, &times(&factor, &of_thick)).map(|entry| entry.0);
        let step = thick.factor().tr_mul(&Vector3::from(rest)).component_div(&squares);
        of_thick = [0, 1, 2].map(|i| of_thick[i] + step[i].into());
    }
    let one = Wide::from(1.0);
    (one - length(&of_thick)).0.min((one - length(&of_thin)).0)
}

/// The contact function's maximum by its definition, `max s (1 - s) d' ((1 - s) A + s B)^-1 d`, by golden section and
/// elimination; factors by rows.
pub fn contact_function(factor_a: &WideMatrix, factor_b: &WideMatrix, between: &WideVector) -> Wide {
    let shape = |factor: &WideMatrix| product(factor, &transposed(factor));
    let (shape_a, shape_b) = (shape(factor_a), shape(factor_b));
    let value = |share: f64| {
        let (share, rest) = (Wide::from(share), Wide::from(1.0) - share.into());
        let mut rows = [0, 1, 2].map(|i| [0, 1, 2].map(|j| rest * shape_a[i][j] + share * shape_b[i][j]));
        let mut right = *between;
        let mut form = Wide::from(0.0);
        for pivot in 0..3 {
            let inverse = rows[pivot][pivot].reciprocal();
            form = form + right[pivot] * right[pivot] * inverse;
            for below in pivot + 1..3 {
                let factor = rows[below][pivot] * inverse;
                let above = rows[pivot];
                for (entry, of_pivot) in rows[below].iter_mut().zip(above) {
                    *entry = *entry - factor * of_pivot;
                }
                right[below] = right[below] - factor * right[pivot];
            }
        }
        share * rest * form
    };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.0, 1.0);
    let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_left, mut at_right) = (value(left), value(right));
    for _ in 0..75 {
        if (at_left - at_right).0 < 0.0 {
            low = left;
            (left, at_left) = (right, at_right);
            right = low + golden * (high - low);
            at_right = value(right);
        } else {
            high = right;
            (right, at_right) = (left, at_left);
            left = high - golden * (high - low);
            at_left = value(left);
        }
    }
    if (at_left - at_right).0 < 0.0 { at_right } else { at_left }
}

pub fn vector(generator: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| signed_unit(generator))
}

/// Uniform on the sphere.
pub fn direction(generator: &mut ChaCha8Rng) -> Vector3<f64> {
    loop {
        let drawn = vector(generator);
        if drawn.norm_squared() <= 1.0 && drawn.norm_squared() > 1e-6 {
            return drawn.normalize();
        }
    }
}

/// Uniform over the attitudes; every eighth is none.
pub fn attitude(generator: &mut ChaCha8Rng) -> UnitQuaternion<f64> {
    if unit_interval(generator) < 0.125 {
        return UnitQuaternion::identity();
    }
    loop {
        let drawn = vector(generator);
        let quaternion = Quaternion::from_parts(signed_unit(generator), drawn);
        if quaternion.norm_squared() <= 1.0 && quaternion.norm_squared() > 1e-6 {
            return UnitQuaternion::from_quaternion(quaternion);
        }
    }
}

/// Semi-axes of a plate, a needle, a ball or anything between, within `axis_ratio`.
fn semi_axes(generator: &mut ChaCha8Rng, size: f64, axis_ratio: f64) -> Vector3<f64> {
    let thin = 1.0 / axis_ratio;
    let kind = unit_interval(generator);
    let axes = if kind < 0.15 {
        Vector3::new(1.0, 1.0, thin)
    } else if kind < 0.3 {
        Vector3::new(1.0, thin, thin)
    } else if kind < 0.35 {
        Vector3::repeat(1.0)
    } else {
        Vector3::from_fn(|_, _| thin.powf(unit_interval(generator)))
    };
    axes * size
}

/// A random ellipsoid about a centre.
pub fn solid(generator: &mut ChaCha8Rng, center: Vector3<f64>, size: f64, axis_ratio: f64) -> Ellipsoid {
    let axes = semi_axes(generator, size, axis_ratio);
    Ellipsoid::try_new(&Pose::from_parts(center.into(), attitude(generator)), &axes).unwrap()
}

/// A pair and its certified relative gap: by how much both solids must grow about their centres to touch, at least (positive,
/// apart), or may shrink, at least (negative, overlapping); zero where neither is certain.
pub struct Known {
    pub a: Ellipsoid,
    pub b: Ellipsoid,
    pub gap: f64,
}

/// A pair that touches, then moved to about `gap`.
pub fn known(generator: &mut ChaCha8Rng, axis_ratio: f64, size_ratio: f64, gap: f64) -> Known {
    let spread = signed_unit(generator);
    let center = vector(generator);
    let a = solid(generator, center, 1.0, axis_ratio);
    let axes_b = semi_axes(generator, size_ratio.powf(spread), axis_ratio);
    let attitude_b = attitude(generator);
    let place =
        |center: Vector3<f64>| Ellipsoid::try_new(&Pose::from_parts(center.into(), attitude_b), &axes_b).unwrap();
    let unplaced = place(Vector3::zeros());
    let of_a = direction(generator);
    // The normal at L_a u is L_a^-T u, and L_a^-T = L_a diag(1 / axes^2).
    let normal = a.factor() * of_a.component_div(&a.semi_axes().component_mul(a.semi_axes()));
    let of_b = unplaced.factor().tr_mul(&normal).normalize();
    let growth = 1.0 + gap;
    let center = a.center() + (a.factor() * of_a + unplaced.factor() * of_b) * growth;
    let b = place(center);
    let apart = gap_along(&a, &b, &normal);
    let gap = if apart > 0.0 { apart } else { -depth(&a, &b, &(of_a * growth), &(of_b * growth)).max(0.0) };
    Known { a, b, gap }
}

/// The pose that a solid was made with, its attitude but for rounding.
pub fn pose(solid: &Ellipsoid) -> Pose<f64> {
    let mut rotation = *solid.factor();
    for (mut column, axis) in rotation.column_iter_mut().zip(solid.semi_axes()) {
        column /= *axis;
    }
    Pose::from_parts((*solid.center()).into(), UnitQuaternion::from_matrix(&rotation))
}

/// Counts of a study, by decades of the gap from 1 down to 1e-16.
#[derive(Clone, Debug, Default)]
pub struct Table {
    pub pairs: [u64; 17],
    pub missed_collisions: [u64; 17],
    pub false_alarms: [u64; 17],
    /// Pairs nearer than what could be certified.
    pub unknown: u64,
    /// Planes that do not separate.
    pub wrong_planes: u64,
    /// Points that are not in both solids, by more than rounding.
    pub wrong_points: u64,
}

impl Table {
    pub fn mistakes_from(&self, gap: f64) -> u64 {
        let decades = decade(gap);
        (0..=decades).map(|i| self.missed_collisions[i] + self.false_alarms[i]).sum()
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
pub fn decade(gap: f64) -> usize {
    // 1e-12 itself belongs to the decade that it begins.
    (-(gap.abs() * 1.000_001).log10()).ceil().clamp(0.0, 16.0) as usize
}

/// Whether a point lies in a solid but for the rounding of its coordinates.
pub fn holds(solid: &Ellipsoid, point: &Vector3<f64>) -> bool {
    let axes = solid.semi_axes();
    let seen = solid.factor().tr_mul(&(point - solid.center())).component_div(&axes.component_mul(axes));
    let rounding = 8.0 * f64::EPSILON * (point.amax() + solid.center().amax() + axes.max()) / axes.min();
    seen.norm() <= 1.0 + rounding
}

impl Table {
    /// Judges one answer: the decision and what it is said to be proven by.
    pub fn record(&mut self, pair: &Known, found: &Separation) {
        match found {
            Separation::Apart(plane) => {
                self.wrong_planes += u64::from(gap_along(&pair.a, &pair.b, &plane.normal) <= 0.0);
            }
            Separation::Overlapping(point) => {
                self.wrong_points += u64::from(pair.gap < 0.0 && !(holds(&pair.a, point) && holds(&pair.b, point)));
            }
        }
        // The certificates of the reference do not resolve less than this.
        if pair.gap.abs() < 1e-25 {
            self.unknown += 1;
            return;
        }
        let row = decade(pair.gap);
        self.pairs[row] += 1;
        let is_apart = matches!(found, Separation::Apart(_));
        self.missed_collisions[row] += u64::from(is_apart && pair.gap < 0.0);
        self.false_alarms[row] += u64::from(!is_apart && pair.gap > 0.0);
    }
}

/// Judges `decide` on `runs` pairs whose gaps are spread over the decades from 1 to 1e-14, on both sides.
pub fn study(
    runs: u64,
    axis_ratio: f64,
    size_ratio: f64,
    seed: u64,
    decide: impl Fn(&Ellipsoid, &Ellipsoid) -> Separation,
) -> Table {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let mut table = Table::default();
    for run in 0..runs {
        let size = 10.0_f64.powf(-14.0 * unit_interval(&mut generator));
        let gap = if run % 2 == 0 { size } else { -size };
        let pair = known(&mut generator, axis_ratio, size_ratio, gap);
        table.record(&pair, &decide(&pair.a, &pair.b));
    }
    table
}
