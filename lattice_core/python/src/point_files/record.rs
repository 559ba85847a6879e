//! Rows of numbers, as text or binary.

use super::PointFile;

/// Type of a number.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    pub fn bytes(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::I64 | Number::U64 | Number::F64 => 8,
        }
    }

    /// Number in little-endian bytes; NaN if there are too few.
    fn read(self, mut bytes: [u8; 8], big: bool) -> f64 {
        if big {
            bytes.get_mut(..self.bytes()).unwrap_or_default().reverse();
        }
        let [a, b, c, d, ..] = bytes;
        match self {
            Number::I8 => f64::from(a as i8),
            Number::U8 => f64::from(a),
            Number::I16 => f64::from(i16::from_le_bytes([a, b])),
            Number::U16 => f64::from(u16::from_le_bytes([a, b])),
            Number::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Number::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Number::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Number::I64 => i64::from_le_bytes(bytes) as f64,
            Number::U64 => u64::from_le_bytes(bytes) as f64,
            Number::F64 => f64::from_le_bytes(bytes),
        }
    }
}

/// Named field of numbers of one type in a row.
pub struct Field {
    pub name: String,
    pub number: Number,
    pub count: usize,
}

/// Fields of a row in order.
pub struct Layout {
    pub fields: Vec<Field>,
    pub rows: usize,
}

/// Position of a number in a row.
#[derive(Clone, Copy)]
struct Place {
    /// Offset, bytes.
    byte: usize,
    /// Index among the numbers.
    token: usize,
    number: Number,
}

/// Byte order of rows, or column order.
#[derive(Clone, Copy)]
pub enum Order {
    /// Rows, little endian.
    Little,
    /// Rows, big endian.
    Big,
    /// Columns, little endian.
    Columns,
}

impl Layout {
    fn place(&self, name: &str) -> Result<Option<Place>, String> {
        let (mut byte, mut token, mut found) = (0_usize, 0_usize, None);
        for field in &self.fields {
            if field.name == name {
                if found.is_some() {
                    return Err(format!("two fields are named {name}"));
                }
                if field.count != 1 {
                    return Err(format!("field {name} has {} numbers, not one", field.count));
                }
                let number = field.number;
                found = Some(Place {
                    byte,
                    token,
                    number,
                });
            }
            byte = byte.saturating_add(field.count.saturating_mul(field.number.bytes()));
            token = token.saturating_add(field.count);
        }
        Ok(found)
    }

    /// Positions of x, y, z, and of the label if present.
    fn places(&self) -> Result<([Place; 3], Option<Place>), String> {
        let need = |name: &str| -> Result<Place, String> {
            self.place(name)?.ok_or_else(|| {
                let names: Vec<_> = self.fields.iter().map(|field| &field.name).collect();
                format!("there is no field {name} among {names:?}")
            })
        };
        Ok(([need("x")?, need("y")?, need("z")?], self.place("label")?))
    }

    fn row_bytes(&self) -> usize {
        let bytes = |field: &Field| field.count.saturating_mul(field.number.bytes());
        self.fields.iter().map(bytes).fold(0, usize::saturating_add)
    }

    /// Size of all rows, bytes.
    pub fn bytes(&self) -> usize {
        self.row_bytes().saturating_mul(self.rows)
    }

    fn row_tokens(&self) -> usize {
        let counts = self.fields.iter().map(|field| field.count);
        counts.fold(0, usize::saturating_add)
    }

    /// Reads the points of binary rows.
    pub fn read_binary(&self, data: &[u8], order: Order) -> Result<PointFile, String> {
        let (axes, label) = self.places()?;
        if data.len() < self.bytes() {
            let (rows, have, need) = (self.rows, data.len(), self.bytes());
            return Err(format!(
                "{rows} points take {need} bytes, the file has {have}"
            ));
        }
        let stride = self.row_bytes();
        let value = |place: Place, row: usize| {
            let size = place.number.bytes();
            let start = match order {
                Order::Columns => place.byte * self.rows + size * row,
                _ => stride * row + place.byte,
            };
            let mut bytes = [0; 8];
            let from = data.get(start..start + size).unwrap_or_default();
            bytes
                .iter_mut()
                .zip(from)
                .for_each(|(to, from)| *to = *from);
            place.number.read(bytes, matches!(order, Order::Big))
        };
        let mut file = PointFile::new(label.is_some());
        for row in 0..self.rows {
            let class = label.map(|label| value(label, row));
            file.push(axes.map(|axis| value(axis, row)), class, row)?;
        }
        Ok(file)
    }

    /// Reads the points of text rows after `skipped` other lines.
    pub fn read_text(&self, data: &[u8], skipped: usize) -> Result<PointFile, String> {
        let (axes, label) = self.places()?;
        let text = std::str::from_utf8(data).map_err(|_| "the points are no text".to_owned())?;
        let lines = text.lines().filter(|line| !line.trim().is_empty());
        let mut lines = lines.skip(skipped);
        let mut file = PointFile::new(label.is_some());
        let mut numbers = Vec::new();
        for row in 0..self.rows {
            let Some(line) = lines.next() else {
                return Err(format!("the file has {row} points of {}", self.rows));
            };
            numbers.clear();
            for token in line.split_ascii_whitespace() {
                let number: f64 = token
                    .parse()
                    .map_err(|_| format!("row {row}: {token:?} is no number"))?;
                numbers.push(number);
            }
            let (have, need) = (numbers.len(), self.row_tokens());
            if have != need {
                return Err(format!("row {row} has {have} numbers, not {need}"));
            }
            let value = |place: Place| numbers.get(place.token).copied().unwrap_or(f64::NAN);
            file.push(axes.map(value), label.map(value), row)?;
        }
        Ok(file)
    }
}
