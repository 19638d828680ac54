//! The Parquet form of a table, through the column writer of the `parquet` crate without its Arrow part. The only file that knows it.

use super::error::ExportError;
use super::history::Table;
use parquet::basic::{Encoding, Repetition, Type as PhysicalType};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::path::Path;
use std::sync::Arc;

/// Output times per row group: a series of ten numbers then takes 5 MB of memory.
const GROUP_ROWS: usize = 1 << 16;

/// Writes the table.
pub(super) fn write(table: &Table<'_>, target: &Path, every: usize) -> Result<(), ExportError> {
    let fail = |cause: String| ExportError::Write { file: target.to_owned(), cause };
    let wrap = |error: ParquetError| fail(error.to_string());
    let column = |name: &String| {
        Type::primitive_type_builder(name, PhysicalType::DOUBLE).with_repetition(Repetition::REQUIRED).build().map(Arc::new)
    };
    let columns = table.blocks.iter().flat_map(|b| &b.names).map(column).collect::<Result<_, _>>().map_err(wrap)?;
    let schema = Type::group_type_builder("histories").with_fields(columns).build().map_err(wrap)?;
    let texts = vec![KeyValue::new("scene_name".to_owned(), table.scene.to_owned())];
    let properties = WriterProperties::builder()
        // histories hardly repeat a number: a dictionary only costs
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::PLAIN)
        .set_created_by(concat!("pliant ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(texts))
        .build();
    let file = std::fs::File::create(target).map_err(|e| fail(e.to_string()))?;
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).map_err(wrap)?;
    for start in (0..table.rows).step_by(GROUP_ROWS) {
        let rows = start..table.rows.min(start + GROUP_ROWS);
        let mut group = writer.next_row_group().map_err(wrap)?;
        for block in &table.blocks {
            let (width, values) = (block.names.len(), block.read(rows.clone())?);
            for i in 0..width {
                let taken = rows.clone().zip(values.chunks_exact(width)).filter(|(row, _)| row.is_multiple_of(every));
                let numbers: Vec<f64> = taken.map(|(_, row)| row[i]).collect();
                let column = group.next_column().map_err(wrap)?;
                let mut column = column.ok_or_else(|| fail("a column too few in the schema".to_owned()))?;
                column.typed::<DoubleType>().write_batch(&numbers, None, None).map_err(wrap)?;
                column.close().map_err(wrap)?;
            }
        }
        group.close().map_err(wrap)?;
    }
    writer.close().map_err(wrap)?;
    Ok(())
}
