//! Registers as plain arrays.

use super::Lanes;

/// Plain arrays: what the compiler makes of them on any processor.
#[derive(Debug, Clone, Copy)]
pub struct Plain;

/// `a b + c`, in one instruction where every processor of the architecture has it.
#[inline(always)]
fn product_sum(a: f64, b: f64, c: f64) -> f64 {
    if cfg!(any(target_arch = "aarch64", target_feature = "fma")) { a.mul_add(b, c) } else { a * b + c }
}

impl Lanes for Plain {
    type V = [f64; 4];

    #[inline(always)]
    fn load(self, x: [f64; 4]) -> [f64; 4] {
        x
    }

    #[inline(always)]
    fn store(self, a: [f64; 4]) -> [f64; 4] {
        a
    }

    #[inline(always)]
    fn splat(self, x: f64) -> [f64; 4] {
        [x; 4]
    }

    #[inline(always)]
    fn add(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
    }

    #[inline(always)]
    fn sub(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
    }

    #[inline(always)]
    fn mul(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
    }

    #[inline(always)]
    fn mul_add(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        [product_sum(a[0], b[0], c[0]), product_sum(a[1], b[1], c[1]), product_sum(a[2], b[2], c[2]), product_sum(a[3], b[3], c[3])]
    }

    #[inline(always)]
    fn mul_take(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        [product_sum(-a[0], b[0], c[0]), product_sum(-a[1], b[1], c[1]), product_sum(-a[2], b[2], c[2]), product_sum(-a[3], b[3], c[3])]
    }

    #[inline(always)]
    fn inverse(self, a: [f64; 4]) -> [f64; 4] {
        [1.0 / a[0], 1.0 / a[1], 1.0 / a[2], 1.0 / a[3]]
    }

    #[inline(always)]
    fn yzx(self, a: [f64; 4]) -> [f64; 4] {
        [a[1], a[2], a[0], a[3]]
    }

    #[inline(always)]
    fn zxy(self, a: [f64; 4]) -> [f64; 4] {
        [a[2], a[0], a[1], a[3]]
    }

    #[inline(always)]
    fn pick(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        [a[0], b[1], c[2], 0.0]
    }

    #[inline(always)]
    fn all_x(self, a: [f64; 4]) -> [f64; 4] {
        [a[0]; 4]
    }

    #[inline(always)]
    fn all_y(self, a: [f64; 4]) -> [f64; 4] {
        [a[1]; 4]
    }

    #[inline(always)]
    fn all_z(self, a: [f64; 4]) -> [f64; 4] {
        [a[2]; 4]
    }

    #[inline(always)]
    fn sums(self, [a, b, c]: [[f64; 4]; 3]) -> [f64; 4] {
        [(a[0] + a[1]) + a[2], (b[0] + b[1]) + b[2], (c[0] + c[1]) + c[2], 0.0]
    }
}
