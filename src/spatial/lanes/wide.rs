//! Registers of x86-64 with AVX2 and FMA.

use super::Lanes;

/// AVX2 and FMA.
pub use pulp::x86::V3 as Wide;

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
    fn fetch<T>(self, soon: &T) {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let first = core::ptr::from_ref(soon).cast::<i8>();
        for line in 0..size_of::<T>().div_ceil(64) {
            // SAFETY: a request reads nothing; the place is inside `soon`, or its last line
            unsafe { _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(64 * line)) };
        }
    }

    #[inline(always)]
    fn inverse(self, a: Self::V) -> Self::V {
        self.avx._mm256_div_pd(self.avx._mm256_set1_pd(1.0), a)
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
    fn pick(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
        self.avx._mm256_blend_pd::<0b0100>(self.avx._mm256_blend_pd::<0b0010>(a, b), c)
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
}
