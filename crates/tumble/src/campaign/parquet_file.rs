//! The table of a campaign as Parquet: the same columns and rows as `rows.csv`.

use super::row::{COLUMNS, Cell, Kind, Row};
use crate::TumbleError;
use parquet::basic::Compression;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::{ParquetError, Result};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::fs::File;
use std::io::{BufWriter, Error, Write};
use std::path::Path;
use std::sync::Arc;
use tumble_formats::FormatsError;

/// Writes the rows to a file.
///
/// # Errors
/// [`FormatsError::Unwritable`].
pub(super) fn write(path: &Path, rows: &[Row]) -> std::result::Result<(), TumbleError> {
    let unwritable = |source| FormatsError::Unwritable { path: path.into(), source };
    let file = File::create(path).map_err(unwritable)?;
    let written = write_to(BufWriter::new(file), rows);
    let written = written.map_err(|error| match error {
        ParquetError::External(source) => unwritable(Error::other(source)),
        other => unwritable(Error::other(other)),
    });
    Ok(written?)
}

/// The schema in Parquet's own words.
fn schema() -> String {
    let column = |kind, name: &str| match kind {
        Kind::Text => format!("required binary {name} (utf8);"),
        Kind::Count => format!("optional int64 {name};"),
        Kind::Number => format!("optional double {name};"),
        Kind::Flag => format!("optional boolean {name};"),
    };
    let columns: Vec<String> = COLUMNS.iter().map(|c| column(c.kind, &c.name)).collect();
    format!("message mission {{ {} }}", columns.join(" "))
}

fn write_to(out: impl Write + Send, rows: &[Row]) -> Result<()> {
    // Its own name keeps the version of the library, and so of the build, out of the bytes.
    let properties =
        WriterProperties::builder().set_compression(Compression::SNAPPY).set_created_by("tumble".to_owned());
    let schema = Arc::new(parse_message_type(&schema())?);
    let mut writer = SerializedFileWriter::new(out, schema, Arc::new(properties.build()))?;
    let mut group = writer.next_row_group()?;
    let mut index = 0;
    while let Some(mut column) = group.next_column()? {
        let cells = || rows.iter().filter_map(|row| row.cells.get(index));
        match column.untyped() {
            ColumnWriter::Int64ColumnWriter(out) => {
                let (values, levels) = split(cells().map(|cell| match cell {
                    Cell::Count(Some(value)) => i64::try_from(*value).ok(),
                    _ => None,
                }));
                out.write_batch(&values, Some(&levels), None)?;
            }
            ColumnWriter::DoubleColumnWriter(out) => {
                let (values, levels) = split(cells().map(|cell| match cell {
                    Cell::Number(value) => *value,
                    _ => None,
                }));
                out.write_batch(&values, Some(&levels), None)?;
            }
            ColumnWriter::BoolColumnWriter(out) => {
                let (values, levels) = split(cells().map(|cell| match cell {
                    Cell::Flag(value) => *value,
                    _ => None,
                }));
                out.write_batch(&values, Some(&levels), None)?;
            }
            ColumnWriter::ByteArrayColumnWriter(out) => {
                let text = |cell: &Cell| match cell {
                    Cell::Text(text) => ByteArray::from(text.as_str()),
                    _ => ByteArray::from(""),
                };
                let values: Vec<ByteArray> = cells().map(text).collect();
                out.write_batch(&values, None, None)?;
            }
            _ => return Err(ParquetError::General("a column of another kind".to_owned())),
        }
        column.close()?;
        index += 1;
    }
    group.close()?;
    writer.close()?;
    Ok(())
}

/// Values that are there, and for each cell whether it is.
fn split<T>(cells: impl Iterator<Item = Option<T>>) -> (Vec<T>, Vec<i16>) {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    for cell in cells {
        levels.push(i16::from(cell.is_some()));
        values.extend(cell);
    }
    (values, levels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::tests::{plan, rows_of};
    use parquet::file::reader::{FileReader as _, SerializedFileReader};
    use parquet::record::{Field, RowAccessor as _};

    #[test]
    fn a_reader_finds_the_cells_of_the_table() {
        let plan = plan(5);
        let rows = rows_of(&plan);
        let path = tumble_formats::testing::scratch("parquet").join("rows.parquet");
        write(&path, &rows).unwrap();
        let reader = SerializedFileReader::new(File::open(&path).unwrap()).unwrap();
        let mut count = 0;
        for (expected, found) in rows.iter().zip(reader.get_row_iter(None).unwrap()) {
            let found = found.unwrap();
            assert_eq!(found.len(), COLUMNS.len());
            for (index, (name, field)) in found.get_column_iter().enumerate() {
                assert_eq!(*name, COLUMNS[index].name);
                let same = match (&expected.cells[index], field) {
                    (Cell::Text(text), Field::Str(other)) => text == other,
                    (Cell::Count(Some(value)), Field::Long(other)) => i64::try_from(*value) == Ok(*other),
                    (Cell::Number(Some(value)), Field::Double(other)) => value.to_bits() == other.to_bits(),
                    (Cell::Flag(Some(value)), Field::Bool(other)) => value == other,
                    (Cell::Count(None) | Cell::Number(None) | Cell::Flag(None), Field::Null) => true,
                    _ => false,
                };
                assert!(same, "{name}: {field:?}");
            }
            assert_eq!(found.get_long(0).unwrap(), count);
            count += 1;
        }
        assert_eq!(count, i64::try_from(rows.len()).unwrap());
        std::fs::remove_file(path).unwrap();
    }
}
