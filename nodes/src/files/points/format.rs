//! Point file formats.

use std::fmt;

/// Supported point file formats.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PointFormat {
    /// PLY with text data.
    PlyAscii,
    /// PLY, little endian.
    PlyBinaryLittleEndian,
    /// PLY, big endian.
    PlyBinaryBigEndian,
    /// PCD with text data.
    PcdAscii,
    /// PCD, point by point.
    PcdBinary,
    /// PCD, field by field, LZF-compressed.
    PcdBinaryCompressed,
    /// Columns of numbers.
    Text,
    /// KITTI scan: x, y, z and intensity as 32-bit floats.
    KittiBin,
    /// LAS.
    Las,
    /// LAS, packed by LASzip.
    Laz,
    /// E57.
    E57,
    /// Binary octree of OctoMap.
    OctoMapBinary,
    /// Octree of OctoMap with log-odds.
    OctoMapFull,
}

impl fmt::Display for PointFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            PointFormat::PlyAscii => "PLY (ascii)",
            PointFormat::PlyBinaryLittleEndian => "PLY (binary little endian)",
            PointFormat::PlyBinaryBigEndian => "PLY (binary big endian)",
            PointFormat::PcdAscii => "PCD (ascii)",
            PointFormat::PcdBinary => "PCD (binary)",
            PointFormat::PcdBinaryCompressed => "PCD (binary compressed)",
            PointFormat::Text => "text",
            PointFormat::KittiBin => "KITTI bin",
            PointFormat::Las => "LAS",
            PointFormat::Laz => "LAZ",
            PointFormat::E57 => "E57",
            PointFormat::OctoMapBinary => "OctoMap (binary)",
            PointFormat::OctoMapFull => "OctoMap (log-odds)",
        })
    }
}
