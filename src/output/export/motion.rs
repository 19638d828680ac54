//! A finished run as XDMF: one temporal collection per flexible body and one for the loads.
//!
//! A body's grid is its deformed surface where it stands in the world, so that viewers show the motion as it is. Its fields are the
//! position in the world, the displacement by deformation in body axes, and the von Mises stress of the summed tensor. Loads are
//! vectors in the world at the points where they act.

use super::error::ExportError;
use super::modal_source::{ModalSource, unescape};
use super::xdmf::{Attribute, Grid, Item, Number, write_collection};
use super::{BLOCK_ROWS, Exported, check_target};
use crate::io::ResultsReader;
use crate::io::field_file::FieldFile;
use crate::io::results_reader::UsedModalFile;
use crate::model::{ModeBasis, Surface};
use crate::spatial::rotation::{matrix_of_quaternion, normalized};
use nalgebra::{DMatrix, Matrix3, Vector3};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Name of the arrays' file in the folder.
const FIELDS: &str = "fields.h5";
/// Name of the loads' collection, and its group in the arrays' file.
const LOADS: &str = "loads";

/// What to export, and whereto.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Folder for all files.
    pub folder: PathBuf,
    /// Names of flexible bodies; all if empty.
    pub bodies: Vec<String>,
    /// Take every n-th output time, from the first on; at least 1.
    pub every: usize,
    /// Where modal files may be.
    pub modal: ModalSource,
}

/// Writes all collections of `results`.
///
/// # Errors
/// If the results file or a modal file cannot be read, a body is not there, a target is an input, or a file cannot be written.
pub fn write_motion(results: &ResultsReader, motion: &Motion) -> Result<Exported, ExportError> {
    if results.rows == 0 {
        return Err(ExportError::NoTimes { file: results.path().to_owned() });
    }
    let chosen = chosen_bodies(results, &motion.bodies)?;
    let points = load_points(results)?;
    if chosen.is_empty() && points.is_empty() {
        return Err(ExportError::NothingToDraw { file: results.path().to_owned() });
    }
    let mut names = Names::default();
    let mut bodies = Vec::new();
    for used in chosen {
        let modal = motion.modal.open(results, used)?;
        bodies.push((BodyTrack::of(results, used, &modal, names.take(&unescape(&used.body)))?, modal.path().to_owned()));
    }
    let target = |name: &str| motion.folder.join(name);
    let mut inputs = vec![results.path().to_owned()];
    inputs.extend(bodies.iter().map(|(_, path)| path.clone()));
    check_target(&target(FIELDS), &inputs)?;
    let made = std::fs::create_dir_all(&motion.folder);
    made.map_err(|e| ExportError::Write { file: motion.folder.clone(), cause: e.to_string() })?;

    let time = results.column("time", None)?.read(0..results.rows)?;
    let time: Vec<f64> = time.into_iter().step_by(motion.every).collect();
    let mut fields = FieldFile::create(&target(FIELDS))?;
    let mut exported = Exported { files: vec![target(FIELDS)], times: time.len(), left_out: Vec::new() };
    for (body, _) in &bodies {
        body.write(results, motion.every, &mut fields)?;
        let path = target(&format!("{}.xdmf", body.name));
        write_collection(&path, &body.name, &body.texts(), time.iter().enumerate().map(|(step, &t)| body.grid(step, t)))?;
        if body.surface.stress.is_none() {
            exported.left_out.push(format!("von Mises stress of {}: its modal file has no stress modes", body.label));
        }
        exported.files.push(path);
    }
    if points.is_empty() {
        exported.left_out.push("loads: the run has none".into());
    } else {
        write_loads(results, &points, motion.every, &mut fields)?;
        let path = target(&format!("{LOADS}.xdmf"));
        let names = points.iter().map(|p| p.name.as_str()).collect::<Vec<_>>().join("; ");
        let texts =
            [("index", names), ("moment_world", "N m, about the point, world axes".into()), ("force_world", "N, world axes".into())];
        write_collection(&path, LOADS, &texts, time.iter().enumerate().map(|(step, &t)| load_grid(points.len(), step, t)))?;
        exported.files.push(path);
    }
    fields.finish()?;
    Ok(exported)
}

