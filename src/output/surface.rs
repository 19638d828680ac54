//! The surface of a flexible body: where it stands and what it feels at given modal coordinates.
//!
//! Stress tensors are linear in the modal coordinates and are summed as tensors; the von Mises value is that of the sum, since those
//! of single modes do not add. Neither function allocates.

use crate::model::surface::{StressModes, StressPlace, Surface};

/// Largest von Mises stress of a surface and where it sits.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StressPeak {
    /// Pa.
    pub value: f64,
    /// Surface node, which is also the node of the modal file; for stress per triangle its first node.
    pub node: usize,
}

/// Points summed at a time, so that the sums stay in the nearest cache.
const BLOCK: usize = 128;

/// Von Mises stress of a tensor xx yy zz xy yz xz.
#[must_use]
pub fn von_mises_of(s: &[f64; 6]) -> f64 {
    let [xx, yy, zz, xy, yz, xz] = *s;
    let normal = (xx - yy).powi(2) + (yy - zz).powi(2) + (zz - xx).powi(2);
    (0.5 * normal + 3.0 * (xy * xy + yz * yz + xz * xz)).sqrt()
}

impl Surface {
    /// Number of stress values, zero without stress.
    #[must_use]
    pub fn stress_count(&self) -> usize {
        match &self.stress {
            None => 0,
            Some(StressModes { place: StressPlace::Node, .. }) => self.points.len(),
            Some(StressModes { place: StressPlace::Triangle, .. }) => self.triangles.len(),
        }
    }

    /// Deformed positions (m, body axes) at the modal coordinates `eta`, the deformation times `scale`; `out` has one entry per point.
    pub fn deform(&self, eta: &[f64], scale: f64, out: &mut [[f32; 3]]) {
        let points = &self.points;
        self.displacements(eta, |i, u| {
            if let (Some(out), Some(x)) = (out.get_mut(i), points.get(i)) {
                *out = std::array::from_fn(|a| (x[a] + scale * u[a]) as f32);
            }
        });
    }

    /// Displacements (m, body axes) by the modal coordinates `eta`; `out` has one entry per point.
    pub fn displace(&self, eta: &[f64], out: &mut [[f64; 3]]) {
        self.displacements(eta, |i, u| {
            if let Some(out) = out.get_mut(i) {
                *out = *u;
            }
        });
    }

    /// Displacement of every point, handed to `each` by index.
    fn displacements(&self, eta: &[f64], mut each: impl FnMut(usize, &[f64; 3])) {
        for start in (0..self.points.len()).step_by(BLOCK) {
            let mut sum = [[0.0_f64; 3]; BLOCK];
            for (shape, eta) in self.displacement.iter().zip(eta) {
                for (sum, u) in sum.iter_mut().zip(shape.get(start..).unwrap_or_default()) {
                    (0..3).for_each(|i| sum[i] += eta * f64::from(u[i]));
                }
            }
            let count = BLOCK.min(self.points.len() - start);
            sum[..count].iter().enumerate().for_each(|(i, u)| each(start + i, u));
        }
    }

    /// Von Mises stress (Pa) at the modal coordinates `eta`, those of `others` with other modes added, handed to `each` by index; returns
    /// the largest with its place.
    fn stress(&self, eta: &[f64], others: Option<(&StressModes, &[f64])>, mut each: impl FnMut(usize, f64)) -> StressPeak {
        let Some(stress) = &self.stress else { return StressPeak::default() };
        let (mut peak, mut place) = (0.0_f64, 0);
        for start in (0..self.stress_count()).step_by(BLOCK) {
            let mut sum = [[0.0_f64; 6]; BLOCK];
            let count = BLOCK.min(self.stress_count() - start);
            let others = others.iter().flat_map(|(modes, eta)| modes.values.iter().zip(*eta));
            for (shape, eta) in stress.values.iter().zip(eta).chain(others) {
                for (sum, s) in sum.iter_mut().zip(shape.get(start..start + count).unwrap_or_default()) {
                    (0..6).for_each(|i| sum[i] += eta * f64::from(s[i]));
                }
            }
            for (i, tensor) in sum[..count].iter().enumerate() {
                let value = von_mises_of(tensor);
                each(start + i, value);
                if value > peak {
                    (peak, place) = (value, start + i);
                }
            }
        }
        let node = match stress.place {
            StressPlace::Node => place,
            StressPlace::Triangle => self.triangles.get(place).map_or(0, |t| t[0] as usize),
        };
        StressPeak { value: peak, node }
    }

