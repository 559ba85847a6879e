//! `lattice fleet status`.

use std::path::PathBuf;

use clap::Args;
use lattice_fleet::Result;
use lattice_fleet::status::status;
use lattice_fleet::tables::Tables;

/// Options of `lattice fleet status`.
#[derive(Args)]
pub struct Status {
    /// Folder of tables
    tables: PathBuf,
    /// Folder of the merged map [default: the folder `merged` of the tables]
    #[arg(long, value_name = "DIR")]
    merged: Option<PathBuf>,
    /// Read every file and compare it with its manifest
    #[arg(long)]
    verify: bool,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Status {
    /// Runs the command.
    pub fn run(self) -> Result {
        let tables = Tables::open(&self.tables)?;
        let merged = self.merged.unwrap_or_else(|| self.tables.join("merged"));
        let status = status(&tables, &merged, self.verify)?;
        if self.json {
            println!("{}", serde_json::to_string_pretty(&status)?);
        } else {
            println!("parts          {}", status.parts);
            println!("rows           {}", status.rows);
            println!("bytes          {}", status.bytes);
            println!(
                "tiles          {}, {} of them up to date in the merged map",
                status.tiles, status.tiles_merged
            );
            println!("unfinished     {} parts in tmp", status.unfinished);
        }
        match status.damaged.len() {
            0 => Ok(()),
            count => Err(format!("{count} damaged:\n  {}", status.damaged.join("\n  ")).into()),
        }
    }
}
