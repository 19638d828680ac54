//! Inertia sweep: articulated inertias `P`, `P+` and gains, from the tips to the base.
//!
//! Reads: [`PoseScratch`]. Writes: [`InertiaScratch`]. Source: Paper Eq. 32 (with the whole `M_fl`) and 33.
//!
//! Where modes move the inboard hinge, Eq. 32 as printed subtracts large terms from each other. The same `P_cr+` is found here without
//! cancellation: with B held as for any body, `P_B+ = P_rr - mu D^-1 mu'`; the acceleration of O per force at O is then
//! `Lambda = Pi D^-1 Pi' + X P_B+^-1 X'`, `X = phi* - Pi D^-1 mu'`, a sum of two semidefinite terms, and `P(k') = Lambda^-1`.
//! Cost: O(bodies + modes), plus O(children^2 modes) per flexible body.
//!
//! The same sweep factors `M + N` of a linearly implicit integrator, N block diagonal over modes and hinges ([`AddedInertia`]): `D` of a
//! hinge becomes `H P H* + N`, the unit modal mass `Lambda`, and every formula above stays as it is.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/mod.rs")]

use super::graded::GradedInertia;
use super::pose_outward::PoseScratch;
use crate::dynamics::DynamicsError;
use crate::dynamics::added_inertia::{AddedInertia, HingeBlock};
use crate::dynamics::aggregate::inertia::AggregateInertia;
use crate::dynamics::modal_block::{ModalBlock, SingularBlock, outer_sum};
use crate::model::hinge::MAX_RATES;
use crate::model::{Body, BodyKind, HingeKind, Role, System};
use crate::spatial::SpatialInertia;
use crate::spatial::shift::{force_from, motion_to, rotate_back};
use nalgebra::{Matrix6, Vector3, Vector6};

/// What the sweep leaves of one hinge.
#[derive(Debug, Clone, Copy, Default)]
pub struct BodyInertia {
    /// Articulated inertia of the recursion's frame (O, or B of a flexible body): `P_rr`.
    pub P: SpatialInertia,
    /// `P(k')` at O in O axes; equal to `P` for a rigid body.
    pub P_hinge: SpatialInertia,
    /// `P+(k')` at O in O axes.
    pub P_plus: SpatialInertia,
    /// `P+(k')` at O in the axes of the parent's frame.
    pub S: SpatialInertia,
    /// `P H* D^-1`, one column per rate.
    pub G: [Vector6<f64>; MAX_RATES],
    /// `L D L'` of the hinge inertia D: unit lower triangle row by row, pivots on the diagonal.
    pub D: [[f64; MAX_RATES]; MAX_RATES],
}

/// What the sweep leaves of one flexible body.
#[derive(Debug, Clone)]
pub struct FlexibleElimination {
    /// Factored `D_fl`.
    pub modal_block: ModalBlock,
    /// `mu' = P_fr`, one row per mode, at B.
    pub mu: Vec<Vector6<f64>>,
    /// `E = D_fl^-1 mu'`, one row per mode.
    pub gain_modal: Vec<Vector6<f64>>,
    /// Children that the modes move.
    pub moved_children: Vec<usize>,
    /// What a root that the modes move needs beside these.
    pub root: Option<RootElimination>,
}

/// The inboard hinge of a body whose modes move it; all in B axes, O being the point of the hinge.
#[derive(Debug, Clone)]
pub struct RootElimination {
    /// `Pi(O)`, one row per mode.
    pub shape: Vec<Vector6<f64>>,
    /// Modal acceleration per force at O, one row per mode.
    pub modal_per_force: Vec<Vector6<f64>>,
    /// Acceleration of B per force at O.
    pub frame_per_force: Matrix6<f64>,
    /// `P_B+^-1`.
    pub frame_inverse: Matrix6<f64>,
    /// `P(k') = Lambda^-1` at O in B axes.
    pub P: Matrix6<f64>,
}

