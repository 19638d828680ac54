//! Modes in a response. With modes scaled by `Lambda^-1/2` their diagonal is one again, and what [`super::super::flexible`] says holds as
//! it stands: `F` and `Phi` become `F Lambda^-1/2` and `Phi Lambda^-1/2`, a force on a mode and its acceleration likewise.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/mod.rs")]

use crate::dynamics::kernel::Doubtful;
use crate::dynamics::kernel::cyclic::Inertia;
use crate::dynamics::kernel::flexible::FlexibleLink;
use crate::dynamics::kernel::inward::Felt;
use crate::dynamics::kernel::modal_shape::{ModalShape, leave_residual};
use crate::dynamics::kernel::rows::{Block, fill, gram, product, spill, take_transposed};
use crate::dynamics::kernel::six::{Pair, Six, inverse_sum, inverse_sum_of_blocks};
use crate::dynamics::kernel::tip::{columns_of, rows_of};
use crate::spatial::lanes::Lanes;

/// What the modes of one body leave.
#[derive(Debug, Clone)]
pub struct FlexibleFactor {
    /// `Lambda^-1/2`.
    scale: Vec<[f64; 4]>,
    /// `M_fr`, scaled.
    rows: Vec<Block<6>>,
    /// Mode shape of every moved child's interface, scaled.
    interfaces: Vec<Vec<Block<6>>>,
    /// `F' Phi'` of every interface.
    coupling: Vec<Six>,
    /// `Phi Phi'` of all pairs of interfaces, row by row.
    flexibility: Vec<Six>,
    /// `sum_a Z_a N_ab` of every interface b.
    reach: Vec<Six>,
    /// Forces on the modes, then what is left of them, scaled.
    r: Vec<[f64; 4]>,
}

impl FlexibleFactor {
    /// Room for a body with the constants `shape`, whose modes move `tips` children.
    pub fn new(shape: &ModalShape, tips: usize) -> Self {
        let zeros = vec![[0.0; 4]; shape.stiffness.len()];
        Self {
            scale: zeros.clone(),
            rows: shape.rows.clone(),
            interfaces: shape.interfaces.clone(),
            coupling: vec![Six::ZERO; tips],
            flexibility: vec![Six::ZERO; tips * tips],
            reach: vec![Six::ZERO; tips],
            r: zeros,
        }
    }

    /// Factors with the modal diagonal `lambda`, after the body's first pass, where the children's inertias are felt; returns that of the
    /// body with its modes at O in inertial axes.
    #[inline(always)]
    pub fn factor<L: Lanes>(
        &mut self,
        s: L,
        body: &mut FlexibleLink,
        shape: &ModalShape,
        lambda: &[f64],
    ) -> Result<Inertia<L::V>, Doubtful> {
        if !lambda.iter().all(|l| *l > 0.0) {
            return Err(Doubtful);
        }
        fill(lambda, &mut self.scale);
        for x in self.scale.as_flattened_mut().iter_mut().take(lambda.len()) {
            *x = 1.0 / x.sqrt();
        }
        let (rows, rigid) = body.present(shape);
        scale_rows(s, rows, &self.scale, &mut self.rows);
        let mut P = Six::ZERO;
        leave_residual(s, rigid, &self.rows, &mut P);
        let tips = body.tips.len();
        for a in 0..tips {
            scale_rows(s, &shape.interfaces[a], &self.scale, &mut self.interfaces[a]);
            gram(s, &self.rows, &self.interfaces[a], &mut self.coupling[a]);
            let (tip, rotation) = (&mut body.tips[a], &body.rotation);
            let (S, _) = tip.gather(s, rotation);
            tip.turn_inertia(s, &S, &mut body.inertia[a]);
            if !tip.reach(s, &self.coupling[a]) {
                return Err(Doubtful);
            }
        }
        for a in 0..tips {
            for b in 0..tips {
                gram(s, &self.interfaces[a], &self.interfaces[b], &mut self.flexibility[a * tips + b]);
            }
        }
        match tips {
            0 => {}
            1 => inverse_sum(s, &body.inertia[0], &self.flexibility[0], &mut body.N[0]).ok_or(Doubtful)?,
            _ => inverse_sum_of_blocks(tips, &body.inertia, &self.flexibility, &mut body.work, &mut body.N).ok_or(Doubtful)?,
        }
        for b in 0..tips {
            let mut sum = Six::ZERO;
            for a in 0..tips {
                let part = body.tips[a].Z.times(s, &body.N[a * tips + b]);
                for j in 0..6 {
                    let (own, other) = (sum.column(s, j), part.column(s, j));
                    sum.put(s, j, [s.add(own[0], other[0]), s.add(own[1], other[1])]);
                }
            }
            sum.add_times_transposed(s, &body.tips[b].Z, &mut P);
            self.reach[b] = sum;
        }
        let mut felt = Felt::turned(s, &P, [s.splat(0.0); 2], &body.rotation);
        if body.is_offset {
            felt.shift(s, s.combine(columns_of(s, &body.rotation), s.of_three((-body.origin).into())));
        }
        Ok(felt.inertia)
    }

