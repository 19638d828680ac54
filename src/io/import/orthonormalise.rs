//! Modes made orthonormal with the mass that the file has.
//!
//! The symmetric (Loewdin) choice `Phi C^(-1/2)`, `C = Phi^T M Phi`, changes the shapes least of all in the norm of the mass; the modes are
//! first scaled to modal mass one, so that their arbitrary scale is no part of the change. Source: P.-O. Loewdin, J. Chem. Phys. 18 (1950) 365.
//! Frequencies are left as the solver gave them. How far `C` is from the identity measures how far the nodal masses are from the mass
//! matrix for which the solver's modes were orthonormal: the error of lumping, to first order.

use super::error::{ImportError, refused};
use super::lumping::modal_mass;
use nalgebra::{DMatrix, SymmetricEigen};
use std::path::Path;

/// Smallest eigenvalue of the correlations: below it modes repeat each other.
const DEPENDENT: f64 = 1e-6;
/// Diagonal modal masses this near to one are those of mass-normalised modes.
const NORMALISED: f64 = 0.1;

/// Smallest eigenvalue of the correlations from which one pass leaves no more than rounding.
const WELL_APART: f64 = 0.5;

/// New modes in terms of the old, and how far the old ones were from orthonormal.
#[derive(Debug)]
pub(super) struct Orthonormal {
    /// One after another: new mode j is the sum over k of old mode k times entry (k, j).
    transforms: Vec<DMatrix<f64>>,
    /// Largest relative change of the modal mass of any combination of modes; of modes in another scale without that of the scale.
    pub departure: f64,
    /// True if the modes came scaled to modal mass one.
    pub were_normalised: bool,
}

/// Of `shapes` (x y z of every node in turn, one per mode) with the nodal masses `mass` (kg).
///
/// # Errors
/// If a mode has no mass, or modes depend on one another.
pub(super) fn orthonormalise(file: &Path, mass: &[f64], shapes: &[Vec<f64>]) -> Result<Orthonormal, ImportError> {
    let (mut change, least) = of_modal_mass(file, &modal_mass(mass, shapes))?;
    if least < WELL_APART {
        // the modal mass squares the condition of the shapes; a second pass over shapes that are all but orthonormal takes back what it cost
        let left = SymmetricEigen::new(modal_mass(mass, &change.apply(shapes)));
        change.transforms.push(inverse_root(&left));
    }
    Ok(change)
}

/// `C^(-1/2)`.
fn inverse_root(eigen: &SymmetricEigen<f64, nalgebra::Dyn>) -> DMatrix<f64> {
    let roots = eigen.eigenvalues.map(|value| 1.0 / value.sqrt());
    &eigen.eigenvectors * DMatrix::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}

/// From the modal mass matrix; the smallest eigenvalue of the correlations beside it.
fn of_modal_mass(file: &Path, modal_mass: &DMatrix<f64>) -> Result<(Orthonormal, f64), ImportError> {
    let n = modal_mass.nrows();
    if let Some(mode) = (0..n).find(|&j| !(modal_mass[(j, j)] > 0.0)) {
        let found = format!("a modal mass of {:.3e}", modal_mass[(mode, mode)]);
        let remedy = "leave the mode out (modes = [...]), or check the nodal masses";
        return Err(refused(file, format!("mode {}", mode + 1), found, "more than zero", remedy));
    }
    let scale: Vec<f64> = (0..n).map(|j| modal_mass[(j, j)].sqrt()).collect();
    let correlation = DMatrix::from_fn(n, n, |j, k| if j == k { 1.0 } else { modal_mass[(j, k)] / (scale[j] * scale[k]) });
    let eigen = SymmetricEigen::new(correlation.clone());
    let least = eigen.eigenvalues.min();
    if !(least > DEPENDENT) {
        let pairs = (0..n).flat_map(|j| (0..j).map(move |k| (k, j)));
        let worst = pairs.max_by(|a, b| correlation[*a].abs().total_cmp(&correlation[*b].abs())).unwrap_or((0, 0));
        let (object, found) = (
            format!("modes {} and {}", worst.0 + 1, worst.1 + 1),
            format!("shapes that depend on one another or on further modes (correlation {:.6})", correlation[worst]),
        );
        let remedy = "leave one of them out (modes = [...]), or check the nodal masses";
        return Err(refused(file, object, found, "modes that are independent with these masses", remedy));
    }
    let inverse_root = inverse_root(&eigen);
    let transform = DMatrix::from_fn(n, n, |k, j| inverse_root[(k, j)] / scale[k]);
    let were_normalised = scale.iter().all(|s| (s * s - 1.0).abs() <= NORMALISED);
    // no combination of modes changes its modal mass by more: the largest departure of an eigenvalue from one
    let spread = |eigenvalues: &nalgebra::DVector<f64>| eigenvalues.iter().map(|value| (value - 1.0).abs()).fold(0.0, f64::max);
    let departure = spread(&if were_normalised { modal_mass.clone().symmetric_eigenvalues() } else { eigen.eigenvalues });
    Ok((Orthonormal { transforms: vec![transform], departure, were_normalised }, least))
}