/// What the inertia sweep writes.
#[derive(Debug, Clone)]
pub struct InertiaScratch {
    /// One per body.
    pub bodies: Vec<BodyInertia>,
    /// One per flexible body, in the order of [`PoseScratch::flexible`].
    pub flexible: Vec<FlexibleElimination>,
    /// One per aggregate.
    pub aggregates: Vec<AggregateInertia>,
    /// Whether something was added to the mass matrix, so that a free hinge transmits forces.
    pub with_added: bool,
    /// Factors of the inertias, for systems whose masses ask for them.
    pub graded: Option<Box<GradedInertia>>,
    /// Per body: its children, for those whose hinge inertia is doubtful.
    children: Vec<Vec<usize>>,
}

impl InertiaScratch {
    /// Room for `system`.
    #[must_use]
    pub fn new(system: &System) -> Self {
        let (mut children, mut all_children) = (vec![Vec::new(); system.bodies.len()], vec![Vec::new(); system.bodies.len()]);
        let inside = |k, parent| system.aggregates.iter().any(|a| a.member_of(k).is_some() && a.member_of(parent).is_some());
        for (k, body) in system.bodies.iter().enumerate() {
            let Some(parent) = body.parent else { continue };
            all_children[parent].push(k);
            if body.parent_side.moves() && !inside(k, parent) {
                children[parent].push(k);
            }
        }
        let eliminate = |(k, body): (usize, &Body)| {
            body.flexible().map(|flexible| {
                let n = flexible.mode_count();
                FlexibleElimination {
                    modal_block: ModalBlock::new(n, children[k].len()),
                    mu: vec![Vector6::zeros(); n],
                    gain_modal: vec![Vector6::zeros(); n],
                    moved_children: children[k].clone(),
                    root: flexible.inboard.moves().then(|| RootElimination::new(n)),
                }
            })
        };
        Self {
            bodies: vec![BodyInertia::default(); system.bodies.len()],
            flexible: system.bodies.iter().enumerate().filter_map(eliminate).collect(),
            aggregates: system.aggregates.iter().map(AggregateInertia::new).collect(),
            with_added: false,
            graded: GradedInertia::new(system).map(Box::new),
            children: all_children,
        }
    }
}

/// Fills `out` from the poses.
///
/// # Errors
/// [`DynamicsError`] naming the hinge or body whose inertia is singular.
pub fn inertia_inward(system: &System, pose: &PoseScratch, out: &mut InertiaScratch) -> Result<(), DynamicsError> {
    inertia_inward_with(system, pose, None, out)
}

/// Fills `out` from the poses, for the mass matrix with `added` on its diagonal blocks.
///
/// # Errors
/// [`DynamicsError`] naming the hinge or body whose inertia is singular.
pub fn inertia_inward_with(
    system: &System,
    pose: &PoseScratch,
    added: Option<&AddedInertia>,
    out: &mut InertiaScratch,
) -> Result<(), DynamicsError> {
    out.with_added = added.is_some();
    for (k, body) in system.bodies.iter().enumerate() {
        out.bodies[k].P = match (&body.kind, pose.bodies[k].flexible) {
            (BodyKind::Rigid(inertia), _) => *inertia,
            (BodyKind::Flexible(_), index) => index.map_or(SpatialInertia::default(), |i| pose.flexible[i].inertia.rigid),
        };
    }
    for (k, body) in system.bodies.iter().enumerate().rev() {
        let role = system.role(k);
        if let Role::Member(_) = role {
            continue;
        }
        if let Role::Heads(index) = role {
            let felt = eliminate_aggregate(system, pose, index, added, out)?;
            let aggregate = &system.aggregates[index];
            if !aggregate.holds_root_modes {
                if let Some(root) = aggregate.root {
                    out.bodies[root].P = out.bodies[root].P.plus(&felt);
                }
                continue;
            }
            out.bodies[k].P_hinge = felt;
        } else if let Some(index) = pose.bodies[k].flexible {
            let diagonal = added.map(|a| &a.modal[body.modal_range()]);
            eliminate_modes(pose, k, index, diagonal, out)
                .map_err(|SingularBlock { empty }| DynamicsError::SingularModes { body: body.name.clone(), empty })?;
        } else {
            out.bodies[k].P_hinge = out.bodies[k].P;
        }
        let block = added.and_then(|a| a.block(system, k));
        let map = &pose.bodies[k].hinge.map;
        let children = &out.children;
        let (inner, outer) = out.bodies.split_at_mut(k + 1);
        let own = &mut inner[k];
        // whatever moves or holds the frame beside its children makes the rough size the best that is known
        let exact = matches!((&body.kind, role), (BodyKind::Rigid(_), Role::Own));
        let terms = |h: &Vector6<f64>| if exact { sum_of_terms(system, pose, k, h, &children[k], outer) } else { f64::INFINITY };
        match out.graded.as_deref_mut().filter(|_| added.is_none()) {
            Some(graded) => graded.eliminate(system, pose, k, &children[k], own),
            None => eliminate_hinge(body, map, block.as_ref(), own, terms),
        }
        .map_err(|pivot| DynamicsError::of_hinge(system, pose, k, pivot))?;
        if let Some(parent) = body.parent {
            let own = &mut out.bodies[k];
            own.S = own.P_plus.rotated(&pose.bodies[k].rotation);
            let felt = own.S.moved_by(&pose.bodies[k].l);
            out.bodies[parent].P = out.bodies[parent].P.plus(&felt);
        }
    }
    Ok(())
}

