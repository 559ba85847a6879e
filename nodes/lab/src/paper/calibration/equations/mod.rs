//! Eqs. (1) to (9): what is printed, what it should be, and whether the library computes that.

mod geometry;
mod literal;
mod metric;
mod reference_scene;
mod semantic;
mod slips;

use super::context::Context;
use crate::AnyError;
use crate::report::Section;
use crate::simulate::house::Scene;
use reference_scene::ReferenceScene;

pub(super) fn sections(
    context: &Context,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Section>, AnyError> {
    let view = context.testbed.view(Scene::Dining, context.first_seed)?;
    let scene = ReferenceScene {
        scenario: context.testbed.scenario(&view, 0.0)?,
    };
    progress(0.3);
    let geometry = geometry::section(&scene)?;
    progress(0.5);
    let semantic = semantic::section(context, &scene)?;
    Ok(vec![geometry, semantic, metric::section(context)?])
}
