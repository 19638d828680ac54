//! Writes modal files, schema `flexible-body-modes` 1.0, with their digest.
//!
//! Plain little-endian arrays and texts of fixed length; above 4 KiB in chunks, shuffled, packed, with a checksum. Arrays and digest come from
//! one list in the order of the digest. No times are stored: the same numbers give the same bytes.

use super::results_file::write_text;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;

/// Above this arrays are packed (bytes).
const PACK_ABOVE: usize = 4096;
/// Size of a chunk (bytes).
const CHUNK_BYTES: usize = 1 << 18;

/// One array in C order.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Values {
    F8(Vec<f64>),
    F4(Vec<f32>),
    I8(Vec<i64>),
    U1(Vec<u8>),
}

/// What a modal file holds, by path.
#[derive(Debug, Default)]
pub(super) struct Contents {
    arrays: BTreeMap<String, (Vec<usize>, Values)>,
    /// (object, name) to text; the root is "".
    texts: Vec<(String, &'static str, String)>,
    /// (object, name) to count.
    counts: Vec<(String, &'static str, i64)>,
}

impl Contents {
    /// Adds an array.
    pub fn array(&mut self, path: impl Into<String>, shape: &[usize], values: Values) {
        self.arrays.insert(path.into(), (shape.to_vec(), values));
    }

    /// Adds a text attribute of a group or dataset.
    pub fn text(&mut self, object: impl Into<String>, name: &'static str, value: impl Into<String>) {
        self.texts.push((object.into(), name, value.into()));
    }

    /// Adds a number attribute of a group or dataset.
    pub fn count(&mut self, object: impl Into<String>, name: &'static str, value: usize) {
        self.counts.push((object.into(), name, value as i64));
    }

    /// Digest of the arrays.
    fn sha256(&self) -> String {
        let mut hash = Sha256::new();
        for (path, (shape, values)) in &self.arrays {
            let shape = shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
            let name = match values {
                Values::F8(_) => "<f8",
                Values::F4(_) => "<f4",
                Values::I8(_) => "<i8",
                Values::U1(_) => "|u1",
            };
            hash.update(format!("{path}\0{name}\0{shape}\0"));
            match values {
                Values::F8(values) => values.iter().for_each(|v| hash.update(v.to_le_bytes())),
                Values::F4(values) => values.iter().for_each(|v| hash.update(v.to_le_bytes())),
                Values::I8(values) => values.iter().for_each(|v| hash.update(v.to_le_bytes())),
                Values::U1(values) => hash.update(values),
            }
        }
        hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Writes the file; one of that name is replaced.
    pub fn write(&self, path: &Path) -> hdf5::Result<()> {
        hdf5::silence_errors(true);
        let file = hdf5::File::create(path)?;
        for (path, (shape, values)) in &self.arrays {
            let (folder, name) = path.rsplit_once('/').unwrap_or(("", path));
            let mut group = file.as_group()?;
            for step in folder.split('/').filter(|step| !step.is_empty()) {
                group = if group.link_exists(step) { group.group(step)? } else { group.create_group(step)? };
            }
            match values {
                Values::F8(values) => put(&group, name, shape, values)?,
                Values::F4(values) => put(&group, name, shape, values)?,
                Values::I8(values) => put(&group, name, shape, values)?,
                Values::U1(values) => put(&group, name, shape, values)?,
            }
        }
        let digest = (String::new(), "content_sha256", self.sha256());
        for (object, name, text) in self.texts.iter().chain([&digest]) {
            self.with_object(&file, object, |location| write_text(location, name, text))?;
        }
        for (object, name, count) in &self.counts {
            self.with_object(&file, object, |location| location.new_attr::<i64>().create(*name)?.write_scalar(count))?;
        }
        file.flush()
    }

    fn with_object(&self, file: &hdf5::File, object: &str, act: impl FnOnce(&hdf5::Location) -> hdf5::Result<()>) -> hdf5::Result<()> {
        if object.is_empty() {
            act(file)
        } else if self.arrays.contains_key(object) {
            act(&*file.dataset(object)?)
        } else {
            act(&*file.group(object)?)
        }
    }
}

fn put<T: hdf5::H5Type>(group: &hdf5::Group, name: &str, shape: &[usize], values: &[T]) -> hdf5::Result<()> {
    let builder = group.new_dataset::<T>().obj_track_times(false);
    let bytes = std::mem::size_of_val(values);
    if bytes <= PACK_ABOVE {
        return builder.shape(shape).create(name)?.write_raw(values);
    }
    let row = (bytes / shape[0]).max(1);
    let chunk: Vec<usize> = std::iter::once((CHUNK_BYTES / row).clamp(1, shape[0])).chain(shape[1..].iter().copied()).collect();
    builder.chunk(chunk).shuffle().deflate(4).fletcher32().shape(shape).create(name)?.write_raw(values)
}
