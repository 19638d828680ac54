//! `pliant modes`: what a modal file brings to a scene.
//!
//! Effective mass of mode j along a is `p_ja^2 / m`, effective inertia about a through the origin `(epsilon : Q_j)_a^2 / J_aa`;
//! both in percent, and summed over the modes so far.

use super::args::ModesArguments;
use super::check::health;
use super::failure::Failure;
use super::report::{Align, Table, number};
use crate::io::modal_check::angular_momentum;
use crate::io::{Examination, InterfaceSupport, ModalFile, ModeKind, examine};
use crate::model::modal_body::ModalBody;
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::io::{self, Write};

/// Everything the tables show.
struct Summary {
    file: ModalFile,
    body: ModalBody,
    kinds: Vec<ModeKind>,
    supports: Vec<InterfaceSupport>,
    turning: Vec<Vector3<f64>>,
    /// Percent of mass per axis, and of inertia per axis.
    effective: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// The same, summed over the modes so far.
    cumulative: Vec<(Vector3<f64>, Vector3<f64>)>,
}

/// Shows one modal file; fails if a rule is broken, after showing what could be read.
pub fn run(arguments: &ModesArguments, output: &mut dyn Write) -> Result<(), Failure> {
    let mut examination = examine(&arguments.file);
    let messages = examination.messages();
    let Some((file, body)) = examination.content.take() else { return Err(Failure::Input(messages)) };
    let summary = summarise(file, body)?;
    if arguments.json {
        writeln!(output, "{}", object(&summary, &examination, messages.is_empty()))?;
    } else {
        write_text(&summary, &examination, output)?;
    }
    if !messages.is_empty() {
        return Err(Failure::Input(messages));
    }
    if arguments.export.is_some() { super::export::modes(arguments) } else { Ok(()) }
}

fn summarise(file: ModalFile, body: ModalBody) -> Result<Summary, Failure> {
    let (kinds, supports) = (file.read_mode_kinds()?, file.read_interface_supports()?);
    let turning = angular_momentum(&body);
    let axes = body.inertia.diagonal();
    let percent = |(p, l): (&Vector3<f64>, &Vector3<f64>)| {
        (p.component_mul(p) * (100.0 / body.mass), l.component_mul(l).component_div(&axes) * 100.0)
    };
    let effective: Vec<_> = body.momentum.iter().zip(&turning).map(percent).collect();
    let sum = |total: &mut (Vector3<f64>, Vector3<f64>), (mass, inertia): &(Vector3<f64>, Vector3<f64>)| {
        *total = (total.0 + mass, total.1 + inertia);
        Some(*total)
    };
    let cumulative = effective.iter().scan((Vector3::zeros(), Vector3::zeros()), sum).collect();
    Ok(Summary { file, body, kinds, supports, turning, effective, cumulative })
}

