//! Line format, by `RCUTILS_CONSOLE_OUTPUT_FORMAT`.

use log::Record;

/// Default format of rcutils.
const DEFAULT: &str = "[{severity}] [{time}] [{name}]: {message}";
/// Longest format, as in rcutils.
const MAX_BYTES: usize = 2048;

/// Parts of a line, in order.
#[derive(Debug)]
pub(super) struct Layout(Vec<Part>);

#[derive(Debug)]
enum Part {
    Text(String),
    Severity,
    Name,
    Message,
    Time,
    TimeAsNanoseconds,
    Function,
    File,
    Line,
}

impl Layout {
    /// Format given in the environment; unknown tokens are kept as text.
    pub(super) fn new(lookup: &impl Fn(&str) -> Option<String>) -> Self {
        let wanted = lookup("RCUTILS_CONSOLE_OUTPUT_FORMAT");
        let wanted = wanted.filter(|text| !text.is_empty() && text.len() <= MAX_BYTES);
        Self::parse(wanted.as_deref().unwrap_or(DEFAULT))
    }

    fn parse(text: &str) -> Self {
        let mut parts = Vec::new();
        let mut rest = text;
        while let Some((before, after)) = rest.split_once('{') {
            let (part, after) = match after.split_once('}') {
                Some((token, after)) if let Some(part) = part(token) => (part, after),
                _ => (Part::Text("{".to_owned()), after),
            };
            parts.extend([Part::Text(before.to_owned()), part]);
            rest = after;
        }
        parts.push(Part::Text(rest.to_owned()));
        Self(parts)
    }

    /// Line of a record, without its newline.
    pub(super) fn line(&self, record: &Record<'_>, now_ns: u128, source: &str) -> String {
        let text = |part: &Part| match part {
            Part::Text(text) => text.clone(),
            Part::Severity => record.level().to_string(),
            Part::Name => source.to_owned(),
            Part::Message => record.args().to_string(),
            Part::Time => format!("{}.{:09}", now_ns / 1_000_000_000, now_ns % 1_000_000_000),
            Part::TimeAsNanoseconds => now_ns.to_string(),
            Part::Function => record.module_path().unwrap_or_default().to_owned(),
            Part::File => record.file().unwrap_or_default().to_owned(),
            Part::Line => record.line().unwrap_or(0).to_string(),
        };
        self.0.iter().map(text).collect()
    }
}

fn part(token: &str) -> Option<Part> {
    Some(match token {
        "severity" => Part::Severity,
        "name" => Part::Name,
        "message" => Part::Message,
        "time" => Part::Time,
        "time_as_nanoseconds" => Part::TimeAsNanoseconds,
        "function_name" => Part::Function,
        "file_name" => Part::File,
        "line_number" => Part::Line,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(form: &str) -> String {
        let lookup =
            |name: &str| (name == "RCUTILS_CONSOLE_OUTPUT_FORMAT").then(|| form.to_owned());
        let text = format_args!("no {{time}} for 5 s");
        let mut record = Record::builder();
        record.level(log::Level::Warn).args(text).line(Some(7));
        let record = record.module_path(Some("a::b")).file(Some("b.rs")).build();
        Layout::new(&lookup).line(&record, 1_700_000_000_000_000_042, "mapper")
    }

    #[test]
    fn lines_look_like_those_of_rcutils() {
        let expected = "[WARN] [1700000000.000000042] [mapper]: no {time} for 5 s";
        assert_eq!(line(""), expected);
        let form = "{time_as_nanoseconds} {function_name} {file_name}:{line_number} {message}";
        let expected = "1700000000000000042 a::b b.rs:7 no {time} for 5 s";
        assert_eq!(line(form), expected);
        assert_eq!(line("{other} {{name}} {"), "{other} {mapper} {");
        assert!(line(&"{message}".repeat(1000)).starts_with("[WARN]"));
    }
}