/// Flexible bodies by name, all if none is named.
fn chosen_bodies<'r>(results: &'r ResultsReader, names: &[String]) -> Result<Vec<&'r UsedModalFile>, ExportError> {
    if names.is_empty() {
        return Ok(results.modal_files.iter().collect());
    }
    let mut chosen: Vec<&UsedModalFile> = Vec::new();
    for name in names {
        let Some(used) = results.modal_files.iter().find(|used| unescape(&used.body) == *name) else {
            let known = results.modal_files.iter().map(|used| unescape(&used.body)).collect::<Vec<_>>();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            return Err(ExportError::NoBody { file: results.path().to_owned(), body: name.clone(), known });
        };
        if !chosen.contains(&used) {
            chosen.push(used);
        }
    }
    Ok(chosen)
}

/// Names that can be those of files and groups: letters, digits, dot, dash and underscore, each once.
#[derive(Debug, Default)]
struct Names(BTreeSet<String>);

impl Names {
    fn take(&mut self, name: &str) -> String {
        let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() || "._-".contains(c) { c } else { '_' }).collect();
        let plain = if plain.trim_matches('.').is_empty() { "body".to_owned() } else { plain };
        let mut found = plain.clone();
        let mut count = 1;
        while found.eq_ignore_ascii_case(LOADS) || !self.0.insert(found.to_lowercase()) {
            count += 1;
            found = format!("{plain}_{count}");
        }
        found
    }
}

/// A flexible body over time.
struct BodyTrack {
    /// Name in the scene.
    label: String,
    /// Name of files and groups.
    name: String,
    /// Group of its series.
    group: String,
    surface: Surface,
}

impl BodyTrack {
    fn of(results: &ResultsReader, used: &UsedModalFile, modal: &crate::io::ModalFile, name: String) -> Result<Self, ExportError> {
        let group = format!("bodies/{}", used.body);
        let basis = match results.find(&format!("{group}/modal_position")) {
            // a flexible body that the run made rigid
            None => ModeBasis::whole(Vec::new(), modal.header().mode_count),
            Some(series) => {
                basis(series.text("components").unwrap_or_default(), series.width, used, modal).ok_or_else(|| ExportError::WrongText {
                    file: results.path().to_owned(),
                    object: format!("{}@components", series.path),
                    found: format!("\"{}\"", series.text("components").unwrap_or_default()),
                    expected: "\"mode N\" or \"residual mode N\" for each of its numbers, of the modes that are there",
                })?
            }
        };
        Ok(Self { label: unescape(&used.body), name, group, surface: modal.read_surface_in(&basis)? })
    }

    fn write(&self, results: &ResultsReader, every: usize, fields: &mut FieldFile) -> Result<(), ExportError> {
        let (surface, modes) = (&self.surface, self.surface.displacement.len());
        let position = results.column(&format!("{}/position", self.group), Some(3))?;
        let quaternion = results.column(&format!("{}/quaternion", self.group), Some(4))?;
        let eta = if modes > 0 { Some(results.column(&format!("{}/modal_position", self.group), Some(modes))?) } else { None };
        let mut world = vec![[0.0_f64; 3]; surface.points.len()];
        let mut moved = vec![[0.0_f64; 3]; surface.points.len()];
        let mut single = vec![[0.0_f32; 3]; surface.points.len()];
        let mut stress = vec![0.0_f32; surface.points.len()];
        let triangles: Vec<[i32; 3]> = surface.triangles.iter().map(|t| t.map(|node| node as i32)).collect();
        fields.write_rows(&self.name, "triangles", &triangles)?;
        for start in (0..results.rows).step_by(BLOCK_ROWS) {
            let rows = start..results.rows.min(start + BLOCK_ROWS);
            let (position, quaternion) = (position.read(rows.clone())?, quaternion.read(rows.clone())?);
            let eta = eta.as_ref().map_or(Ok(Vec::new()), |eta| eta.read(rows.clone()))?;
            for (i, row) in rows.enumerate().filter(|(_, row)| row.is_multiple_of(every)) {
                let rotation = rotation(&quaternion[4 * i..4 * i + 4]);
                let origin = Vector3::from_column_slice(&position[3 * i..3 * i + 3]);
                let eta = &eta[modes * i..modes * (i + 1)];
                surface.displace(eta, &mut moved);
                for (((x, u), out), point) in world.iter_mut().zip(&moved).zip(&mut single).zip(&surface.points) {
                    *x = (origin + rotation * (Vector3::from(*point) + Vector3::from(*u))).into();
                    *out = u.map(|u| u as f32);
                }
                let step = step_name(row / every);
                fields.write_rows(&format!("{}/position_world", self.name), &step, &world)?;
                fields.write_rows(&format!("{}/displacement_body", self.name), &step, &single)?;
                if surface.stress.is_some() {
                    surface.point_stress(eta, &mut stress);
                    fields.write_scalars(&format!("{}/von_mises", self.name), &step, &stress)?;
                }
            }
        }
        Ok(())
    }

