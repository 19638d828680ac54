//! Keys of a scene by their path, so that values can be put into its document before it is assembled.
//!
//! A path is keys with dots between them: `simulation.duration`, `gravity[3]`, `load[1].force.sine.amplitude[3]`. Items of a list are
//! counted from 1, as in error messages; bodies, hinges and closures go by name as well: `hinge.drive.stiffness`, `body."left panel".mass`.

use super::spec::SceneSpec;
use thiserror::Error;
use toml::{Table, Value};

/// One step of a path.
#[derive(Debug, Clone, PartialEq, Eq)]
enum KeyStep {
    /// Key of a table, or the name of an item.
    Key(String),
    /// Place in a list, 0-based.
    Item(usize),
}

/// The path of a key of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyPath {
    text: String,
    steps: Vec<KeyStep>,
}

/// Why a path leads to no key.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum KeyFault {
    /// The text is no path.
    #[error(
        "\"{text}\" is not a path of keys: {reason}; write keys with dots between them, as in hinge.drive.stiffness or load[1].force.constant[3]"
    )]
    Syntax {
        /// The text.
        text: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// Nothing of that name.
    #[error("\"{path}\": the scene has no {what} \"{name}\"{}", proposal(near, all))]
    Unknown {
        /// The path.
        path: String,
        /// What was looked for: "hinge", "key".
        what: String,
        /// Its name.
        name: String,
        /// Names that are nearly the same.
        near: Vec<String>,
        /// All names there are.
        all: Vec<String>,
    },
    /// A place beyond the end of a list.
    #[error("\"{path}\": {list} has {count} items in the scene, counted from 1")]
    NoItem {
        /// The path.
        path: String,
        /// The list.
        list: String,
        /// Its items.
        count: usize,
    },
    /// An item or a key of something that has none.
    #[error("\"{path}\": {parent} is {found} in the scene, not {expected}")]
    Kind {
        /// The path.
        path: String,
        /// Where the path leads so far.
        parent: String,
        /// What is there.
        found: &'static str,
        /// What would have to be there.
        expected: &'static str,
    },
}

/// "; did you mean ...?" or what there is.
fn proposal(near: &[String], all: &[String]) -> String {
    match (near, all) {
        ([], []) => String::new(),
        ([], all) => format!("; there are {}", all.join(", ")),
        (near, _) => format!("; did you mean {}?", near.join(" or ")),
    }
}

/// Those of `names` that differ from `found` by a slip of the hand, the nearest first; three at most.
#[must_use]
pub fn nearest(found: &str, names: &[String]) -> Vec<String> {
    let allowed = (found.chars().count() / 3).max(2);
    let mut near: Vec<_> =
        names.iter().map(|name| (strsim::damerau_levenshtein(found, name), name)).filter(|(d, _)| *d <= allowed).collect();
    near.sort();
    near.into_iter().take(3).map(|(_, name)| name.clone()).collect()
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::String(_) => "a text",
        Value::Integer(_) | Value::Float(_) => "a number",
        Value::Boolean(_) => "true or false",
        Value::Datetime(_) => "a date",
        Value::Array(_) => "a list",
        Value::Table(_) => "a table",
    }
}

impl KeyPath {
    /// The path that `text` spells.
    ///
    /// # Errors
    /// [`KeyFault::Syntax`].
    pub fn parse(text: &str) -> Result<Self, KeyFault> {
        let fault = |reason| KeyFault::Syntax { text: text.to_owned(), reason };
        let mut steps = Vec::new();
        let mut rest = text.trim();
        let mut first = true;
        while !rest.is_empty() {
            if let Some(inside) = rest.strip_prefix('[') {
                let (number, after) = inside.split_once(']').ok_or_else(|| fault("a [ without its ]"))?;
                let number: usize = number.trim().parse().map_err(|_| fault("between [ and ] stands the number of an item"))?;
                let item = number.checked_sub(1).ok_or_else(|| fault("items are counted from 1"))?;
                if first {
                    return Err(fault("it begins with an item"));
                }
                steps.push(KeyStep::Item(item));
                rest = after;
                continue;
            }
            if !first {
                rest = rest.strip_prefix('.').ok_or_else(|| fault("a dot is missing"))?;
            }
            first = false;
            let name = if let Some(quoted) = rest.strip_prefix('"') {
                let (name, after) = quoted.split_once('"').ok_or_else(|| fault("a quote without its end"))?;
                rest = after;
                name
            } else {
                let (name, after) = rest.split_at(rest.find(['.', '[', '"', ']']).unwrap_or(rest.len()));
                rest = after;
                name.trim()
            };
            if name.is_empty() {
                return Err(fault("a key is empty"));
            }
            steps.push(KeyStep::Key(name.to_owned()));
        }
        if steps.is_empty() {
            return Err(fault("it is empty"));
        }
        Ok(Self { text: text.trim().to_owned(), steps })
    }

