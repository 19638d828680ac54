//! The health report of a modal file: one row per rule of the schema, with a figure, a limit and a verdict.

use std::path::PathBuf;

/// A rule of the schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rule {
    /// Name and major version of the format.
    Format,
    /// Presence, type, shape and storage of every object.
    Structure,
    /// Index ranges.
    Indices,
    /// Finite numbers.
    Finite,
    /// Checksums of chunks.
    Checksums,
    /// Digest of the content.
    Digest,
    /// Frequencies above zero.
    FrequencyPositive,
    /// Frequencies in ascending order.
    FrequencyOrder,
    /// Damping ratios not negative.
    Damping,
    /// Full stiffness symmetric and positive semidefinite.
    Stiffness,
    /// Mass above zero.
    Mass,
    /// Centre of mass inside the bounding box.
    CenterOfMass,
    /// Inertia symmetric.
    InertiaSymmetry,
    /// Central inertia positive definite.
    InertiaPositive,
    /// Triangle inequality of the central moments of inertia.
    InertiaTriangle,
    /// Modal mass matrix is the identity.
    Orthonormality,
    /// Symmetry of the second moment.
    SecondMomentSymmetry,
    /// Bessel's inequality in translation.
    BesselTranslation,
    /// Bessel's inequality in rotation.
    BesselRotation,
    /// Nodal masses add up to the mass.
    LumpedMass,
    /// Nodal masses give the centre of mass.
    LumpedFirstMoment,
    /// Nodal masses give the inertia.
    LumpedInertia,
    /// Nodal masses give the momentum of each mode.
    LumpedMomentum,
    /// Nodal masses give the first moment of each mode.
    LumpedModalMoment,
    /// Nodal masses give orthonormal modes.
    LumpedOrthonormality,
    /// Root nodes at rest in every mode.
    RootNodes,
    /// Root interface at rest in every mode.
    RootInterface,
    /// Free-free modes carry no momentum.
    FreeMomentum,
    /// Free-free modes carry no angular momentum.
    FreeAngularMomentum,
    /// Interface weights add up to one.
    InterfaceWeights,
    /// Interface sits at the weighted mean of its nodes.
    InterfacePosition,
    /// Interface moves as the weighted mean of its nodes.
    InterfaceTranslation,
    /// Interface axes are a rotation.
    InterfaceOrientation,
    /// Root interface at the origin.
    RootPosition,
    /// Geometric stiffness symmetric.
    GeometricSymmetry,
}

impl Rule {
    /// Every rule, in the order of the report.
    pub const ALL: [Self; 35] = [
        Self::Format,
        Self::Structure,
        Self::Indices,
        Self::Finite,
        Self::Checksums,
        Self::Digest,
        Self::FrequencyPositive,
        Self::FrequencyOrder,
        Self::Damping,
        Self::Stiffness,
        Self::Mass,
        Self::CenterOfMass,
        Self::InertiaSymmetry,
        Self::InertiaPositive,
        Self::InertiaTriangle,
        Self::Orthonormality,
        Self::SecondMomentSymmetry,
        Self::BesselTranslation,
        Self::BesselRotation,
        Self::LumpedMass,
        Self::LumpedFirstMoment,
        Self::LumpedInertia,
        Self::LumpedMomentum,
        Self::LumpedModalMoment,
        Self::LumpedOrthonormality,
        Self::RootNodes,
        Self::RootInterface,
        Self::FreeMomentum,
        Self::FreeAngularMomentum,
        Self::InterfaceWeights,
        Self::InterfacePosition,
        Self::InterfaceTranslation,
        Self::InterfaceOrientation,
        Self::RootPosition,
        Self::GeometricSymmetry,
    ];

