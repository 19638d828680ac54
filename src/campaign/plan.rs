//! A plan: which keys of a scene take which values in which case.
//!
//! Cases are counted from 0 here and from 1 in everything that is shown. The rows of the table come slowest, then the grids in their
//! order, then the samples: case = ((row * grid + place) ...) * samples + sample. A random value is draw number `sample` of its parameter,
//! the same at every row and grid value, so that these can be compared.

use super::draw::Distribution;
use super::plan_spec::{PlanSpec, Ways};
use super::table;
use crate::scene::error::Source;
use crate::scene::locate::Step;
use crate::scene::{KeyFault, KeyPath, SceneError};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Most cases of a campaign.
pub(super) const MOST_CASES: usize = 10_000_000;

/// Where the values of a parameter come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Draws; of a choice the place in this list.
    Random(Distribution, Vec<Value>),
    /// One for each place on an axis.
    Listed {
        /// The axis.
        axis: usize,
        /// The values.
        values: Vec<Value>,
    },
}

/// Something that varies.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Unique.
    pub name: String,
    /// Keys that take the value.
    pub keys: Vec<KeyPath>,
    /// True if the value multiplies what the scene has.
    pub scale: bool,
    /// Its values.
    pub values: Values,
    /// Where it stands in the plan, for messages; none for a column of a table.
    place: Option<usize>,
}

impl Parameter {
    /// All keys in one text: the name of its random stream.
    #[must_use]
    pub fn stream(&self) -> String {
        self.keys.iter().map(KeyPath::text).collect::<Vec<_>>().join(", ")
    }
}

/// All cases of a campaign.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The plan file, or the table.
    pub source: Source,
    /// Files that the plan was read from.
    pub inputs: Vec<PathBuf>,
    /// Text of the table, if there is one.
    pub table: Option<String>,
    /// Of all random values.
    pub seed: u64,
    /// Cases at each place of the axes.
    pub samples: usize,
    /// What varies.
    pub parameters: Vec<Parameter>,
    /// Number of places on each axis.
    axes: Vec<usize>,
    cases: usize,
}

fn read(path: &Path) -> Result<String, SceneError> {
    std::fs::read_to_string(path).map_err(|e| SceneError::unreadable(path, "plan", &e))
}

