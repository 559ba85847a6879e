//! PCD 0.7: a header of fields, and the points as text, binary, or compressed by LZF.

use super::record::{Field, Layout, Number, Order};
use super::{PointFile, header_of, lzf};

/// Reads the points of a file; the viewpoint is not applied.
pub fn read(bytes: &[u8]) -> Result<PointFile, String> {
    let (lines, data) = header_of(bytes, |line| line.starts_with("DATA"))?;
    let words_of = |name: &str| -> Option<Vec<&str>> {
        lines.iter().find_map(|line| {
            let mut words = line.split_ascii_whitespace();
            (words.next() == Some(name)).then(|| words.collect())
        })
    };
    let need = |name: &str| words_of(name).ok_or_else(|| format!("the header has no {name}"));
    let names = need("FIELDS")?;
    let ones = vec!["1"; names.len()];
    let (sizes, types) = (need("SIZE")?, need("TYPE")?);
    let counts = words_of("COUNT").unwrap_or(ones);
    let equal = [sizes.len(), types.len(), counts.len()].map(|len| len == names.len());
    if equal.contains(&false) {
        let [sizes, types, counts] = [sizes.len(), types.len(), counts.len()];
        let names = names.len();
        return Err(format!(
            "{names} FIELDS have {sizes} SIZE, {types} TYPE and {counts} COUNT"
        ));
    }
    let number = |name: &str| -> Result<usize, String> {
        let words = need(name)?;
        let value = words.first().and_then(|word| word.parse().ok());
        value.ok_or_else(|| format!("{name} {words:?} is no number"))
    };
    let mut fields = Vec::new();
    for (((name, size), kind), count) in names.iter().zip(&sizes).zip(&types).zip(&counts) {
        fields.push(Field {
            name: (*name).to_owned(),
            number: number_of(kind, size)
                .ok_or_else(|| format!("field {name} is of TYPE {kind} and SIZE {size}"))?,
            count: count
                .parse()
                .map_err(|_| format!("field {name} has COUNT {count}"))?,
        });
    }
    let grid = number("WIDTH")?.checked_mul(number("HEIGHT")?);
    let rows = match words_of("POINTS") {
        Some(_) => number("POINTS")?,
        None => grid.unwrap_or(usize::MAX),
    };
    if grid != Some(rows) {
        return Err(format!(
            "POINTS is {rows}, WIDTH times HEIGHT {}",
            grid.unwrap_or(usize::MAX)
        ));
    }
    let layout = Layout { fields, rows };
    let kind = need("DATA")?;
    let mut file = match kind.as_slice() {
        ["ascii"] => layout.read_text(data, 0)?,
        ["binary"] => layout.read_binary(data, Order::Little)?,
        ["binary_compressed"] => layout.read_binary(&unpacked(data, &layout)?, Order::Columns)?,
        _ => return Err(format!("DATA {kind:?} is none of PCD")),
    };
    if let Some(view) = words_of("VIEWPOINT")
        && view != ["0", "0", "0", "1", "0", "0", "0"]
        && view
            .iter()
            .map(|w| w.parse().ok())
            .ne([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0].map(Some))
    {
        file.warning = Some(format!(
            "VIEWPOINT {} (x y z, qw qx qy qz of the sensor) is not applied",
            view.join(" ")
        ));
    }
    Ok(file)
}

fn unpacked(data: &[u8], layout: &Layout) -> Result<Vec<u8>, String> {
    let size = |at: usize| {
        let bytes = data.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
        bytes
            .map(u32::from_le_bytes)
            .ok_or("the compressed points are cut off")
    };
    let (packed, length) = (size(0)? as usize, size(4)? as usize);
    if length != layout.bytes() {
        let (rows, need) = (layout.rows, layout.bytes());
        return Err(format!(
            "{rows} points take {need} bytes, the compressed ones {length}"
        ));
    }
    let packed = data.get(8..).and_then(|data| data.get(..packed));
    lzf::unpack(packed.ok_or("the compressed points are cut off")?, length)
}

/// Header of points and labels.
pub fn header(points: usize, single: bool, labels: bool) -> String {
    let size = if single { 4 } else { 8 };
    let label = |text: &'static str| if labels { text } else { "" };
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z{}\nSIZE {size} {size} {size}{}\n\
         TYPE F F F{}\nCOUNT 1 1 1{}\nWIDTH {points}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA binary\n",
        label(" label"),
        label(" 2"),
        label(" U"),
        label(" 1"),
    )
}

fn number_of(kind: &str, size: &str) -> Option<Number> {
    Some(match (kind, size) {
        ("I", "1") => Number::I8,
        ("U", "1") => Number::U8,
        ("I", "2") => Number::I16,
        ("U", "2") => Number::U16,
        ("I", "4") => Number::I32,
        ("U", "4") => Number::U32,
        ("I", "8") => Number::I64,
        ("U", "8") => Number::U64,
        ("F", "4") => Number::F32,
        ("F", "8") => Number::F64,
        _ => return None,
    })
}
