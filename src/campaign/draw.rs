//! Random values: draw i of a parameter depends on the seed, the parameter's keys and i alone.
//!
//! The generator is ChaCha with 12 rounds, whose output is the same on every machine. Its key is the digest of the seed and the keys, its
//! stream the number of the draw, so that neither the order nor the number of draws, threads or shards changes one.

use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution as _, LogNormal, Normal, StandardUniform};
use sha2::{Digest, Sha256};

/// How a value is spread.
#[derive(Debug, Clone, PartialEq)]
pub enum Distribution {
    /// Equally likely between two values.
    Uniform {
        /// Least.
        min: f64,
        /// Greatest.
        max: f64,
    },
    /// The logarithm is equally likely.
    LogUniform {
        /// Least, above zero.
        min: f64,
        /// Greatest.
        max: f64,
    },
    /// Gaussian.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation, above zero.
        deviation: f64,
        /// What lies outside is drawn again.
        bounds: Bounds,
    },
    /// The logarithm is Gaussian.
    LogNormal {
        /// Median, above zero.
        median: f64,
        /// Standard deviation of the natural logarithm, above zero.
        log_deviation: f64,
        /// What lies outside is drawn again.
        bounds: Bounds,
    },
    /// A place in a list: item i with the share that its weight is of the sum.
    Choice {
        /// Sums of the weights up to each item.
        cumulated: Vec<f64>,
    },
}

/// Least and greatest value; infinite where there is no bound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least.
    pub min: f64,
    /// Greatest.
    pub max: f64,
}

impl Bounds {
    fn hold(self, x: f64) -> bool {
        x >= self.min && x <= self.max
    }
}

/// Draws that are tried for a value within bounds; a distribution with a thousandth between them misses so often once in e^1000 times.
const MOST_DRAWS: usize = 1_000_000;
/// Draws that show how much of a distribution is within its bounds, and how many of them must be.
const TRIAL_DRAWS: usize = 20_000;
const LEAST_WITHIN: usize = 20;

fn generator(seed: u64, keys: &str, draw: u64) -> ChaCha12Rng {
    let digest = Sha256::digest(format!("pliant sweep\0{seed}\0{keys}"));
    let mut generator = ChaCha12Rng::from_seed(digest.into());
    generator.set_stream(draw);
    generator
}

impl Distribution {
    /// Draw number `draw` of the parameter of these keys: the value, of a choice the place in its list.
    #[must_use]
    pub fn draw(&self, seed: u64, keys: &str, draw: u64) -> f64 {
        let mut generator = generator(seed, keys, draw);
        let bounds = self.bounds();
        let within = (0..MOST_DRAWS).map(|_| self.once(&mut generator)).find(|x| bounds.hold(*x));
        within.unwrap_or_else(|| self.once(&mut generator).clamp(bounds.min, bounds.max))
    }

    /// True if at least about a thousandth of the distribution lies within its bounds, so that drawing again ends.
    #[must_use]
    pub fn reaches_its_bounds(&self) -> bool {
        let (bounds, mut generator) = (self.bounds(), generator(0, "trial", 0));
        (0..TRIAL_DRAWS).filter(|_| bounds.hold(self.once(&mut generator))).count() >= LEAST_WITHIN
    }

    fn bounds(&self) -> Bounds {
        match *self {
            Self::Uniform { min, max } | Self::LogUniform { min, max } => Bounds { min, max },
            Self::Normal { bounds, .. } | Self::LogNormal { bounds, .. } => bounds,
            Self::Choice { .. } => Bounds { min: 0.0, max: f64::INFINITY },
        }
    }