    /// Largest von Mises stress at the modal coordinates `eta`.
    #[must_use]
    pub fn stress_peak(&self, eta: &[f64]) -> StressPeak {
        self.stress(eta, None, |_, _| {})
    }

    /// Largest von Mises stress at the modal coordinates `eta` and those `xi` of other modes of the same surface.
    #[must_use]
    pub fn stress_peak_with(&self, eta: &[f64], others: &StressModes, xi: &[f64]) -> StressPeak {
        self.stress(eta, Some((others, xi)), |_, _| {})
    }

    /// Von Mises stress (Pa) per point at the modal coordinates `eta`; of the values per triangle, each point takes the largest around
    /// it. `out` has one entry per point.
    pub fn point_stress(&self, eta: &[f64], out: &mut [f32]) -> StressPeak {
        match self.stress.as_ref().map(|s| s.place) {
            None => {
                out.fill(0.0);
                StressPeak::default()
            }
            Some(StressPlace::Node) => self.stress(eta, None, |i, value| {
                if let Some(out) = out.get_mut(i) {
                    *out = value as f32;
                }
            }),
            Some(StressPlace::Triangle) => {
                out.fill(0.0);
                self.stress(eta, None, |i, value| {
                    for &node in &self.triangles[i] {
                        if let Some(out) = out.get_mut(node as usize) {
                            *out = out.max(value as f32);
                        }
                    }
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent() -> Surface {
        Surface {
            points: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2], [1, 3, 2]],
            displacement: vec![vec![[0.0, 0.0, 1.0]; 4], vec![[0.5, 0.0, 0.0]; 4]],
            stress: Some(StressModes {
                place: StressPlace::Node,
                values: vec![
                    vec![[10.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 6], [0.0, 0.0, 0.0, 1.0, 2.0, 3.0], [0.0; 6]],
                    vec![[10.0, 10.0, 10.0, 0.0, 0.0, 0.0], [0.0; 6], [4.0, 0.0, 0.0, 0.0, 0.0, 0.0], [1.0; 6]],
                ],
            }),
        }
    }

    #[test]
    fn tensors_are_summed_before_the_von_mises_value_is_taken() {
        let (surface, mut values) = (bent(), [0.0; 4]);
        let peak = surface.point_stress(&[2.0, -1.0], &mut values);
        // node 0: (20, 0, 0) - (10, 10, 10) is uniaxial 20 with a pressure that does not count
        assert!((f64::from(values[0]) - 20.0).abs() < 1e-5);
        // node 2: xx = -4, shear 2, 4, 6: sqrt(16 + 3 (4 + 16 + 36))
        assert!((f64::from(values[2]) - 184.0_f64.sqrt()).abs() < 1e-5);
        assert_eq!((peak.value, peak.node), (20.0, 0));
        assert_eq!(surface.stress_peak(&[2.0, -1.0]), peak);
        // summing the modes' own values would give 20 + 0 at node 0 but also sqrt(168) + 4 at node 2
        assert!(peak.value > f64::from(values[2]));
    }

    #[test]
    fn a_point_takes_the_largest_triangle_around_it() {
        let mut surface = bent();
        surface.stress = Some(StressModes {
            place: StressPlace::Triangle,
            values: vec![vec![[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0, 0.0, 0.0]]],
        });
        let mut values = [0.0; 4];
        let peak = surface.point_stress(&[-1.0, 0.0], &mut values);
        assert_eq!(values, [1.0, 3.0, 3.0, 3.0]);
        assert_eq!((peak.value, peak.node), (3.0, 1));
    }

    #[test]
    fn the_scale_applies_to_the_deformation_alone() {
        let (surface, mut points) = (bent(), [[0.0; 3]; 4]);
        surface.deform(&[0.25, 2.0], 4.0, &mut points);
        assert_eq!(points[3], [5.0, 1.0, 1.0]);
    }
}
