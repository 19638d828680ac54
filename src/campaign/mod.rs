//! Campaigns: one scene run for many values of its keys, and the envelope of every load over all cases.
//!
//! [`plan`] says which keys take which values, from a [`table`] or by [`draw`]; [`identity`] says what decides the numbers. [`runner`] runs
//! the cases on all cores and keeps the [`record`] of each in a [`records`] file as it ends, from which a campaign that was killed goes on and in which a
//! shard hands over its share ([`merge`]). [`envelope`] goes through the records, and [`results`] writes them to one file. Nothing here prints.

pub mod draw;
pub mod envelope;
pub mod error;
pub mod identity;
pub mod merge;
pub mod plan;
pub mod plan_spec;
pub mod record;
pub mod records;
pub mod results;
pub mod runner;
pub mod table;

pub use envelope::{CampaignReport, Envelope};
pub use error::CampaignError;
pub use plan::Plan;
pub use record::{CaseRecord, Header, Shard};
pub use records::Records;
pub use runner::{Campaign, Watch};
