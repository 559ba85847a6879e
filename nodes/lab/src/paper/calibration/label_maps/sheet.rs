//! PNG pictures beside each other in one SVG, with a key below.

use super::picture::SIZE;
use crate::report::escaped;
use base64::prelude::{BASE64_STANDARD, Engine};
use std::fmt::Write;

/// Height of the line above a picture, and of a line of the key, pixels.
const LINE: u32 = 26;
/// Width of an entry of the key, pixels.
const ENTRY: u32 = 120;

/// A colour and what it means.
pub(super) type Entry = ([u8; 3], String);

/// Pictures with their titles, and what their colours mean.
pub(super) fn sheet(pictures: &[(&str, Vec<u8>)], key: &[Entry]) -> String {
    let [width, height] = SIZE;
    let all = width * pictures.len().max(1) as u32;
    let in_line = (all / ENTRY).max(1) as usize;
    let lines = key.len().div_ceil(in_line) as u32;
    let tall = LINE + height + LINE * lines;
    let mut svg = format!(
        "<svg width=\"{all}\" height=\"{tall}\" viewBox=\"0 0 {all} {tall}\" \
         xmlns=\"http://www.w3.org/2000/svg\" font-family=\"sans-serif\" font-size=\"14\">\n"
    );
    // Writing to a string does not fail.
    for (x, (title, png)) in (0..).step_by(width as usize).zip(pictures) {
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"18\" text-anchor=\"middle\">{}</text>\n\
             <image x=\"{x}\" y=\"{LINE}\" width=\"{width}\" height=\"{height}\" \
             href=\"data:image/png;base64,{}\"/>",
            x + width / 2,
            escaped(title),
            BASE64_STANDARD.encode(png)
        );
    }
    for (i, ([r, g, b], meaning)) in key.iter().enumerate() {
        let x = (i % in_line) as u32 * ENTRY + 8;
        let y = LINE + height + (i / in_line) as u32 * LINE + 6;
        let _ = writeln!(
            svg,
            "<rect x=\"{x}\" y=\"{y}\" width=\"14\" height=\"14\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>\
             <text x=\"{}\" y=\"{}\">{}</text>",
            x + 20,
            y + 12,
            escaped(meaning)
        );
    }
    svg.push_str("</svg>\n");
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_is_one_element_with_all_pictures_and_meanings() {
        let key: Vec<Entry> = (0..9).map(|i| ([255, i, 0], format!("<{i}>"))).collect();
        let sheet = sheet(&[("a & b", vec![1, 2]), ("c", vec![3])], &key);
        assert!(sheet.starts_with("<svg ") && sheet.ends_with("</svg>\n"));
        assert_eq!(sheet.matches("<image ").count(), 2);
        assert_eq!(sheet.matches("<rect ").count(), 9);
        assert!(sheet.contains("a &amp; b") && sheet.contains("&lt;8&gt;"));
        assert!(sheet.contains("href=\"data:image/png;base64,AQI=\""));
        // Two pictures are as wide as 7 entries: a second line.
        let tall = SIZE[1] + 3 * LINE;
        let size = format!("<svg width=\"880\" height=\"{tall}\"");
        assert!(sheet.starts_with(&size), "{}", &sheet[..120]);
    }
}
