//! `lattice map merge`, `diff` and `crop`.

use std::path::PathBuf;

use clap::Args;
use lattice_core::voxels::file::MapContents;
use lattice_core::voxels::label_names::LabelNames;
use lattice_core::voxels::set_ops;
use serde::Serialize;

use super::output::Form;
use super::{read, read_named};
use crate::CliResult;
use crate::progress::Progress;

/// Options of `lattice map merge`.
#[derive(Args)]
pub struct Merge {
    /// Map files; the first one defines the datum
    #[arg(required = true)]
    maps: Vec<PathBuf>,
    /// Map file to write
    #[arg(long, short)]
    out: PathBuf,
    #[command(flatten)]
    form: Form,
    /// Print the written size as JSON
    #[arg(long)]
    json: bool,
}

/// Options of `lattice map diff`.
#[derive(Args)]
pub struct Diff {
    /// Map file
    a: PathBuf,
    /// Map file with the same cells
    b: PathBuf,
    /// Write the voxels of the first map that are not in the second
    #[arg(long, short)]
    out: Option<PathBuf>,
    #[command(flatten)]
    form: Form,
    /// Print the counts as JSON
    #[arg(long)]
    json: bool,
}

/// Options of `lattice map crop`.
#[derive(Args)]
pub struct Crop {
    /// Map file
    map: PathBuf,
    /// Smallest coordinates of a centre, map frame, in m
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true, required = true)]
    min: Vec<f64>,
    /// Largest coordinates, exclusive, so that adjacent boxes are disjoint
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true, required = true)]
    max: Vec<f64>,
    /// Map file to write
    #[arg(long, short)]
    out: PathBuf,
    #[command(flatten)]
    form: Form,
    /// Print the written size as JSON
    #[arg(long)]
    json: bool,
}

impl Merge {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let progress = Progress::new("merge");
        let mut merged: Option<MapContents> = None;
        let mut names = LabelNames::new();
        for (number, path) in self.maps.iter().enumerate() {
            progress.set(number as f64 / self.maps.len() as f64);
            let (mut map, named) = read_named(path)?;
            let named = { named.into_iter() }.filter(|_| !self.form.occupancy_only);
            for (label, name) in named {
                let known = names.entry(label).or_insert_with(|| name.clone());
                if *known != name {
                    let path = path.display();
                    return Err(format!(
                        "{path}: label {label} is {name:?}, but {known:?} in an earlier map: only maps with the same classes can be merged"
                    )
                    .into());
                }
            }
            if self.form.occupancy_only {
                map.drop_payload();
            }
            match &mut merged {
                Some(merged) => merged
                    .merge(map)
                    .map_err(|e| format!("{}: {e}", path.display()))?,
                None => merged = Some(map),
            }
        }
        progress.done();
        let merged = merged.ok_or("no map to merge")?;
        Ok(self
            .form
            .write(&merged, &names, &self.out)?
            .print(self.json)?)
    }
}

#[derive(Serialize)]
struct Counts {
    only_a: usize,
    only_b: usize,
    both: usize,
}

impl Diff {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let ((mut a, names), (b, _)) = (read_named(&self.a)?, read(&self.b)?);
        let there = |e| format!("{}: {e}", self.b.display());
        a.expect_cells_of(&b).map_err(there)?;
        let b = b.with_datum(a.datum_index()).map_err(there)?.into_keys();
        let mut counts = Counts {
            only_a: 0,
            only_b: 0,
            both: 0,
        };
        set_ops::walk(a.keys(), &b, |_, side| {
            *(match side {
                std::cmp::Ordering::Less => &mut counts.only_a,
                std::cmp::Ordering::Equal => &mut counts.both,
                std::cmp::Ordering::Greater => &mut counts.only_b,
            }) += 1;
        });
        if let Some(out) = &self.out {
            let mut theirs = b.iter().peekable();
            a.retain(|key, _| {
                while theirs.next_if(|other| **other < key).is_some() {}
                theirs.peek() != Some(&&key)
            });
            self.form.write(&a, &names, out)?;
        }
        if self.json {
            println!("{}", serde_json::to_string_pretty(&counts)?);
            return Ok(());
        }
        println!("only in {:<24} {}", self.a.display(), counts.only_a);
        println!("only in {:<24} {}", self.b.display(), counts.only_b);
        println!("{:<32} {}", "in both", counts.both);
        Ok(())
    }
}

impl Crop {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let sides: Vec<(f64, f64)> = self.min.iter().copied().zip(self.max.clone()).collect();
        // Rejects NaN too.
        if !sides.iter().all(|(min, max)| min < max) {
            return Err(format!(
                "--min {:?} is not below --max {:?} on every axis",
                self.min, self.max
            )
            .into());
        }
        let (mut map, names) = read_named(&self.map)?;
        map.retain(|_, center_m| {
            let mut sides = sides.iter().zip(center_m.iter());
            sides.all(|((min, max), x)| (min..max).contains(&x))
        });
        Ok(self.form.write(&map, &names, &self.out)?.print(self.json)?)
    }
}
