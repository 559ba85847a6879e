//! Index section of a ROS 1 bag.

use std::collections::BTreeMap;
use std::fs::File;

use super::contents::{Block, Connection, Contents};
use super::record::{Head, MAGIC, RecordError, op};

/// First record of a bag.
pub(super) struct BagHeader {
    /// Offset of the index; 0 if the recorder was killed.
    pub index_pos: u64,
    connections: u32,
    chunks: u32,
    /// Name of the plugin that encrypted it, if any.
    pub encryptor: String,
}

/// Reads the first record.
pub(super) fn bag_header(file: &mut File, size: u64) -> Result<BagHeader, RecordError> {
    let head = Head::read(file, MAGIC.len() as u64, size)?;
    let fields = head.fields();
    let header = || {
        let header = BagHeader {
            index_pos: fields.u64("index_pos")?,
            connections: fields.u32("conn_count")?,
            chunks: fields.u32("chunk_count")?,
            encryptor: fields.text("encryptor").unwrap_or_default(),
        };
        (head.op == op::BAG_HEADER).then_some(header)
    };
    header().ok_or_else(|| RecordError::bad(head.place, "no header of a bag"))
}

/// Connections and chunks by the index; the error is a reason to read the whole file.
pub(super) fn read_index(
    file: &mut File,
    header: &BagHeader,
    size: u64,
) -> Result<Contents, String> {
    if header.index_pos == 0 {
        return Err("it has no index".to_owned());
    }
    let mut contents = Contents::default();
    let mut at = header.index_pos;
    let wrong = |error: RecordError| match error.inside() {
        RecordError {
            place,
            cause: super::record::Cause::Bad(reason),
        } => format!("its index at {place}: {reason}"),
        RecordError { place, .. } => format!("its index at {place} is too large"),
    };
    if at > size {
        return Err(format!("its index begins at byte {at}, beyond its end"));
    }
    while at < size {
        let head = Head::read(file, at, size).map_err(wrong)?;
        match head.op {
            op::CONNECTION => {
                let data = head.data(file).map_err(wrong)?;
                contents.take(head.fields(), &data)?;
            }
            op::CHUNK_INFO => {
                let data = head.data(file).map_err(wrong)?;
                let block = chunk_info(&head, &data, header.index_pos);
                let block = block.ok_or_else(|| format!("its index at byte {at} is invalid"))?;
                for (connection, count) in &block.counts {
                    let total = contents.counts.entry(*connection).or_default();
                    *total = total.saturating_add(*count);
                }
                contents.blocks.push(block);
            }
            op => return Err(format!("its index has a record of kind {op}")),
        }
        at = head.end();
    }
    let counts = (contents.connections.len(), contents.blocks.len());
    let stated = (header.connections as usize, header.chunks as usize);
    if counts != stated {
        return Err(format!(
            "its index has {} connections and {} chunks, its header {} and {}",
            counts.0, counts.1, stated.0, stated.1
        ));
    }
    let known = |id: &u32| contents.connections.contains_key(id);
    if !contents.counts.keys().all(known) {
        return Err("its index counts messages of unknown connections".to_owned());
    }
    // The chunks repeat the connections.
    if !contents.connections.values().all(Connection::is_plausible) {
        return Err("its index has a connection that cannot be read".to_owned());
    }
    contents.blocks.sort_by_key(|block| block.offset);
    let is_same = |pair: &[Block]| match pair {
        [a, b] => a.offset == b.offset,
        _ => false,
    };
    match contents.blocks.windows(2).any(is_same) {
        true => Err("its index has a chunk twice".to_owned()),
        false => Ok(contents),
    }
}

fn chunk_info(head: &Head, data: &[u8], index_pos: u64) -> Option<Block> {
    let fields = head.fields();
    let offset = fields.u64("chunk_pos").filter(|at| *at < index_pos)?;
    let entries = usize::try_from(fields.u32("count")?).ok()?;
    let (start_ns, end_ns) = (fields.time_ns("start_time")?, fields.time_ns("end_time")?);
    if fields.u32("ver")? != 1 || data.len() != entries.checked_mul(8)? {
        return None;
    }
    let mut counts = BTreeMap::new();
    for entry in data.chunks_exact(8) {
        let (connection, count) = entry.split_first_chunk::<4>()?;
        let count = u32::from_le_bytes(*count.first_chunk()?);
        let total: &mut u64 = counts.entry(u32::from_le_bytes(*connection)).or_default();
        *total += u64::from(count);
    }
    counts.retain(|_, count| *count > 0);
    Some(Block {
        offset,
        end: offset + 1,
        start_ns,
        end_ns,
        counts,
        indexed: true,
        behind: false,
    })
}