impl Plan {
    /// Reads a plan (TOML), or a table of cases (a name that ends in .csv).
    ///
    /// # Errors
    /// [`SceneError`] with file, line, key, what was found and what to write instead.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let source = Source { path: path.to_owned(), text: read(path)? };
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
            let spec = PlanSpec { seed: 0, samples: None, table: None, parameter: Vec::new() };
            let text = source.text.clone();
            return Self::new(source, &spec, Some((path.to_owned(), text)));
        }
        let spec: PlanSpec = toml::from_str(&source.text)
            .map_err(|e| SceneError::Syntax { path: path.to_owned(), message: e.to_string().trim_end().to_owned() })?;
        let table = match &spec.table {
            None => None,
            Some(file) => {
                let table = path.parent().unwrap_or(Path::new("")).join(file);
                let text = std::fs::read_to_string(&table)
                    .map_err(|e| source.value(&[Step::Key("table")], format!("{}: cannot be read: {e}", table.display())))?;
                Some((table, text))
            }
        };
        Self::new(source, &spec, table)
    }

    fn new(source: Source, spec: &PlanSpec, table: Option<(PathBuf, String)>) -> Result<Self, SceneError> {
        let (mut parameters, mut axes) = (Vec::<Parameter>::new(), Vec::new());
        if let Some((path, text)) = &table {
            let columns = table::columns(path, text)?;
            axes.push(columns[0].values.len());
            for column in columns {
                let key = KeyPath::parse(&column.key).map_err(|e| {
                    let at = crate::scene::locate::Location { line: 1, column: 1, key: "heading".into() };
                    SceneError::Value { path: path.clone(), at, message: e.to_string() }
                })?;
                let values = Values::Listed { axis: 0, values: column.values };
                parameters.push(Parameter { name: column.key, keys: vec![key], scale: false, values, place: None });
            }
        }
        for (index, given) in spec.parameter.iter().enumerate() {
            let at = |key| [Step::Key("parameter"), Step::Index(index), Step::Key(key)];
            let texts = match (&given.key, &given.keys) {
                (Some(key), None) => vec![key.clone()],
                (None, Some(keys)) if !keys.is_empty() => keys.clone(),
                _ => return Err(source.value(&at("key")[..2], "a parameter has key = \"...\", or keys = [...] that take the same value")),
            };
            let keys = texts.iter().map(|t| KeyPath::parse(t).map_err(|e| source.value(&at("key"), e.to_string())));
            let keys = keys.collect::<Result<Vec<_>, _>>()?;
            let values = match given.ways(index, &source)? {
                Ways::Random(distribution) => Values::Random(distribution, Vec::new()),
                Ways::Choice(distribution, list) => Values::Random(distribution, list),
                Ways::Grid(values) => {
                    axes.push(values.len());
                    Values::Listed { axis: axes.len() - 1, values }
                }
            };
            let name = given.name.clone().unwrap_or_else(|| texts[0].clone());
            if parameters.iter().any(|p| p.name == name) {
                return Err(source.value(&at("key"), format!("\"{name}\" names two parameters; give one of them another name")));
            }
            parameters.push(Parameter { name, keys, scale: given.scale, values, place: Some(index) });
        }
        let random = parameters.iter().any(|p| matches!(p.values, Values::Random(..)));
        let samples = match spec.samples {
            Some(0) => return Err(source.value(&[Step::Key("samples")], "0 runs nothing; give 1 or more")),
            Some(n) if random || n == 1 => n,
            Some(n) => {
                let message = format!("{n}, but no parameter is random, so that all samples would be the same; leave it out");
                return Err(source.value(&[Step::Key("samples")], message));
            }
            None if random => return Err(source.value(&[Step::Key("samples")], "say how many cases to draw: samples = 100")),
            None => 1,
        };
        if parameters.is_empty() {
            return Err(source.value(&[Step::Key("parameter")], "nothing varies; add [[parameter]] with key and distribution, or table"));
        }
        let count = axes.iter().try_fold(samples, |product, n| product.checked_mul(*n)).filter(|n| *n <= MOST_CASES);
        let Some(cases) = count else {
            return Err(
                source.value(&[Step::Key("samples")], format!("the grids and samples make more than {MOST_CASES} cases; take fewer"))
            );
        };
        let mut inputs = vec![source.path.clone()];
        inputs.extend(table.as_ref().map(|(path, _)| path.clone()));
        Ok(Self { source, inputs, table: table.map(|(_, text)| text), seed: spec.seed, samples, parameters, axes, cases })
    }

    /// Number of cases.
    #[must_use]
    pub fn cases(&self) -> usize {
        self.cases
    }

    /// The value of every parameter in a case.
    #[must_use]
    pub fn values(&self, case: usize) -> Vec<Value> {
        let sample = case % self.samples;
        let mut rest = case / self.samples;
        let mut places = vec![0; self.axes.len()];
        for (place, count) in places.iter_mut().zip(&self.axes).rev() {
            (*place, rest) = (rest % count, rest / count);
        }
        let value = |parameter: &Parameter| match &parameter.values {
            Values::Listed { axis, values } => values[places[*axis]].clone(),
            Values::Random(distribution, list) => {
                let drawn = distribution.draw(self.seed, &parameter.stream(), sample as u64);
                list.get(drawn as usize).filter(|_| !list.is_empty()).cloned().unwrap_or(Value::Float(drawn))
            }
        };
        self.parameters.iter().map(value).collect()
    }

    /// The scene's document with these values of the parameters.
    ///
    /// # Errors
    /// If a key leads to nothing, or a value cannot multiply what the scene has.
    pub fn apply(&self, document: &Table, values: &[Value]) -> Result<Table, ApplyError> {
        let mut changed = document.clone();
        for (parameter, value) in self.parameters.iter().zip(values) {
            for key in &parameter.keys {
                let value = if parameter.scale { scaled(key, key.get(document)?, value)? } else { value.clone() };
                key.set(&mut changed, value)?;
            }
        }
        Ok(changed)
    }

    /// Holds every key against the scene, before anything runs.
    ///
    /// # Errors
    /// [`SceneError`] that points into the plan.
    pub fn check(&self, document: &Table) -> Result<(), SceneError> {
        let first = self.values(0);
        let mut seen: Vec<(&Parameter, &KeyPath)> = Vec::new();
        for (parameter, value) in self.parameters.iter().zip(&first) {
            let fault = |message: String| self.fault(parameter, message);
            for key in &parameter.keys {
                let mut changed = document.clone();
                let put = key.set(&mut changed, value.clone()).and_then(|()| key.check(&changed));
                put.map_err(|e| fault(e.to_string()))?;
                if parameter.scale {
                    let had = key.get(document).map_err(|e| fault(e.to_string()))?;
                    scaled(key, had, value).map_err(|e| fault(e.to_string()))?;
                }
                for (_, other) in &seen {
                    if key.overlaps(other, document).map_err(|e| fault(e.to_string()))? {
                        return Err(fault(format!("\"{}\" and \"{}\" set the same key; drop one", other.text(), key.text())));
                    }
                }
                seen.push((parameter, key));
            }
        }
        Ok(())
    }

    fn fault(&self, parameter: &Parameter, message: String) -> SceneError {
        match parameter.place {
            Some(index) => self.source.value(&[Step::Key("parameter"), Step::Index(index), Step::Key("key")], message),
            None => {
                let at = crate::scene::locate::Location { line: 1, column: 1, key: "heading".into() };
                SceneError::Value { path: self.inputs.last().cloned().unwrap_or_default(), at, message }
            }
        }
    }
}

