//! Inertia sweep of rigid trees whose masses differ by orders of magnitude, on factors `P = C C*`.
//!
//! Reads: [`PoseScratch`]. Writes: [`GradedInertia`] and the hinge's part of [`BodyInertia`]. Source: Paper Eq. 33 in square-root form.
//! Cost: O(bodies), about three times that of the plain sweep.
//!
//! A light link that carries a heavy one leaves `P+ = P - G D G*` with the small difference of large numbers: what is left of the heavy
//! inertia is as small as the link's own, and its digits were lost where the heavy inertia was turned into the link's axes. The columns
//! of `C` keep large and small apart: with `y = C* h`, a reflection that moves all of `h`'s share into one column leaves that column out
//! (`P+ = C Q (1 - e e*) Q* C*`), and no sum of large numbers is ever formed. The reflection takes the largest share as its pivot, so that
//! small columns are changed by small multiples of large ones only.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/mod.rs")]

use super::inertia_inward::{BodyInertia, SINGULAR, SingularPivot, check_pivot, rough_size};
use super::pose_outward::PoseScratch;
use crate::model::hinge::MAX_RATES;
use crate::model::{BodyKind, HingeKind, System};
use crate::spatial::SpatialInertia;
use crate::spatial::shift::{force_from, motion_to, rotate, rotate_back, spatial};
use nalgebra::{Matrix3, Vector3, Vector6};

/// Ratio of a body's mass to that of one that carries it from which the plain sweep would lose too many digits: four of sixteen.
const GRADED: f64 = 1e4;

/// Columns of an inertia, as many as it has directions.
type Factor = [Vector6<f64>; 6];

/// Factors of a tree.
#[derive(Debug, Clone)]
pub struct GradedInertia {
    /// Of each body's own inertia at O in O axes.
    own: Vec<Factor>,
    /// Of `P+` at O in O axes.
    outer: Vec<Factor>,
    /// What one body gathers: its own columns and those of its children.
    columns: Vec<Vector6<f64>>,
}

impl GradedInertia {
    /// Room for `system`, if it is a tree of rigid bodies some of which are much heavier than one that carries them.
    #[must_use]
    pub fn new(system: &System) -> Option<Self> {
        if !system.closures.is_empty() {
            return None;
        }
        let mut own = Vec::with_capacity(system.bodies.len());
        let (mut lightest, mut children) = (vec![f64::INFINITY; system.bodies.len()], vec![0_usize; system.bodies.len()]);
        let mut graded = false;
        for (k, body) in system.bodies.iter().enumerate() {
            let BodyKind::Rigid(inertia) = &body.kind else { return None };
            let mass = body.mass();
            let carrying = body.parent.map_or(f64::INFINITY, |p| lightest[p]);
            graded |= mass > GRADED * carrying;
            // a body without mass leaves nothing small behind
            lightest[k] = if mass > 0.0 { carrying.min(mass) } else { carrying };
            if let Some(parent) = body.parent {
                children[parent] += 1;
            }
            own.push(factor_of(inertia));
        }
        let most = children.into_iter().max().unwrap_or(0);
        graded.then(|| Self { outer: vec![[Vector6::zeros(); 6]; own.len()], own, columns: Vec::with_capacity(6 * (most + 1)) })
    }

    /// Hinge of body `k`: as the plain sweep leaves it, and the factor that the parent gathers.
    pub(super) fn eliminate(
        &mut self,
        system: &System,
        pose: &PoseScratch,
        k: usize,
        children: &[usize],
        own: &mut BodyInertia,
    ) -> Result<(), SingularPivot> {
        let (body, at) = (&system.bodies[k], &pose.bodies[k]);
        let Self { own: factors, outer, columns } = self;
        columns.clear();
        columns.extend(factors[k]);
        for &child in children {
            let from = &pose.bodies[child];
            columns.extend(outer[child].map(|c| force_from(&from.l, &rotate(&from.rotation, &c))));
        }
        // squares of magnitudes of what the shares of the columns are sums of, in the axes in which they were found
        let terms = |h: &Vector6<f64>| {
            let square = |x: &Vector6<f64>, factor: &Factor| factor.iter().map(|c| c.abs().dot(&x.abs()).powi(2)).sum::<f64>();
            let seen = |child: usize| rotate_back(&pose.bodies[child].rotation, &motion_to(&pose.bodies[child].l, h));
            square(h, &factors[k]) + children.iter().map(|&child| square(&seen(child), &outer[child])).sum::<f64>()
        };
        own.P_hinge = product(columns);
        let moves = !body.hinge.is_prescribed();
        let m = if moves { body.hinge.kind.rate_count() } else { 0 };
        let mut U = [Vector6::zeros(); MAX_RATES];
        for i in 0..m {
            let h = &at.hinge.map[i];
            let w = columns.iter().map(|c| c * c.dot(h)).sum::<Vector6<f64>>();
            let pivot = columns.iter().map(|c| c.dot(h).powi(2)).sum::<f64>();
            own.D[i][i] = pivot;
            // rounding is that of the shares, whose squares add up to the pivot
            check_pivot(i, pivot.sqrt(), rough_size(&own.P_hinge, h).sqrt(), || terms(h).sqrt())
                .map_err(|(rate, share, scale)| (rate, share * share, scale * scale))?;
            for r in i + 1..m {
                own.D[r][i] = at.hinge.map[r].dot(&w) / pivot;
            }
            U[i] += w;
            for r in i + 1..m {
                U[r] += w * own.D[r][i];
            }
            leave_out(columns, |c| c.dot(h));
        }
        own.P_plus = if m > 0 && matches!(body.hinge.kind, HingeKind::Free) { SpatialInertia::default() } else { product(columns) };
        own.solve_gain(&U[..m]);
        reduce(columns);
        let outer = &mut outer[k];
        outer.fill(Vector6::zeros());
        if !matches!(body.hinge.kind, HingeKind::Free) {
            outer.iter_mut().zip(columns.iter()).for_each(|(out, column)| *out = *column);
        }
        Ok(())
    }
}

