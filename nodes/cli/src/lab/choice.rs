//! Choices and threads of the laboratory.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// A value of an option with its name and help.
pub(super) type Choice<T> = (&'static str, &'static str, T);

/// Parser of an option that takes one of some names, each with its help and its value.
pub(super) fn choice<T: Clone + Send + Sync + 'static>(
    choices: &'static [Choice<T>],
) -> impl TypedValueParser<Value = T> {
    let names = choices.iter();
    let names = names.map(|(name, help, _)| PossibleValue::new(*name).help(*help));
    PossibleValuesParser::new(names).try_map(|chosen: String| {
        let found = choices.iter().find(|(name, ..)| *name == chosen);
        found.map(|choice| choice.2.clone()).ok_or("no such choice")
    })
}

/// Number of processors.
pub(super) fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
