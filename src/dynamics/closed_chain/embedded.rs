//! Closures that are embedded in aggregates, as the rest of an evaluation sees them: closed, free of contradiction, and loaded.

use super::{CONTRADICTION, ClosedChain, rounding_of_rates};
use crate::dynamics::DynamicsError;
use crate::dynamics::aggregate::load::Swept;
use crate::dynamics::sweep::force_inward::ForceScratch;
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::dynamics::sweep::velocity_outward::VelocityScratch;
use crate::model::{State, System};

/// Refuses aggregates whose loops lose rank, or whose closures and prescribed motions contradict one another, after the velocity sweep.
///
/// # Errors
/// Naming the closure.
pub fn check_embedded(system: &System, pose: &PoseScratch, velocity: &VelocityScratch) -> Result<(), DynamicsError> {
    for ((aggregate, embedding), bias) in system.aggregates.iter().zip(&pose.embeddings).zip(&velocity.embedded) {
        let rows = || aggregate.closures.iter().flat_map(|&c| system.closures[c].rows().map(move |_| c)).enumerate();
        let share = |row: usize| embedding.redundancy(row);
        let worst = || rows().max_by(|a, b| share(a.0).total_cmp(&share(b.0))).map_or(0, |(_, c)| c);
        if embedding.is_lost() {
            return Err(DynamicsError::ChangePoint { closure: system.closures[worst()].name.clone() });
        }
        let [missed, size] = bias.missed;
        if missed > CONTRADICTION * size && missed > rounding_of_rates(velocity) {
            return Err(DynamicsError::ContradictoryClosures {
                closure: system.closures[worst()].name.clone(),
                rank: embedding.rank(),
                rows: embedding.rows(),
            });
        }
    }
    Ok(())
}

impl ClosedChain {
    /// Moves the dependent coordinates and rates of all aggregates until their closures close.
    ///
    /// # Errors
    /// If no state nearby closes.
    pub fn close_aggregates(&mut self, system: &System, state: &mut State, pose: &mut PoseScratch) -> Result<(), DynamicsError> {
        self.closings.iter_mut().enumerate().try_for_each(|(index, closing)| closing.close(system, state, pose, index))
    }

    /// Multipliers of embedded closures and the loads inside aggregates, inner aggregates first.
    pub fn recover_embedded(&mut self, swept: &Swept<'_>, force: &mut ForceScratch) {
        for &index in &self.inner_first {
            self.loads[index].recover(swept, index, force, &mut self.lambda);
        }
    }
}
