//! `pliant import`: a file of another code becomes a modal file, with a report of what was carried, approximated and left out.

use super::args::ImportArguments;
use super::check::health;
use super::failure::{Failure, with_causes};
use crate::io::Verdict;
use crate::io::import::{ImportReport, import_to};
use crate::scene::ImportSpec;
use crate::scene::import_spec::{DensitySpec, InterfaceSpec, NodeMassSpec};
use crate::scene::spec::Numbers;
use std::io::{self, Write};

/// Imports one file.
pub fn run(arguments: &ImportArguments, output: &mut dyn Write) -> Result<(), Failure> {
    let spec = spec(arguments)?;
    let options = spec.options().map_err(|(key, message)| Failure::input(format!("{}: {key}: {message}", arguments.file.display())))?;
    let body = import_to(&arguments.file, &options, &arguments.out).map_err(|error| Failure::input(with_causes(&error)))?;
    let messages = body.examination.messages();
    if arguments.json {
        let report = &body.report;
        let object = serde_json::json!({
            "file": report.file.to_string_lossy(),
            "out": arguments.out.to_string_lossy(),
            "format": report.format,
            "nodes": report.sizes.0,
            "modes": report.sizes.1,
            "mass": report.mass,
            "departure": report.departure,
            "carried": report.carried,
            "approximated": report.approximated,
            "left_out": report.left_out,
            "rules": health::objects(&body.examination.report),
        });
        writeln!(output, "{object}")?;
    } else {
        write_text(&body.report, arguments, output)?;
        let warned = body.examination.report.with_verdict(Verdict::Warn).count();
        writeln!(output, "  rules           all hold, {warned} with a warning: see `pliant check {}`", arguments.out.display())?;
    }
    if messages.is_empty() { Ok(()) } else { Err(Failure::Input(messages)) }
}

fn write_text(report: &ImportReport, arguments: &ImportArguments, output: &mut dyn Write) -> io::Result<()> {
    writeln!(output, "{} ({}) to {}", report.file.display(), report.format, arguments.out.display())?;
    for (name, lines) in [("carried", &report.carried), ("approximated", &report.approximated), ("left out", &report.left_out)] {
        for (i, line) in lines.iter().enumerate() {
            writeln!(output, "  {:<15} {line}", if i == 0 { name } else { "" })?;
        }
    }
    Ok(())
}

/// The keys of the file given by `--keys`, and the options over them.
fn spec(arguments: &ImportArguments) -> Result<ImportSpec, Failure> {
    let mut spec = match &arguments.keys {
        None => ImportSpec::default(),
        Some(path) => {
            let fail = |message: String| Failure::input(format!("{}: {}", path.display(), message.trim_end()));
            let text = std::fs::read_to_string(path).map_err(|e| fail(format!("cannot be read: {e}")))?;
            toml::from_str(&text).map_err(|e| fail(e.to_string()))?
        }
    };
    let set = |key: &mut Option<String>, option: &Option<String>| {
        if option.is_some() {
            key.clone_from(option);
        }
    };
    set(&mut spec.title, &arguments.title);
    set(&mut spec.displacement, &arguments.displacement);
    set(&mut spec.rotation, &arguments.rotation);
    set(&mut spec.stress, &arguments.stress);
    set(&mut spec.boundary, &arguments.boundary);
    set(&mut spec.root, &arguments.root);
    set(&mut spec.mesh, &arguments.mesh);
    if !arguments.frequencies.is_empty() {
        spec.frequency_hz = Some(arguments.frequencies.clone());
    }
    if !arguments.modes.is_empty() {
        spec.modes = Some(arguments.modes.clone());
    }
    if !arguments.damping_ratio.is_empty() {
        spec.damping_ratio = Some(Numbers::Many(arguments.damping_ratio.clone()));
    }
    if arguments.density.is_some() || arguments.areal_density.is_some() || arguments.node_mass.is_some() {
        spec.density = arguments.density.map(DensitySpec::One);
        spec.areal_density = arguments.areal_density;
        spec.node_mass = arguments.node_mass.clone().map(NodeMassSpec::Field);
    }
    for text in &arguments.interface {
        let (name, selection) = interface(text).map_err(|message| Failure::input(format!("--interface {text}: {message}")))?;
        spec.interface.insert(name, selection);
    }
    Ok(spec)
}

/// `NAME=GROUP` or `NAME=box:x,y,z,x,y,z`.
fn interface(text: &str) -> Result<(String, InterfaceSpec), &'static str> {
    const WANTED: &str = "write NAME=GROUP, or NAME=box:x,y,z,x,y,z with the least and the greatest coordinates (m)";
    let (name, selection) = text.split_once('=').ok_or(WANTED)?;
    let Some(numbers) = selection.strip_prefix("box:") else {
        return Ok((name.to_owned(), InterfaceSpec { group: Some(selection.to_owned()), ..InterfaceSpec::default() }));
    };
    let numbers: Vec<f64> = numbers.split(',').map(|word| word.trim().parse().map_err(|_| WANTED)).collect::<Result<_, _>>()?;
    match numbers[..] {
        [a, b, c, d, e, f] => Ok((name.to_owned(), InterfaceSpec { edges: Some([[a, b, c], [d, e, f]]), ..InterfaceSpec::default() })),
        _ => Err(WANTED),
    }
}
