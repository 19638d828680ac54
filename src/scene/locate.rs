//! From a key of the scene to its line and column.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A step towards a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// Key of a table.
    Key(&'static str),
    /// Place in a list, 0-based.
    Index(usize),
}

/// A key with its place in the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Location {
    /// 1-based.
    pub line: usize,
    /// 1-based, in characters.
    pub column: usize,
    /// As in `hinge[3].parent`, items counted from 1.
    pub key: String,
}

fn position(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    (line, column)
}

/// Where the path leads in `text`; the last part of it that exists if it does not lead all the way.
#[must_use]
pub fn locate(text: &str, path: &[Step]) -> Location {
    let key = path.iter().fold(String::new(), |key, step| match step {
        Step::Key(name) if key.is_empty() => (*name).to_owned(),
        Step::Key(name) => format!("{key}.{name}"),
        Step::Index(i) => format!("{key}[{}]", i + 1),
    });
    let mut offset = 0;
    if let Ok(root) = DeTable::parse(text) {
        let mut here: Option<&DeValue<'_>> = None;
        for step in path {
            let next = match (step, here) {
                (Step::Key(name), None) => root.get_ref().get(*name),
                (Step::Key(name), Some(DeValue::Table(table))) => table.get(*name),
                (Step::Index(i), Some(DeValue::Array(list))) => list.get(*i),
                _ => None,
            };
            let Some(next) = next else { break };
            offset = next.span().start;
            here = Some(next.get_ref());
        }
    }
    let (line, column) = position(text, offset);
    Location { line, column, key }
}

/// The first number in `text` that is not finite, with its path spelled out.
#[must_use]
pub fn first_not_finite(text: &str) -> Option<Location> {
    fn walk(value: &Spanned<DeValue<'_>>, key: String) -> Option<(usize, String)> {
        match value.get_ref() {
            DeValue::Float(number) => {
                let finite = number.as_str().parse::<f64>().is_ok_and(f64::is_finite);
                (!finite).then(|| (value.span().start, key))
            }
            DeValue::Array(list) => list.iter().enumerate().find_map(|(i, v)| walk(v, format!("{key}[{}]", i + 1))),
            DeValue::Table(table) => table.iter().find_map(|(k, v)| walk(v, format!("{key}.{}", k.get_ref()))),
            _ => None,
        }
    }
    let root = DeTable::parse(text).ok()?;
    let (offset, key) = root.get_ref().iter().find_map(|(k, v)| walk(v, k.get_ref().to_string()))?;
    let (line, column) = position(text, offset);
    Some(Location { line, column, key })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"x\"\n[[hinge]]\nparent = \"a\"\n[[hinge]]\nparent = \"b\"\naxis = [0.0, nan, 1.0]\n";

    #[test]
    fn keys_are_found_at_their_line_and_column() {
        let found = locate(TEXT, &[Step::Key("hinge"), Step::Index(1), Step::Key("parent")]);
        assert_eq!((found.line, found.column, found.key.as_str()), (5, 10, "hinge[2].parent"));
        let missing = locate(TEXT, &[Step::Key("hinge"), Step::Index(1), Step::Key("child")]);
        assert_eq!((missing.line, missing.key.as_str()), (4, "hinge[2].child"));
    }

    #[test]
    fn numbers_that_are_not_finite_are_found() {
        let found = first_not_finite(TEXT).unwrap();
        assert_eq!((found.line, found.key.as_str()), (6, "hinge[2].axis[2]"));
        assert_eq!(first_not_finite("x = 1e400\n").unwrap().key, "x");
    }
}
