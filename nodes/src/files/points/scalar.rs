//! Numbers in binary form.

/// Number types of point files.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    /// Size in bytes.
    pub fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    pub fn is_float(self) -> bool {
        matches!(self, Scalar::F32 | Scalar::F64)
    }

    /// Decodes the number at the start of little-endian `bytes`; `None` if there are too few.
    pub fn decode(self, bytes: &[u8]) -> Option<f64> {
        Some(match self {
            Scalar::I8 => i8::from_le_bytes(first(bytes)?).into(),
            Scalar::U8 => u8::from_le_bytes(first(bytes)?).into(),
            Scalar::I16 => i16::from_le_bytes(first(bytes)?).into(),
            Scalar::U16 => u16::from_le_bytes(first(bytes)?).into(),
            Scalar::I32 => i32::from_le_bytes(first(bytes)?).into(),
            Scalar::U32 => u32::from_le_bytes(first(bytes)?).into(),
            Scalar::F32 => f32::from_le_bytes(first(bytes)?).into(),
            Scalar::F64 => f64::from_le_bytes(first(bytes)?),
        })
    }
}

fn first<const N: usize>(bytes: &[u8]) -> Option<[u8; N]> {
    bytes.first_chunk().copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_sign_and_size() {
        let bytes = [0xff; 8];
        for (scalar, value) in [
            (Scalar::I8, -1.0),
            (Scalar::U8, 255.0),
            (Scalar::I16, -1.0),
            (Scalar::U16, 65535.0),
            (Scalar::I32, -1.0),
            (Scalar::U32, 4294967295.0),
        ] {
            assert_eq!(scalar.decode(&bytes), Some(value));
            assert_eq!(scalar.decode(&bytes[..scalar.size() - 1]), None);
        }
        assert_eq!(Scalar::F32.decode(&1.5_f32.to_le_bytes()), Some(1.5));
        assert_eq!(Scalar::F64.decode(&0.1_f64.to_le_bytes()), Some(0.1));
    }
}
