//! 3 x 3 matrices by cyclic diagonals: `(xx, yy, zz)`, `(xy, yz, zx)` and `(xz, yx, zy)`, a register each.
//!
//! A symmetric matrix has two of them, since its third is the second turned by one place; products, transposed products and the shift of an
//! inertia need no number spread over a register. In what follows an index counts places in (x, y, z) and starts again after z.

use crate::spatial::lanes::Lanes;

/// Diagonals `m(i, i)`, `m(i, i + 1)` and `m(i, i + 2)`.
pub type General<V> = [V; 3];

/// Diagonals `m(i, i)` and `m(i, i + 1)`; `m(i, i + 2)` is `m(i + 2, i)`.
pub type Symmetric<V> = [V; 2];

/// A vector and its turns (y, z, x) and (z, x, y).
#[derive(Clone, Copy)]
pub struct Turns<V> {
    pub x: V,
    pub yzx: V,
    pub zxy: V,
}

impl<V: Copy> Turns<V> {
    #[inline(always)]
    pub fn new<L: Lanes<V = V>>(s: L, x: V) -> Self {
        Self { x, yzx: s.yzx(x), zxy: s.zxy(x) }
    }
}

/// `m x`.
#[inline(always)]
pub fn symmetric_times<L: Lanes>(s: L, m: Symmetric<L::V>, x: L::V) -> L::V {
    // two short chains instead of one long
    let around = s.zxy(s.mul(m[1], x));
    s.add(s.mul_add(m[0], x, s.mul(m[1], s.yzx(x))), around)
}

/// `x m x`, everywhere: sooner than by way of `m x`.
#[inline(always)]
pub fn square<L: Lanes>(s: L, m: Symmetric<L::V>, x: L::V) -> L::V {
    let (own, twice) = (s.mul(x, x), s.mul(s.add(x, x), s.yzx(x)));
    s.total(s.mul_add(m[1], twice, s.mul(m[0], own)))
}

/// `m' x`.
#[inline(always)]
pub fn transposed_times<L: Lanes>(s: L, m: General<L::V>, x: L::V) -> L::V {
    let (back, around) = (s.zxy(s.mul(m[1], x)), s.yzx(s.mul(m[2], x)));
    s.mul_add(m[0], x, s.add(back, around))
}

/// `half b'`, where it is symmetric.
#[inline(always)]
pub fn symmetric_product<L: Lanes>(s: L, half: [L::V; 3], b: [L::V; 3]) -> Symmetric<L::V> {
    [s.combine_lanes(half, b), s.combine_lanes(half, [s.yzx(b[0]), s.yzx(b[1]), s.yzx(b[2])])]
}

/// `half b'`.
#[inline(always)]
pub fn general_product<L: Lanes>(s: L, half: [L::V; 3], b: [L::V; 3]) -> General<L::V> {
    let [first, second] = symmetric_product(s, half, b);
    [first, second, s.combine_lanes(half, [s.zxy(b[0]), s.zxy(b[1]), s.zxy(b[2])])]
}

/// Columns of a matrix.
#[inline(always)]
pub fn columns<L: Lanes>(s: L, [first, second, third]: General<L::V>) -> [L::V; 3] {
    [s.pick(first, third, second), s.pick(second, first, third), s.pick(third, second, first)]
}

/// Columns of a symmetric matrix.
#[inline(always)]
pub fn symmetric_columns<L: Lanes>(s: L, [first, second]: Symmetric<L::V>) -> [L::V; 3] {
    columns(s, [first, second, s.zxy(second)])
}

/// Inertia `[[rotational, coupling], [coupling', translational]]`.
#[derive(Clone, Copy)]
pub struct Inertia<V> {
    pub rotational: Symmetric<V>,
    pub coupling: General<V>,
    pub translational: Symmetric<V>,
}

