//! What of a flexible body never changes, shared by all bodies that are alike.

use super::rows::{Block, blocks_of, gram};
use super::six::Six;
use crate::model::flexible_body::ModalIntegrals;
use crate::model::{Attachment, FlexibleBody, InertiaOrder};
use crate::spatial::SpatialInertia;
use crate::spatial::lanes::{Lanes, Plain};
use nalgebra::{Matrix3, Vector6};
use std::sync::Arc;

/// Constants of a flexible body with the children that its modes move, all in the axes of its frame B.
#[derive(Debug, Clone)]
pub struct ModalShape {
    pub modes: usize,
    pub order: InertiaOrder,
    /// Rows `int rho phi_a r_b` (nine) and the momentum (three).
    pub integrals: Vec<Block<12>>,
    /// `M_fr` of the undeformed body: angular, linear.
    pub rows: Vec<Block<6>>,
    /// Mode shape of every moved child's interface (rotation; translation).
    pub interfaces: Vec<Vec<Block<6>>>,
    /// 1/s^2.
    pub stiffness: Vec<[f64; 4]>,
    /// 1/s.
    pub damping: Vec<[f64; 4]>,
    /// `Phi Phi'` of all pairs of interfaces, row by row.
    pub flexibility: Vec<Six>,
    /// `M_fr' Phi'` of every interface, undeformed.
    pub coupling: Vec<Six>,
    /// Inertia of the undeformed body that its modes leave to B: `M_rr - M_fr' M_fr`.
    pub residual: Six,
    /// Undeformed.
    pub rigid: SpatialInertia,
    source: Source,
}

/// What makes two bodies alike.
#[derive(Debug, Clone)]
struct Source {
    integrals: Arc<ModalIntegrals>,
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    interfaces: Vec<Vec<Vector6<f64>>>,
}

impl ModalShape {
    /// Index in `known` of the constants of `body`, whose modes move `children`; added if they are new.
    pub fn find(known: &mut Vec<Self>, body: &FlexibleBody, children: &[&Attachment]) -> usize {
        let alike = |s: &Self| {
            let shapes = || s.source.interfaces.iter().zip(children).all(|(a, b)| *a == b.mode_shape);
            Arc::ptr_eq(&s.source.integrals, &body.integrals)
                && s.order == body.order
                && s.source.interfaces.len() == children.len()
                && s.source.stiffness == body.stiffness
                && s.source.damping == body.damping
                && shapes()
        };
        known.iter().position(alike).unwrap_or_else(|| {
            known.push(Self::new(body, children));
            known.len() - 1
        })
    }

    fn new(body: &FlexibleBody, children: &[&Attachment]) -> Self {
        let (n, of) = (body.mode_count(), &body.integrals);
        let w = |a: usize, b: usize, j: usize| of.shape_position[(3 * a + b) * n + j];
        let integrals = blocks_of(n, |row, j| if row < 9 { w(row / 3, row % 3, j) } else { of.momentum[j][row - 9] });
        let rows: Vec<Block<6>> = blocks_of(n, |row, j| {
            let rotary = |c: usize| of.rotary.get(j).map_or(0.0, |r| r[c]);
            match row {
                0 => w(2, 1, j) - w(1, 2, j) + rotary(0),
                1 => w(0, 2, j) - w(2, 0, j) + rotary(1),
                2 => w(1, 0, j) - w(0, 1, j) + rotary(2),
                _ => of.momentum[j][row - 3],
            }
        });
        let interfaces: Vec<Vec<Block<6>>> = children.iter().map(|a| blocks_of(n, |row, j| a.mode_shape[j][row])).collect();
        let pairs = interfaces.iter().flat_map(|a| interfaces.iter().map(move |b| (a, b)));
        let flexibility = pairs.map(|(a, b)| product_of(a, b)).collect();
        let inertia = Matrix3::from_diagonal_element(of.second_moment.trace()) - of.second_moment;
        let rigid = SpatialInertia::rigid(of.mass, &of.first_moment, &((inertia + inertia.transpose()) * 0.5));
        Self {
            modes: n,
            order: body.order,
            coupling: interfaces.iter().map(|phi| product_of(&rows, phi)).collect(),
            residual: {
                let mut residual = Six::ZERO;
                leave_residual(Plain, &rigid, &rows, &mut residual);
                residual
            },
            rigid,
            integrals,
            rows,
            interfaces,
            stiffness: blocks_of::<1>(n, |_, j| body.stiffness[j]).into_iter().flatten().collect(),
            damping: blocks_of::<1>(n, |_, j| body.damping[j]).into_iter().flatten().collect(),
            flexibility,
            source: Source {
                integrals: Arc::clone(&body.integrals),
                stiffness: body.stiffness.clone(),
                damping: body.damping.clone(),
                interfaces: children.iter().map(|a| a.mode_shape.clone()).collect(),
            },
        }
    }
}

/// `a b'` of two sets of rows.
fn product_of(a: &[Block<6>], b: &[Block<6>]) -> Six {
    let mut out = Six::ZERO;
    gram(Plain, a, b, &mut out);
    out
}

/// Leaves `M_rr - M_fr' M_fr`.
#[inline(always)]
pub fn leave_residual<L: Lanes>(s: L, rigid: &SpatialInertia, rows: &[Block<6>], out: &mut Six) {
    gram(s, rows, rows, out);
    for j in 0..3 {
        let [top, bottom] = out.column(s, j);
        let (r, c) = (&rigid.rotational, &rigid.coupling);
        let own = [s.of_three([r[(0, j)], r[(1, j)], r[(2, j)]]), s.of_three([c[(j, 0)], c[(j, 1)], c[(j, 2)]])];
        out.put(s, j, [s.sub(own[0], top), s.sub(own[1], bottom)]);
        let ([top, bottom], t) = (out.column(s, j + 3), &rigid.translational);
        let own = [s.of_three([c[(0, j)], c[(1, j)], c[(2, j)]]), s.of_three([t[(0, j)], t[(1, j)], t[(2, j)]])];
        out.put(s, j + 3, [s.sub(own[0], top), s.sub(own[1], bottom)]);
    }
}
