//! Text files: one point per line, columns separated by blanks, commas or semicolons.
//!
//! x, y and z are the first three columns, unless the first line names its columns; a column
//! named `label` is the class. Further columns, empty lines and comments after `#`, `%` or `//` are ignored.
//! Decimal commas are accepted where they cannot be separators: between semicolons, blanks or quotes.

use super::collect::Collector;
use super::label::label_among;
use super::source::Source;
use super::{PointFileError, PointFormat};

pub(super) fn read(
    source: &mut Source,
    points: &mut Collector,
) -> Result<PointFormat, PointFileError> {
    if matches!(source.peek()?, [0xff, 0xfe, ..] | [0xfe, 0xff, ..]) {
        return Err(PointFileError::NotRead {
            what: "text in UTF-16",
            remedy: "save it as UTF-8",
        });
    }
    let (mut columns, mut label_at) = ([0, 1, 2], None);
    let mut first = true;
    let mut line_number = 0;
    while let Some(line) = source.line()? {
        line_number += 1;
        let line = match line_number {
            1 => line.trim_start_matches('\u{feff}'),
            _ => &*line,
        };
        let row = Row::new(content(line));
        if row.content.is_empty() {
            continue;
        }
        match (row.point(columns), first.then(|| row.names())) {
            (Ok(point_m), _) => {
                let label = label_at.map(|at| row.fields().nth(at).and_then(decimal));
                points.push_with(point_m, label.map(|l| l.unwrap_or(f64::NAN)))?;
            }
            (Err(_), Some(Some(named))) => {
                columns = named;
                label_at = label_among(row.fields());
            }
            (Err(reason), _) => {
                return Err(PointFileError::Line {
                    format: PointFormat::Text,
                    line: line_number,
                    reason,
                });
            }
        }
        first = false;
    }
    Ok(PointFormat::Text)
}

/// Line without comment and surrounding blanks.
fn content(line: &str) -> &str {
    let line = line.split(['#', '%']).next().unwrap_or_default();
    line.split("//").next().unwrap_or_default().trim()
}

/// Column separator of a line.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Separator {
    Blank,
    Comma,
    Semicolon,
}

/// A line with its separator.
struct Row<'a> {
    content: &'a str,
    separator: Separator,
}

impl<'a> Row<'a> {
    fn new(content: &'a str) -> Self {
        let separator = match content {
            _ if content.contains(';') => Separator::Semicolon,
            _ if content.contains(',') && !has_decimal_commas(content) => Separator::Comma,
            _ => Separator::Blank,
        };
        Self { content, separator }
    }

    /// Columns of the line, without quotes.
    fn fields(&self) -> impl Iterator<Item = &'a str> + Clone + use<'a> {
        let separator = self.separator;
        let mut quoted = false;
        let fields = self.content.split(move |c: char| {
            quoted ^= c == '"';
            !quoted
                && match separator {
                    Separator::Blank => c.is_whitespace(),
                    Separator::Comma => c == ',',
                    Separator::Semicolon => c == ';',
                }
        });
        let fields = fields.map(|field| field.trim().trim_matches('"').trim());
        fields.filter(move |field| separator != Separator::Blank || !field.is_empty())
    }

    /// Indices of the columns x, y and z, if the line names them.
    fn names(&self) -> Option<[usize; 3]> {
        let column = |name| {
            self.fields()
                .position(|field| field.eq_ignore_ascii_case(name))
        };
        Some([column("x")?, column("y")?, column("z")?])
    }

    fn point(&self, columns: [usize; 3]) -> Result<[f64; 3], String> {
        let mut point_m = [0.0; 3];
        for ((coordinate, column), axis) in point_m.iter_mut().zip(columns).zip(["x", "y", "z"]) {
            let field = self.fields().nth(column).ok_or_else(|| {
                let found = self.fields().count();
                format!("{found} columns, but {axis} is column {}", column + 1)
            })?;
            *coordinate = decimal(field).ok_or_else(|| {
                let is_grouped = field.contains('.') && field.contains(',');
                let field: String = field.chars().take(40).collect();
                let why = match is_grouped {
                    true => "not a number: write it without thousands separators",
                    false => "not a number",
                };
                format!("column {} ({axis}) is {field:?}, {why}", column + 1)
            })?;
        }
        match self.fraction() {
            None => Ok(point_m),
            Some(fraction) => Err(format!(
                "{fraction:?} may be the decimals of a number with a decimal comma, which commas cannot separate: write \
                 decimal points, or put semicolons between the columns"
            )),
        }
    }

    /// Column after a comma with a leading zero, which only decimals have, in a line without decimal points.
    fn fraction(&self) -> Option<&'a str> {
        if self.separator != Separator::Comma || self.content.contains(['.', '"']) {
            return None;
        }
        let is_fraction = |field: &&str| {
            field.len() > 1 && field.starts_with('0') && field.bytes().all(|b| b.is_ascii_digit())
        };
        self.fields().skip(1).find(is_fraction)
    }
}

