//! A flexible body as the recursion reads it: modal integrals packed for the sweeps, stiffness and damping resolved.

use super::modal_body::{Interface, ModalBody};
use super::mode_products::ModeProducts;
use nalgebra::{DMatrix, Matrix3, Vector3, Vector6};
use std::f64::consts::TAU;

/// Highest power of the modal coordinates kept in the inertia.
///
/// Zeroth order evaluates every inertia coefficient on the undeformed body and leaves out the coupling of modal rates among each
/// other; first order adds what is linear in the modal coordinates; second order is exact for assumed modes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum InertiaOrder {
    /// Undeformed body.
    Zeroth,
    /// Linear in the modal coordinates.
    First,
    /// Exact.
    #[default]
    Second,
}

/// Number of independent components of a 3 x 3 tensor.
pub const TENSOR: usize = 9;
/// Number of unit inertial loads of the geometric stiffness.
pub const INERTIAL_LOADS: usize = 12;

/// Modal integrals of one modal file for one choice of modes, shared by the bodies that use it.
///
/// Planes of n or n x n numbers, one per tensor component `3 * a + b`, so that each contraction is a pass over contiguous data.
#[derive(Debug, Clone)]
pub struct ModalIntegrals {
    /// Mass (kg).
    pub mass: f64,
    /// Undeformed first moment `m c` (kg m).
    pub first_moment: Vector3<f64>,
    /// Undeformed `int rho r_a r_b` (kg m^2).
    pub second_moment: Matrix3<f64>,
    /// Per mode `int rho phi_j` (sqrt(kg)).
    pub momentum: Vec<Vector3<f64>>,
    /// Nine planes of n: `int rho phi_ja r_b`.
    pub shape_position: Vec<f64>,
    /// `int rho phi_ja phi_kb` of all pairs of modes, with `int rho Gamma_jk,a r_b` of the geometric stiffness in `second_order`.
    pub products: ModeProducts,
    /// Per mode, angular momentum of rotary inertia (kg^(1/2) m); empty without.
    pub rotary: Vec<Vector3<f64>>,
    /// Six planes of n x n, symmetric: `int rho (r x Gamma_jk)_c`, then `int rho Gamma_jk,c`, of the second-order displacement
    /// `1/2 eta' Gamma eta` that geometric stiffness stands for; empty without.
    pub second_order: Vec<f64>,
}

impl ModalIntegrals {
    /// Packs the integrals of `body`, and its geometric stiffness where it has that.
    #[must_use]
    pub fn with_geometric_stiffness(body: &ModalBody) -> Self {
        Self::packed(body, body.geometric_stiffness.as_deref())
    }

    /// Adds the second-order displacement field whose work under the 12 unit inertial loads makes the geometric stiffness.
    ///
    /// A frame acceleration `a(r)` loads the body by `-rho a`, so `K = int rho a_b Gamma_b`: `K_acc,b = int rho Gamma_b`, and with
    /// `N_ab = int rho r_a Gamma_b`: `K_alpha,c = N_ab - N_ba` (abc cyclic), `K_omega,ab = N_ab + N_ba`, `K_omega,aa = N_aa - tr N`.
    ///
    /// Adds N to the nine planes of `shape_shape`, and returns the six of `second_order`.
    fn add_geometric_stiffness(n: usize, matrices: &[DMatrix<f64>], shape_shape: &mut [f64]) -> Vec<f64> {
        let square = n * n;
        let at = |load: usize, i: usize| 0.5 * (matrices[load][(i % n, i / n)] + matrices[load][(i / n, i % n)]);
        let second_order = (0..6).map(|l| (l + 3) % 6).flat_map(|load| (0..square).map(move |i| at(load, i))).collect();
        for i in 0..square {
            let squares = 0.5 * (at(6, i) + at(7, i) + at(8, i));
            for a in 0..3 {
                shape_shape[4 * a * square + i] += at(6 + a, i) - squares;
            }
            for (c, product) in [(0, 10), (1, 11), (2, 9)] {
                let (a, b) = ((c + 1) % 3, (c + 2) % 3);
                // plane (b, a) takes Gamma_b r_a
                shape_shape[(3 * b + a) * square + i] += 0.5 * (at(product, i) + at(3 + c, i));
                shape_shape[(3 * a + b) * square + i] += 0.5 * (at(product, i) - at(3 + c, i));
            }
        }
        second_order
    }

    /// True if geometric stiffness is in.
    #[must_use]
    pub fn has_geometric_stiffness(&self) -> bool {
        !self.second_order.is_empty()
    }

    /// Packs the integrals of `body` without its geometric stiffness.
    #[must_use]
    pub fn of(body: &ModalBody) -> Self {
        Self::packed(body, None)
    }

    fn packed(body: &ModalBody, geometric_stiffness: Option<&[DMatrix<f64>]>) -> Self {
        let n = body.mode_count();
        let mut shape_position = vec![0.0; TENSOR * n];
        let mut shape_shape = vec![0.0; TENSOR * n * n];
        for a in 0..3 {
            for b in 0..3 {
                let plane = 3 * a + b;
                for j in 0..n {
                    // the file stores r first, mode second
                    shape_position[plane * n + j] = body.first_moment[j][(b, a)];
                    for k in 0..n {
                        shape_shape[(plane * n + k) * n + j] = body.second_moment[j * n + k][(a, b)];
                    }
                }
            }
        }
        let square = n * n;
        let mut shape_cross = vec![0.0; 3 * square];
        for (c, (a, b)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
            for i in 0..square {
                shape_cross[c * square + i] = shape_shape[(3 * b + a) * square + i] - shape_shape[(3 * a + b) * square + i];
            }
        }
        let second_order = geometric_stiffness.map_or_else(Vec::new, |m| Self::add_geometric_stiffness(n, m, &mut shape_shape));
        let cross_sum = |q: &Matrix3<f64>| Vector3::new(q[(1, 2)] - q[(2, 1)], q[(2, 0)] - q[(0, 2)], q[(0, 1)] - q[(1, 0)]);
        let rotary = body.angular_momentum.iter().flat_map(|l| l.iter().zip(&body.first_moment).map(|(l, q)| l - cross_sum(q))).collect();
        Self {
            mass: body.mass,
            first_moment: body.center_of_mass * body.mass,
            second_moment: Matrix3::from_diagonal_element(0.5 * body.inertia.trace()) - body.inertia,
            momentum: body.momentum.clone(),
            shape_position,
            products: ModeProducts::new(n, &shape_shape, &shape_cross, geometric_stiffness.is_some()),
            rotary,
            second_order,
        }
    }

