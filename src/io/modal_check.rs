//! Holds a modal file against every rule of the schema, without giving up at the first.
//!
//! Sources of the rules: the table in the schema; tolerances are relative to the scale named beside each figure. A rule that
//! speaks of something the file does not have is reported as not applicable; rules behind a failed read are reported as not reached.

use super::digest::{Content, read_content};
use super::error::ModalFileError;
use super::header::NodeMassKind;
use super::health::{Bound, HealthReport, Rule, RuleResult, Verdict};
use super::lumped::LumpedSums;
use super::modal_file::{InterfaceSupport, MODAL_MASS_LIMIT, ModalFile};
use crate::model::modal_body::{Boundary, ModalBody};
use nalgebra::{DMatrix, Matrix3, SymmetricEigen, Vector3};
use std::path::Path;

/// What an examination found.
#[derive(Debug)]
pub struct Examination {
    /// One row per rule.
    pub report: HealthReport,
    /// The error that ended the reading, if it could not be finished.
    pub error: Option<ModalFileError>,
    /// The open file and its modal integrals, if all of it could be read.
    pub content: Option<(ModalFile, ModalBody)>,
}

impl Examination {
    /// The file and its integrals if no rule is broken.
    ///
    /// # Errors
    /// What ended the reading, or the first broken rule with how many more there are.
    pub fn into_accepted(self) -> Result<(ModalFile, ModalBody), ModalFileError> {
        if let Some(error) = self.error {
            return Err(error);
        }
        let mut broken = self.report.with_verdict(Verdict::Fail);
        let first = broken.next().cloned();
        let others = broken.count();
        match (first, self.content) {
            (None, Some(content)) => Ok(content),
            (Some(row), _) => Err(broken_rule(&self.report.file, &row, others)),
            (None, None) => Err(ModalFileError::Open { file: self.report.file, cause: "nothing was read".to_owned() }),
        }
    }

    /// Every broken rule as a message, with the error that ended the reading first.
    #[must_use]
    pub fn messages(&self) -> Vec<String> {
        let rows = self.report.with_verdict(Verdict::Fail).filter(|_| self.error.is_none());
        self.error.iter().map(ToString::to_string).chain(rows.map(|row| broken_rule(&self.report.file, row, 0).to_string())).collect()
    }
}

fn broken_rule(file: &Path, row: &RuleResult, others: usize) -> ModalFileError {
    let found = match (&row.note, row.figure) {
        (Some(note), None) => note.clone(),
        (Some(note), Some(figure)) => format!("{figure:.3e} ({note})"),
        (None, figure) => figure.map_or("nothing".to_owned(), |f| format!("{f:.3e}")),
    };
    let expected = match row.bound {
        Some(Bound::AtMost(limit)) => format!("at most {limit:e}"),
        Some(Bound::AtLeast(limit)) => format!("at least {limit:e}"),
        Some(Bound::MoreThan(limit)) => format!("more than {limit:e}"),
        None => "agreement".to_owned(),
    };
    ModalFileError::RuleBroken { file: file.to_owned(), object: row.object.clone(), rule: row.rule, found, expected, others }
}

/// Reads a whole file and reports on every rule; never fails itself.
#[must_use]
pub fn examine(path: &Path) -> Examination {
    let mut rows = Rows::default();
    let outcome = read_and_judge(path, &mut rows);
    let (content, error) = match outcome {
        Ok(content) => (Some(content), None),
        Err(error) => (None, Some(error)),
    };
    if let Some(error) = &error {
        rows.0.retain(|row| row.rule != error.rule());
        rows.0.push(RuleResult {
            rule: error.rule(),
            object: String::new(),
            figure: None,
            bound: None,
            verdict: Verdict::Fail,
            note: Some(error.to_string()),
        });
    }
    for rule in Rule::ALL {
        if !rows.0.iter().any(|row| row.rule == rule) {
            rows.0.push(RuleResult { rule, object: String::new(), figure: None, bound: None, verdict: Verdict::NotReached, note: None });
        }
    }
    rows.0.sort_by_key(|row| row.rule);
    Examination { report: HealthReport { file: path.to_owned(), rows: rows.0 }, error, content }
}

/// Rows so far.
#[derive(Default)]
struct Rows(Vec<RuleResult>);

impl Rows {
    fn push(&mut self, rule: Rule, object: &str, figure: Option<f64>, bound: Option<Bound>, verdict: Verdict, note: Option<String>) {
        self.0.push(RuleResult { rule, object: object.to_owned(), figure, bound, verdict, note });
    }

