//! HDF5 files from a sound one and a list of edits: libfuzzer mutates the list, so that most files get past the C library into our own code.
//!
//! The first byte chooses the sound file. Every edit is eight bytes: what, on which object, with which other object, attribute or value.
//! Objects and values are numbers modulo how many there are, so that every list means something. An edit that HDF5 refuses has no effect.

use hdf5::types::{FixedAscii, VarLenUnicode};
use hdf5::{File, Group, IndexType, IterationOrder, Location, LocationType};
use std::path::Path;

/// Bytes of an edit.
const EDIT: usize = 8;
/// Most edits of a list.
const EDITS: usize = 24;
/// Most numbers of a dataset that an edit makes.
const NUMBERS: usize = 1 << 16;
/// Integers that counts, node numbers, families and extents may lie about.
const INTEGERS: [i64; 24] = [
    0, 1, -1, 2, 3, 4, 5, 6, 7, 8, 16, 19, 20, 21, 32, 60, 64, 65, 500, 501, i32::MAX as i64, i64::MAX, i64::MIN, 1 << 40,
];
/// Real numbers at the edges of what is allowed.
const REALS: [f64; 20] = [
    0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 3.0, 1e-3, 1e-12, 1e-160, 1e-308, 1e3, 1e12, 1e99, 1e101, 1e160, 1e308, f64::NAN, f64::INFINITY,
    f64::NEG_INFINITY,
];
/// Texts that attributes hold, and names of objects.
const TEXTS: [&str; 40] = [
    "", "body", "plate", "root", "tip", "cantilever", "free-free", "craig-bampton", "general", "rbe2", "rbe3", "SI", "1.0", "2.0",
    "flexible-body-modes", "pliant-results", "elastic", "nodal", "consistent", "lumped", "node", "cell", "volume", "surface", "HE8", "H20", "TE4", "T10",
    "TR3", "TR6", "QU4", "PE6", "PY5", "SE2", "NOE", "MED_NO_PROFILE_INTERNAL", "VTKHDF", "mode 1, mode 2", "residual mode 1", "\u{1b}[2J",
];

/// A sound file with the names of what it holds.
pub struct Seed {
    bytes: &'static [u8],
    /// Groups, then datasets.
    objects: Vec<(String, LocationType)>,
}

impl Seed {
    /// Lists the objects of a file; `scratch` is a name that may be written.
    pub fn of(bytes: &'static [u8], scratch: &Path) -> Self {
        std::fs::write(scratch, bytes).expect("the folder can be written");
        hdf5::silence_errors(true);
        let file = File::open(scratch).expect("the file is sound");
        let mut objects = Vec::new();
        list(&file, "", &mut objects);
        file.close().expect("the file was only read");
        Self { bytes, objects }
    }
}

fn list(group: &Group, prefix: &str, objects: &mut Vec<(String, LocationType)>) {
    let mut names = Vec::new();
    let visited = group.iter_visit(IndexType::Name, IterationOrder::Native, |name, _| {
        names.push(name.to_owned());
        Ok(())
    });
    visited.expect("the file is sound");
    for name in names {
        let path = format!("{prefix}{name}");
        match group.loc_type_by_name(&name).expect("the file is sound") {
            LocationType::Group => {
                objects.push((path.clone(), LocationType::Group));
                list(&group.group(&name).expect("the file is sound"), &format!("{path}/"), objects);
            }
            other => objects.push((path, other)),
        }
    }
}

/// Writes the file that `list` describes.
pub fn build(seeds: &[Seed], list: &[u8], file: &Path) {
    let (&first, list) = list.split_first().unwrap_or((&0, &[]));
    let seed = &seeds[first as usize % seeds.len()];
    std::fs::write(file, seed.bytes).expect("the folder can be written");
    let edits: Vec<Edit> = list.chunks_exact(EDIT).take(EDITS).map(|bytes| Edit(bytes.try_into().expect("eight bytes"))).collect();
    let in_bytes = |edit: &&Edit| edit.0[0] >= BYTES_FROM;
    if edits.iter().any(|edit| !in_bytes(&edit)) {
        let opened = File::open_rw(file).expect("the file is sound");
        for edit in edits.iter().filter(|edit| !in_bytes(edit)) {
            // what HDF5 itself refuses to write cannot be met in a file either
            let _ = edit.apply(&opened, seed);
        }
        // edits may have left links to objects that are still open; the library writes all it has
        let _ = opened.close();
    }
    if edits.iter().any(|edit| in_bytes(&edit)) {
        let mut bytes = std::fs::read(file).expect("the file was written");
        edits.iter().filter(in_bytes).for_each(|edit| edit.damage(&mut bytes));
        std::fs::write(file, bytes).expect("the folder can be written");
    }
}