    /// Number of modes.
    #[must_use]
    pub fn mode_count(&self) -> usize {
        self.momentum.len()
    }
}

/// Where a frame sits on a body: fixed to it, or carried by an interface that the modes move.
#[derive(Debug, Clone)]
pub struct Attachment {
    /// Undeformed position of the interface (or the fixed frame itself) in body axes (m).
    pub position: Vector3<f64>,
    /// Undeformed axes of the interface (or of the fixed frame).
    pub rotation: Matrix3<f64>,
    /// Position of the attached frame in interface axes (m).
    pub offset: Vector3<f64>,
    /// Axes of the attached frame in interface axes.
    pub offset_rotation: Matrix3<f64>,
    /// Mode shape (rotation; translation) of the interface; empty if no mode moves it.
    pub mode_shape: Vec<Vector6<f64>>,
}

impl Attachment {
    /// A frame fixed to the body.
    #[must_use]
    pub fn fixed(position: Vector3<f64>, rotation: Matrix3<f64>) -> Self {
        Self { position, rotation, offset: Vector3::zeros(), offset_rotation: Matrix3::identity(), mode_shape: Vec::new() }
    }

    /// A frame at an offset (position, axes) from an interface, in the interface's axes.
    #[must_use]
    pub fn on_interface(interface: &Interface, offset: Vector3<f64>, offset_rotation: Matrix3<f64>) -> Self {
        if interface.mode_shape.iter().all(|s| *s == Vector6::zeros()) {
            return Self::fixed(interface.position + interface.orientation * offset, interface.orientation * offset_rotation);
        }
        Self {
            position: interface.position,
            rotation: interface.orientation,
            offset,
            offset_rotation,
            mode_shape: interface.mode_shape.clone(),
        }
    }

    /// True if modes move the frame.
    #[must_use]
    pub fn moves(&self) -> bool {
        !self.mode_shape.is_empty()
    }
}

/// A flexible body of a system. n is the number of retained modes.
#[derive(Debug, Clone)]
pub struct FlexibleBody {
    /// Modal integrals, shared between bodies of one file and one choice of modes.
    pub integrals: std::sync::Arc<ModalIntegrals>,
    /// omega_j^2 (1/s^2), length n; the diagonal of the modal stiffness.
    pub stiffness: Vec<f64>,
    /// Full modal stiffness where it is not diagonal.
    pub full_stiffness: Option<DMatrix<f64>>,
    /// 2 zeta_j omega_j (1/s), length n.
    pub damping: Vec<f64>,
    /// How much of the deformation the inertia follows.
    pub order: InertiaOrder,
    /// Frame O of the inboard hinge.
    pub inboard: Attachment,
    /// Names of the retained modes, as "mode 3" for the third of the modal file.
    pub mode_names: Vec<String>,
    /// Per mode, the diagonal of the 12 geometric stiffness matrices that the modal data have but the integrals leave out; empty if none.
    pub unused_stiffening: Vec<[f64; INERTIAL_LOADS]>,
}

impl FlexibleBody {
    /// Number of retained modes.
    #[must_use]
    pub fn mode_count(&self) -> usize {
        self.stiffness.len()
    }

    /// True if geometric stiffness takes part in the motion.
    #[must_use]
    pub fn stiffens(&self) -> bool {
        self.integrals.has_geometric_stiffness() && self.order >= InertiaOrder::First
    }

    /// Highest natural frequency of the retained modes (Hz), zero without modes.
    #[must_use]
    pub fn highest_frequency_hz(&self) -> f64 {
        self.stiffness.iter().copied().fold(0.0, f64::max).sqrt() / TAU
    }

    /// Modal spring and damper forces `K eta + C eta_dot`, written to `out` (length n).
    pub fn elastic_force(&self, eta: &[f64], eta_dot: &[f64], out: &mut [f64]) {
        for (j, o) in out.iter_mut().enumerate() {
            *o = self.elastic_force_on(j, eta, eta_dot);
        }
    }

    /// The same on mode `j` alone.
    #[inline]
    #[must_use]
    pub fn elastic_force_on(&self, j: usize, eta: &[f64], eta_dot: &[f64]) -> f64 {
        let spring = match &self.full_stiffness {
            None => self.stiffness[j] * eta[j],
            Some(full) => full.row(j).iter().zip(eta).map(|(k, e)| k * e).sum::<f64>(),
        };
        self.damping[j] * eta_dot[j] + spring
    }

    /// Strain energy (J) at the modal coordinates `eta`.
    #[must_use]
    pub fn strain_energy(&self, eta: &[f64]) -> f64 {
        match &self.full_stiffness {
            None => self.stiffness.iter().zip(eta).map(|(k, e)| 0.5 * k * e * e).sum(),
            Some(full) => (0..eta.len()).map(|j| 0.5 * eta[j] * full.row(j).iter().zip(eta).map(|(k, e)| k * e).sum::<f64>()).sum(),
        }
    }
}
