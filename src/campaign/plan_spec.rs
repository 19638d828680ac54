//! The plan file as serde reads it, and what its numbers must be.

use super::draw::{Bounds, Distribution};
use crate::scene::SceneError;
use crate::scene::error::Source;
use crate::scene::locate::Step;
use serde::Deserialize;
use std::path::PathBuf;
use toml::Value;

/// `uniform` and `log_uniform`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeSpec {
    /// Least.
    pub min: f64,
    /// Greatest.
    pub max: f64,
}

/// `normal = { mean, deviation, min, max }`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NormalSpec {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// Least.
    pub min: Option<f64>,
    /// Greatest.
    pub max: Option<f64>,
}

/// `lognormal = { median, log_deviation, min, max }`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogNormalSpec {
    /// Median.
    pub median: f64,
    /// Standard deviation of the natural logarithm.
    pub log_deviation: f64,
    /// Least.
    pub min: Option<f64>,
    /// Greatest.
    pub max: Option<f64>,
}

/// `grid = [...]` or `grid = { from, to, count }`
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "a list of values or { from = A, to = B, count = N }")]
pub enum GridSpec {
    /// Values.
    List(Vec<Value>),
    /// Numbers at equal distances.
    Range {
        /// First.
        from: f64,
        /// Last.
        to: f64,
        /// How many.
        count: usize,
    },
}

/// `[[parameter]]`: keys, and exactly one way to their values.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterSpec {
    /// Name in results; the key if none.
    pub name: Option<String>,
    /// Key of the scene.
    pub key: Option<String>,
    /// Several keys that take the same value.
    pub keys: Option<Vec<String>>,
    /// The value multiplies what the scene has.
    #[serde(default)]
    pub scale: bool,
    /// Random.
    pub uniform: Option<RangeSpec>,
    /// Random.
    pub log_uniform: Option<RangeSpec>,
    /// Random.
    pub normal: Option<NormalSpec>,
    /// Random.
    pub lognormal: Option<LogNormalSpec>,
    /// Random, one of a list.
    pub choice: Option<Vec<Value>>,
    /// Weights of the choices; equal if none.
    pub weights: Option<Vec<f64>>,
    /// All of them, one after the other.
    pub grid: Option<GridSpec>,
}

/// The plan file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanSpec {
    /// Of all random values.
    #[serde(default)]
    pub seed: u64,
    /// Cases for each combination of the table's rows and the grids' values.
    pub samples: Option<usize>,
    /// CSV file, relative to the plan.
    pub table: Option<PathBuf>,
    /// What varies.
    #[serde(default)]
    pub parameter: Vec<ParameterSpec>,
}

/// True if no number in the value is infinite or NaN.
#[must_use]
pub fn is_finite(value: &Value) -> bool {
    match value {
        Value::Float(x) => x.is_finite(),
        Value::Array(list) => list.iter().all(is_finite),
        Value::Table(table) => table.values().all(is_finite),
        _ => true,
    }
}

/// Most values of a grid.
const MOST_GRID: usize = 1_000_000;

/// Values of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum Ways {
    /// A number at random.
    Random(Distribution),
    /// One of a list at random.
    Choice(Distribution, Vec<Value>),
    /// All of a list.
    Grid(Vec<Value>),
}

