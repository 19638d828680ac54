//! From the fields of a file to mode shapes: which field, which components, which steps, at which frequencies.

use super::error::{ImportError, listed, printable, refused};
use super::mesh::{Field, FieldPlace, FieldStep, ForeignModel};
use super::options::ImportOptions;

/// Components of a displacement and of a rotation, in the spellings of Code_Aster, Abaqus, meshio and others.
const TRANSLATIONS: [[&str; 3]; 4] = [["DX", "DY", "DZ"], ["UX", "UY", "UZ"], ["X", "Y", "Z"], ["U1", "U2", "U3"]];
const ROTATIONS: [[&str; 3]; 4] = [["DRX", "DRY", "DRZ"], ["RX", "RY", "RZ"], ["ROTX", "ROTY", "ROTZ"], ["UR1", "UR2", "UR3"]];
/// Components of a stress in modal files.
const STRESSES: [&str; 6] = ["XX", "YY", "ZZ", "XY", "YZ", "XZ"];

/// Most modes of a body; their sums cost the square of their number.
const MODE_LIMIT: usize = 500;

/// Modes of a file, sorted by frequency.
#[derive(Debug)]
pub(super) struct Modes {
    /// Hz, ascending.
    pub frequency_hz: Vec<f64>,
    /// One per mode.
    pub damping_ratio: Vec<f64>,
    /// x y z of every node in turn, one per mode.
    pub displacement: Vec<Vec<f64>>,
    /// Likewise, where the file has nodal rotations.
    pub rotation: Option<Vec<Vec<f64>>>,
    /// xx yy zz xy yz xz of every node or cell in turn, one per mode.
    pub stress: Option<(FieldPlace, Vec<Vec<f64>>)>,
    /// What a reader of the report should know.
    pub notes: Vec<String>,
}

/// A field and one of its steps for every mode.
type Series<'m> = Vec<(&'m Field, &'m FieldStep)>;

/// Reads the modes that are asked for.
pub(super) fn read(model: &ForeignModel, options: &ImportOptions) -> Result<Modes, ImportError> {
    let needed = |key: &str, found: String, remedy: &str| {
        Err(ImportError::Needed { file: model.file.clone(), key: key.to_owned(), found, remedy: remedy.to_owned() })
    };
    let Some(name) = &options.displacement else {
        let found = format!("the fields {}", model.field_names());
        return needed("displacement", found, "name the field of the mode shapes, or a pattern such as \"mode_*\"");
    };
    let all = series(model, "displacement", name)?;
    let chosen = chosen_steps(model, options, all.len())?;
    let pick =
        |series: Series<'_>| -> Vec<(Field, FieldStep)> { chosen.iter().map(|&i| (series[i].0.clone(), series[i].1.clone())).collect() };
    let shapes = pick(all.clone());
    let count = shapes.len();
    if count > MODE_LIMIT {
        let (found, expected) = (format!("{count} modes"), format!("at most {MODE_LIMIT}"));
        return Err(refused(&model.file, "displacement", found, expected, "retain those that matter (modes = [...])"));
    }
    // steps may all refer to one array, so that the file's length alone does not bound what they hold together
    model.source.budget().check(&model.file, "the shapes of all modes", count * 3 * model.points.len())?;

    let frequency = match &options.frequency_hz {
        Some(list) if list.len() == count => list.clone(),
        Some(list) => {
            let (found, expected) = (format!("{} numbers", list.len()), format!("{count}: one per retained mode"));
            return Err(refused(&model.file, "frequency_hz", found, expected, "give one frequency per mode"));
        }
        None => times(model, &all, &chosen)?,
    };
    if let Some(mode) = frequency.iter().position(|f| !(*f > 0.0 && f.is_finite())) {
        let (object, found) = (format!("the frequency of mode {}", chosen[mode] + 1), format!("{} Hz", frequency[mode]));
        let remedy = "leave rigid-body modes out (modes = [...]), or give frequency_hz";
        return Err(refused(&model.file, object, found, "more than zero", remedy));
    }
    let damping = match options.damping_ratio.as_deref() {
        None => return needed("damping_ratio", "none".to_owned(), "give one number, or one per mode; 0.0 if none is wanted"),
        Some([one]) => vec![*one; count],
        Some(list) if list.len() == count => list.to_vec(),
        Some(list) => {
            let (found, expected) = (format!("{} numbers", list.len()), format!("one, or {count}: one per retained mode"));
            return Err(refused(&model.file, "damping_ratio", found, expected, "give one damping ratio per mode"));
        }
    };

    let mut notes = Vec::new();
    let columns = columns(model, &shapes[0].0, &TRANSLATIONS, "displacement")?;
    let displacement = gather(model, &shapes, &columns)?;
    let rotation = match (&options.rotation, named(&shapes[0].0, &ROTATIONS)) {
        (Some(name), _) => {
            let turns = same_length(model, "rotation", name, all.len()).map(pick)?;
            let columns = self::columns(model, &turns[0].0, &ROTATIONS, "rotation")?;
            Some(gather(model, &turns, &columns)?)
        }
        (None, Some(columns)) => Some(gather(model, &shapes, &columns)?),
        (None, None) => None,
    };
    let stress = match &options.stress {
        None => None,
        Some(name) => {
            let states = same_length(model, "stress", name, all.len()).map(pick)?;
            let rows = if states[0].0.place == FieldPlace::Node { model.points.len() } else { model.cell_count() };
            model.source.budget().check(&model.file, "the stress of all modes", count.saturating_mul(6 * rows))?;
            let columns = stress_columns(model, &states[0].0, options.stress_components.as_deref())?;
            Some((states[0].0.place, gather(model, &states, &columns)?))
        }
    };
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| frequency[a].total_cmp(&frequency[b]));
    if order.windows(2).any(|pair| pair[0] > pair[1]) {
        notes.push("modes sorted by frequency".to_owned());
    }
    let sort = |modes: Vec<Vec<f64>>| -> Vec<Vec<f64>> {
        let mut modes: Vec<Option<Vec<f64>>> = modes.into_iter().map(Some).collect();
        order.iter().filter_map(|&i| modes[i].take()).collect()
    };
    Ok(Modes {
        frequency_hz: order.iter().map(|&i| frequency[i]).collect(),
        damping_ratio: order.iter().map(|&i| damping[i]).collect(),
        displacement: sort(displacement),
        rotation: rotation.map(sort),
        stress: stress.map(|(place, modes)| (place, sort(modes))),
        notes,
    })
}

