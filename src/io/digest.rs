//! The content pass: every dataset outside `/VTKHDF` is read once, for its digest and for numbers that are not finite.
//!
//! `content_sha256` runs over the datasets in path order: path, NUL, element type (`<f8` `<f4` `<i8` `|u1`), NUL, shape as
//! `a,b`, NUL, little-endian bytes in C order. Attributes are not covered.

use super::array::{Element, ElementType, GuardedDataset, usable};
use super::error::ModalFileError;
use super::guard::GuardedFile;
use sha2::{Digest, Sha256};

/// Most bytes one pass reads; at 300 MB/s about a minute.
const TOTAL_LIMIT: u64 = 16 << 30;
/// Above this the schema asks for chunks with checksums (bytes).
const CHECKSUM_ABOVE: u64 = 4096;

/// What the pass found.
#[derive(Debug)]
pub(super) struct Content {
    /// Lower-case hexadecimal SHA-256.
    pub sha256: String,
    /// Number of datasets read.
    pub datasets: usize,
    /// Datasets above 4 KiB without fletcher32.
    pub unguarded: Vec<String>,
    /// How many numbers are not finite or above 1e100, and the first of them as an error.
    pub not_finite: usize,
    pub first_not_finite: Option<ModalFileError>,
}

/// Reads everything once.
pub(super) fn read_content(file: &GuardedFile) -> Result<Content, ModalFileError> {
    let mut hash = Sha256::new();
    let mut content = Content { sha256: String::new(), datasets: 0, unguarded: Vec::new(), not_finite: 0, first_not_finite: None };
    let mut total = 0_u64;
    for path in file.dataset_paths() {
        let dataset = file.dataset(path)?;
        total = total.saturating_add(dataset.bytes());
        if total > TOTAL_LIMIT {
            let found = format!("{total} bytes in all datasets up to this one");
            return Err(ModalFileError::TooLarge { file: file.path().to_owned(), object: path.to_owned(), found, limit: TOTAL_LIMIT });
        }
        let shape = dataset.shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
        hash.update(format!("{path}\0{}\0{shape}\0", dataset.element.name()));
        match dataset.element {
            ElementType::F8 => hash_reals::<f64>(&dataset, &mut hash, &mut content, |v| v, |v| v.to_le_bytes())?,
            ElementType::F4 => hash_reals::<f32>(&dataset, &mut hash, &mut content, f64::from, |v| v.to_le_bytes())?,
            ElementType::I8 => hash_elements(&dataset.read::<i64>()?, &mut hash, |v| v.to_le_bytes()),
            ElementType::U1 => hash.update(dataset.read::<u8>()?),
        }
        content.datasets += 1;
        if dataset.bytes() > CHECKSUM_ABOVE && !(dataset.chunked && dataset.checksummed) {
            content.unguarded.push(path.to_owned());
        }
    }
    content.sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(content)
}

/// Hashes numbers and counts those that are not finite.
fn hash_reals<T: Element + Bytes>(
    dataset: &GuardedDataset<'_>,
    hash: &mut Sha256,
    content: &mut Content,
    widen: impl Fn(T) -> f64,
    bytes: impl Fn(T) -> T::Array,
) -> Result<(), ModalFileError> {
    let values = dataset.read::<T>()?;
    for (index, &value) in values.iter().enumerate() {
        let value = widen(value);
        if !usable(value) {
            content.not_finite += 1;
            content.first_not_finite.get_or_insert_with(|| dataset.not_finite(index, value));
        }
    }
    hash_elements(&values, hash, bytes);
    Ok(())
}

/// The byte array of a number type.
trait Bytes {
    type Array: AsRef<[u8]>;
}
impl Bytes for f64 {
    type Array = [u8; 8];
}
impl Bytes for f32 {
    type Array = [u8; 4];
}

/// Feeds elements in blocks, so that the hash sees long runs.
fn hash_elements<T: Copy, B: AsRef<[u8]>>(values: &[T], hash: &mut Sha256, bytes: impl Fn(T) -> B) {
    let mut block = Vec::with_capacity(1 << 16);
    for part in values.chunks(1 << 13) {
        block.clear();
        part.iter().for_each(|&value| block.extend_from_slice(bytes(value).as_ref()));
        hash.update(&block);
    }
}
