//! Loops of the drive of an odometry.

use lattice_core::loop_closure::{LoopCloser, Segment};

use super::machine::{LidarOdometry, Registered};

/// Loops of one drive, whose scans come one by one.
#[derive(Default)]
pub struct DriveLoops {
    closer: LoopCloser,
    drive: u32,
}

impl DriveLoops {
    /// Handles a scan. A log that begins again has no loops: its poses have two frames.
    pub fn add(&mut self, found: &Registered) {
        self.drive = self.drive.max(found.drive);
        self.close(found.segment.clone());
    }

    /// Ends the drive and gives its loops; none if they are not sought, or if the log began again.
    pub fn finish(mut self, machine: &mut LidarOdometry) -> LoopCloser {
        self.close(machine.last_segment());
        match self.drive {
            0 => self.closer,
            _ => LoopCloser::default(),
        }
    }

    fn close(&mut self, segment: Option<Segment>) {
        let Some(segment) = segment.filter(|_| self.drive == 0) else {
            return;
        };
        // Distances that gave the scans a lattice give one here.
        if let Err(error) = self.closer.add(segment) {
            log::debug!("no loop is sought: {error}");
        }
    }
}