/// The steps of a field, or the fields that fit a pattern in the order of their numbers.
fn series<'m>(model: &'m ForeignModel, key: &str, name: &str) -> Result<Series<'m>, ImportError> {
    if let Some(field) = model.field(name) {
        return Ok(field.steps.iter().map(|step| (field, step)).collect());
    }
    let mut found: Vec<(u64, &Field)> = Vec::new();
    if let Some((before, after)) = name.split_once('*') {
        let number = |field: &Field| field.name.strip_prefix(before)?.strip_suffix(after)?.parse().ok();
        found = model.fields.iter().filter_map(|field| Some((number(field)?, field))).collect();
        found.sort_by_key(|(number, _)| *number);
    }
    if found.is_empty() {
        let (object, expected) = (format!("{key} = \"{}\"", printable(name)), format!("one of {}", model.field_names()));
        return Err(refused(&model.file, object, "no field of that name", expected, "name a field of the file"));
    }
    if let Some((_, field)) = found.iter().find(|(_, field)| field.steps.len() != 1) {
        let (object, found) = (format!("field \"{}\"", printable(&field.name)), format!("{} steps", field.steps.len()));
        return Err(refused(
            &model.file,
            object,
            found,
            "one step, as the pattern counts modes by names",
            "name the field without a pattern",
        ));
    }
    Ok(found.into_iter().map(|(_, field)| (field, &field.steps[0])).collect())
}

/// A series of as many steps as there are mode shapes.
fn same_length<'m>(model: &'m ForeignModel, key: &str, name: &str, count: usize) -> Result<Series<'m>, ImportError> {
    let series = series(model, key, name)?;
    if series.len() == count {
        return Ok(series);
    }
    let (object, found) = (format!("{key} = \"{}\"", printable(name)), format!("{} steps", series.len()));
    Err(refused(&model.file, object, found, format!("{count}, as many as mode shapes"), "export both for the same modes"))
}

/// 0-based steps to retain.
fn chosen_steps(model: &ForeignModel, options: &ImportOptions, available: usize) -> Result<Vec<usize>, ImportError> {
    let fault = |found: String| {
        let expected = format!("numbers from 1 to {available}, each once");
        Err(refused(&model.file, "modes", found, expected, "name steps of the displacement field"))
    };
    let Some(list) = &options.modes else { return Ok((0..available).collect()) };
    let mut seen = vec![false; available];
    for &mode in list {
        if mode == 0 || mode > available {
            return fault(format!("mode {mode}"));
        }
        if std::mem::replace(&mut seen[mode - 1], true) {
            return fault(format!("mode {mode} twice"));
        }
    }
    if list.is_empty() { fault("none".to_owned()) } else { Ok(list.iter().map(|mode| mode - 1).collect()) }
}

