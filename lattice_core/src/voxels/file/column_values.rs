//! The further columns of a list as bytes: moments, stamps and labels.

use super::read::ColumnError;
use crate::lattice::Lattice;
use crate::voxels::codec::{Varints, push_varint, unzigzag, zigzag};
use crate::voxels::store::fixed_point::moment_unit_m;
use crate::voxels::store::payload_columns::{Columns, Moments};
use crate::voxels::{LabelCount, OFFSET_UNIT_M, Stamps, Voxel};

/// Moments of more points may have wrapped.
const MAX_MOMENT_POINTS: u32 = 1 << 31;

/// Six values a voxel.
pub(super) fn encode_moments(columns: &Columns) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(columns.moments.len().saturating_mul(24));
    let values = columns.moments.iter().flatten();
    values.for_each(|&value| push_varint(&mut bytes, zigzag(value)));
    bytes
}

/// The inverse of [`encode_moments`], for points of which none is more than `reach` off a centre.
pub(super) fn decode_moments(
    bytes: &[u8],
    voxels: &[Voxel],
    lattice: &Lattice,
    reach: u64,
) -> Result<Vec<Moments>, ColumnError> {
    let reach = reach as f64 * OFFSET_UNIT_M / moment_unit_m(lattice) + 2.0;
    let limit_of_one = (reach * reach) as u128;
    let mut values = Varints::new(bytes);
    let mut column = Vec::with_capacity(voxels.len());
    for voxel in voxels {
        let mut moments: Moments = [0; 6];
        for value in &mut moments {
            *value = unzigzag(expect(&mut values)?);
        }
        let limit = limit_of_one.saturating_mul(voxel.count.into());
        let beyond = moments.iter().any(|m| u128::from(m.unsigned_abs()) > limit);
        let [xx, _, _, yy, _, zz] = moments;
        if voxel.count < MAX_MOMENT_POINTS && (beyond || xx < 0 || yy < 0 || zz < 0) {
            let count = voxel.count;
            return Err(values.error(format!("no {count} points in a cell have {moments:?}")));
        }
        column.push(moments);
    }
    expect_end(&mut values)?;
    Ok(column)
}

/// First and last stamp, each as difference to the voxel before.
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

/// The inverse of [`encode_stamps`].
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

/// For each voxel the number of labels, and as often a label and its count.
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

/// The inverse of [`encode_labels`].
pub(super) fn decode_labels(
    bytes: &[u8],
    voxels: usize,
) -> Result<Vec<Vec<LabelCount>>, ColumnError> {
    let mut values = Varints::new(bytes);
    let mut column = Vec::with_capacity(voxels);
    for _ in 0..voxels {
        let len = expect(&mut values)?;
        // Not reserved before they have come.
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

/// The next value, which must be there.
pub(super) fn expect(values: &mut Varints) -> Result<u64, ColumnError> {
    let value = values.next_value()?;
    value.ok_or_else(|| values.error("it has too few values".into()))
}

/// Fails if there are more values.
pub(super) fn expect_end(values: &mut Varints) -> Result<(), ColumnError> {
    match values.next_value()? {
        Some(_) => Err(values.error("it has too many values".into())),
        None => Ok(()),
    }
}
