//! Steps past change points of loops, where these lose rank for an instant.
//!
//! At the distance d (relative singular value of the loops) rounding of accelerations grows like 1/d^2, so that an error-controlled step
//! that is cut down only comes closer and fails for rounding. The error estimate is allowed what rounding makes of it, and after some failed
//! tries steps of the last accepted length are taken instead, to leap over.

use crate::dynamics::closed_chain::schur::REDUNDANT;

/// Distance below which a step that fails does so at a change point.
const NEAR: f64 = 1e-2;
/// Failed tries of one step after which it is leapt.
const TRIES: usize = 3;
/// Shares of the last accepted step that a leap takes, in turn: some stage of one may fall on the change point itself.
const LEAPS: [f64; 6] = [1.0, 0.6, 1.5, 0.8, 0.4, 2.0];
/// Most that rounding may make of the error estimate, in units of the tolerance; the report's local error shows it.
const LARGEST_ROUNDING: f64 = 1e3;

/// True if loops at this distance from losing rank are at a change point.
#[must_use]
pub fn is_near(distance: f64) -> bool {
    distance < NEAR
}

/// The tries of one step.
#[derive(Debug)]
pub struct Passage {
    nearest: f64,
    tries: usize,
}

impl Default for Passage {
    fn default() -> Self {
        Self { nearest: f64::INFINITY, tries: 0 }
    }
}

impl Passage {
    /// True if some try came near a change point.
    #[must_use]
    pub fn is_near(&self) -> bool {
        is_near(self.nearest)
    }

    /// Error, in units of the relative tolerance, that a try may have which came as near as `all` (any loop) and `cut` (cut ones).
    pub fn allowed_error(&mut self, [all, cut]: [f64; 2], relative: f64) -> f64 {
        self.nearest = self.nearest.min(all);
        // what the rounding of the scaled loop inertia makes of accelerations; embedded loops have none
        let rounding = REDUNDANT / (cut * cut * relative);
        if is_near(cut) { rounding.clamp(1.0, LARGEST_ROUNDING) } else { 1.0 }
    }

    /// After a failed try: the share of the last accepted step to leap, if it is time to.
    pub fn leap(&mut self) -> Option<f64> {
        self.tries += 1;
        if !self.is_near() {
            return None;
        }
        self.tries.checked_sub(TRIES).and_then(|i| LEAPS.get(i)).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaps_begin_near_a_change_point_after_some_tries_and_end() {
        let mut far = Passage::default();
        assert_eq!(far.allowed_error([1.0; 2], 1e-6), 1.0);
        assert!((0..20).all(|_| far.leap().is_none()));
        let mut near = Passage::default();
        assert!(near.allowed_error([1e-4; 2], 1e-6) > 99.0 && near.allowed_error([1e-9; 2], 1e-6) <= LARGEST_ROUNDING);
        // embedded loops round no more than others do
        assert_eq!(near.allowed_error([1e-9, f64::INFINITY], 1e-6), 1.0);
        let leaps: Vec<_> = (0..20).map(|_| near.leap()).collect();
        assert!(leaps[..2].iter().all(Option::is_none) && leaps[2] == Some(1.0) && leaps[8..].iter().all(Option::is_none));
    }
}
