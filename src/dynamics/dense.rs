//! The slow twin of the recursion: dense mass matrix from body Jacobians, solved by faer.
//!
//! Columns of the Jacobians come from velocity sweeps with one unit rate at a time, the bias from the Newton-Euler sweep at zero free
//! acceleration; the recursion's articulated quantities are not used. For tests, audits and small systems.

use super::Workspace;
use super::closed_chain::constraint::Motion;
use super::closed_chain::least_norm::least_norm;
use super::inverse::NewtonEuler;
use super::sweep::{force_inward, pose_outward, velocity_outward};
use crate::model::{BodyKind, State, System};
use faer::Mat;
use faer::linalg::solvers::Solve;
use nalgebra::{DMatrix, DVector};

/// Dense equations of motion `M u_dot + C = Q`, u = (hinge rates; modal rates).
#[derive(Debug, Clone)]
pub struct DenseEquations {
    /// Mass matrix.
    pub mass: DMatrix<f64>,
    /// `Q - C`: applied forces less bias, with every free acceleration zero and prescribed ones as given.
    pub force: DVector<f64>,
    /// Indices of free coordinates.
    pub free: Vec<usize>,
    /// Accelerations of all coordinates with the free ones zero.
    pub prescribed: DVector<f64>,
    /// G: motion along the closures' blocked directions per rate.
    pub closure_map: DMatrix<f64>,
    /// Acceleration along them with every free acceleration zero.
    pub closure_bias: DVector<f64>,
}

/// Assembles the equations at `state`.
#[must_use]
pub fn equations(system: &System, state: &State) -> DenseEquations {
    let (nv, nm) = (system.velocity_count, system.modal_count);
    let n = nv + nm;
    let mut workspace = Workspace::new(system);
    pose_outward::pose_outward(system, state, &mut workspace.pose);

    // body velocities per unit rate
    let mut unit = state.clone();
    let mut columns = Vec::with_capacity(n);
    let mut closure_map = DMatrix::zeros(system.closure_rows(), n);
    for i in 0..n {
        unit.velocity.fill(0.0);
        unit.modal_velocity.fill(0.0);
        if i < nv {
            unit.velocity[i] = 1.0
        } else {
            unit.modal_velocity[i - nv] = 1.0
        }
        velocity_outward::velocity_outward(system, &unit, &workspace.pose, &mut workspace.velocity);
        if let Some(chain) = &workspace.closed {
            chain.rates(system, &unit, &workspace.pose, &workspace.velocity, closure_map.column_mut(i).as_mut_slice());
        }
        columns.push(workspace.velocity.bodies.iter().map(|b| b.V).collect::<Vec<_>>());
    }
    let mut mass = DMatrix::zeros(n, n);
    for (k, body) in system.bodies.iter().enumerate() {
        for i in 0..n {
            let x = columns[i][k];
            let (mut momentum, mut modal) = (nalgebra::Vector6::zeros(), vec![0.0; body.mode_count()]);
            match (&body.kind, workspace.pose.bodies[k].flexible) {
                (BodyKind::Rigid(inertia), _) => momentum = inertia.times(&x),
                (BodyKind::Flexible(_), Some(index)) => {
                    let inertia = &workspace.pose.flexible[index].inertia;
                    momentum = inertia.rigid.times(&x);
                    for (j, m) in body.modal_range().enumerate() {
                        let own = if i == nv + m { 1.0 } else { 0.0 };
                        momentum += inertia.row[j] * own;
                        modal[j] = own + inertia.row[j].dot(&x);
                    }
                }
                (BodyKind::Flexible(_), None) => {}
            }
            for (j, column) in columns.iter().enumerate() {
                mass[(j, i)] += column[k].dot(&momentum);
            }
            for (j, m) in body.modal_range().enumerate() {
                mass[(nv + m, i)] += modal[j];
            }
        }
    }

    // bias from the independent sweep, with loads as the force sweep finds them
    velocity_outward::velocity_outward(system, state, &workspace.pose, &mut workspace.velocity);
    force_inward::gather_applied(system, state, &workspace.pose, &mut workspace.force);
    let mut prescribed = DVector::zeros(n);
    let mut is_free = vec![true; n];
    for &k in &system.prescribed {
        for m in system.bodies[k].velocity_range() {
            prescribed[m] = workspace.velocity.prescribed[m];
            is_free[m] = false;
        }
    }
    let mut sweep = NewtonEuler::new(system);
    sweep.sweep(system, state, &prescribed.as_slice()[..nv], &vec![0.0; nm], &workspace.pose, &workspace.force);
    let closure_bias = closure_bias(system, &workspace, &sweep, &prescribed.as_slice()[..nv]);
    let (mut hinge, mut modal) = (vec![0.0; nv], vec![0.0; nm]);
    sweep.generalised_force(system, state, &workspace.pose, &mut hinge, &mut modal);
    let mut force = DVector::zeros(n);
    for m in 0..nv {
        force[m] = workspace.force.applied[m] - hinge[m];
    }
    for m in 0..nm {
        force[nv + m] = -modal[m];
    }
    DenseEquations { mass, force, free: (0..n).filter(|&i| is_free[i]).collect(), prescribed, closure_map, closure_bias }
}

