//! What a reproduction says: sections with a claim, a finding and a verdict, tables and pictures.
//!
//! A report holds no time, no path and no count of threads, so that the same seed gives the same bytes.

use serde::Serialize;

/// A paper, reproduced.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Report {
    /// Title and authors of the paper.
    pub paper: String,
    /// What was run, without the folder that it was written to.
    pub command: String,
    /// Version of this library.
    pub version: String,
    /// What random numbers began with.
    pub seed: u64,
    /// Whether fewer trials were run than a full report needs.
    pub quick: bool,
    /// In the order of the paper.
    pub sections: Vec<Section>,
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

/// A number beside the one that it should be.
#[derive(Clone, PartialEq, Debug, Serialize)]
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
    /// Whether the number is near enough; never, if it is not a number.
    pub fn holds(&self) -> bool {
        (self.found - self.expected).abs() <= self.tolerance
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
#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(untagged)]
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