/// Aggregate `index` (Eq. 62): the inertia that its root's frame feels.
fn eliminate_aggregate(
    system: &System,
    pose: &PoseScratch,
    index: usize,
    added: Option<&AddedInertia>,
    out: &mut InertiaScratch,
) -> Result<SpatialInertia, DynamicsError> {
    let aggregate = &system.aggregates[index];
    for member in &aggregate.members {
        if let Some(flexible) = pose.bodies[member.body].flexible {
            gather_rows(pose, flexible, out);
        }
    }
    let InertiaScratch { bodies, flexible, aggregates, .. } = out;
    aggregates[index].eliminate(system, pose, aggregate, &pose.embeddings[index], added, bodies, flexible).map_err(|singular| {
        let (coordinate, body) = aggregate.name_of(system, singular.coordinate);
        DynamicsError::SingularAggregate {
            closures: aggregate.closure_names(system),
            coordinate,
            body,
            inertia: singular.inertia,
            scale: singular.scale,
        }
    })
}

/// `mu' = P_fr` of a flexible body: its own rows and what the children that its modes move add.
fn gather_rows(pose: &PoseScratch, index: usize, out: &mut InertiaScratch) {
    let FlexibleElimination { mu, moved_children, .. } = &mut out.flexible[index];
    mu.copy_from_slice(&pose.flexible[index].inertia.row);
    for &child in moved_children.iter() {
        let own = &pose.bodies[child];
        let S = &out.bodies[child].S;
        let shape = own.shape.map_or(&[][..], |start| &pose.shape[start..start + mu.len()]);
        for (mu, y) in mu.iter_mut().zip(shape) {
            *mu += force_from(&own.l, &S.times(y));
        }
    }
}

/// Modes of flexible body `k`: `P_cr+ = P_rr - mu D_fl^-1 mu'` (Eq. 32), moved to O.
fn eliminate_modes(
    pose: &PoseScratch,
    k: usize,
    index: usize,
    diagonal: Option<&[f64]>,
    out: &mut InertiaScratch,
) -> Result<(), SingularBlock> {
    let part = &pose.flexible[index];
    gather_rows(pose, index, out);
    let FlexibleElimination { modal_block, mu, gain_modal, moved_children, root } = &mut out.flexible[index];
    modal_block.begin(diagonal);
    for &child in moved_children.iter() {
        let S = out.bodies[child].S;
        let shape = pose.bodies[child].shape.map_or(&[][..], |start| &pose.shape[start..start + mu.len()]);
        modal_block.add_child(|Y| Y.copy_from_slice(shape), &S)?;
    }
    gain_modal.copy_from_slice(mu);
    modal_block.solve_rows(gain_modal);

    let own = &mut out.bodies[k];
    let left = own.P.matrix() - outer_sum(mu, gain_modal);
    let (x, turned) = (part.inboard.position, part.inboard.rotation.transpose());
    own.P_hinge = match root {
        // from B to O at x: the origin of B lies at -x from O
        None => SpatialInertia::from_matrix(&left).moved_by(&-x).rotated(&turned),
        Some(root) => {
            root.eliminate(&x, &part.shape_inboard, &left, modal_block, gain_modal)?;
            SpatialInertia::from_matrix(&root.P).rotated(&turned)
        }
    };
    Ok(())
}