    /// Name in reports and messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.text().0
    }

    /// What the rule protects, in one line.
    #[must_use]
    pub fn protects(self) -> &'static str {
        self.text().1
    }

    /// What to do when it is broken.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        self.text().2
    }

    /// Name, what it protects, remedy.
    fn text(self) -> (&'static str, &'static str, &'static str) {
        let export = "export the modes again, or correct the tool that computed this quantity";
        let lumped = "check the unit of mass, the node order and mesh/node_mass against the tensors in inertia/";
        match self {
            Self::Format => ("format and version", "the reader knows what each dataset means", "write the file in flexible-body-modes 1.x"),
            Self::Structure => ("types, shapes and storage", "nothing is guessed or filled with zeros", "write the file again"),
            Self::Indices => ("index ranges", "cells, triangles and interfaces point at nodes that exist", "count nodes from 0"),
            Self::Finite => ("finite numbers", "one NaN would spread through a whole run", export),
            Self::Checksums => {
                ("chunk checksums", "flipped bits on disk or in transfer are noticed", "write datasets above 4 KiB with fletcher32")
            }
            Self::Digest => (
                "content digest",
                "the data is what the tool wrote, unedited",
                "restore the file, or write content_sha256 again after a wanted edit",
            ),
            Self::FrequencyPositive => {
                ("frequencies positive (Hz)", "no rigid-body mode is integrated twice", "leave rigid-body modes out")
            }
            Self::FrequencyOrder => {
                ("frequencies ascending (Hz)", "`modes = { count = n }` keeps the lowest", "sort the modes by frequency")
            }
            Self::Damping => ("damping not negative", "modes do not gain energy by themselves", "give damping ratios of zero or more"),
            Self::Stiffness => ("stiffness symmetric, semidefinite", "strain energy exists and is never negative", export),
            Self::Mass => ("mass positive (kg)", "the body has inertia", export),
            Self::CenterOfMass => (
                "centre of mass inside mesh",
                "origin and unit of length are those of the mesh",
                "measure the centre of mass from the origin of mesh/points, in m",
            ),
            Self::InertiaSymmetry => ("inertia symmetric", "rotation conserves energy", export),
            Self::InertiaPositive => (
                "central inertia positive",
                "the inertia belongs to some mass distribution",
                "give the inertia about the origin, not about the centre of mass",
            ),
            Self::InertiaTriangle => ("inertia triangle inequality", "the inertia belongs to some mass distribution", export),
            Self::Orthonormality => (
                "modes mass-orthonormal",
                "modal mass is one, as the equations assume",
                "scale and orthonormalise the modes with the mass matrix",
            ),
            Self::SecondMomentSymmetry => ("second moment symmetric", "the mass matrix stays symmetric in deformation", export),
            Self::BesselTranslation => (
                "effective mass at most mass",
                "modes do not carry more mass than the body has",
                "check the unit of mass and the scaling of the modes",
            ),
            Self::BesselRotation => (
                "effective inertia at most inertia",
                "modes do not carry more inertia than the body has",
                "check the axes and the scaling of the modes",
            ),
            Self::LumpedMass => ("nodal mass adds up", "mesh and mass belong to the same model", lumped),
            Self::LumpedFirstMoment => ("nodal mass gives centre of mass", "mesh and centre of mass share the origin", lumped),
            Self::LumpedInertia => ("nodal mass gives inertia", "mesh and inertia share origin and axes", lumped),
            Self::LumpedMomentum => ("nodal mass gives momentum", "mode shapes and participation belong together", lumped),
            Self::LumpedModalMoment => ("nodal mass gives first moments", "mode shapes and rotation coupling belong together", lumped),
            Self::LumpedOrthonormality => ("nodal mass gives modal mass", "mode shapes and modal mass belong together", lumped),
            Self::RootNodes => {
                ("root nodes at rest", "a clamped root moves in no mode", "clamp all root nodes, or state boundary \"general\"")
            }
            Self::RootInterface => {
                ("root interface at rest", "a hinge on the root feels no modal motion", "clamp the root, or state boundary \"general\"")
            }
            Self::FreeMomentum => (
                "free-free momentum zero",
                "mean-axis modes do not move the centre of mass",
                "remove the rigid-body part, or state boundary \"general\"",
            ),
            Self::FreeAngularMomentum => (
                "free-free angular momentum zero",
                "mean-axis modes do not turn the body",
                "remove the rigid-body part, or state boundary \"general\"",
            ),
            Self::InterfaceWeights => {
                ("interface weights add up", "an interface moves with its nodes as a whole", "divide the weights by their sum")
            }
            Self::InterfacePosition => {
                ("interface position from nodes", "loads act where the nodes are", "set the position to the weighted mean of the nodes")
            }
            Self::InterfaceTranslation => (
                "interface motion from nodes",
                "6-vectors are (ux uy uz rx ry rz) in body axes",
                "check order, axes and scaling of the interface displacement",
            ),
            Self::InterfaceOrientation => {
                ("interface axes a rotation", "hinge axes keep their angles", "give a right-handed orthonormal matrix")
            }
            Self::RootPosition => (
                "root interface at origin",
                "the hinge sits at the origin of the mesh",
                "move the mesh so that the root interface is its origin",
            ),
            Self::GeometricSymmetry => ("geometric stiffness symmetric", "stiffening conserves energy", export),
        }
    }
}

