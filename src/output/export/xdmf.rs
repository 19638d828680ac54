//! The XML of XDMF 3: temporal collections whose arrays lie in HDF5 files.
//!
//! Every step is a whole grid with its own geometry, so that VTK moves the mesh. Of the two readers that matter, meshio takes the mesh
//! of the first step and ignores hyperslabs, so that every array is a dataset of its own.

use super::error::ExportError;
use std::fmt;
use std::io::Write;
use std::path::Path;

/// Element type of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    F8,
    F4,
    I8,
    I4,
}

/// A reference to an array.
#[derive(Debug, Clone)]
pub(super) struct Item<'a> {
    /// Name of the HDF5 file, without folder.
    pub file: &'a str,
    /// Path with leading slash.
    pub path: String,
    pub number: Number,
    /// Shape, of rank 1 or 2.
    pub shape: Vec<usize>,
}

/// Name, place and array of an attribute.
pub(super) struct Attribute<'a> {
    pub name: String,
    /// "Node" or "Cell".
    pub center: &'static str,
    pub item: Item<'a>,
}

/// One grid.
pub(super) struct Grid<'a> {
    pub name: String,
    /// None for a grid outside a collection.
    pub time: Option<f64>,
    /// Name of the topology, and the cells.
    pub topology: (&'a str, Item<'a>),
    pub points: Item<'a>,
    pub attributes: Vec<Attribute<'a>>,
}

impl fmt::Display for Item<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, bytes) = match self.number {
            Number::F8 => ("Float", 8),
            Number::F4 => ("Float", 4),
            Number::I8 => ("Int", 8),
            Number::I4 => ("Int", 4),
        };
        let shape = self.shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
        let (file, path) = (escape(self.file), escape(&self.path));
        write!(f, r#"<DataItem DataType="{kind}" Precision="{bytes}" Dimensions="{shape}" Format="HDF">{file}:{path}</DataItem>"#)
    }
}

impl fmt::Display for Grid<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, r#"<Grid Name="{}" GridType="Uniform">"#, escape(&self.name))?;
        let (topology, cells) = &self.topology;
        let (count, nodes) = (cells.shape[0], cells.shape.get(1).copied().unwrap_or(1));
        writeln!(f, r#"<Topology TopologyType="{topology}" NumberOfElements="{count}" NodesPerElement="{nodes}">{cells}</Topology>"#)?;
        writeln!(f, r#"<Geometry GeometryType="XYZ">{}</Geometry>"#, self.points)?;
        if let Some(time) = self.time {
            writeln!(f, r#"<Time Value="{time:?}"/>"#)?;
        }
        for Attribute { name, center, item } in &self.attributes {
            let kind = match item.shape.get(1) {
                Some(3) => "Vector",
                Some(6) => "Tensor6",
                _ => "Scalar",
            };
            writeln!(f, r#"<Attribute Name="{}" AttributeType="{kind}" Center="{center}">{item}</Attribute>"#, escape(name))?;
        }
        writeln!(f, "</Grid>")
    }
}

/// Writes one grid as a file of its own.
pub(super) fn write_grid(path: &Path, grid: &Grid<'_>) -> Result<(), ExportError> {
    write(path, |out| write!(out, "{grid}"))
}

/// Writes a temporal collection with texts that say what is in it; grids are asked for one by one.
pub(super) fn write_collection<'a>(
    path: &Path,
    name: &str,
    texts: &[(&str, String)],
    grids: impl Iterator<Item = Grid<'a>>,
) -> Result<(), ExportError> {
    write(path, |out| {
        for (name, text) in texts {
            writeln!(out, r#"<Information Name="{}" Value="{}"/>"#, escape(name), escape(text))?;
        }
        writeln!(out, r#"<Grid Name="{}" GridType="Collection" CollectionType="Temporal">"#, escape(name))?;
        for grid in grids {
            write!(out, "{grid}")?;
        }
        writeln!(out, "</Grid>")
    })
}

fn write(path: &Path, body: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<(), ExportError> {
    let made = || -> std::io::Result<()> {
        let mut out = std::io::BufWriter::new(std::fs::File::create(path)?);
        writeln!(out, r#"<?xml version="1.0" encoding="utf-8"?>"#)?;
        writeln!(out, r#"<Xdmf Version="3.0"><Domain>"#)?;
        body(&mut out)?;
        writeln!(out, "</Domain></Xdmf>")?;
        out.flush()
    };
    made().map_err(|e| ExportError::Write { file: path.to_owned(), cause: e.to_string() })
}

/// The name of the HDF5 file of references; a colon in it would end it early.
pub(super) fn file_name(path: &Path) -> Result<String, ExportError> {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    match name.chars().find(|c| *c == ':' || *c == char::REPLACEMENT_CHARACTER) {
        Some(found) => Err(ExportError::Name { file: path.to_owned(), found }),
        None => Ok(name),
    }
}

fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_texts_cannot_end_an_element() {
        assert_eq!(escape("a<b> & \"c\"\n"), "a&lt;b&gt; &amp; &quot;c&quot; ");
    }

    #[test]
    fn a_name_with_a_colon_is_refused_with_what_to_do() {
        let text = file_name(Path::new("a/b:c.h5")).unwrap_err().to_string();
        assert_eq!(
            text,
            "a/b:c.h5: found the character ':' in the name, expected none: XDMF readers split references to arrays at it; rename the file"
        );
    }
}