impl RootElimination {
    fn new(n: usize) -> Self {
        let rows = vec![Vector6::zeros(); n];
        let zero = Matrix6::zeros();
        Self { shape: rows.clone(), modal_per_force: rows, frame_per_force: zero, frame_inverse: zero, P: zero }
    }

    /// From `P_B+` (`left`) and the gain `E` of the modes with B held to the inertia felt at O, which lies at `x`.
    fn eliminate(
        &mut self,
        x: &Vector3<f64>,
        shape_inboard: &[Vector6<f64>],
        left: &Matrix6<f64>,
        modal_block: &ModalBlock,
        gain_modal: &[Vector6<f64>],
    ) -> Result<(), SingularBlock> {
        for (s, b) in self.shape.iter_mut().zip(shape_inboard) {
            *s = motion_to(x, b);
        }
        self.modal_per_force.copy_from_slice(&self.shape);
        modal_block.solve_rows(&mut self.modal_per_force);
        let mut direct = outer_sum(&self.shape, &self.modal_per_force);
        // X = phi* - Pi E
        let mut X = -outer_sum(&self.shape, gain_modal);
        for i in 0..6 {
            let column = motion_to(x, &Vector6::ith(i, 1.0));
            let sum = X.column(i) + column;
            X.set_column(i, &sum);
        }
        let symmetric = (left + left.transpose()) * 0.5;
        let empty = || symmetric.symmetric_eigenvalues().min() >= -1e-9 * symmetric.trace();
        self.frame_inverse = symmetric.cholesky().ok_or_else(|| SingularBlock { empty: empty() })?.inverse();
        self.frame_per_force = self.frame_inverse * X.transpose();
        direct += X * self.frame_per_force;
        self.P = ((direct + direct.transpose()) * 0.5).cholesky().ok_or(SingularBlock { empty: false })?.inverse();
        for (m, e) in self.modal_per_force.iter_mut().zip(gain_modal) {
            *m -= self.frame_per_force.tr_mul(e);
        }
        Ok(())
    }
}

/// Pivots at or below this multiple of what they were formed from are rounding, not inertia.
pub const SINGULAR: f64 = 8.0 * f64::EPSILON;

/// What is wrong with a hinge: (rate, pivot, what the pivot was compared with).
pub(in crate::dynamics) type SingularPivot = (usize, f64, f64);

/// Refuses a pivot of the hinge of rate `rate` that is rounding of what it was formed from: of `size` at most, of `terms` at closer look.
///
/// `size` is the trace of `P`. It holds inertia about locked axes too, which may be far larger than what the hinge moves without adding a
/// digit of noise to it; so the sum of the magnitudes of the very terms is taken, where the rough size is not enough. A pivot that is not
/// a normal number has no inverse.
#[inline]
pub(super) fn check_pivot(rate: usize, pivot: f64, size: f64, terms: impl FnOnce() -> f64) -> Result<(), SingularPivot> {
    if pivot > SINGULAR * size && pivot >= f64::MIN_POSITIVE {
        return Ok(());
    }
    let scale = size.min(terms());
    if pivot > SINGULAR * scale && pivot >= f64::MIN_POSITIVE { Ok(()) } else { Err((rate, pivot, scale)) }
}

/// `sum |h_a| |M_ab| |h_b|` of a symmetric inertia.
fn magnitude(inertia: &SpatialInertia, h: &Vector6<f64>) -> f64 {
    h.abs().dot(&(inertia.matrix().abs() * h.abs()))
}