/// Accelerations along the blocked directions by the independent sweep.
fn closure_bias(system: &System, workspace: &Workspace, sweep: &NewtonEuler, hinge: &[f64]) -> DVector<f64> {
    let mut out = DVector::zeros(system.closure_rows());
    let modal = vec![0.0; system.modal_count];
    let motion =
        Motion { body: |k: usize| sweep.body_acceleration(k), world: force_inward::world_acceleration(system), hinge, modal: Some(&modal) };
    for (closure, at) in system.closures.iter().zip(&workspace.pose.closures) {
        at.along(closure, system, &motion, &mut out.as_mut_slice()[closure.rows()]);
    }
    out.iter_mut().zip(&workspace.velocity.closure_bias).for_each(|(o, b)| *o += b);
    out
}

impl DenseEquations {
    /// Accelerations of all coordinates and multipliers of the closures, by one dense system `[M G'; G 0]` and its singular values:
    /// where the multipliers are not unique, those of least norm. None if the decomposition fails.
    #[must_use]
    pub fn closed_accelerations(&self) -> Option<(DVector<f64>, DVector<f64>)> {
        let (n, rows) = (self.free.len(), self.closure_bias.len());
        let (mut matrix, mut right) = (DMatrix::zeros(n + rows, n + rows), DVector::zeros(n + rows));
        for (i, &m) in self.free.iter().enumerate() {
            for (j, &l) in self.free.iter().enumerate() {
                matrix[(i, j)] = self.mass[(m, l)];
            }
            right[i] = self.force[m];
            for row in 0..rows {
                matrix[(i, n + row)] = -self.closure_map[(row, m)];
                matrix[(n + row, i)] = self.closure_map[(row, m)];
            }
        }
        for row in 0..rows {
            right[n + row] = -self.closure_bias[row];
        }
        let solved = least_norm(&matrix, &right, 1e-11, 0.0)?;
        let mut all = self.prescribed.clone();
        for (i, &m) in self.free.iter().enumerate() {
            all[m] = solved[i];
        }
        Some((all, solved.rows(n, rows).into_owned()))
    }

    /// Mass matrix of the free coordinates.
    fn free_mass(&self) -> Mat<f64> {
        Mat::from_fn(self.free.len(), self.free.len(), |i, j| self.mass[(self.free[i], self.free[j])])
    }

    /// Accelerations of all coordinates (hinge rates, then modes), by faer's pivoted LU.
    #[must_use]
    pub fn accelerations(&self) -> DVector<f64> {
        let right = Mat::from_fn(self.free.len(), 1, |i, _| self.force[self.free[i]]);
        let solved = self.free_mass().partial_piv_lu().solve(&right);
        let mut all = self.prescribed.clone();
        for (i, &m) in self.free.iter().enumerate() {
            all[m] = solved[(i, 0)];
        }
        all
    }

    /// Condition number (2-norm) of the mass matrix of the free coordinates; one without free coordinates, infinite if a
    /// decomposition fails.
    #[must_use]
    pub fn condition(&self) -> f64 {
        if self.free.is_empty() {
            return 1.0;
        }
        match self.free_mass().singular_values() {
            Ok(values) => values[0] / values[values.len() - 1],
            Err(_) => f64::INFINITY,
        }
    }
}
