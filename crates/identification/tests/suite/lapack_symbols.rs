//! The eleven BLAS and LAPACK routines that Clarabel's semidefinite cone calls, under their Fortran names.
//!
//! For the tests of `tumble-identification` only: a program that links a real BLAS would have every symbol twice.
//! Small matrices are the target. Eigenvalues come from cyclic Jacobi and singular values from one-sided Jacobi, both
//! accurate to high relative precision without workspace; the workspace arguments of the ABI are ignored.
//!
//! The Fortran ABI passes everything by pointer, column-major, which is why this module, and only this one, is unsafe.
#![allow(unsafe_code)]
// The signatures and the safety contract (valid pointers, consistent dimensions) are those of the reference library.
#![allow(clippy::too_many_arguments, clippy::missing_safety_doc)]
// Negated comparisons catch NaN; loops over indices read like the formulas.
#![allow(clippy::neg_cmp_op_on_partial_ord, clippy::needless_range_loop)]
// Dimensions and flags arrive as C integers; they are sizes of small matrices.
#![allow(clippy::cast_sign_loss, clippy::cast_possible_truncation, clippy::cast_possible_wrap)]

use core::ffi::{c_char, c_int};

/// The two precisions.
trait Real:
    Copy
    + PartialOrd
    + core::ops::Add<Output = Self>
    + core::ops::Sub<Output = Self>
    + core::ops::Mul<Output = Self>
    + core::ops::Div<Output = Self>
    + core::ops::Neg<Output = Self>
{
    const ZERO: Self;
    const ONE: Self;
    const EPS: Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn of(i: usize) -> Self;
}
macro_rules! real {
    ($t:ty) => {
        impl Real for $t {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const EPS: Self = <$t>::EPSILON;
            fn sqrt(self) -> Self {
                <$t>::sqrt(self)
            }
            fn abs(self) -> Self {
                <$t>::abs(self)
            }
            fn of(i: usize) -> Self {
                i as $t
            }
        }
    };
}
real!(f32);
real!(f64);

fn yes(c: *const c_char, what: u8) -> bool {
    (unsafe { *c } as u8).eq_ignore_ascii_case(&what)
}
unsafe fn size(p: *const c_int) -> usize {
    (unsafe { *p }) as usize
}

/// Column-major view.
#[derive(Clone, Copy)]
struct ColumnMajor<T> {
    p: *mut T,
    ld: usize,
}
impl<T: Copy> ColumnMajor<T> {
    unsafe fn new(p: *const T, ld: *const c_int) -> Self {
        Self { p: p.cast_mut(), ld: unsafe { size(ld) } }
    }
    fn get(&self, i: usize, j: usize) -> T {
        unsafe { *self.p.add(i + j * self.ld) }
    }
    fn set(&self, i: usize, j: usize, v: T) {
        unsafe { *self.p.add(i + j * self.ld) = v }
    }
}
fn axpby<T: Real>(alpha: T, ab: T, beta: T, c: T) -> T {
    // BLAS semantics: beta == 0 means that C is not read
    if beta == T::ZERO { alpha * ab } else { alpha * ab + beta * c }
}

