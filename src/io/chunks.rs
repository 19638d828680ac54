//! The chunk index of a dataset, held against its shape before libhdf5 reads a chunk.
//!
//! libhdf5 takes the index at its word: a missing chunk is read as fill values, and one that is stored in fewer bytes than its
//! checksum has made the checksum run through all memory.

use hdf5::filters::Filter;

/// Bytes of a fletcher32 checksum.
const CHECKSUM_BYTES: u64 = 4;

/// More than deflate and a checksum add to a chunk that does not compress, beside a sixteenth of its size. A chunk stored in more
/// bytes than that would unpack to something else, and libhdf5 unpacks first and looks afterwards.
const SLACK_BYTES: u64 = 1024;

/// What the index promises and what it holds, in words, if they differ.
pub(super) struct ChunkFault {
    pub found: String,
    pub expected: String,
}

/// Every chunk of the grid is there once, inside the file, no smaller than its checksum and no larger than raw data.
///
/// `chunk` has the rank of `shape` and no zero extent; `element_bytes` is the size of one element, `file_bytes` that of the file.
pub(super) fn check_chunks(
    dataset: &hdf5::Dataset,
    shape: &[usize],
    chunk: &[usize],
    filters: &[Filter],
    element_bytes: u64,
    file_bytes: u64,
) -> Result<(), ChunkFault> {
    let grid: Vec<usize> = shape.iter().zip(chunk).map(|(&extent, &step)| extent.div_ceil(step)).collect();
    let expected: usize = grid.iter().product();
    let raw_bytes = chunk.iter().fold(element_bytes, |product, &step| product.saturating_mul(step as u64));
    let checksum = filters.iter().position(|filter| matches!(filter, Filter::Fletcher32));
    let mut seen = vec![false; expected];
    let mut fault = None;
    let visited = dataset.chunks_visit(|info| {
        let place = info.offset.iter().zip(chunk).zip(&grid).try_fold(0_usize, |place, ((&offset, &step), &count)| {
            let index = usize::try_from(offset).ok()? / step;
            ((offset as usize).is_multiple_of(step) && index < count).then_some(place * count + index)
        });
        let applied = |position: usize| info.filter_mask & (1 << position) == 0;
        let guarded = checksum.is_some_and(applied);
        let plain = (0..filters.len()).all(|position| !applied(position));
        let end = info.addr.checked_add(info.size);
        fault = if end.is_none_or(|end| end > file_bytes) {
            Some(("a chunk beyond the end of the file".to_owned(), format!("chunks within {file_bytes} bytes")))
        } else if plain && info.size != raw_bytes {
            Some((format!("a chunk of {} bytes", info.size), format!("chunks of {raw_bytes} bytes")))
        } else if info.size > raw_bytes + raw_bytes / 16 + SLACK_BYTES {
            Some((format!("a chunk of {} bytes", info.size), format!("chunks of at most {raw_bytes} bytes and some overhead")))
        } else if guarded && info.size <= CHECKSUM_BYTES || info.size == 0 {
            Some((format!("a chunk of {} bytes", info.size), "chunks longer than their checksum".to_owned()))
        } else {
            match place.filter(|&place| !seen[place]) {
                None => Some(("a chunk out of place".to_owned(), format!("each of {expected} chunks once"))),
                Some(place) => {
                    seen[place] = true;
                    None
                }
            }
        };
        i32::from(fault.is_some())
    });
    if let Some((found, expected)) = fault {
        return Err(ChunkFault { found, expected });
    }
    let count = seen.iter().filter(|&&there| there).count();
    if visited.is_err() || count != expected {
        let found = if visited.is_err() { "no readable chunk index".to_owned() } else { format!("{count} chunks") };
        return Err(ChunkFault { found, expected: format!("{expected} chunks") });
    }
    Ok(())
}
