//! What a user should know of a scene before it runs: what assembling its closures did to the values given, and limits that nothing watches.

use super::outputs::Monitor;
use crate::dynamics::closed_chain::assembly::Assembled;
use crate::model::{State, System};

/// Rounding of printed digits: misfits (m or rad) and shares of a rate below this are not worth a word.
const NOTABLE: f64 = 1e-6;

/// The remarks on a system whose state was given as `given` and assembled to `state`.
pub(super) fn remarks(system: &System, given: &State, state: &State, assembled: &Assembled, monitors: &[Monitor]) -> Vec<String> {
    let mut out = Vec::new();
    let bodies = || system.definition_order.iter().map(|&k| &system.bodies[k]);
    if let Some(left) = assembled.bent.filter(|left| *left > NOTABLE) {
        let bent = bodies().filter_map(|body| {
            let (before, after) = (&given.modal_position[body.modal_range()], &state.modal_position[body.modal_range()]);
            let flexible = body.flexible().filter(|_| before != after)?;
            Some(format!("\"{}\" (strain energy {} J)", body.name, short(flexible.strain_energy(after))))
        });
        let bent: Vec<_> = bent.collect();
        out.push(format!(
            "the closures stay open by {} (m or rad) in the nearest position of the hinges, and are closed at the start by bending {}; correct frames \
             and positions if no such preload is meant",
            short(left),
            bent.join(", ")
        ));
    }
    for body in bodies() {
        let (before, after) = (&given.velocity[body.velocity_range()], &state.velocity[body.velocity_range()]);
        let size = before.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        if before.iter().zip(after).any(|(b, a)| (b - a).abs() > NOTABLE * size) && size > 0.0 {
            let list = |v: &[f64]| v.iter().map(|x| short(*x)).collect::<Vec<_>>().join(", ");
            out.push(format!(
                "the closures change the given velocity of hinge \"{}\" from {} to {}; give velocities that keep the loops closed",
                body.hinge.name,
                list(before),
                list(after)
            ));
        }
    }
    for body in bodies() {
        let Some(flexible) = body.flexible() else { continue };
        let ratio = flexible.damping.iter().zip(&flexible.stiffness).map(|(c, k)| c / (2.0 * k.sqrt())).fold(0.0, f64::max);
        // rounding of 2 zeta omega
        if ratio > 1.0 + 1e-9 && ratio.is_finite() {
            out.push(format!(
                "modes of \"{}\" are damped by {} of critical; damping_ratio is a share, 0.005 for half a per cent",
                body.name,
                short(ratio)
            ));
        }
    }
    for monitor in monitors {
        if let Monitor::Body { body, stress_limit: Some(_) } = *monitor
            && system.bodies[body].mode_count() == 0
        {
            out.push(format!("the stress limit of \"{}\" is not watched: the body retains no mode", system.bodies[body].name));
        }
    }
    out
}

/// Three digits.
fn short(x: f64) -> String {
    if x == 0.0 || (1e-3..1e5).contains(&x.abs()) { format!("{x:.3}") } else { format!("{x:.2e}") }
}
