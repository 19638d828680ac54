//! What decides the numbers of a campaign, piece by piece, so that what differs can be named.

use super::plan::{Plan, Values};
use crate::scene::Scene;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;
use toml::{Table, Value};

/// Digest of each piece by its name in messages.
pub type Identity = BTreeMap<String, String>;

fn digest(bytes: impl AsRef<[u8]>) -> String {
    Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

/// The identity of a campaign over `scene`, which is the scene without any parameter, with its parsed text `document`; `options` are what
/// the command line changes.
#[must_use]
pub fn identity(scene: &Scene, document: &Table, plan: &Plan, options: &str) -> Identity {
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
    // tables of time functions, and files that parameters choose
    let mut names = Vec::new();
    document.iter().for_each(|(key, value)| texts(key, value, &mut names));
    for parameter in &plan.parameters {
        let (Values::Random(_, values) | Values::Listed { values, .. }) = &parameter.values;
        values.iter().for_each(|value| texts("", value, &mut names));
    }
    let folder = scene.source.path.parent().unwrap_or(Path::new(""));
    for name in names {
        if let Ok(bytes) = std::fs::read(folder.join(name)) {
            add(format!("the file {name}"), digest(bytes));
        }
    }
    pieces
}

/// Texts in a value, some of which name files; those of bodies are known by their content.
fn texts<'v>(key: &str, value: &'v Value, into: &mut Vec<&'v str>) {
    match value {
        _ if ["modal_file", "import"].contains(&key) => {}
        Value::String(text) if !text.is_empty() && !into.contains(&text.as_str()) => into.push(text),
        Value::Array(list) => list.iter().for_each(|v| texts(key, v, into)),
        Value::Table(table) => table.iter().for_each(|(key, v)| texts(key, v, into)),
        _ => {}
    }
}

/// Names of the pieces that differ.
#[must_use]
pub fn differences(a: &Identity, b: &Identity) -> Vec<String> {
    let all: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    all.into_iter().filter(|piece| a.get(*piece) != b.get(*piece)).cloned().collect()
}
