//! What decides the numbers of a campaign, piece by piece, so that what differs can be named.

use super::plan::{Parameter, Plan, Values};
use crate::scene::Scene;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;
use toml::Value;

/// Digest of each piece by its name in messages.
pub type Identity = BTreeMap<String, String>;

fn digest(bytes: impl AsRef<[u8]>) -> String {
    Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

/// The identity of a campaign over `scene`, which is the scene without any parameter; `options` are what the command line changes.
#[must_use]
pub fn identity(scene: &Scene, plan: &Plan, options: &str) -> Identity {
    let mut pieces = Identity::new();
    let mut add = |what: String, digest: String| {
        pieces.insert(what, digest);
    };
    add("the version of pliant".into(), env!("CARGO_PKG_VERSION").into());
    add("the scene".into(), digest(&scene.source.text));
    add("the plan".into(), digest(&plan.source.text));
    add("the options of the command line".into(), digest(options));
    if let Some(table) = &plan.table {
        add("the table of cases".into(), digest(table));
    }
    for (body, selection) in &scene.flexible {
        add(format!("the modal file of body \"{}\"", scene.system.bodies[*body].name), selection.content_sha256.clone());
    }
    // tables of time functions are in files of their own
    let hinges: Vec<_> = scene.system.bodies.iter().map(|b| format!("{:?}", b.hinge)).collect();
    add("a table that the scene reads".into(), digest(format!("{:?}{hinges:?}", scene.system.loads)));
    let folder = scene.source.path.parent().unwrap_or(Path::new(""));
    for file in plan.parameters.iter().flat_map(texts) {
        if let Ok(bytes) = std::fs::read(folder.join(file)) {
            add(format!("the file {file}"), digest(bytes));
        }
    }
    pieces
}

/// Texts among the values of a parameter: some of them name files.
fn texts(parameter: &Parameter) -> Vec<&str> {
    fn of<'v>(value: &'v Value, into: &mut Vec<&'v str>) {
        match value {
            Value::String(text) if !into.contains(&text.as_str()) => into.push(text),
            Value::Array(list) => list.iter().for_each(|v| of(v, into)),
            Value::Table(table) => table.iter().for_each(|(_, v)| of(v, into)),
            _ => {}
        }
    }
    let (Values::Random(_, values) | Values::Listed { values, .. }) = &parameter.values;
    let mut found = Vec::new();
    values.iter().for_each(|v| of(v, &mut found));
    found
}

/// Names of the pieces that differ.
#[must_use]
pub fn differences(a: &Identity, b: &Identity) -> Vec<String> {
    let all: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    all.into_iter().filter(|piece| a.get(*piece) != b.get(*piece)).cloned().collect()
}
