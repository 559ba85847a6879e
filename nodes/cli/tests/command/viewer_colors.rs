//! The page shows the mean colours of a map's cells.

use std::fs::File;

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::file::write_map;
use lattice_core::voxels::{Payload, PointColumns, VoxelList};
use nalgebra::Vector3;
use serde_json::json;

use crate::browser::chromium;
use crate::browser::devtools::Page;
use crate::viewer::{COMPLETE, Viewer};

const CHOOSE: &str = "(() => { const colour = document.getElementById('colour'); colour.value = 'colour'; \
    colour.dispatchEvent(new Event('change')); lattice.frame(); })()";
const LEGEND: &str = "document.getElementById('legend').textContent";
/// True for red, green, blue and grey if the picture has cells of that colour, left of the axes.
const SEEN: &str = "(() => { const canvas = lattice.picture(); const { width, height } = canvas; \
    const pixels = canvas.getContext('2d').getImageData(0, 0, width, height).data; const found = [0, 0, 0]; \
    for (let y = 220; y < height - 180; y++) for (let x = 0; x < width - 180; x++) { \
      const of = pixels.slice(4 * (y * width + x), 4 * (y * width + x) + 3); \
      for (let k = 0; k < 3; k++) if (of[k] > 60 && of[(k + 1) % 3] < of[k] / 3 && of[(k + 2) % 3] < of[k] / 3) found[k]++; } \
    return found.map((pixels) => pixels > 20); })()";

/// A map file of a wall of cells whose rows are red, green, blue and without a colour.
fn file(path: &std::path::Path, with_colors: bool) {
    let lattice = Lattice::new(LatticeKind::Fcc, 0.125).unwrap();
    let list = VoxelList::new(lattice, Vector3::zeros(), 10_000).unwrap();
    let mut list = list.with_payload(Payload {
        color: with_colors,
        ..Payload::default()
    });
    let rows = [
        Some([230, 20, 20]),
        Some([10, 200, 30]),
        Some([10, 20, 220]),
        None,
    ];
    let cells = (0..12_u8).flat_map(|z| (0..20_u8).map(move |x| (x, z)));
    let points: Vec<_> = cells
        .clone()
        .map(|(x, z)| [f64::from(x), 0.0, f64::from(z)].map(|m| 0.5 * m))
        .collect();
    let colors: Vec<_> = cells.map(|(_, z)| rows[usize::from(z / 3)]).collect();
    let columns = PointColumns {
        colors: &colors,
        ..PointColumns::default()
    };
    list.insert_points(Vector3::zeros(), &points, columns);
    write_map(&list, File::create(path).unwrap()).unwrap();
}

#[test]
fn cells_have_their_mean_colours() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.lattice");
    for (with_colors, note) in [
        (true, "Cells without a colour are grey."),
        (false, "The cells of this map have no colours"),
    ] {
        file(&path, with_colors);
        let map = path.display().to_string();
        let viewer = Viewer::start(&["view", &map, "--port", "0"]);
        let mut page = Page::open(&chromium, &viewer.url);
        page.wait_for(COMPLETE);
        page.value("document.querySelector('[data-camera=side]').click(); lattice.frame()");
        assert_eq!(page.value(SEEN), json!([false, false, false]));
        page.value(CHOOSE);
        page.wait_for(&format!("{LEGEND}.includes('{note}')"));
        assert_eq!(
            page.value(SEEN),
            json!([with_colors, with_colors, with_colors])
        );
        assert!(page.console.is_empty(), "{:?}", page.console);
    }
}
