//! Three-vectors in registers of four numbers, by what the processor at run time offers.
//!
//! [`Lanes`] is written twice: for x86-64 with AVX2 and FMA ([`Wide`]), which is asked for once per system, and in plain arrays
//! ([`Plain`]), which every processor runs. A kernel is one generic function over them. The two differ in rounding alone: a fused
//! product and sum is rounded once, the plain one twice.
//!
//! The fourth number of a register means nothing: it may hold whatever lay beside a vector in memory.

/// The four numbers of `x` from `at` on, in one piece: assembled one by one they would be loaded one by one.
#[inline(always)]
#[must_use]
pub fn quad<const N: usize>(x: &[f64; N], at: usize) -> [f64; 4] {
    // callers stay inside; the compiler sees it where N and the place are constants
    x[at..].first_chunk().copied().unwrap_or([0.0; 4])
}

/// Four numbers and what is done with the first three.
pub trait Lanes: Copy {
    /// A register.
    type V: Copy;

    /// Four numbers from memory.
    fn load(self, x: [f64; 4]) -> Self::V;
    /// Four numbers to memory.
    fn store(self, a: Self::V) -> [f64; 4];
    /// The same number everywhere.
    fn splat(self, x: f64) -> Self::V;
    /// `a + b`.
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a - b`.
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a b`, number by number.
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a b + c`.
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `c - a b`.
    fn mul_take(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// (y, z, x).
    fn yzx(self, a: Self::V) -> Self::V;
    /// (z, x, y).
    fn zxy(self, a: Self::V) -> Self::V;
    /// The first number everywhere.
    fn all_x(self, a: Self::V) -> Self::V;
    /// The second number everywhere.
    fn all_y(self, a: Self::V) -> Self::V;
    /// The third number everywhere.
    fn all_z(self, a: Self::V) -> Self::V;

    /// The last three of four numbers.
    #[inline(always)]
    fn last_three(self, x: [f64; 4]) -> Self::V {
        self.load([x[1], x[2], x[3], 0.0])
    }

    /// The sums of the first three numbers of three registers.
    fn sums(self, a: [Self::V; 3]) -> Self::V;

    /// The sums of all four numbers of four registers.
    #[inline(always)]
    fn sums_of_four(self, a: [Self::V; 4]) -> Self::V {
        let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (self.store(a[0]), self.store(a[1]));
        let ([c0, c1, c2, c3], [d0, d1, d2, d3]) = (self.store(a[2]), self.store(a[3]));
        self.load([(a0 + a1) + (a2 + a3), (b0 + b1) + (b2 + b3), (c0 + c1) + (c2 + c3), (d0 + d1) + (d2 + d3)])
    }

    /// `[x, y, z]`.
    #[inline(always)]
    fn three(self, a: Self::V) -> [f64; 3] {
        let [x, y, z, _] = self.store(a);
        [x, y, z]
    }

    /// `[x, y, z]` in a register.
    #[inline(always)]
    fn of_three(self, x: [f64; 3]) -> Self::V {
        self.load([x[0], x[1], x[2], 0.0])
    }

    /// `a . b`.
    #[inline(always)]
    fn dot(self, a: Self::V, b: Self::V) -> f64 {
        let [x, y, z, _] = self.store(self.mul(a, b));
        (x + y) + z
    }

    /// `a . b + c . d`.
    #[inline(always)]
    fn dot_two(self, a: Self::V, b: Self::V, c: Self::V, d: Self::V) -> f64 {
        let [x, y, z, _] = self.store(self.mul_add(c, d, self.mul(a, b)));
        (x + y) + z
    }

    /// `a x b`.
    #[inline(always)]
    fn cross(self, a: Self::V, b: Self::V) -> Self::V {
        self.yzx(self.mul_take(self.yzx(a), b, self.mul(a, self.yzx(b))))
    }

    /// `sum_j columns_j x_j`.
    #[inline(always)]
    fn combine(self, columns: [Self::V; 3], x: Self::V) -> Self::V {
        let first = self.mul(columns[0], self.all_x(x));
        self.mul_add(columns[2], self.all_z(x), self.mul_add(columns[1], self.all_y(x), first))
    }

    /// `sum_j columns_j x_j + c`.
    #[inline(always)]
    fn combine_add(self, columns: [Self::V; 3], x: Self::V, c: Self::V) -> Self::V {
        let first = self.mul_add(columns[0], self.all_x(x), c);
        self.mul_add(columns[2], self.all_z(x), self.mul_add(columns[1], self.all_y(x), first))
    }

    /// `sum_j columns_j x_j` of numbers that fill their registers.
    #[inline(always)]
    fn combine_lanes(self, columns: [Self::V; 3], x: [Self::V; 3]) -> Self::V {
        self.mul_add(columns[2], x[2], self.mul_add(columns[1], x[1], self.mul(columns[0], x[0])))
    }

    /// `sum_j columns_j x_j` of numbers in memory.
    #[inline(always)]
    fn combine_numbers(self, columns: [Self::V; 3], x: [f64; 3]) -> Self::V {
        let first = self.mul(columns[0], self.splat(x[0]));
        self.mul_add(columns[2], self.splat(x[2]), self.mul_add(columns[1], self.splat(x[1]), first))
    }
}

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
    fn yzx(self, a: [f64; 4]) -> [f64; 4] {
        [a[1], a[2], a[0], a[3]]
    }

    #[inline(always)]
    fn zxy(self, a: [f64; 4]) -> [f64; 4] {
        [a[2], a[0], a[1], a[3]]
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

/// AVX2 and FMA.
#[cfg(target_arch = "x86_64")]
pub use pulp::x86::V3 as Wide;

#[cfg(target_arch = "x86_64")]
impl Lanes for Wide {
    type V = core::arch::x86_64::__m256d;

    #[inline(always)]
    fn load(self, x: [f64; 4]) -> Self::V {
        pulp::cast(x)
    }

    #[inline(always)]
    fn store(self, a: Self::V) -> [f64; 4] {
        pulp::cast(a)
    }

    #[inline(always)]
    fn splat(self, x: f64) -> Self::V {
        self.avx._mm256_set1_pd(x)
    }

    #[inline(always)]
    fn add(self, a: Self::V, b: Self::V) -> Self::V {
        self.avx._mm256_add_pd(a, b)
    }

    #[inline(always)]
    fn sub(self, a: Self::V, b: Self::V) -> Self::V {
        self.avx._mm256_sub_pd(a, b)
    }

    #[inline(always)]
    fn mul(self, a: Self::V, b: Self::V) -> Self::V {
        self.avx._mm256_mul_pd(a, b)
    }

    #[inline(always)]
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
        self.fma._mm256_fmadd_pd(a, b, c)
    }

    #[inline(always)]
    fn mul_take(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
        self.fma._mm256_fnmadd_pd(a, b, c)
    }

    #[inline(always)]
    fn yzx(self, a: Self::V) -> Self::V {
        self.avx2._mm256_permute4x64_pd::<0b11_00_10_01>(a)
    }

    #[inline(always)]
    fn zxy(self, a: Self::V) -> Self::V {
        self.avx2._mm256_permute4x64_pd::<0b11_01_00_10>(a)
    }

    #[inline(always)]
    fn all_x(self, a: Self::V) -> Self::V {
        self.avx2._mm256_permute4x64_pd::<0b00_00_00_00>(a)
    }

    #[inline(always)]
    fn all_y(self, a: Self::V) -> Self::V {
        self.avx2._mm256_permute4x64_pd::<0b01_01_01_01>(a)
    }

    #[inline(always)]
    fn all_z(self, a: Self::V) -> Self::V {
        self.avx2._mm256_permute4x64_pd::<0b10_10_10_10>(a)
    }

    #[inline(always)]
    fn sums_of_four(self, [a, b, c, d]: [Self::V; 4]) -> Self::V {
        let (first, second) = (self.avx._mm256_hadd_pd(a, b), self.avx._mm256_hadd_pd(c, d));
        let low = self.avx._mm256_permute2f128_pd::<0x20>(first, second);
        let high = self.avx._mm256_permute2f128_pd::<0x31>(first, second);
        self.add(low, high)
    }

    #[inline(always)]
    fn sums(self, [a, b, c]: [Self::V; 3]) -> Self::V {
        // (ax, bx, az, bz) and (ay, by, .., ..), then the halves that hold c
        let (low, high) = (self.avx._mm256_unpacklo_pd(a, b), self.avx._mm256_unpackhi_pd(a, b));
        let c_high = self.avx._mm256_permute_pd::<0b0101>(c);
        let x = self.avx._mm256_permute2f128_pd::<0x20>(low, c);
        let y = self.avx._mm256_permute2f128_pd::<0x20>(high, c_high);
        let z = self.avx._mm256_permute2f128_pd::<0x31>(low, c);
        self.add(self.add(x, y), z)
    }

    #[inline(always)]
    fn last_three(self, x: [f64; 4]) -> Self::V {
        self.avx2._mm256_permute4x64_pd::<0b11_11_10_01>(pulp::cast(x))
    }
}

/// A function over [`Lanes`].
pub trait Kernel {
    /// What it gives.
    type Output;

    /// Runs it; must be inlined, so that it is compiled for the processor's instructions.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// The widest [`Lanes`] of this processor.
#[derive(Debug, Clone, Copy)]
pub struct Processor {
    #[cfg(target_arch = "x86_64")]
    wide: Option<Wide>,
}

impl Processor {
    /// Asks the processor.
    #[must_use]
    pub fn detect() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            wide: Wide::try_new(),
        }
    }

    /// Plain arrays on any processor, to hold the others against.
    #[must_use]
    pub fn plain() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            wide: None,
        }
    }

    /// Name for reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        #[cfg(target_arch = "x86_64")]
        if self.wide.is_some() {
            return "AVX2 and FMA";
        }
        "plain"
    }

    /// Runs `kernel` with the widest lanes.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(wide) = self.wide {
            struct Call<K>(Wide, K);
            impl<K: Kernel> pulp::NullaryFnOnce for Call<K> {
                type Output = K::Output;
                #[inline(always)]
                fn call(self) -> K::Output {
                    self.1.run(self.0)
                }
            }
            return wide.vectorize(Call(wide, kernel));
        }
        kernel.run(Plain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    struct Products([f64; 3], [f64; 3]);

    impl Kernel for Products {
        type Output = ([f64; 3], f64, f64, [f64; 3], [f64; 3]);

        #[inline(always)]
        fn run<L: Lanes>(self, s: L) -> Self::Output {
            // what lies beside a vector must not matter
            let (a, b) = (s.load([self.0[0], self.0[1], self.0[2], f64::NAN]), s.last_three([7.0, self.1[0], self.1[1], self.1[2]]));
            let columns = [a, b, s.yzx(a)];
            let (by_lane, by_number) = (s.combine_add(columns, b, s.zxy(a)), s.combine_numbers(columns, self.1));
            (s.three(s.cross(a, b)), s.dot(a, b), s.dot_two(a, b, b, b), s.three(by_lane), s.three(by_number))
        }
    }

    #[test]
    fn products_of_vectors_are_those_of_plain_algebra_on_every_processor() {
        let (a, b) = (Vector3::new(0.3, -1.2, 0.7), Vector3::new(-0.4, 0.9, 1.6));
        let turned = Vector3::new(a.y, a.z, a.x);
        let matrix = Matrix3::from_columns(&[a, b, turned]);
        let wanted = (a.cross(&b), a.dot(&b), a.dot(&b) + b.dot(&b), matrix * b + Vector3::new(a.z, a.x, a.y), matrix * b);
        for processor in [Processor::plain(), Processor::detect()] {
            let found = processor.run(Products(a.into(), b.into()));
            // sums of at most seven products of numbers below two
            let tolerance = 7.0 * 4.0 * f64::EPSILON;
            assert!((Vector3::from(found.0) - wanted.0).norm() < tolerance, "{}", processor.name());
            assert!((found.1 - wanted.1).abs() < tolerance && (found.2 - wanted.2).abs() < tolerance, "{}", processor.name());
            assert!((Vector3::from(found.3) - wanted.3).norm() < tolerance, "{}", processor.name());
            assert!((Vector3::from(found.4) - wanted.4).norm() < tolerance, "{}", processor.name());
        }
    }
}
