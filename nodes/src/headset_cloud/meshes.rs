//! Handling of meshes and sessions.

use std::sync::Arc;

use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::visualization_msgs::Marker;

use super::machine::{HeadsetCloud, HeadsetOutput};
use super::marker::{FromMarker, from_marker};
use super::refusal::{MeshRefusal, shown};
use super::session::SessionUpdate;
use super::surfaces::Change;
use crate::mesh::LabelledMesh;

/// Surface name of the mesh file.
const FILE: &str = "file";

impl HeadsetCloud {
    /// Handles a surface, a chunk of it, or its removal.
    pub fn on_mesh(&mut self, message: &Arc<HeadsetMesh>) -> Vec<HeadsetOutput> {
        self.counts.meshes_in += 1;
        let mut outputs = Vec::new();
        match self.take_mesh(message, &mut outputs) {
            Ok(change) => self.changed(change, message.header.stamp.to_ns()),
            Err(refusal) => self.refuse("mesh", refusal.name(), &refusal.to_string()),
        }
        outputs.extend(self.serve());
        outputs
    }

    /// Handles a marker of triangles as a surface of the current session.
    pub fn on_marker(&mut self, marker: &Marker) -> Vec<HeadsetOutput> {
        match from_marker(marker) {
            FromMarker::Surface(surface) => return self.on_mesh(&Arc::new(surface)),
            FromMarker::RemoveAll(prefix) => {
                let removed = self.surfaces.remove_all(&prefix);
                let change = Change {
                    removed,
                    ..Change::default()
                };
                self.changed(change, marker.header.stamp.to_ns());
            }
            FromMarker::Refused(reason, problem) => self.refuse("marker", reason, problem),
        }
        self.counts.meshes_in += 1;
        Vec::new()
    }

    /// Adds the mesh file, in the frame and axes of the headset.
    pub fn on_mesh_file(&mut self, mesh: &LabelledMesh) -> Result<(), MeshRefusal> {
        let change = self.surfaces.on_file(FILE, mesh)?;
        self.changed(change, 0);
        Ok(())
    }

    /// Handles the session of the headset: a new session has a new origin.
    pub fn on_session(&mut self, text: &str) {
        match self.session.on_topic(text, self.now_ns) {
            SessionUpdate::Same | SessionUpdate::First => {}
            SessionUpdate::Another => self.begin_session(),
            SessionUpdate::Ended => self.refuse("session", "malformed", "its text is too long"),
        }
    }

    fn take_mesh(
        &mut self,
        message: &Arc<HeadsetMesh>,
        outputs: &mut Vec<HeadsetOutput>,
    ) -> Result<Change, MeshRefusal> {
        self.surfaces.check(message)?;
        let update = self.session.on_mesh(&message.session, self.now_ns);
        if update == SessionUpdate::Ended {
            return Err(MeshRefusal::OtherSession {
                surface: shown(&message.surface),
                found: shown(&message.session),
            });
        }
        if update == SessionUpdate::Another {
            self.begin_session();
        }
        if update != SessionUpdate::Same {
            outputs.push(HeadsetOutput::Session(message.session.clone()));
        }
        self.surfaces.on_mesh(message, self.now_ns)
    }

    /// Drops everything in the previous origin.
    fn begin_session(&mut self) {
        self.counts.sessions += 1;
        self.surfaces.clear();
        self.poses.clear();
        self.drop_waiting(Some("other_session"));
        self.raycast_mesh = None;
        self.changed_ns = None;
    }

    fn changed(&mut self, change: Change, stamp_ns: i64) {
        let counts = &mut self.counts;
        counts.surfaces_replaced += change.replaced;
        counts.surfaces_removed += change.removed;
        counts.triangles_degenerate += change.degenerate;
        counts.drop_some("mesh", "incomplete", change.incomplete);
        if change.replaced + change.removed > 0 {
            self.raycast_mesh = None;
            self.changed_ns = Some(stamp_ns);
        }
    }
}
