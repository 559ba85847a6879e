//! The messages of a log in the order in which a recorder receives them.

use super::facts::{
    INSPVAX_TOPIC, ODOMETRY_TOPIC, TF_STATIC_TOPIC, TF_TOPIC, bobcat_origin, bobcat_start_ns,
    points_topic, scan_topic,
};
use super::messages;
use crate::AnyError;
use crate::simulate::{Bobcat, InsSample, InsSamples, Laser};
use lattice_core::geodesy::EnuFrame;
use lattice_msgs::cdr;
use rayon::prelude::*;

/// Length of log that is computed at a time, ns.
const BLOCK_NS: i64 = 1_000_000_000;
/// Time from the last beam of a scan to its arrival at the recorder, ns.
const CLOUD_DELAY_NS: i64 = 3_000_000;
/// Time from a turntable's stamp to its arrival, ns.
const TURNTABLE_DELAY_NS: i64 = 400_000;

/// A message as it is recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct LogEntry {
    pub topic: &'static str,
    /// Time of arrival at the recorder, UTC, ns since the Unix epoch.
    pub log_time_ns: i64,
    pub cdr: Vec<u8>,
    /// For a cloud or a scan its points without noise, in the map frame (m), in their order.
    pub true_points_m: Vec<[f32; 3]>,
}

/// One block of the log.
#[derive(Debug)]
pub(super) struct Block<'a> {
    /// Messages ordered by log time.
    pub(super) entries: Vec<LogEntry>,
    /// INS epochs, for their true poses.
    pub(super) epochs: &'a [InsSample],
    /// End of the block, ns since the start of the tour.
    pub(super) end_ns: i64,
}

/// Computes a log block by block; the memory it takes does not grow with the duration.
pub(super) struct Log<'a> {
    bobcat: &'a Bobcat,
    /// True for LaserScan in place of PointCloud2.
    scans: bool,
    map: EnuFrame,
    samples: std::iter::Peekable<InsSamples<'a>>,
    next_scan: [u64; 3],
    begin_ns: i64,
    epochs: Vec<InsSample>,
    pending: Vec<LogEntry>,
}

impl<'a> Log<'a> {
    pub(super) fn new(bobcat: &'a Bobcat, scans: bool) -> Result<Self, AnyError> {
        let mounts = LogEntry {
            topic: TF_STATIC_TOPIC,
            log_time_ns: bobcat_start_ns().saturating_add(bobcat.begin_ns()),
            cdr: cdr::to_vec(&messages::mounts())?,
            true_points_m: Vec::new(),
        };
        Ok(Self {
            bobcat,
            scans,
            map: EnuFrame::new(bobcat_origin()?),
            samples: bobcat.ins().peekable(),
            next_scan: Laser::ALL.map(|laser| bobcat.first_scan(laser)),
            begin_ns: bobcat.begin_ns(),
            epochs: Vec::new(),
            pending: vec![mounts],
        })
    }

