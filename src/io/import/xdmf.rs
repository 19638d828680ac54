//! XDMF 3 as meshio writes it: a uniform grid, or a temporal collection of them with one step per mode.
//!
//! Sources: the XDMF model and format (xdmf.org) and the files of meshio 5.3. A collection may name the mesh once, by an include whose
//! xpointer names a grid; includes lead one step and never to a file, so that they cannot run in circles.

use super::budget::Budget;
use super::cell::CellKind;
use super::error::{ImportError, listed, printable, refused};
use super::mesh::{COUNT_LIMIT, CellBlock, Field, FieldPlace, FieldSource, FieldStep, ForeignModel};
use super::xdmf_item::{Folder, Item};
use super::xml::{self, Document, Element};
use nalgebra::Vector3;
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Reads an XDMF file.
///
/// # Errors
/// If the file is not XDMF, holds what the importer does not know, or its data is missing, damaged or of another size than stated.
pub fn read(path: &Path) -> Result<ForeignModel, ImportError> {
    let fail = |cause: String| ImportError::Open { file: path.to_owned(), cause };
    let metadata = std::fs::metadata(path).map_err(|e| fail(e.to_string()))?;
    if !metadata.is_file() {
        return Err(fail("not a regular file".to_owned()));
    }
    if metadata.len() > xml::TEXT_LIMIT as u64 {
        let found = format!("{} bytes of XML", metadata.len());
        let expected = format!("at most {} bytes", xml::TEXT_LIMIT);
        return Err(refused(path, "the file", found, expected, "store the numbers in HDF5 (in meshio data_format=\"HDF\")"));
    }
    let bytes = std::fs::read(path).map_err(|e| fail(e.to_string()))?;
    let text = String::from_utf8(bytes).map_err(|e| fail(format!("not UTF-8 text at byte {}", e.utf8_error().valid_up_to())))?;
    let document = xml::parse(path, &text)?;
    Reader { folder: Folder::of(path, metadata.len()), document }.model()
}

/// A parsed file.
struct Reader {
    folder: Folder,
    document: Document,
}

/// Grids by name and by place below a named grid. Every step may point at one; a search for each would take as long as the square of the
/// file's length.
struct Grids<'d> {
    by_name: HashMap<&'d str, &'d Element>,
    below: RefCell<HashMap<&'d str, Vec<&'d Element>>>,
    /// Topology and geometry of the grids that were pointed at.
    meshes: RefCell<HashMap<*const Element, Option<Mesh<'d>>>>,
}

/// Topology and geometry.
type Mesh<'d> = (&'d Element, &'d Element);

/// Numbers of fields by the place of their item.
#[derive(Debug)]
struct Items {
    folder: Folder,
    items: Vec<Item>,
}

impl FieldSource for Items {
    fn values(&self, _: &Field, step: &FieldStep) -> Result<Vec<f64>, ImportError> {
        self.folder.numbers(&self.items[step.key])
    }

    fn budget(&self) -> &Budget {
        &self.folder.budget
    }

    fn files(&self) -> Vec<PathBuf> {
        self.folder.files()
    }
}

impl Reader {
    fn refuse<T>(&self, object: &str, found: impl Into<String>, expected: &str, remedy: &str) -> Result<T, ImportError> {
        Err(refused(self.folder.file(), object, found, expected, remedy))
    }

