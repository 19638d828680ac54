//! From a file of another code to a modal file: the steps in order, and a report of what was carried, approximated and left out.

use super::error::{ImportError, printable, refused};
use super::interface_fit::{Fit, fit, select};
use super::lumping::{Tensors, nodal_mass};
use super::mesh::ForeignModel;
use super::modes;
use super::options::{ImportOptions, InterfaceRequest};
use super::orthonormalise::orthonormalise;
use super::write::{BodyParts, PlacedInterface, contents};
use super::{boundary, med, surface, xdmf};
use crate::io::{Coupling, Examination, ModalFile, examine};
use std::path::{Path, PathBuf};

/// What an import did.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportReport {
    /// The imported file.
    pub file: PathBuf,
    /// Every file that was read.
    pub inputs: Vec<PathBuf>,
    /// "XDMF" or "MED".
    pub format: &'static str,
    /// Nodes and modes.
    pub sizes: (usize, usize),
    /// kg.
    pub mass: f64,
    /// Largest relative change of the modal mass of any combination of modes by the nodal masses: what lumping changes, to first order.
    pub departure: f64,
    /// What was taken over as it is.
    pub carried: Vec<String>,
    /// What was approximated or changed, with figures.
    pub approximated: Vec<String>,
    /// What was left out.
    pub left_out: Vec<String>,
}

/// A checked modal file with the report of its making.
#[derive(Debug)]
pub struct ImportedBody {
    /// What was done.
    pub report: ImportReport,
    /// The modal file, read back and held against every rule.
    pub examination: Examination,
}

/// Imports a file into the modal file `out`, which takes its name only once it has passed every rule.
///
/// # Errors
/// If the file cannot be read, something that is needed is missing, or the body breaks a rule of modal files.
pub fn import_to(file: &Path, options: &ImportOptions, out: &Path) -> Result<ImportedBody, ImportError> {
    let fail = |cause: String| ImportError::Output { file: out.to_owned(), cause };
    // a folder that cannot be written is known before the work
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".import").suffix(".h5");
    // readable as any new file is; the default is the owner's eyes only
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let partial = builder.tempfile_in(folder).map_err(|e| fail(e.to_string()))?.into_temp_path();
    let report = write(file, options, &partial)?;
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    // a series NAME.xdmf has its numbers in NAME.h5
    if report.inputs.iter().any(|input| real(input) == real(out)) {
        return Err(fail("it is a file that is imported".to_owned()));
    }
    accept(file, &partial)?;
    partial.persist(out).map_err(|e| fail(e.error.to_string()))?;
    Ok(ImportedBody { report, examination: examine(out) })
}

/// Imports a file into a modal file of its own that goes away with the value.
///
/// # Errors
/// As [`import_to`].
pub fn import(file: &Path, options: &ImportOptions) -> Result<(ModalFile, crate::model::modal_body::ModalBody), ImportError> {
    let fail = |cause: String| ImportError::Output { file: std::env::temp_dir(), cause };
    let scratch = tempfile::Builder::new().prefix("pliant").suffix(".h5").tempfile().map_err(|e| fail(e.to_string()))?.into_temp_path();
    let report = write(file, options, &scratch)?;
    let (modal_file, body) = accept(file, &scratch)?;
    Ok((modal_file.made_from(file, report.inputs, scratch), body))
}

/// The written file, if it breaks no rule.
fn accept(file: &Path, written: &Path) -> Result<(ModalFile, crate::model::modal_body::ModalBody), ImportError> {
    examine(written).into_accepted().map_err(|error| {
        // the file that was written goes away; the one that the user knows is named instead
        let text = error.to_string().replace(&format!("{}: ", written.display()), "");
        ImportError::Rule { file: file.to_owned(), cause: text }
    })
}

/// Reads a file by its extension.
fn read(file: &Path, options: &ImportOptions) -> Result<ForeignModel, ImportError> {
    match file.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
        Some("xdmf" | "xmf") => xdmf::read(file),
        Some("med" | "rmed") => med::read(file, options.mesh.as_deref()),
        other => {
            let found = other.map_or("no extension".to_owned(), |e| format!("the extension .{}", printable(e)));
            let remedy = "rename the file, or convert it, for example with meshio; a modal file (.h5) needs no import";
            Err(refused(file, "the file", found, "XDMF (.xdmf, .xmf) or MED (.med, .rmed)", remedy))
        }
    }
}

