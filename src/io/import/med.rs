//! MED 3 and 4: mesh, families and groups, nodal fields with named components, one step per mode.
//!
//! Read as plain HDF5, so that no version of the MED library is needed. Source: the layout that the MED library 4.2, MEDCoupling 9 and
//! meshio 5.3 write. Arrays are component by component; steps come in no order; nodes count from 1; integers are i4 or i8.

use super::budget::Budget;
use super::cell::CellKind;
use super::error::{ImportError, listed, printable, refused};
use super::mesh::{COUNT_LIMIT, CellBlock, Field, FieldPlace, FieldSource, FieldStep, ForeignModel};
use crate::io::guard::GuardedFile;
use nalgebra::Vector3;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

/// Length of one name in a list of component names (bytes).
const NAME_BYTES: usize = 16;
/// What the name of a group takes, in numbers of eight bytes: its 80 bytes and what holds them.
const GROUP_NAME_NUMBERS: usize = 14;
/// Where steps lie that cover the whole mesh.
const NO_PROFILE: &str = "MED_NO_PROFILE_INTERNAL";
const AGAIN: &str = "export the file again";

/// Reads a MED file; `wanted` names the mesh where there are several.
///
/// # Errors
/// If the file is not MED 3 or 4, holds what the importer does not know, or its data is missing, damaged or of another size than stated.
pub fn read(path: &Path, wanted: Option<&str>) -> Result<ForeignModel, ImportError> {
    let file = GuardedFile::open(path)?;
    let budget = Budget::new(file.bytes());
    let reader = Reader { path: path.to_owned(), file, budget };
    reader.check_version()?;
    let mesh = reader.mesh_name(wanted)?;
    let state = reader.only_child(&format!("ENS_MAA/{mesh}"), "mesh steps", "one state of the mesh")?;
    let points = reader.points(&mesh, &state)?;
    let (blocks, families) = reader.cells(&state, points.len())?;
    let node_groups = reader.node_groups(&mesh, &state, points.len())?;
    let cell_groups = reader.cell_groups(&mesh, &families)?;
    let (fields, steps) = reader.fields(&mesh, points.len())?;
    let file = reader.path.clone();
    let source = Box::new(Steps { reader, steps });
    Ok(ForeignModel { file, format: "MED", points, blocks, node_groups, cell_groups, fields, source })
}

/// An open file.
#[derive(Debug)]
struct Reader {
    path: PathBuf,
    file: GuardedFile,
    budget: Budget,
}

/// Numbers of fields by the path of their dataset.
#[derive(Debug)]
struct Steps {
    reader: Reader,
    steps: Vec<String>,
}

impl FieldSource for Steps {
    fn values(&self, field: &Field, step: &FieldStep) -> Result<Vec<f64>, ImportError> {
        let values = self.reader.numbers(&self.steps[step.key])?;
        Ok(by_rows(&values, field.components.len()))
    }

    fn budget(&self) -> &Budget {
        &self.reader.budget
    }

    fn files(&self) -> Vec<PathBuf> {
        vec![self.reader.path.clone()]
    }
}

/// From component after component to row after row.
fn by_rows<T: Copy>(values: &[T], components: usize) -> Vec<T> {
    let rows = values.len().checked_div(components).unwrap_or(0);
    (0..rows).flat_map(|row| (0..components).map(move |c| values[c * rows + row])).collect()
}

impl Reader {
    fn refuse<T>(&self, object: &str, found: impl Into<String>, expected: &str, remedy: &str) -> Result<T, ImportError> {
        Err(refused(&self.path, object, found, expected, remedy))
    }

    fn check_version(&self) -> Result<(), ImportError> {
        const INFO: &str = "INFOS_GENERALES";
        if !self.file.has(INFO) || !self.file.has("ENS_MAA") {
            let found = format!("the groups {}", listed(self.file.children_of_root()));
            return self.refuse("the file", found, "INFOS_GENERALES and ENS_MAA", "name a MED file; a modal file needs no import");
        }
        match self.file.integer(INFO, "MAJ")? {
            3 | 4 => Ok(()),
            other => self.refuse("INFOS_GENERALES@MAJ", other.to_string(), "3 or 4", "convert the file to MED 4 (medimport)"),
        }
    }

    fn mesh_name(&self, wanted: Option<&str>) -> Result<String, ImportError> {
        let names = self.file.children("ENS_MAA");
        match (wanted, &names[..]) {
            (Some(wanted), _) if names.contains(&wanted) => Ok(wanted.to_owned()),
            (None, [only]) => Ok((*only).to_owned()),
            (Some(wanted), _) => {
                let found = format!("no mesh \"{}\"", printable(wanted));
                self.refuse("ENS_MAA", found, &format!("one of {}", listed(names)), "correct the key mesh")
            }
            (None, []) => self.refuse("ENS_MAA", "no mesh", "a mesh", "export the mesh with the modes"),
            (None, _) => Err(ImportError::Needed {
                file: self.path.clone(),
                key: "mesh".to_owned(),
                found: format!("the meshes {}", listed(names)),
                remedy: "name the one that carries the modes".to_owned(),
            }),
        }
    }