impl<V: Copy> Inertia<V> {
    /// `start + inertia (angular; linear)`.
    #[inline(always)]
    pub fn times_add<L: Lanes<V = V>>(&self, s: L, angular: V, linear: V, start: [V; 2]) -> [V; 2] {
        let (r, c, t) = (self.rotational, self.coupling, self.translational);
        let (turned, along, across) = (s.yzx(angular), s.yzx(linear), s.zxy(linear));
        let moment = s.mul_add(r[1], turned, s.mul_add(r[0], angular, start[0]));
        let moment = s.mul_add(c[2], across, s.mul_add(c[1], along, s.mul_add(c[0], linear, moment)));
        let moment = s.add(moment, s.zxy(s.mul(r[1], angular)));
        let force = s.mul_add(t[0], linear, s.mul_add(c[0], angular, start[1]));
        let force = s.mul_add(t[1], along, s.add(force, s.yzx(s.mul(c[2], angular))));
        let force = s.add(force, s.zxy(s.mul_add(t[1], linear, s.mul(c[1], angular))));
        [moment, force]
    }

    /// Less `g g' / D`, with `g` as (angular; linear) and `1 / D` everywhere: products first, since the quotient comes last.
    #[inline(always)]
    pub fn less<L: Lanes<V = V>>(&self, s: L, [angular, linear]: [V; 2], inverse: V) -> Self {
        let (r, c, t) = (self.rotational, self.coupling, self.translational);
        let along = Turns::new(s, linear);
        let turned = s.yzx(angular);
        Self {
            rotational: [s.mul_take(s.mul(angular, angular), inverse, r[0]), s.mul_take(s.mul(angular, turned), inverse, r[1])],
            coupling: [
                s.mul_take(s.mul(angular, linear), inverse, c[0]),
                s.mul_take(s.mul(angular, along.yzx), inverse, c[1]),
                s.mul_take(s.mul(angular, along.zxy), inverse, c[2]),
            ],
            translational: [s.mul_take(s.mul(linear, linear), inverse, t[0]), s.mul_take(s.mul(linear, along.yzx), inverse, t[1])],
        }
    }

    /// The same seen from a point that lies at `-l`: `phi P phi*`.
    #[inline(always)]
    pub fn shifted<L: Lanes<V = V>>(&self, s: L, l: &Turns<V>) -> Self {
        let (r, c, t) = (self.rotational, self.coupling, self.translational);
        // A = C + l~ T, then J + l~ C' - A l~
        let (t_next, t_last, d_next, d_last) = (s.yzx(t[1]), s.zxy(t[1]), s.yzx(t[0]), s.zxy(t[0]));
        let a = [
            s.mul_take(l.zxy, t[1], s.mul_add(l.yzx, t_last, c[0])),
            s.mul_take(l.zxy, d_next, s.mul_add(l.yzx, t_next, c[1])),
            s.mul_take(l.zxy, t_next, s.mul_add(l.yzx, d_last, c[2])),
        ];
        // what A does comes last: it is known last
        let own = s.mul_take(l.zxy, c[1], s.mul_add(l.yzx, c[2], r[0]));
        let side = s.mul_take(l.zxy, s.yzx(c[0]), s.mul_add(l.yzx, s.yzx(c[1]), r[1]));
        let own = s.mul_take(l.zxy, a[1], s.mul_add(l.yzx, a[2], own));
        let side = s.mul_add(l.zxy, a[0], s.mul_take(l.x, a[2], side));
        Self { rotational: [own, side], coupling: a, translational: t }
    }

    /// The same with a rigid body: its inertia about O, first moment and mass.
    #[inline(always)]
    pub fn with_rigid<L: Lanes<V = V>>(&self, s: L, own: Symmetric<V>, first_moment: &Turns<V>, mass: f64) -> Self {
        let (r, c, t) = (self.rotational, self.coupling, self.translational);
        Self {
            rotational: [s.add(r[0], own[0]), s.add(r[1], own[1])],
            // the tilde matrix of its first moment
            coupling: [c[0], s.sub(c[1], first_moment.zxy), s.add(c[2], first_moment.yzx)],
            translational: [s.add(t[0], s.splat(mass)), t[1]],
        }
    }

