//! What a reproduction says: sections with a claim, a finding and a verdict, tables and pictures.
//!
//! A report holds no time, no path and no count of threads, so that the same seed gives the same bytes.

mod files;
mod html;
pub mod plot;

use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

pub use files::{ReportError, write};
pub use html::{escaped, html};

/// A paper, reproduced.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Report {
    paper: String,
    command: String,
    version: &'static str,
    seed: u64,
    quick: bool,
    sections: Vec<Section>,
}

/// What a report is of.
#[derive(Clone, PartialEq, Debug)]
pub struct Head {
    /// Title and authors of the paper.
    pub paper: String,
    /// What was run, without the folder that it was written to.
    pub command: String,
    /// What random numbers began with.
    pub seed: u64,
    /// Whether fewer trials were run than a full report needs.
    pub quick: bool,
}

impl Report {
    /// Of sections in the order of the paper. One that claims to be reproduced, corrected or not, while
    /// a check of it fails becomes one that is not.
    pub fn new(head: Head, sections: Vec<Section>) -> Report {
        Report {
            paper: head.paper,
            command: head.command,
            version: env!("CARGO_PKG_VERSION"),
            seed: head.seed,
            quick: head.quick,
            sections: sections.into_iter().map(Section::settled).collect(),
        }
    }

    /// In the order of the paper.
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// Checks that fail, each with the section that it belongs to.
    pub fn failing(&self) -> impl Iterator<Item = (&Section, &Check)> {
        let sections = self.sections.iter();
        sections.flat_map(|section| section.failing().map(move |check| (section, check)))
    }
}

/// One equation, table or figure of a paper.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Section {
    /// Its anchor, and the stem of its files: `fig5`, `table1`.
    pub id: String,
    /// "Fig. 5: distortion and voxel count under rotation".
    pub title: String,
    /// What the paper says, in our words.
    pub claim: String,
    /// What we find.
    pub finding: String,
    /// Whether they agree.
    pub verdict: Verdict,
    /// Numbers with a value to meet.
    pub checks: Vec<Check>,
    /// All numbers.
    pub tables: Vec<Table>,
    /// Pictures.
    pub figures: Vec<Figure>,
}

impl Section {
    /// Checks that do not hold.
    pub fn failing(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|check| !check.holds())
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

/// How a claim stands.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(tag = "verdict", content = "why", rename_all = "snake_case")]
pub enum Verdict {
    /// As the paper says.
    Reproduced,
    /// As the paper says once this is corrected.
    Corrected(String),
    /// Not to be settled without these data, which we do not have.
    DependsOnData(String),
    /// Not as the paper says.
    NotReproduced(String),
}

impl Verdict {
    /// In a few words.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::Corrected(_) => "reproduced, corrected",
            Self::DependsOnData(_) => "depends on data we do not have",
            Self::NotReproduced(_) => "not reproduced",
        }
    }

    /// The correction, the data or the reason.
    pub fn why(&self) -> &str {
        match self {
            Self::Reproduced => "",
            Self::Corrected(why) | Self::DependsOnData(why) | Self::NotReproduced(why) => why,
        }
    }
}

/// A number beside the one that it should be.
#[derive(Clone, PartialEq, Debug)]
pub struct Check {
    /// Of what, with its unit: "RMS of FCC (m)".
    pub name: String,
    /// As printed in the paper, if it is.
    pub printed: Option<f64>,
    /// From theory or a measurement made elsewhere.
    pub expected: f64,
    /// Ours.
    pub found: f64,
    /// How far it may be off, in the same unit.
    pub tolerance: f64,
}

impl Check {
    /// Something that must be so: 1 if it is, 0 if not.
    pub fn that(name: impl Into<String>, is_so: bool) -> Check {
        Check {
            name: format!("{} (1: yes)", name.into()),
            printed: None,
            expected: 1.0,
            found: f64::from(u8::from(is_so)),
            tolerance: 0.0,
        }
    }

    /// Whether the number is near enough; never, if it is not a number.
    pub fn holds(&self) -> bool {
        (self.found - self.expected).abs() <= self.tolerance
    }
}

impl Serialize for Check {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut fields = to.serialize_struct("Check", 6)?;
        fields.serialize_field("name", &self.name)?;
        fields.serialize_field("printed", &self.printed)?;
        fields.serialize_field("expected", &self.expected)?;
        fields.serialize_field("found", &self.found)?;
        fields.serialize_field("tolerance", &self.tolerance)?;
        fields.serialize_field("holds", &self.holds())?;
        fields.end()
    }
}

/// Rows of numbers; also a file `<name>.csv`.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Table {
    /// Stem of its file, unique in the report.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// Names of its columns, with units.
    pub columns: Vec<String>,
    /// A cell for each column.
    pub rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Clone, PartialEq, Debug)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A number and the digits after the point that it is shown with; files hold all of them.
    Number(f64, usize),
    /// A count.
    Count(u64),
    /// Nothing.
    Empty,
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

/// A picture.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Figure {
    /// Stem of its name, unique in the report.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// The drawing: an `<svg>` element, no scripts and no links to other files.
    #[serde(skip)]
    pub svg: String,
}

#[cfg(test)]
mod tests;