    /// The only group below a group, with its whole path.
    fn only_child(&self, group: &str, what: &str, expected: &str) -> Result<String, ImportError> {
        match self.file.children(group)[..] {
            [only] => Ok(format!("{group}/{only}")),
            ref names => self.refuse(group, format!("{} {what}", names.len()), expected, "export a mesh that does not change in time"),
        }
    }

    fn numbers(&self, path: &str) -> Result<Vec<f64>, ImportError> {
        let dataset = self.file.foreign(path)?;
        self.budget.check(&self.path, path, dataset.len())?;
        Ok(dataset.read_numbers()?)
    }

    /// Nodes of cells, or families: they are kept.
    fn integers(&self, path: &str) -> Result<Vec<i64>, ImportError> {
        let dataset = self.file.foreign(path)?;
        self.budget.keep(&self.path, path, dataset.len())?;
        Ok(dataset.read_integers()?)
    }

    fn points(&self, mesh: &str, state: &str) -> Result<Vec<Vector3<f64>>, ImportError> {
        let object = format!("ENS_MAA/{mesh}@ESP");
        let space = self.file.integer(&format!("ENS_MAA/{mesh}"), "ESP")?;
        if space != 3 {
            return self.refuse(&object, format!("{space} coordinates per node"), "3", "export the mesh in three dimensions");
        }
        let path = format!("{state}/NOE/COO");
        let values = self.numbers(&path)?;
        self.budget.keep(&self.path, &path, values.len())?;
        let count = values.len() / 3;
        let stated = self.file.integer(&path, "NBR")?;
        if count == 0 || count > COUNT_LIMIT || values.len() % 3 != 0 || usize::try_from(stated) != Ok(count) {
            let found = format!("{} numbers for {stated} nodes", values.len());
            return self.refuse(&path, found, "three per node, for 1 to 50 million nodes", AGAIN);
        }
        match values.iter().position(|v| !(v.abs() <= 1e100)) {
            None => Ok(by_rows(&values, 3).chunks_exact(3).map(Vector3::from_column_slice).collect()),
            Some(at) => {
                self.refuse(&path, format!("{:e} at node {}", values[at], at % count + 1), "finite coordinates", "repair the export")
            }
        }
    }

    /// Cells by kind, and the family of each cell.
    fn cells(&self, state: &str, nodes: usize) -> Result<(Vec<CellBlock>, Vec<Vec<i64>>), ImportError> {
        let (mut blocks, mut families) = (Vec::new(), Vec::new());
        for name in self.file.children(&format!("{state}/MAI")) {
            // single points carry neither mass nor faces
            if name == "PO1" {
                continue;
            }
            let at = |dataset: &str| format!("{state}/MAI/{name}/{dataset}");
            let Some(kind) = CellKind::from_med(name) else {
                let expected = "SE2 SE3 TR3 TR6 QU4 QU8 QU9 TE4 T10 PY5 P13 PE6 P15 HE8 H20 H27";
                return self.refuse(&at("NOD"), format!("cells of type {}", printable(name)), expected, "export cells of a known type");
            };
            let indices = self.integers(&at("NOD"))?;
            let (width, stated) = (kind.node_count(), self.file.integer(&at("NOD"), "NBR")?);
            if indices.len() % width != 0 || usize::try_from(stated) != Ok(indices.len() / width) {
                let found = format!("{} numbers for {stated} cells", indices.len());
                return self.refuse(&at("NOD"), found, &format!("{width} per cell"), AGAIN);
            }
            if let Some(&wrong) = indices.iter().find(|&&node| node < 1 || node > nodes as i64) {
                return self.refuse(&at("NOD"), format!("node {wrong}"), &format!("1 to {nodes}"), AGAIN);
            }
            let flat: Vec<usize> = indices.iter().map(|&node| node as usize - 1).collect();
            let count = flat.len() / width;
            families.push(self.families(&at("FAM"), count)?);
            blocks.push(CellBlock { kind, nodes: by_rows(&flat, width) });
        }
        Ok((blocks, families))
    }

    /// Family of each node or cell; zero where the file has none.
    fn families(&self, path: &str, count: usize) -> Result<Vec<i64>, ImportError> {
        if !self.file.has(path) {
            return Ok(vec![0; count]);
        }
        let families = self.integers(path)?;
        if families.len() == count {
            return Ok(families);
        }
        self.refuse(path, format!("{} numbers", families.len()), &format!("{count}: one family each"), AGAIN)
    }

    /// Names of the groups of each family.
    fn groups_of_families(&self, mesh: &str, side: &str) -> Result<HashMap<i64, Vec<String>>, ImportError> {
        let folder = format!("FAS/{mesh}/{side}");
        let mut groups = HashMap::new();
        for family in self.file.children(&folder) {
            let path = format!("{folder}/{family}");
            let number = self.file.integer(&path, "NUM")?;
            let names = format!("{path}/GRO/NOM");
            // families without groups are sound
            if self.file.has(&names) {
                let dataset = self.file.foreign(&names)?;
                self.budget.keep(&self.path, &names, dataset.len() * GROUP_NAME_NUMBERS)?;
                let names = dataset.read_names()?;
                groups.insert(number, names.into_iter().filter(|name| !name.is_empty()).collect());
            }
        }
        Ok(groups)
    }

