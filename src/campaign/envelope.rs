//! The envelope over cases: largest and smallest value of every component of every load, with what acted beside it, the case and the time.

use super::record::{CaseRecord, Header, Shard};
use crate::output::evaluation::Named;
use crate::output::extremes::Sense;
use serde::Serialize;

/// One row of an envelope.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// "max" or "min".
    pub extreme: &'static str,
    /// Of this component.
    pub component: String,
    /// Its value; the largest or smallest of all cases.
    pub value: f64,
    /// All components at that instant, this one among them.
    pub load: Vec<f64>,
    /// Number of the case, counted from 1; the lowest of equals.
    pub case: usize,
    /// s.
    pub time_s: f64,
    /// Value of every parameter in that case.
    pub parameters: Vec<serde_json::Value>,
}

/// Of one load: a row for the largest value of every component, then for the smallest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoadEnvelope {
    /// Names of the components.
    pub components: Vec<String>,
    /// Unit of each.
    pub units: Vec<String>,
    /// Axes of the components.
    pub frame: Option<String>,
    /// Point about which moments are taken.
    pub point: Option<String>,
    /// Who acts on whom.
    pub side: String,
    /// Rows; none if no case is complete.
    pub rows: Vec<Row>,
}

/// Envelopes of all loads, over the cases taken in so far.
#[derive(Debug, Clone, PartialEq)]
pub struct Envelope {
    /// By load, in the order of the heading.
    pub loads: Vec<LoadEnvelope>,
    /// Cases that are in it.
    pub completed: usize,
    /// Cases that failed, counted from 1, with their parameters and why: the first few.
    pub failures: Vec<CaseFailure>,
    /// How many failed.
    pub failed: usize,
    /// Wall-clock time of all cases together (s).
    pub wall_s: f64,
}

/// A case that failed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CaseFailure {
    /// Number, counted from 1.
    pub case: usize,
    /// Value of every parameter.
    pub parameters: Vec<serde_json::Value>,
    /// Why.
    pub message: String,
}

/// Failed cases whose message is kept for the report; the results file has all.
const MOST_FAILURES: usize = 10;

impl Envelope {
    /// An envelope of no case.
    #[must_use]
    pub fn new(header: &Header) -> Self {
        let empty = header.loads.iter().map(|load| LoadEnvelope {
            components: load.components.clone(),
            units: load.units.clone(),
            frame: load.frame.clone(),
            point: load.point.clone(),
            side: load.side.clone(),
            rows: Vec::new(),
        });
        Self { loads: empty.collect(), completed: 0, failures: Vec::new(), failed: 0, wall_s: 0.0 }
    }

    /// Takes in a case; cases come in the order of their numbers, so that the lowest of equals stays.
    pub fn follow(&mut self, record: &CaseRecord) {
        self.wall_s += record.wall_s;
        if let Some(message) = &record.failure {
            self.failed += 1;
            if self.failures.len() < MOST_FAILURES {
                self.failures.push(CaseFailure { case: record.case, parameters: record.values.clone(), message: message.clone() });
            }
            return;
        }
        self.completed += 1;
        for (envelope, extremes) in self.loads.iter_mut().zip(&record.loads) {
            let width = envelope.components.len();
            let places = Sense::BOTH.into_iter().flat_map(|sense| (0..width).map(move |component| (sense, component)));
            for (index, (sense, component)) in places.enumerate() {
                let (time_s, load) = extremes.at(width, sense, component);
                let value = load[component];
                if envelope.rows.get(index).is_some_and(|row| !sense.exceeds(value, row.value)) {
                    continue;
                }
                let row = Row {
                    extreme: sense.name(),
                    component: envelope.components[component].clone(),
                    value,
                    load: load.to_vec(),
                    case: record.case,
                    time_s,
                    parameters: record.values.clone(),
                };
                match envelope.rows.get_mut(index) {
                    Some(old) => *old = row,
                    None => envelope.rows.push(row),
                }
            }
        }
    }
}