/// Why values cannot be put into a scene.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ApplyError {
    /// A key.
    #[error(transparent)]
    Key(#[from] KeyFault),
    /// Something that cannot be multiplied.
    #[error("\"{key}\": scale = true multiplies a number or a list of numbers of the scene; {found}")]
    Scale {
        /// The key.
        key: String,
        /// What is there instead.
        found: &'static str,
    },
}

/// What the scene has, times a number.
fn scaled(key: &KeyPath, had: Option<&Value>, factor: &Value) -> Result<Value, ApplyError> {
    fn times(had: &Value, factor: f64) -> Option<Value> {
        match had {
            Value::Float(x) => Some(Value::Float(x * factor)),
            Value::Integer(x) => Some(Value::Float(*x as f64 * factor)),
            Value::Array(list) => list.iter().map(|x| times(x, factor)).collect::<Option<Vec<_>>>().map(Value::Array),
            _ => None,
        }
    }
    let fault = |found| ApplyError::Scale { key: key.text().to_owned(), found };
    let factor = match factor {
        Value::Float(x) => *x,
        Value::Integer(x) => *x as f64,
        _ => return Err(fault("the value of the parameter is no number")),
    };
    let had = had.ok_or_else(|| fault("the scene leaves this key out"))?;
    times(had, factor).ok_or_else(|| fault("this key holds something else"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str =
        "gravity = [0.0, 0.0, -9.81]\n[[body]]\nname = \"hub\"\nmass = 2\ninertia = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n";

    fn plan(text: &str) -> Result<Plan, String> {
        let source = Source { path: "plan.toml".into(), text: text.to_owned() };
        let spec: PlanSpec = toml::from_str(text).map_err(|e| e.to_string())?;
        Plan::new(source, &spec, None).map_err(|e| e.to_string())
    }

    fn checked(text: &str) -> Result<(), String> {
        plan(text)?.check(&SCENE.parse().unwrap()).map_err(|e| e.to_string())
    }

    #[test]
    fn cases_go_through_rows_then_grids_then_samples() {
        let source = Source { path: "plan.toml".into(), text: String::new() };
        let text = "seed = 3\nsamples = 4\n[[parameter]]\nkey = \"a\"\ngrid = [1, 2, 3]\n[[parameter]]\nkey = \"b\"\nuniform = { min = 0.0, max = 1.0 }\n\
                    [[parameter]]\nkey = \"c\"\ngrid = { from = 0.0, to = 1.0, count = 2 }\n";
        let spec: PlanSpec = toml::from_str(text).unwrap();
        let plan = Plan::new(source, &spec, Some(("t.csv".into(), "d\n10\n20\n".into()))).unwrap();
        assert_eq!(plan.cases(), 2 * 3 * 2 * 4);
        let all: Vec<Vec<Value>> = (0..plan.cases()).map(|i| plan.values(i)).collect();
        // d, a, b, c
        assert_eq!([&all[0][0], &all[0][1], &all[0][3]], [&Value::Integer(10), &Value::Integer(1), &Value::Float(0.0)]);
        assert_eq!([&all[4][0], &all[4][1], &all[4][3]], [&Value::Integer(10), &Value::Integer(1), &Value::Float(1.0)]);
        assert_eq!([&all[8][0], &all[8][1], &all[8][3]], [&Value::Integer(10), &Value::Integer(2), &Value::Float(0.0)]);
        assert_eq!(all[24][0], Value::Integer(20));
        // the same draws at every grid value, whatever the number of samples
        assert!((0..4).all(|i| all[i][2] == all[i + 4][2] && all[i][2] == all[i + 24][2]) && all[0][2] != all[1][2]);
        let more: PlanSpec = toml::from_str(&text.replace("samples = 4", "samples = 7")).unwrap();
        let more = Plan::new(plan.source.clone(), &more, Some(("t.csv".into(), "d\n10\n20\n".into()))).unwrap();
        assert!((0..4).all(|i| more.values(i)[2] == all[i][2]));
    }

    #[test]
    fn values_are_set_or_multiply_what_the_scene_has() {
        let text = "[[parameter]]\nkey = \"gravity[3]\"\ngrid = [-1.5]\n[[parameter]]\nkeys = [\"body.hub.mass\", \"body.hub.inertia\"]\nscale = true\ngrid = [2]\n";
        let (plan, document) = (plan(text).unwrap(), SCENE.parse::<Table>().unwrap());
        plan.check(&document).unwrap();
        let changed = plan.apply(&document, &plan.values(0)).unwrap();
        let body = &changed["body"][0];
        assert_eq!((changed["gravity"][2].as_float(), body["mass"].as_float()), (Some(-1.5), Some(4.0)));
        assert_eq!((body["inertia"][1][1].as_float(), body["inertia"][1][0].as_float()), (Some(2.0), Some(0.0)));
    }

    #[test]
    fn a_plan_that_cannot_be_is_refused_with_its_key() {
        for (text, expected) in [
            ("", "parameter: nothing varies"),
            ("[[parameter]]\nkey = \"gravity[3]\"\n", "plan.toml:1:1: parameter[1]: a parameter has exactly one of uniform"),
            ("[[parameter]]\ngrid = [1]\n", "parameter[1]: a parameter has key"),
            ("[[parameter]]\nkey = \"gravity[3]\"\nuniform = { min = 1.0, max = 2.0 }\n", "samples: say how many"),
            (
                "samples = 0\n[[parameter]]\nkey = \"gravity[3]\"\nuniform = { min = 1.0, max = 2.0 }\n",
                "plan.toml:1:11: samples: 0 runs nothing",
            ),
            ("samples = 2\n[[parameter]]\nkey = \"gravity[3]\"\ngrid = [1]\n", "no parameter is random"),
            (
                "[[parameter]]\nkey = \"gravity[3]\"\nuniform = { min = 2.0, max = 1.0 }\n",
                "plan.toml:3:11: parameter[1].uniform: min = 2 must be below max = 1",
            ),
            ("[[parameter]]\nkey = \"gravity[3]\"\nuniform = { min = -1e308, max = 1e308 }\n", "both finite"),
            ("[[parameter]]\nkey = \"gravity[3]\"\nlog_uniform = { min = 0.0, max = 1.0 }\n", "min = 0 must be above zero"),
            ("[[parameter]]\nkey = \"gravity[3]\"\nnormal = { mean = 0.0, deviation = 0.0 }\n", "deviation = 0 must be above zero"),
            ("[[parameter]]\nkey = \"gravity[3]\"\nnormal = { mean = 0.0, deviation = 1.0, min = 9.0 }\n", "less than a thousandth"),
            ("[[parameter]]\nkey = \"gravity[3]\"\nlognormal = { median = -1.0, log_deviation = 1.0 }\n", "median = -1"),
            ("[[parameter]]\nkey = \"gravity[3]\"\nchoice = []\n", "choice lists nothing"),
            ("[[parameter]]\nkey = \"gravity[3]\"\nchoice = [1.0, 2.0]\nweights = [1.0]\n", "give 2 weights"),
            ("[[parameter]]\nkey = \"gravity[3]\"\ngrid = [nan]\n", "a number of grid is not finite"),
            ("[[parameter]]\nkey = \"gravity[3]\"\ngrid = { from = 0.0, to = 1.0, count = 1 }\n", "count between 2 and"),
            ("[[parameter]]\nkey = \"gravity[4]\"\ngrid = [1.0]\n", "plan.toml:2:7: parameter[1].key: \"gravity[4]\": gravity has 3 items"),
            ("[[parameter]]\nkey = \"body.hub.mas\"\ngrid = [1.0]\n", "no key \"mas\"; did you mean mass"),
            ("[[parameter]]\nkey = \"body.hub.name\"\nscale = true\ngrid = [1.0]\n", "this key holds something else"),
            ("[[parameter]]\nkey = \"body.hub.box\"\nscale = true\ngrid = [1.0]\n", "the scene leaves this key out"),
            (
                "[[parameter]]\nkey = \"gravity\"\ngrid = [[0.0, 0.0, 0.0]]\n[[parameter]]\nkey = \"gravity[3]\"\ngrid = [1.0]\n",
                "\"gravity\" and \"gravity[3]\" set the same key",
            ),
            ("[[parameter]]\nkey = \"a\"\ngrid = [1]\n[[parameter]]\nkey = \"a\"\ngrid = [1]\n", "\"a\" names two parameters"),
            ("[[parameter]]\nkey = \"a\"\nnoraml = 1\n", "unknown field `noraml`"),
            (
                "samples = 100000\n[[parameter]]\nkey = \"a\"\ngrid = { from = 0.0, to = 1.0, count = 1000 }\n[[parameter]]\nkey = \"b\"\nchoice = [1]\n",
                "more than 10000000 cases",
            ),
        ] {
            let found = checked(text).unwrap_err();
            assert!(found.contains(expected), "{text}\n{found}\n{expected}");
        }
    }
}