    /// The bound on members of groups: few nodes in families of many groups each are many members.
    fn keep_members<'f>(
        &self,
        mesh: &str,
        side: &str,
        numbers: usize,
        groups: &HashMap<i64, Vec<String>>,
        families: impl Iterator<Item = &'f i64>,
    ) -> Result<(), ImportError> {
        let members: usize = families.map(|family| groups.get(family).map_or(0, Vec::len)).fold(0, usize::saturating_add);
        self.budget.keep(&self.path, &format!("FAS/{mesh}/{side}"), members.saturating_mul(numbers))
    }

    fn node_groups(&self, mesh: &str, state: &str, nodes: usize) -> Result<BTreeMap<String, Vec<usize>>, ImportError> {
        let groups = self.groups_of_families(mesh, "NOEUD")?;
        let families = self.families(&format!("{state}/NOE/FAM"), nodes)?;
        self.keep_members(mesh, "NOEUD", 1, &groups, families.iter())?;
        let mut members: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (node, family) in families.into_iter().enumerate() {
            for name in groups.get(&family).into_iter().flatten() {
                members.entry(name.clone()).or_default().push(node);
            }
        }
        Ok(members)
    }

    fn cell_groups(&self, mesh: &str, families: &[Vec<i64>]) -> Result<BTreeMap<String, Vec<(usize, usize)>>, ImportError> {
        let groups = self.groups_of_families(mesh, "ELEME")?;
        self.keep_members(mesh, "ELEME", 2, &groups, families.iter().flatten())?;
        let mut members: BTreeMap<String, Vec<(usize, usize)>> = BTreeMap::new();
        for (block, families) in families.iter().enumerate() {
            for (cell, family) in families.iter().enumerate() {
                for name in groups.get(family).into_iter().flatten() {
                    members.entry(name.clone()).or_default().push((block, cell));
                }
            }
        }
        Ok(members)
    }

    /// Nodal fields of the mesh, and the dataset of each step.
    fn fields(&self, mesh: &str, nodes: usize) -> Result<(Vec<Field>, Vec<String>), ImportError> {
        let (mut fields, mut datasets) = (Vec::new(), Vec::new());
        for name in self.file.children("CHA") {
            let group = format!("CHA/{name}");
            if self.file.text(&group, "MAI")? != mesh {
                continue;
            }
            let count = usize::try_from(self.file.integer(&group, "NCO")?).unwrap_or(0);
            if count == 0 || count > 64 {
                return self.refuse(&format!("{group}@NCO"), format!("{count} components"), "1 to 64", AGAIN);
            }
            let text = self.file.text(&group, "NOM")?;
            let component = |i: usize| text.as_bytes().chunks(NAME_BYTES).nth(i).map(String::from_utf8_lossy);
            let components = (0..count).map(|i| component(i).map_or(String::new(), |name| name.trim().to_owned())).collect();
            let mut steps = Vec::new();
            for step in self.file.children(&group) {
                let at = format!("{group}/{step}");
                // fields on cells and in integration points have no NOE
                if !self.file.has(&format!("{at}/NOE")) {
                    continue;
                }
                let profiles = self.file.children(&format!("{at}/NOE"));
                let [profile] = profiles[..] else {
                    return self.refuse(&format!("{at}/NOE"), format!("{} parts", profiles.len()), "one for all nodes", AGAIN);
                };
                let whole = format!("{at}/NOE/{profile}");
                let rows = self.file.integer(&whole, "NBR")?;
                if profile != NO_PROFILE || usize::try_from(rows) != Ok(nodes) {
                    let (found, expected) = (format!("{rows} nodes of the profile {}", printable(profile)), format!("all {nodes} nodes"));
                    return self.refuse(&whole, found, &expected, "export the field on the whole mesh");
                }
                let (number, order) = (self.file.integer(&at, "NDT")?, self.file.integer(&at, "NOR")?);
                let time = Some(self.file.real(&at, "PDT")?);
                steps.push((order, FieldStep { number, time, key: datasets.len() }));
                datasets.push(format!("{whole}/CO"));
            }
            steps.sort_by_key(|(order, step)| (step.number, *order));
            if let Some(pair) = steps.windows(2).find(|pair| pair[0].1.number == pair[1].1.number) {
                let found = format!("step {} twice", pair[0].1.number);
                return self.refuse(&group, found, "one state per step", "export one state per mode");
            }
            if !steps.is_empty() {
                let steps = steps.into_iter().map(|(_, step)| step).collect();
                fields.push(Field { name: name.to_owned(), place: FieldPlace::Node, components, steps });
            }
        }
        Ok((fields, datasets))
    }
}

#[cfg(test)]
mod tests {
    use super::by_rows;

    #[test]
    fn components_become_columns() {
        assert_eq!(by_rows(&[1, 2, 3, 4, 5, 6], 2), [1, 4, 2, 5, 3, 6]);
        assert!(by_rows::<i64>(&[], 0).is_empty());
    }
}
