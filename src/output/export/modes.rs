//! The modes of a modal file as XDMF. Nothing is copied: the XML points into the modal file, which must lie in the same folder.

use super::error::ExportError;
use super::xdmf::{Attribute, Grid, Item, Number, file_name, write_collection, write_grid};
use crate::io::ModalFile;
use crate::io::modal_layout::FieldLayout;
use crate::model::surface::StressPlace;
use std::path::Path;

/// Cell types that XDMF names, as meshio names them.
const TOPOLOGIES: [(&str, &str); 17] = [
    ("vertex", "Polyvertex"),
    ("line", "Polyline"),
    ("line3", "Edge_3"),
    ("triangle", "Triangle"),
    ("triangle6", "Triangle_6"),
    ("quad", "Quadrilateral"),
    ("quad8", "Quadrilateral_8"),
    ("quad9", "Quadrilateral_9"),
    ("tetra", "Tetrahedron"),
    ("tetra10", "Tetrahedron_10"),
    ("pyramid", "Pyramid"),
    ("pyramid13", "Pyramid_13"),
    ("wedge", "Wedge"),
    ("wedge15", "Wedge_15"),
    ("hexahedron", "Hexahedron"),
    ("hexahedron20", "Hexahedron_20"),
    ("hexahedron27", "Hexahedron_27"),
];

/// Writes a series with one step per mode, whose time is the frequency (Hz).
///
/// # Errors
/// If the modal file cannot be read, its cells have no name in XDMF, or the target cannot be written.
pub fn write_series(modal: &ModalFile, target: &Path) -> Result<(), ExportError> {
    let source = Source::of(modal)?;
    let frequencies = modal.read_frequencies()?;
    let steps = frequencies.iter().enumerate().map(|(mode, &frequency)| {
        let mut attributes = vec![source.displacement(mode, "displacement".into())];
        attributes.extend(source.stress(mode, "stress".into()));
        source.grid(format!("mode_{mode:04}"), Some(frequency), attributes)
    });
    let texts = [("time", "frequency (Hz)".to_owned()), ("displacement", "m per unit modal coordinate, body axes".to_owned())];
    write_collection(target, "modes", &texts, steps)
}

/// Writes one grid with every mode and its stress as attributes.
///
/// # Errors
/// As [`write_series`].
pub fn write_modes(modal: &ModalFile, target: &Path) -> Result<(), ExportError> {
    let source = Source::of(modal)?;
    let of_mode = |mode: usize| {
        let shape = source.displacement(mode, format!("mode_{mode:04}"));
        std::iter::once(shape).chain(source.stress(mode, format!("stress_{mode:04}")))
    };
    let attributes = (0..modal.header().mode_count).flat_map(of_mode).collect();
    write_grid(target, &source.grid("modes".into(), None, attributes))
}

/// Where the arrays lie.
struct Source {
    file: String,
    topology: &'static str,
    layout: FieldLayout,
    nodes: usize,
}

impl Source {
    fn of(modal: &ModalFile) -> Result<Self, ExportError> {
        let layout = modal.field_layout()?;
        let Some((_, topology)) = TOPOLOGIES.iter().find(|(name, _)| *name == layout.cell_type) else {
            let known = TOPOLOGIES.map(|(name, _)| name).join(", ");
            return Err(ExportError::CellType { file: modal.path().to_owned(), found: layout.cell_type, known });
        };
        Ok(Self { file: file_name(modal.path())?, topology, layout, nodes: modal.header().node_count })
    }

    fn item(&self, path: String, number: Number, shape: Vec<usize>) -> Item<'_> {
        Item { file: &self.file, path, number, shape }
    }

    fn displacement(&self, mode: usize, name: String) -> Attribute<'_> {
        let number = float(self.layout.displacement[mode]);
        Attribute { name, center: "Node", item: self.item(format!("/modes/displacement/{mode:04}"), number, vec![self.nodes, 3]) }
    }

    fn stress(&self, mode: usize, name: String) -> Option<Attribute<'_>> {
        let (place, bytes) = self.layout.stress.as_ref()?;
        let (center, rows) = match place {
            StressPlace::Node => ("Node", self.nodes),
            StressPlace::Triangle => ("Cell", self.layout.cells.0),
        };
        Some(Attribute { name, center, item: self.item(format!("/modes/stress/{mode:04}"), float(bytes[mode]), vec![rows, 6]) })
    }

    fn grid<'a>(&'a self, name: String, time: Option<f64>, attributes: Vec<Attribute<'a>>) -> Grid<'a> {
        let cells = self.item("/mesh/cells".into(), Number::I8, vec![self.layout.cells.0, self.layout.cells.1]);
        let points = self.item("/mesh/points".into(), Number::F8, vec![self.nodes, 3]);
        Grid { name, time, topology: (self.topology, cells), points, attributes }
    }
}

fn float(bytes: usize) -> Number {
    if bytes == 4 { Number::F4 } else { Number::F8 }
}