    /// A rule that numbers decide.
    fn judge(&mut self, rule: Rule, object: &str, figure: f64, bound: Bound) {
        self.judge_with_warning(rule, object, figure, bound, bound);
    }

    /// A rule with a warning before the limit.
    fn judge_with_warning(&mut self, rule: Rule, object: &str, figure: f64, bound: Bound, wanted: Bound) {
        let verdict = match (bound.holds(figure), wanted.holds(figure)) {
            (false, _) => Verdict::Fail,
            (true, false) => Verdict::Warn,
            (true, true) => Verdict::Ok,
        };
        let note = (verdict == Verdict::Warn).then(|| format!("better {} {:e}", wanted.relation(), wanted.limit()));
        self.push(rule, object, Some(figure), Some(bound), verdict, note);
    }

    /// Adds what the figure of a rule cannot say.
    fn remark(&mut self, rule: Rule, remark: String) {
        for row in self.0.iter_mut().filter(|row| row.rule == rule) {
            row.note = Some(row.note.take().map_or(remark.clone(), |note| format!("{note}; {remark}")));
        }
    }

    /// A rule that holds by the reading itself.
    fn held(&mut self, rule: Rule, note: String) {
        self.push(rule, "", None, None, Verdict::Ok, Some(note));
    }

    fn not_applicable(&mut self, rule: Rule, object: &str, note: &str) {
        self.push(rule, object, None, None, Verdict::NotApplicable, Some(note.to_owned()));
    }
}

fn read_and_judge(path: &Path, rows: &mut Rows) -> Result<(ModalFile, ModalBody), ModalFileError> {
    let file = ModalFile::open(path)?;
    rows.held(Rule::Format, format!("version {}", file.header().version));
    let content = read_content(&file.file)?;
    judge_content(rows, &file, &content);
    check_counts(&file)?;
    let kinds = file.read_mode_kinds()?;
    let supports = file.read_interface_supports()?;
    let (cells, per_cell) = file.read_cells()?;
    let triangles = file.read_surface_triangles()?;
    rows.held(Rule::Indices, format!("{} cells of {per_cell} nodes, {} triangles", cells.len() / per_cell.max(1), triangles.len()));
    drop((cells, triangles, kinds));
    if let Some(error) = content.first_not_finite {
        return Err(error);
    }
    let body = file.read_body()?;
    let sums = LumpedSums::read(&file, &supports)?;
    rows.held(Rule::Structure, format!("{} datasets", content.datasets));

    judge_modes(rows, &body);
    judge_rigid(rows, &body, &sums);
    judge_integrals(rows, &body, file.read_modal_mass_departure()?);
    judge_lumped(rows, &file, &body, &sums);
    if let Some(source) = file.inertia_source()? {
        rows.remark(Rule::Orthonormality, source);
    }
    judge_boundary(rows, &body, &sums);
    judge_interfaces(rows, &body, &supports, &sums);
    judge_geometric(rows, &file, &body)?;
    Ok((file, body))
}

fn judge_content(rows: &mut Rows, file: &ModalFile, content: &Content) {
    rows.push(Rule::Finite, "", Some(content.not_finite as f64), Some(Bound::AtMost(0.0)), verdict(content.not_finite == 0), None);
    let note =
        content.unguarded.first().map(|path| format!("{} datasets above 4 KiB without fletcher32, first {path}", content.unguarded.len()));
    let guarded = if note.is_none() { Verdict::Ok } else { Verdict::Warn };
    rows.push(Rule::Checksums, "", Some(content.unguarded.len() as f64), Some(Bound::AtMost(0.0)), guarded, note);
    let stated = &file.header().content_sha256;
    let agrees = stated.eq_ignore_ascii_case(&content.sha256);
    let note = if agrees { format!("{:.12}...", content.sha256) } else { format!("{} from the data, \"{stated}\" stated", content.sha256) };
    rows.push(Rule::Digest, "@content_sha256", None, None, verdict(agrees), Some(note));
}

fn verdict(holds: bool) -> Verdict {
    if holds { Verdict::Ok } else { Verdict::Fail }
}

