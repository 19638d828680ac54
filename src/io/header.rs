//! The attributes of a modal file: what it is, before any data is read.

use super::error::ModalFileError;
use super::guard::GuardedFile;
use crate::model::modal_body::Boundary;

/// Name of the format in `@format`.
pub const FORMAT: &str = "flexible-body-modes";
/// Major version that this reader knows.
pub const MAJOR_VERSION: &str = "1";
/// Words that `@units` may hold: SI without prefixes but kg.
const UNITS: [&str; 10] = ["m", "kg", "s", "rad", "Pa", "Hz", "N", "K", "-", "SI"];
/// How the nodal masses were made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NodeMassKind {
    /// Row sums of the consistent matrix, all positive.
    RowSum,
    /// Row sums with negative entries: quadrature weights, not particles.
    RowSumSigned,
    /// Scaled diagonal (Hinton, Rock, Zienkiewicz).
    Hrz,
    /// As the solver gave them.
    Solver,
}

/// The attributes of a modal file.
#[derive(Debug, Clone)]
pub struct Header {
    /// Schema version, `1.x`.
    pub version: String,
    /// Title of the structure.
    pub title: String,
    /// Tool that wrote the file.
    pub generator: String,
    /// Units as stated.
    pub units: String,
    /// How the modes were held.
    pub boundary: Boundary,
    /// Name of the root interface.
    pub root_interface: String,
    /// Number of modes n, at least 1.
    pub mode_count: usize,
    /// Number of nodes N, at least 1.
    pub node_count: usize,
    /// Number of surface and interface nodes S, which come first.
    pub surface_nodes: usize,
    /// Digest as stated.
    pub content_sha256: String,
    /// How the nodal masses were made.
    pub node_mass_kind: NodeMassKind,
    /// Where the tensors are sums over nodes: by how much the modes of the source departed from orthonormality with these masses.
    pub lumping_departure: Option<f64>,
}

/// Reads and understands every attribute that the schema requires of the file as a whole.
pub(super) fn read_header(file: &GuardedFile) -> Result<Header, ModalFileError> {
    let refuse = |object: &str, found: &str, expected: &str, remedy| ModalFileError::WrongValue {
        file: file.path().to_owned(),
        object: object.to_owned(),
        found: format!("\"{found}\""),
        expected: expected.to_owned(),
        remedy,
    };
    let format = file.text("", "format")?;
    if format != FORMAT {
        return Err(refuse("@format", &format, FORMAT, "give a modal file, or convert the export of another tool"));
    }
    let version = file.text("", "version")?;
    if version.split('.').next() != Some(MAJOR_VERSION) {
        return Err(refuse("@version", &version, "1.x", "write the file in schema 1.0, or use a newer pliant"));
    }
    let units = file.text("", "units")?;
    if units.split([' ', ',']).any(|word| !word.is_empty() && !UNITS.contains(&word)) {
        return Err(refuse("@units", &units, "m kg s rad Pa Hz", "convert all data to SI before writing it"));
    }
    let word = file.text("", "boundary")?;
    let boundary = Boundary::from_name(&word)
        .ok_or_else(|| refuse("@boundary", &word, "cantilever, free-free, craig-bampton or general", "state how the modes were held"))?;
    let root_interface = file.text("", "root_interface")?;
    if !file.children("interfaces").contains(&root_interface.as_str()) {
        return Err(refuse(
            "@root_interface",
            &root_interface,
            "the name of a group in interfaces",
            "add the interface or correct the name",
        ));
    }
    let word = file.text("mesh/node_mass", "kind")?;
    let node_mass_kind = match word.as_str() {
        "row_sum" => NodeMassKind::RowSum,
        "row_sum_signed" => NodeMassKind::RowSumSigned,
        "hrz" => NodeMassKind::Hrz,
        "solver" => NodeMassKind::Solver,
        _ => {
            return Err(refuse(
                "mesh/node_mass@kind",
                &word,
                "row_sum, row_sum_signed, hrz or solver",
                "state how the nodal masses were made",
            ));
        }
    };
    let at_least_one = |name: &str| -> Result<usize, ModalFileError> {
        let count = file.count("", name)?;
        if count > 0 { Ok(count) } else { Err(refuse(&format!("@{name}"), "0", "at least 1", "describe a body without modes as rigid")) }
    };
    let (mode_count, node_count) = (at_least_one("mode_count")?, at_least_one("node_count")?);
    let surface_nodes = file.count("mesh/points", "surface_nodes")?;
    if surface_nodes > node_count {
        let found = surface_nodes.to_string();
        return Err(refuse(
            "mesh/points@surface_nodes",
            &found,
            "at most node_count",
            "count the surface and interface nodes, which come first",
        ));
    }
    let content_sha256 = file.text("", "content_sha256")?;
    let (title, generator) = (file.text("", "title")?, file.text("", "generator")?);
    Ok(Header {
        version,
        title,
        generator,
        units,
        boundary,
        root_interface,
        mode_count,
        node_count,
        surface_nodes,
        content_sha256,
        node_mass_kind,
        lumping_departure: lumping_departure(file)?,
    })
}

/// Optional attributes of `inertia`: where the tensors come from, and the figure that belongs to it.
fn lumping_departure(file: &GuardedFile) -> Result<Option<f64>, ModalFileError> {
    match file.text("inertia", "source") {
        Err(ModalFileError::Missing { .. }) => return Ok(None),
        Ok(word) if word == "lumped" => {}
        Ok(_) => return Ok(None),
        Err(error) => return Err(error),
    }
    let text = file.text("inertia", "departure")?;
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1e100).contains(&value) => Ok(Some(value)),
        _ => Err(ModalFileError::WrongValue {
            file: file.path().to_owned(),
            object: "inertia@departure".to_owned(),
            found: format!("\"{text}\""),
            expected: "a number of zero or more".to_owned(),
            remedy: "import the body again",
        }),
    }
}