impl ParameterSpec {
    /// The way to the values of parameter `index` of the plan in `source`.
    ///
    /// # Errors
    /// If none or several are given, or a number cannot be.
    pub fn ways(&self, index: usize, source: &Source) -> Result<Ways, SceneError> {
        let at = |key| [Step::Key("parameter"), Step::Index(index), Step::Key(key)];
        let given = [
            self.uniform.is_some(),
            self.log_uniform.is_some(),
            self.normal.is_some(),
            self.lognormal.is_some(),
            self.choice.is_some(),
            self.grid.is_some(),
        ];
        if given.iter().filter(|g| **g).count() != 1 {
            let message = "a parameter has exactly one of uniform, log_uniform, normal, lognormal, choice, grid";
            return Err(source.value(&at("key")[..2], message));
        }
        if self.weights.is_some() && self.choice.is_none() {
            return Err(source.value(&at("weights"), "weights belong to choice"));
        }
        let fault = |key, message: String| source.value(&at(key), message);
        let range = |key, &RangeSpec { min, max }: &RangeSpec| {
            // the width must be finite too
            let holds = min < max && (max - min).is_finite();
            if holds { Ok((min, max)) } else { Err(fault(key, format!("min = {min} must be below max = {max}, both finite"))) }
        };
        let bounds =
            |min: Option<f64>, max: Option<f64>| Bounds { min: min.unwrap_or(f64::NEG_INFINITY), max: max.unwrap_or(f64::INFINITY) };
        let bounded = |key, distribution: Distribution, Bounds { min, max }: Bounds| {
            if !(min < max) {
                return Err(fault(key, format!("min = {min} must be below max = {max}")));
            }
            if !distribution.reaches_its_bounds() {
                return Err(fault(key, "less than a thousandth of the distribution lies between min and max; widen them".into()));
            }
            Ok(Ways::Random(distribution))
        };
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if let Some(r) = &self.uniform {
            let (min, max) = range("uniform", r)?;
            return Ok(Ways::Random(Distribution::Uniform { min, max }));
        }
        if let Some(r) = &self.log_uniform {
            let (min, max) = range("log_uniform", r)?;
            if !(min > 0.0) {
                return Err(source.value(&at("log_uniform"), format!("min = {min} must be above zero")));
            }
            return Ok(Ways::Random(Distribution::LogUniform { min, max }));
        }
        if let Some(NormalSpec { mean, deviation, min, max }) = self.normal {
            if !(positive(deviation) && mean.is_finite()) {
                let message = format!("deviation = {deviation} must be above zero, and mean = {mean} finite");
                return Err(source.value(&at("normal"), message));
            }
            let bounds = bounds(min, max);
            return bounded("normal", Distribution::Normal { mean, deviation, bounds }, bounds);
        }
        if let Some(LogNormalSpec { median, log_deviation, min, max }) = self.lognormal {
            if !(positive(median) && positive(log_deviation)) {
                let message = format!("median = {median} and log_deviation = {log_deviation} must be above zero");
                return Err(source.value(&at("lognormal"), message));
            }
            let bounds = bounds(min, max);
            return bounded("lognormal", Distribution::LogNormal { median, log_deviation, bounds }, bounds);
        }
        if let Some(choice) = &self.choice {
            let weights = self.weights.clone().unwrap_or_else(|| vec![1.0; choice.len()]);
            check_list("choice", choice).map_err(|message| fault("choice", message))?;
            let sum: f64 = weights.iter().sum();
            if weights.len() != choice.len() || !positive(sum) || weights.iter().any(|w| !(*w >= 0.0)) {
                let message = format!("give {} weights of zero or more, not all zero: one for each choice", choice.len());
                return Err(source.value(&at("weights"), message));
            }
            let cumulated = weights.iter().scan(0.0, |sum, w| {
                *sum += w;
                Some(*sum)
            });
            return Ok(Ways::Choice(Distribution::Choice { cumulated: cumulated.collect() }, choice.clone()));
        }
        let values = match &self.grid {
            Some(GridSpec::List(list)) => list.clone(),
            Some(GridSpec::Range { from, to, count }) if (2..=MOST_GRID).contains(count) && (to - from).is_finite() => {
                let last = (*count - 1) as f64;
                // both ends are met to the last bit
                let between = |i: usize| if i + 1 == *count { *to } else { from + (to - from) * (i as f64 / last) };
                (0..*count).map(|i| Value::Float(between(i))).collect()
            }
            _ => return Err(source.value(&at("grid"), format!("from and to must be finite, count between 2 and {MOST_GRID}"))),
        };
        check_list("grid", &values).map_err(|message| fault("grid", message))?;
        Ok(Ways::Grid(values))
    }
}

fn check_list(what: &str, values: &[Value]) -> Result<(), String> {
    if values.is_empty() {
        return Err(format!("{what} lists nothing; give values"));
    }
    if values.iter().any(|v| !is_finite(v)) {
        return Err(format!("a number of {what} is not finite; write finite numbers"));
    }
    Ok(())
}
