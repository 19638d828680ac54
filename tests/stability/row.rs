//! One line of the stability table.

/// What a case says of one quantity.
#[derive(Debug)]
pub struct Row {
    case: &'static str,
    quantity: String,
    bound: String,
    measured: String,
    holds: bool,
}

pub const EPS: f64 = f64::EPSILON;

impl Row {
    /// A number that is at most `bound`; `reason` says where the bound comes from.
    pub fn at_most(case: &'static str, quantity: impl Into<String>, measured: f64, bound: f64, reason: &str) -> Self {
        let reason = if reason.is_empty() { String::new() } else { format!(" ({reason})") };
        Self {
            case,
            quantity: quantity.into(),
            bound: format!("{bound:.1e}{reason}"),
            measured: format!("{measured:.1e}"),
            // what is not a number meets no bound
            holds: measured <= bound,
        }
    }

    /// A message that names all of `words`.
    pub fn says(case: &'static str, quantity: impl Into<String>, found: Option<String>, words: &[&str]) -> Self {
        let holds = found.as_ref().is_some_and(|text| words.iter().all(|w| text.contains(w)));
        let bound = format!("an error that names {}", words.join(", "));
        Self { case, quantity: quantity.into(), bound, measured: if holds { "so".into() } else { format!("{found:?}") }, holds }
    }

    /// The same line with other words for its bound.
    pub fn named(mut self, bound: &str) -> Self {
        self.bound = bound.into();
        self
    }

    /// A property that holds or does not.
    pub fn holds(case: &'static str, quantity: impl Into<String>, bound: &str, measured: impl Into<String>, holds: bool) -> Self {
        Self { case, quantity: quantity.into(), bound: bound.into(), measured: measured.into(), holds }
    }
}

/// Prints the rows as the table's script reads them, and asserts that every one meets its bound.
#[track_caller]
pub fn assert_rows(rows: &[Row]) {
    for row in rows {
        println!("stability | {} | {} | {} | {}", row.case, row.quantity, row.bound, row.measured);
    }
    let missed: Vec<_> = rows.iter().filter(|r| !r.holds).collect();
    assert!(!rows.is_empty() && missed.is_empty(), "missed: {missed:#?}");
}

/// Largest `|found - expected| / |expected|`.
pub fn componentwise(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).fold(0.0, |worst, (f, e)| {
        let off = (f - e).abs() / e.abs();
        // NaN must not get lost in a maximum
        if off > worst || off.is_nan() { off } else { worst }
    })
}