/// `C C*`.
fn product(columns: &[Vector6<f64>]) -> SpatialInertia {
    let mut sum = SpatialInertia::default();
    columns.iter().for_each(|c| sum.subtract_outer(c, -1.0));
    sum
}

/// A factor of a rigid body's inertia: the momenta of unit energies along the axes at its centre of mass, and about its principal axes.
fn factor_of(inertia: &SpatialInertia) -> Factor {
    let mass = inertia.translational[(0, 0)];
    let c = if mass > 0.0 { inertia.first_moment() / mass } else { Vector3::zeros() };
    let central = inertia.rotational - (Matrix3::from_diagonal_element(c.norm_squared()) - c * c.transpose()) * mass;
    let principal = ((central + central.transpose()) * 0.5).symmetric_eigen();
    // of a point mass: what is left of the inertia about O once that of the mass is taken off is rounding
    let rounding = SINGULAR * inertia.rotational.trace();
    std::array::from_fn(|i| {
        if i < 3 {
            let push = Vector3::ith(i, mass.sqrt());
            spatial(&c.cross(&push), &push)
        } else {
            let value = principal.eigenvalues[i - 3];
            let size = if value > rounding { value.sqrt() } else { 0.0 };
            spatial(&(principal.eigenvectors.column(i - 3) * size), &Vector3::zeros())
        }
    })
}

/// Reflects the columns so that `share` of all but one is zero; moves that one to the end and returns it.
fn gather(columns: &mut [Vector6<f64>], share: impl Fn(&Vector6<f64>) -> f64) -> bool {
    let Some(last) = columns.len().checked_sub(1) else { return false };
    let mut pivot = 0;
    let mut sum = 0.0;
    for (j, column) in columns.iter().enumerate() {
        let y = share(column);
        sum += y * y;
        if y.abs() > share(&columns[pivot]).abs() {
            pivot = j;
        }
    }
    if sum == 0.0 {
        return false;
    }
    columns.swap(pivot, last);
    let (y, norm) = (share(&columns[last]), sum.sqrt());
    // v = y with the pivot's entry raised by the norm, away from cancellation; columns change by -2 v (C v) / v^2
    let raised = y + norm.copysign(y);
    let mut along = columns[last] * raised;
    for column in &columns[..last] {
        along += column * share(column);
    }
    let scale = 1.0 / (norm * (norm + y.abs()));
    for column in &mut columns[..last] {
        *column -= along * (scale * share(column));
    }
    columns[last] -= along * (scale * raised);
    true
}

/// Takes the direction of `share` out of the inertia.
fn leave_out(columns: &mut Vec<Vector6<f64>>, share: impl Fn(&Vector6<f64>) -> f64) {
    if gather(columns, share) {
        columns.pop();
    }
}

/// At most six columns of the same inertia: those that reflections make triangular, the largest entry first.
fn reduce(columns: &mut Vec<Vector6<f64>>) {
    let mut left = columns.len();
    let mut rows = [true; 6];
    while left > 0 && columns.len() > 6 {
        let largest = |row: &usize| columns[..left].iter().fold(0.0_f64, |a, c| a.max(c[*row].abs()));
        let Some(row) = (0..6).filter(|&r| rows[r]).max_by(|a, b| largest(a).total_cmp(&largest(b))) else {
            // every row of what is left is zero
            columns.drain(..left);
            return;
        };
        rows[row] = false;
        if gather(&mut columns[..left], |c| c[row]) {
            for column in &mut columns[..left - 1] {
                column[row] = 0.0;
            }
            left -= 1;
        }
    }
}