    /// The sum of two.
    #[inline(always)]
    pub fn plus<L: Lanes<V = V>>(&self, s: L, other: &Self) -> Self {
        let (a, b) = (self, other);
        Self {
            rotational: [s.add(a.rotational[0], b.rotational[0]), s.add(a.rotational[1], b.rotational[1])],
            coupling: [s.add(a.coupling[0], b.coupling[0]), s.add(a.coupling[1], b.coupling[1]), s.add(a.coupling[2], b.coupling[2])],
            translational: [s.add(a.translational[0], b.translational[0]), s.add(a.translational[1], b.translational[1])],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::kernel::record::Outboard;
    use crate::spatial::SpatialInertia;
    use crate::spatial::lanes::{Kernel, Processor};
    use crate::spatial::shift::{angular, force_from, linear};
    use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

    /// One inertia, a force on it, a gain and its pivot, an arm: product with the force, the rest after the gain, and the shifted; with the last
    /// comes the square of the moment in the rotational inertia.
    struct Operations(SpatialInertia, Vector6<f64>, Vector6<f64>, f64, Vector3<f64>);

    impl Kernel for Operations {
        type Output = [(SpatialInertia, Vector6<f64>); 3];

        #[inline(always)]
        fn run<L: Lanes>(self, s: L) -> Self::Output {
            let Self(inertia, x, g, pivot, l) = self;
            let register = |v: Vector3<f64>| s.of_three(v.into());
            let record = Outboard::new(&inertia, &x);
            let (own, wrench) = (record.inertia(s), record.wrench(s));
            let product = own.times_add(s, wrench[0], wrench[1], wrench);
            let pair = [register(angular(&g)), register(linear(&g))];
            let turns = Turns::new(s, register(l));
            let square = square(s, own.rotational, wrench[0]);
            [
                Outboard::of(s, &own, product),
                Outboard::of(s, &own.less(s, pair, s.splat(1.0 / pivot)), wrench),
                Outboard::of(s, &own.shifted(s, &turns), [square, square]),
            ]
            .map(|record| record.plain())
        }
    }

    #[test]
    fn operations_by_diagonals_are_those_of_whole_matrices() {
        let number = |i: usize| (1.7 * i as f64 + 0.3).sin();
        let root = Matrix6::from_fn(|i, j| number(6 * i + j));
        let whole = root * root.transpose();
        let block = |i: usize, j: usize| -> Matrix3<f64> { whole.fixed_view::<3, 3>(i, j).into() };
        let inertia = SpatialInertia { rotational: block(0, 0), coupling: block(0, 3), translational: block(3, 3) };
        let (x, g) = (Vector6::from_fn(|i, _| number(40 + i)), Vector6::from_fn(|i, _| number(50 + i)));
        let (pivot, l) = (1.9, Vector3::new(0.4, -1.1, 0.8));
        let shift = Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|j| force_from(&l, &Vector6::ith(j, 1.0))));
        let wanted = [whole, whole - g * g.transpose() / pivot, shift * whole * shift.transpose()];
        for processor in [Processor::plain(), Processor::detect()] {
            let found = processor.run(Operations(inertia, x, g, pivot, l));
            // sums of at most 36 products of two arms and an inertia
            let tolerance = 36.0 * f64::EPSILON * whole.norm() * (1.0 + l.norm()).powi(2);
            assert!((found[0].1 - (x + whole * x)).norm() < tolerance, "{}: {}", processor.name(), found[0].1);
            let square = Vector6::repeat((angular(&x).transpose() * inertia.rotational * angular(&x))[0]);
            assert!((found[2].1 - square).norm() < tolerance * x.norm(), "{}: {} is not {square}", processor.name(), found[2].1);
            for (found, wanted) in found.iter().zip(&wanted) {
                assert!((found.0.matrix() - wanted).norm() < tolerance, "{}: {}{}", processor.name(), found.0.matrix(), wanted);
            }
        }
    }
}
