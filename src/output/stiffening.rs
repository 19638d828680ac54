//! Whether the motion of a flexible body asks for geometric stiffness that does not take part: followed over steps and output times.
//!
//! Spin softens modes (in every run, through their second moment) and stiffens them (only by geometric stiffness); acceleration and
//! gravity do either, by geometric stiffness alone. Both are held against the modal stiffness, mode by mode on the diagonal.

use super::scales::plain;
use crate::integrate::Sample;
use crate::model::flexible_body::{FlexibleBody, INERTIAL_LOADS};
use crate::model::{InertiaOrder, System};
use crate::spatial::shift::{angular, linear};
use nalgebra::{Vector3, Vector6};

/// Share of the modal stiffness from which a warning is due: half of it in a frequency, where one looks for 1 % in loads.
const NOTABLE: f64 = 0.01;

/// Largest share of a mode's stiffness, where and when.
#[derive(Debug, Clone, Copy, Default)]
struct Share {
    value: f64,
    mode: usize,
    time: f64,
}

impl Share {
    fn raise(&mut self, value: f64, mode: usize, time: f64) {
        if value > self.value {
            *self = Self { value, mode, time };
        }
    }
}

#[derive(Debug, Clone)]
struct Followed {
    body: usize,
    /// Taken by the spin through the modes' second moment.
    softening: Share,
    /// Added or taken by the geometric stiffness that is not used.
    left_out: Share,
}

/// Follows the bodies that do not use geometric stiffness; nothing where all do.
#[derive(Debug, Clone)]
pub struct StiffeningGauge {
    bodies: Vec<Followed>,
}

impl StiffeningGauge {
    /// A gauge for `system`.
    #[must_use]
    pub fn new(system: &System) -> Self {
        let linear = |k: &usize| system.bodies[*k].flexible().is_some_and(|f| f.mode_count() > 0 && !f.stiffens());
        let followed = |body| Followed { body, softening: Share::default(), left_out: Share::default() };
        Self { bodies: (0..system.bodies.len()).filter(linear).map(followed).collect() }
    }

    /// Takes in one evaluation.
    pub fn follow(&mut self, sample: &Sample<'_>) {
        for followed in &mut self.bodies {
            let k = followed.body;
            let Some(flexible) = sample.system.bodies[k].flexible() else { continue };
            let (omega, alpha) = sample.workspace.frame_motion(k);
            let load = inertial_load(&omega, &alpha);
            for (j, stiffness) in flexible.stiffness.iter().enumerate() {
                if flexible.order >= InertiaOrder::First {
                    followed.softening.raise(softening(flexible, j, &omega) / stiffness, j, sample.state.time);
                }
                if let Some(unit) = flexible.unused_stiffening.get(j) {
                    let left_out: f64 = unit.iter().zip(&load).map(|(k, l)| k * l).sum();
                    followed.left_out.raise(left_out.abs() / stiffness, j, sample.state.time);
                }
            }
        }
    }

    /// What is to be said of the run.
    #[must_use]
    pub fn warnings(&self, system: &System) -> Vec<String> {
        let bodies = system.definition_order.iter().filter_map(|k| self.bodies.iter().find(|b| b.body == *k));
        bodies.filter_map(|b| Some(warning(&system.bodies[b.body].name, system.bodies[b.body].flexible()?, b)).flatten()).collect()
    }
}

/// Factors of the 12 unit inertial loads for the motion of the body's frame, `alpha` less gravity.
fn inertial_load(omega: &Vector3<f64>, alpha: &Vector6<f64>) -> [f64; INERTIAL_LOADS] {
    let (w, a, spin) = (omega, linear(alpha), angular(alpha));
    let squares = [w.x * w.x, w.y * w.y, w.z * w.z, w.x * w.y, w.y * w.z, w.x * w.z];
    let mut load = [0.0; INERTIAL_LOADS];
    load[..3].copy_from_slice(a.as_slice());
    load[3..6].copy_from_slice(spin.as_slice());
    load[6..].copy_from_slice(&squares);
    load
}

/// `(omega^2 - omega omega') : int rho phi_j phi_j'`.
fn softening(flexible: &FlexibleBody, j: usize, omega: &Vector3<f64>) -> f64 {
    let mut sum = 0.0;
    for a in 0..3 {
        for b in 0..3 {
            let factor = if a == b { omega.norm_squared() } else { 0.0 } - omega[a] * omega[b];
            sum += factor * flexible.integrals.products.diagonal(3 * a + b, j);
        }
    }
    sum
}

fn warning(name: &str, flexible: &FlexibleBody, followed: &Followed) -> Option<String> {
    let percent = |share: &Share| plain(100.0 * share.value);
    let mode = |share: &Share| flexible.mode_names.get(share.mode).map_or("?", String::as_str);
    let Followed { softening, left_out, .. } = followed;
    let runaway = if softening.value > 1.0 { ": deflections grow without bound" } else { "" };
    let spin = (softening.value > NOTABLE).then(|| {
        format!("spin takes {} % of the stiffness of {} (t = {} s){runaway}", percent(softening), mode(softening), plain(softening.time))
    });
    let unused = (left_out.value > NOTABLE).then(|| {
        format!(
            "geometric stiffness, which is not used, would change that of {} by {} % (t = {} s)",
            mode(left_out),
            percent(left_out),
            plain(left_out.time)
        )
    });
    let has_data = !flexible.unused_stiffening.is_empty();
    let remedy = match (has_data, flexible.order) {
        (true, InertiaOrder::Zeroth) => "set geometric_stiffness = true and inertia_order = 2",
        (true, _) => "set geometric_stiffness = true",
        (false, _) => "the modal file has no geometric stiffness to set against it; write it with geometric/stiffness",
    };
    let said: Vec<_> = spin.into_iter().chain(unused).collect();
    (!said.is_empty()).then(|| format!("body \"{name}\": {}; {remedy}", said.join("; ")))
}
