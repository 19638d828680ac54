//! Tables for the terminal.

use std::io::{self, Write};

/// How a column is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// Text.
    Left,
    /// Numbers.
    Right,
}

/// Rows of text under headings, two spaces apart, indented by two.
#[derive(Debug)]
pub struct Table {
    columns: Vec<(String, Align)>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with these headings.
    pub fn new(columns: &[(&str, Align)]) -> Self {
        Self { columns: columns.iter().map(|&(name, align)| (name.to_owned(), align)).collect(), rows: Vec::new() }
    }

    /// Adds a row; missing cells are empty, further cells are dropped.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        let mut row: Vec<String> = cells.into_iter().take(self.columns.len()).collect();
        row.resize(self.columns.len(), String::new());
        self.rows.push(row);
    }

    /// Writes headings and rows.
    pub fn write(&self, output: &mut dyn Write) -> io::Result<()> {
        let width = |i: usize, heading: &str| self.rows.iter().map(|row| row[i].chars().count()).chain([heading.chars().count()]).max();
        let widths: Vec<usize> = self.columns.iter().enumerate().map(|(i, (name, _))| width(i, name).unwrap_or(0)).collect();
        let headings: Vec<String> = self.columns.iter().map(|(name, _)| name.clone()).collect();
        for row in std::iter::once(&headings).chain(&self.rows) {
            let mut line = String::new();
            for ((cell, &width), (_, align)) in row.iter().zip(&widths).zip(&self.columns) {
                let gap = " ".repeat(width - cell.chars().count());
                let padded = if *align == Align::Left { format!("  {cell}{gap}") } else { format!("  {gap}{cell}") };
                line.push_str(&padded);
            }
            writeln!(output, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// A number in six significant digits, plain where that is short.
pub fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e6).contains(&magnitude) {
        let decimals = (5 - magnitude.log10().floor() as i32).clamp(0, 9) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_aligns_its_columns() {
        let mut table = Table::new(&[("name", Align::Left), ("value", Align::Right)]);
        table.row(["a".to_owned(), "12.5".to_owned()]);
        table.row(["longer".to_owned()]);
        let mut text = Vec::new();
        table.write(&mut text).unwrap();
        assert_eq!(String::from_utf8(text).unwrap(), "  name    value\n  a        12.5\n  longer\n");
    }

    #[test]
    fn numbers_show_six_digits() {
        assert_eq!([0.0, 3.0, -0.25, 123_456.7, 1e-9].map(number), ["0", "3.00000", "-0.250000", "123457", "1.000e-9"]);
    }
}
