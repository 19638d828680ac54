//! Tables of cases: a CSV file whose heading names keys of the scene, with one case per row.

use super::plan_spec::is_finite;
use crate::scene::SceneError;
use crate::scene::locate::Location;
use std::path::Path;
use toml::Value;

/// One column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Heading.
    pub key: String,
    /// One value per row.
    pub values: Vec<Value>,
}

/// The columns of the table in `text`. Lines that start with `#` are passed over.
///
/// # Errors
/// [`SceneError::Value`] with the line and the heading.
pub fn columns(path: &Path, text: &str) -> Result<Vec<Column>, SceneError> {
    let fault = |line: u64, key: &str, message: String| SceneError::Value {
        path: path.to_owned(),
        at: Location { line: usize::try_from(line).unwrap_or(0), column: 1, key: key.to_owned() },
        message,
    };
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).flexible(true).from_reader(text.as_bytes());
    let headings = reader.headers().map_err(|e| fault(1, "heading", e.to_string()))?.clone();
    let line_of = |record: &csv::StringRecord| record.position().map_or(0, csv::Position::line);
    let at = line_of(&headings);
    if headings.iter().all(str::is_empty) {
        return Err(fault(
            at.max(1),
            "heading",
            "the table is empty; its first line names keys of the scene, as in hinge.drive.stiffness".into(),
        ));
    }
    let mut columns: Vec<Column> = Vec::new();
    for (place, key) in headings.iter().enumerate() {
        if key.is_empty() {
            return Err(fault(at, "heading", format!("column {} has no heading; name a key of the scene", place + 1)));
        }
        if columns.iter().any(|c| c.key == key) {
            return Err(fault(at, "heading", format!("{key} heads two columns; keep one")));
        }
        columns.push(Column { key: key.to_owned(), values: Vec::new() });
    }
    for record in reader.records() {
        let record = record.map_err(|e| fault(e.position().map_or(0, csv::Position::line), "row", e.to_string()))?;
        let line = line_of(&record);
        if record.len() != columns.len() {
            let message = format!("{} values, but the heading names {} keys; write a value for each", record.len(), columns.len());
            return Err(fault(line, "row", message));
        }
        for (column, cell) in columns.iter_mut().zip(record.iter()) {
            let value = value_of(cell).map_err(|message| fault(line, &column.key, message))?;
            if let Some(first) = column.values.first().filter(|first| kind(first) != kind(&value)) {
                let message = format!("\"{cell}\" is {}, but the rows above have {}; give all of one kind", kind(&value), kind(first));
                return Err(fault(line, &column.key, message));
            }
            column.values.push(value);
        }
    }
    if columns[0].values.is_empty() {
        return Err(fault(at, "row", "the table has a heading but no rows; each row is a case".into()));
    }
    Ok(columns)
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Integer(_) | Value::Float(_) => "a number",
        Value::Boolean(_) => "true or false",
        Value::Array(_) => "a list",
        Value::Table(_) => "a table",
        Value::String(_) | Value::Datetime(_) => "a text",
    }
}

/// A number, true or false, a list or table as in TOML, else a text.
fn value_of(cell: &str) -> Result<Value, String> {
    if cell.is_empty() {
        return Err("the cell is empty; write a value".into());
    }
    if let Ok(integer) = cell.parse::<i64>() {
        return Ok(Value::Integer(integer));
    }
    if let Ok(number) = cell.parse::<f64>() {
        return if number.is_finite() { Ok(Value::Float(number)) } else { Err(format!("{cell} is not finite; write a finite number")) };
    }
    if let Ok(switch) = cell.parse::<bool>() {
        return Ok(Value::Boolean(switch));
    }
    if !cell.starts_with(['[', '{']) {
        return Ok(Value::String(cell.to_owned()));
    }
    let parsed = format!("value = {cell}").parse::<toml::Table>();
    match parsed.ok().and_then(|mut table| table.remove("value")) {
        Some(value) if is_finite(&value) => Ok(value),
        _ => Err(format!("{cell} is not a list or table of finite values as TOML writes it")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Column>, String> {
        columns(Path::new("cases.csv"), text).map_err(|e| e.to_string())
    }

    #[test]
    fn cells_are_numbers_switches_lists_or_texts() {
        let table = read("# angles\nmass, closure.rod.method ,flag,axis\n1,auto,true,\"[0, 1.5]\"\n2.5e0 , tree_augmented,false,\"[1]\"\n")
            .unwrap();
        assert_eq!(table.iter().map(|c| c.key.as_str()).collect::<Vec<_>>(), ["mass", "closure.rod.method", "flag", "axis"]);
        assert_eq!(table[0].values, [Value::Integer(1), Value::Float(2.5)]);
        assert_eq!(table[1].values[1], Value::String("tree_augmented".into()));
        assert_eq!(table[2].values[0], Value::Boolean(true));
        assert_eq!(table[3].values[0], Value::Array(vec![Value::Integer(0), Value::Float(1.5)]));
    }

    #[test]
    fn a_table_that_cannot_be_is_refused_with_line_and_key() {
        for (text, expected) in [
            ("", "cases.csv:1:1: heading: the table is empty"),
            ("a,,b\n1,2,3\n", "cases.csv:1:1: heading: column 2 has no heading"),
            ("a,a\n1,2\n", "heading: a heads two columns"),
            ("a,b\n", "row: the table has a heading but no rows"),
            ("a,b\n1,2\n1\n", "cases.csv:3:1: row: 1 values, but the heading names 2 keys"),
            ("a,b\n1,\n", "cases.csv:2:1: b: the cell is empty"),
            ("a,b\n1,nan\n", "cases.csv:2:1: b: nan is not finite"),
            ("a,b\n1,1e999\n", "b: 1e999 is not finite"),
            ("# c\na\n1\nx\n", "cases.csv:4:1: a: \"x\" is a text, but the rows above have a number"),
            ("a\n\"[1, 2\"\n", "a: [1, 2 is not a list"),
            ("a\n\"[1, nan]\"\n", "is not a list or table of finite values"),
        ] {
            let found = read(text).unwrap_err();
            assert!(found.contains(expected), "{text:?}: {found}");
        }
    }
}
