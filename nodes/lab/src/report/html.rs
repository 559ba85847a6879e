//! The HTML of a report: one page with its style and pictures inline, and no scripts.

use super::content::{Cell, Check, Figure, Report, Section, Table, Verdict, number};

/// Rows from which a table is folded away.
const LONG: usize = 14;
/// Characters up to which a text in a table is not broken.
const SHORT: usize = 32;

/// The report as an HTML page.
pub fn html(report: &Report) -> String {
    let title = escaped(&report.title);
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>{title}</title>\n<style>\n{}</style>\n</head>\n<body>\n\
         <h1>{title}</h1>\n\
         <p class=\"run\">{} <code>{}</code>, Lattice {}</p>\n",
        include_str!("style.css"),
        escaped(&report.lead),
        escaped(&report.command),
        escaped(report.version),
    );
    if report
        .sections
        .iter()
        .any(|section| !section.claim.is_empty())
    {
        add_verdicts(&mut page, report);
    }
    for section in &report.sections {
        add_section(&mut page, section);
    }
    page.push_str("</body>\n</html>\n");
    page
}

/// The table of all verdicts, with links to the sections.
fn add_verdicts(page: &mut String, report: &Report) {
    page.push_str(
        "<div class=\"scroll\"><table>\n<caption>Verdicts</caption>\n\
         <thead><tr><th>Of the paper</th><th>Verdict</th><th class=\"n\">Checks that hold</th><th>Why</th></tr></thead>\n<tbody>\n",
    );
    for section in &report.sections {
        let failing = section.failing().count();
        let all = section.checks.len();
        page.push_str(&format!(
            "<tr><td><a href=\"#{}\">{}</a></td><td>{}</td><td class=\"n{}\">{} of {all}</td><td>{}</td></tr>\n",
            escaped(&section.id),
            escaped(&section.title),
            badge(&section.verdict),
            if failing > 0 { " no" } else { "" },
            all - failing,
            escaped(section.verdict.why()),
        ));
    }
    page.push_str("</tbody></table></div>\n");
}

fn badge(verdict: &Verdict) -> String {
    let class = match verdict {
        Verdict::Reproduced => "reproduced",
        Verdict::Corrected(_) => "corrected",
        Verdict::DependsOnData(_) => "data",
        Verdict::NotReproduced(_) => "failed",
        Verdict::Measured => return String::new(),
    };
    format!("<span class=\"badge {class}\">{}</span>", verdict.name())
}

fn add_section(page: &mut String, section: &Section) {
    page.push_str(&format!(
        "<section id=\"{}\">\n<h2>{} {}</h2>\n",
        escaped(&section.id),
        escaped(&section.title),
        badge(&section.verdict)
    ));
    if !section.verdict.why().is_empty() {
        let why = escaped(section.verdict.why());
        page.push_str(&format!("<p class=\"why\">{why}</p>\n"));
    }
    let finding = escaped(&section.finding);
    match section.claim.as_str() {
        "" => page.push_str(&format!("<p>{finding}</p>\n")),
        claim => page.push_str(&format!(
            "<div class=\"sides\"><div><h3>The paper</h3><p>{}</p></div>\
             <div class=\"ours\"><h3>What we find</h3><p>{finding}</p></div></div>\n",
            escaped(claim),
        )),
    }
    for figure in &section.figures {
        add_figure(page, figure);
    }
    add_checks(page, &section.checks);
    for table in &section.tables {
        add_table(page, table);
    }
    page.push_str("</section>\n");
}

/// Pictures have no ids, so that two of them do not clash.
fn add_figure(page: &mut String, figure: &Figure) {
    let caption = escaped(&figure.caption);
    let labelled = format!("<svg role=\"img\" aria-label=\"{caption}\" ");
    let svg = figure.svg.trim_end().replacen("<svg ", &labelled, 1);
    let name = escaped(&figure.name);
    page.push_str(&format!(
        "<figure id=\"figure-{name}\">\n{svg}\n<figcaption>{caption}</figcaption>\n</figure>\n"
    ));
}

