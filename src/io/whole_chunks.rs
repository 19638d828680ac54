//! Files whose chunks are written, and read, whole and once.

/// Opens and makes files without a cache of chunks. libhdf5 would keep up to 8 MB per dataset, which adds up over the many series of a long
/// run, and each flush goes through all that is kept.
pub(super) fn whole_chunks() -> hdf5::FileBuilder {
    let mut builder = hdf5::FileBuilder::new();
    builder.with_fapl(|access| access.chunk_cache(0, 0, 1.0));
    builder
}