/// Frequencies from the times of the steps; never from times that only count them.
fn times(model: &ForeignModel, all: &Series<'_>, chosen: &[usize]) -> Result<Vec<f64>, ImportError> {
    let times: Vec<Option<f64>> = all.iter().map(|(_, step)| step.time).collect();
    let counted = times.iter().zip(all).enumerate().all(|(i, (t, (_, step)))| *t == Some(step.number as f64) || *t == Some(i as f64));
    let constant = times.len() > 1 && times.iter().all(|t| *t == times[0]);
    let found = if times.iter().any(Option::is_none) {
        "steps without time"
    } else if counted {
        "times that count the steps"
    } else if constant {
        "the same time in all steps"
    } else {
        return Ok(chosen.iter().filter_map(|&i| times[i]).collect());
    };
    Err(ImportError::Needed {
        file: model.file.clone(),
        key: "frequency_hz".to_owned(),
        found: found.to_owned(),
        remedy: "give the frequency of every retained mode (Hz)".to_owned(),
    })
}

/// Places of three named components.
fn named(field: &Field, spellings: &[[&str; 3]]) -> Option<Vec<usize>> {
    let find = |name: &str| field.components.iter().position(|c| c.eq_ignore_ascii_case(name));
    spellings.iter().find_map(|names| names.iter().map(|name| find(name)).collect())
}

/// Places of the components of a vector: by name, or all three where none has a name.
fn columns(model: &ForeignModel, field: &Field, spellings: &[[&str; 3]], key: &str) -> Result<Vec<usize>, ImportError> {
    let object = format!("field \"{}\"", printable(&field.name));
    if field.place != FieldPlace::Node {
        return Err(refused(&model.file, object, "a field on cells", format!("a nodal field for {key}"), "export it at the nodes"));
    }
    if let Some(columns) = named(field, spellings) {
        return Ok(columns);
    }
    if field.components.len() == 3 && field.components.iter().all(String::is_empty) {
        return Ok(vec![0, 1, 2]);
    }
    let expected = format!("three components, named {} or not at all", spellings[0].join(" "));
    Err(refused(
        &model.file,
        object,
        components(field),
        expected,
        "export displacements and rotations as vectors of their own, or name the components",
    ))
}

/// Places of xx yy zz xy yz xz.
fn stress_columns(model: &ForeignModel, field: &Field, order: Option<&[String]>) -> Result<Vec<usize>, ImportError> {
    let tail = |name: &String| {
        let letters: Vec<char> = name.to_ascii_uppercase().chars().collect();
        let mut last: Vec<char> = letters[letters.len().saturating_sub(2)..].to_vec();
        last.sort_unstable();
        last.into_iter().collect::<String>()
    };
    let unnamed = field.components.iter().all(String::is_empty);
    let names: Vec<String> = match order {
        Some(order) => order.iter().map(tail).collect(),
        // the order of VTK, in which XDMF has its Tensor6
        None if unnamed => STRESSES.map(ToOwned::to_owned).to_vec(),
        None => field.components.iter().map(tail).collect(),
    };
    let columns: Option<Vec<usize>> = STRESSES.iter().map(|name| names.iter().position(|n| n == name)).collect();
    match columns.filter(|_| names.len() == field.components.len()) {
        Some(columns) => Ok(columns),
        None => {
            let (object, expected) =
                (format!("field \"{}\"", printable(&field.name)), "components that end in xx yy zz xy yz xz, each once");
            let found = order.map_or_else(|| components(field), |order| format!("{} for {}", components(field), order.join(" ")));
            Err(refused(&model.file, object, found, expected, "give their order as stress_components = [\"xx\", ...]"))
        }
    }
}

fn components(field: &Field) -> String {
    format!("{} components {}", field.components.len(), listed(field.components.iter().map(String::as_str)))
}

/// Some components of every step, row after row.
fn gather(model: &ForeignModel, series: &[(Field, FieldStep)], columns: &[usize]) -> Result<Vec<Vec<f64>>, ImportError> {
    let width = series[0].0.components.len();
    let read = |(field, step): &(Field, FieldStep)| {
        if field.components.len() != width {
            let (object, found) = (format!("field \"{}\"", printable(&field.name)), components(field));
            return Err(refused(&model.file, object, found, format!("{width} as in the first mode"), "export all modes alike"));
        }
        let values = model.values(field, step)?;
        Ok(values.chunks_exact(width).flat_map(|row| columns.iter().map(|&c| row[c])).collect())
    };
    series.iter().map(read).collect()
}