    fn texts(&self) -> [(&'static str, String); 4] {
        [
            ("body", self.label.clone()),
            ("position_world", "m, deformed and moved, world axes".into()),
            ("displacement_body", "m, by deformation alone, body axes".into()),
            ("von_mises", "Pa, of the summed stress tensor".into()),
        ]
    }

    fn grid(&self, step: usize, time: f64) -> Grid<'_> {
        let nodes = self.surface.points.len();
        let item = |quantity: &str, number, shape| Item {
            file: FIELDS,
            path: format!("/{}/{quantity}/{}", self.name, step_name(step)),
            number,
            shape,
        };
        let node = |name: &str, item| Attribute { name: name.to_owned(), center: "Node", item };
        let mut attributes = vec![
            node("position_world", item("position_world", Number::F8, vec![nodes, 3])),
            node("displacement_body", item("displacement_body", Number::F4, vec![nodes, 3])),
        ];
        if self.surface.stress.is_some() {
            attributes.push(node("von_mises", item("von_mises", Number::F4, vec![nodes])));
        }
        let cells = vec![self.surface.triangles.len(), 3];
        Grid {
            name: self.name.clone(),
            time: Some(time),
            topology: ("Triangle", Item { file: FIELDS, path: format!("/{}/triangles", self.name), number: Number::I4, shape: cells }),
            points: item("position_world", Number::F8, vec![nodes, 3]),
            attributes,
        }
    }
}

/// A hinge or closure with a load.
struct LoadPoint {
    name: String,
    group: String,
}

/// All hinges and closures whose loads are in the file; gears act on no point.
fn load_points(results: &ResultsReader) -> Result<Vec<LoadPoint>, ExportError> {
    let mut points = Vec::new();
    for kind in ["hinges", "closures"] {
        for step in results.children(kind) {
            let group = format!("{kind}/{step}");
            if results.find(&format!("{group}/load_moment")).is_none() {
                continue;
            }
            for needed in ["load_point", "load_quaternion"] {
                let object = format!("{group}/{needed}");
                if results.find(&object).is_none() {
                    return Err(ExportError::NoPose { file: results.path().to_owned(), object });
                }
            }
            points.push(LoadPoint { name: unescape(step), group });
        }
    }
    Ok(points)
}

fn write_loads(results: &ResultsReader, points: &[LoadPoint], every: usize, fields: &mut FieldFile) -> Result<(), ExportError> {
    const SERIES: [(&str, usize); 4] = [("load_point", 3), ("load_quaternion", 4), ("load_moment", 3), ("load_force", 3)];
    let of_point = |point: &LoadPoint| {
        let [a, b, c, d] = SERIES.map(|(name, width)| results.column(&format!("{}/{name}", point.group), Some(width)));
        Ok([a?, b?, c?, d?])
    };
    let columns = points.iter().map(of_point).collect::<Result<Vec<_>, ExportError>>()?;
    let vertices: Vec<[i32; 1]> = (0..points.len()).map(|i| [i as i32]).collect();
    fields.write_rows(LOADS, "vertices", &vertices)?;
    fields.write_scalars(LOADS, "index", &vertices.iter().map(|v| v[0]).collect::<Vec<_>>())?;
    let mut out = [(); 3].map(|()| vec![[0.0_f64; 3]; points.len()]);
    for start in (0..results.rows).step_by(BLOCK_ROWS) {
        let rows = start..results.rows.min(start + BLOCK_ROWS);
        let read = |columns: &[crate::io::results_reader::Column<'_>; 4]| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| columns[i].read(rows.clone()));
            Ok([a?, b?, c?, d?])
        };
        let blocks = columns.iter().map(read).collect::<Result<Vec<_>, ExportError>>()?;
        for (i, row) in rows.clone().enumerate().filter(|(_, row)| row.is_multiple_of(every)) {
            for (k, [point, quaternion, moment, force]) in blocks.iter().enumerate() {
                let rotation = rotation(&quaternion[4 * i..4 * i + 4]);
                let triple = |values: &[f64]| Vector3::from_column_slice(&values[3 * i..3 * i + 3]);
                out[0][k] = triple(point).into();
                out[1][k] = (rotation * triple(moment)).into();
                out[2][k] = (rotation * triple(force)).into();
            }
            for (name, values) in ["position_world", "moment_world", "force_world"].into_iter().zip(&out) {
                fields.write_rows(&format!("{LOADS}/{name}"), &step_name(row / every), values)?;
            }
        }
    }
    Ok(())
}

