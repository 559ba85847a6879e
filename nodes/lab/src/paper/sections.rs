//! Sections of a report from a table.

use crate::AnyError;
use crate::report::Section;

/// Part of a report: name, share of the time, and the maker of its sections.
pub type Part<M> = (&'static str, f64, M);

/// Makes all parts in their order; `progress` gets the share done and the name of the part.
pub fn in_order<M: Copy>(
    parts: &[Part<M>],
    progress: &mut dyn FnMut(f64, &str),
    make: impl Fn(M, &mut dyn FnMut(f64)) -> Result<Vec<Section>, AnyError>,
) -> Result<Vec<Section>, AnyError> {
    let all: f64 = parts.iter().map(|(_, share, _)| share).sum();
    let mut before = 0.0;
    let mut sections = Vec::new();
    for (name, share, how) in parts {
        progress(before / all, name);
        let mut tell = |done: f64| progress((before + share * done) / all, name);
        sections.extend(make(*how, &mut tell)?);
        before += share;
    }
    Ok(sections)
}
