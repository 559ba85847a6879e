//! Networks as the node sees them: a tensor of colours in, scores or classes of pixels out.

use std::path::PathBuf;

use thiserror::Error;

/// Most classes: their numbers have 16 bits, and one is none.
pub(super) const MAX_CLASSES: usize = u16::MAX as usize;

/// Size of an image or of the output of a network, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Size {
    /// Pixels in all.
    pub fn pixels(self) -> usize {
        self.width.saturating_mul(self.height)
    }
}

/// Library that runs a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// tract, which is built in with the feature `onnx`.
    #[default]
    Tract,
    /// ONNX Runtime, a library that is loaded, with the feature `ort`.
    Ort,
}

impl Backend {
    /// All, by the names that parameters and options have for them.
    pub const ALL: [(&'static str, Self); 2] = [("tract", Self::Tract), ("ort", Self::Ort)];
}

/// Output of a network, row by row.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// A value of each class: all pixels of the first, all of the second and so on.
    Scores {
        /// Number of classes, at least 1.
        classes: usize,
        /// `classes` times the pixels.
        values: Vec<f32>,
    },
    /// The class of each pixel; the network has chosen.
    Classes(Vec<i64>),
}

/// Output of a network with its size, which need not be that of its input.
#[derive(Clone, Debug, PartialEq)]
pub struct Scores {
    /// Size of the output.
    pub size: Size,
    /// Its values.
    pub values: Values,
}

/// Error of a model that cannot be used.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The program does not have the backend.
    #[error("this program was built without the feature `{0}`: build it with `--features {0}`")]
    NotBuilt(&'static str),
    /// The library of ONNX Runtime cannot be used.
    #[error("ONNX Runtime: {0}")]
    Library(String),
    /// The file cannot be read.
    #[error("{}: {error}", path.display())]
    File {
        /// Its path.
        path: PathBuf,
        /// Why not.
        error: std::io::Error,
    },
    /// More bytes than are read.
    #[error("{}: {bytes} bytes, more than {max}", path.display())]
    Large {
        /// Its path.
        path: PathBuf,
        /// Its size.
        bytes: u64,
        /// The limit.
        max: u64,
    },
    /// It is no model, or one that asks for what is not offered.
    #[error("{}: {problem}", path.display())]
    Unusable {
        /// Path of the model.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}

/// A network that labels images.
pub trait Network: Send {
    /// Size of the images that it takes.
    fn input(&self) -> Size;

    /// Names of its classes by their numbers; empty if it does not say.
    fn names(&self) -> &[String];

    /// Output for an image: red, green and blue planes of the size of the input, normalised.
    ///
    /// Errors: the network cannot be run, or its output is of another kind than it says.
    fn run(&self, planes: Vec<f32>) -> Result<Scores, String>;
}
