//! Thin form of the map for slow links: keys and counts only, both as LEB128, some two bytes a voxel.

use lattice_core::voxels::codec;
use lattice_msgs::RosMessage;
use lattice_msgs::cdr::{self, CdrError};
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};

use super::map_stream::{Entry, entry};
use crate::convert::map::part_colors;

/// Name of the encoding: `keys` contains the Morton keys, then the counts in the same order as LEB128.
pub const ENCODING: &str = "morton21_delta_leb128_counts_leb128";

/// A map message with a thin form.
pub trait Thin: RosMessage {
    /// The same cells with counts only.
    fn thin(self) -> Self;
}

/// Stream entry of a message, in both forms.
pub fn both<M: Thin>(chunk: M) -> Result<Entry, CdrError> {
    let full = entry(cdr::to_vec(&chunk)?);
    Ok(Entry {
        thin: Some(cdr::to_vec(&chunk.thin())?.into()),
        ..full
    })
}

macro_rules! thin {
    ($($message:ty),*) => {
        $(impl Thin for $message {
            fn thin(mut self) -> Self {
                let parts = part_colors(&self.key_encoding, &self.keys, self.voxels);
                let end = parts.map_or(self.keys.len(), |(keys, _)| keys.len());
                self.keys.truncate(end);
                self.keys.extend(codec::encode_counts(&self.counts));
                self.counts.clear();
                self.key_encoding = ENCODING.to_owned();
                self.mean_offsets.clear();
                self.labels.clear();
                self.label_counts.clear();
                self
            }
        })*
    };
}

thin!(LatticeMap, LatticeMapUpdate);

#[cfg(test)]
mod tests {
    use lattice_core::lattice::MortonKey;
    use serde_bytes::ByteBuf;

    use super::*;

    #[test]
    fn a_thin_message_has_the_keys_and_counts_in_two_bytes_a_voxel() {
        let surface = (0..3000).map(|i| [i % 60, i / 60, (i % 60) / 7]);
        let mut keys: Vec<MortonKey> = surface.filter_map(MortonKey::pack).collect();
        keys.sort_unstable();
        let full = LatticeMap {
            voxels: 3000,
            keys: ByteBuf::from(codec::encode_keys(&keys)),
            counts: (0..3000).map(|i| 1 + i % 127).collect(),
            mean_offsets: vec![7; 9000],
            ..LatticeMap::default()
        };
        let both = both(full.clone()).unwrap();
        assert!(both.cdr.len() > 11 * 3000, "{}", both.cdr.len());
        let thin = both.thin.unwrap();
        assert!(thin.len() < 2 * 3000 + 800, "{}", thin.len());
        let thin: LatticeMap = cdr::from_slice(&thin).unwrap();
        let (head, counts) = thin.keys.split_at(full.keys.len());
        assert_eq!(head, full.keys.as_slice());
        let expected: Vec<u8> = full.counts.iter().map(|count| *count as u8).collect();
        assert_eq!((counts, &*thin.key_encoding), (&*expected, ENCODING));
    }
}
