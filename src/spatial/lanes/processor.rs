//! The widest registers of the processor at run time.

#[cfg(target_arch = "x86_64")]
use super::Wide;
use super::{Lanes, Plain};

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
        type Output = ([f64; 3], f64, [f64; 3], [f64; 3], [f64; 3], [f64; 3], [f64; 3]);

        #[inline(always)]
        fn run<L: Lanes>(self, s: L) -> Self::Output {
            // what lies beside a vector must not matter
            let (a, b) = (s.load([self.0[0], self.0[1], self.0[2], f64::NAN]), s.load([self.1[0], self.1[1], self.1[2], 7.0]));
            let columns = [a, b, s.yzx(a)];
            let (by_lane, by_number) = (s.combine_add(columns, b, s.zxy(a)), s.combine_numbers(columns, self.1));
            let sums = s.three(s.sums(columns));
            let picked = s.three(s.pick(b, a, b));
            let spread = s.three(s.mul(s.total(a), s.inverse(b)));
            (s.three(s.cross(a, b)), s.dot_two(a, b, b, b), s.three(by_lane), s.three(by_number), picked, sums, spread)
        }
    }

    #[test]
    fn products_of_vectors_are_those_of_plain_algebra_on_every_processor() {
        let (a, b) = (Vector3::new(0.3, -1.2, 0.7), Vector3::new(-0.4, 0.9, 1.6));
        let turned = Vector3::new(a.y, a.z, a.x);
        let matrix = Matrix3::from_columns(&[a, b, turned]);
        let wanted = (a.cross(&b), a.dot(&b) + b.dot(&b), matrix * b + Vector3::new(a.z, a.x, a.y), matrix * b);
        for processor in [Processor::plain(), Processor::detect()] {
            let found = processor.run(Products(a.into(), b.into()));
            // sums of at most seven products of numbers below two
            let tolerance = 7.0 * 4.0 * f64::EPSILON;
            assert!((Vector3::from(found.0) - wanted.0).norm() < tolerance, "{}", processor.name());
            assert!((found.1 - wanted.1).abs() < tolerance, "{}", processor.name());
            assert!((Vector3::from(found.2) - wanted.2).norm() < tolerance, "{}", processor.name());
            assert!((Vector3::from(found.3) - wanted.3).norm() < tolerance, "{}", processor.name());
            assert_eq!(found.4, [b.x, a.y, b.z], "{}", processor.name());
            let spread = b.map(|x| a.sum() / x);
            assert!((Vector3::from(found.6) - spread).norm() < tolerance, "{}: {:?}", processor.name(), found.6);
            let sums = [a, b, turned].map(|v| v.sum());
            assert!(
                found.5.iter().zip(sums).all(|(found, wanted)| (found - wanted).abs() < tolerance),
                "{}: {:?}",
                processor.name(),
                found.5
            );
        }
    }
}