    /// The path as it was written.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The steps with names of items replaced by their places: two paths to one key have the same.
    ///
    /// # Errors
    /// If a step leads to nothing, other than a key that the scene leaves at its default.
    fn resolved(&self, document: &Table) -> Result<Vec<KeyStep>, KeyFault> {
        let mut here: Option<&Value> = None;
        let mut steps: Vec<KeyStep> = Vec::new();
        let kind_fault = |steps: &[KeyStep], value: &Value, expected| KeyFault::Kind {
            path: self.text.clone(),
            parent: spelled(steps),
            found: kind(value),
            expected,
        };
        for (depth, step) in self.steps.iter().enumerate() {
            let next = match (step, here) {
                (KeyStep::Key(name), None) if depth == 0 => document.get(name),
                (KeyStep::Key(name), Some(Value::Table(table))) => table.get(name),
                (KeyStep::Key(name), Some(Value::Array(list))) if list.iter().any(Value::is_table) => {
                    let place = self.named(name, list, &steps)?;
                    steps.push(KeyStep::Item(place));
                    here = list.get(place);
                    continue;
                }
                (KeyStep::Item(place), Some(Value::Array(list))) => {
                    let count = list.len();
                    let no_item = || KeyFault::NoItem { path: self.text.clone(), list: spelled(&steps), count };
                    Some(list.get(*place).ok_or_else(no_item)?)
                }
                (KeyStep::Key(_), None) => None,
                (KeyStep::Item(_), None) => {
                    let list = spelled(&steps);
                    return Err(KeyFault::Unknown { path: self.text.clone(), what: "list".into(), name: list, near: vec![], all: vec![] });
                }
                (KeyStep::Key(_), Some(value)) => return Err(kind_fault(&steps, value, "a table of keys")),
                (KeyStep::Item(_), Some(value)) => return Err(kind_fault(&steps, value, "a list")),
            };
            steps.push(step.clone());
            here = next;
        }
        Ok(steps)
    }

    /// Place of the item of that name in a list of tables.
    fn named(&self, name: &str, list: &[Value], steps: &[KeyStep]) -> Result<usize, KeyFault> {
        let name_of = |item: &Value| item.get("name").and_then(Value::as_str).map(str::to_owned);
        list.iter().position(|item| name_of(item).as_deref() == Some(name)).ok_or_else(|| {
            let mut all: Vec<String> = list.iter().filter_map(name_of).collect();
            if all.is_empty() {
                all = (1..=list.len()).map(|i| format!("{}[{i}]", spelled(steps))).collect();
            }
            KeyFault::Unknown { path: self.text.clone(), what: spelled(steps), name: name.to_owned(), near: nearest(name, &all), all }
        })
    }

    /// The value in the document; none for a key that is not there.
    ///
    /// # Errors
    /// If the path leads to nothing.
    pub fn get<'d>(&self, document: &'d Table) -> Result<Option<&'d Value>, KeyFault> {
        let steps = self.resolved(document)?;
        let Some((KeyStep::Key(first), rest)) = steps.split_first() else { return Ok(None) };
        let below = |here: &'d Value, step: &KeyStep| match step {
            KeyStep::Key(name) => here.get(name),
            KeyStep::Item(place) => here.get(place),
        };
        Ok(rest.iter().try_fold(document.get(first), |here, step| Some(here.and_then(|value| below(value, step)))).flatten())
    }

    /// Puts a value into the document; tables on the way to it are made where the scene leaves them out.
    ///
    /// # Errors
    /// If the path leads to nothing.
    pub fn set(&self, document: &mut Table, value: Value) -> Result<(), KeyFault> {
        let steps = self.resolved(document)?;
        let Some((KeyStep::Key(first), rest)) = steps.split_first() else { return Ok(()) };
        let mut here = document.entry(first.clone()).or_insert_with(|| Value::Table(Table::new()));
        for step in rest {
            let next = match (step, here) {
                (KeyStep::Key(name), Value::Table(table)) => Some(table.entry(name.clone()).or_insert_with(|| Value::Table(Table::new()))),
                (KeyStep::Item(place), Value::Array(list)) => list.get_mut(*place),
                _ => None,
            };
            // resolved() has been there
            let Some(next) = next else { return Ok(()) };
            here = next;
        }
        *here = value;
        Ok(())
    }

    /// True if both lead to the same key, or one leads into the other.
    ///
    /// # Errors
    /// If one leads to nothing.
    pub fn overlaps(&self, other: &Self, document: &Table) -> Result<bool, KeyFault> {
        let (a, b) = (self.resolved(document)?, other.resolved(document)?);
        Ok(a.iter().zip(&b).all(|(a, b)| a == b))
    }

    /// Holds the keys of the document against those that a scene may have.
    ///
    /// # Errors
    /// [`KeyFault::Unknown`] with the nearest keys.
    pub fn check(&self, document: &Table) -> Result<(), KeyFault> {
        let Err(error) = document.clone().try_into::<SceneSpec>() else { return Ok(()) };
        match unknown_field(error.message()) {
            None => Ok(()),
            Some((name, all)) => {
                Err(KeyFault::Unknown { path: self.text.clone(), what: "key".into(), near: nearest(&name, &all), name, all })
            }
        }
    }
}