unsafe fn gemm<T: Real>(
    ta: *const c_char,
    tb: *const c_char,
    m: *const c_int,
    n: *const c_int,
    k: *const c_int,
    alpha: *const T,
    a: *const T,
    lda: *const c_int,
    b: *const T,
    ldb: *const c_int,
    beta: *const T,
    c: *mut T,
    ldc: *const c_int,
) {
    unsafe {
        let (m, n, k) = (size(m), size(n), size(k));
        let (a_view, b_view, c_view) = (ColumnMajor::new(a, lda), ColumnMajor::new(b, ldb), ColumnMajor::new(c, ldc));
        let (ta, tb) = (!yes(ta, b'N'), !yes(tb, b'N'));
        for j in 0..n {
            for i in 0..m {
                let mut s = T::ZERO;
                for l in 0..k {
                    s = s
                        + (if ta { a_view.get(l, i) } else { a_view.get(i, l) })
                            * (if tb { b_view.get(j, l) } else { b_view.get(l, j) });
                }
                let old = if *beta == T::ZERO { T::ZERO } else { c_view.get(i, j) };
                c_view.set(i, j, axpby(*alpha, s, *beta, old));
            }
        }
    }
}
unsafe fn gemv<T: Real>(
    t: *const c_char,
    m: *const c_int,
    n: *const c_int,
    alpha: *const T,
    a: *const T,
    lda: *const c_int,
    x: *const T,
    incx: *const c_int,
    beta: *const T,
    y: *mut T,
    incy: *const c_int,
) {
    unsafe {
        let (m, n, ix, iy) = (size(m), size(n), size(incx), size(incy));
        let a_view = ColumnMajor::new(a, lda);
        let t = !yes(t, b'N');
        let (rows, cols) = if t { (n, m) } else { (m, n) };
        for i in 0..rows {
            let mut s = T::ZERO;
            for j in 0..cols {
                s = s + (if t { a_view.get(j, i) } else { a_view.get(i, j) }) * *x.add(j * ix);
            }
            let old = if *beta == T::ZERO { T::ZERO } else { *y.add(i * iy) };
            *y.add(i * iy) = axpby(*alpha, s, *beta, old);
        }
    }
}
unsafe fn symv<T: Real>(
    uplo: *const c_char,
    n: *const c_int,
    alpha: *const T,
    a: *const T,
    lda: *const c_int,
    x: *const T,
    incx: *const c_int,
    beta: *const T,
    y: *mut T,
    incy: *const c_int,
) {
    unsafe {
        let (n, ix, iy, up, a_view) = (size(n), size(incx), size(incy), yes(uplo, b'U'), ColumnMajor::new(a, lda));
        for i in 0..n {
            let mut s = T::ZERO;
            for j in 0..n {
                s = s + (if (i <= j) == up || i == j { a_view.get(i, j) } else { a_view.get(j, i) }) * *x.add(j * ix);
            }
            let old = if *beta == T::ZERO { T::ZERO } else { *y.add(i * iy) };
            *y.add(i * iy) = axpby(*alpha, s, *beta, old);
        }
    }
}
unsafe fn syr2k_any<T: Real>(
    uplo: *const c_char,
    trans: *const c_char,
    n: *const c_int,
    k: *const c_int,
    alpha: *const T,
    a_view: ColumnMajor<T>,
    b_view: Option<ColumnMajor<T>>,
    beta: *const T,
    c: *mut T,
    ldc: *const c_int,
) {
    unsafe {
        let (n, k, up, nt, c_view) = (size(n), size(k), yes(uplo, b'U'), yes(trans, b'N'), ColumnMajor::new(c, ldc));
        let e = |x_view: ColumnMajor<T>, i: usize, l: usize| if nt { x_view.get(i, l) } else { x_view.get(l, i) };
        for j in 0..n {
            let (lo, hi) = if up { (0, j + 1) } else { (j, n) };
            for i in lo..hi {
                let mut s = T::ZERO;
                for l in 0..k {
                    s = match b_view {
                        None => s + e(a_view, i, l) * e(a_view, j, l),
                        Some(b_view) => s + e(a_view, i, l) * e(b_view, j, l) + e(b_view, i, l) * e(a_view, j, l),
                    };
                }
                let old = if *beta == T::ZERO { T::ZERO } else { c_view.get(i, j) };
                c_view.set(i, j, axpby(*alpha, s, *beta, old));
            }
        }
    }
}
unsafe fn syrk<T: Real>(
    uplo: *const c_char,
    trans: *const c_char,
    n: *const c_int,
    k: *const c_int,
    alpha: *const T,
    a: *const T,
    lda: *const c_int,
    beta: *const T,
    c: *mut T,
    ldc: *const c_int,
) {
    unsafe { syr2k_any(uplo, trans, n, k, alpha, ColumnMajor::new(a, lda), None, beta, c, ldc) }
}
unsafe fn syr2k<T: Real>(
    uplo: *const c_char,
    trans: *const c_char,
    n: *const c_int,
    k: *const c_int,
    alpha: *const T,
    a: *const T,
    lda: *const c_int,
    b: *const T,
    ldb: *const c_int,
    beta: *const T,
    c: *mut T,
    ldc: *const c_int,
) {
    unsafe {
        syr2k_any(uplo, trans, n, k, alpha, ColumnMajor::new(a, lda), Some(ColumnMajor::new(b, ldb)), beta, c, ldc);
    }
}
unsafe fn potrf<T: Real>(uplo: *const c_char, n: *const c_int, a: *mut T, lda: *const c_int, info: *mut c_int) {
    unsafe {
        let (n, up, a_view) = (size(n), yes(uplo, b'U'), ColumnMajor::new(a, lda));
        // L(i,j), j <= i, lives at (i,j) or, for the upper variant, at (j,i)
        let g = |i: usize, j: usize| if up { a_view.get(j, i) } else { a_view.get(i, j) };
        let s = |i: usize, j: usize, v: T| if up { a_view.set(j, i, v) } else { a_view.set(i, j, v) };
        *info = 0;
        for j in 0..n {
            let mut d = g(j, j);
            for k in 0..j {
                d = d - g(j, k) * g(j, k);
            }
            if !(d > T::ZERO) {
                *info = (j + 1) as c_int;
                return;
            }
            let d = d.sqrt();
            s(j, j, d);
            for i in j + 1..n {
                let mut v = g(i, j);
                for k in 0..j {
                    v = v - g(i, k) * g(j, k);
                }
                s(i, j, v / d);
            }
        }
    }
}
unsafe fn potrs<T: Real>(
    uplo: *const c_char,
    n: *const c_int,
    nrhs: *const c_int,
    a: *const T,
    lda: *const c_int,
    b: *mut T,
    ldb: *const c_int,
    info: *mut c_int,
) {
    unsafe {
        let (n, r, up, a_view, b_view) =
            (size(n), size(nrhs), yes(uplo, b'U'), ColumnMajor::new(a, lda), ColumnMajor::new(b, ldb));
        let g = |i: usize, j: usize| if up { a_view.get(j, i) } else { a_view.get(i, j) };
        for c in 0..r {
            for i in 0..n {
                let mut v = b_view.get(i, c);
                for k in 0..i {
                    v = v - g(i, k) * b_view.get(k, c);
                }
                b_view.set(i, c, v / g(i, i));
            }
            for i in (0..n).rev() {
                let mut v = b_view.get(i, c);
                for k in i + 1..n {
                    v = v - g(k, i) * b_view.get(k, c);
                }
                b_view.set(i, c, v / g(i, i));
            }
        }
        *info = 0;
    }
}
unsafe fn gesv<T: Real>(
    n: *const c_int,
    nrhs: *const c_int,
    a: *mut T,
    lda: *const c_int,
    ipiv: *mut c_int,
    b: *mut T,
    ldb: *const c_int,
    info: *mut c_int,
) {
    unsafe {
        let (n, r, a_view, b_view) = (size(n), size(nrhs), ColumnMajor::new(a, lda), ColumnMajor::new(b, ldb));
        *info = 0;
        for k in 0..n {
            let mut p = k;
            for i in k + 1..n {
                if a_view.get(i, k).abs() > a_view.get(p, k).abs() {
                    p = i;
                }
            }
            *ipiv.add(k) = (p + 1) as c_int;
            if a_view.get(p, k) == T::ZERO {
                *info = (k + 1) as c_int;
                return;
            }
            if p != k {
                for j in 0..n {
                    let (x, y) = (a_view.get(k, j), a_view.get(p, j));
                    a_view.set(k, j, y);
                    a_view.set(p, j, x);
                }
                for j in 0..r {
                    let (x, y) = (b_view.get(k, j), b_view.get(p, j));
                    b_view.set(k, j, y);
                    b_view.set(p, j, x);
                }
            }
            for i in k + 1..n {
                let f = a_view.get(i, k) / a_view.get(k, k);
                a_view.set(i, k, f);
                for j in k + 1..n {
                    a_view.set(i, j, a_view.get(i, j) - f * a_view.get(k, j));
                }
                for j in 0..r {
                    b_view.set(i, j, b_view.get(i, j) - f * b_view.get(k, j));
                }
            }
        }
        for j in 0..r {
            for i in (0..n).rev() {
                let mut v = b_view.get(i, j);
                for k in i + 1..n {
                    v = v - a_view.get(i, k) * b_view.get(k, j);
                }
                b_view.set(i, j, v / a_view.get(i, i));
            }
        }
    }
}

