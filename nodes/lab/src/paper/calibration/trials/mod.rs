//! Table 1 and the conclusions of the paper, on many simulated trials in place of one real one.

mod claim;
mod figures;
mod median;
mod methods;
mod printed;
mod table1;
mod trials_of_methods;

use super::context::Context;
use crate::AnyError;
use crate::report::Section;
use trials_of_methods::Trials;

/// The sections of Table 1 and of what is concluded.
pub(super) fn sections(
    context: &Context,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Section>, AnyError> {
    let trials = match &context.evaluated {
        Some(trials) => Trials::of(trials.clone())?,
        None => Trials::run(context, progress)?,
    };
    Ok(vec![table1::section(&trials)?, claim::section(&trials)?])
}

#[cfg(test)]
mod tests;
