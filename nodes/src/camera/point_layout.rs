//! Fields of clouds of labelled points.

/// Largest cloud with probabilities, bytes; a larger one has none.
const MAX_BYTES: usize = 32 << 20;

/// Optional fields of a cloud besides x, y, z, label and confidence.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointLayout {
    /// True with the field `rgb`.
    pub has_color: bool,
    /// Camera position in the cloud's frame, m; written to `vp_x`, `vp_y`, `vp_z` of each point.
    pub viewpoint_m: Option<[f32; 3]>,
    /// Elements of the field `label_probs`; 0: no such field.
    pub classes: usize,
}

impl PointLayout {
    /// Bytes per point: four for x, y, z, rgb, confidence, viewpoint and probabilities each, two for the label.
    pub(super) fn step(self) -> usize {
        let viewpoint = 3 * usize::from(self.viewpoint_m.is_some());
        18 + 4 * (usize::from(self.has_color) + viewpoint + self.classes)
    }

    /// The layout without probabilities if `points` points would exceed the limit.
    pub fn bounded(self, points: usize) -> Self {
        match points.saturating_mul(self.step()) <= MAX_BYTES {
            true => self,
            false => Self { classes: 0, ..self },
        }
    }
}
