//! LZF compression: literal pieces, and copies of earlier output.

/// Unpacks data to exactly `length` bytes; uses at most some 90 times the memory of `packed`.
pub fn unpack(packed: &[u8], length: usize) -> Result<Vec<u8>, String> {
    let mut data: Vec<u8> = Vec::with_capacity(length.min(packed.len().saturating_mul(4)));
    let mut bytes = packed.iter().copied();
    let cut = || "the compressed points end within a piece".to_owned();
    while let Some(control) = bytes.next() {
        // The upper three bits are the length of a copy minus 2; 7 is continued in the next byte.
        let length_bits = usize::from(control >> 5);
        if length_bits == 0 {
            let before = data.len();
            let literal = usize::from(control) + 1;
            data.extend(bytes.by_ref().take(literal));
            if data.len() < before + literal {
                return Err(cut());
            }
        } else {
            let more = if length_bits == 7 {
                usize::from(bytes.next().ok_or_else(cut)?)
            } else {
                0
            };
            let low = usize::from(bytes.next().ok_or_else(cut)?);
            let back = (usize::from(control & 31) << 8 | low) + 1;
            let start = data.len().checked_sub(back);
            let start =
                start.ok_or_else(|| format!("a copy from {back} bytes back, of {}", data.len()))?;
            // A copy may overlap its own output.
            for at in start..start + length_bits + more + 2 {
                data.extend(data.get(at).copied());
            }
        }
        if data.len() > length {
            return Err(format!(
                "the compressed points are more than {length} bytes"
            ));
        }
    }
    match data.len() == length {
        true => Ok(data),
        false => Err(format!(
            "the compressed points are {} bytes of {length}",
            data.len()
        )),
    }
}
