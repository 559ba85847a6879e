//! Samples of a log for the calibration of mounts.

use lattice_bag::BagReader;

use super::pipeline::{Pipeline, run};
use super::report::RunReport;
use super::slice::Slice;
use super::topic_plan::TopicPlan;
use super::topics::TopicError;
use crate::enu_transformer::{LogSamples, TransformerOptions};
use lattice_core::raycast::FreeSpaceError;
use thiserror::Error;

/// Cause for which a log has no samples.
#[derive(Debug, Error)]
pub enum SampleError {
    /// Error of the log.
    #[error(transparent)]
    Log(#[from] TopicError),
    /// Error of the machines.
    #[error(transparent)]
    Pipeline(#[from] FreeSpaceError),
}

/// Reads the points of the clouds of a slice of a log, `limit` at most, each with the pose of the base at its time.
///
/// # Errors
/// If the log cannot be read. Clouds without poses or mounts are counted in the report.
pub fn mount_samples(
    bag: &BagReader,
    plan: &TopicPlan,
    slice: &Slice,
    transformer: TransformerOptions,
    limit: usize,
    progress: &mut dyn FnMut(f64),
) -> Result<(LogSamples, RunReport), SampleError> {
    let mut pipeline = Pipeline::new(transformer, [], None)?;
    pipeline.transformer.keep_samples(limit);
    let report = run(bag, plan, slice, &mut pipeline, "", progress)?;
    Ok((pipeline.transformer.take_samples(), report))
}
