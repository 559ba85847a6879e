//! Rust structs of ROS 2 messages, services and actions, from their `.msg`, `.srv` and `.action` texts.
//!
//! For messages that `lattice_msgs` has not: call [`Generator`] in a build script, and include what it wrote with
//! `lattice_msgs::include_messages!`. The structs have the traits of `lattice_msgs`, hence CDR, type hashes, and topics,
//! services and actions of `lattice_runtime`. The messages of `lattice_msgs` itself are made by this crate.
//!
//! ```no_run
//! // build.rs; my_msgs is a ROS package with the folders msg, srv and action.
//! fn main() -> Result<(), lattice_msgs_generator::GenerateError> {
//!     lattice_msgs_generator::Generator::new()
//!         .package("my_msgs", "../my_msgs")
//!         .generate()
//! }
//! ```
//!
//! | text | Rust |
//! |---|---|
//! | `uint8[]`, `byte[]`, `char[]` | `ByteBuf` |
//! | `T[]`, `T[<=N]`, `T[N]` | `Vec<T>`, `Vec<T>`, `[T; N]`; bounds are not checked |
//! | `string`, `string<=N` | `String`; bounds are not checked |
//! | `wstring` | refused |
//! | `type` and other keywords | `type_` |
//! | a message without fields | one byte, as on the wire |
//! | service `S`; action `A` | `S`, `SRequest`, `SResponse`; `AAction`, `AGoal`, `AResult`, `AFeedback` and more |
//!
//! Comments become documentation: those at the start are of the message; those above a line, behind it, or indented
//! below it are of its field or constant. Small messages of fixed size without fields of another crate are `Copy`.
#![forbid(unsafe_code)]

mod definition;
mod documentation;
mod error;
mod literal;
mod names;
mod package;
mod rust;
mod structs;

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

pub use error::GenerateError;
use names::{Names, module};
use package::Package;
use rust::Writer;

/// Packages whose structs are made together.
///
/// A message may have fields of any of these packages, and of those in `lattice_msgs`.
#[derive(Clone, Debug)]
#[must_use]
pub struct Generator {
    packages: Vec<(String, PathBuf)>,
    root: &'static str,
}

impl Default for Generator {
    fn default() -> Self {
        Self::new()
    }
}

impl Generator {
    /// A generator without packages.
    pub fn new() -> Self {
        Self {
            packages: Vec::new(),
            root: "::lattice_msgs",
        }
    }

    /// Adds a ROS package: its name, and the folder with its definitions, or with `msg/`, `srv/` and `action/` of them.
    pub fn package(mut self, name: &str, folder: impl Into<PathBuf>) -> Self {
        self.packages.push((name.to_owned(), folder.into()));
        self
    }

    /// Paths for use in `lattice_msgs` itself.
    #[doc(hidden)]
    pub fn inside_lattice_msgs(mut self) -> Self {
        self.root = "crate";
        self
    }

    /// Writes `PACKAGE.rs` for each package into the folder `OUT_DIR` of a build script.
    ///
    /// cargo calls the script again if a definition changes.
    ///
    /// # Errors
    ///
    /// A folder or file that cannot be read or written, or a malformed definition, by file and line.
    pub fn generate(&self) -> Result<(), GenerateError> {
        let folder = env::var_os("OUT_DIR").ok_or(GenerateError::NoOutDir)?;
        for (_, folder) in &self.packages {
            println!("cargo::rerun-if-changed={}", folder.display());
        }
        self.write_to(Path::new(&folder))
    }

    /// Writes `PACKAGE.rs` for each package into a folder.
    ///
    /// # Errors
    ///
    /// As [`Generator::generate`].
    pub fn write_to(&self, folder: &Path) -> Result<(), GenerateError> {
        let packages = self.packages.iter();
        let packages = packages.map(|(name, folder)| Package::read(name, folder));
        let packages = packages.collect::<Result<Vec<_>, _>>()?;
        let names = Names::new(&packages, self.root);
        let writer = Writer::new(&names);
        for package in &packages {
            let path = folder.join(format!("{}.rs", module(&package.name)));
            fs::write(&path, writer.package(package)?)
                .map_err(|source| GenerateError::File { path, source })?;
        }
        Ok(())
    }
}

/// Compiles the build script of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(test)]
mod tests {
    use super::*;

    fn written(files: &[(&str, &str)]) -> Result<String, GenerateError> {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        let generator = Generator::new().package("my_msgs", folder.path());
        generator.write_to(folder.path())?;
        Ok(fs::read_to_string(folder.path().join("my_msgs.rs")).unwrap())
    }

    #[test]
    fn code_of_a_message() {
        let code = written(&[
            (
                "msg/Cell.msg",
                "# A cell\nuint8[2] type [1, 2] # kind\nuint16 NICKEL=3\n",
            ),
            (
                "msg/Pack.msg",
                "std_msgs/Header header\nCell[] cells\nfloat64[36] table\nbyte[] raw\n",
            ),
        ]);
        let code = code.unwrap();
        for part in [
            "/// A cell.\n#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash,",
            "    /// Kind.\n    #[serde(rename = \"type\")]\n    pub type_: [u8; 2],",
            "            type_: [1, 2],",
            "    /// `3`.\n    pub const NICKEL: u16 = 3;",
            "pub header: ::lattice_msgs::std_msgs::Header,",
            "pub cells: ::std::vec::Vec<self::Cell>,",
            "    #[serde(with = \"::lattice_msgs::generated::BigArray\")]\n    pub table: [f64; 36],",
            "pub raw: ::lattice_msgs::generated::ByteBuf,",
            "visitor.visit::<Pack>();",
        ] {
            assert!(code.contains(part), "{part}\n{code}");
        }
    }

    #[test]
    fn refusals_name_file_and_line() {
        for (files, wanted) in [
            (
                &[("msg/A.msg", "int32 a\nB b\n")][..],
                "msg/A.msg:2: `B` is no message of package my_msgs",
            ),
            (
                &[("A.msg", "uint8 a 300\n")],
                "A.msg:1: `300` is no value of type u8",
            ),
            (&[("a_b.msg", "uint8 a\n")], "`a_b` is no name of a message"),
            (&[("A.txt", "")], "no .msg, .srv or .action file"),
        ] {
            let error = written(files).unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
        }
        let error = Generator::new()
            .package("a", "/nowhere")
            .write_to(Path::new("/tmp"));
        assert!(matches!(error, Err(GenerateError::File { .. })));
    }
}