/// One dataset per mode and no more; stress of the right shape where there is any.
fn check_counts(file: &ModalFile) -> Result<(), ModalFileError> {
    let n = file.header().mode_count;
    for quantity in ["displacement", "rotation", "stress"] {
        let group = format!("modes/{quantity}");
        let found = file.file.children(&group).len();
        if quantity == "displacement" && !file.file.has(&group) {
            let expected = "a group with one dataset per mode".to_owned();
            return Err(ModalFileError::Missing { file: file.path().to_owned(), object: group, expected });
        }
        let needed = file.file.has(&group);
        if needed && found != n {
            let (path, expected) = (file.path().to_owned(), format!("{n}: one dataset per mode"));
            return Err(ModalFileError::WrongShape { file: path, object: group, found: format!("{found} datasets"), expected });
        }
    }
    for quantity in ["displacement", "rotation"].into_iter().filter(|q| file.file.has(&format!("modes/{q}"))) {
        (0..n).try_for_each(|mode| file.displacement_dataset(quantity, mode).map(drop))?;
    }
    if let Some(location) = file.stress_location()? {
        let stress_rows = file.stress_rows(location)?;
        (0..n).try_for_each(|mode| file.stress_dataset(mode, stress_rows).map(drop))?;
    }
    if file.file.has("mesh/cell_material") {
        file.sized("mesh/cell_material", &[file.cell_shape()?.0], "(cells)")?.read::<u8>()?;
    }
    Ok(())
}

fn judge_modes(rows: &mut Rows, body: &ModalBody) {
    let lowest = minimum(body.frequency_hz.iter().copied());
    rows.judge(Rule::FrequencyPositive, "modes/frequency", lowest, Bound::MoreThan(0.0));
    let drop = body.frequency_hz.windows(2).map(|pair| pair[0] - pair[1]).fold(0.0, f64::max);
    rows.judge(Rule::FrequencyOrder, "modes/frequency", drop, Bound::AtMost(0.0));
    rows.judge(Rule::Damping, "modes/damping_ratio", minimum(body.damping_ratio.iter().copied()), Bound::AtLeast(0.0));
    match &body.stiffness {
        None => rows.not_applicable(Rule::Stiffness, "modes/stiffness", "diagonal"),
        Some(stiffness) => {
            let scale = positive(stiffness.amax());
            let softest = -minimum(SymmetricEigen::new(0.5 * (stiffness + stiffness.transpose())).eigenvalues.iter().copied()) / scale;
            rows.judge(Rule::Stiffness, "modes/stiffness", asymmetry(stiffness).max(softest), Bound::AtMost(1e-9));
        }
    }
}

fn judge_rigid(rows: &mut Rows, body: &ModalBody, sums: &LumpedSums) {
    rows.judge(Rule::Mass, "body/mass", body.mass, Bound::MoreThan(0.0));
    let (low, high) = bounding_box(&sums.points);
    let c = body.center_of_mass;
    let outside = (low - c).sup(&(c - high)).max().max(0.0) / positive(size(&sums.points));
    rows.judge(Rule::CenterOfMass, "body/center_of_mass", outside, Bound::AtMost(1e-12));
    let inertia = body.inertia;
    let scale = positive(inertia.amax());
    rows.judge(Rule::InertiaSymmetry, "body/inertia", (inertia - inertia.transpose()).amax() / scale, Bound::AtMost(1e-12));
    let central = inertia - body.mass * (c.norm_squared() * Matrix3::identity() - c * c.transpose());
    let mut principal: Vec<f64> = (0.5 * (central + central.transpose())).symmetric_eigenvalues().iter().copied().collect();
    principal.sort_by(f64::total_cmp);
    // both relative to the inertia about the origin, because that difference carries its round-off
    rows.judge(Rule::InertiaPositive, "body/inertia", principal[0] / scale, Bound::MoreThan(0.0));
    rows.judge(
        Rule::InertiaTriangle,
        "body/inertia",
        ((principal[2] - principal[0] - principal[1]) / scale).max(0.0),
        Bound::AtMost(1e-12),
    );
}

fn judge_integrals(rows: &mut Rows, body: &ModalBody, modal_mass_departure: Option<f64>) {
    let n = body.mode_count();
    let trace = DMatrix::from_fn(n, n, |j, k| body.second_moment[j * n + k].trace());
    // with rotary inertia the trace is only the translational share of the modal mass
    let limit = Bound::AtMost(MODAL_MASS_LIMIT);
    match modal_mass_departure {
        Some(departure) => rows.judge(Rule::Orthonormality, "inertia/modal_mass", departure, limit),
        None => rows.judge(Rule::Orthonormality, "inertia/second_moment", (trace - DMatrix::identity(n, n)).amax(), limit),
    }
    let mirrored = |j: usize, k: usize| (body.second_moment[j * n + k] - body.second_moment[k * n + j].transpose()).amax();
    let worst = (0..n).flat_map(|j| (0..j + 1).map(move |k| (j, k))).map(|(j, k)| mirrored(j, k)).fold(0.0, f64::max);
    rows.judge(Rule::SecondMomentSymmetry, "inertia/second_moment", worst, Bound::AtMost(1e-12));
    let effective = |values: &[Vector3<f64>]| values.iter().map(|v| v.component_mul(v)).sum::<Vector3<f64>>();
    let bessel = Bound::AtMost(1.0 + 1e-9);
    rows.judge(Rule::BesselTranslation, "inertia/momentum", effective(&body.momentum).max() / body.mass, bessel);
    let turned = effective(&angular_momentum(body)).component_div(&body.inertia.diagonal()).max();
    rows.judge(Rule::BesselRotation, "inertia/first_moment", turned, bessel);
}