/// How a figure is held against its limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// The figure must not exceed the limit.
    AtMost(f64),
    /// The figure must reach the limit.
    AtLeast(f64),
    /// The figure must exceed the limit.
    MoreThan(f64),
}

impl Bound {
    /// The limit itself.
    #[must_use]
    pub fn limit(self) -> f64 {
        match self {
            Self::AtMost(limit) | Self::AtLeast(limit) | Self::MoreThan(limit) => limit,
        }
    }

    /// The relation as written in reports.
    #[must_use]
    pub fn relation(self) -> &'static str {
        match self {
            Self::AtMost(_) => "<=",
            Self::AtLeast(_) => ">=",
            Self::MoreThan(_) => ">",
        }
    }

    /// False for a figure that is not a number.
    #[must_use]
    pub fn holds(self, figure: f64) -> bool {
        match self {
            Self::AtMost(limit) => figure <= limit,
            Self::AtLeast(limit) => figure >= limit,
            Self::MoreThan(limit) => figure > limit,
        }
    }
}

/// Outcome of a rule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// It holds.
    Ok,
    /// It holds, with a margin or a circumstance worth knowing.
    Warn,
    /// It is broken; the file is refused.
    Fail,
    /// The file has nothing the rule speaks of.
    NotApplicable,
    /// Not evaluated, because the file could not be read that far.
    NotReached,
}

impl Verdict {
    /// Word in reports.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Fail => "FAIL",
            Self::NotApplicable => "n/a",
            Self::NotReached => "not reached",
        }
    }
}

/// One row of the report.
#[derive(Debug, Clone)]
pub struct RuleResult {
    /// The rule.
    pub rule: Rule,
    /// Path of the dataset or attribute the figure belongs to; of several the worst.
    pub object: String,
    /// What was measured; relative unless the rule's name carries a unit.
    pub figure: Option<f64>,
    /// What it is held against.
    pub bound: Option<Bound>,
    /// Outcome.
    pub verdict: Verdict,
    /// What a number cannot say.
    pub note: Option<String>,
}

/// All rows for one file, in the order of [`Rule::ALL`].
#[derive(Debug, Clone)]
pub struct HealthReport {
    /// The file.
    pub file: PathBuf,
    /// One row per rule.
    pub rows: Vec<RuleResult>,
}

impl HealthReport {
    /// Rows with this verdict.
    pub fn with_verdict(&self, verdict: Verdict) -> impl Iterator<Item = &RuleResult> {
        self.rows.iter().filter(move |row| row.verdict == verdict)
    }

    /// True if no rule is broken.
    #[must_use]
    pub fn is_accepted(&self) -> bool {
        self.with_verdict(Verdict::Fail).next().is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rule_stands_once_and_in_order() {
        assert!(Rule::ALL.windows(2).all(|pair| pair[0] < pair[1]));
        let mut names: Vec<&str> = Rule::ALL.iter().map(|rule| rule.name()).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
    }

    #[test]
    fn a_figure_that_is_not_a_number_holds_no_bound() {
        assert!([Bound::AtMost(1.0), Bound::AtLeast(1.0), Bound::MoreThan(1.0)].iter().all(|bound| !bound.holds(f64::NAN)));
    }
}
