//! Lost samples, detected from gaps in the writers' sequence numbers.

use std::collections::BTreeMap;

use super::port::EndpointId;

/// Limit of tracked writers per topic; the least recently active one is removed.
const MAX_WRITERS: usize = 4096;

/// Sequence numbers received from each writer.
///
/// A writer numbers its samples without gaps. Samples before the first received one preceded the match and are
/// not counted. Missing samples after it were lost, or overwritten in the writer's history. A writer is
/// identified by its GUID: its numbers continue after a lost lease, and a restarted writer has a new
/// GUID.
#[derive(Default)]
pub(crate) struct Gaps {
    writers: BTreeMap<EndpointId, Seen>,
    samples: u64,
}

struct Seen {
    /// Transport handle; it changes each time the transport rediscovers the writer.
    handle: u64,
    next: i64,
    /// Activity counter at its last sample.
    at: u64,
}

impl Gaps {
    /// Records a sample; returns the number of samples missing before it.
    pub(crate) fn note(&mut self, writer: EndpointId, handle: u64, number: i64) -> u64 {
        self.samples += 1;
        let at = self.samples;
        let next = number.saturating_add(1);
        let Some(seen) = self.writers.get_mut(&writer) else {
            self.forget_one();
            self.writers.insert(writer, Seen { handle, next, at });
            return 0;
        };
        let is_found_again = seen.handle != handle;
        (seen.handle, seen.at) = (handle, at);
        if number >= seen.next {
            let missing = number.saturating_sub(seen.next);
            seen.next = next;
            return missing.unsigned_abs();
        }
        // Resent history, or a writer that restarted its numbering.
        if is_found_again {
            seen.next = next;
        }
        0
    }

    fn forget_one(&mut self) {
        if self.writers.len() < MAX_WRITERS {
            return;
        }
        let oldest = self.writers.iter().min_by_key(|(_, seen)| seen.at);
        if let Some(oldest) = oldest.map(|(writer, _)| *writer) {
            self.writers.remove(&oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: EndpointId = EndpointId([1; 16]);
    const B: EndpointId = EndpointId([2; 16]);

    fn lost(gaps: &mut Gaps, samples: &[(EndpointId, u64, i64)]) -> Vec<u64> {
        let note = |(writer, handle, number): &(EndpointId, u64, i64)| {
            gaps.note(*writer, *handle, *number)
        };
        samples.iter().map(note).collect()
    }

    #[test]
    fn what_is_left_out_is_lost_and_what_came_before_is_not() {
        let gaps = &mut Gaps::default();
        assert_eq!(lost(gaps, &[(A, 1, 100), (A, 1, 101)]), [0, 0]);
        assert_eq!(lost(gaps, &[(A, 1, 104), (A, 1, 105)]), [2, 0]);
        // Two writers count for themselves.
        let both = [(B, 2, 7), (A, 1, 106), (B, 2, 9), (A, 1, 107)];
        assert_eq!(lost(gaps, &both), [0, 0, 1, 0]);
    }

    #[test]
    fn a_writer_that_is_found_again_goes_on_and_one_that_counts_anew_begins() {
        let gaps = &mut Gaps::default();
        assert_eq!(lost(gaps, &[(A, 1, 10), (A, 5, 31)]), [0, 20]);
        // Its history, once more.
        assert_eq!(lost(gaps, &[(A, 6, 30), (A, 6, 31), (A, 6, 32)]), [0, 0, 0]);
        assert_eq!(lost(gaps, &[(A, 7, 1), (A, 7, 2), (A, 7, 4)]), [0, 0, 1]);
        // Old ones of the same match, as of a cache that answers late, are no new beginning.
        assert_eq!(lost(gaps, &[(A, 7, 3), (A, 7, 1), (A, 7, 5)]), [0, 0, 0]);
    }

    #[test]
    fn hostile_numbers_and_writers_are_bounded() {
        let gaps = &mut Gaps::default();
        let wide = lost(
            gaps,
            &[(A, 1, i64::MIN), (A, 1, i64::MAX), (A, 1, i64::MAX)],
        );
        assert_eq!(wide, [0, i64::MAX as u64, 0]);
        for number in 0..2 * MAX_WRITERS as u32 {
            let mut id = [0; 16];
            id[..4].copy_from_slice(&number.to_le_bytes());
            gaps.note(EndpointId(id), 1, 1);
        }
        assert_eq!(gaps.writers.len(), MAX_WRITERS);
    }
}
