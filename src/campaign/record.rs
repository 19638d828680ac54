//! What a records file holds: its heading, which all shards of a campaign have in common, and one finished case.

use super::identity::Identity;
use crate::output::extremes::Extremes;
use serde::{Deserialize, Serialize};

/// Version of the form.
pub const VERSION: &str = "1.0";

/// A share of a campaign: the cases c with c mod `count` = `index` - 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// Counted from 1.
    pub index: usize,
    /// Number of shards.
    pub count: usize,
}

impl Shard {
    /// The whole campaign.
    pub const WHOLE: Self = Self { index: 1, count: 1 };

    /// True if the case, counted from 0, is in this share.
    #[must_use]
    pub fn has(self, case: usize) -> bool {
        case % self.count == self.index - 1
    }

    /// Cases of this share, counted from 0, of a campaign of `cases`.
    pub fn cases(self, cases: usize) -> impl Iterator<Item = usize> {
        (self.index - 1..cases).step_by(self.count)
    }
}

/// A parameter as the results file keeps it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ParameterRecord {
    /// Unique.
    pub name: String,
    /// Keys of the scene, separated by commas.
    pub keys: String,
    /// True if the value multiplies what the scene has.
    pub scale: bool,
}

/// A load as the results file keeps it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoadRecord {
    /// "hinges" or "closures".
    pub group: String,
    /// Name of the hinge or closure.
    pub owner: String,
    /// Names of the components: moment x, y, z, force x, y, z; one for a gear.
    pub components: Vec<String>,
    /// Unit of each component.
    pub units: Vec<String>,
    /// Axes of the components.
    pub frame: Option<String>,
    /// Point about which moments are taken.
    pub point: Option<String>,
    /// Who acts on whom.
    pub side: String,
}

/// A modal file of the scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModalFileEntry {
    /// Name of the body.
    pub body: String,
    /// Digest of its content.
    pub content_sha256: String,
}

/// What all records of a campaign have in common.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Version of the form; the first key.
    pub pliant_campaign: String,
    /// What decides the numbers.
    pub identity: Identity,
    /// The share that the file holds.
    pub shard: Shard,
    /// Cases of all shards together.
    pub cases: usize,
    /// Name of the scene.
    pub scene_name: String,
    /// Its text.
    pub scene: String,
    /// Text of the plan.
    pub plan: String,
    /// Seed of the random values.
    pub seed: u64,
    /// Modal files of the scene.
    pub modal_files: Vec<ModalFileEntry>,
    /// What varies.
    pub parameters: Vec<ParameterRecord>,
    /// What is followed.
    pub loads: Vec<LoadRecord>,
}

/// One finished case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaseRecord {
    /// Number, counted from 1.
    pub case: usize,
    /// Value of every parameter.
    pub values: Vec<serde_json::Value>,
    /// Why the case has no loads; none if it is complete.
    pub failure: Option<String>,
    /// Time reached (s).
    pub end_time_s: f64,
    /// Accepted steps.
    pub steps: u64,
    /// Wall-clock time (s); not part of the results.
    pub wall_s: f64,
    /// Extremes of every load; empty if the case failed.
    pub loads: Vec<Extremes>,
}

impl CaseRecord {
    /// True if the record fits the heading and all its numbers are finite.
    pub(super) fn fits(&self, header: &Header) -> bool {
        let cases = (1..=header.cases).contains(&self.case) && header.shard.has(self.case - 1);
        let whole =
            || self.loads.len() == header.loads.len() && self.loads.iter().zip(&header.loads).all(|(e, l)| e.is_whole(l.units.len()));
        cases && self.values.len() == header.parameters.len() && if self.failure.is_some() { self.loads.is_empty() } else { whole() }
    }
}
