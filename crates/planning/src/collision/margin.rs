//! A margin between two ellipsoids that an optimiser can differentiate twice.

use super::Ellipsoid;
use super::contact_function::Pair;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// A margin and its derivatives by (centre of a, attitude of a, centre of b, attitude of b).
///
/// Attitudes are small rotations `theta` on the right, about the ellipsoid's own axes: `R exp(theta)`; the second derivatives
/// are those of this chart at `theta = 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalingMargin {
    /// `g - 1`, where both solids grown about their centres by the factor `g` touch: zero at contact, negative overlapping,
    /// -1 where the centres are the same.
    pub value: f64,
    /// First derivatives, 1/m and 1/rad.
    pub gradient: SVector<f64, 12>,
    /// Second derivatives, symmetric.
    pub hessian: SMatrix<f64, 12, 12>,
}

/// Below this growth the centres count as the same: its square and their inverses are still ordinary numbers.
const CONCENTRIC: f64 = 1e-60;

/// The margin between two solids.
///
/// `g` is the square root of the contact function, a norm of the vector between the centres: smooth everywhere but where that
/// is zero (`g` below 1e-60). There the gradient returned is zero, which is one of its subgradients, and so is the Hessian;
/// near there the gradient keeps its size and the Hessian grows as one over the distance. Derivatives err by about 1e-16 times
/// the cube of the larger semi-axis ratio, relative to the largest of their kind.
///
/// # Source
/// Envelope theorem for the first derivatives, implicit function theorem for the second, by the weight `t` of
/// [`super::separation`]'s contact function `t / (1 + t) d' (A + t B)^-1 d`.
pub fn scaling_margin(a: &Ellipsoid, b: &Ellipsoid) -> ScalingMargin {
    let concentric = ScalingMargin { value: -1.0, gradient: SVector::zeros(), hessian: SMatrix::zeros() };
    let between = b.center() - a.center();
    let reach = |solid: &Ellipsoid| f64::sqrt(solid.factor().tr_mul(&between).norm_squared());
    // A quotient that underflows or of zeros is no number and fails this.
    let first = reach(a) / reach(b);
    if !(first > 0.0 && first < f64::MAX) {
        return concentric;
    }
    let pair = Pair::<f64>::new(a, b, 1.0);
    let found = pair.balanced(first);
    let normal = Vector3::from(found.normal);
    let weight = found.weight;
    let (square_a, square_b) = (found.square_a, found.square_b);
    let growth = normal.dot(&between) / (f64::sqrt(square_a) + f64::sqrt(square_b));
    if !(growth > CONCENTRIC && growth < f64::MAX) {
        return concentric;
    }

    let (turn_a, turn_b) = (Turn::new(a, &found.pulled_a), Turn::new(b, &found.pulled_b));
    let [xx, xy, xz, yy, yz, zz] = found.adjugate.map(|entry| entry * found.inverse_determinant);
    let inverse = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let image_b = Vector3::from(found.image_b);

    // By d, theta_a, theta_b, and without the factor t / (1 + t): F_p = 2 n' y - n' dM n, with y = dd - dM n.
    let (turned_a, turned_b) = (turn_a.image, turn_b.image * weight);
    let (slope_a, slope_b) = (turn_a.slope, turn_b.slope * weight);
    let first_derivative = Nine { d: normal * 2.0, a: -slope_a, b: -slope_b };

    // M^-1 times y's columns.
    let (solved_a, solved_b) = (inverse * turned_a, inverse * turned_b);
    let (aa, bb) = (turned_a.tr_mul(&solved_a), turned_b.tr_mul(&solved_b));
    let ab = turned_a.tr_mul(&solved_b);

    // By t, F_p changes as below, and F_t by the curvature, which F_t = 0 simplifies.
    let drift = -(inverse * image_b);
    let shrink = 1.0 / (weight * (1.0 + weight));
    let mixed = Nine {
        d: first_derivative.d * shrink + drift * 2.0,
        a: first_derivative.a * shrink - turned_a.tr_mul(&drift) * 2.0,
        b: first_derivative.b * shrink - turned_b.tr_mul(&drift) * 2.0 - turn_b.slope,
    };
    let curvature = -2.0 * (square_b / weight - found.curvature_b());

    // With q = t / (1 + t): d2 g = q / (2 g) (d2 F - F_tp F_tp' / F_tt) - dg dg' / g, where F is without q.
    let share = weight / (1.0 + weight);
    let by_growth = share / (2.0 * growth);
    let gradient = first_derivative.times(by_growth);
    // Of solids so unlike that rounding hides the curvature, what the weight adds is beyond knowing.
    let of_mixed = if curvature < 0.0 { -by_growth / curvature } else { 0.0 };
    let of_gradient = -1.0 / growth;
    let block = |base: Matrix3<f64>, left: fn(&Nine) -> &Vector3<f64>, right: fn(&Nine) -> &Vector3<f64>| {
        base * by_growth
            + (left(&mixed) * of_mixed) * right(&mixed).transpose()
            + (left(&gradient) * of_gradient) * right(&gradient).transpose()
    };
    let dd = block(inverse * 2.0, |nine| &nine.d, |nine| &nine.d);
    let da = block(solved_a * -2.0, |nine| &nine.d, |nine| &nine.a);
    let db = block(solved_b * -2.0, |nine| &nine.d, |nine| &nine.b);
    let aa = block(aa * 2.0 - turn_a.bend, |nine| &nine.a, |nine| &nine.a);
    let ab = block(ab * 2.0, |nine| &nine.a, |nine| &nine.b);
    let bb = block(bb * 2.0 - turn_b.bend * weight, |nine| &nine.b, |nine| &nine.b);

    // Rounded alike on both sides of the diagonal.
    let [dd, aa, bb] = [dd, aa, bb].map(|block| (block + block.transpose()) * 0.5);

    let mut margin = ScalingMargin { value: growth - 1.0, ..concentric };
    margin.gradient.fixed_rows_mut::<3>(0).copy_from(&-gradient.d);
    margin.gradient.fixed_rows_mut::<3>(3).copy_from(&gradient.a);
    margin.gradient.fixed_rows_mut::<3>(6).copy_from(&gradient.d);
    margin.gradient.fixed_rows_mut::<3>(9).copy_from(&gradient.b);
    // Solids unlike in size by 1e16 or so: nothing is left of their curvatures.
    let sum = [dd, da, db, aa, ab, bb].map(|block| block.sum()).iter().sum::<f64>();
    if !sum.is_finite() {
        return margin;
    }
    let rows = [
        [dd, -da, -dd, -db],
        [-da.transpose(), aa, da.transpose(), ab],
        [-dd, da, dd, db],
        [-db.transpose(), ab.transpose(), db.transpose(), bb],
    ];
    for (row, blocks) in rows.iter().enumerate() {
        for (column, block) in blocks.iter().enumerate() {
            margin.hessian.fixed_view_mut::<3, 3>(3 * row, 3 * column).copy_from(block);
        }
    }
    margin
}

