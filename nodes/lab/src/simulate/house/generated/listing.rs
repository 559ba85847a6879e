//! Lines of the lists of walls and furniture.

use crate::AnyError;

/// A line with its words and the numbers after them.
pub(super) type Line<'a> = (&'a str, Vec<&'a str>, Vec<f32>);

/// The lines of a text, without comments.
pub(super) fn lines(text: &str) -> impl Iterator<Item = Result<Line<'_>, AnyError>> {
    let lines = text
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| {
        let is_word = |word: &&str| word.starts_with(|c: char| c.is_ascii_alphabetic());
        let words: Vec<&str> = line.split_whitespace().take_while(is_word).collect();
        let numbers = line.split_whitespace().skip(words.len()).map(str::parse);
        Ok((line, words, numbers.collect::<Result<_, _>>()?))
    })
}