    /// Inward: residual force at O in inertial axes of the body's modes, under `external` on them and what the moved children hand on.
    #[inline(always)]
    pub fn take_forces<L: Lanes>(&mut self, s: L, body: &mut FlexibleLink, external: &[f64]) -> Pair<L::V> {
        fill(external, &mut self.r);
        for (r, scale) in self.r.iter_mut().zip(&self.scale) {
            *r = s.store(s.mul(s.load(*r), s.load(*scale)));
        }
        let (axes, back) = (columns_of(s, &body.rotation), rows_of(s, &body.rotation));
        let mut z = [s.splat(0.0); 2];
        for (tip, rows) in body.tips.iter().zip(&self.interfaces) {
            let wrench = tip.felt.wrench(s);
            let felt = [s.combine(back, wrench[0]), s.combine(back, wrench[1])];
            z = [s.add(s.add(z[0], felt[0]), s.cross(s.of_three(tip.position.into()), felt[1])), s.add(z[1], felt[1])];
            take_transposed(s, rows, tip.turn_back(s, felt), &mut self.r);
        }
        let felt = product(s, &self.rows, &self.r);
        z = [s.add(z[0], felt[0]), s.add(z[1], felt[1])];
        for ((tip, rows), reach) in body.tips.iter_mut().zip(&self.interfaces).zip(&self.reach) {
            let e = product(s, rows, &self.r);
            tip.e = [s.store(e[0]), s.store(e[1])];
            let felt = reach.apply(s, e);
            z = [s.add(z[0], felt[0]), s.add(z[1], felt[1])];
        }
        // B lies at `-origin` from O
        let moment = s.sub(z[0], s.cross(s.of_three(body.origin.into()), z[1]));
        [s.combine(axes, moment), s.combine(axes, z[1])]
    }

    /// Outward: accelerations of the modes into `modal`, and those of the moved children's frames; `outer` is the acceleration at O, inertial
    /// axes.
    #[inline(always)]
    pub fn follow<L: Lanes>(&mut self, s: L, body: &mut FlexibleLink, outer: Pair<L::V>, modal: &mut [f64]) {
        let back = rows_of(s, &body.rotation);
        let turning = s.combine(back, outer[0]);
        let alpha = [turning, s.sub(s.combine(back, outer[1]), s.cross(turning, s.of_three(body.origin.into())))];
        take_transposed(s, &self.rows, alpha, &mut self.r);
        // Phi eta_ddot = e - F' Phi' alpha - Phi Phi' y, y = N (e + Z' alpha)
        let tips = body.tips.len();
        for a in 0..tips {
            let mut y = [s.splat(0.0); 2];
            for b in 0..tips {
                let (e, reached) = (body.tips[b].e, body.tips[b].Z.apply_transposed(s, alpha));
                let driven = [s.add(s.load(e[0]), reached[0]), s.add(s.load(e[1]), reached[1])];
                let part = body.N[a * tips + b].apply(s, driven);
                y = [s.add(y[0], part[0]), s.add(y[1], part[1])];
            }
            take_transposed(s, &self.interfaces[a], y, &mut self.r);
            body.y[a] = [s.store(y[0]), s.store(y[1])];
        }
        for (r, scale) in self.r.iter_mut().zip(&self.scale) {
            *r = s.store(s.mul(s.load(*r), s.load(*scale)));
        }
        spill(&self.r, modal);
        for a in 0..tips {
            let tip = &mut body.tips[a];
            let carried = self.coupling[a].apply_transposed(s, alpha);
            let mut moved = [s.sub(s.load(tip.e[0]), carried[0]), s.sub(s.load(tip.e[1]), carried[1])];
            for b in 0..tips {
                let y = &body.y[b];
                let held = self.flexibility[a * tips + b].combine(s, [y[0][0], y[0][1], y[0][2], y[1][0], y[1][1], y[1][2]]);
                moved = [s.sub(moved[0], held[0]), s.sub(moved[1], held[1])];
            }
            tip.accelerate(s, &body.rotation, alpha, moved);
        }
    }
}

/// `rows` with every mode times its `scale`.
#[inline(always)]
fn scale_rows<L: Lanes>(s: L, rows: &[Block<6>], scale: &[[f64; 4]], out: &mut [Block<6>]) {
    for ((rows, scale), out) in rows.iter().zip(scale).zip(out) {
        let scale = s.load(*scale);
        for r in 0..6 {
            out[r] = s.store(s.mul(s.load(rows[r]), scale));
        }
    }
}
