//! The outer skin of a flexible body with its mode shapes and stress modes: data for pictures and stress, never for a step.

/// Where stress values sit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StressPlace {
    /// One value per surface node.
    Node,
    /// One value per surface triangle: that of the cell behind it.
    Triangle,
}

/// Stress per unit modal coordinate.
#[derive(Debug, Clone)]
pub struct StressModes {
    /// Where the values sit.
    pub place: StressPlace,
    /// xx yy zz xy yz xz (Pa per unit modal coordinate), per mode, per node or triangle.
    pub values: Vec<Vec<[f32; 6]>>,
}

/// Outer skin of a flexible body, one shape per retained mode.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Undeformed positions (m, body axes).
    pub points: Vec<[f64; 3]>,
    /// Outward triangles over `points`.
    pub triangles: Vec<[u32; 3]>,
    /// Displacement (m per unit modal coordinate), per mode, per point.
    pub displacement: Vec<Vec<[f32; 3]>>,
    /// Stress, where the modal file has it.
    pub stress: Option<StressModes>,
}
