//! A dataset that has passed the guard: shape against expectation, then the read, then finiteness.

use super::error::ModalFileError;
use super::guard::{GuardedFile, tuple};
use hdf5::types::H5Type;
use std::ops::Range;

/// Magnitude above which a number is as useless as an infinity: products of three such numbers would overflow.
const LARGEST: f64 = 1e100;

/// False for NaN, infinities and magnitudes above 1e100.
pub(super) fn usable(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// The four element types of the schema, all little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ElementType {
    F8,
    F4,
    I8,
    U1,
}

impl ElementType {
    /// Name in the digest (that of NumPy).
    pub fn name(self) -> &'static str {
        match self {
            Self::F8 => "<f8",
            Self::F4 => "<f4",
            Self::I8 => "<i8",
            Self::U1 => "|u1",
        }
    }

    /// Size of one element.
    pub fn bytes(self) -> u64 {
        match self {
            Self::F8 | Self::I8 => 8,
            Self::F4 => 4,
            Self::U1 => 1,
        }
    }
}

/// A Rust type that holds one of the four element types as stored.
pub(super) trait Element: H5Type + Copy + Default {
    const TYPE: ElementType;
}
impl Element for f64 {
    const TYPE: ElementType = ElementType::F8;
}
impl Element for f32 {
    const TYPE: ElementType = ElementType::F4;
}
impl Element for i64 {
    const TYPE: ElementType = ElementType::I8;
}
impl Element for u8 {
    const TYPE: ElementType = ElementType::U1;
}

/// A dataset that has passed every check but its expected shape.
#[derive(Debug)]
pub(super) struct GuardedDataset<'f> {
    pub(super) file: &'f GuardedFile,
    pub(super) path: String,
    pub(super) dataset: hdf5::Dataset,
    /// Element type as stored.
    pub element: ElementType,
    /// Shape, at most 2 GiB in all.
    pub shape: Vec<usize>,
    /// True if every chunk carries a checksum.
    pub checksummed: bool,
    /// True if stored in chunks.
    pub chunked: bool,
}

impl GuardedDataset<'_> {
    /// Number of elements.
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Bytes as stored in memory.
    pub fn bytes(&self) -> u64 {
        self.len() as u64 * self.element.bytes()
    }

    /// Refuses any other shape; `None` is any extent, `meaning` says what the extents are.
    pub fn expect_shape(self, expected: &[Option<usize>], meaning: &str) -> Result<Self, ModalFileError> {
        let fits =
            self.shape.len() == expected.len() && self.shape.iter().zip(expected).all(|(&found, wanted)| wanted.is_none_or(|w| w == found));
        if fits {
            return Ok(self);
        }
        let wanted = expected.iter().map(|e| e.map_or("any".to_owned(), |w| w.to_string())).collect::<Vec<_>>().join(", ");
        let (file, object, found) = (self.file.path().to_owned(), self.path.clone(), tuple(&self.shape));
        Err(ModalFileError::WrongShape { file, object, found, expected: format!("({wanted}): {meaning}") })
    }

    /// All elements in C order, exactly as stored.
    pub fn read<T: Element>(&self) -> Result<Vec<T>, ModalFileError> {
        if self.element != T::TYPE {
            return Err(self.file.wrong_type(&self.path, self.element.name(), T::TYPE.name()));
        }
        let mut values: Vec<T> = Vec::new();
        let len = self.len();
        // the declared size is bounded, but the machine may still be short of it
        if values.try_reserve_exact(len).is_err() {
            return Err(self.too_large_for_memory());
        }
        values.resize(len, T::default());
        if len > 0 {
            self.dataset.as_reader().no_convert().read_into_raw(&mut values).map_err(|e| self.file.unreadable(&self.path, &e))?;
        }
        Ok(values)
    }

    /// Rows `rows` of a dataset of rank 1 or 2, in C order, exactly as stored; the caller keeps the range inside the shape.
    pub fn read_rows<T: Element>(&self, rows: Range<usize>) -> Result<Vec<T>, ModalFileError> {
        if self.element != T::TYPE {
            return Err(self.file.wrong_type(&self.path, self.element.name(), T::TYPE.name()));
        }
        if rows.is_empty() {
            return Ok(Vec::new());
        }
        let reader = self.dataset.as_reader().no_convert();
        let read = match self.shape.len() {
            1 => reader.read_slice_1d::<T, _>(rows).map(|values| values.into_raw_vec_and_offset().0),
            _ => reader.read_slice_2d::<T, _>((rows, ..)).map(|values| values.into_raw_vec_and_offset().0),
        };
        read.map_err(|e| self.file.unreadable(&self.path, &e))
    }

    /// All elements of an f8 dataset, finite.
    pub fn read_f64(&self) -> Result<Vec<f64>, ModalFileError> {
        let values = self.read::<f64>()?;
        self.finite(&values)?;
        Ok(values)
    }

    /// All elements of an f8 or f4 dataset, finite.
    pub fn read_real(&self) -> Result<Vec<f64>, ModalFileError> {
        let values = if self.element == ElementType::F4 { widen(&self.read::<f32>()?) } else { self.read::<f64>()? };
        self.finite(&values)?;
        Ok(values)
    }

    /// Some rows of an f8 or f4 dataset of rank 1 or 2, finite.
    pub fn read_real_rows(&self, rows: Range<usize>) -> Result<Vec<f64>, ModalFileError> {
        let values = if self.element == ElementType::F4 { widen(&self.read_rows::<f32>(rows)?) } else { self.read_rows::<f64>(rows)? };
        self.finite(&values)?;
        Ok(values)
    }

    /// All elements of an i8 dataset, each in `0..end`.
    pub fn read_indices(&self, end: usize) -> Result<Vec<usize>, ModalFileError> {
        let values = self.read::<i64>()?;
        if let Some((position, &found)) = values.iter().enumerate().find(|&(_, &v)| usize::try_from(v).map_or(true, |v| v >= end)) {
            let (file, object) = (self.file.path().to_owned(), self.path.clone());
            return Err(ModalFileError::IndexOutOfRange { file, object, position, found, last: end as i64 - 1 });
        }
        Ok(values.into_iter().map(|v| v as usize).collect())
    }

    fn finite(&self, values: &[f64]) -> Result<(), ModalFileError> {
        match values.iter().position(|&v| !usable(v)) {
            None => Ok(()),
            Some(index) => Err(self.not_finite(index, values[index])),
        }
    }

    /// The refusal of one value.
    pub fn not_finite(&self, index: usize, value: f64) -> ModalFileError {
        ModalFileError::NotFinite { file: self.file.path().to_owned(), object: self.path.clone(), index, value }
    }

    fn too_large_for_memory(&self) -> ModalFileError {
        let found = format!("{} bytes, more than the memory left", self.bytes());
        ModalFileError::TooLarge { file: self.file.path().to_owned(), object: self.path.clone(), found, limit: super::guard::DATASET_LIMIT }
    }
}

fn widen(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}
