//! Rigid models: `fd` (accelerations of all hinges) and `fdf` (those and the six-component load of every hinge, in inertial axes).
//!
//! The check is the sum of the absolute accelerations of the revolute hinges. Ops that answer numbers: `accelerations` of the revolute
//! hinges and `loads` of all hinges (moment about O; force; by the parent on the child, in the child's axes), in the order of the links;
//! `condition`: that of the mass matrix, by the dense twin of the recursion.

use crate::links::Model;
use crate::protocol::Case;
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::{Workspace, accelerations, dense};
use pliant::model::{State, System};
use std::error::Error;

/// One model and its last evaluation.
pub struct Rigid {
    system: System,
    state: State,
    /// For `fd`, without room for loads, and for `fdf`; made when first asked for.
    workspaces: [Option<Workspace>; 2],
    asked: usize,
    /// Rate of the last hinge.
    last: f64,
}

impl Rigid {
    /// The model `name` of `n` links.
    ///
    /// # Errors
    /// If there is none.
    pub fn build(name: &str, n: usize) -> Result<Option<Self>, Box<dyn Error>> {
        let (system, state) = Model::of(name, n)?.definition().build()?;
        let last = state.velocity.last().copied().ok_or("a model without hinges")?;
        Ok(Some(Self { system, state, workspaces: [None, None], asked: 0, last }))
    }

    fn accelerations(&self) -> impl Iterator<Item = f64> {
        let revolute = |k: &&usize| self.system.bodies[**k].velocity_range().len() == 1;
        let order = self.system.definition_order.iter().filter(revolute);
        let found = self.workspaces[self.asked].as_ref().map_or(&[][..], |w| &w.acceleration.hinge);
        order.filter_map(|&k| found.get(self.system.bodies[k].velocity).copied())
    }
}

impl Case for Rigid {
    fn call(&mut self, op: &str, call: u32) -> Result<bool, Box<dyn Error>> {
        self.asked = match op {
            "fd" => 0,
            "fdf" => 1,
            _ => return Ok(false),
        };
        if let Some(rate) = self.state.velocity.last_mut() {
            *rate = self.last + 1e-12 * f64::from(call);
        }
        let room = if op == "fdf" { Workspace::new } else { Workspace::without_loads };
        let workspace = self.workspaces[self.asked].get_or_insert_with(|| room(&self.system));
        accelerations(&self.system, &self.state, workspace)?;
        if op == "fdf" {
            // all loads lie in memory, in inertial axes
            std::hint::black_box(workspace.kernel().ok_or("not a tree for the kernel")?);
        }
        Ok(true)
    }

    fn check(&self) -> f64 {
        self.accelerations().map(f64::abs).sum()
    }

    fn numbers(&mut self, op: &str) -> Result<Option<Vec<f64>>, Box<dyn Error>> {
        match op {
            "accelerations" => {
                self.call("fd", 0)?;
                Ok(Some(self.accelerations().collect()))
            }
            "loads" => {
                self.call("fdf", 0)?;
                let workspace = self.workspaces[1].as_ref().ok_or("no evaluation")?;
                let loads = self.system.definition_order.iter().map(|&k| hinge_load(workspace, k));
                Ok(Some(loads.flat_map(|load| load.data.0[0]).collect()))
            }
            "condition" => {
                let values = dense::equations(&self.system, &self.state).mass.symmetric_eigenvalues();
                Ok(Some(vec![values.max() / values.min()]))
            }
            _ => Ok(None),
        }
    }
}
