//! Data items of an XDMF file: numbers in the text itself, or a dataset of an HDF5 file in the same folder.

use super::budget::Budget;
use super::error::{ImportError, printable, refused};
use super::xml::Element;
use crate::io::guard::{GuardedFile, OBJECT_LIMIT};
use std::cell::{Cell, RefCell};
use std::collections::{BTreeSet, HashMap};
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

/// Most HDF5 files behind one XDMF file.
const FILE_LIMIT: usize = 64;

/// Longest path of a dataset with its file (bytes).
const REFERENCE_LIMIT: usize = 1024;

/// Where the numbers are.
#[derive(Debug, Clone, PartialEq)]
enum Content {
    Inline(String),
    Hdf { file: String, path: String },
}

/// A data item, understood but not read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Item {
    /// What it belongs to, for messages.
    object: String,
    /// Extents as stated.
    pub dimensions: Vec<usize>,
    content: Content,
}

impl Item {
    /// Number of elements as stated.
    pub fn len(&self) -> usize {
        self.dimensions.iter().product()
    }
}

/// The folder of an XDMF file and the HDF5 files opened in it so far.
#[derive(Debug)]
pub(super) struct Folder {
    xdmf: PathBuf,
    open: RefCell<HashMap<String, Rc<GuardedFile>>>,
    /// Groups and datasets of all of them.
    objects: Cell<usize>,
    /// The bound on what is read, for all files together.
    pub budget: Budget,
}

impl Folder {
    /// The folder of the file `xdmf` of that length.
    pub fn of(xdmf: &Path, bytes: u64) -> Self {
        Self { xdmf: xdmf.to_owned(), open: RefCell::default(), objects: Cell::new(0), budget: Budget::new(bytes) }
    }

    /// The XDMF file.
    pub fn file(&self) -> &Path {
        &self.xdmf
    }

    /// The XDMF file and the HDF5 files opened so far.
    pub fn files(&self) -> Vec<PathBuf> {
        let files: BTreeSet<PathBuf> = self.open.borrow().values().map(|file| file.path().to_owned()).collect();
        files.into_iter().chain([self.xdmf.clone()]).collect()
    }

    /// Understands a DataItem; `object` says whose it is.
    pub fn item(&self, element: &Element, object: &str) -> Result<Item, ImportError> {
        let fault = |found: String, expected: &str, remedy: &str| Err(refused(&self.xdmf, object, found, expected, remedy));
        if let Some(kind) = element.attribute("ItemType").filter(|kind| !kind.eq_ignore_ascii_case("Uniform")) {
            return fault(
                format!("a DataItem of type {}", printable(kind)),
                "a uniform one",
                "export whole arrays, not slices or functions",
            );
        }
        if element.attribute("Reference").is_some() {
            return fault(
                "a DataItem that refers to another".to_owned(),
                "one with its own data",
                "write the HDF5 path into each DataItem",
            );
        }
        let Some(stated) = element.attribute("Dimensions") else {
            return fault("a DataItem without Dimensions".to_owned(), "its extents", "export the file again");
        };
        let dimensions: Option<Vec<usize>> = stated.split_ascii_whitespace().map(|word| word.parse().ok()).collect();
        let count = dimensions.as_ref().and_then(|d| d.iter().try_fold(1_usize, |product, &extent| product.checked_mul(extent)));
        let (Some(dimensions), Some(_)) = (dimensions, count.filter(|c| *c <= 1 << 40)) else {
            let found = format!("Dimensions \"{}\"", printable(stated));
            return fault(found, "one to three extents that fit into memory", "export the file again");
        };
        if dimensions.is_empty() || dimensions.len() > 3 {
            return fault(format!("{} extents", dimensions.len()), "one to three", "export the file again");
        }
        let format = element.attribute("Format").unwrap_or("XML");
        let content = match format.to_ascii_lowercase().as_str() {
            "xml" => Content::Inline(element.text.clone()),
            "hdf" | "hdf5" => {
                let reference = element.text.trim();
                // names reach the terminal in messages, where control characters are commands
                let fits = reference.len() <= REFERENCE_LIMIT && !reference.contains(char::is_control);
                let Some((file, path)) = reference.split_once(":/").filter(|_| fits) else {
                    return fault(format!("\"{}\"", printable(reference)), "FILE.h5:/path/of/dataset", "export the file again");
                };
                Content::Hdf { file: file.to_owned(), path: path.trim_matches('/').to_owned() }
            }
            _ => {
                let remedy = "export with HDF5 or XML data (in meshio data_format=\"HDF\")";
                return fault(format!("data in the format {}", printable(format)), "HDF or XML", remedy);
            }
        };
        Ok(Item { object: object.to_owned(), dimensions, content })
    }