/// Rotation (c, s) that annihilates the off-diagonal of [[app, apq], [apq, aqq]].
fn jacobi<T: Real>(app: T, apq: T, aqq: T) -> (T, T) {
    let theta = (aqq - app) / (T::of(2) * apq);
    let t = T::ONE / (theta.abs() + (T::ONE + theta * theta).sqrt());
    let t = if theta < T::ZERO { -t } else { t };
    let c = T::ONE / (T::ONE + t * t).sqrt();
    (c, c * t)
}

unsafe fn syevr<T: Real>(
    jobz: *const c_char,
    _range: *const c_char,
    uplo: *const c_char,
    n: *const c_int,
    a: *mut T,
    lda: *const c_int,
    _vl: *const T,
    _vu: *const T,
    _il: *const c_int,
    _iu: *const c_int,
    _abstol: *const T,
    m: *mut c_int,
    w: *mut T,
    z: *mut T,
    ldz: *const c_int,
    _isuppz: *mut c_int,
    work: *mut T,
    lwork: *const c_int,
    iwork: *mut c_int,
    _liwork: *const c_int,
    info: *mut c_int,
) {
    unsafe {
        *info = 0;
        if *lwork == -1 {
            *work = T::ONE;
            *iwork = 1;
            return;
        }
        let (n, up, a_view, vecs) = (size(n), yes(uplo, b'U'), ColumnMajor::new(a, lda), yes(jobz, b'V'));
        let mut s: Vec<T> = (0..n * n)
            .map(|k| {
                let (i, j) = (k % n, k / n);
                if (i <= j) == up || i == j { a_view.get(i, j) } else { a_view.get(j, i) }
            })
            .collect();
        let mut v: Vec<T> = (0..n * n).map(|k| if k % n == k / n { T::ONE } else { T::ZERO }).collect();
        for _sweep in 0..60 {
            let mut off = T::ZERO;
            for p in 0..n {
                for q in p + 1..n {
                    let apq = s[p + q * n];
                    let scale = (s[p + p * n].abs() * s[q + q * n].abs()).sqrt();
                    if apq == T::ZERO || (scale + apq.abs()) == scale {
                        continue;
                    }
                    off = off + apq.abs();
                    let (c, sn) = jacobi(s[p + p * n], apq, s[q + q * n]);
                    for k in 0..n {
                        let (x, y) = (s[k + p * n], s[k + q * n]);
                        s[k + p * n] = c * x - sn * y;
                        s[k + q * n] = sn * x + c * y;
                    }
                    for k in 0..n {
                        let (x, y) = (s[p + k * n], s[q + k * n]);
                        s[p + k * n] = c * x - sn * y;
                        s[q + k * n] = sn * x + c * y;
                    }
                    for k in 0..n {
                        let (x, y) = (v[k + p * n], v[k + q * n]);
                        v[k + p * n] = c * x - sn * y;
                        v[k + q * n] = sn * x + c * y;
                    }
                }
            }
            if off == T::ZERO {
                break;
            }
        }
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&i, &j| s[i + i * n].partial_cmp(&s[j + j * n]).unwrap_or(core::cmp::Ordering::Equal));
        for (k, &i) in order.iter().enumerate() {
            *w.add(k) = s[i + i * n];
            if vecs {
                let z_view = ColumnMajor::new(z, ldz);
                for r in 0..n {
                    z_view.set(r, k, v[r + i * n]);
                }
            }
        }
        *m = n as c_int;
    }
}

