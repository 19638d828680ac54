//! `[body.import]` of a scene, and the same keys in a file of their own for `pliant import --keys`.

use super::spec::Numbers;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// One density, or one per group of cells.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "a density (kg/m^3) or a table of densities by group")]
pub enum DensitySpec {
    /// Of all volume cells.
    One(f64),
    /// By group.
    Groups(BTreeMap<String, f64>),
}

/// A field of nodal masses, or their list.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "the name of a nodal field or a list of masses (kg)")]
pub enum NodeMassSpec {
    /// Name of the field.
    Field(String),
    /// One per node.
    List(Vec<f64>),
}

/// Nodes of an interface: exactly one of group, box and nodes.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InterfaceSpec {
    /// Group of nodes or cells.
    pub group: Option<String>,
    /// Least and greatest coordinates (m).
    #[serde(rename = "box")]
    pub edges: Option<[[f64; 3]; 2]>,
    /// 0-based nodes.
    pub nodes: Option<Vec<usize>>,
    /// "rbe3" or "rbe2".
    pub coupling: Option<String>,
}

/// What is asked of an import.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImportSpec {
    /// The XDMF or MED file.
    pub file: Option<PathBuf>,
    /// Title of the body.
    pub title: Option<String>,
    /// Mesh of a MED file with several.
    pub mesh: Option<String>,
    /// Field of the mode shapes, or a pattern with one `*`.
    pub displacement: Option<String>,
    /// Field of nodal rotations.
    pub rotation: Option<String>,
    /// Field of the stress modes.
    pub stress: Option<String>,
    /// Order of its components.
    pub stress_components: Option<Vec<String>>,
    /// Frequencies (Hz); the times of the steps if none.
    pub frequency_hz: Option<Vec<f64>>,
    /// 1-based steps to retain; all if none.
    pub modes: Option<Vec<usize>>,
    /// One number, or one per retained mode.
    pub damping_ratio: Option<Numbers>,
    /// kg/m^3.
    pub density: Option<DensitySpec>,
    /// kg/m^2, of a mesh of surface cells.
    pub areal_density: Option<f64>,
    /// kg.
    pub node_mass: Option<NodeMassSpec>,
    /// How the modes were held; found from the root if none.
    pub boundary: Option<String>,
    /// Name of the inboard interface; "root" if none.
    pub root: Option<String>,
    /// Interfaces by name.
    #[serde(default)]
    pub interface: BTreeMap<String, InterfaceSpec>,
}

#[cfg(feature = "hdf5")]
impl ImportSpec {
    /// As plain options; the key and what is wrong with it if something is.
    ///
    /// # Errors
    /// If a value cannot be, or keys exclude one another.
    pub fn options(&self) -> Result<crate::io::import::ImportOptions, (&'static str, String)> {
        use crate::io::import::{ImportOptions, InterfaceRequest, Selection};
        use crate::model::modal_body::Boundary;
        use nalgebra::Vector3;
        let boundary = match &self.boundary {
            None => None,
            Some(word) => Some(
                Boundary::from_name(word)
                    .ok_or_else(|| ("boundary", format!("\"{word}\" must be cantilever, free-free, craig-bampton or general")))?,
            ),
        };
        let damping_ratio = self.damping_ratio.as_ref().map(Numbers::list);
        if let Some(wrong) = damping_ratio.iter().flatten().find(|z| !(**z >= 0.0)) {
            return Err(("damping_ratio", format!("{wrong} must be zero or more")));
        }
        let interface = |(name, spec): (&String, &InterfaceSpec)| {
            let fault = |message: &str| ("interface", format!("\"{name}\": {message}"));
            let selection = match (&spec.group, &spec.edges, &spec.nodes) {
                (Some(group), None, None) => Selection::Group(group.clone()),
                (None, Some([low, high]), None) => {
                    if (0..3).any(|a| !(low[a] <= high[a])) {
                        return Err(fault("box = [low, high] needs low at most high along every axis"));
                    }
                    Selection::Box { low: Vector3::from(*low), high: Vector3::from(*high) }
                }
                (None, None, Some(nodes)) => Selection::Nodes(nodes.clone()),
                _ => return Err(fault("give one of group = NAME, box = [[x, y, z], [x, y, z]] and nodes = [...]")),
            };
            let coupling = match spec.coupling.as_deref() {
                None => None,
                Some("rbe3") => Some(crate::io::Coupling::Rbe3),
                Some("rbe2") => Some(crate::io::Coupling::Rbe2),
                Some(other) => return Err(fault(&format!("coupling \"{other}\" must be rbe3 or rbe2"))),
            };
            Ok((name.clone(), InterfaceRequest { selection, coupling }))
        };
        Ok(ImportOptions {
            title: self.title.clone(),
            mesh: self.mesh.clone(),
            displacement: self.displacement.clone(),
            rotation: self.rotation.clone(),
            stress: self.stress.clone(),
            stress_components: self.stress_components.clone(),
            frequency_hz: self.frequency_hz.clone(),
            modes: self.modes.clone(),
            damping_ratio,
            mass: self.mass()?,
            boundary,
            root: self.root.clone(),
            interfaces: self.interface.iter().map(interface).collect::<Result<_, _>>()?,
        })
    }

    /// The one source of masses.
    fn mass(&self) -> Result<Option<crate::io::import::MassSource>, (&'static str, String)> {
        use crate::io::import::MassSource;
        let positive = |key, value: f64| if value > 0.0 { Ok(value) } else { Err((key, format!("{value} must be positive"))) };
        match (&self.density, self.areal_density, &self.node_mass) {
            (None, None, None) => Ok(None),
            (Some(DensitySpec::One(density)), None, None) => Ok(Some(MassSource::Density(positive("density", *density)?))),
            (Some(DensitySpec::Groups(groups)), None, None) => {
                groups.values().try_for_each(|&density| positive("density", density).map(drop))?;
                Ok(Some(MassSource::DensityByGroup(groups.clone())))
            }
            (None, Some(density), None) => Ok(Some(MassSource::ArealDensity(positive("areal_density", density)?))),
            (None, None, Some(NodeMassSpec::Field(name))) => Ok(Some(MassSource::Field(name.clone()))),
            (None, None, Some(NodeMassSpec::List(list))) => Ok(Some(MassSource::Values(list.clone()))),
            _ => Err(("node_mass", "give one of density, areal_density and node_mass".to_owned())),
        }
    }
}