    fn once(&self, generator: &mut ChaCha12Rng) -> f64 {
        let mut unit = || -> f64 { StandardUniform.sample(generator) };
        match self {
            Self::Uniform { min, max } => min + unit() * (max - min),
            // rounding must not leave the interval
            Self::LogUniform { min, max } => (min.ln() + unit() * (max.ln() - min.ln())).exp().clamp(*min, *max),
            Self::Choice { cumulated } => {
                let at = unit() * cumulated.last().copied().unwrap_or(0.0);
                cumulated.partition_point(|sum| *sum <= at).min(cumulated.len().saturating_sub(1)) as f64
            }
            // deviations are finite, which is all that these ask
            Self::Normal { mean, deviation, .. } => Normal::new(*mean, *deviation).map_or(f64::NAN, |d| d.sample(generator)),
            Self::LogNormal { median, log_deviation, .. } => {
                LogNormal::new(median.ln(), *log_deviation).map_or(f64::NAN, |d| d.sample(generator))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Bounds = Bounds { min: f64::NEG_INFINITY, max: f64::INFINITY };
    const COUNT: u64 = 20_000;

    fn draws(distribution: &Distribution, seed: u64) -> Vec<f64> {
        (0..COUNT).map(|i| distribution.draw(seed, "hinge.drive.stiffness", i)).collect()
    }

    /// Mean and variance, against those expected within five standard errors; `fourth` is the fourth central moment.
    fn assert_moments(values: &[f64], mean: f64, variance: f64, fourth: f64, what: &str) {
        let n = values.len() as f64;
        let found_mean = values.iter().sum::<f64>() / n;
        let found_variance = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n;
        let (of_mean, of_variance) = ((variance / n).sqrt(), ((fourth - variance * variance) / n).sqrt());
        assert!((found_mean - mean).abs() < 5.0 * of_mean, "{what}: mean {found_mean}, expected {mean} within {of_mean}");
        assert!(
            (found_variance - variance).abs() < 5.0 * of_variance,
            "{what}: {found_variance}, expected {variance} within {of_variance}"
        );
    }

    #[test]
    fn draws_have_the_moments_of_their_distribution() {
        let width: f64 = 3.0;
        assert_moments(
            &draws(&Distribution::Uniform { min: -1.0, max: 2.0 }, 1),
            0.5,
            width.powi(2) / 12.0,
            width.powi(4) / 80.0,
            "uniform",
        );
        let normal = Distribution::Normal { mean: 4.0, deviation: 0.5, bounds: FREE };
        assert_moments(&draws(&normal, 2), 4.0, 0.25, 3.0 * 0.0625, "normal");
        let logs = |d: &Distribution, seed| draws(d, seed).iter().map(|x| x.ln()).collect::<Vec<_>>();
        let lognormal = Distribution::LogNormal { median: 3.0, log_deviation: 0.5, bounds: FREE };
        assert_moments(&logs(&lognormal, 3), 3.0_f64.ln(), 0.25, 3.0 * 0.0625, "lognormal");
        let decades = Distribution::LogUniform { min: 0.01, max: 100.0 };
        let span = 10_000.0_f64.ln();
        assert_moments(&logs(&decades, 4), 0.0, span.powi(2) / 12.0, span.powi(4) / 80.0, "log uniform");
        let choice = Distribution::Choice { cumulated: vec![1.0, 1.0, 4.0] };
        let counts = draws(&choice, 5).iter().fold([0_u32; 3], |mut c, x| {
            c[*x as usize] += 1;
            c
        });
        assert_eq!(counts[1], 0);
        let deviation = (COUNT as f64 * 0.25 * 0.75).sqrt();
        assert!((f64::from(counts[0]) - 0.25 * COUNT as f64).abs() < 5.0 * deviation, "{counts:?}");
    }

    #[test]
    fn a_truncated_normal_stays_within_its_bounds_and_has_their_mean() {
        let normal = Distribution::Normal { mean: 0.0, deviation: 1.0, bounds: Bounds { min: 0.0, max: f64::INFINITY } };
        let values = draws(&normal, 6);
        assert!(values.iter().all(|x| *x >= 0.0));
        // the half-normal distribution: mean sqrt(2 / pi), variance 1 - 2 / pi; its fourth central moment is below 0.53
        let mean = (2.0 / std::f64::consts::PI).sqrt();
        assert_moments(&values, mean, 1.0 - mean * mean, 0.53, "half normal");
        let tail = |min, max| Distribution::Normal { mean: 0.0, deviation: 1.0, bounds: Bounds { min, max } };
        assert!(tail(2.5, f64::INFINITY).reaches_its_bounds());
        assert!(!tail(5.0, f64::INFINITY).reaches_its_bounds() && !tail(0.0, 1e-9).reaches_its_bounds());
    }

    #[test]
    fn a_draw_depends_on_seed_keys_and_number_alone() {
        let normal = Distribution::Normal { mean: 0.0, deviation: 1.0, bounds: FREE };
        let forward: Vec<f64> = (0..50).map(|i| normal.draw(7, "a", i)).collect();
        let backward: Vec<f64> = (0..50).rev().map(|i| normal.draw(7, "a", i)).collect();
        assert!(forward.iter().eq(backward.iter().rev()));
        assert!((0..50).all(|i| normal.draw(8, "a", i) != forward[i as usize] && normal.draw(7, "b", i) != forward[i as usize]));
        // no two streams of one parameter, or of two, go together: correlation below five standard errors
        let pairs = |other: &str, shift: u64| (0..COUNT).map(|i| normal.draw(7, "a", i) * normal.draw(7, other, i + shift)).sum::<f64>();
        for (other, shift) in [("a", 1), ("b", 0)] {
            let correlation = pairs(other, shift) / COUNT as f64;
            assert!(correlation.abs() < 5.0 / (COUNT as f64).sqrt(), "{correlation}");
        }
    }

    #[test]
    fn pinned_draws_stay_what_they_are() {
        let uniform = Distribution::Uniform { min: 0.0, max: 1.0 };
        let found: Vec<f64> = (0..3).map(|i| uniform.draw(1, "hinge.drive.stiffness", i)).collect();
        assert_eq!(found, PINNED);
    }

    /// Regression: results of a seed must not change from one version to the next.
    const PINNED: [f64; 3] = [0.5131670794837199, 0.2484601012922628, 0.1874635529182611];
}
