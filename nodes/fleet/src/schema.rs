//! Columns of the tables and their encodings in Parquet.

use std::sync::Arc;

use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::file::properties::WriterProperties;

/// Table `voxels`: a row for each voxel. Counts and sums are null in a map of occupied cells alone, stamps
/// where no point had one or none are kept.
pub fn voxels() -> SchemaRef {
    let needed = ["tile", "ix", "iy", "iz"].map(|name| Field::new(name, DataType::Int64, false));
    let kept = ["count", "sum_x", "sum_y", "sum_z", "first_ns", "last_ns"];
    let kept = kept.map(|name| Field::new(name, DataType::Int64, true));
    Arc::new(Schema::new([&needed[..], &kept[..]].concat()))
}

/// Table `labels`: a row for each label of a voxel.
pub fn labels() -> SchemaRef {
    let names = ["tile", "ix", "iy", "iz", "label", "n"];
    let fields = names.map(|name| Field::new(name, DataType::Int64, false));
    Arc::new(Schema::new(fields.to_vec()))
}

/// Encodings for sorted cells: packed differences of integers, then zstd.
pub fn properties() -> WriterProperties {
    WriterProperties::builder()
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::DELTA_BINARY_PACKED)
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_max_row_group_row_count(Some(1 << 20))
        .build()
}
