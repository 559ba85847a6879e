//! The Markdown of a report: text and tables for a terminal or a page of documentation.

use super::content::{Report, Table};

/// The report in Markdown; pictures are named as files beside it.
pub fn markdown(report: &Report) -> String {
    let mut text = format!("# {}\n\n{}\n", report.title, report.lead);
    for section in &report.sections {
        text.push_str(&format!("\n## {}\n", section.title));
        for words in [&section.claim, &section.finding] {
            if !words.is_empty() {
                text.push_str(&format!("\n{words}\n"));
            }
        }
        for table in &section.tables {
            add_table(&mut text, table);
        }
        for figure in &section.figures {
            text.push_str(&format!("\n![{}]({}.svg)\n", figure.caption, figure.name));
        }
    }
    text
}

fn add_table(text: &mut String, table: &Table) {
    text.push_str(&format!("\n{}:\n\n", table.caption));
    let mut line = |cells: Vec<String>| {
        let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "/")).collect();
        text.push_str(&format!("| {} |\n", cells.join(" | ")));
    };
    line(table.columns.clone());
    line(vec!["---".to_owned(); table.columns.len()]);
    for row in &table.rows {
        line(row.iter().map(|cell| cell.shown()).collect());
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::report;
    use super::*;

    #[test]
    fn a_table_has_a_line_for_each_row() {
        let text = markdown(&report());
        for part in [
            "## Fig. 1: cells & sides",
            "Sides:\n\n| lattice | side (m) | cells | a, b |\n| --- | --- | --- | --- |\n",
            "| cubic | 0.123 | 6 |  |\n| a \"b\" | – | 7 | <i> |\n",
            "![A \"sketch\"](sketch.svg)",
        ] {
            assert!(text.contains(part), "{part} is not in {text}");
        }
    }
}
