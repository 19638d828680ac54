//! What the passes leave for one another: registers in memory, each at a multiple of its size, so that none lies across two cache lines.

use super::cyclic::Inertia;
use crate::spatial::SpatialInertia;
use crate::spatial::lanes::Lanes;
use crate::spatial::shift::spatial;
use nalgebra::{Matrix3, Vector3, Vector6};

/// Three numbers and one that means nothing where nothing else is said.
pub type Quad = [f64; 4];

/// The columns of a 3 x 3 matrix.
pub type Block = [Quad; 3];

/// Attitude and angular velocity of one body or frame.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub struct Motion {
    /// Columns: its axes in inertial axes.
    pub turn: Block,
    /// rad/s, inertial axes.
    pub omega: Quad,
}

/// What a hinge of at most one rate leaves for the accelerations, inertial axes at O.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(32))]
pub struct Hinge {
    /// Gain `G = P H* / D`, angular half; the fourth number is `nu`. No gain without a rate.
    pub gain_angular: Quad,
    /// Its linear half.
    pub gain_linear: Quad,
    /// O of the parent to O (m).
    pub l: Quad,
    /// Bias acceleration, angular half.
    pub bias_angular: Quad,
    /// Its linear half.
    pub bias_linear: Quad,
}

/// Inertia and residual force that a body leaves, `P+` and `z+` at O, inertial axes: blocks by cyclic diagonals.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(32))]
pub struct Outboard {
    pub rotational: [Quad; 2],
    pub coupling: [Quad; 3],
    pub translational: [Quad; 2],
    pub moment: Quad,
    pub force: Quad,
}

/// Load at a hinge, at O in inertial axes; at first `alpha+`, of which it is made.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(32))]
pub struct Load {
    pub moment: Quad,
    pub force: Quad,
}

/// Columns in registers.
#[inline(always)]
pub fn block<L: Lanes>(s: L, b: &Block) -> [L::V; 3] {
    [s.load(b[0]), s.load(b[1]), s.load(b[2])]
}

/// Columns to memory.
#[inline(always)]
pub fn stored<L: Lanes>(s: L, b: [L::V; 3]) -> Block {
    [s.store(b[0]), s.store(b[1]), s.store(b[2])]
}

fn matrix(b: &Block) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| b[j][i])
}

fn quads(m: &Matrix3<f64>) -> Block {
    std::array::from_fn(|j| quad(&m.column(j).into()))
}

fn vector(q: &Quad) -> Vector3<f64> {
    Vector3::new(q[0], q[1], q[2])
}

fn quad(v: &Vector3<f64>) -> Quad {
    [v.x, v.y, v.z, 0.0]
}

impl Motion {
    /// Of the inertial frame.
    pub const REST: Self = Self { turn: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]], omega: [0.0; 4] };

    /// From plain algebra.
    pub fn new(rotation: &Matrix3<f64>, omega: &Vector3<f64>) -> Self {
        Self { turn: quads(rotation), omega: quad(omega) }
    }

    /// Its axes to inertial axes.
    pub fn rotation(&self) -> Matrix3<f64> {
        matrix(&self.turn)
    }

    /// rad/s, inertial axes.
    pub fn angular_velocity(&self) -> Vector3<f64> {
        vector(&self.omega)
    }
}

impl Load {
    /// `alpha+`.
    #[inline(always)]
    pub fn of<L: Lanes>(s: L, angular: L::V, linear: L::V) -> Self {
        Self { moment: s.store(angular), force: s.store(linear) }
    }

    /// `P+ alpha+ + z+` in the place of `alpha+`.
    #[inline(always)]
    pub fn settle<L: Lanes>(&mut self, s: L, felt: &Outboard) {
        let [moment, force] = felt.inertia(s).times_add(s, s.load(self.moment), s.load(self.force), felt.wrench(s));
        *self = Self { moment: s.store(moment), force: s.store(force) };
    }

    /// (moment; force) in plain algebra.
    pub fn plain(&self) -> Vector6<f64> {
        spatial(&vector(&self.moment), &vector(&self.force))
    }
}

impl Outboard {
    /// To memory.
    #[inline(always)]
    pub fn of<L: Lanes>(s: L, inertia: &Inertia<L::V>, wrench: [L::V; 2]) -> Self {
        let mut record = Self::default();
        record.put_inertia(s, inertia);
        record.put_wrench(s, wrench);
        record
    }

    /// The inertia to memory.
    #[inline(always)]
    pub fn put_inertia<L: Lanes>(&mut self, s: L, inertia: &Inertia<L::V>) {
        let (r, t) = (inertia.rotational, inertia.translational);
        self.rotational = [s.store(r[0]), s.store(r[1])];
        self.coupling = stored(s, inertia.coupling);
        self.translational = [s.store(t[0]), s.store(t[1])];
    }

    /// Moment and force to memory.
    #[inline(always)]
    pub fn put_wrench<L: Lanes>(&mut self, s: L, [moment, force]: [L::V; 2]) {
        (self.moment, self.force) = (s.store(moment), s.store(force));
    }

    /// The inertia in registers.
    #[inline(always)]
    pub fn inertia<L: Lanes>(&self, s: L) -> Inertia<L::V> {
        let (r, t) = (&self.rotational, &self.translational);
        Inertia {
            rotational: [s.load(r[0]), s.load(r[1])],
            coupling: block(s, &self.coupling),
            translational: [s.load(t[0]), s.load(t[1])],
        }
    }

    /// Moment and force in registers.
    #[inline(always)]
    pub fn wrench<L: Lanes>(&self, s: L) -> [L::V; 2] {
        [s.load(self.moment), s.load(self.force)]
    }

    /// From plain algebra.
    #[inline(never)]
    pub fn new(inertia: &SpatialInertia, force: &Vector6<f64>) -> Self {
        let diagonal = |m: &Matrix3<f64>, k: usize| [m[(0, k % 3)], m[(1, (1 + k) % 3)], m[(2, (2 + k) % 3)], 0.0];
        Self {
            rotational: std::array::from_fn(|k| diagonal(&inertia.rotational, k)),
            coupling: std::array::from_fn(|k| diagonal(&inertia.coupling, k)),
            translational: std::array::from_fn(|k| diagonal(&inertia.translational, k)),
            moment: quad(&force.fixed_rows::<3>(0).into()),
            force: quad(&force.fixed_rows::<3>(3).into()),
        }
    }

    /// To plain algebra.
    #[inline(never)]
    pub fn plain(&self) -> (SpatialInertia, Vector6<f64>) {
        let general = |m: &[Quad; 3]| Matrix3::from_fn(|i, j| m[(3 + j - i) % 3][i]);
        let symmetric = |m: &[Quad; 2]| general(&[m[0], m[1], [m[1][2], m[1][0], m[1][1], 0.0]]);
        let inertia = SpatialInertia {
            rotational: symmetric(&self.rotational),
            coupling: general(&self.coupling),
            translational: symmetric(&self.translational),
        };
        (inertia, spatial(&vector(&self.moment), &vector(&self.force)))
    }
}
