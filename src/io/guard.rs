//! Checked reads: what a file may contain, decided before libhdf5 is asked for a single element.
//!
//! The order matters. Links first (only hard links are followed), then the element type, the layout, external storage and filters,
//! then the declared size against the expectation, the file's own length and the limits below, then that all storage is there, and only then the read.

use super::array::{ElementType, GuardedDataset};
use super::chunks::check_chunks;
use super::error::ModalFileError;
use super::whole_chunks::whole_chunks;
use hdf5::filters::Filter;
use hdf5::types::{FixedAscii, FixedUnicode, VarLenAscii, VarLenUnicode};
use hdf5::{Datatype, IndexType, IterationOrder, LinkType, LocationType};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Largest dataset that is read (bytes).
pub(super) const DATASET_LIMIT: u64 = 2 << 30;
/// Largest chunk that libhdf5 may unpack (bytes); writers choose about 1 MB.
const CHUNK_LIMIT: u64 = 256 << 20;
/// Most chunks of one dataset.
const CHUNK_COUNT_LIMIT: u64 = 1 << 20;
/// Most that one byte of deflate can unpack to: 258 bytes from two bits.
const DEFLATE_RATIO: u64 = 1032;
/// Most objects outside `/VTKHDF`, and deepest path: the schema needs two objects a mode and three levels.
pub(super) const OBJECT_LIMIT: usize = 100_000;
/// Most attributes of one object: each is looked at whenever one is asked for, and objects may be links to one another.
const ATTRIBUTE_LIMIT: usize = 1000;
const DEPTH_LIMIT: usize = 8;
/// Longest text attribute (bytes).
const TEXT_LIMIT: usize = 4096;

/// What a path of the catalogue leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ObjectKind {
    Group,
    Dataset,
}

/// An open file with the list of what it holds outside `/VTKHDF`.
#[derive(Debug)]
pub(super) struct GuardedFile {
    path: PathBuf,
    file: hdf5::File,
    bytes: u64,
    /// Every object by path without leading slash, in the order of the digest.
    catalogue: BTreeMap<String, ObjectKind>,
}

impl GuardedFile {
    /// Opens a regular file read-only and lists it.
    pub fn open(path: &Path) -> Result<Self, ModalFileError> {
        Self::open_by(&hdf5::FileBuilder::new(), path)
    }

    /// The same for a file that is read by whole chunks.
    pub fn open_whole_chunks(path: &Path) -> Result<Self, ModalFileError> {
        Self::open_by(&whole_chunks(), path)
    }

    fn open_by(builder: &hdf5::FileBuilder, path: &Path) -> Result<Self, ModalFileError> {
        let fail = |cause: String| ModalFileError::Open { file: path.to_owned(), cause };
        let metadata = std::fs::metadata(path).map_err(|e| fail(e.to_string()))?;
        if !metadata.is_file() {
            return Err(fail("not a regular file".to_owned()));
        }
        hdf5::silence_errors(true);
        let file = builder.open(path).map_err(|e| fail(cause(&e)))?;
        let mut guarded = Self { path: path.to_owned(), file, bytes: metadata.len(), catalogue: BTreeMap::new() };
        guarded.list()?;
        Ok(guarded)
    }

    /// The path as given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Another name in messages.
    pub(super) fn show_as(&mut self, path: &Path) {
        path.clone_into(&mut self.path);
    }