impl Orthonormal {
    /// Applies the change to one quantity of every mode.
    pub fn apply(&self, modes: &[Vec<f64>]) -> Vec<Vec<f64>> {
        self.transforms.iter().fold(modes.to_vec(), |modes, transform| combined(transform, &modes))
    }
}

fn combined(transform: &DMatrix<f64>, modes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let combine = |j: usize| {
        let mut sum = vec![0.0; modes.first().map_or(0, Vec::len)];
        for (k, mode) in modes.iter().enumerate() {
            let factor = transform[(k, j)];
            sum.iter_mut().zip(mode).for_each(|(s, v)| *s += factor * v);
        }
        sum
    };
    (0..modes.len()).map(combine).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASS: [f64; 3] = [1.0, 2.0, 0.5];

    fn shapes() -> Vec<Vec<f64>> {
        vec![vec![0.0, 0.0, 1.0, 0.1, 0.0, 0.4, 0.0, 0.0, 0.0], vec![0.0, 0.3, -1.0, 0.0, 0.0, 0.8, 0.2, 0.0, 1.0]]
    }

    #[test]
    fn the_new_modes_are_orthonormal_with_the_mass() {
        let old = shapes();
        let result = orthonormalise(Path::new("a.med"), &MASS, &old).unwrap();
        let new = result.apply(&old);
        assert!((modal_mass(&MASS, &new) - DMatrix::identity(2, 2)).amax() < 1e-14);
        // both were scaled at will
        assert!(!result.were_normalised && result.departure > 0.0);
        let again = orthonormalise(Path::new("a.med"), &MASS, &new).unwrap();
        assert!(again.were_normalised && again.departure < 1e-14);
    }

    #[test]
    fn nearly_dependent_modes_cost_no_more_digits_than_their_condition() {
        let mut old = shapes();
        // modes that differ by a hundredth
        old[1] = old[0].iter().zip(&old[1]).map(|(a, b)| a + 0.01 * b).collect();
        let new = orthonormalise(Path::new("a.med"), &MASS, &old).unwrap().apply(&old);
        assert!((modal_mass(&MASS, &new) - DMatrix::identity(2, 2)).amax() < 4.0 * f64::EPSILON);
    }

    #[test]
    fn modes_that_repeat_or_have_no_mass_are_named() {
        let mut twice = shapes();
        twice.push(twice[1].iter().map(|v| -3.0 * v).collect());
        let text = orthonormalise(Path::new("a.med"), &MASS, &twice).unwrap_err().to_string();
        assert!(text.contains("a.med: modes 2 and 3: found shapes that depend on one another or on further modes (correlation -1.000000), expected modes that are independent"), "{text}");
        let text = orthonormalise(Path::new("a.med"), &MASS, &[vec![0.0; 9]]).unwrap_err().to_string();
        assert!(text.contains("mode 1: found a modal mass of 0.000e0, expected more than zero; leave the mode out"), "{text}");
    }
}