    /// The next block, None after the last. Each block holds what arrives in it, wherever it was measured.
    pub(super) fn next_block(&mut self) -> Result<Option<Block<'_>>, AnyError> {
        if self.begin_ns > self.bobcat.end_ns() {
            return Ok(None);
        }
        let end_ns = self.begin_ns.saturating_add(BLOCK_NS);
        let scans = self.scans_before(end_ns);
        let scans = scans.into_par_iter();
        let clouds = scans.map(|(laser, index)| self.cloud(laser, index));
        let clouds: Result<Vec<_>, _> = clouds.collect();
        self.pending.extend(clouds?);
        self.epochs.clear();
        while let Some(sample) = self.samples.next_if(|sample| sample.time_ns < end_ns) {
            self.epochs.push(sample);
        }
        for sample in &self.epochs {
            self.pending.extend(self.epoch(sample)?);
        }
        // Log times of one topic differ, so that this order is the only one.
        self.pending
            .sort_by(|a, b| (a.log_time_ns, a.topic).cmp(&(b.log_time_ns, b.topic)));
        let last = end_ns > self.bobcat.end_ns();
        let limit_ns = bobcat_start_ns().saturating_add(end_ns);
        let arrived = if last {
            self.pending.len()
        } else {
            self.pending.partition_point(|e| e.log_time_ns < limit_ns)
        };
        let entries = self.pending.drain(..arrived).collect();
        self.begin_ns = end_ns;
        Ok(Some(Block {
            entries,
            epochs: &self.epochs,
            end_ns,
        }))
    }

    /// The scans that start before a time and were not yet computed.
    fn scans_before(&mut self, end_ns: i64) -> Vec<(Laser, u64)> {
        let mut scans = Vec::new();
        for (laser, next) in Laser::ALL.into_iter().zip(&mut self.next_scan) {
            let count = self.bobcat.scan_count(laser);
            while *next < count && self.bobcat.scan_start_ns(laser, *next) < end_ns {
                scans.push((laser, *next));
                *next += 1;
            }
        }
        scans
    }

    fn cloud(&self, laser: Laser, index: u64) -> Result<LogEntry, AnyError> {
        let scan = self.bobcat.scan(laser, index);
        let arrival_ns = scan.start_ns + crate::simulate::SCAN_SPAN_NS + CLOUD_DELAY_NS;
        let returns = scan.returns.iter();
        let truth = returns.map(|hit| hit.truth_m.cast::<f32>().into());
        let (topic, cdr) = match self.scans {
            true => (
                scan_topic(laser),
                cdr::to_vec(&messages::laser_scan(laser, &scan))?,
            ),
            false => (
                points_topic(laser),
                cdr::to_vec(&messages::cloud(laser, &scan))?,
            ),
        };
        Ok(LogEntry {
            topic,
            log_time_ns: bobcat_start_ns().saturating_add(arrival_ns),
            cdr,
            true_points_m: truth.collect(),
        })
    }

    /// Both forms of the INS pose, which arrive together, and the turntable.
    fn epoch(&self, sample: &InsSample) -> Result<[LogEntry; 3], AnyError> {
        let stamp_ns = bobcat_start_ns().saturating_add(sample.time_ns);
        let entry = |topic, delay_ns: i64, cdr| LogEntry {
            topic,
            log_time_ns: stamp_ns.saturating_add(delay_ns),
            cdr,
            true_points_m: Vec::new(),
        };
        let inspvax = cdr::to_vec(&messages::inspvax(&self.map, sample)?)?;
        let odometry = cdr::to_vec(&messages::odometry(sample))?;
        let turntable = cdr::to_vec(&messages::turntable(self.bobcat, sample.time_ns))?;
        Ok([
            entry(INSPVAX_TOPIC, sample.delay_ns, inspvax),
            entry(ODOMETRY_TOPIC, sample.delay_ns, odometry),
            entry(TF_TOPIC, TURNTABLE_DELAY_NS, turntable),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(seed: u64, duration_s: f64) -> Vec<LogEntry> {
        let bobcat = Bobcat::new(seed, duration_s).unwrap();
        let mut log = Log::new(&bobcat, false).unwrap();
        let mut entries = Vec::new();
        while let Some(block) = log.next_block().unwrap() {
            entries.extend(block.entries);
        }
        entries
    }

    #[test]
    fn messages_come_in_the_order_of_arrival_and_none_is_lost() {
        let entries = entries(1, 3.0);
        assert!(entries.is_sorted_by_key(|entry| entry.log_time_ns));
        let count = |topic| entries.iter().filter(|e| e.topic == topic).count();
        assert_eq!(count(TF_STATIC_TOPIC), 1);
        assert_eq!(entries[0].topic, TF_STATIC_TOPIC);
        for topic in [INSPVAX_TOPIC, ODOMETRY_TOPIC, TF_TOPIC] {
            assert_eq!(count(topic), 301);
        }
        let bobcat = Bobcat::new(1, 3.0).unwrap();
        for laser in Laser::ALL {
            assert_eq!(count(points_topic(laser)) as u64, bobcat.scan_count(laser));
        }
    }

    #[test]
    fn a_later_log_has_what_a_longer_one_has_then() {
        let later = Bobcat::new(1, 1.5).unwrap().starting_at(3.0).unwrap();
        let mut log = Log::new(&later, false).unwrap();
        let mut found = Vec::new();
        while let Some(block) = log.next_block().unwrap() {
            found.extend(block.entries);
        }
        let whole = entries(1, 4.5);
        let begin_ns = bobcat_start_ns() + later.begin_ns();
        assert_eq!(found[0].topic, TF_STATIC_TOPIC);
        assert_eq!(found[0].log_time_ns, begin_ns);
        assert!(found[1..].iter().all(|entry| whole.contains(entry)));
        // Scans that started before it are the only ones that it lacks.
        let missing = whole
            .iter()
            .filter(|e| e.log_time_ns >= begin_ns && !found.contains(e));
        let missing: Vec<_> = missing.map(|e| e.topic).collect();
        assert!(missing.len() <= 6, "{missing:?}");
        for begin_s in [-1.0, f64::NAN, 1e9] {
            assert!(Bobcat::new(1, 1.0).unwrap().starting_at(begin_s).is_err());
        }
    }

    #[test]
    fn a_longer_log_begins_like_a_shorter_one() {
        let (short, long) = (entries(5, 1.5), entries(5, 2.5));
        let same = short.iter().zip(&long).take_while(|(a, b)| a == b).count();
        assert!(same > short.len() - 20, "{same} of {}", short.len());
    }
}
