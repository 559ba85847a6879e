//! Content of a report: sections with checks, tables and figures.

use serde::{Serialize, Serializer};

/// A report of one paper or one evaluation.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Report {
    pub(super) title: String,
    pub(super) lead: String,
    pub(super) command: String,
    pub(super) version: &'static str,
    pub(super) sections: Vec<Section>,
}

impl Report {
    /// A report of sections in their order. One that claims to be reproduced, corrected or not, while a
    /// check of it fails becomes one that is not.
    ///
    /// The command line is without the folder that the report was written to.
    pub fn new(title: &str, lead: String, command: String, sections: Vec<Section>) -> Report {
        Report {
            title: title.to_owned(),
            lead,
            command,
            version: env!("CARGO_PKG_VERSION"),
            sections: sections.into_iter().map(Section::settled).collect(),
        }
    }

    /// A report of `lattice evaluate` with these words.
    pub fn of_evaluation(title: &str, lead: String, words: &str, sections: Vec<Section>) -> Report {
        Report::new(title, lead, format!("lattice evaluate {words}"), sections)
    }

    /// A report of a paper, whose title has its authors.
    pub fn of_paper(title: &str, command: String, quick: bool, sections: Vec<Section>) -> Report {
        let mut lead = "Each table and figure computed anew.".to_owned();
        if quick {
            lead.push_str(" A quick run: fewer samples and trials than a full report.");
        }
        Report::new(title, lead, command, sections)
    }

    /// Sections in their order.
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// Checks that fail, each with its section.
    pub fn failing(&self) -> impl Iterator<Item = (&Section, &Check)> {
        let sections = self.sections.iter();
        sections.flat_map(|section| section.failing().map(move |check| (section, check)))
    }
}

/// One equation, table or figure of a paper, or one question of an evaluation.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Section {
    /// Anchor and stem of its files: `fig5`, `table1`.
    pub id: String,
    /// Heading: "Fig. 5: distortion and voxel count under rotation".
    pub title: String,
    /// Claim of the paper in our words; empty for an evaluation.
    pub claim: String,
    /// Our finding.
    pub finding: String,
    pub verdict: Verdict,
    /// Numbers with a value to meet.
    pub checks: Vec<Check>,
    /// Tables with all numbers.
    pub tables: Vec<Table>,
    pub figures: Vec<Figure>,
}

impl Section {
    /// A section of an evaluation.
    pub fn measured(id: &str, title: &str, finding: impl Into<String>) -> Section {
        Section {
            id: id.to_owned(),
            title: title.to_owned(),
            claim: String::new(),
            finding: finding.into(),
            verdict: Verdict::Measured,
            checks: Vec::new(),
            tables: Vec::new(),
            figures: Vec::new(),
        }
    }

    /// A section of an evaluation with one table, of its name and title.
    pub fn of_table(
        id: &str,
        title: &str,
        columns: &str,
        rows: impl IntoIterator<Item = Vec<Cell>>,
    ) -> Section {
        Section::measured(id, title, "").with_table(Table::new(id, title, columns, rows))
    }

    /// The section with one more table.
    pub fn with_table(mut self, table: Table) -> Section {
        self.tables.push(table);
        self
    }

    pub fn failing(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|check| !check.holds)
    }

    /// The section with a verdict that its checks allow.
    fn settled(mut self) -> Section {
        let claims = matches!(self.verdict, Verdict::Reproduced | Verdict::Corrected(_));
        let names: Vec<&str> = self.failing().map(|check| check.name.as_str()).collect();
        if claims && !names.is_empty() {
            self.verdict = Verdict::NotReproduced(format!("checks fail: {}", names.join("; ")));
        }
        self
    }
}

/// Verdict on a claim.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(tag = "verdict", content = "why", rename_all = "snake_case")]
pub enum Verdict {
    Reproduced,
    /// Result as in the paper once this is corrected.
    Corrected(String),
    /// Not to be settled without these data, which we do not have.
    DependsOnData(String),
    /// Not as the paper says.
    NotReproduced(String),
    /// Measured, without a claim.
    Measured,
}

impl Verdict {
    pub fn name(&self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::Corrected(_) => "reproduced, corrected",
            Self::DependsOnData(_) => "depends on data we do not have",
            Self::NotReproduced(_) => "not reproduced",
            Self::Measured => "measured",
        }
    }

    pub fn why(&self) -> &str {
        match self {
            Self::Reproduced | Self::Measured => "",
            Self::Corrected(why) | Self::DependsOnData(why) | Self::NotReproduced(why) => why,
        }
    }
}