fn judge_lumped(rows: &mut Rows, file: &ModalFile, body: &ModalBody, sums: &LumpedSums) {
    const MASS: &str = "mesh/node_mass";
    let rows_are_exact = file.header().node_mass_kind == NodeMassKind::RowSum;
    let (mass, length, inertia) = (body.mass, positive(size(&sums.points)), positive(body.inertia.amax()));
    let exact = Bound::AtMost(if rows_are_exact { 1e-9 } else { 1e-2 });
    let momentum = match (rows_are_exact, sums.single_precision) {
        (true, false) => exact,
        (true, true) => Bound::AtMost(1e-6),
        (false, _) => exact,
    };
    rows.judge(Rule::LumpedMass, MASS, (sums.mass / mass - 1.0).abs(), Bound::AtMost(1e-9));
    rows.judge(Rule::LumpedFirstMoment, MASS, (sums.first_moment - mass * body.center_of_mass).amax() / (mass * length), exact);
    let inertia_limit = Bound::AtMost(if rows_are_exact { 1e-4 } else { 1e-2 });
    rows.judge(Rule::LumpedInertia, MASS, (sums.inertia - body.inertia).amax() / inertia, inertia_limit);
    let off = maximum(sums.momentum.iter().zip(&body.momentum).map(|(a, b)| (a - b).amax())) / mass.sqrt();
    rows.judge(Rule::LumpedMomentum, "inertia/momentum", off, momentum);
    let off = maximum(sums.modal_moment.iter().zip(&body.first_moment).map(|(a, b)| (a - b).amax())) / inertia.sqrt();
    rows.judge_with_warning(Rule::LumpedModalMoment, "inertia/first_moment", off, Bound::AtMost(1e-2), Bound::AtMost(1e-3));
    let off = (&sums.modal_mass - DMatrix::identity(body.mode_count(), body.mode_count())).amax();
    let (object, wanted) = ("modes/displacement", Bound::AtMost(1e-3));
    match file.header().lumping_departure {
        None => rows.judge_with_warning(Rule::LumpedOrthonormality, object, off, Bound::AtMost(1e-2), wanted),
        // the sums agree with themselves; what they changed in the modes of the source is the figure to know
        Some(departure) => {
            let held = if wanted.holds(departure) { Verdict::Ok } else { Verdict::Warn };
            let verdict = if off <= 1e-2 { held } else { Verdict::Fail };
            let note = "the tensors are sums over nodes; by so much did the imported modes depart from orthonormality with these masses";
            rows.push(Rule::LumpedOrthonormality, object, Some(departure.max(off)), Some(wanted), verdict, Some(note.to_owned()));
        }
    }
}

fn judge_boundary(rows: &mut Rows, body: &ModalBody, sums: &LumpedSums) {
    let name = body.boundary.name();
    if body.boundary.holds_root() {
        rows.judge(Rule::RootNodes, "modes/displacement", sums.root_motion / positive(sums.largest_displacement), Bound::AtMost(0.0));
        let object = format!("interfaces/{}/displacement", body.root_interface);
        let shapes = body.interface(&body.root_interface).map_or(&[][..], |root| &root.mode_shape);
        rows.judge(Rule::RootInterface, &object, maximum(shapes.iter().map(nalgebra::Vector6::amax)), Bound::AtMost(0.0));
    } else {
        rows.not_applicable(Rule::RootNodes, "modes/displacement", name);
        rows.not_applicable(Rule::RootInterface, "interfaces", name);
    }
    if body.boundary == Boundary::FreeFree {
        let momentum = maximum(body.momentum.iter().map(Vector3::amax)) / body.mass.sqrt();
        rows.judge(Rule::FreeMomentum, "inertia/momentum", momentum, Bound::AtMost(1e-6));
        let turning = maximum(angular_momentum(body).iter().map(Vector3::amax)) / positive(body.inertia.amax()).sqrt();
        rows.judge(Rule::FreeAngularMomentum, "inertia/first_moment", turning, Bound::AtMost(1e-6));
    } else {
        rows.not_applicable(Rule::FreeMomentum, "inertia/momentum", name);
        rows.not_applicable(Rule::FreeAngularMomentum, "inertia/first_moment", name);
    }
}