fn write_text(summary: &Summary, examination: &Examination, output: &mut dyn Write) -> io::Result<()> {
    let (header, body) = (summary.file.header(), &summary.body);
    writeln!(output, "{}: {}", summary.file.path().display(), header.title)?;
    writeln!(output, "  written by      {} (schema {})", header.generator, header.version)?;
    writeln!(output, "  boundary        {}, root interface \"{}\"", header.boundary.name(), header.root_interface)?;
    writeln!(
        output,
        "  size            {} modes, {} nodes, {} on the surface",
        header.mode_count, header.node_count, header.surface_nodes
    )?;
    writeln!(output, "  mass            {} kg", number(body.mass))?;
    writeln!(output, "  centre of mass  {} m", triple(&body.center_of_mass))?;
    let (j, o) = (body.inertia.diagonal(), Vector3::new(body.inertia[(0, 1)], body.inertia[(1, 2)], body.inertia[(0, 2)]));
    writeln!(output, "  inertia         {} kg m2 (xx yy zz about the origin), {} (xy yz xz of the matrix)", triple(&j), triple(&o))?;
    let held = |present: bool, word: &str| if present { word.to_owned() } else { format!("no {word}") };
    let stress = examination_word(summary.file.stress_location().ok().flatten().is_some());
    let geometric = held(body.geometric_stiffness.is_some(), "geometric stiffness");
    let stiffness = if body.stiffness.is_some() { "full modal stiffness" } else { "diagonal modal stiffness" };
    writeln!(output, "  holds           {stiffness}, {geometric}, {stress}")?;

    if let Ok(Some(source)) = summary.file.inertia_source() {
        writeln!(output, "  integrals       {source}")?;
    }

    let right = |name: &'static str| (name, Align::Right);
    writeln!(output, "\nEffective mass and inertia about the root (percent of mass, of inertia; cumulative below)")?;
    let axes = ["x", "y", "z", "rx", "ry", "rz", "cum x", "cum y", "cum z", "cum rx", "cum ry", "cum rz"].map(right);
    let mut columns = vec![right("mode"), right("Hz"), right("damping"), ("kind", Align::Left)];
    columns.extend(axes);
    let mut table = Table::new(&columns);
    for (j, ((mass, inertia), (total_mass, total_inertia))) in summary.effective.iter().zip(&summary.cumulative).enumerate() {
        let mut row =
            vec![(j + 1).to_string(), number(body.frequency_hz[j]), number(body.damping_ratio[j]), summary.kinds[j].name().to_owned()];
        row.extend([mass, inertia, total_mass, total_inertia].into_iter().flat_map(|v| v.iter().map(|p| format!("{p:.2}"))));
        table.row(row);
    }
    table.write(output)?;

    writeln!(output, "\nParticipation: momentum p (sqrt kg) and angular momentum about the root eps:Q (sqrt kg m)")?;
    let mut table = Table::new(&["mode", "px", "py", "pz", "Lx", "Ly", "Lz"].map(right));
    for (j, (p, l)) in body.momentum.iter().zip(&summary.turning).enumerate() {
        table.row([(j + 1).to_string()].into_iter().chain(p.iter().chain(l.iter()).map(|&v| number(v))));
    }
    table.write(output)?;

    writeln!(output, "\nInterfaces")?;
    let mut table =
        Table::new(&[("name", Align::Left), right("x (m)"), right("y (m)"), right("z (m)"), ("coupling", Align::Left), right("nodes")]);
    for (interface, support) in body.interfaces.iter().zip(&summary.supports) {
        let position = interface.position.iter().map(|&v| number(v));
        let tail = [support.coupling.name().to_owned(), support.nodes.len().to_string()];
        table.row([interface.name.clone()].into_iter().chain(position).chain(tail));
    }
    table.write(output)?;

    writeln!(output, "\nRules")?;
    health::table(&examination.report).write(output)
}

fn examination_word(has_stress: bool) -> &'static str {
    if has_stress { "stress modes" } else { "no stress modes" }
}

fn triple(v: &Vector3<f64>) -> String {
    format!("[{}, {}, {}]", number(v.x), number(v.y), number(v.z))
}

fn array(v: &Vector3<f64>) -> [f64; 3] {
    [v.x, v.y, v.z]
}

fn object(summary: &Summary, examination: &Examination, accepted: bool) -> Value {
    let (header, body) = (summary.file.header(), &summary.body);
    let mode = |j: usize| {
        json!({
            "mode": j + 1,
            "frequency_hz": body.frequency_hz[j],
            "damping_ratio": body.damping_ratio[j],
            "kind": summary.kinds[j].name(),
            "momentum": array(&body.momentum[j]),
            "angular_momentum": array(&summary.turning[j]),
            "effective_mass_percent": array(&summary.effective[j].0),
            "effective_inertia_percent": array(&summary.effective[j].1),
            "cumulative_mass_percent": array(&summary.cumulative[j].0),
            "cumulative_inertia_percent": array(&summary.cumulative[j].1),
        })
    };
    let interfaces = body
        .interfaces
        .iter()
        .zip(&summary.supports)
        .map(|(i, s)| json!({ "name": i.name, "position": array(&i.position), "coupling": s.coupling.name(), "nodes": s.nodes.len() }));
    json!({
        "file": summary.file.path().to_string_lossy(),
        "accepted": accepted,
        "title": header.title,
        "generator": header.generator,
        "version": header.version,
        "boundary": header.boundary.name(),
        "root_interface": header.root_interface,
        "node_count": header.node_count,
        "surface_nodes": header.surface_nodes,
        "mass": body.mass,
        "center_of_mass": array(&body.center_of_mass),
        "inertia": (0..3).map(|a| [body.inertia[(a, 0)], body.inertia[(a, 1)], body.inertia[(a, 2)]]).collect::<Vec<_>>(),
        "full_stiffness": body.stiffness.is_some(),
        "geometric_stiffness": body.geometric_stiffness.is_some(),
        "inertia_source": summary.file.inertia_source().ok().flatten(),
        "stress": summary.file.stress_location().ok().flatten().is_some(),
        "modes": (0..body.mode_count()).map(mode).collect::<Vec<_>>(),
        "interfaces": interfaces.collect::<Vec<_>>(),
        "rules": health::objects(&examination.report),
    })
}