    fn model(self) -> Result<ForeignModel, ImportError> {
        let root = self.document.root();
        if root.name != "Xdmf" {
            return self.refuse("the file", format!("the element \"{}\"", printable(&root.name)), "Xdmf", "name an XDMF file");
        }
        let domains: Vec<&Element> = self.document.below(root, "Domain").collect();
        let [domain] = domains[..] else {
            return self.refuse("Xdmf", format!("{} domains", domains.len()), "one Domain", "export one mesh per file");
        };
        let grids: Vec<&Element> = self.document.below(domain, "Grid").collect();
        let collections: Vec<&Element> = grids.iter().copied().filter(|grid| kind(grid) != "uniform").collect();
        let (steps, times) = match (&collections[..], &grids[..]) {
            ([], [grid]) => (vec![*grid], Vec::new()),
            ([collection], _) => {
                let (kind, order) = (kind(collection), collection.attribute("CollectionType").unwrap_or("Spatial"));
                if kind != "collection" || !order.eq_ignore_ascii_case("Temporal") {
                    let found = format!("a grid of type {} {}", printable(&kind), printable(order));
                    return self.refuse("Grid", found, "a uniform grid or a temporal collection", "export one mesh with one step per mode");
                }
                (self.document.below(collection, "Grid").collect(), self.listed_times(collection)?)
            }
            _ => {
                let found = format!("{} grids in the domain", grids.len());
                return self.refuse("Domain", found, "one uniform grid, or one temporal collection", "export one mesh per file");
            }
        };
        let Some(first) = steps.first() else {
            return self.refuse("Grid", "a collection without grids", "one grid per mode", "export the modes as steps");
        };
        let grids = self.grids();
        let (topology, geometry) = self.mesh_of(first, &grids)?;
        // each mesh is compared once, however many steps point at it
        let mut compared = HashSet::new();
        for step in &steps[1..] {
            // a step may leave the mesh out, refer to it, or repeat it; another mesh would give the fields other nodes
            if !self.document.children(step).any(|child| matches!(child.name.as_str(), "Topology" | "Geometry" | "include")) {
                continue;
            }
            let (other, points) = self.mesh_of(step, &grids)?;
            if compared.insert(std::ptr::from_ref(other)) && !(self.same(other, topology) && self.same(points, geometry)) {
                return self.refuse("Topology", "another mesh in a later step", "one mesh for all modes", "export the modes on one mesh");
            }
        }
        let points = self.points(geometry)?;
        let blocks = self.cells(topology, points.len())?;
        let (fields, items) = self.fields(&steps, &times)?;
        let file = self.folder.file().to_owned();
        let source = Box::new(Items { folder: self.folder, items });
        let (node_groups, cell_groups) = (BTreeMap::new(), BTreeMap::new());
        Ok(ForeignModel { file, format: "XDMF", points, blocks, node_groups, cell_groups, fields, source })
    }

    /// Times that a collection lists once for all its grids.
    fn listed_times(&self, collection: &Element) -> Result<Vec<f64>, ImportError> {
        let Some(time) = self.document.below(collection, "Time").next() else { return Ok(Vec::new()) };
        let kind = time.attribute("TimeType").unwrap_or("Single");
        match self.document.below(time, "DataItem").next() {
            Some(item) if kind.eq_ignore_ascii_case("List") => self.folder.numbers(&self.folder.item(item, "Time")?),
            _ => self.refuse(
                "Time",
                format!("the time type {}", printable(kind)),
                "a list, or a Time in each grid",
                "export the times one by one",
            ),
        }
    }

