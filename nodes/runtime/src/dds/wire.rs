//! RTPS messages as bytes: those that RustDDS cannot send, and those it does not show (RTPS 2.5, 8.3 and 9.4).

/// The first twelve bytes of each identity of a participant's endpoints.
pub(super) type Prefix = [u8; 12];

/// Writer of the announcements of a participant.
pub(super) const ENTITY_SPDP_WRITER: [u8; 4] = [0, 1, 0, 0xc2];

/// Protocol 2.4, vendor RustDDS.
const VERSION: [u8; 4] = [2, 4, 1, 0x12];

const PID_SENTINEL: u16 = 1;

/// A message in the making.
pub(super) struct Message {
    pub bytes: Vec<u8>,
}

impl Message {
    /// One of a participant, without submessages.
    pub(super) fn of(sender: &Prefix) -> Self {
        let bytes = [b"RTPS".as_slice(), &VERSION, sender].concat();
        Self { bytes }
    }

    /// Appends a submessage in little endian; `body` has less than 64 kB.
    pub(super) fn push(&mut self, kind: u8, flags: u8, body: &[u8]) {
        let length = u16::try_from(body.len()).unwrap_or(0);
        self.bytes.extend([kind, flags]);
        self.bytes.extend(length.to_le_bytes());
        self.bytes.extend(body);
    }
}

/// Appends a parameter in little endian; the length of its value is a multiple of four.
pub(super) fn put_parameter(list: &mut Vec<u8>, id: u16, value: &[u8]) {
    let length = u16::try_from(value.len()).unwrap_or(0);
    list.extend(id.to_le_bytes());
    list.extend(length.to_le_bytes());
    list.extend(value);
}

/// Appends the parameter that ends a list.
pub(super) fn put_end(list: &mut Vec<u8>) {
    put_parameter(list, PID_SENTINEL, &[]);
}

/// Sender of a datagram. None: it is no RTPS message.
pub(super) fn sender(datagram: &[u8]) -> Option<Prefix> {
    let header = datagram.strip_prefix(b"RTPS")?;
    header.get(4..16)?.try_into().ok()
}

/// Submessages (kind, flags, body) of a datagram.
pub(super) fn submessages(datagram: &[u8]) -> impl Iterator<Item = (u8, u8, &[u8])> {
    let mut rest = datagram.get(20..).unwrap_or_default();
    std::iter::from_fn(move || {
        let [kind, flags, first, second, body @ ..] = rest else {
            return None;
        };
        let length = number(*first, *second, flags & 1 == 1);
        // The last one of a message may say 0 and reach to its end.
        let length = match length {
            0 => body.len(),
            length => usize::from(length),
        };
        let (body, after) = body.split_at_checked(length)?;
        rest = after;
        Some((*kind, *flags, body))
    })
}

/// Parameters (identity, value) of a list, up to its end.
pub(super) fn parameters(list: &[u8], is_little: bool) -> Parameters<'_> {
    Parameters {
        rest: list,
        is_little,
    }
}

/// See [`parameters`].
pub(super) struct Parameters<'a> {
    rest: &'a [u8],
    is_little: bool,
}

impl<'a> Parameters<'a> {
    /// Bytes behind the parameters taken.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.rest
    }
}

impl<'a> Iterator for Parameters<'a> {
    type Item = (u16, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let [first, second, third, fourth, rest @ ..] = self.rest else {
            return None;
        };
        let id = number(*first, *second, self.is_little);
        let length = number(*third, *fourth, self.is_little);
        let (value, after) = match id {
            PID_SENTINEL => (&[][..], rest),
            _ => rest.split_at_checked(length.into())?,
        };
        self.rest = after;
        (id != PID_SENTINEL).then_some((id, value))
    }
}

fn number(first: u8, second: u8, is_little: bool) -> u16 {
    match is_little {
        true => u16::from_le_bytes([first, second]),
        false => u16::from_be_bytes([first, second]),
    }
}