/// Keys and items as they are written.
fn spelled(steps: &[KeyStep]) -> String {
    steps.iter().fold(String::new(), |text, step| match step {
        KeyStep::Key(name) if text.is_empty() => name.clone(),
        KeyStep::Key(name) => format!("{text}.{name}"),
        KeyStep::Item(place) => format!("{text}[{}]", place + 1),
    })
}

/// The key that serde does not know, and those that it does.
fn unknown_field(message: &str) -> Option<(String, Vec<String>)> {
    let mut quoted = message.strip_prefix("unknown field ")?.split('`').skip(1).step_by(2).map(str::to_owned);
    Some((quoted.next()?, quoted.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[[body]]
name = "hub"
mass = 1.0
[[body]]
name = "left panel"
modal_file = "panel.h5"
[[hinge]]
name = "drive"
kind = "revolute"
parent = "world"
child = "hub"
position = [0.1]
[[load]]
body = "hub"
force = { sine = { amplitude = [0.0, 0.0, 1.0], frequency_hz = 2.0 } }
"#;

    fn scene() -> Table {
        SCENE.parse().unwrap()
    }

    fn fault(path: &str) -> String {
        let mut document = scene();
        let put = KeyPath::parse(path).and_then(|key| {
            key.set(&mut document, Value::Float(1.0))?;
            key.check(&document)
        });
        put.unwrap_err().to_string()
    }

    #[test]
    fn values_are_put_where_the_path_leads() {
        for (path, same) in [
            ("gravity[3]", "gravity[3]"),
            ("body.hub.mass", "body[1].mass"),
            ("body.\"left panel\".damping_ratio", "body[2].damping_ratio"),
            ("body.left panel.damping_ratio", "body[2].damping_ratio"),
            ("hinge.drive.position[1]", "hinge[1].position[1]"),
            ("load[1].force.sine.amplitude[2]", "load[1].force.sine.amplitude[2]"),
            ("simulation.relative_tolerance", "simulation.relative_tolerance"),
        ] {
            let mut document = scene();
            let (key, other) = (KeyPath::parse(path).unwrap(), KeyPath::parse(same).unwrap());
            key.set(&mut document, Value::Float(7.5)).unwrap();
            assert_eq!(other.get(&document).unwrap(), Some(&Value::Float(7.5)), "{path}");
            assert!(key.overlaps(&other, &scene()).unwrap());
            key.check(&document).unwrap();
            // nothing else has changed
            other.set(&mut document, Value::Boolean(true)).unwrap();
            let mut expected = scene();
            key.set(&mut expected, Value::Boolean(true)).unwrap();
            assert_eq!(document, expected);
        }
        let (whole, item) = (KeyPath::parse("gravity").unwrap(), KeyPath::parse("gravity[3]").unwrap());
        assert!(whole.overlaps(&item, &scene()).unwrap());
        assert!(!KeyPath::parse("gravity[1]").unwrap().overlaps(&item, &scene()).unwrap());
        assert_eq!(KeyPath::parse("hinge.drive.damping").unwrap().get(&scene()).unwrap(), None);
    }

    #[test]
    fn paths_that_lead_nowhere_name_what_is_near() {
        assert!(fault("hinge.drve.stiffness").contains("the scene has no hinge \"drve\"; did you mean drive?"));
        assert!(fault("hinge.panel.stiffness").contains("there are drive"));
        assert!(fault("hinge.drive.stifness").contains("the scene has no key \"stifness\"; did you mean stiffness?"));
        assert!(fault("hinge.drive.torque.sin.amplitude").contains("no key \"sin\"; did you mean sine"));
        assert!(fault("simulation.tolerance").contains("there are duration, integrator, relative_tolerance"));
        assert!(fault("gravty[3]").contains("the scene has no list \"gravty\""));
        assert!(fault("gravity[4]").contains("gravity has 3 items in the scene, counted from 1"));
        assert!(fault("hinge.drive.velocity[1]").contains("no list \"hinge[1].velocity\""));
        assert!(fault("load.hub.force").contains("no load \"hub\"; there are load[1]"));
        assert!(fault("body.hub.mass.value").contains("body[1].mass is a number in the scene, not a table of keys"));
        assert!(fault("body.hub.mass[1]").contains("body[1].mass is a number in the scene, not a list"));
    }

    #[test]
    fn texts_that_are_no_path_are_refused() {
        for text in ["", " ", "a.", ".a", "a..b", "a[0]", "a[x]", "a[1", "[1]", "a[1]b", "a.\"b", "a]b"] {
            assert!(matches!(KeyPath::parse(text), Err(KeyFault::Syntax { .. })), "{text}");
        }
    }
}