/// Economy SVD by one-sided Jacobi on the taller of a_view and A'.
unsafe fn svd<T: Real>(
    m: *const c_int,
    n: *const c_int,
    a: *mut T,
    lda: *const c_int,
    s: *mut T,
    uu: *mut T,
    ldu: *const c_int,
    vt: *mut T,
    ldvt: *const c_int,
    work: *mut T,
    lwork: *const c_int,
    info: *mut c_int,
) {
    unsafe {
        *info = 0;
        if *lwork == -1 {
            *work = T::ONE;
            return;
        }
        let (m, n, a_view, u_view, vt_view) =
            (size(m), size(n), ColumnMajor::new(a, lda), ColumnMajor::new(uu, ldu), ColumnMajor::new(vt, ldvt));
        let tall = m >= n;
        let (r, c) = if tall { (m, n) } else { (n, m) };
        let mut g: Vec<T> = (0..r * c)
            .map(|k| {
                let (i, j) = (k % r, k / r);
                if tall { a_view.get(i, j) } else { a_view.get(j, i) }
            })
            .collect();
        let mut v: Vec<T> = (0..c * c).map(|k| if k % c == k / c { T::ONE } else { T::ZERO }).collect();
        for _sweep in 0..60 {
            let mut rotated = false;
            for p in 0..c {
                for q in p + 1..c {
                    let (mut al, mut be, mut ga) = (T::ZERO, T::ZERO, T::ZERO);
                    for k in 0..r {
                        let (x, y) = (g[k + p * r], g[k + q * r]);
                        al = al + x * x;
                        be = be + y * y;
                        ga = ga + x * y;
                    }
                    if ga == T::ZERO || ga.abs() <= T::EPS * (al * be).sqrt() {
                        continue;
                    }
                    rotated = true;
                    let (cs, sn) = jacobi(al, ga, be);
                    for k in 0..r {
                        let (x, y) = (g[k + p * r], g[k + q * r]);
                        g[k + p * r] = cs * x - sn * y;
                        g[k + q * r] = sn * x + cs * y;
                    }
                    for k in 0..c {
                        let (x, y) = (v[k + p * c], v[k + q * c]);
                        v[k + p * c] = cs * x - sn * y;
                        v[k + q * c] = sn * x + cs * y;
                    }
                }
            }
            if !rotated {
                break;
            }
        }
        let norm: Vec<T> = (0..c)
            .map(|j| {
                let mut t = T::ZERO;
                for k in 0..r {
                    t = t + g[k + j * r] * g[k + j * r];
                }
                t.sqrt()
            })
            .collect();
        let mut order: Vec<usize> = (0..c).collect();
        order.sort_by(|&i, &j| norm[j].partial_cmp(&norm[i]).unwrap_or(core::cmp::Ordering::Equal));
        let mut basis: Vec<T> = Vec::with_capacity(r * c);
        for (k, &j) in order.iter().enumerate() {
            *s.add(k) = norm[j];
            let mut col: Vec<T> =
                if norm[j] > T::ZERO { (0..r).map(|i| g[i + j * r] / norm[j]).collect() } else { vec![T::ZERO; r] };
            if !(norm[j] > T::ZERO) {
                // complete the basis: the unit vector with the largest residual after projection
                let mut best = T::ZERO;
                for e in 0..r {
                    let mut t: Vec<T> = (0..r).map(|i| if i == e { T::ONE } else { T::ZERO }).collect();
                    for _ in 0..2 {
                        for b in 0..k {
                            let mut d = T::ZERO;
                            for i in 0..r {
                                d = d + basis[i + b * r] * t[i];
                            }
                            for i in 0..r {
                                t[i] = t[i] - d * basis[i + b * r];
                            }
                        }
                    }
                    let mut nn = T::ZERO;
                    for &x in &t {
                        nn = nn + x * x;
                    }
                    let nn = nn.sqrt();
                    if nn > best {
                        best = nn;
                        col = t.iter().map(|&x| x / nn).collect();
                    }
                }
            }
            for i in 0..r {
                if tall { u_view.set(i, k, col[i]) } else { vt_view.set(k, i, col[i]) }
            }
            for i in 0..c {
                if tall { vt_view.set(k, i, v[i + j * c]) } else { u_view.set(i, k, v[i + j * c]) }
            }
            basis.extend(col);
        }
    }
}