    /// Length of the file.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Walks the groups by name; a link that is not hard is refused wherever it stands.
    fn list(&mut self) -> Result<(), ModalFileError> {
        let mut open = vec![(String::new(), 0)];
        while let Some((prefix, depth)) = open.pop() {
            let shown = if prefix.is_empty() { "/" } else { prefix.trim_end_matches('/') };
            let group = if prefix.is_empty() { self.file.as_group() } else { self.file.group(shown) };
            let group = group.map_err(|e| self.unreadable(shown, &e))?;
            let mut links: Vec<(String, LinkType)> = Vec::new();
            let mut overflow = false;
            let room = OBJECT_LIMIT - self.catalogue.len();
            let listed = group.iter_visit(IndexType::Name, IterationOrder::Native, |name, info| {
                if links.len() >= room {
                    overflow = true;
                    return Err("too many links".into());
                }
                links.push((name.to_owned(), info.link_type));
                Ok(())
            });
            if overflow || depth > DEPTH_LIMIT {
                let (file, expected) = (self.path.clone(), format!("at most {OBJECT_LIMIT} objects, {DEPTH_LIMIT} levels deep"));
                let remedy = "the file is damaged, or its groups are linked in a circle: write it again";
                return Err(ModalFileError::WrongValue { file, object: shown.to_owned(), found: "more".to_owned(), expected, remedy });
            }
            listed.map_err(|e| self.unreadable(shown, &e))?;
            for (name, link) in links {
                let path = format!("{prefix}{name}");
                if path == "VTKHDF" {
                    continue;
                }
                if name.contains(char::is_control) {
                    let (file, object, found) = (self.path.clone(), shown.to_owned(), format!("an object named {name:?}"));
                    let remedy = "rename the object";
                    return Err(ModalFileError::WrongValue { file, object, found, expected: "printable names".to_owned(), remedy });
                }
                let elsewhere = |found| ModalFileError::Elsewhere { file: self.path.clone(), object: path.clone(), found };
                match link {
                    LinkType::Hard => {}
                    LinkType::Soft => return Err(elsewhere("a soft link")),
                    LinkType::External => return Err(elsewhere("an external link")),
                }
                match group.loc_type_by_name(&name).map_err(|e| self.unreadable(&path, &e))? {
                    LocationType::Group => {
                        open.push((format!("{path}/"), depth + 1));
                        self.catalogue.insert(path, ObjectKind::Group);
                    }
                    LocationType::Dataset => {
                        self.catalogue.insert(path, ObjectKind::Dataset);
                    }
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// Paths of all datasets outside `/VTKHDF`, in byte order.
    pub fn dataset_paths(&self) -> impl Iterator<Item = &str> {
        self.catalogue.iter().filter(|(_, kind)| **kind == ObjectKind::Dataset).map(|(path, _)| path.as_str())
    }

    /// True if the path leads to something.
    pub fn has(&self, path: &str) -> bool {
        self.catalogue.contains_key(path)
    }

    /// Names directly under a group; empty if there is no such group.
    pub fn children(&self, group: &str) -> Vec<&str> {
        let prefix = format!("{group}/");
        let inside = self.catalogue.range(prefix.clone()..).take_while(|(path, _)| path.starts_with(&prefix));
        inside.filter_map(|(path, _)| path.strip_prefix(&prefix)).filter(|name| !name.contains('/')).collect()
    }

    /// Number of objects outside `/VTKHDF`.
    pub(super) fn object_count(&self) -> usize {
        self.catalogue.len()
    }

    /// Names directly under the root.
    pub(super) fn children_of_root(&self) -> impl Iterator<Item = &str> {
        self.catalogue.keys().map(String::as_str).filter(|path| !path.contains('/'))
    }

    /// Opens a dataset after all checks that need no expectation.
    pub fn dataset(&self, path: &str) -> Result<GuardedDataset<'_>, ModalFileError> {
        let dataset = self.open_dataset(path)?;
        let element = self.element_type(path, &dataset)?;
        let (shape, checksummed, chunked) = self.storage(path, &dataset, element.bytes())?;
        Ok(GuardedDataset { file: self, path: path.to_owned(), dataset, element, shape, checksummed, chunked })
    }

    /// A dataset by path, nothing checked but that it is one.
    pub(super) fn open_dataset(&self, path: &str) -> Result<hdf5::Dataset, ModalFileError> {
        let expected = "a dataset";
        match self.catalogue.get(path) {
            Some(ObjectKind::Dataset) => {}
            Some(ObjectKind::Group) => return Err(self.wrong_type(path, "a group", expected)),
            None => {
                return Err(ModalFileError::Missing { file: self.path.clone(), object: path.to_owned(), expected: expected.to_owned() });
            }
        }
        self.file.dataset(path).map_err(|e| self.unreadable(path, &e))
    }

    /// The element type, or a refusal that names what was found.
    fn element_type(&self, path: &str, dataset: &hdf5::Dataset) -> Result<ElementType, ModalFileError> {
        let datatype = dataset.dtype().map_err(|e| self.unreadable(path, &e))?;
        if datatype.is::<f64>() {
            Ok(ElementType::F8)
        } else if datatype.is::<f32>() {
            Ok(ElementType::F4)
        } else if datatype.is::<i64>() {
            Ok(ElementType::I8)
        } else if datatype.is::<u8>() {
            Ok(ElementType::U1)
        } else {
            Err(self.wrong_type(path, &describe(&datatype), "little-endian f8, f4, i8 or u1"))
        }
    }

    /// Layout, filters and sizes; returns the shape, whether a checksum guards the data and whether it is chunked.
    pub(super) fn storage(&self, path: &str, dataset: &hdf5::Dataset, element: u64) -> Result<(Vec<usize>, bool, bool), ModalFileError> {
        use hdf5::plist::dataset_create::Layout;
        let elsewhere = |found| ModalFileError::Elsewhere { file: self.path.clone(), object: path.to_owned(), found };
        let unreadable = |e: &hdf5::Error| self.unreadable(path, e);
        let plist = dataset.create_plist().map_err(|e| unreadable(&e))?;
        let layout = plist.get_layout().map_err(|e| unreadable(&e))?;
        // before the shape: the extent of a virtual dataset comes from other files
        if layout == Layout::Virtual {
            return Err(elsewhere("a virtual dataset"));
        }
        if !plist.get_external().map_err(|e| unreadable(&e))?.is_empty() {
            return Err(elsewhere("external storage"));
        }
        let filters = plist.get_filters().map_err(|e| unreadable(&e))?;
        let count = |wanted: fn(&Filter) -> bool| filters.iter().filter(|f| wanted(f)).count();
        let deflates = count(|f| matches!(f, Filter::Deflate(_)));
        let shuffles = count(|f| matches!(f, Filter::Shuffle));
        let checksums = count(|f| matches!(f, Filter::Fletcher32));
        // the checksum comes last in writing, so that it is the first to see damaged bytes
        let checksum_last = checksums == 0 || matches!(filters.last(), Some(Filter::Fletcher32));
        if deflates + shuffles + checksums != filters.len() || deflates.max(shuffles).max(checksums) > 1 || !checksum_last {
            return Err(ModalFileError::Filter { file: self.path.clone(), object: path.to_owned(), found: format!("{filters:?}") });
        }

        let shape = dataset.get_shape().map_err(|e| unreadable(&e))?;
        let bytes = self.checked_bytes(path, &shape, element, DATASET_LIMIT)?;
        let holdable = if deflates > 0 { self.bytes.saturating_mul(DEFLATE_RATIO) } else { self.bytes };
        if bytes > holdable {
            return Err(self.too_large(path, &shape, element, holdable));
        }
        let incomplete = |found: String, expected: String| ModalFileError::Incomplete {
            file: self.path.clone(),
            object: path.to_owned(),
            found,
            expected,
        };
        let chunked = layout == Layout::Chunked;
        if chunked {
            let chunk = plist.get_chunk().map_err(|e| unreadable(&e))?.unwrap_or_default();
            if chunk.len() != shape.len() || chunk.contains(&0) {
                return Err(incomplete(format!("chunks of shape {}", tuple(&chunk)), format!("chunks of rank {}", shape.len())));
            }
            self.checked_bytes(path, &chunk, element, CHUNK_LIMIT)?;
            let expected = shape.iter().zip(&chunk).map(|(&extent, &step)| extent.div_ceil(step) as u64).product::<u64>();
            if expected > CHUNK_COUNT_LIMIT {
                return Err(incomplete(format!("{expected} chunks"), format!("at most {CHUNK_COUNT_LIMIT} chunks")));
            }
            check_chunks(dataset, &shape, &chunk, &filters, element, self.bytes).map_err(|f| incomplete(f.found, f.expected))?;
        } else if dataset.storage_size() < bytes {
            return Err(incomplete(format!("{} bytes", dataset.storage_size()), format!("{bytes} bytes")));
        }
        Ok((shape, checksums > 0, chunked))
    }

    /// Bytes of an array, refused on overflow or above the limit.
    fn checked_bytes(&self, path: &str, shape: &[usize], element: u64, limit: u64) -> Result<u64, ModalFileError> {
        let bytes = shape.iter().try_fold(element, |product, &extent| product.checked_mul(u64::try_from(extent).ok()?));
        bytes.filter(|&bytes| bytes <= limit).ok_or_else(|| self.too_large(path, shape, element, limit))
    }

    fn too_large(&self, path: &str, shape: &[usize], element: u64, limit: u64) -> ModalFileError {
        let found = format!("{} elements of {element} bytes", tuple(shape));
        ModalFileError::TooLarge { file: self.path.clone(), object: path.to_owned(), found, limit }
    }

    /// Fixed-length text of an attribute of a group or dataset ("" is the root).
    pub fn text(&self, object: &str, name: &str) -> Result<String, ModalFileError> {
        let (shown, attribute) = self.attribute(object, name, "a fixed-length text")?;
        let datatype = attribute.dtype().map_err(|e| self.unreadable(&shown, &e))?;
        let fits = datatype.size() <= TEXT_LIMIT;
        let read = if fits && is_ascii(&datatype) {
            attribute.read_raw::<FixedAscii<TEXT_LIMIT>>().map(|v| v.first().map(|t| t.as_bytes().to_vec()))
        } else if fits && is_unicode(&datatype) {
            attribute.read_raw::<FixedUnicode<TEXT_LIMIT>>().map(|v| v.first().map(|t| t.as_bytes().to_vec()))
        } else {
            return Err(self.wrong_type(&shown, &describe(&datatype), "a fixed-length text of at most 4096 bytes"));
        };
        let bytes = read.map_err(|e| self.unreadable(&shown, &e))?.unwrap_or_default();
        let text = String::from_utf8(bytes).map_err(|_| self.wrong_type(&shown, "bytes that are not UTF-8", "a UTF-8 text"))?;
        let text = text.trim_end_matches(['\0', ' ']);
        // texts reach the terminal, where control characters are commands
        if text.contains(char::is_control) {
            return Err(self.wrong_type(&shown, "a text with control characters", "a printable text"));
        }
        Ok(text.to_owned())
    }

    /// An attribute that counts something.
    pub fn count(&self, object: &str, name: &str) -> Result<usize, ModalFileError> {
        let (shown, attribute) = self.attribute(object, name, "an integer")?;
        let datatype = attribute.dtype().map_err(|e| self.unreadable(&shown, &e))?;
        if integer_name(&datatype).is_none() {
            return Err(self.wrong_type(&shown, &describe(&datatype), "an integer"));
        }
        let value = attribute.read_raw::<i64>().map_err(|e| self.unreadable(&shown, &e))?.first().copied().unwrap_or(-1);
        usize::try_from(value).map_err(|_| ModalFileError::WrongValue {
            file: self.path.clone(),
            object: shown.clone(),
            found: value.to_string(),
            expected: "a count".to_owned(),
            remedy: "write the attribute again",
        })
    }

    /// An attribute of one element, and its name in messages.
    pub(super) fn attribute(&self, object: &str, name: &str, expected: &str) -> Result<(String, hdf5::Attribute), ModalFileError> {
        let shown = format!("{object}@{name}");
        let missing =
            || ModalFileError::Missing { file: self.path.clone(), object: shown.clone(), expected: format!("{expected} attribute") };
        let unreadable = |e: hdf5::Error| self.unreadable(&shown, &e);
        let read = |location: &hdf5::Location| -> Result<hdf5::Attribute, ModalFileError> {
            let mut seen = 0;
            let found = location.find_attr(IndexType::Name, IterationOrder::Native, |found, _| {
                seen += 1;
                if seen > ATTRIBUTE_LIMIT { Err("more than 1000 attributes".into()) } else { Ok((found == name).then_some(())) }
            });
            found.map_err(unreadable)?.ok_or_else(missing)?;
            location.attr(name).map_err(unreadable)
        };
        let attribute = match self.catalogue.get(object) {
            None if object.is_empty() => read(&self.file)?,
            None => return Err(missing()),
            Some(ObjectKind::Group) => read(&*self.file.group(object).map_err(unreadable)?)?,
            Some(ObjectKind::Dataset) => read(&*self.file.dataset(object).map_err(unreadable)?)?,
        };
        let shape = attribute.get_shape().map_err(unreadable)?;
        if shape.iter().any(|&extent| extent != 1) || shape.len() > 1 {
            let (found, expected) = (tuple(&shape), "a single value".to_owned());
            return Err(ModalFileError::WrongShape { file: self.path.clone(), object: shown, found, expected });
        }
        Ok((shown, attribute))
    }

    /// A refusal of an element type.
    pub fn wrong_type(&self, object: &str, found: &str, expected: &str) -> ModalFileError {
        let remedy = "write it as a plain little-endian array or, for texts, as fixed-length bytes (numpy.bytes_ in h5py)";
        ModalFileError::WrongType {
            file: self.path.clone(),
            object: object.to_owned(),
            found: found.to_owned(),
            expected: expected.to_owned(),
            remedy,
        }
    }

    /// An error of libhdf5 about an object.
    pub fn unreadable(&self, object: &str, error: &hdf5::Error) -> ModalFileError {
        ModalFileError::Unreadable { file: self.path.clone(), object: object.to_owned(), cause: cause(error) }
    }
}

/// A shape as NumPy prints it.
pub(super) fn tuple(shape: &[usize]) -> String {
    format!("({})", shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "))
}

/// The first line of what libhdf5 said.
pub(super) fn cause(error: &hdf5::Error) -> String {
    error.to_string().lines().next().unwrap_or("no reason given").to_owned()
}

/// Fixed-length text in ASCII; decided by the conversions of libhdf5, which exist between such texts only.
fn is_ascii(datatype: &Datatype) -> bool {
    datatype.conv_to::<FixedAscii<TEXT_LIMIT>>().is_some()
}

/// Fixed-length text in UTF-8.
fn is_unicode(datatype: &Datatype) -> bool {
    datatype.conv_to::<FixedUnicode<TEXT_LIMIT>>().is_some()
}

/// The name of an integer type, if it is one.
pub(super) fn integer_name(datatype: &Datatype) -> Option<&'static str> {
    let signed = [("i1", datatype.is::<i8>()), ("i2", datatype.is::<i16>()), ("i4", datatype.is::<i32>()), ("i8", datatype.is::<i64>())];
    let unsigned = [("u1", datatype.is::<u8>()), ("u2", datatype.is::<u16>()), ("u4", datatype.is::<u32>()), ("u8", datatype.is::<u64>())];
    signed.into_iter().chain(unsigned).find(|&(_, found)| found).map(|(name, _)| name)
}

/// An element type in words.
///
/// By comparison with known types: the wrapper's own descriptor copies a nested type once per level, which takes gigabytes for
/// the thousands of levels that fit into one header message.
pub(super) fn describe(datatype: &Datatype) -> String {
    if let Some(name) = integer_name(datatype) {
        name.to_owned()
    } else if datatype.is::<f32>() {
        "f4".to_owned()
    } else if datatype.is::<f64>() {
        "f8".to_owned()
    } else if datatype.is::<VarLenAscii>() || datatype.is::<VarLenUnicode>() {
        "a variable-length text".to_owned()
    } else if is_ascii(datatype) || is_unicode(datatype) {
        format!("a text of {} bytes", datatype.size())
    } else if datatype.is::<bool>() {
        "a boolean (an enumeration)".to_owned()
    } else if datatype.byte_order() == hdf5::datatype::ByteOrder::BigEndian {
        format!("a big-endian type of {} bytes", datatype.size())
    } else {
        format!("a compound, enumerated, array, reference, variable-length or odd number type of {} bytes", datatype.size())
    }
}
