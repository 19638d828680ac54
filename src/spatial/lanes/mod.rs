//! Three-vectors in registers of four numbers, by what the processor at run time offers.
//!
//! [`Lanes`] is written twice: for x86-64 with AVX2 and FMA ([`Wide`]), which is asked for once per system, and in plain arrays
//! ([`Plain`]), which every processor runs. A kernel is one generic function over them. The two differ in rounding alone: a fused
//! product and sum is rounded once, the plain one twice.
//!
//! The fourth number of a register means nothing: it may hold whatever lay beside a vector in memory.

mod plain;
mod processor;
#[cfg(target_arch = "x86_64")]
mod wide;

pub use plain::Plain;
pub use processor::{Kernel, Processor};
#[cfg(target_arch = "x86_64")]
pub use wide::Wide;

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
    /// `1 / a`, number by number.
    fn inverse(self, a: Self::V) -> Self::V;
    /// (y, z, x).
    fn yzx(self, a: Self::V) -> Self::V;
    /// (z, x, y).
    fn zxy(self, a: Self::V) -> Self::V;
    /// The first number of `a`, the second of `b`, the third of `c`.
    fn pick(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// The first number everywhere.
    fn all_x(self, a: Self::V) -> Self::V;
    /// The second number everywhere.
    fn all_y(self, a: Self::V) -> Self::V;
    /// The third number everywhere.
    fn all_z(self, a: Self::V) -> Self::V;

    /// Asks for the cache lines of what will be read soon, where the processor can be asked.
    #[inline(always)]
    fn fetch<T>(self, _soon: &T) {}

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

    /// `x + y + z`.
    #[inline(always)]
    fn sum(self, a: Self::V) -> f64 {
        let [x, y, z, _] = self.store(a);
        (x + y) + z
    }

    /// `x + y + z` in each of the first three places: ready to be multiplied with, sooner than one number that must be spread.
    #[inline(always)]
    fn total(self, a: Self::V) -> Self::V {
        self.add(self.add(a, self.yzx(a)), self.zxy(a))
    }

    /// The first number.
    #[inline(always)]
    fn first(self, a: Self::V) -> f64 {
        let [x, ..] = self.store(a);
        x
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