macro_rules! export {
    ($t:ty, $gemm:ident $gemv:ident $symv:ident $syrk:ident $syr2k:ident $potrf:ident $potrs:ident $gesv:ident $gesdd:ident $gesvd:ident $syevr:ident) => {
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gemm(
            ta: *const c_char,
            tb: *const c_char,
            m: *const c_int,
            n: *const c_int,
            k: *const c_int,
            al: *const $t,
            a: *const $t,
            lda: *const c_int,
            b: *const $t,
            ldb: *const c_int,
            be: *const $t,
            c: *mut $t,
            ldc: *const c_int,
        ) {
            unsafe { gemm(ta, tb, m, n, k, al, a, lda, b, ldb, be, c, ldc) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gemv(
            t: *const c_char,
            m: *const c_int,
            n: *const c_int,
            al: *const $t,
            a: *const $t,
            lda: *const c_int,
            x: *const $t,
            ix: *const c_int,
            be: *const $t,
            y: *mut $t,
            iy: *const c_int,
        ) {
            unsafe { gemv(t, m, n, al, a, lda, x, ix, be, y, iy) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $symv(
            uplo: *const c_char,
            n: *const c_int,
            al: *const $t,
            a: *const $t,
            lda: *const c_int,
            x: *const $t,
            ix: *const c_int,
            be: *const $t,
            y: *mut $t,
            iy: *const c_int,
        ) {
            unsafe { symv(uplo, n, al, a, lda, x, ix, be, y, iy) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syrk(
            uplo: *const c_char,
            t: *const c_char,
            n: *const c_int,
            k: *const c_int,
            al: *const $t,
            a: *const $t,
            lda: *const c_int,
            be: *const $t,
            c: *mut $t,
            ldc: *const c_int,
        ) {
            unsafe { syrk(uplo, t, n, k, al, a, lda, be, c, ldc) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syr2k(
            uplo: *const c_char,
            t: *const c_char,
            n: *const c_int,
            k: *const c_int,
            al: *const $t,
            a: *const $t,
            lda: *const c_int,
            b: *const $t,
            ldb: *const c_int,
            be: *const $t,
            c: *mut $t,
            ldc: *const c_int,
        ) {
            unsafe { syr2k(uplo, t, n, k, al, a, lda, b, ldb, be, c, ldc) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $potrf(
            uplo: *const c_char,
            n: *const c_int,
            a: *mut $t,
            lda: *const c_int,
            info: *mut c_int,
        ) {
            unsafe { potrf(uplo, n, a, lda, info) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $potrs(
            uplo: *const c_char,
            n: *const c_int,
            nrhs: *const c_int,
            a: *const $t,
            lda: *const c_int,
            b: *mut $t,
            ldb: *const c_int,
            info: *mut c_int,
        ) {
            unsafe { potrs(uplo, n, nrhs, a, lda, b, ldb, info) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesv(
            n: *const c_int,
            nrhs: *const c_int,
            a: *mut $t,
            lda: *const c_int,
            ipiv: *mut c_int,
            b: *mut $t,
            ldb: *const c_int,
            info: *mut c_int,
        ) {
            unsafe { gesv(n, nrhs, a, lda, ipiv, b, ldb, info) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesdd(
            _j: *const c_char,
            m: *const c_int,
            n: *const c_int,
            a: *mut $t,
            lda: *const c_int,
            s: *mut $t,
            uu: *mut $t,
            ldu: *const c_int,
            vt: *mut $t,
            ldvt: *const c_int,
            work: *mut $t,
            lwork: *const c_int,
            _iw: *mut c_int,
            info: *mut c_int,
        ) {
            unsafe { svd(m, n, a, lda, s, uu, ldu, vt, ldvt, work, lwork, info) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesvd(
            _j: *const c_char,
            _k: *const c_char,
            m: *const c_int,
            n: *const c_int,
            a: *mut $t,
            lda: *const c_int,
            s: *mut $t,
            uu: *mut $t,
            ldu: *const c_int,
            vt: *mut $t,
            ldvt: *const c_int,
            work: *mut $t,
            lwork: *const c_int,
            info: *mut c_int,
        ) {
            unsafe { svd(m, n, a, lda, s, uu, ldu, vt, ldvt, work, lwork, info) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syevr(
            j: *const c_char,
            r: *const c_char,
            uplo: *const c_char,
            n: *const c_int,
            a: *mut $t,
            lda: *const c_int,
            vl: *const $t,
            vu: *const $t,
            il: *const c_int,
            iu: *const c_int,
            ab: *const $t,
            m: *mut c_int,
            w: *mut $t,
            z: *mut $t,
            ldz: *const c_int,
            isz: *mut c_int,
            work: *mut $t,
            lwork: *const c_int,
            iw: *mut c_int,
            liw: *const c_int,
            info: *mut c_int,
        ) {
            unsafe { syevr(j, r, uplo, n, a, lda, vl, vu, il, iu, ab, m, w, z, ldz, isz, work, lwork, iw, liw, info) }
        }
    };
}
export!(f32, sgemm_ sgemv_ ssymv_ ssyrk_ ssyr2k_ spotrf_ spotrs_ sgesv_ sgesdd_ sgesvd_ ssyevr_);
export!(f64, dgemm_ dgemv_ dsymv_ dsyrk_ dsyr2k_ dpotrf_ dpotrs_ dgesv_ dgesdd_ dgesvd_ dsyevr_);

#[cfg(test)]
// The borrows of a call live as long as the call.
#[allow(clippy::borrow_as_ptr)]
mod tests {
    use super::*;
    use core::ptr::null;

    const N: c_int = 3;

    fn flag(c: u8) -> c_char {
        c as c_char
    }

    fn multiply(a: &[f64; 9], b: &[f64; 9], transpose_b: bool) -> [f64; 9] {
        let mut c = [f64::NAN; 9];
        let (ta, tb) = (flag(b'N'), flag(if transpose_b { b'T' } else { b'N' }));
        // SAFETY: three 3×3 arrays and their true dimensions.
        unsafe {
            dgemm_(&ta, &tb, &N, &N, &N, &1.0, a.as_ptr(), &N, b.as_ptr(), &N, &0.0, c.as_mut_ptr(), &N);
        }
        c
    }

    fn near(a: &[f64], b: &[f64]) {
        assert_eq!(a.len(), b.len());
        for (x, y) in a.iter().zip(b) {
            assert!((x - y).abs() < 1e-13, "{a:?} {b:?}");
        }
    }

    /// Column-major, symmetric positive definite, eigenvalues 2 − √2, 2, 2 + √2.
    const SECOND_DIFFERENCE: [f64; 9] = [2.0, -1.0, 0.0, -1.0, 2.0, -1.0, 0.0, -1.0, 2.0];

    #[test]
    fn products_by_hand() {
        let a = [1.0, 4.0, 7.0, 2.0, 5.0, 8.0, 3.0, 6.0, 9.0];
        let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        near(&multiply(&a, &identity, false), &a);
        near(&multiply(&identity, &a, true), &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        let mut y = [1.0, 1.0, 1.0];
        // SAFETY: a 3×3 array and two vectors of three.
        unsafe {
            dgemv_(&flag(b'N'), &N, &N, &2.0, a.as_ptr(), &N, [1.0, 0.0, -1.0].as_ptr(), &1, &3.0, y.as_mut_ptr(), &1);
        };
        near(&y, &[-1.0, -1.0, -1.0]);
        // Only the named triangle may be read.
        let upper = [2.0, f64::NAN, f64::NAN, -1.0, 2.0, f64::NAN, 0.0, -1.0, 2.0];
        // SAFETY: as above.
        unsafe {
            dsymv_(&flag(b'U'), &N, &1.0, upper.as_ptr(), &N, [1.0, 2.0, 3.0].as_ptr(), &1, &0.0, y.as_mut_ptr(), &1);
        };
        near(&y, &[0.0, 0.0, 4.0]);
    }

    #[test]
    fn rank_updates_write_one_triangle() {
        let (a, b) = ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]);
        let mut c = [0.5; 9];
        // SAFETY: a 3×3 array and 3×1 arrays.
        unsafe {
            dsyrk_(&flag(b'U'), &flag(b'N'), &N, &1, &1.0, a.as_ptr(), &N, &0.0, c.as_mut_ptr(), &N);
        }
        near(&c, &[1.0, 0.5, 0.5, 2.0, 4.0, 0.5, 3.0, 6.0, 9.0]);
        // SAFETY: as above.
        unsafe {
            dsyr2k_(&flag(b'L'), &flag(b'N'), &N, &1, &1.0, a.as_ptr(), &N, b.as_ptr(), &N, &0.0, c.as_mut_ptr(), &N);
        }
        near(&c, &[8.0, 13.0, 18.0, 2.0, 20.0, 27.0, 3.0, 6.0, 36.0]);
    }

    #[test]
    fn cholesky_and_lu_solve() {
        let rhs = [1.0, -2.0, 5.0];
        for solver in [b'U', b'L', b'G'] {
            let (mut a, mut x, mut info) = (SECOND_DIFFERENCE, rhs, -1);
            // SAFETY: a 3×3 array, a vector and three pivots.
            unsafe {
                if solver == b'G' {
                    dgesv_(&N, &1, a.as_mut_ptr(), &N, [0; 3].as_mut_ptr(), x.as_mut_ptr(), &N, &mut info);
                } else {
                    dpotrf_(&flag(solver), &N, a.as_mut_ptr(), &N, &mut info);
                    assert_eq!(info, 0);
                    dpotrs_(&flag(solver), &N, &1, a.as_ptr(), &N, x.as_mut_ptr(), &N, &mut info);
                }
            }
            assert_eq!(info, 0);
            near(&[2.0 * x[0] - x[1], 2.0 * x[1] - x[0] - x[2], 2.0 * x[2] - x[1]], &rhs);
        }
        let (mut indefinite, mut info) = ([1.0, 2.0, 2.0, 1.0], 0);
        // SAFETY: a 2×2 array.
        unsafe { dpotrf_(&flag(b'U'), &2, indefinite.as_mut_ptr(), &2, &mut info) };
        assert_eq!(info, 2);
    }

    #[test]
    fn eigenvalues_of_the_second_difference() {
        let (mut a, mut w, mut z, mut found, mut info) = (SECOND_DIFFERENCE, [0.0; 3], [0.0; 9], 0, -1);
        // SAFETY: arrays of the stated sizes; the unused arguments may be null.
        unsafe {
            dsyevr_(
                &flag(b'V'),
                &flag(b'A'),
                &flag(b'U'),
                &N,
                a.as_mut_ptr(),
                &N,
                null(),
                null(),
                null(),
                null(),
                null(),
                &mut found,
                w.as_mut_ptr(),
                z.as_mut_ptr(),
                &N,
                [0; 6].as_mut_ptr(),
                [0.0; 8].as_mut_ptr(),
                &8,
                [0; 8].as_mut_ptr(),
                &8,
                &mut info,
            );
        }
        assert_eq!((info, found), (0, 3));
        near(&w, &[2.0 - 2.0_f64.sqrt(), 2.0, 2.0 + 2.0_f64.sqrt()]);
        let mut scaled = z;
        for j in 0..3 {
            for i in 0..3 {
                scaled[i + 3 * j] *= w[j];
            }
        }
        near(&multiply(&scaled, &z, true), &SECOND_DIFFERENCE);
    }

    #[test]
    fn singular_values_of_a_rank_one_matrix() {
        // (1, 2, 2)ᵀ (2, 1, −2): one singular value 9.
        let original = [2.0, 4.0, 4.0, 1.0, 2.0, 2.0, -2.0, -4.0, -4.0];
        let (mut a, mut s, mut u, mut vt, mut info) = (original, [0.0; 3], [0.0; 9], [0.0; 9], -1);
        // SAFETY: arrays of the stated sizes.
        unsafe {
            dgesvd_(
                &flag(b'S'),
                &flag(b'S'),
                &N,
                &N,
                a.as_mut_ptr(),
                &N,
                s.as_mut_ptr(),
                u.as_mut_ptr(),
                &N,
                vt.as_mut_ptr(),
                &N,
                [0.0; 8].as_mut_ptr(),
                &8,
                &mut info,
            );
        }
        assert_eq!(info, 0);
        near(&s, &[9.0, 0.0, 0.0]);
        let mut scaled = u;
        for (column, value) in scaled.chunks_mut(3).zip(s) {
            for x in column {
                *x *= value;
            }
        }
        near(&multiply(&scaled, &vt, false), &original);
        near(&multiply(&u, &u, true), &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    }
}
