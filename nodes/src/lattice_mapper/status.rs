//! Report and diagnostics of the node.

use std::sync::atomic::Ordering;

use super::compute_state::{ComputeState, NO_VIEWPOINTS};
use super::corrected::CorrectedDrive;
use super::octomap::Octomaps;
use super::report::MapperReport;
use crate::report;
use lattice_runtime::{Level, WORKING};

const NO_COLORS: &str = "no cloud has colours (`keep_color`): they need a field rgb, rgba or r, g, b, which \
                         `pass_fields` of enu_transformer passes on";

impl ComputeState {
    pub(super) fn report(&mut self) -> MapperReport {
        MapperReport {
            clouds_inbox_full: self.clouds_inbox_full(),
            clouds_lost_on_network: self.clouds.on_network(),
            undecodable: self.inputs.undecodable(),
            updates_not_published: self.output.updates_lost(),
            chunks_not_published: self.output.chunks_lost(),
            corrections: self.drive.as_ref().map(|drive| drive.counts().clone()),
            ..MapperReport::of(&self.machine)
        }
    }

    /// Clouds rejected by a full inbox or overrun before it.
    fn clouds_inbox_full(&self) -> u64 {
        self.lost.load(Ordering::Relaxed) + self.clouds.overrun()
    }

    pub(super) fn diagnose(&mut self) {
        let voxels = self.machine.cells().len();
        let counts = self.machine.counts();
        if counts.points_mapped > 0 || voxels > 0 {
            self.unmapped = None;
        }
        let (inbox_full, on_network) = (self.clouds_inbox_full(), self.clouds.on_network());
        let lost = inbox_full + on_network;
        let updates = self.output.updates_lost();
        let not_published = updates + self.output.chunks_lost();
        let refused =
            counts.clouds_malformed + counts.clouds_wrong_frame + counts.clouds_stamp_jump;
        let octomaps = self.octomaps.as_ref();
        let (level, message) = if let Some(problem) = self.autosave.problem() {
            (Level::Error, problem)
        } else if let Some(problem) = octomaps.and_then(Octomaps::problem) {
            (Level::Error, problem)
        } else if let Some(unmapped) = &self.unmapped {
            (Level::Warn, unmapped.message(counts))
        } else if counts.clouds_in == 0 {
            (Level::Warn, "no cloud yet".to_owned())
        } else if counts.points_list_full > 0 {
            let limits = "`max_voxels` or `max_map_bytes`";
            (Level::Warn, format!("the list is full ({limits})"))
        } else if counts.clouds_no_viewpoint > 0 {
            let clouds = counts.clouds_no_viewpoint;
            (Level::Warn, format!("{clouds} clouds: {NO_VIEWPOINTS}"))
        } else if counts.clouds_uncolored > 0
            && counts.clouds_uncolored + refused >= counts.clouds_in
        {
            (Level::Warn, NO_COLORS.to_owned())
        } else if counts.ray_blocks_refused > 0 {
            let problem =
                "the memory for rays is full (`rays.max_bytes`): not all voxels are cleared";
            (Level::Warn, problem.to_owned())
        } else if refused + lost > 0 {
            let message = format!("{refused} clouds rejected, {lost} lost");
            (Level::Warn, message)
        } else if let Some(problem) = self.drive.as_ref().and_then(CorrectedDrive::problem) {
            (Level::Warn, problem)
        } else if not_published > 0 {
            let message = format!("{not_published} parts of the map not published");
            (Level::Warn, message)
        } else {
            (Level::Ok, "mapping".to_owned())
        };
        let mut values = report::key_values(counts);
        values.extend(
            self.drive
                .iter()
                .flat_map(|drive| report::key_values(drive.counts())),
        );
        let distortion = self.machine.distortion();
        values.extend([
            ("clouds_inbox_full".into(), inbox_full.to_string()),
            ("clouds_lost_on_network".into(), on_network.to_string()),
            ("undecodable".into(), self.inputs.undecodable().to_string()),
            ("updates_not_published".into(), updates.to_string()),
            (
                "chunks_not_published".into(),
                self.output.chunks_lost().to_string(),
            ),
            ("voxels".into(), voxels.to_string()),
            (WORKING.into(), self.unmapped.is_none().to_string()),
            ("rms_m".into(), format!("{:.5}", distortion.rms_m)),
        ]);
        self.diagnostics.set("map", level, message, values);
    }
}
