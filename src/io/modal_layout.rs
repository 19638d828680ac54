//! How the fields of a modal file are stored and where its integrals come from: what another program, or a reader of the report, asks.

use super::array::ElementType;
use super::error::ModalFileError;
use super::modal_file::ModalFile;
use crate::model::surface::StressPlace;

/// Shapes and types of the arrays that pictures use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldLayout {
    /// Name of the one cell type, as meshio has it.
    pub cell_type: String,
    /// Number of cells, and of nodes per cell.
    pub cells: (usize, usize),
    /// Bytes of a number of the displacement, per mode.
    pub displacement: Vec<usize>,
    /// Where stress sits, and bytes of its numbers per mode.
    pub stress: Option<(StressPlace, Vec<usize>)>,
}

impl ModalFile {
    /// The layout of mesh, mode shapes and stress modes.
    ///
    /// # Errors
    /// If a dataset is missing, of another type or shape, or damaged.
    pub fn field_layout(&self) -> Result<FieldLayout, ModalFileError> {
        let modes = 0..self.header().mode_count;
        let bytes = |element: ElementType| element.bytes() as usize;
        let displacement = modes.clone().map(|mode| Ok(bytes(self.displacement_dataset("displacement", mode)?.element)));
        let displacement = displacement.collect::<Result<_, ModalFileError>>()?;
        let stress = match self.stress_location()? {
            None => None,
            Some(place) => {
                let rows = self.stress_rows(place)?;
                let of_mode = |mode| Ok(bytes(self.stress_dataset(mode, rows)?.element));
                Some((place, modes.map(of_mode).collect::<Result<_, ModalFileError>>()?))
            }
        };
        Ok(FieldLayout { cell_type: self.file.text("mesh/cells", "cell_type")?, cells: self.cell_shape()?, displacement, stress })
    }

    /// Where the inertia integrals come from, if the file says so: converters write lumped sums here, with what these miss.
    ///
    /// # Errors
    /// If the attribute is no text.
    pub fn inertia_source(&self) -> Result<Option<String>, ModalFileError> {
        match self.file.text("inertia", "source") {
            Ok(text) => Ok(Some(text)),
            Err(ModalFileError::Missing { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Frequencies (Hz), length n.
    ///
    /// # Errors
    /// If the dataset is missing, of another type or shape, damaged or not finite.
    pub fn read_frequencies(&self) -> Result<Vec<f64>, ModalFileError> {
        self.sized("modes/frequency", &[self.header().mode_count], "(modes)")?.read_f64()
    }
}