/// From this kind on an edit damages bytes; the others change objects.
const BYTES_FROM: u8 = 208;

struct Edit([u8; EDIT]);

impl Edit {
    fn word(&self, at: usize) -> usize {
        usize::from(u16::from_le_bytes([self.0[at], self.0[at + 1]]))
    }

    fn object<'s>(&self, at: usize, seed: &'s Seed) -> &'s str {
        &seed.objects[usize::from(self.0[at]) % seed.objects.len()].0
    }

    fn text(&self, at: usize) -> &'static str {
        TEXTS[usize::from(self.0[at]) % TEXTS.len()]
    }

    fn integer(&self, at: usize) -> i64 {
        INTEGERS[usize::from(self.0[at]) % INTEGERS.len()]
    }

    fn real(&self, at: usize) -> f64 {
        REALS[usize::from(self.0[at]) % REALS.len()]
    }

    fn apply(&self, file: &File, seed: &Seed) -> hdf5::Result<()> {
        let object = self.object(1, seed);
        let other = self.object(2, seed);
        let (folder, _) = object.rsplit_once('/').unwrap_or(("", object));
        match self.0[0] % 16 {
            0 => file.unlink(object),
            1 => file.relink(object, &format!("{folder}/{}", self.text(3))),
            2 => {
                // in place of another object: exchanged, shared or circular
                file.unlink(other)?;
                file.link_hard(&format!("/{object}"), other)
            }
            3 => file.link_hard(&format!("/{object}"), &format!("{other}/{}", self.text(3))),
            4 => file.link_soft(&format!("/{other}"), &format!("{folder}/{}", self.text(3))),
            5 => file.link_external("other.h5", "/x", &format!("{folder}/{}", self.text(3))),
            6 => file.create_group(&format!("{object}/{}", self.text(3))).map(drop),
            7 | 8 => self.reshape(file, object),
            9..=11 => self.set_number(file, object),
            12 => self.scale(file, object),
            13 => self.remove_attribute(file, object),
            _ => self.set_attribute(file, object),
        }
    }

    /// Another shape, type or storage, filled with what was there.
    fn reshape(&self, file: &File, path: &str) -> hdf5::Result<()> {
        let dataset = file.dataset(path)?;
        let mut shape = dataset.shape();
        let axis = usize::from(self.0[2]) % shape.len().max(1);
        let extent = match self.0[3] {
            n @ 0..200 => usize::from(n),
            n => shape.get(axis).copied().unwrap_or(1).saturating_add_signed(isize::from(n as i8)),
        };
        match self.0[4] % 4 {
            0 if axis < shape.len() => shape[axis] = extent,
            1 => shape.insert(axis.min(shape.len()), extent),
            2 if axis < shape.len() => drop(shape.remove(axis)),
            _ => {}
        }
        let count = shape.iter().try_fold(1_usize, |n, &e| n.checked_mul(e)).filter(|n| *n <= NUMBERS);
        let Some(count) = count else { return Ok(()) };
        let old = dataset.read_raw::<f64>().unwrap_or_default();
        drop(dataset);
        file.unlink(path)?;
        let value = |i: usize| if old.is_empty() { self.real(5) } else { old[i % old.len()] };
        let values = (0..count).map(value);
        macro_rules! create {
            ($kind:ty, $values:expr) => {{
                let builder = file.new_dataset::<$kind>().shape(shape.clone());
                let chunk: Vec<usize> = shape.iter().map(|e| e.div_ceil(2).max(1)).collect();
                let dataset = match self.0[6] % 4 {
                    1 if count > 0 && !shape.is_empty() => builder.chunk(chunk).shuffle().deflate(1).create(path)?,
                    2 if count > 0 && !shape.is_empty() => builder.chunk(chunk).fletcher32().create(path)?,
                    _ => builder.create(path)?,
                };
                // chunks that were never written stay holes
                if self.0[6] % 8 < 4 { dataset.write_raw(&$values.collect::<Vec<$kind>>()) } else { Ok(()) }
            }};
        }
        match self.0[7] % 6 {
            0 | 1 => create!(f64, values),
            2 => create!(f32, values.map(|v| v as f32)),
            3 => create!(i64, values.map(|v| v as i64)),
            4 => create!(i32, values.map(|v| v as i32)),
            _ => create!(u8, values.map(|v| v as u8)),
        }
    }

    /// Some numbers of a dataset, of its own type.
    fn set_number(&self, file: &File, path: &str) -> hdf5::Result<()> {
        let dataset = file.dataset(path)?;
        let datatype = dataset.dtype()?;
        let count = dataset.size();
        if count == 0 || count > NUMBERS {
            return Ok(());
        }
        let at = self.word(2) % count;
        let run = usize::from(self.0[4]).min(count - at);
        if datatype.is::<f64>() || datatype.is::<f32>() {
            let mut values = dataset.read_raw::<f64>()?;
            values[at..][..run].fill(if self.0[6] % 2 == 0 { self.real(5) } else { f64::from(self.0[5] as i8) / 16.0 });
            dataset.write_raw(&values)
        } else {
            let mut values = dataset.read_raw::<i64>()?;
            values[at..][..run].fill(if self.0[6] % 2 == 0 { self.integer(5) } else { i64::from(self.0[5] as i8) });
            dataset.write_raw(&values)
        }
    }

    fn scale(&self, file: &File, path: &str) -> hdf5::Result<()> {
        let dataset = file.dataset(path)?;
        if dataset.size() == 0 || dataset.size() > NUMBERS {
            return Ok(());
        }
        let mut values = dataset.read_raw::<f64>()?;
        values.iter_mut().for_each(|v| *v *= self.real(5));
        dataset.write_raw(&values)
    }

    /// The attribute's name, by number among those that are there.
    fn attribute(&self, location: &Location) -> hdf5::Result<String> {
        let names = location.attr_names()?;
        Ok(names.get(usize::from(self.0[2]) % names.len().max(1)).map_or_else(|| self.text(3).to_owned(), Clone::clone))
    }

    fn remove_attribute(&self, file: &File, path: &str) -> hdf5::Result<()> {
        at(file, path, self.0[6], |location| location.delete_attr(&self.attribute(location)?))
    }

    fn set_attribute(&self, file: &File, path: &str) -> hdf5::Result<()> {
        at(file, path, self.0[6], |location| self.set_attribute_of(location))
    }

    fn set_attribute_of(&self, location: &Location) -> hdf5::Result<()> {
        let name = self.attribute(location)?;
        if location.attr_names()?.contains(&name) {
            location.delete_attr(&name)?;
        }
        let name = name.as_str();
        match self.0[7] % 8 {
            0 => location.new_attr::<i32>().create(name)?.write_scalar(&(self.integer(5) as i32)),
            1 => location.new_attr::<i64>().create(name)?.write_scalar(&self.integer(5)),
            2 => location.new_attr::<f64>().create(name)?.write_scalar(&self.real(5)),
            3 => location.new_attr::<f32>().create(name)?.write_scalar(&(self.real(5) as f32)),
            4 => location.new_attr::<i32>().shape([usize::from(self.0[4] % 4)]).create(name).map(drop),
            5 => {
                let text: VarLenUnicode = self.text(5).parse().unwrap_or_default();
                location.new_attr::<VarLenUnicode>().create(name)?.write_scalar(&text)
            }
            _ => {
                let text = FixedAscii::<96>::from_ascii(self.text(5).as_bytes()).unwrap_or_default();
                location.new_attr::<FixedAscii<96>>().create(name)?.write_scalar(&text)
            }
        }
    }

    /// Damage of the kinds that disks and cut transfers make.
    fn damage(&self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let at = (self.word(1) | usize::from(self.0[3]) << 16) % bytes.len();
        match self.0[0] % 6 {
            0 => bytes.truncate(at),
            1 => {
                let run = usize::from(self.0[4]).min(bytes.len() - at);
                bytes[at..][..run].fill(self.0[5]);
            }
            2 => {
                let run = usize::from(self.0[4] % 16).min(bytes.len() - at);
                let value = self.integer(5).to_le_bytes();
                bytes[at..].iter_mut().zip(value).take(run).for_each(|(byte, new)| *byte = new);
            }
            _ => bytes[at] = self.0[4],
        }
    }
}

/// Does something at an object, or at the root.
fn at<T>(file: &File, path: &str, choice: u8, act: impl FnOnce(&Location) -> hdf5::Result<T>) -> hdf5::Result<T> {
    if choice.is_multiple_of(8) {
        return act(file);
    }
    match file.group(path) {
        Ok(group) => act(&group),
        Err(_) => {
            let dataset = file.dataset(path)?;
            act(&dataset)
        }
    }
}