fn load_grid(count: usize, step: usize, time: f64) -> Grid<'static> {
    let at = |path: String, number, shape| Item { file: FIELDS, path, number, shape };
    let vectors = |name: &str| at(format!("/{LOADS}/{name}/{}", step_name(step)), Number::F8, vec![count, 3]);
    let node = |name: &str, item| Attribute { name: name.to_owned(), center: "Node", item };
    Grid {
        name: LOADS.into(),
        time: Some(time),
        topology: ("Polyvertex", at(format!("/{LOADS}/vertices"), Number::I4, vec![count, 1])),
        points: vectors("position_world"),
        attributes: vec![
            node("moment_world", vectors("moment_world")),
            node("force_world", vectors("force_world")),
            node("index", at(format!("/{LOADS}/index"), Number::I4, vec![count])),
        ],
    }
}

fn step_name(step: usize) -> String {
    format!("{step:06}")
}

fn rotation(quaternion: &[f64]) -> Matrix3<f64> {
    matrix_of_quaternion(&normalized(&[quaternion[0], quaternion[1], quaternion[2], quaternion[3]]))
}

/// The modes that a run retained: those named, and the residual modes that the results file keeps.
fn basis(names: &str, width: Option<usize>, used: &UsedModalFile, modal: &crate::io::ModalFile) -> Option<ModeBasis> {
    let available = modal.header().mode_count;
    let residual = used.residual_modes.clone().unwrap_or_else(|| DMatrix::zeros(available, 0));
    let count = width?.checked_sub(residual.ncols())?;
    let whole: Vec<_> = names.split(',').take(count).collect();
    let rest = names.split(',').skip(count).all(|name| name.trim().starts_with("residual mode "));
    let whole = if count == 0 { Vec::new() } else { mode_numbers(&whole.join(","), Some(count))? };
    let exist = whole.iter().all(|j| *j < available);
    (rest && exist && residual.nrows() == available && names.split(',').count() == width?).then_some(ModeBasis { whole, residual })
}

/// 0-based numbers of "mode 1, mode 5", as many as the series has columns.
fn mode_numbers(text: &str, width: Option<usize>) -> Option<Vec<usize>> {
    let number = |part: &str| part.trim().strip_prefix("mode ")?.parse::<usize>().ok()?.checked_sub(1);
    let modes = text.split(',').map(number).collect::<Option<Vec<_>>>()?;
    (Some(modes.len()) == width).then_some(modes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_plain_and_each_stands_once() {
        let mut names = Names::default();
        let taken = ["left/drive", "left drive", "loads", "..", "Panel", "panel"].map(|name| names.take(name));
        assert_eq!(taken, ["left_drive", "left_drive_2", "loads_2", "body", "Panel", "panel_2"]);
    }

    #[test]
    fn modes_are_read_from_the_names_of_the_components() {
        assert_eq!(mode_numbers("mode 1, mode 5", Some(2)), Some(vec![0, 4]));
        assert_eq!(mode_numbers("mode 1, mode 5", Some(3)), None);
        assert_eq!(mode_numbers("mode 0", Some(1)), None);
        // the text was cut at its limit
        assert_eq!(mode_numbers("mode 1, mo", Some(2)), None);
    }
}
