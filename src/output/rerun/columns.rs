//! Output times gathered into columns: one message per entity for many times costs a small part of one per time.

use rerun::{EntityPath, RecordingStream, RecordingStreamResult, TimeColumn};

/// Most output times per message.
const MOST_TIMES: usize = 512;
/// Memory (bytes) from which on what is gathered is sent, however few times it is.
const MOST_BYTES: usize = 8 << 20;

/// Numbers of one entity, the same count at every time.
struct Numbers {
    entity: EntityPath,
    values: Vec<f64>,
}

/// One arrow of one entity.
struct Arrows {
    entity: EntityPath,
    origins: Vec<[f32; 3]>,
    vectors: Vec<[f32; 3]>,
}

/// Pose of one entity in its parent.
struct Poses {
    entity: EntityPath,
    positions: Vec<[f32; 3]>,
    turns: Vec<rerun::Quaternion>,
}

/// Points of one entity, as many at every time, with colours or without.
struct Surfaces {
    entity: EntityPath,
    points: Vec<[f32; 3]>,
    colours: Vec<[u8; 3]>,
}

/// What entities show at the times gathered so far. Every time hands over the same entities in the same order; an entity is named, which
/// costs more than its numbers, only at the first.
#[derive(Default)]
pub struct Columns {
    times: Vec<f64>,
    numbers: (usize, Vec<Numbers>),
    arrows: (usize, Vec<Arrows>),
    poses: (usize, Vec<Poses>),
    surfaces: (usize, Vec<Surfaces>),
}

/// The next column in order, made by `make` at the first time.
fn next<C>((cursor, columns): &mut (usize, Vec<C>), make: impl FnOnce() -> C) -> Option<&mut C> {
    if *cursor == columns.len() {
        columns.push(make());
    }
    *cursor += 1;
    columns.get_mut(*cursor - 1)
}

impl Columns {
    /// Begins a time (s).
    pub fn begin(&mut self, time: f64) {
        self.times.push(time);
        (self.numbers.0, self.arrows.0, self.poses.0, self.surfaces.0) = (0, 0, 0, 0);
    }

    /// Numbers of the next entity that has some.
    pub fn numbers(&mut self, entity: impl FnOnce() -> EntityPath, values: impl IntoIterator<Item = f64>) {
        if let Some(column) = next(&mut self.numbers, || Numbers { entity: entity(), values: Vec::new() }) {
            column.values.extend(values);
        }
    }

    /// Arrow of the next entity that is one.
    pub fn arrow(&mut self, entity: impl FnOnce() -> EntityPath, origin: [f32; 3], vector: [f32; 3]) {
        if let Some(column) = next(&mut self.arrows, || Arrows { entity: entity(), origins: Vec::new(), vectors: Vec::new() }) {
            column.origins.push(origin);
            column.vectors.push(vector);
        }
    }

    /// Pose of the next entity that moves.
    pub fn pose(&mut self, entity: impl FnOnce() -> EntityPath, position: [f32; 3], turn: rerun::Quaternion) {
        if let Some(column) = next(&mut self.poses, || Poses { entity: entity(), positions: Vec::new(), turns: Vec::new() }) {
            column.positions.push(position);
            column.turns.push(turn);
        }
    }

    /// Points of the next entity that deforms, and their colours if it has any.
    pub fn surface(&mut self, entity: impl FnOnce() -> EntityPath, points: &[[f32; 3]], colours: impl IntoIterator<Item = [u8; 3]>) {
        if let Some(column) = next(&mut self.surfaces, || Surfaces { entity: entity(), points: Vec::new(), colours: Vec::new() }) {
            column.points.extend_from_slice(points);
            column.colours.extend(colours);
        }
    }

    /// True if no more should be gathered.
    pub fn is_full(&self) -> bool {
        let bytes: usize = self.surfaces.1.iter().map(|s| size_of_val(&s.points[..]) + size_of_val(&s.colours[..])).sum();
        self.times.len() >= MOST_TIMES || bytes >= MOST_BYTES
    }

    /// Sends what was gathered and begins anew.
    ///
    /// # Errors
    /// If the numbers do not make columns.
    pub fn send(&mut self, recording: &RecordingStream) -> RecordingStreamResult<()> {
        let count = self.times.len();
        if count == 0 {
            return Ok(());
        }
        let times = TimeColumn::new_duration_secs(super::TIMELINE, self.times.drain(..));
        let times = || [times.clone()];
        // all times have the same share of a column
        let shares = |length: usize| std::iter::repeat_n(length / count, count);
        for Numbers { entity, values } in &mut self.numbers.1 {
            let columns = rerun::Scalars::new(values.iter().copied()).columns(shares(values.len()))?;
            recording.send_columns(entity.clone(), times(), columns)?;
            values.clear();
        }
        for Arrows { entity, origins, vectors } in &mut self.arrows.1 {
            let arrows = rerun::Arrows3D::update_fields().with_vectors(vectors.drain(..)).with_origins(origins.drain(..));
            recording.send_columns(entity.clone(), times(), arrows.columns_of_unit_batches()?)?;
        }
        for Poses { entity, positions, turns } in &mut self.poses.1 {
            let poses =
                rerun::Transform3D::update_fields().with_many_translation(positions.drain(..)).with_many_quaternion(turns.drain(..));
            recording.send_columns(entity.clone(), times(), poses.columns_of_unit_batches()?)?;
        }
        for Surfaces { entity, points, colours } in &mut self.surfaces.1 {
            let length = points.len();
            let mesh = rerun::Mesh3D::update_fields().with_vertex_positions(points.drain(..));
            let mesh = if colours.is_empty() { mesh } else { mesh.with_vertex_colors(colours.drain(..)) };
            recording.send_columns(entity.clone(), times(), mesh.columns(shares(length))?)?;
        }
        Ok(())
    }
}