/// Magnitudes of what `h P h*` of rigid body `k` is the sum of: its own inertia, and that of each child before the child's hinge took its
/// share, in the axes in which it was found.
fn sum_of_terms(system: &System, pose: &PoseScratch, k: usize, h: &Vector6<f64>, children: &[usize], outer: &[BodyInertia]) -> f64 {
    let own = match &system.bodies[k].kind {
        BodyKind::Rigid(inertia) => magnitude(inertia, h),
        BodyKind::Flexible(_) => f64::INFINITY,
    };
    let of_child = |&child: &usize| {
        let (at, felt) = (&pose.bodies[child], &outer[child - k - 1].P_hinge);
        let seen = rotate_back(&at.rotation, &motion_to(&at.l, h));
        let moves = system.bodies[child].hinge.kind.rate_count() > 0 && !system.bodies[child].hinge.is_prescribed();
        if moves && system.bodies[child].mode_count() == 0 { magnitude(felt, &seen) } else { rough_size(felt, &seen) }
    };
    own + children.iter().map(of_child).sum::<f64>()
}

/// Size of `h P h*` and of all that may have cancelled in it.
pub(super) fn rough_size(P: &SpatialInertia, h: &Vector6<f64>) -> f64 {
    P.rotational.trace() * h.fixed_rows::<3>(0).norm_squared() + P.translational.trace() * h.fixed_rows::<3>(3).norm_squared()
}

/// Hinge of a body: `D = H P H*` and what is `added`, `G = P H* D^-1`, `P+ = P - G D G*` (Eq. 33). `terms`: see [`check_pivot`].
pub(in crate::dynamics) fn eliminate_hinge(
    body: &Body,
    map: &[Vector6<f64>; MAX_RATES],
    added: Option<&HingeBlock>,
    own: &mut BodyInertia,
    terms: impl Fn(&Vector6<f64>) -> f64,
) -> Result<(), SingularPivot> {
    own.P_plus = own.P_hinge;
    let m = body.hinge.kind.rate_count();
    if m == 0 || body.hinge.is_prescribed() {
        return Ok(());
    }
    let P = &own.P_hinge;
    let mut U = [Vector6::zeros(); MAX_RATES];
    for i in 0..m {
        U[i] = P.times(&map[i]);
    }
    let D = &mut own.D;
    for i in 0..m {
        for j in 0..=i {
            let mut sum = map[i].dot(&U[j]) + added.map_or(0.0, |n| n[i][j]);
            for c in 0..j {
                sum -= D[i][c] * D[c][c] * D[j][c];
            }
            D[i][j] = if i == j { sum } else { sum / D[j][j] };
        }
        check_pivot(i, D[i][i], rough_size(P, &map[i]), || terms(&map[i]))?;
    }
    if matches!(body.hinge.kind, HingeKind::Free) && added.is_none() {
        // nothing passes a free hinge: exactly zero instead of rounding
        own.P_plus = SpatialInertia::default();
    } else {
        // columns of U L^-T: P+ = P - sum w w' / d, symmetric as formed
        let mut w = U;
        for i in 0..m {
            for c in 0..i {
                let (done, rest) = w.split_at_mut(i);
                rest[0] -= done[c] * D[i][c];
            }
            own.P_plus.subtract_outer(&w[i], D[i][i]);
        }
    }
    own.solve_gain(&U[..m]);
    Ok(())
}

impl BodyInertia {
    /// `G = U D^-1` of `U = P H*`, one column per rate.
    pub(super) fn solve_gain(&mut self, U: &[Vector6<f64>]) {
        let m = U.len();
        for row in 0..6 {
            let mut x = [0.0; MAX_RATES];
            for i in 0..m {
                x[i] = U[i][row];
            }
            solve_hinge(&self.D, &mut x[..m]);
            for i in 0..m {
                self.G[i][row] = x[i];
            }
        }
    }
}

/// `x <- D^-1 x` with the factors of D.
pub fn solve_hinge(D: &[[f64; MAX_RATES]; MAX_RATES], x: &mut [f64]) {
    let m = x.len();
    for i in 0..m {
        for c in 0..i {
            x[i] -= D[i][c] * x[c];
        }
    }
    for i in 0..m {
        x[i] /= D[i][i];
    }
    for i in (0..m).rev() {
        for c in i + 1..m {
            x[i] -= D[c][i] * x[c];
        }
    }
}