    /// Real numbers of an item.
    pub fn numbers(&self, item: &Item) -> Result<Vec<f64>, ImportError> {
        self.budget_for(item)?;
        match &item.content {
            Content::Inline(text) => self.parse(item, text, "numbers"),
            Content::Hdf { file, path } => {
                let file = self.open(item, file)?;
                let dataset = file.foreign(path)?;
                self.expect(item, dataset.len())?;
                Ok(dataset.read_numbers()?)
            }
        }
    }

    /// Integers of an item.
    pub fn integers(&self, item: &Item) -> Result<Vec<i64>, ImportError> {
        self.budget_for(item)?;
        match &item.content {
            Content::Inline(text) => self.parse(item, text, "integers"),
            Content::Hdf { file, path } => {
                let file = self.open(item, file)?;
                let dataset = file.foreign(path)?;
                self.expect(item, dataset.len())?;
                Ok(dataset.read_integers()?)
            }
        }
    }

    /// The bound on what is held, once the files behind the item are known.
    fn budget_for(&self, item: &Item) -> Result<(), ImportError> {
        if let Content::Hdf { file, .. } = &item.content {
            self.open(item, file)?;
        }
        self.budget.check(&self.xdmf, &item.object, item.len())
    }

    fn parse<T: std::str::FromStr>(&self, item: &Item, text: &str, what: &str) -> Result<Vec<T>, ImportError> {
        let mut values = Vec::new();
        for word in text.split_ascii_whitespace() {
            let Ok(value) = word.parse() else {
                return Err(refused(&self.xdmf, &item.object, format!("\"{}\"", printable(word)), what, "export the file again"));
            };
            values.push(value);
        }
        self.expect(item, values.len())?;
        Ok(values)
    }

    /// As many values as the item states.
    fn expect(&self, item: &Item, found: usize) -> Result<(), ImportError> {
        if found == item.len() {
            return Ok(());
        }
        let expected = format!("{} as its Dimensions {:?} say", item.len(), item.dimensions);
        Err(refused(&self.xdmf, &item.object, format!("{found} values"), expected, "export the XDMF file and its HDF5 file together"))
    }

    /// The HDF5 file of that name in the folder.
    fn open(&self, item: &Item, name: &str) -> Result<Rc<GuardedFile>, ImportError> {
        if let Some(file) = self.open.borrow().get(name) {
            return Ok(file.clone());
        }
        let outside = || {
            let remedy = "copy the HDF5 file beside the XDMF file and name it without a path";
            refused(&self.xdmf, &item.object, format!("the file \"{}\"", printable(name)), "a file in the folder of this one", remedy)
        };
        let relative = Path::new(name);
        if name.is_empty() || !relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
            return Err(outside());
        }
        if self.open.borrow().len() >= FILE_LIMIT {
            let found = format!("more than {FILE_LIMIT} HDF5 files");
            return Err(refused(&self.xdmf, &item.object, found, "one, or a few", "export all steps into one HDF5 file"));
        }
        let folder = match self.xdmf.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let path = folder.join(relative);
        let real = path.canonicalize();
        // a link may lead elsewhere although its name does not
        let inside = match (folder.canonicalize(), &real) {
            (Ok(folder), Ok(target)) => target.starts_with(folder),
            // what is not there is said by the system below
            _ => true,
        };
        if !inside {
            return Err(outside());
        }
        // a file under another name gives no more room and costs no more time
        let known = real
            .ok()
            .and_then(|real| self.open.borrow().values().find(|file| file.path().canonicalize().is_ok_and(|p| p == real)).cloned());
        if let Some(file) = known {
            self.open.borrow_mut().insert(name.to_owned(), file.clone());
            return Ok(file);
        }
        let file = Rc::new(GuardedFile::open(&path)?);
        // listing takes time: what one file may cost, all of them together may
        let objects = self.objects.get() + file.object_count();
        self.objects.set(objects);
        if objects > OBJECT_LIMIT {
            let found = format!("{objects} objects in the HDF5 files up to {}", printable(name));
            let expected = format!("at most {OBJECT_LIMIT}");
            return Err(refused(&self.xdmf, &item.object, found, expected, "leave what is no mode out of the HDF5 files"));
        }
        self.budget.extend(file.bytes());
        self.open.borrow_mut().insert(name.to_owned(), file.clone());
        Ok(file)
    }
}
