//! Three-vectors, quaternions and 3x3 matrices as plain arrays: what the kernels of a step compute with.

/// A vector of three.
pub type V3 = [f64; 3];
/// A quaternion, the real part first, of any length.
pub type V4 = [f64; 4];
/// Three rows.
pub type M3 = [[f64; 3]; 3];

/// `a x b`.
#[inline(always)]
pub fn cross(a: &V3, b: &V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `a b`.
#[inline(always)]
pub fn dot(a: &V3, b: &V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a + factor b`.
#[inline(always)]
pub fn plus<const N: usize>(a: &[f64; N], factor: f64, b: &[f64; N]) -> [f64; N] {
    core::array::from_fn(|i| a[i] + factor * b[i])
}

/// `a += factor b`.
#[inline(always)]
pub fn add<const N: usize>(a: &mut [f64; N], factor: f64, b: &[f64; N]) {
    *a = plus(a, factor, b);
}

/// `a += factor b`.
#[inline(always)]
pub fn add_matrix(a: &mut M3, factor: f64, b: &M3) {
    for (a, b) in a.iter_mut().zip(b) {
        add(a, factor, b);
    }
}

/// `m a`.
#[inline(always)]
pub fn times(m: &M3, a: &V3) -> V3 {
    [dot(&m[0], a), dot(&m[1], a), dot(&m[2], a)]
}

/// `m' a`.
#[inline(always)]
pub fn transpose_times(m: &M3, a: &V3) -> V3 {
    core::array::from_fn(|i| m[0][i] * a[0] + m[1][i] * a[1] + m[2][i] * a[2])
}

/// `a b`.
#[inline(always)]
pub fn product(a: &M3, b: &M3) -> M3 {
    core::array::from_fn(|i| transpose_times(b, &a[i]))
}

/// Whether every entry is zero.
#[inline(always)]
pub fn is_zero(a: &V3) -> bool {
    a.iter().all(|x| *x == 0.0)
}

/// `S(a)` with `S(a) b = a x b`.
#[inline(always)]
pub fn skew(a: &V3) -> M3 {
    [[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]]
}

/// Matrix of `g -> (a g b* + b g a*) / 2`, a rotation by `a` where `a = b` is a unit quaternion.
#[inline(always)]
pub fn rotation(a: &V4, b: &V4) -> M3 {
    let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (*a, *b);
    let scale = a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3;
    let (s1, s2, s3) = (a0 * b1 + b0 * a1, a0 * b2 + b0 * a2, a0 * b3 + b0 * a3);
    let (d12, d13, d23) = (a1 * b2 + a2 * b1, a1 * b3 + a3 * b1, a2 * b3 + a3 * b2);
    [
        [scale + 2.0 * a1 * b1, d12 - s3, d13 + s2],
        [d12 + s3, scale + 2.0 * a2 * b2, d23 - s1],
        [d13 - s2, d23 + s1, scale + 2.0 * a3 * b3],
    ]
}
