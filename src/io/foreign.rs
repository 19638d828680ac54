//! Guarded reads of HDF5 data that other codes lay out: any little-endian integer or real type, names as byte arrays, numbers in attributes.
//!
//! Every check of [`GuardedFile::dataset`] holds here too; only the set of element types is wider.

use super::error::ModalFileError;
use super::guard::{GuardedFile, describe, integer_name};

/// Length of the names in families of a MED file (bytes).
const NAME_BYTES: usize = 80;

/// Element types by what they can be read as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Class {
    Single,
    Double,
    Integer,
    Names,
}

/// A dataset that has passed every check but its expected shape.
#[derive(Debug)]
pub(super) struct ForeignDataset<'f> {
    file: &'f GuardedFile,
    path: String,
    dataset: hdf5::Dataset,
    class: Class,
    /// Shape, at most 2 GiB in all.
    pub shape: Vec<usize>,
}

impl ForeignDataset<'_> {
    /// Number of elements.
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// All elements as real numbers, C order.
    pub fn read_numbers(&self) -> Result<Vec<f64>, ModalFileError> {
        match self.class {
            Class::Single => Ok(self.read::<f32>()?.into_iter().map(f64::from).collect()),
            Class::Double => self.read::<f64>(),
            Class::Integer => Ok(self.read::<i64>()?.into_iter().map(|v| v as f64).collect()),
            Class::Names => Err(self.file.wrong_type(&self.path, "names", "numbers")),
        }
    }

    /// All elements as integers, C order.
    pub fn read_integers(&self) -> Result<Vec<i64>, ModalFileError> {
        match self.class {
            Class::Integer => self.read::<i64>(),
            Class::Single | Class::Double => Err(self.file.wrong_type(&self.path, "real numbers", "integers")),
            Class::Names => Err(self.file.wrong_type(&self.path, "names", "integers")),
        }
    }

    /// All names, without what pads them.
    pub fn read_names(&self) -> Result<Vec<String>, ModalFileError> {
        if self.class != Class::Names {
            return Err(self.file.wrong_type(&self.path, "numbers", "names of 80 bytes"));
        }
        let name = |bytes: [i8; NAME_BYTES]| {
            let bytes: Vec<u8> = bytes.into_iter().map(|b| b as u8).take_while(|&b| b != 0).collect();
            String::from_utf8_lossy(&bytes).trim_end().to_owned()
        };
        Ok(self.read::<[i8; NAME_BYTES]>()?.into_iter().map(name).collect())
    }

    fn read<T: hdf5::H5Type>(&self) -> Result<Vec<T>, ModalFileError> {
        if self.len() == 0 {
            return Ok(Vec::new());
        }
        self.dataset.read_raw::<T>().map_err(|e| self.file.unreadable(&self.path, &e))
    }
}

impl GuardedFile {
    /// Opens a dataset of another code after all checks that need no expectation.
    pub(super) fn foreign(&self, path: &str) -> Result<ForeignDataset<'_>, ModalFileError> {
        let dataset = self.open_dataset(path)?;
        let datatype = dataset.dtype().map_err(|e| self.unreadable(path, &e))?;
        let class = if datatype.is::<f64>() {
            Class::Double
        } else if datatype.is::<f32>() {
            Class::Single
        } else if integer_name(&datatype).is_some() {
            Class::Integer
        } else if datatype.is::<[i8; NAME_BYTES]>() {
            Class::Names
        } else {
            return Err(self.wrong_type(path, &describe(&datatype), "little-endian real numbers, integers or names of 80 bytes"));
        };
        let (shape, _, _) = self.storage(path, &dataset, (datatype.size() as u64).max(1))?;
        Ok(ForeignDataset { file: self, path: path.to_owned(), dataset, class, shape })
    }

    /// An attribute that is an integer of any width.
    pub(super) fn integer(&self, object: &str, name: &str) -> Result<i64, ModalFileError> {
        let (shown, attribute) = self.attribute(object, name, "an integer")?;
        let datatype = attribute.dtype().map_err(|e| self.unreadable(&shown, &e))?;
        if integer_name(&datatype).is_none() {
            return Err(self.wrong_type(&shown, &describe(&datatype), "an integer"));
        }
        let values = attribute.read_raw::<i64>().map_err(|e| self.unreadable(&shown, &e))?;
        values.first().copied().ok_or_else(|| self.wrong_type(&shown, "nothing", "an integer"))
    }

    /// An attribute that is a finite real number.
    pub(super) fn real(&self, object: &str, name: &str) -> Result<f64, ModalFileError> {
        let (shown, attribute) = self.attribute(object, name, "a real number")?;
        let datatype = attribute.dtype().map_err(|e| self.unreadable(&shown, &e))?;
        if !datatype.is::<f64>() {
            return Err(self.wrong_type(&shown, &describe(&datatype), "a real number (f8)"));
        }
        let values = attribute.read_raw::<f64>().map_err(|e| self.unreadable(&shown, &e))?;
        let value = values.first().copied().unwrap_or(f64::NAN);
        if value.abs() <= 1e100 { Ok(value) } else { Err(self.wrong_type(&shown, &value.to_string(), "a finite number")) }
    }
}
