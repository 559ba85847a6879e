//! Optional columns of a list as bytes: stamps, labels and colours.

use super::column_error::ColumnError;
use crate::voxels::codec::{Varints, push_varint, unzigzag, zigzag};
use crate::voxels::store::payload_columns::Columns;
use crate::voxels::{ColorSum, LabelCount, Stamps, Voxel};

/// First and last stamp, each as the difference to the previous voxel.
pub(super) fn encode_stamps(columns: &Columns) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(columns.stamps.len().saturating_mul(8));
    let mut before = [0_i64; 2];
    for stamps in &columns.stamps {
        let row = [stamps.first_ns, stamps.last_ns];
        for (value, before) in row.iter().zip(before) {
            push_varint(&mut bytes, zigzag(value.wrapping_sub(before)));
        }
        before = row;
    }
    bytes
}

/// Inverse of [`encode_stamps`].
pub(super) fn decode_stamps(bytes: &[u8], voxels: usize) -> Result<Vec<Stamps>, ColumnError> {
    let mut values = Varints::new(bytes);
    let mut column = Vec::with_capacity(voxels);
    let mut row = [0_i64; 2];
    for _ in 0..voxels {
        for value in &mut row {
            *value = value.wrapping_add(unzigzag(expect(&mut values)?));
        }
        let [first_ns, last_ns] = row;
        let stamps = Stamps { first_ns, last_ns };
        if first_ns > last_ns && stamps != Stamps::NONE {
            return Err(values.error(format!("{first_ns} ns is after the last, {last_ns} ns")));
        }
        column.push(stamps);
    }
    expect_end(&mut values)?;
    Ok(column)
}

/// For each voxel the number of labels, then each label and its count.
pub(super) fn encode_labels(columns: &Columns) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(columns.labels.len().saturating_mul(4));
    for labels in &columns.labels {
        push_varint(&mut bytes, labels.len() as u64);
        for counted in labels {
            push_varint(&mut bytes, counted.label.into());
            push_varint(&mut bytes, counted.count.into());
        }
    }
    bytes
}

/// Inverse of [`encode_labels`].
pub(super) fn decode_labels(
    bytes: &[u8],
    voxels: usize,
) -> Result<Vec<Vec<LabelCount>>, ColumnError> {
    let mut values = Varints::new(bytes);
    let mut column = Vec::with_capacity(voxels);
    for _ in 0..voxels {
        let len = expect(&mut values)?;
        // Memory is not reserved before the values arrive.
        let mut labels: Vec<LabelCount> = Vec::new();
        for _ in 0..len {
            let (label, count) = (expect(&mut values)?, expect(&mut values)?);
            let (Ok(label), Ok(count @ 1..)) = (u16::try_from(label), u32::try_from(count)) else {
                return Err(values.error(format!("label {label} of {count} points")));
            };
            if labels.last().is_some_and(|last| last.label >= label) {
                return Err(values.error(format!("label {label} does not ascend")));
            }
            labels.push(LabelCount { label, count });
        }
        labels.shrink_to_fit();
        column.push(labels);
    }
    expect_end(&mut values)?;
    Ok(column)
}

/// For each voxel the number of coloured points and the sums of red, green and blue.
pub(super) fn encode_colors(columns: &Columns) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(columns.colors.len().saturating_mul(8));
    for ColorSum { count, sum } in columns.colors() {
        push_varint(&mut bytes, count.into());
        sum.iter().for_each(|sum| push_varint(&mut bytes, *sum));
    }
    bytes
}

/// Inverse of [`encode_colors`].
pub(super) fn decode_colors(bytes: &[u8], voxels: &[Voxel]) -> Result<Vec<ColorSum>, ColumnError> {
    let mut values = Varints::new(bytes);
    let mut column = Vec::with_capacity(voxels.len());
    for voxel in voxels {
        let count = expect(&mut values)?;
        let Ok(count) = u32::try_from(count) else {
            return Err(values.error(format!("a voxel has {count} coloured points")));
        };
        let mut color = ColorSum { count, sum: [0; 3] };
        for sum in &mut color.sum {
            *sum = expect(&mut values)?;
        }
        if let Some(reason) = color.contradiction(voxel.count) {
            return Err(values.error(reason));
        }
        column.push(color);
    }
    expect_end(&mut values)?;
    Ok(column)
}

/// Next value; fails at the end.
pub(super) fn expect(values: &mut Varints) -> Result<u64, ColumnError> {
    let value = values.next_value()?;
    value.ok_or_else(|| values.error("there are too few values".into()))
}

pub(super) fn expect_end(values: &mut Varints) -> Result<(), ColumnError> {
    match values.next_value()? {
        Some(_) => Err(values.error("there are too many values".into())),
        None => Ok(()),
    }
}