/// A number beside the one that it should be; none is near enough to NaN.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Check {
    /// Name with its unit: "RMS of FCC (m)".
    pub name: String,
    /// Number printed in the paper, if it is.
    pub(super) printed: Option<f64>,
    /// Number from theory or a measurement made elsewhere.
    pub(super) expected: f64,
    pub(super) found: f64,
    /// Greatest allowed difference, in the same unit.
    pub(super) tolerance: f64,
    pub(super) holds: bool,
}

impl Check {
    /// A number that is not printed in the paper.
    pub fn new(name: impl Into<String>, expected: f64, found: f64, tolerance: f64) -> Check {
        Check {
            name: name.into(),
            printed: None,
            expected,
            found,
            tolerance,
            holds: (found - expected).abs() <= tolerance,
        }
    }

    /// True if the difference is within the tolerance.
    pub fn holds(&self) -> bool {
        self.holds
    }

    /// The same with the number printed in the paper.
    pub fn with_printed(self, printed: Option<f64>) -> Check {
        Check { printed, ..self }
    }

    /// A count that must be met.
    pub fn count(name: impl Into<String>, expected: usize, found: usize) -> Check {
        Check::new(name, expected as f64, found as f64, 0.0)
    }

    /// A statement that must be true: 1 if it is, 0 if not.
    pub fn that(name: impl Into<String>, is_so: bool) -> Check {
        Check::count(format!("{} (1: yes)", name.into()), 1, usize::from(is_so))
    }
}

/// A table; also a file `<name>.csv`.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Table {
    /// Stem of its file, unique in the report.
    pub name: String,
    /// Caption above it.
    pub caption: String,
    /// Names of its columns, with units.
    pub columns: Vec<String>,
    /// Rows with a cell for each column.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table of rows; the names of its columns have bars between them.
    pub fn new(
        name: impl Into<String>,
        caption: impl Into<String>,
        columns: &str,
        rows: impl IntoIterator<Item = Vec<Cell>>,
    ) -> Table {
        Table {
            name: name.into(),
            caption: caption.into(),
            columns: columns.split('|').map(str::to_owned).collect(),
            rows: rows.into_iter().collect(),
        }
    }
}

/// A cell of a table.
#[derive(Clone, PartialEq, Debug)]
pub enum Cell {
    Text(String),
    /// A number and its digits after the point on the page; files hold all of them.
    Number(f64, usize),
    Count(u64),
    Empty,
}

/// Numbers with `digits` decimals.
pub fn numbers<const N: usize>(digits: usize, values: [f64; N]) -> [Cell; N] {
    values.map(|value| Cell::Number(value, digits))
}

impl Cell {
    /// A number, or no value.
    pub fn number(value: Option<f64>, digits: usize) -> Cell {
        value.map_or(Cell::Empty, |value| Cell::Number(value, digits))
    }

    /// Text of the cell on a page.
    pub(super) fn shown(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(value, digits) => number(*value, *digits),
            Self::Count(count) => count.to_string(),
            Self::Empty => String::new(),
        }
    }
}

/// Number with `digits` decimals; a dash if it is not finite.
pub(super) fn number(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let text = format!("{value:.digits$}");
    // No -0.00.
    let magnitude = text.trim_start_matches('-');
    match magnitude.bytes().all(|b| b == b'0' || b == b'.') {
        true => magnitude.to_owned(),
        false => text,
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => to.serialize_str(text),
            Self::Number(value, _) => to.serialize_f64(*value),
            Self::Count(count) => to.serialize_u64(*count),
            Self::Empty => to.serialize_none(),
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Cell {
        Cell::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Cell {
        Cell::Text(text)
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Cell {
        Cell::Count(count as u64)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Figure {
    /// Stem of its file, unique in the report.
    pub name: String,
    pub caption: String,
    /// The drawing: an `<svg>` element, no scripts and no links to other files.
    #[serde(skip)]
    pub svg: String,
}

impl Figure {
    pub fn new(name: impl Into<String>, caption: impl Into<String>, svg: String) -> Figure {
        let (name, caption) = (name.into(), caption.into());
        Figure { name, caption, svg }
    }
}