    fn grids(&self) -> Grids<'_> {
        let mut by_name = HashMap::new();
        for grid in self.document.named("Grid") {
            if let Some(name) = grid.attribute("Name") {
                by_name.entry(name).or_insert(grid);
            }
        }
        Grids { by_name, below: RefCell::default(), meshes: RefCell::default() }
    }

    /// Topology and geometry of a grid, or of the grid that it includes.
    fn mesh_of<'d>(&'d self, grid: &'d Element, grids: &Grids<'d>) -> Result<Mesh<'d>, ImportError> {
        let own = |grid: &'d Element| Some((self.document.below(grid, "Topology").next()?, self.document.below(grid, "Geometry").next()?));
        if let Some(mesh) = own(grid) {
            return Ok(mesh);
        }
        let Some(include) = self.document.below(grid, "include").next() else {
            return self.refuse(
                "Grid",
                "no Topology and Geometry",
                "both, or an include of another grid's",
                "export the mesh with the modes",
            );
        };
        if include.attribute("href").is_some() {
            return self.refuse(
                "include",
                "a reference to another file",
                "one to a grid of this file",
                "export the mesh into the same file",
            );
        }
        let pointer = include.attribute("xpointer").unwrap_or_default();
        let target = self.pointed(pointer, grids);
        let target = target.and_then(|grid| *grids.meshes.borrow_mut().entry(std::ptr::from_ref(grid)).or_insert_with(|| own(grid)));
        target.map_or_else(
            || {
                let found = format!("the pointer \"{}\"", printable(pointer));
                let expected = "xpointer(//Grid[@Name=\"...\"]...) to a grid with its own Topology and Geometry";
                self.refuse("include", found, expected, "export the file again, for example with meshio")
            },
            Ok,
        )
    }

    /// The grid named by a pointer, or the numbered one below it.
    fn pointed<'d>(&'d self, pointer: &str, grids: &Grids<'d>) -> Option<&'d Element> {
        let (_, rest) = pointer.split_once("//Grid[@Name=")?;
        let quote = rest.chars().next().filter(|c| matches!(c, '"' | '\''))?;
        let (name, rest) = rest[1..].split_once(quote)?;
        let (&name, &grid) = grids.by_name.get_key_value(name)?;
        match rest.split_once("/Grid[") {
            None => Some(grid),
            Some((_, number)) => {
                let number: usize = number.split_once(']')?.0.parse().ok()?;
                let mut below = grids.below.borrow_mut();
                let children = below.entry(name).or_insert_with(|| self.document.below(grid, "Grid").collect());
                children.get(number.checked_sub(1)?).copied()
            }
        }
    }

    /// Equal elements with equal items.
    fn same(&self, a: &Element, b: &Element) -> bool {
        let items = |e| self.document.below(e, "DataItem").map(|i| (&i.attributes, i.text.trim())).collect::<Vec<_>>();
        std::ptr::eq(a, b) || (a.attributes == b.attributes && items(a) == items(b))
    }

    /// The one DataItem of an element.
    fn only_item(&self, element: &Element, object: &str) -> Result<Item, ImportError> {
        let items: Vec<&Element> = self.document.below(element, "DataItem").collect();
        match items[..] {
            [item] => self.folder.item(item, object),
            _ => self.refuse(object, format!("{} data items", items.len()), "one", "export the file again"),
        }
    }

    fn points(&self, geometry: &Element) -> Result<Vec<Vector3<f64>>, ImportError> {
        const OBJECT: &str = "Geometry";
        let kind = geometry.attribute("GeometryType").or(geometry.attribute("Type")).unwrap_or("XYZ");
        if !kind.eq_ignore_ascii_case("XYZ") {
            let found = format!("the type {}", printable(kind));
            return self.refuse(OBJECT, found, "XYZ", "export three coordinates per node in one array (N, 3)");
        }
        let item = self.only_item(geometry, OBJECT)?;
        let count = item.len() / 3;
        if item.dimensions.len() != 2 || item.dimensions[1] != 3 || count == 0 || count > COUNT_LIMIT {
            let found = format!("an array of extents {:?}", item.dimensions);
            return self.refuse(OBJECT, found, "extents [N, 3] with N from 1 to 50 million", "export three coordinates per node");
        }
        let values = self.folder.numbers(&item)?;
        match values.iter().position(|v| !(v.abs() <= 1e100)) {
            None => Ok(values.chunks_exact(3).map(Vector3::from_column_slice).collect()),
            Some(at) => self.refuse(OBJECT, format!("{:e} at node {}", values[at], at / 3), "finite coordinates", "repair the export"),
        }
    }

    fn cells(&self, topology: &Element, nodes: usize) -> Result<Vec<CellBlock>, ImportError> {
        const OBJECT: &str = "Topology";
        let word = topology.attribute("TopologyType").or(topology.attribute("Type")).unwrap_or_default();
        let item = self.only_item(topology, OBJECT)?;
        let order = topology.attribute("Order").or(topology.attribute("BaseOffset")).is_some_and(|text| text.trim() != "0");
        if order {
            return self.refuse(
                OBJECT,
                "an order or offset of its own",
                "nodes counted from 0 in VTK order",
                "export it again without them",
            );
        }
        let blocks = if word.eq_ignore_ascii_case("Mixed") {
            let stream = self.folder.integers(&item)?;
            self.mixed(&stream, nodes)?
        } else {
            let Some(kind) = CellKind::from_xdmf(word) else {
                let known = "Triangle, Quadrilateral, Tetrahedron, Pyramid, Wedge, Hexahedron, their quadratic forms, or Mixed";
                return self.refuse(OBJECT, format!("the type \"{}\"", printable(word)), known, "export cells of a known type");
            };
            if item.dimensions.len() != 2 || item.dimensions[1] != kind.node_count() {
                let found = format!("an array of extents {:?}", item.dimensions);
                let expected = format!("extents [E, {}] of {}", kind.node_count(), kind.name());
                return self.refuse(OBJECT, found, &expected, "export the connectivity in two dimensions, as meshio does");
            }
            let indices = self.folder.integers(&item)?;
            vec![CellBlock { kind, nodes: indices.iter().map(|&node| self.node(node, nodes)).collect::<Result<_, _>>()? }]
        };
        // older files count cells in either attribute; a number that disagrees means that one of both is damaged
        let stated = topology.attribute("NumberOfElements").and_then(|text| text.trim().parse::<usize>().ok());
        let found = blocks.iter().map(|block| block.cells().len()).sum::<usize>();
        match stated.filter(|&stated| stated != found) {
            None => Ok(blocks),
            Some(stated) => {
                self.refuse(OBJECT, format!("{found} cells"), &format!("{stated} as NumberOfElements says"), "export the file again")
            }
        }
    }

    fn node(&self, node: i64, nodes: usize) -> Result<usize, ImportError> {
        match usize::try_from(node) {
            Ok(index) if index < nodes => Ok(index),
            _ => self.refuse("Topology", format!("node {node}"), &format!("0 to {}", nodes - 1), "count nodes from 0, or export again"),
        }
    }

    /// A stream of type numbers and nodes, as neighbours of one kind in one block each.
    fn mixed(&self, stream: &[i64], nodes: usize) -> Result<Vec<CellBlock>, ImportError> {
        let mut blocks: Vec<CellBlock> = Vec::new();
        let mut at = 0;
        while at < stream.len() {
            let number = stream[at];
            let Some(kind) = CellKind::from_xdmf_number(number) else {
                let found = format!("the type number {number} at position {at}");
                return self.refuse("Topology", found, "a known cell type", "export cells of types that VTK and XDMF share");
            };
            at += 1;
            // the stream states the number of nodes of polylines
            if kind == CellKind::Line2 {
                if stream.get(at) != Some(&2) {
                    return self.refuse("Topology", "a polyline of other than two nodes", "lines of two nodes", "export lines one by one");
                }
                at += 1;
            }
            let Some(cell) = stream.get(at..at + kind.node_count()) else {
                let found = format!("{} numbers after the last {}", stream.len() - at, kind.name());
                return self.refuse("Topology", found, &kind.node_count().to_string(), "export the file again; it was cut short");
            };
            at += kind.node_count();
            let cell = cell.iter().map(|&node| self.node(node, nodes)).collect::<Result<Vec<_>, _>>()?;
            match blocks.last_mut().filter(|block| block.kind == kind) {
                Some(block) => block.nodes.extend(cell),
                None => blocks.push(CellBlock { kind, nodes: cell }),
            }
        }
        Ok(blocks)
    }

    /// Attributes on nodes and cells, gathered over the steps.
    fn fields(&self, steps: &[&Element], times: &[f64]) -> Result<(Vec<Field>, Vec<Item>), ImportError> {
        let mut fields: Vec<Field> = Vec::new();
        let mut by_name: BTreeMap<(String, bool), usize> = BTreeMap::new();
        let mut items = Vec::new();
        for (number, grid) in steps.iter().enumerate() {
            let time = self.time(grid)?.or_else(|| times.get(number).copied());
            for attribute in self.document.below(grid, "Attribute") {
                let place = match attribute.attribute("Center").unwrap_or("Node").to_ascii_lowercase().as_str() {
                    "node" => FieldPlace::Node,
                    "cell" => FieldPlace::Cell,
                    _ => continue,
                };
                let Some(name) = attribute.attribute("Name") else {
                    return self.refuse("Attribute", "no name", "a Name", "name every field");
                };
                let object = format!("Attribute \"{}\"", printable(name));
                let item = self.only_item(attribute, &object)?;
                let width: usize = item.dimensions[1..].iter().product();
                if width == 0 || width > 64 {
                    return self.refuse(&object, format!("{width} components"), "1 to 64", "export the field again");
                }
                let step = FieldStep { number: number as i64 + 1, time, key: items.len() };
                items.push(item);
                let next = fields.len();
                let index = *by_name.entry((name.to_owned(), place == FieldPlace::Node)).or_insert(next);
                if index == next {
                    fields.push(Field { name: name.to_owned(), place, components: vec![String::new(); width], steps: Vec::new() });
                }
                let field = &mut fields[index];
                if field.components.len() != width {
                    let expected = format!("{} as in the steps before", field.components.len());
                    return self.refuse(&object, format!("{width} components"), &expected, "export all steps alike");
                }
                if field.steps.last().is_some_and(|last| last.number == step.number) {
                    return self.refuse(&object, "the name twice in one grid", "each name once", "give every field a name of its own");
                }
                field.steps.push(step);
            }
        }
        Ok((fields, items))
    }

    fn time(&self, grid: &Element) -> Result<Option<f64>, ImportError> {
        let Some(time) = self.document.below(grid, "Time").next() else { return Ok(None) };
        let text = time.attribute("Value").unwrap_or_default();
        match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Some(value)),
            _ => self.refuse("Time", format!("the value {}", listed([text])), "a number", "write the frequency as Time Value"),
        }
    }
}

/// Type of a grid in lower case.
fn kind(grid: &Element) -> String {
    grid.attribute("GridType").unwrap_or("Uniform").to_ascii_lowercase()
}