fn judge_interfaces(rows: &mut Rows, body: &ModalBody, supports: &[InterfaceSupport], sums: &LumpedSums) {
    let length = positive(size(&sums.points));
    let mut worst = |rule: Rule, dataset: &str, limit: f64, figure: &dyn Fn(usize) -> f64| {
        let each = supports.iter().enumerate().map(|(i, support)| (figure(i), format!("interfaces/{}/{dataset}", support.name)));
        let (figure, object) = each.fold((0.0, "interfaces".to_owned()), |a, b| if b.0 <= a.0 { a } else { b });
        rows.judge(rule, &object, figure, Bound::AtMost(limit));
    };
    worst(Rule::InterfaceWeights, "weights", 1e-12, &|i| (supports[i].weights.iter().sum::<f64>() - 1.0).abs());
    worst(Rule::InterfacePosition, "position", 1e-9, &|i| {
        let mean: Vector3<f64> = supports[i].nodes.iter().zip(&supports[i].weights).map(|(&node, w)| *w * sums.points[node]).sum();
        (mean - body.interfaces[i].position).amax() / length
    });
    worst(Rule::InterfaceTranslation, "displacement", 1e-6, &|i| {
        let shapes = body.interfaces[i].mode_shape.iter().map(|shape| shape.fixed_rows::<3>(3).into_owned());
        maximum(sums.interface_translation[i].iter().zip(shapes).map(|(a, b)| (a - b).amax())) / positive(sums.largest_displacement)
    });
    worst(Rule::InterfaceOrientation, "orientation", 1e-9, &|i| {
        let r = body.interfaces[i].orientation;
        (r.transpose() * r - Matrix3::identity()).amax().max((r.determinant() - 1.0).abs())
    });
    let root = body.interface(&body.root_interface).map_or(f64::NAN, |root| root.position.amax() / length);
    rows.judge(Rule::RootPosition, &format!("interfaces/{}/position", body.root_interface), root, Bound::AtMost(1e-9));
}

fn judge_geometric(rows: &mut Rows, file: &ModalFile, body: &ModalBody) -> Result<(), ModalFileError> {
    let mut worst: Option<(f64, String)> = None;
    let mut consider = |matrices: &[DMatrix<f64>], object: &str| {
        let scale = positive(maximum(matrices.iter().map(DMatrix::amax)));
        let figure = maximum(matrices.iter().map(|m| (m - m.transpose()).amax())) / scale;
        if worst.as_ref().is_none_or(|(so_far, _)| figure > *so_far) {
            worst = Some((figure, object.to_owned()));
        }
    };
    if let Some(matrices) = &body.geometric_stiffness {
        consider(matrices, "geometric/stiffness");
    }
    for name in file.interface_names() {
        if let Some(matrices) = file.read_interface_geometric_stiffness(&name)? {
            consider(&matrices, &format!("geometric/{name}"));
        }
    }
    match worst {
        Some((figure, object)) => rows.judge(Rule::GeometricSymmetry, &object, figure, Bound::AtMost(1e-9)),
        None => rows.not_applicable(Rule::GeometricSymmetry, "geometric", "no geometric stiffness"),
    }
    Ok(())
}

/// Angular momentum of each mode about the origin: as stored, or epsilon : Q.
#[must_use]
pub fn angular_momentum(body: &ModalBody) -> Vec<Vector3<f64>> {
    let from_moment = |q: &Matrix3<f64>| Vector3::new(q[(1, 2)] - q[(2, 1)], q[(2, 0)] - q[(0, 2)], q[(0, 1)] - q[(1, 0)]);
    body.angular_momentum.clone().unwrap_or_else(|| body.first_moment.iter().map(from_moment).collect())
}

fn asymmetry(matrix: &DMatrix<f64>) -> f64 {
    (matrix - matrix.transpose()).amax() / positive(matrix.amax())
}

fn bounding_box(points: &[Vector3<f64>]) -> (Vector3<f64>, Vector3<f64>) {
    let start = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    points.iter().fold(start, |(low, high), p| (low.inf(p), high.sup(p)))
}

/// Largest coordinate of any node (m).
fn size(points: &[Vector3<f64>]) -> f64 {
    maximum(points.iter().map(Vector3::amax))
}

fn maximum(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

fn minimum(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::INFINITY, f64::min)
}

/// A scale to divide by; zero scales only zeros.
fn positive(value: f64) -> f64 {
    if value > 0.0 { value } else { 1.0 }
}
