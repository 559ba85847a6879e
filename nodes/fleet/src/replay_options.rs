//! Options of `lattice replay` in a task: known ones, and the texts of parameter files.

use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::path::Path;

use lattice_core::voxels::file::LatticeFigures;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::files::{at, sha256_of, write_whole};

/// Largest number of parameters and parameter files of a task.
const MAX_PARAMS: usize = 1000;
/// Largest parameter file, bytes.
const MAX_PARAMS_BYTES: u64 = 1 << 20;

/// Options of `lattice replay`, the same for all logs.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReplayOptions {
    /// Texts of the parameter files.
    pub params: Vec<String>,
    /// Single parameters, `NAME:=VALUE`.
    pub param: Vec<String>,
    /// Name of the lattice; none: that of the parameters.
    pub lattice: Option<String>,
    /// Volume of a cell, m^3; none: that of the parameters.
    pub cell_volume_m3: Option<f64>,
}

impl ReplayOptions {
    /// Reads the text of a parameter file.
    pub fn read_params(path: &Path) -> Result<String> {
        let bytes = fs::metadata(path).map_err(|error| at(path, error))?.len();
        if bytes > MAX_PARAMS_BYTES {
            let reason =
                format!("{bytes} bytes, above the limit of {MAX_PARAMS_BYTES} of a parameter file");
            return Err(at(path, reason));
        }
        fs::read_to_string(path).map_err(|error| at(path, error))
    }

    /// Fails for an option that `lattice replay` could take for another one, or a value out of range.
    pub fn check(&self) -> Result {
        let counted = self.params.len().max(self.param.len());
        if counted > MAX_PARAMS {
            return Err(format!("{counted} parameters, above the limit of {MAX_PARAMS}").into());
        }
        let longest = self.params.iter().chain(&self.param).map(String::len).max();
        let longest = longest.unwrap_or(0) as u64;
        if longest > MAX_PARAMS_BYTES {
            return Err(format!(
                "a parameter of {longest} bytes, above the limit of {MAX_PARAMS_BYTES}"
            )
            .into());
        }
        let is_param = |text: &&String| {
            let name = text.split_once(":=").map_or("", |(name, _)| name);
            let is_name = |c: char| c.is_alphanumeric() || "_.:/".contains(c);
            !name.is_empty() && name.chars().all(is_name)
        };
        if let Some(wrong) = self.param.iter().find(|text| !is_param(text)) {
            return Err(format!("parameter {wrong:?} is not NAME:=VALUE").into());
        }
        if let Some(lattice) = &self.lattice {
            LatticeFigures::kind_of(lattice)?;
        }
        match self.cell_volume_m3 {
            Some(volume_m3) if !(volume_m3 > 0.0 && volume_m3.is_finite()) => {
                Err(format!("cell volume {volume_m3} m^3 is not above 0 (`--cell-volume`)").into())
            }
            _ => Ok(()),
        }
    }

    /// Settings of the part: the options, and digests of the parameter files.
    pub fn settings(&self) -> Vec<String> {
        let mut settings: Vec<String> = self.options().flatten().collect();
        for text in &self.params {
            settings.push(format!("--params of SHA-256 {}", sha256_of(text)));
        }
        settings
    }

    /// Arguments of `lattice replay`; the parameter files are written to a folder.
    pub fn arguments(&self, folder: &Path) -> Result<Vec<OsString>> {
        let mut arguments = Vec::new();
        for (number, text) in self.params.iter().enumerate() {
            let path = folder.join(format!("params{number}.yaml"));
            write_whole(&path, |file| Ok(file.write_all(text.as_bytes())?))?;
            arguments.extend(["--params".into(), path.into_os_string()]);
        }
        for [name, value] in self.options() {
            arguments.push(name.into());
            arguments.push(value.into());
        }
        Ok(arguments)
    }

    fn options(&self) -> impl Iterator<Item = [String; 2]> {
        let param = self
            .param
            .iter()
            .map(|value| ["-p".to_owned(), value.clone()]);
        let lattice = self.lattice.iter();
        let lattice = lattice.map(|name| ["--lattice".to_owned(), name.clone()]);
        let volume = self.cell_volume_m3.iter();
        let volume = volume.map(|m3| ["--cell-volume".to_owned(), m3.to_string()]);
        param.chain(lattice).chain(volume)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_that_hide_others_are_refused() {
        let of = |param: &str| ReplayOptions {
            param: vec![param.to_owned()],
            ..ReplayOptions::default()
        };
        assert!(
            of("/robot1/lattice_mapper:ins.source:=odometry")
                .check()
                .is_ok()
        );
        for wrong in ["--out-table=/etc", "-x:=1", "a b:=1", ":=1", "name"] {
            let error = of(wrong).check().unwrap_err().to_string();
            assert!(error.contains("is not NAME:=VALUE"), "{wrong}: {error}");
        }
        let lattice = ReplayOptions {
            lattice: Some("--json".to_owned()),
            ..ReplayOptions::default()
        };
        assert!(lattice.check().is_err());
        for volume_m3 in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let options = ReplayOptions {
                cell_volume_m3: Some(volume_m3),
                ..ReplayOptions::default()
            };
            assert!(options.check().is_err(), "{volume_m3}");
        }
    }
}