fn write(file: &Path, options: &ImportOptions, out: &Path) -> Result<ImportReport, ImportError> {
    let mut model = read(file, options)?;
    if model.dimension() < 2 {
        let found = if model.dimension() == 0 { "no cells" } else { "lines only" };
        return Err(refused(file, "the mesh", found, "volume or surface cells", "export the mesh with its cells"));
    }
    let turned = surface::orient(&mut model)?;
    let outer = surface::outer_facets(&model);

    let root = options.root.as_deref().unwrap_or("root");
    let fits = interfaces(&model, options, root, &outer)?;
    let origin = fits.iter().find(|(name, ..)| name == root).map(|(_, _, fit)| fit.position).unwrap_or_default();
    model.points.iter_mut().for_each(|point| *point -= origin);
    let mut nodal = nodal_mass(&model, options.mass.as_ref())?;

    let modes = modes::read(&model, options)?;
    let mut report = ImportReport {
        file: file.to_owned(),
        inputs: model.source.files(),
        format: model.format,
        sizes: (model.points.len(), modes.frequency_hz.len()),
        mass: nodal.mass.iter().sum(),
        departure: 0.0,
        carried: Vec::new(),
        approximated: Vec::new(),
        left_out: Vec::new(),
    };
    report.approximated.push(format!("nodal masses {}: {:.6} kg in all", nodal.origin, report.mass));
    let size = model.points.iter().map(nalgebra::Vector3::amax).fold(0.0, f64::max);
    // below that the root sat at the origin but for the rounding of its mean
    if origin.amax() > 1e-12 * size {
        let [x, y, z] = <[f64; 3]>::from(-origin);
        report.approximated.push(format!("moved by [{x:.6}, {y:.6}, {z:.6}] m, so that \"{root}\" is the origin"));
    }
    if turned > 0 {
        report.approximated.push(format!("{turned} cells counted in the other sense"));
    }

    let (mut displacement, mut rotation) = (modes.displacement, modes.rotation);
    let held = boundary::settle(&model, options, &fits, root, &nodal.mass, &mut displacement, rotation.as_mut())?;
    report.approximated.extend(held.note);
    let change = orthonormalise(file, &nodal.mass, &displacement)?;
    report.departure = change.departure;
    let scale = if change.were_normalised { "orthonormality" } else { "orthogonality (the modes came in another scale)" };
    report.approximated.push(format!("modes orthonormalised; they departed from {scale} with these masses by {:.1e}", change.departure));
    report.approximated.push("inertia integrals are sums over nodes".to_owned());
    let displacement = change.apply(&displacement);
    let rotation = rotation.map(|modes| change.apply(&modes));
    let stress = modes.stress.map(|(place, modes)| (place, change.apply(&modes)));
    let mut tensors = Tensors::of(&model.points, &nodal, &displacement);
    // nodal rotations would give rotary inertia modal mass, and modes that fill the whole inertia of the nodes need all of it
    if let Some(rotary) = nodal.rotary
        && (rotation.is_some() || !tensors.modes_fit_the_inertia())
    {
        nodal.rotary = None;
        tensors = Tensors::of(&model.points, &nodal, &displacement);
        let share = rotary.amax() / tensors.inertia.amax();
        report.approximated.push(format!("inertia is that of the nodes, {share:.1e} from that of the geometry"));
    }
    describe(&model, options, &modes.notes, stress.is_some(), rotation.is_some(), &fits, &mut report);

    let title = options.title.clone().unwrap_or_else(|| file.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned()));
    let place = |(name, coupling, fit): (String, Coupling, Fit)| {
        let six = |j: usize| match held.boundary.holds_root() && name == root {
            true => [0.0; 6],
            false => fit.measure(&displacement[j], rotation.as_ref().map(|r| r[j].as_slice())),
        };
        let displacement = (0..displacement.len()).map(six).collect();
        let position = fit.position - origin;
        PlacedInterface { name, coupling, position, nodes: fit.nodes, weights: fit.weights, displacement }
    };
    let interfaces = fits.into_iter().map(place).collect();
    let parts = BodyParts {
        title,
        generator: format!("pliant {} import of {}", env!("CARGO_PKG_VERSION"), model.format),
        boundary: held.boundary,
        root: root.to_owned(),
        frequency_hz: modes.frequency_hz,
        damping_ratio: modes.damping_ratio,
        departure: change.departure,
        nodal,
        tensors,
        interfaces,
        displacement,
        rotation,
        stress,
    };
    let contents = contents(&model, &outer, parts);
    contents.write(out).map_err(|e| ImportError::Output { file: out.to_owned(), cause: e.to_string() })?;
    Ok(report)
}