/// Derivatives by `d`, the attitude of a and that of b.
struct Nine {
    d: Vector3<f64>,
    a: Vector3<f64>,
    b: Vector3<f64>,
}

impl Nine {
    fn times(&self, factor: f64) -> Self {
        Self { d: self.d * factor, a: self.a * factor, b: self.b * factor }
    }
}

/// How `A n` and `n' A n` change as the solid turns, `n` held.
struct Turn {
    /// `dA n = image theta`.
    image: Matrix3<f64>,
    /// `n' dA n = slope . theta`.
    slope: Vector3<f64>,
    /// `n' d2A n = theta' bend theta`.
    bend: Matrix3<f64>,
}

impl Turn {
    /// From `L' n`. With `m = R' n` and `D` the squared semi-axes, `A n` turned is `R exp(theta) D exp(-theta) m`.
    #[inline(always)]
    fn new(solid: &Ellipsoid, pulled: &[f64; 3]) -> Self {
        let axes = solid.semi_axes();
        let [x, y, z] = [pulled[0] / axes.x, pulled[1] / axes.y, pulled[2] / axes.z];
        let [aa, bb, cc] = [axes.x * axes.x, axes.y * axes.y, axes.z * axes.z];
        let (ab, bc, ca) = (aa - bb, bb - cc, cc - aa);
        // D [m]x - [D m]x, its rows divided by the semi-axes that the factor's columns have too much.
        let turned = Matrix3::new(
            0.0,
            ca * z / axes.x,
            ab * y / axes.x,
            bc * z / axes.y,
            0.0,
            ab * x / axes.y,
            bc * y / axes.z,
            ca * x / axes.z,
            0.0,
        );
        let (xy, xz, yz) = ((bc - ca) * x * y, (ab - bc) * x * z, (ca - ab) * y * z);
        let bend = Matrix3::new(
            2.0 * bc * (z * z - y * y),
            xy,
            xz,
            xy,
            2.0 * ca * (x * x - z * z),
            yz,
            xz,
            yz,
            2.0 * ab * (y * y - x * x),
        );
        let slope = Vector3::new(bc * y * z, ca * z * x, ab * x * y) * 2.0;
        Self { image: solid.factor() * turned, slope, bend }
    }
}
