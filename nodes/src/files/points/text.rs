//! Text files: one point a line, columns between blanks, commas or semicolons.
//!
//! x, y and z are the first three columns, unless the first line names its columns; a column that it
//! names `label` is the class. Further columns are ignored, and so are empty lines and what follows `#`, `%` or `//`.

use super::collect::Collector;
use super::source::Source;
use super::{PointFileError, PointFormat};

pub(super) fn read(
    source: &mut Source,
    points: &mut Collector,
) -> Result<PointFormat, PointFileError> {
    let (mut columns, mut label_at) = ([0, 1, 2], None);
    let mut first = true;
    let mut line_number = 0;
    while let Some(line) = source.line()? {
        line_number += 1;
        let content = content(&line);
        if content.is_empty() {
            continue;
        }
        match (point(content, columns), first.then(|| names(content))) {
            (Ok(point_m), _) => {
                let label = label_at.map(|at| fields(content).nth(at).and_then(number));
                points.push_with(point_m, label.map(|l| l.unwrap_or(f64::NAN)))?;
            }
            (Err(_), Some(Some(named))) => {
                columns = named;
                label_at = column_named(content, "label");
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

/// The line without comment and surrounding blanks.
fn content(line: &str) -> &str {
    let line = line.split(['#', '%']).next().unwrap_or_default();
    line.split("//").next().unwrap_or_default().trim()
}

/// The columns of a line.
fn fields(content: &str) -> impl Iterator<Item = &str> {
    let separated = content.contains([',', ';']);
    content
        .split(move |c: char| match separated {
            true => c == ',' || c == ';',
            false => c.is_whitespace(),
        })
        .map(str::trim)
        .filter(move |field| separated || !field.is_empty())
}

/// Places of the columns x, y and z, if the line names them.
fn names(content: &str) -> Option<[usize; 3]> {
    let column = |name: &str| column_named(content, name);
    Some([column("x")?, column("y")?, column("z")?])
}

fn column_named(content: &str, name: &str) -> Option<usize> {
    fields(content).position(|field| field.trim_matches('"').eq_ignore_ascii_case(name))
}

fn point(content: &str, columns: [usize; 3]) -> Result<[f64; 3], String> {
    let mut point_m = [0.0; 3];
    for ((coordinate, column), axis) in point_m.iter_mut().zip(columns).zip(["x", "y", "z"]) {
        let field = fields(content).nth(column).ok_or_else(|| {
            let found = fields(content).count();
            format!("{found} columns, but {axis} is column {}", column + 1)
        })?;
        *coordinate = number(field).ok_or_else(|| {
            let field: String = field.chars().take(40).collect();
            format!("column {} ({axis}) is {field:?}, not a number", column + 1)
        })?;
    }
    Ok(point_m)
}

/// A number in any usual spelling, NaN and infinities too.
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
        let text =
            "# scan\n\n1 2 3\n\t1.0\t+2e0  3. 99 abc\r\n1,2,3\n 1 ; 2 ; 3 ; # end\n1, 2, 3, 4 // c";
        assert_eq!(points(text), Ok(vec![[1.0, 2.0, 3.0]; 5]));
        assert_eq!(points(""), Ok(vec![]));
    }

    #[test]
    fn a_first_line_may_name_the_columns() {
        let text = "% by us\n\"Time\",Z,X,Y\n9,3,1,2\n8,6,4,5\n";
        assert_eq!(points(text), Ok(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]));
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
