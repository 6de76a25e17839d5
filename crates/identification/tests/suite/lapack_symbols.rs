//! The eleven BLAS and LAPACK routines that Clarabel's semidefinite cone calls, under their Fortran names, on faer.
//!
//! For the tests of `tumble-identification` only: a program that links a real BLAS would have every symbol twice. It shares no
//! line with the Jacobi rotations and the triangles that it helps to check. faer brings its own workspace; the workspace
//! arguments of the ABI are ignored.
//!
//! The Fortran ABI passes everything by pointer, column-major, which is why this module, and only this one, is unsafe.
#![allow(unsafe_code)]
// The signatures and the safety contract (valid pointers, consistent dimensions) are those of the reference library.
#![allow(clippy::too_many_arguments, clippy::missing_safety_doc)]
// Dimensions and flags arrive as C integers; they are sizes of small matrices.
#![allow(clippy::cast_sign_loss, clippy::cast_possible_truncation, clippy::cast_possible_wrap)]

use core::ffi::{c_char, c_int};
use core::ops::MulAssign;
use faer::diag::DiagMut;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt;
use faer::linalg::evd::{self, ComputeEigenvectors};
use faer::linalg::lu::partial_pivoting as lu;
use faer::linalg::matmul::matmul;
use faer::linalg::svd::{self, ComputeSvdVectors};
use faer::traits::ComplexField;
use faer::{Accum, Mat, MatMut, MatRef, Par, Spec};

type Flag = *const c_char;
type Size = *const c_int;

unsafe fn is(flag: Flag, letter: u8) -> bool {
    (unsafe { *flag } as u8).eq_ignore_ascii_case(&letter)
}

unsafe fn size(p: Size) -> usize {
    (unsafe { *p }) as usize
}

unsafe fn view<'a, T>(p: *const T, rows: usize, columns: usize, leading: Size) -> MatRef<'a, T> {
    unsafe { MatRef::from_raw_parts(p, rows, columns, 1, size(leading) as isize) }
}

unsafe fn view_mut<'a, T>(p: *mut T, rows: usize, columns: usize, leading: Size) -> MatMut<'a, T> {
    unsafe { MatMut::from_raw_parts_mut(p, rows, columns, 1, size(leading) as isize) }
}

/// A matrix of this shape, stored as it is or transposed.
unsafe fn operand<'a, T>(flag: Flag, p: *const T, rows: usize, columns: usize, leading: Size) -> MatRef<'a, T> {
    unsafe {
        if is(flag, b'N') { view(p, rows, columns, leading) } else { view(p, columns, rows, leading).transpose() }
    }
}

unsafe fn column<'a, T>(p: *const T, length: usize, step: Size) -> MatRef<'a, T> {
    unsafe { MatRef::from_raw_parts(p, length, 1, *step as isize, 1) }
}

unsafe fn column_mut<'a, T>(p: *mut T, length: usize, step: Size) -> MatMut<'a, T> {
    unsafe { MatMut::from_raw_parts_mut(p, length, 1, *step as isize, 1) }
}

/// A symmetric matrix of which one triangle is stored, transposed so that it is the lower one.
unsafe fn lower<'a, T>(triangle: Flag, p: *const T, n: usize, leading: Size) -> MatRef<'a, T> {
    let stored = unsafe { view(p, n, n, leading) };
    if unsafe { is(triangle, b'U') } { stored.transpose() } else { stored }
}

unsafe fn lower_mut<'a, T>(triangle: Flag, p: *mut T, n: usize, leading: Size) -> MatMut<'a, T> {
    let stored = unsafe { view_mut(p, n, n, leading) };
    if unsafe { is(triangle, b'U') } { stored.transpose_mut() } else { stored }
}

/// Memory for a routine of faer.
fn memory(request: StackReq) -> MemBuffer {
    MemBuffer::new(request)
}

