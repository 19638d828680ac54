//! How the modes were held, and shapes that keep what this promises: no motion of a clamped root, no momentum of free modes.

use super::error::{ImportError, refused};
use super::interface_fit::Fit;
use super::mesh::ForeignModel;
use super::options::ImportOptions;
use crate::io::Coupling;
use crate::model::modal_body::Boundary;
use nalgebra::{Matrix6, Vector3, Vector6};

/// Largest motion of a root that counts as the round-off of a solver, relative to the mode's largest.
const CLAMPED: f64 = 1e-6;
/// Largest share of rigid motion that is taken out of free modes, in the norm of the mass.
const RIGID: f64 = 0.1;

/// What was decided.
#[derive(Debug)]
pub(super) struct Held {
    pub boundary: Boundary,
    /// A line for the report, where the shapes were changed.
    pub note: Option<String>,
}

/// Settles the boundary, and brings the shapes in line with it.
pub(super) fn settle(
    model: &ForeignModel,
    options: &ImportOptions,
    fits: &[(String, Coupling, Fit)],
    root: &str,
    mass: &[f64],
    displacement: &mut [Vec<f64>],
    rotation: Option<&mut Vec<Vec<f64>>>,
) -> Result<Held, ImportError> {
    let nodes = fits.iter().find(|(name, ..)| name == root).map_or(&[][..], |(_, _, fit)| &fit.nodes);
    let rotation = rotation.map_or(&mut [][..], Vec::as_mut_slice);
    let motion = root_motion(displacement, nodes).max(root_motion(rotation, nodes));
    match options.boundary {
        None if motion == 0.0 => Ok(Held { boundary: Boundary::Cantilever, note: None }),
        None => Ok(Held {
            boundary: Boundary::General,
            note: Some(format!("boundary \"general\": the root moves by {motion:.1e} of the largest motion")),
        }),
        Some(Boundary::General) => Ok(Held { boundary: Boundary::General, note: None }),
        Some(boundary @ Boundary::FreeFree) => {
            let share = remove_rigid_motion(&model.points, mass, displacement, rotation).ok_or_else(|| {
                refused(&model.file, "the nodes", "all on one line", "a body with inertia about every axis", "state boundary = \"general\"")
            })?;
            if share > RIGID {
                let (found, expected) =
                    (format!("{share:.1e} of a mode's norm in rigid motion"), format!("at most {RIGID}: modes of the free body"));
                return Err(refused(
                    &model.file,
                    "boundary = \"free-free\"",
                    found,
                    expected,
                    "state how the modes were held, or leave the key out",
                ));
            }
            Ok(Held { boundary, note: Some(format!("rigid motion of {share:.1e} taken out of the free modes")) })
        }
        Some(boundary) if motion <= CLAMPED => {
            for shape in displacement.iter_mut().chain(rotation) {
                nodes.iter().for_each(|&node| shape[3 * node..3 * node + 3].fill(0.0));
            }
            let note = (motion > 0.0).then(|| format!("motion of the clamped root of {motion:.1e} set to zero"));
            Ok(Held { boundary, note })
        }
        Some(boundary) => {
            let (object, found) =
                (format!("boundary = \"{}\"", boundary.name()), format!("a root that moves by {motion:.1e} of the largest motion"));
            let remedy = "name the clamped nodes as the root, or state boundary = \"general\"";
            Err(refused(&model.file, object, found, format!("at most {CLAMPED:.0e}: a clamped root"), remedy))
        }
    }
}

/// Largest motion of some nodes in any mode, relative to the largest of any node in that mode.
fn root_motion(shapes: &[Vec<f64>], nodes: &[usize]) -> f64 {
    let one = |shape: &Vec<f64>| {
        let largest = shape.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        let root = nodes.iter().flat_map(|&node| &shape[3 * node..3 * node + 3]).fold(0.0_f64, |a, v| a.max(v.abs()));
        if root == 0.0 { 0.0 } else { root / largest }
    };
    shapes.iter().map(one).fold(0.0, f64::max)
}

/// Subtracts from every mode the rigid motion that carries its momentum; the largest share of any mode, in the norm of the mass.
fn remove_rigid_motion(points: &[Vector3<f64>], mass: &[f64], displacement: &mut [Vec<f64>], rotation: &mut [Vec<f64>]) -> Option<f64> {
    let total: f64 = mass.iter().sum();
    let center: Vector3<f64> = mass.iter().zip(points).map(|(m, r)| *m * r).sum::<Vector3<f64>>() / total;
    // about the centre of mass translation and rotation do not mix
    let inertia: nalgebra::Matrix3<f64> = mass
        .iter()
        .zip(points)
        .map(|(m, r)| {
            let r = r - center;
            *m * (r.norm_squared() * nalgebra::Matrix3::identity() - r * r.transpose())
        })
        .sum();
    let inverse = inertia.cholesky()?.inverse();
    let mut norm = Matrix6::zeros();
    norm.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(total);
    norm.fixed_view_mut::<3, 3>(3, 3).copy_from(&inertia);
    let mut largest = 0.0_f64;
    for (j, shape) in displacement.iter_mut().enumerate() {
        let vector = |i: usize, shape: &[f64]| Vector3::new(shape[3 * i], shape[3 * i + 1], shape[3 * i + 2]);
        let momentum: Vector3<f64> = mass.iter().enumerate().map(|(i, m)| *m * vector(i, shape)).sum();
        let turning: Vector3<f64> = mass.iter().enumerate().map(|(i, m)| *m * (points[i] - center).cross(&vector(i, shape))).sum();
        let whole: f64 = mass.iter().enumerate().map(|(i, m)| m * vector(i, shape).norm_squared()).sum();
        let (travel, turn) = (momentum / total, inverse * turning);
        let rigid = Vector6::new(travel.x, travel.y, travel.z, turn.x, turn.y, turn.z);
        largest = largest.max((rigid.dot(&(norm * rigid)) / whole.abs().max(f64::MIN_POSITIVE)).sqrt());
        for (i, r) in points.iter().enumerate() {
            let motion = travel + turn.cross(&(r - center));
            (0..3).for_each(|a| shape[3 * i + a] -= motion[a]);
        }
        if let Some(rotation) = rotation.get_mut(j) {
            rotation.chunks_exact_mut(3).for_each(|r| (0..3).for_each(|a| r[a] -= turn[a]));
        }
    }
    Some(largest)
}
