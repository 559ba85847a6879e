//! Labels that a method uses.

use crate::registration::{
    LabelDistribution, LabelUse, Method, PreparedCloud, RegisterOptions, SemanticVariant,
};

/// Labels of both clouds, in the order of the trees.
pub(super) struct Labels<'a> {
    pub source: &'a [LabelDistribution],
    pub target: &'a [LabelDistribution],
}

/// Labels that a method uses.
pub(super) fn labels<'a>(
    source: &'a PreparedCloud,
    target: &'a PreparedCloud,
    options: &RegisterOptions,
) -> Labels<'a> {
    let blurred = options.method == Method::Semantic(SemanticVariant::Published)
        && options.labels == LabelUse::Soft;
    if blurred {
        Labels {
            source: source.blurred_labels(),
            target: target.blurred_labels(),
        }
    } else {
        Labels {
            source: source.labels(),
            target: target.labels(),
        }
    }
}