/// `c = alpha a b + beta c`; where `beta` is zero, `c` is not read.
fn update<T>(alpha: T, a: MatRef<'_, T>, b: MatRef<'_, T>, beta: T, mut c: MatMut<'_, T>)
where
    T: ComplexField + Copy + Default + PartialEq + MulAssign,
{
    let kept = if beta == T::default() { Accum::Replace } else { Accum::Add };
    if kept == Accum::Add {
        for j in 0..c.ncols() {
            for i in 0..c.nrows() {
                c[(i, j)] *= beta;
            }
        }
    }
    matmul(c, kept, a, b, alpha, Par::Seq);
}

/// The lower triangle of `c = product + beta c`, for a symmetric product; where `beta` is zero, `c` is not read.
fn update_triangle<T>(product: &Mat<T>, beta: T, mut c: MatMut<'_, T>)
where
    T: Copy + Default + PartialEq + core::ops::Add<Output = T> + core::ops::Mul<Output = T>,
{
    for j in 0..c.ncols() {
        for i in j..c.nrows() {
            let kept = if beta == T::default() { T::default() } else { beta * c[(i, j)] };
            c[(i, j)] = product[(i, j)] + kept;
        }
    }
}

macro_rules! routines {
    ($t:ident: $gemm:ident $gemv:ident $symv:ident $syrk:ident $syr2k:ident $potrf:ident $potrs:ident $gesv:ident $gesdd:ident $gesvd:ident $syevr:ident $svd:ident) => {
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gemm(
            ta: Flag,
            tb: Flag,
            m: Size,
            n: Size,
            k: Size,
            alpha: *const $t,
            a: *const $t,
            lda: Size,
            b: *const $t,
            ldb: Size,
            beta: *const $t,
            c: *mut $t,
            ldc: Size,
        ) {
            unsafe {
                let (m, n, k) = (size(m), size(n), size(k));
                let (a, b) = (operand(ta, a, m, k, lda), operand(tb, b, k, n, ldb));
                update(*alpha, a, b, *beta, view_mut(c, m, n, ldc));
            }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gemv(
            t: Flag,
            m: Size,
            n: Size,
            alpha: *const $t,
            a: *const $t,
            lda: Size,
            x: *const $t,
            incx: Size,
            beta: *const $t,
            y: *mut $t,
            incy: Size,
        ) {
            unsafe {
                let (m, n) = if is(t, b'N') { (size(m), size(n)) } else { (size(n), size(m)) };
                update(*alpha, operand(t, a, m, n, lda), column(x, n, incx), *beta, column_mut(y, m, incy));
            }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $symv(
            uplo: Flag,
            n: Size,
            alpha: *const $t,
            a: *const $t,
            lda: Size,
            x: *const $t,
            incx: Size,
            beta: *const $t,
            y: *mut $t,
            incy: Size,
        ) {
            unsafe {
                let n = size(n);
                let a = lower(uplo, a, n, lda);
                let whole = Mat::from_fn(n, n, |i, j| a[(i.max(j), i.min(j))]);
                update(*alpha, whole.as_ref(), column(x, n, incx), *beta, column_mut(y, n, incy));
            }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syrk(
            uplo: Flag,
            trans: Flag,
            n: Size,
            k: Size,
            alpha: *const $t,
            a: *const $t,
            lda: Size,
            beta: *const $t,
            c: *mut $t,
            ldc: Size,
        ) {
            unsafe {
                let (n, k) = (size(n), size(k));
                let (a, mut product) = (operand(trans, a, n, k, lda), Mat::zeros(n, n));
                update(*alpha, a, a.transpose(), 0.0, product.as_mut());
                update_triangle(&product, *beta, lower_mut(uplo, c, n, ldc));
            }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syr2k(
            uplo: Flag,
            trans: Flag,
            n: Size,
            k: Size,
            alpha: *const $t,
            a: *const $t,
            lda: Size,
            b: *const $t,
            ldb: Size,
            beta: *const $t,
            c: *mut $t,
            ldc: Size,
        ) {
            unsafe {
                let (n, k) = (size(n), size(k));
                let (a, b) = (operand(trans, a, n, k, lda), operand(trans, b, n, k, ldb));
                let mut product = Mat::zeros(n, n);
                update(*alpha, a, b.transpose(), 0.0, product.as_mut());
                update(*alpha, b, a.transpose(), 1.0, product.as_mut());
                update_triangle(&product, *beta, lower_mut(uplo, c, n, ldc));
            }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $potrf(uplo: Flag, n: Size, a: *mut $t, lda: Size, info: *mut c_int) {
            unsafe {
                let n = size(n);
                let mut a = lower_mut(uplo, a, n, lda);
                let mut factor = a.to_owned();
                let mut memory = memory(llt::factor::cholesky_in_place_scratch::<$t>(n, Par::Seq, Spec::default()));
                let found = llt::factor::cholesky_in_place(
                    factor.as_mut(),
                    llt::factor::LltRegularization::default(),
                    Par::Seq,
                    MemStack::new(&mut memory),
                    Spec::default(),
                );
                *info = match found {
                    Ok(_) => 0,
                    Err(llt::factor::LltError::NonPositivePivot { index }) => index as c_int + 1,
                };
                // The other triangle is not to be written.
                for j in 0..n {
                    for i in j..n {
                        a[(i, j)] = factor[(i, j)];
                    }
                }
            }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $potrs(
            uplo: Flag,
            n: Size,
            nrhs: Size,
            a: *const $t,
            lda: Size,
            b: *mut $t,
            ldb: Size,
            info: *mut c_int,
        ) {
            unsafe {
                let (n, r) = (size(n), size(nrhs));
                let mut memory = memory(llt::solve::solve_in_place_scratch::<$t>(n, r, Par::Seq));
                let (factor, b) = (lower(uplo, a, n, lda), view_mut(b, n, r, ldb));
                llt::solve::solve_in_place(factor, b, Par::Seq, MemStack::new(&mut memory));
                *info = 0;
            }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesv(
            n: Size,
            nrhs: Size,
            a: *mut $t,
            lda: Size,
            _ipiv: *mut c_int,
            b: *mut $t,
            ldb: Size,
            info: *mut c_int,
        ) {
            unsafe {
                let (n, r) = (size(n), size(nrhs));
                let (mut a, b) = (view_mut(a, n, n, lda), view_mut(b, n, r, ldb));
                let (mut order, mut inverse) = (vec![0_usize; n], vec![0_usize; n]);
                let mut memory = memory(StackReq::any_of(&[
                    lu::factor::lu_in_place_scratch::<usize, $t>(n, n, Par::Seq, Spec::default()),
                    lu::solve::solve_in_place_scratch::<usize, $t>(n, r, Par::Seq),
                ]));
                let stack = MemStack::new(&mut memory);
                let a_mut = a.as_mut();
                let (_, rows) =
                    lu::factor::lu_in_place(a_mut, &mut order, &mut inverse, Par::Seq, stack, Spec::default());
                let singular = (0..n).find(|&k| a[(k, k)] == 0.0);
                *info = singular.map_or(0, |k| k as c_int + 1);
                if singular.is_none() {
                    lu::solve::solve_in_place(a.as_ref(), a.as_ref(), rows, b, Par::Seq, MemStack::new(&mut memory));
                }
            }
        }
        /// Both routines for singular values, thin.
        unsafe fn $svd(
            m: Size,
            n: Size,
            a: *mut $t,
            lda: Size,
            s: *mut $t,
            u: *mut $t,
            ldu: Size,
            vt: *mut $t,
            ldvt: Size,
            work: *mut $t,
            lwork: Size,
            info: *mut c_int,
        ) {
            unsafe {
                *info = 0;
                if *lwork == -1 {
                    *work = 1.0;
                    return;
                }
                let (m, n) = (size(m), size(n));
                let k = m.min(n);
                let thin = ComputeSvdVectors::Thin;
                let mut memory = memory(svd::svd_scratch::<$t>(m, n, thin, thin, Par::Seq, Spec::default()));
                let found = svd::svd(
                    view(a, m, n, lda),
                    DiagMut::from_raw_parts_mut(s, k, 1),
                    Some(view_mut(u, m, k, ldu)),
                    Some(view_mut(vt, k, n, ldvt).transpose_mut()),
                    Par::Seq,
                    MemStack::new(&mut memory),
                    Spec::default(),
                );
                *info = c_int::from(found.is_err());
            }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesdd(
            _jobz: Flag,
            m: Size,
            n: Size,
            a: *mut $t,
            lda: Size,
            s: *mut $t,
            u: *mut $t,
            ldu: Size,
            vt: *mut $t,
            ldvt: Size,
            work: *mut $t,
            lwork: Size,
            _iwork: *mut c_int,
            info: *mut c_int,
        ) {
            unsafe { $svd(m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, info) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesvd(
            _jobu: Flag,
            _jobvt: Flag,
            m: Size,
            n: Size,
            a: *mut $t,
            lda: Size,
            s: *mut $t,
            u: *mut $t,
            ldu: Size,
            vt: *mut $t,
            ldvt: Size,
            work: *mut $t,
            lwork: Size,
            info: *mut c_int,
        ) {
            unsafe { $svd(m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, info) }
        }
        #[doc = "The routine of this name in the reference BLAS or LAPACK, as far as Clarabel uses it."]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syevr(
            jobz: Flag,
            _range: Flag,
            uplo: Flag,
            n: Size,
            a: *mut $t,
            lda: Size,
            _vl: *const $t,
            _vu: *const $t,
            _il: Size,
            _iu: Size,
            _abstol: *const $t,
            m: *mut c_int,
            w: *mut $t,
            z: *mut $t,
            ldz: Size,
            _isuppz: *mut c_int,
            work: *mut $t,
            lwork: Size,
            iwork: *mut c_int,
            _liwork: Size,
            info: *mut c_int,
        ) {
            unsafe {
                *info = 0;
                if *lwork == -1 {
                    *work = 1.0;
                    *iwork = 1;
                    return;
                }
                let n = size(n);
                let vectors = is(jobz, b'V');
                let wanted = if vectors { ComputeEigenvectors::Yes } else { ComputeEigenvectors::No };
                let mut memory = memory(evd::self_adjoint_evd_scratch::<$t>(n, wanted, Par::Seq, Spec::default()));
                let found = evd::self_adjoint_evd(
                    lower(uplo, a, n, lda),
                    DiagMut::from_raw_parts_mut(w, n, 1),
                    if vectors { Some(view_mut(z, n, n, ldz)) } else { None },
                    Par::Seq,
                    MemStack::new(&mut memory),
                    Spec::default(),
                );
                *m = n as c_int;
                *info = c_int::from(found.is_err());
            }
        }
    };
}
routines!(f32: sgemm_ sgemv_ ssymv_ ssyrk_ ssyr2k_ spotrf_ spotrs_ sgesv_ sgesdd_ sgesvd_ ssyevr_ svd_f32);
routines!(f64: dgemm_ dgemv_ dsymv_ dsyrk_ dsyr2k_ dpotrf_ dpotrs_ dgesv_ dgesdd_ dgesvd_ dsyevr_ svd_f64);

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
