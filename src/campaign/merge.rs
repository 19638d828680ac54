//! Shards of one campaign, held against each other and read as one.

use super::error::CampaignError;
use super::identity::differences;
use super::record::{CaseRecord, Header, Shard};
use super::records::Records;
use std::path::PathBuf;

/// Where the records of a whole campaign are read: one file, or one for each shard.
#[derive(Debug)]
pub struct Whole {
    /// By shard.
    shards: Vec<Records>,
    header: Header,
}

impl From<Records> for Whole {
    fn from(records: Records) -> Self {
        Self { header: records.header.clone(), shards: vec![records] }
    }
}

impl Whole {
    /// Opens the shards of a campaign, given in any order.
    ///
    /// # Errors
    /// If a file cannot be read, is of another campaign, or a shard or a case is missing; all that is wrong is named.
    pub fn open(paths: &[PathBuf]) -> Result<Self, CampaignError> {
        let mut shards = paths.iter().map(|path| Records::open_shard(path)).collect::<Result<Vec<_>, _>>()?;
        shards.sort_by_key(|records| records.header.shard.index);
        let mut faults = Vec::new();
        let Some(first) = shards.first() else { return Err(CampaignError::Shards(vec!["no shard is given".into()])) };
        let (count, header) = (first.header.shard.count, Header { shard: Shard::WHOLE, ..first.header.clone() });
        let mut found: Vec<Option<&Records>> = vec![None; count];
        for records in &shards {
            let (path, Shard { index, count: of }) = (records.path().display(), records.header.shard);
            if (Header { shard: Shard::WHOLE, ..records.header.clone() }) != header {
                let mut names = differences(&records.header.identity, &header.identity);
                if names.is_empty() {
                    names.push("what the scene is assembled to".into());
                }
                let reference = first.path().display();
                faults.push(format!("{path}: of another campaign than {reference}: not the same are {}; leave it out", names.join(", ")));
                continue;
            }
            if of != count {
                faults.push(format!(
                    "{path}: shard {index} of {of}, but {} is one of {count}; merge shards of one division",
                    first.path().display()
                ));
                continue;
            }
            if let Some(other) = found[index - 1].replace(records) {
                faults.push(format!("{path}: shard {index} of {count}, which {} is too; give each once", other.path().display()));
                continue;
            }
            let missing = records.missing();
            if let Some(case) = missing.first() {
                let (lacks, all) = (missing.len(), records.header.shard.cases(header.cases).count());
                faults.push(format!(
                    "{path}: {lacks} of {all} cases are missing (the first is case {}); run shard {index}/{count} again, it goes on there",
                    case + 1
                ));
            }
        }
        let absent: Vec<String> =
            found.iter().enumerate().filter(|(_, r)| r.is_none()).map(|(i, _)| format!("{}/{count}", i + 1)).collect();
        if !absent.is_empty() {
            faults.push(format!("no file is of shard {}; run it by pliant sweep --shard, or add its file", absent.join(", ")));
        }
        if faults.is_empty() { Ok(Self { shards, header }) } else { Err(CampaignError::Shards(faults)) }
    }

    /// What all records have in common.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The record of a case, counted from 0; none if it is not there.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn record(&mut self, case: usize) -> Result<Option<CaseRecord>, CampaignError> {
        match self.shards.iter_mut().find(|records| records.has(case)) {
            Some(records) => records.record(case),
            None => Ok(None),
        }
    }

    /// Files that are read.
    #[must_use]
    pub fn paths(&self) -> Vec<PathBuf> {
        self.shards.iter().map(|records| records.path().to_owned()).collect()
    }
}
