//! From a scene to the plan of its outputs: surfaces are read here, and only where a picture or a stress figure wants them.

use super::plan::{BodyBox, BodySurface, ModalFileRecord, OutputPlan, TruncationPlan};
use crate::io::ModalFileError;
use crate::model::{BodyKind, ModeBasis, Surface, System};
use crate::scene::{Monitor, Scene};
use std::collections::HashMap;
use std::sync::Arc;

/// The plan of `scene`; with `picture`, surfaces of all flexible bodies are read, else only those whose stress is wanted.
///
/// # Errors
/// If the surface of a modal file cannot be read.
pub fn plan(scene: &Scene, picture: bool) -> Result<OutputPlan, ModalFileError> {
    // bodies of one file and one choice of modes share their basis
    let mut shared: HashMap<*const ModeBasis, Arc<Surface>> = HashMap::new();
    let mut surfaces = Vec::new();
    let mut modal_files = Vec::new();
    for (body, selection) in &scene.flexible {
        modal_files.push(ModalFileRecord {
            body: scene.system.bodies[*body].name.clone(),
            path: selection.file.path().display().to_string(),
            content_sha256: selection.content_sha256.clone(),
            residual_modes: selection.basis.has_residual().then(|| selection.basis.residual.clone()),
        });
        let stress = selection.basis.mode_count() > 0 && (scene.stress.contains(body) || scene.monitors_stress(*body));
        if picture || stress {
            let key = Arc::as_ptr(&selection.basis);
            let surface = match shared.get(&key) {
                Some(surface) => Arc::clone(surface),
                None => {
                    let surface = Arc::new(selection.file.read_surface_in(&selection.basis)?);
                    shared.insert(key, Arc::clone(&surface));
                    surface
                }
            };
            surfaces.push(BodySurface { body: *body, surface, stress });
        }
    }
    let truncation = if scene.truncation { truncation(scene, &surfaces)? } else { None };
    let box_of = |(k, size): (usize, &Option<[f64; 3]>)| {
        size.map(|size| {
            let body = &scene.system.bodies[k];
            // centred on the mass, as the cuboid of equal inertia would be
            let center = match &body.kind {
                BodyKind::Rigid(inertia) if body.mass() > 0.0 => {
                    let c = inertia.first_moment() / body.mass();
                    body.frame_rotation.tr_mul(&(c - body.frame_position))
                }
                _ => nalgebra::Vector3::zeros(),
            };
            BodyBox { body: k, size, center: center.into() }
        })
    };
    Ok(OutputPlan {
        scene_name: scene.name.clone(),
        scene_text: scene.source.text.clone(),
        modal_files,
        hinges: scene.hinges.clone(),
        closures: scene.closures.clone(),
        surfaces,
        boxes: scene.boxes.iter().enumerate().filter_map(box_of).collect(),
        monitors: scene.monitors.iter().filter(|m| is_there(m, &scene.system)).copied().collect(),
        deformation_scale: scene.deformation_scale,
        audit: scene.audit,
        truncation,
        warnings: scene.warnings.clone(),
    })
}

/// False for the stress of a body that retains no mode.
fn is_there(monitor: &Monitor, system: &System) -> bool {
    !matches!(*monitor, Monitor::Body { body, .. } if system.bodies[body].mode_count() == 0)
}

/// The modes that `scene` leaves out, with their stress where that of their body is evaluated.
fn truncation(scene: &Scene, surfaces: &[BodySurface]) -> Result<Option<TruncationPlan>, ModalFileError> {
    let Some(modes) = scene.left_out_modes() else { return Ok(None) };
    let stress_of = |surface: &BodySurface| {
        let place = modes.bodies.iter().position(|left| left.body == surface.body).filter(|_| surface.stress);
        let selection = scene.flexible.iter().find(|(body, _)| *body == surface.body);
        let (Some(place), Some((_, selection))) = (place, selection) else { return Ok(None) };
        let rest = ModeBasis { whole: Vec::new(), residual: modes.bodies[place].rest.clone() };
        let stress = selection.file.read_surface_in(&rest)?.stress;
        Ok(stress.map(|stress| (Arc::new(stress), place)))
    };
    let stress = surfaces.iter().map(stress_of).collect::<Result<_, ModalFileError>>()?;
    Ok(Some(TruncationPlan { modes: Arc::new(modes), stress }))
}
