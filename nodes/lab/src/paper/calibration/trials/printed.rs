//! Table 1 as printed.

use crate::evaluate::{PRINTED, Printed};
use crate::simulate::house::Scene;

/// Printed errors of a scene.
pub(super) fn printed(scene: Scene) -> Option<&'static Printed> {
    PRINTED.iter().find(|printed| printed.scene == scene.name())
}

/// True of a scene whose labels the paper finds wrong (section 5, Figs. 3 and 4).
pub(super) fn blamed(scene: Scene) -> bool {
    matches!(scene, Scene::Tv | Scene::Bookshelf)
}