/// True for blank-separated columns whose first three are numbers, one of them with a decimal comma.
fn has_decimal_commas(content: &str) -> bool {
    let mut words = content
        .split_whitespace()
        .map(|word| word.trim_matches('"'));
    let axes = [words.next(), words.next(), words.next()];
    axes.iter()
        .all(|word| word.is_some_and(|word| decimal(word).is_some()))
        && axes.iter().flatten().any(|word| word.contains(','))
}

/// Parses a number in any usual notation, also with a decimal comma between digits.
fn decimal(word: &str) -> Option<f64> {
    let Some((whole, fraction)) = word.split_once(',') else {
        return number(word);
    };
    let ends_in_digit = whole
        .bytes()
        .next_back()
        .is_some_and(|b| b.is_ascii_digit());
    let is_fraction = fraction.bytes().next().is_some_and(|b| b.is_ascii_digit());
    let has_point = word.contains('.');
    (ends_in_digit && is_fraction && !has_point)
        .then(|| number(&format!("{whole}.{fraction}")))
        .flatten()
}

/// Parses a number in any usual notation, including NaN and infinities.
pub(super) fn number(word: &str) -> Option<f64> {
    word.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(text: &'static str) -> Result<Vec<[f64; 3]>, String> {
        let mut points = Collector::new(100);
        let mut source = Source::new(Box::new(text.as_bytes()));
        read(&mut source, &mut points).map_err(|error| error.to_string())?;
        Ok(points.points_m)
    }

    #[test]
    fn columns_are_separated_in_any_usual_way() {
        let text = "# scan\n\n1 2 3\n\t1.0\t+2e0  3. 99 abc\r\n1,2,3\n 1 ; 2 ; 3 ; # end\n1, 2, 3, 4 // c\n\
                    1 ,2 ,3\n1,2 ,3\n\"1\",\"2\",\"3\"\n1,2,3,x y z\n";
        assert_eq!(points(text), Ok(vec![[1.0, 2.0, 3.0]; 9]));
        assert_eq!(points(""), Ok(vec![]));
    }

    #[test]
    fn a_first_line_may_name_the_columns() {
        for text in [
            "% by us\n\"Time\",Z,X,Y\n9,3,1,2\n8,6,4,5\n",
            "\u{feff}X;Y;Z\r\n1,0;2;3\r\n4;5,0;6\r\n",
            "\u{feff}X\tY\tZ\n1,0\t2,0\t3,0\n4,0\t5,0\t6,0\n",
            "\u{feff}1 2 3\n4 5 6\n",
        ] {
            let expected = vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
            assert_eq!(points(text), Ok(expected), "{text}");
        }
    }

    #[test]
    fn decimal_commas_are_read_where_they_separate_nothing() {
        for text in [
            "20,47;28,1;-3,2",
            "20,47;28,1;-3,2;0,5\r\n",
            " 20,47 ; 28,1 ; -3,2 ;",
            "20,47\t28,1\t-3,2",
            "20,47  28,1 -3,2 255",
            "20,470 28,1e0 -3,2",
            "\"20,47\",\"28,1\",\"-3,2\"",
            "\"20,47\";\"28,1\";\"-3,2\"",
            "\"20,47\" \"28,1\" \"-3,2\"",
            "20.47;28.1;-3.2",
        ] {
            assert_eq!(points(text), Ok(vec![[20.47, 28.1, -3.2]]), "{text}");
        }
        assert_eq!(
            points("448000,123;5411000,5;300"),
            Ok(vec![[448000.123, 5411000.5, 300.0]])
        );
        for (text, why) in [
            ("20,05,28,1,3,2", "\"05\" may be the decimals"),
            ("1.234,5;2.345,6;3,2", "without thousands separators"),
            ("1,234.5;2,345.6;3.2", "without thousands separators"),
            ("20,47;28,1", "2 columns"),
            ("1,2;3,4,5", "\"3,4,5\", not a number"),
            ("1 234,5;2;3", "\"1 234,5\", not a number"),
            ("20,47 28,1", "not a number"),
            (",5;1;2", "\",5\", not a number"),
        ] {
            let error = points(text).unwrap_err();
            assert!(error.contains(why), "{text}: {error}");
        }
        // Whole numbers and a colour, between commas.
        assert_eq!(points("20,47,28,1,3,2"), Ok(vec![[20.0, 47.0, 28.0]]));
        assert_eq!(points("0,10,0,007.5"), Ok(vec![[0.0, 10.0, 0.0]]));
    }

    #[test]
    fn faults_are_told_with_their_line() {
        for (text, message) in [
            ("1 2 3\n1 2", "line 2: 2 columns, but z is column 3"),
            (
                "1 2 3\nx y z",
                "line 2: column 1 (x) is \"x\", not a number",
            ),
            ("\n1,,3,4", "line 2: column 2 (y) is \"\", not a number"),
            ("a b c", "line 1: column 1 (x) is \"a\", not a number"),
            (
                "x,y,z,t\n1,2,",
                "line 2: column 3 (z) is \"\", not a number",
            ),
        ] {
            assert_eq!(points(text), Err(format!("text file, {message}")));
        }
    }
}