/// Fits every interface; the root must be one of them.
fn interfaces(
    model: &ForeignModel,
    options: &ImportOptions,
    root: &str,
    outer: &[surface::Facet],
) -> Result<Vec<(String, Coupling, Fit)>, ImportError> {
    if !options.interfaces.contains_key(root) {
        let groups = model.node_groups.keys().chain(model.cell_groups.keys()).map(String::as_str);
        return Err(ImportError::Needed {
            file: model.file.clone(),
            key: format!("interface \"{root}\""),
            found: format!("the groups {}", super::error::listed(groups)),
            remedy: "say which group or box of nodes carries the inboard hinge, or name another interface as root".to_owned(),
        });
    }
    let turning = model_may_turn(model, options);
    let one = |(name, request): (&String, &InterfaceRequest)| {
        if name.is_empty() || name == "." || name == ".." || name.contains(|c: char| c.is_control() || c == '/') {
            let found = format!("the name \"{}\"", printable(name));
            return Err(refused(&model.file, "interface", found, "a printable name without slash", "rename the interface"));
        }
        let fit = fit(model, &select(model, name, &request.selection)?, outer);
        if !fit.turns() && !turning {
            let found = format!("{} nodes on a point or a line", fit.nodes.len());
            let expected = "nodes that are not in line, or a file with nodal rotations";
            return Err(refused(&model.file, format!("interface \"{name}\""), found, expected, "select a face, or export nodal rotations"));
        }
        Ok((name.clone(), request.coupling.unwrap_or(Coupling::Rbe3), fit))
    };
    options.interfaces.iter().map(one).collect()
}

/// True if nodal rotations will be there.
fn model_may_turn(model: &ForeignModel, options: &ImportOptions) -> bool {
    let names = |name: &String| {
        model.field(name).is_some_and(|f| f.components.iter().any(|c| c.eq_ignore_ascii_case("DRX") || c.eq_ignore_ascii_case("RX")))
    };
    options.rotation.is_some() || options.displacement.as_ref().is_some_and(names)
}

/// Lines of the report on what is and what is not in the modal file.
fn describe(
    model: &ForeignModel,
    options: &ImportOptions,
    notes: &[String],
    stress: bool,
    rotation: bool,
    fits: &[(String, Coupling, Fit)],
    report: &mut ImportReport,
) {
    let dimension = model.dimension();
    let kinds: Vec<&str> = model.blocks.iter().filter(|b| b.kind.dimension() == dimension).map(|b| b.kind.name()).collect();
    report.carried.push(format!("{} nodes, cells {}", model.points.len(), kinds.join(", ")));
    let origin = if options.frequency_hz.is_some() { "as given" } else { "from the steps" };
    report.carried.push(format!("{} modes, frequencies {origin}", report.sizes.1));
    if rotation {
        report.carried.push("nodal rotations".to_owned());
    }
    if stress {
        report.carried.push("stress modes".to_owned());
    }
    report.carried.extend(notes.iter().cloned());
    for (name, _, fit) in fits {
        report.carried.push(format!("interface \"{name}\": {} nodes, {} weights", fit.nodes.len(), fit.weighting));
        if fit.idle > 0 {
            report.left_out.push(format!("{} nodes of \"{name}\" that lie on none of its faces", fit.idle));
        }
    }
    if kinds.iter().any(|kind| *kind != kinds[0]) {
        report.approximated.push("cells of several kinds, kept by their corners".to_owned());
    }
    let others: usize = model.blocks.iter().filter(|b| b.kind.dimension() < dimension).map(|b| b.cells().len()).sum();
    if others > 0 {
        report.left_out.push(format!("{others} cells of lower dimension; they carry no mass"));
    }
    if !stress {
        report.left_out.push("stress (no field was named)".to_owned());
    }
    report.left_out.push("geometric stiffness".to_owned());
}