/// What a campaign has found, for the screen and as JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CampaignReport {
    /// Name of the scene.
    pub scene: String,
    /// Cases of all shards together.
    pub cases: usize,
    /// The share that was run.
    pub shard: Shard,
    /// Complete cases in the envelope.
    pub completed: usize,
    /// Cases that failed.
    pub failed: usize,
    /// Cases that were in the records file already.
    pub resumed: usize,
    /// Threads; none where nothing was run.
    pub threads: Option<usize>,
    /// Wall-clock time of this run of the program (s); none where nothing was run.
    pub wall_s: Option<f64>,
    /// Wall-clock time of all cases together (s).
    pub case_wall_s: f64,
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// The first of the cases that failed.
    pub failures: Vec<CaseFailure>,
    /// By hinge.
    pub hinges: Named<LoadEnvelope>,
    /// By closure.
    pub closures: Named<LoadEnvelope>,
    /// What was written.
    pub file: String,
}

impl CampaignReport {
    /// The report of an envelope; what was run is added by who ran it.
    #[must_use]
    pub fn new(header: &Header, envelope: Envelope, file: String) -> Self {
        let mut groups = [Named::default(), Named::default()];
        for (load, found) in header.loads.iter().zip(envelope.loads) {
            groups[usize::from(load.group != "hinges")].0.push((load.owner.clone(), found));
        }
        let [hinges, closures] = groups;
        Self {
            scene: header.scene_name.clone(),
            cases: header.cases,
            shard: header.shard,
            completed: envelope.completed,
            failed: envelope.failed,
            resumed: 0,
            threads: None,
            wall_s: None,
            case_wall_s: envelope.wall_s,
            parameters: header.parameters.iter().map(|p| p.name.clone()).collect(),
            failures: envelope.failures,
            hinges,
            closures,
            file,
        }
    }

    /// The envelope as a table: one row per extreme, with all components, the case, the time and the values of the parameters.
    ///
    /// # Errors
    /// If the rows cannot be written.
    pub fn write_csv(&self, sink: &mut dyn std::io::Write) -> Result<(), csv::Error> {
        let mut writer = csv::Writer::from_writer(sink);
        let six = ["moment_x (N m)", "moment_y (N m)", "moment_z (N m)", "force_x (N)", "force_y (N)", "force_z (N)"];
        let heading = ["load", "name", "extreme", "component", "value", "unit"].into_iter().chain(six).chain(["case", "time (s)"]);
        writer.write_record(heading.chain(self.parameters.iter().map(String::as_str)))?;
        for (group, envelopes) in [("hinge", &self.hinges), ("closure", &self.closures)] {
            for (name, envelope) in envelopes.iter() {
                for (index, row) in envelope.rows.iter().enumerate() {
                    let unit = envelope.units[index % envelope.units.len()].clone();
                    // a gear has no components
                    let components =
                        (0..six.len()).map(|i| row.load.get(i).filter(|_| row.load.len() > 1).map_or(String::new(), f64::to_string));
                    let mut cells = vec![group.into(), name.into(), row.extreme.into(), row.component.clone(), row.value.to_string(), unit];
                    cells.extend(components);
                    cells.extend([row.case.to_string(), row.time_s.to_string()]);
                    cells.extend(row.parameters.iter().map(plain));
                    writer.write_record(cells)?;
                }
            }
        }
        Ok(writer.flush()?)
    }
}

/// A value without the quotes of JSON.
#[must_use]
pub fn plain(value: &serde_json::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::super::records::tests::{header, record};
    use super::*;

    #[test]
    fn the_lowest_of_equal_cases_stays_and_failures_do_not_count() {
        let mut envelope = Envelope::new(&header());
        envelope.follow(&record(0, 1.0));
        envelope.follow(&record(1, 4.0));
        envelope.follow(&CaseRecord { failure: Some("no".into()), loads: Vec::new(), ..record(2, 9.0) });
        envelope.follow(&record(3, 4.0));
        let rows = &envelope.loads[0].rows;
        assert_eq!((envelope.completed, envelope.failed, envelope.failures[0].case), (3, 1, 3));
        assert_eq!((rows[0].extreme, rows[0].value, rows[0].case, rows[0].time_s), ("max", 4.0, 2, 0.5));
        assert_eq!((rows[1].extreme, rows[1].value, rows[1].case, rows[1].time_s), ("min", -1.5, 1, 0.25));
    }
}
