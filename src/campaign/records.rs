//! The records of a campaign: a heading and one JSON object per finished case, appended as it ends.
//!
//! The file is what a campaign that was killed goes on from, and what a shard hands over. A last line that was cut short is cut off.
//! Numbers read back to the same bits.

use super::error::CampaignError;
use super::identity::differences;
use super::record::{CaseRecord, Header, Shard, VERSION};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// First key of a heading, by which the file is known, and version of its form.
const MARK: &str = "{\"pliant_campaign\":";

/// Time after which what was appended is made to survive a loss of power too.
const SYNC_EVERY: Duration = Duration::from_secs(1);
/// Longest line (bytes): 200 loads of six components and texts.
const MOST_LINE: u64 = 1 << 28;

/// A records file.
#[derive(Debug)]
pub struct Records {
    path: PathBuf,
    file: File,
    /// What all records have in common.
    pub header: Header,
    /// Where the line of each case of the campaign begins and how long it is.
    lines: Vec<Option<(u64, usize)>>,
    end: u64,
    synced: Instant,
}

impl Records {
    /// Opens the file at `path` for `header`, made if need be, and finds what is in it.
    ///
    /// # Errors
    /// If it cannot be opened, is being written, holds something else, or is of another campaign.
    pub fn open(path: &Path, header: Header) -> Result<Self, CampaignError> {
        let fail = |source| CampaignError::Open { path: path.to_owned(), source };
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(fail)?;
        // where the file system knows no locks, two at one file are not found out
        if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(CampaignError::Busy { path: path.to_owned() });
        }
        let mut records = match Self::read(path, file.try_clone().map_err(fail)?)? {
            Some(found) => found.held_against(&header)?,
            None => {
                file.set_len(0).map_err(fail)?;
                let lines = vec![None; header.cases];
                let mut new =
                    Self { path: path.to_owned(), file: file.try_clone().map_err(fail)?, header, lines, end: 0, synced: Instant::now() };
                let line = serde_json::to_string(&new.header).map_err(|e| fail(e.into()))?;
                new.append(&line)?;
                new
            }
        };
        // what was cut short
        records.file.set_len(records.end).map_err(fail)?;
        records.file = file;
        Ok(records)
    }

    /// Opens the file of a shard to read it.
    ///
    /// # Errors
    /// If it cannot be opened or holds something else.
    pub fn open_shard(path: &Path) -> Result<Self, CampaignError> {
        let file = File::open(path).map_err(|source| CampaignError::Open { path: path.to_owned(), source })?;
        Self::read(path, file)?.ok_or_else(|| CampaignError::Foreign { path: path.to_owned() })
    }

    /// What is in the file; none if it is empty or its heading was cut short.
    fn read(path: &Path, file: File) -> Result<Option<Self>, CampaignError> {
        let fail = |source| CampaignError::Open { path: path.to_owned(), source };
        let foreign = || CampaignError::Foreign { path: path.to_owned() };
        let mut reader = BufReader::new(file.try_clone().map_err(fail)?);
        reader.rewind().map_err(fail)?;
        let mut next = || -> Result<Option<Vec<u8>>, CampaignError> {
            let mut line = Vec::new();
            reader.by_ref().take(MOST_LINE).read_until(b'\n', &mut line).map_err(fail)?;
            Ok((!line.is_empty()).then_some(line))
        };
        let Some(first) = next()? else { return Ok(None) };
        let begins = first.iter().zip(MARK.as_bytes()).all(|(a, b)| a == b);
        if !begins {
            return Err(foreign());
        }
        if !first.ends_with(b"\n") {
            return Ok(None);
        }
        let header: Header = serde_json::from_slice(&first).map_err(|_| foreign())?;
        if header.pliant_campaign != VERSION
            || !(1..=header.shard.count).contains(&header.shard.index)
            || header.cases > super::plan::MOST_CASES
        {
            return Err(foreign());
        }
        let mut lines = vec![None; header.cases];
        let mut end = first.len() as u64;
        while let Some(line) = next()?.filter(|line| line.ends_with(b"\n")) {
            let record = serde_json::from_slice::<CaseRecord>(&line).ok().filter(|record| record.fits(&header));
            if let Some(record) = record {
                lines[record.case - 1].get_or_insert((end, line.len()));
            }
            end += line.len() as u64;
        }
        Ok(Some(Self { path: path.to_owned(), file, header, lines, end, synced: Instant::now() }))
    }

    fn held_against(self, header: &Header) -> Result<Self, CampaignError> {
        let mut found = differences(&self.header.identity, &header.identity);
        if self.header.shard != header.shard {
            let Shard { index, count } = self.header.shard;
            found.push(format!("the shard ({index}/{count} there)"));
        }
        if found.is_empty() && self.header != *header {
            found.push("what the scene is assembled to".into());
        }
        if found.is_empty() { Ok(self) } else { Err(CampaignError::Differs { path: self.path, differences: found }) }
    }

    /// The path as given.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// True if the record of a case, counted from 0, is there.
    #[must_use]
    pub fn has(&self, case: usize) -> bool {
        self.lines.get(case).is_some_and(Option::is_some)
    }

    /// Cases of the shard, counted from 0, whose record is not there.
    #[must_use]
    pub fn missing(&self) -> Vec<usize> {
        self.header.shard.cases(self.header.cases).filter(|&case| !self.has(case)).collect()
    }

    /// Number of records.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lines.iter().flatten().count()
    }

    /// True if there is no record yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Keeps a finished case, in the file before this returns.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn keep(&mut self, record: &CaseRecord) -> Result<(), CampaignError> {
        let line = serde_json::to_string(record).map_err(|e| CampaignError::Write { path: self.path.clone(), source: e.into() })?;
        let at = self.end;
        self.append(&line)?;
        self.lines[record.case - 1] = Some((at, line.len() + 1));
        Ok(())
    }

    fn append(&mut self, line: &str) -> Result<(), CampaignError> {
        let mut write = || {
            self.file.seek(SeekFrom::Start(self.end))?;
            self.file.write_all(format!("{line}\n").as_bytes())?;
            if self.synced.elapsed() > SYNC_EVERY {
                self.file.sync_data()?;
                self.synced = Instant::now();
            }
            Ok(())
        };
        write().map_err(|source| CampaignError::Write { path: self.path.clone(), source })?;
        self.end += line.len() as u64 + 1;
        Ok(())
    }

    /// The record of a case, counted from 0; none if it is not there.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn record(&mut self, case: usize) -> Result<Option<CaseRecord>, CampaignError> {
        let Some((at, length)) = self.lines.get(case).copied().flatten() else { return Ok(None) };
        let fail = |message: String| CampaignError::Read { path: self.path.clone(), case: case + 1, message };
        let mut line = vec![0; length];
        self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(&mut line)).map_err(|e| fail(e.to_string()))?;
        serde_json::from_slice(&line).map(Some).map_err(|e| fail(e.to_string()))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::identity::Identity;
    use super::super::record::{LoadRecord, ParameterRecord};
    use super::*;

    /// A campaign of five cases and one load of one component.
    pub fn header() -> Header {
        Header {
            pliant_campaign: VERSION.into(),
            identity: Identity::from([("the scene".into(), "a".into()), ("the plan".into(), "b".into())]),
            shard: Shard::WHOLE,
            cases: 5,
            scene_name: "scene".into(),
            scene: String::new(),
            plan: String::new(),
            seed: 0,
            modal_files: Vec::new(),
            parameters: vec![ParameterRecord { name: "mass".into(), keys: "body.hub.mass".into(), scale: false }],
            loads: vec![LoadRecord {
                group: "closures".into(),
                owner: "cable".into(),
                components: vec!["coordinate_force".into()],
                units: vec!["N".into()],
                frame: None,
                point: None,
                side: "by a on b".into(),
            }],
        }
    }

    pub fn record(case: usize, max: f64) -> CaseRecord {
        let loads = vec![serde_json::from_str(&format!("[0.5,{max:e},0.25,-1.5]")).unwrap()];
        CaseRecord { case: case + 1, values: vec![max.into()], failure: None, end_time_s: 1.0, steps: 3, wall_s: 0.1, loads }
    }

    #[test]
    fn records_come_back_bit_by_bit_and_a_cut_line_is_cut_off() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.jsonl");
        let odd = 0.1 + 0.2;
        {
            let mut records = Records::open(&path, header()).unwrap();
            records.keep(&record(3, odd)).unwrap();
            records.keep(&record(0, 1.0 / 3.0)).unwrap();
            assert!(matches!(Records::open(&path, header()), Err(CampaignError::Busy { .. })));
        }
        let whole = std::fs::read(&path).unwrap();
        for cut in 1..40 {
            std::fs::write(&path, &whole[..whole.len() - cut]).unwrap();
            let mut records = Records::open(&path, header()).unwrap();
            assert_eq!((records.len(), records.has(3), records.has(0)), (1, true, false));
            assert_eq!(records.record(3).unwrap().unwrap(), record(3, odd));
            records.keep(&record(1, 2.0)).unwrap();
            drop(records);
            assert_eq!(Records::open(&path, header()).unwrap().missing(), [0, 2, 4]);
        }
        // a heading that was cut short is begun anew
        std::fs::write(&path, &whole[..50]).unwrap();
        assert!(Records::open(&path, header()).unwrap().is_empty());
    }

    #[test]
    fn records_of_something_else_are_refused_by_name_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.jsonl");
        drop(Records::open(&path, header()).unwrap());
        let before = std::fs::read(&path).unwrap();
        let mut other = header();
        other.identity.insert("the scene".into(), "c".into());
        other.identity.insert("the modal file of body \"panel\"".into(), "d".into());
        let message = Records::open(&path, other).unwrap_err().to_string();
        assert!(message.contains("of another campaign: the modal file of body \"panel\" and the scene are not the same"), "{message}");
        let shard = Header { shard: Shard { index: 2, count: 3 }, ..header() };
        assert!(Records::open(&path, shard).unwrap_err().to_string().contains("the shard (1/1 there) is not the same"));
        assert_eq!(std::fs::read(&path).unwrap(), before);
        std::fs::write(&path, "time,x\n0,1\n").unwrap();
        assert!(matches!(Records::open(&path, header()), Err(CampaignError::Foreign { .. })));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "time,x\n0,1\n");
    }

    #[test]
    fn shards_share_the_cases() {
        for count in 1..5 {
            let mut all: Vec<usize> = (1..=count).flat_map(|index| Shard { index, count }.cases(7)).collect();
            all.sort_unstable();
            assert_eq!(all, (0..7).collect::<Vec<_>>());
        }
    }
}
