//! What is integrated: hinge and modal coordinates and their rates.

use super::System;

/// Configuration and rates of a system at one time. Lengths are those of the [`System`].
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// s.
    pub time: f64,
    /// Hinge coordinates, `system.position_count`.
    pub position: Vec<f64>,
    /// Hinge rates, `system.velocity_count`.
    pub velocity: Vec<f64>,
    /// Modal coordinates (m kg^(1/2)), `system.modal_count`.
    pub modal_position: Vec<f64>,
    /// Modal rates, `system.modal_count`.
    pub modal_velocity: Vec<f64>,
}

impl State {
    /// The reference position at rest, at time zero.
    #[must_use]
    pub fn reference(system: &System) -> Self {
        Self {
            time: 0.0,
            position: system.bodies.iter().flat_map(|b| b.hinge.kind.reference_position()).collect(),
            velocity: vec![0.0; system.velocity_count],
            modal_position: vec![0.0; system.modal_count],
            modal_velocity: vec![0.0; system.modal_count],
        }
    }

    /// Sets coordinates and rates of prescribed hinges to their functions of time at `self.time`.
    pub fn apply_prescribed(&mut self, system: &System) {
        for &k in &system.prescribed {
            let body = &system.bodies[k];
            if let Some(motion) = &body.hinge.motion {
                for i in 0..body.hinge.kind.rate_count() {
                    let [value, rate, _] = motion.sample(self.time, i);
                    self.position[body.position + i] = value;
                    self.velocity[body.velocity + i] = rate;
                }
            }
        }
    }

    /// True if every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [&self.position, &self.velocity, &self.modal_position, &self.modal_velocity].iter().all(|v| v.iter().all(|x| x.is_finite()))
    }
}