fn add_checks(page: &mut String, checks: &[Check]) {
    if checks.is_empty() {
        return;
    }
    let mut rows = String::from(
        "<thead><tr><th>Number</th><th class=\"n\">printed</th><th class=\"n\">expected</th>\
         <th class=\"n\">found</th><th class=\"n\">may be off by</th><th>holds</th></tr></thead>\n<tbody>\n",
    );
    for check in checks {
        let digits = digits_of(check.tolerance);
        let printed = check
            .printed
            .map_or(String::new(), |printed| printed.to_string());
        let (class, word) = match check.holds {
            true => ("yes", "yes"),
            false => ("no", "NO"),
        };
        rows.push_str(&format!(
            "<tr><td>{}</td><td class=\"n\">{printed}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
             <td class=\"n\">{}</td><td class=\"{class}\">{word}</td></tr>\n",
            escaped(&check.name),
            number(check.expected, digits),
            number(check.found, digits),
            number(check.tolerance, digits),
        ));
    }
    let failing = checks.iter().filter(|check| !check.holds).count();
    let summary = match failing {
        0 => format!("Checks: all {} hold", checks.len()),
        _ => format!("Checks: {failing} of {} fail", checks.len()),
    };
    fold(page, &summary, checks.len() > LONG && failing == 0, &rows);
}

fn add_table(page: &mut String, table: &Table) {
    // A column is one of numbers if any cell is.
    let numbers: Vec<bool> = (0..table.columns.len())
        .map(|column| {
            let mut cells = table.rows.iter().filter_map(|row| row.get(column));
            cells.any(|cell| matches!(cell, Cell::Number(..) | Cell::Count(_)))
        })
        .collect();
    let class = |column: usize| match numbers.get(column) {
        Some(true) => " class=\"n\"",
        _ => "",
    };
    let mut rows = String::from("<thead><tr>");
    for (column, name) in table.columns.iter().enumerate() {
        rows.push_str(&format!("<th{}>{}</th>", class(column), escaped(name)));
    }
    rows.push_str("</tr></thead>\n<tbody>\n");
    for row in &table.rows {
        rows.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            let class = match cell {
                Cell::Text(text) if text.chars().count() <= SHORT => " class=\"s\"",
                Cell::Text(_) => "",
                _ => class(column),
            };
            let text = escaped(&cell.shown());
            rows.push_str(&format!("<td{class}>{text}</td>"));
        }
        rows.push_str("</tr>\n");
    }
    let title = format!("{} ({}.csv)", table.caption, table.name);
    fold(page, &title, table.rows.len() > LONG, &rows);
}

/// A table, behind its title where it is long.
fn fold(page: &mut String, title: &str, long: bool, rows: &str) {
    let title = escaped(title);
    page.push_str(&match long {
        true => format!(
            "<details><summary>{title}</summary><div class=\"scroll\"><table>\n{rows}</tbody></table></div></details>\n"
        ),
        false => format!(
            "<div class=\"scroll\"><table>\n<caption>{title}</caption>\n{rows}</tbody></table></div>\n"
        ),
    });
}

/// Digits after the point that show a difference of this size.
fn digits_of(tolerance: f64) -> usize {
    match tolerance > 0.0 {
        true => (1.0 - tolerance.log10().floor()).clamp(0.0, 9.0) as usize,
        false => 0,
    }
}

/// Escaped text, for an element or an attribute in double quotes.
pub fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::super::tests::{report, report_of, section};
    use super::*;

    #[test]
    fn a_page_says_what_was_run_and_escapes_all_words() {
        let page = html(&report());
        for part in [
            "<code>lattice paper</code>, Lattice ",
            "A quick run",
            "Cells are &lt;b&gt;cubes&lt;/b&gt;.",
            "Fig. 1: cells &amp; sides",
            "<a href=\"#fig1\">",
            "<section id=\"fig1\">",
            "side of &lt;cubic&gt; (m)",
            "<td class=\"n\">0.123</td>",
            "aria-label=\"A &quot;sketch&quot;\" width=\"9\"",
            "2 of 2",
            "<td class=\"s\">a &quot;b&quot;</td><td class=\"n\">–</td>",
        ] {
            assert!(page.contains(part), "{part} is not in {page}");
        }
        for part in "<b> <i> <script http: https: @import url(".split(' ') {
            assert!(!page.contains(part), "{part} is in {page}");
        }
    }

    #[test]
    fn a_check_that_fails_is_seen_in_three_places() {
        let page = html(&report_of(vec![section(Verdict::Reproduced, 2.0)]));
        assert!(page.contains("<td class=\"n no\">1 of 2</td>"));
        assert!(page.contains("Checks: 1 of 2 fail") && page.contains("<td class=\"no\">NO</td>"));
        assert!(page.contains("badge failed") && !page.contains("badge reproduced"));
    }

    #[test]
    fn numbers_show_what_can_be_seen_of_them() {
        assert_eq!(number(-0.0004, 2), "0.00");
        assert_eq!(number(-12.345, 1), "-12.3");
        assert_eq!(number(f64::NAN, 1), "–");
        assert_eq!([0.002, 0.0, 30.0].map(digits_of), [4, 0, 0]);
    }
}
