//! Modal data of one flexible body: what the recursion needs of a modal file, and nothing per node.
//!
//! With nodes at `r` and assumed modes `phi_j`, a material point sits at `x = r + sum_j eta_j phi_j` in body axes. Everything the
//! equations of motion need of the mass distribution follows from the integrals stored here (Paper section 3; the list of
//! terms is in `dynamics/flexible_inertia.rs`).

use nalgebra::{DMatrix, Matrix3, Vector3, Vector6};

/// How the modes were held when they were computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Boundary {
    /// Clamped at the root interface: no mode moves there (Paper Eq. 20).
    Cantilever,
    /// Mean-axis modes of the unheld body; every interface moves.
    FreeFree,
    /// Clamped at the root, with constraint modes of the other interfaces, orthonormalised.
    CraigBampton,
    /// Any assumed modes.
    General,
}

impl Boundary {
    /// The name used in modal files and messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cantilever => "cantilever",
            Self::FreeFree => "free-free",
            Self::CraigBampton => "craig-bampton",
            Self::General => "general",
        }
    }

    /// The boundary of that name, if there is one.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::Cantilever, Self::FreeFree, Self::CraigBampton, Self::General].into_iter().find(|b| b.name() == name)
    }

    /// True if the modes vanish at the root interface by construction.
    #[must_use]
    pub fn holds_root(self) -> bool {
        matches!(self, Self::Cantilever | Self::CraigBampton)
    }
}

/// A named place on a flexible body where a hinge, a closure or a load may sit.
#[derive(Debug, Clone)]
pub struct Interface {
    /// Name, unique within the body.
    pub name: String,
    /// Undeformed position of the interface frame (m, body axes, from the body origin).
    pub position: Vector3<f64>,
    /// Axes of the undeformed interface frame in body axes (columns); identity where the file has none.
    pub orientation: Matrix3<f64>,
    /// Mode shape of the frame, one entry per mode: (rotation; translation) per unit modal coordinate, body axes.
    pub mode_shape: Vec<Vector6<f64>>,
}

/// Modal description of a flexible body. n is the number of modes; vectors and tensors are in body axes about the body origin.
#[derive(Debug, Clone)]
pub struct ModalBody {
    /// Mass (kg).
    pub mass: f64,
    /// Undeformed centre of mass (m).
    pub center_of_mass: Vector3<f64>,
    /// Undeformed rotational inertia about the origin (kg m^2).
    pub inertia: Matrix3<f64>,
    /// How the modes were held.
    pub boundary: Boundary,
    /// Name of the interface that carries the inboard hinge unless a scene says otherwise.
    pub root_interface: String,
    /// Natural frequency of each mode (Hz), length n.
    pub frequency_hz: Vec<f64>,
    /// Modal damping ratio of each mode, length n.
    pub damping_ratio: Vec<f64>,
    /// Modal stiffness n x n (1/s^2) where it is not diag((2 pi f)^2).
    pub stiffness: Option<DMatrix<f64>>,
    /// p_ja = int rho phi_ja, length n.
    pub momentum: Vec<Vector3<f64>>,
    /// Q_jab = int rho r_a phi_jb, length n; row a, column b.
    pub first_moment: Vec<Matrix3<f64>>,
    /// P_jkab = int rho phi_ja phi_kb, row-major n x n of 3 x 3 (index `j * n + k`); row a, column b.
    pub second_moment: Vec<Matrix3<f64>>,
    /// Angular momentum of each mode where rotary inertia adds to `epsilon : Q`, length n.
    pub angular_momentum: Option<Vec<Vector3<f64>>>,
    /// Geometric stiffness for the 12 unit inertial loads acc x..z, alpha x..z, omega xx yy zz xy yz xz; each n x n.
    pub geometric_stiffness: Option<Vec<DMatrix<f64>>>,
    /// Places where something may be attached.
    pub interfaces: Vec<Interface>,
}

impl ModalBody {
    /// Number of modes.
    #[must_use]
    pub fn mode_count(&self) -> usize {
        self.frequency_hz.len()
    }

    /// The interface of that name, if there is one.
    #[must_use]
    pub fn interface(&self, name: &str) -> Option<&Interface> {
        self.interfaces.iter().find(|i| i.name == name)
    }

    /// The same body with only the modes `keep` (0-based, in that order).
    ///
    /// # Panics
    /// If an index is out of range; callers check names and numbers first.
    #[must_use]
    pub fn with_modes(&self, keep: &[usize]) -> Self {
        let n = self.mode_count();
        let pick = |m: &DMatrix<f64>| DMatrix::from_fn(keep.len(), keep.len(), |i, j| m[(keep[i], keep[j])]);
        Self {
            frequency_hz: keep.iter().map(|&j| self.frequency_hz[j]).collect(),
            damping_ratio: keep.iter().map(|&j| self.damping_ratio[j]).collect(),
            stiffness: self.stiffness.as_ref().map(pick),
            momentum: keep.iter().map(|&j| self.momentum[j]).collect(),
            first_moment: keep.iter().map(|&j| self.first_moment[j]).collect(),
            second_moment: keep.iter().flat_map(|&j| keep.iter().map(move |&k| j * n + k)).map(|i| self.second_moment[i]).collect(),
            angular_momentum: self.angular_momentum.as_ref().map(|l| keep.iter().map(|&j| l[j]).collect()),
            geometric_stiffness: self.geometric_stiffness.as_ref().map(|g| g.iter().map(pick).collect()),
            interfaces: self
                .interfaces
                .iter()
                .map(|i| Interface { mode_shape: keep.iter().map(|&j| i.mode_shape[j]).collect(), ..i.clone() })
                .collect(),
            ..self.clone()
        }
    }
}
