//! What a linearly implicit integrator adds to the mass matrix: N of `M + N`, which couples no modes and no two hinges.

use crate::model::System;
use crate::model::hinge::MAX_RATES;

/// A symmetric block of one hinge's rates.
pub type HingeBlock = [[f64; MAX_RATES]; MAX_RATES];

/// N by its blocks.
#[derive(Debug, Clone)]
pub struct AddedInertia {
    /// `Lambda`: unit modal mass plus what is added, indexed like the modal coordinates.
    pub modal: Vec<f64>,
    /// What is added on the diagonal of the hinge rates, not negative, indexed like them.
    pub hinge: Vec<f64>,
    /// In place of that, whole positive semidefinite blocks of the hinges of several rates of some bodies, which ascend.
    pub blocks: Vec<(usize, HingeBlock)>,
}

impl AddedInertia {
    /// Nothing.
    #[must_use]
    pub fn none(system: &System) -> Self {
        Self { modal: vec![1.0; system.modal_count], hinge: vec![0.0; system.velocity_count], blocks: vec![] }
    }

    /// What is added on the hinge of body `k`; none for zero.
    #[must_use]
    pub fn block(&self, system: &System, k: usize) -> Option<HingeBlock> {
        if let Ok(place) = self.blocks.binary_search_by_key(&k, |b| b.0) {
            return Some(self.blocks[place].1);
        }
        let diagonal = &self.hinge[system.bodies[k].velocity_range()];
        if diagonal.iter().all(|d| *d == 0.0) {
            return None;
        }
        let mut block = HingeBlock::default();
        diagonal.iter().enumerate().for_each(|(i, d)| block[i][i] = *d);
        Some(block)
    }
}
