//! Pictures of small maps.

use super::*;
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use nalgebra::Vector3;

fn list(kind: LatticeKind, centers_m: &[[f64; 3]]) -> VoxelList {
    let lattice = Lattice::new(kind, 1.0).unwrap();
    let mut list = VoxelList::new(lattice, Vector3::new(5e6, 4e6, 300.0), 1000).unwrap();
    let points: Vec<_> = centers_m
        .iter()
        .map(|&p| list.datum_m() + Vector3::from(p))
        .collect();
    list.insert(&Cloud::from_points(0, list.datum_m(), &points));
    list
}

const BACKGROUND: [u8; 4] = [255; 4];

fn options() -> RenderOptions {
    RenderOptions {
        width: 64,
        height: 48,
        ..RenderOptions::default()
    }
}

/// RGBA rows.
fn render(list: &VoxelList, options: &RenderOptions) -> Vec<Vec<[u8; 4]>> {
    let mut bytes = Vec::new();
    render_png(list, options, &mut bytes).unwrap();
    decoded(bytes, options)
}

fn decoded(bytes: Vec<u8>, options: &RenderOptions) -> Vec<Vec<[u8; 4]>> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
        .read_info()
        .unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height), (options.width, options.height));
    pixels
        .chunks(4 * options.width as usize)
        .map(|row| row.chunks(4).map(|p| p.try_into().unwrap()).collect())
        .collect()
}

#[test]
fn a_cell_of_any_kind_fills_the_middle_and_the_background_the_corners() {
    for kind in LatticeKind::ALL {
        for (azimuth_deg, elevation_deg) in
            [(0.0, 90.0), (123.0, 35.0), (-700.0, -90.0), (10.0, 0.0)]
        {
            let options = RenderOptions {
                azimuth_deg,
                elevation_deg,
                ..options()
            };
            let picture = render(&list(kind, &[[0.0; 3]]), &options);
            assert_ne!(picture[24][32], BACKGROUND, "{kind}");
            for (row, column) in [(0, 0), (0, 63), (47, 0), (47, 63)] {
                assert_eq!(picture[row][column], BACKGROUND, "{kind}");
            }
            // No hole between the faces.
            for row in &picture {
                let map: Vec<usize> = (0..64).filter(|&x| row[x] != BACKGROUND).collect();
                assert!(map.windows(2).all(|w| w[1] == w[0] + 1), "{kind}");
            }
        }
    }
}

#[test]
fn the_camera_stands_where_the_azimuth_says() {
    // A tall tower in the east, a low one in the west.
    let mut cells: Vec<[f64; 3]> = (0..6).map(|z| [8.0, 0.0, f64::from(z)]).collect();
    cells.push([-8.0, 0.0, 0.0]);
    let list = list(LatticeKind::Cubic, &cells);
    let tall_is_right = |azimuth_deg| {
        let picture = render(
            &list,
            &RenderOptions {
                azimuth_deg,
                elevation_deg: 10.0,
                ..options()
            },
        );
        let count = |columns: std::ops::Range<usize>| {
            let row = |row: &Vec<[u8; 4]>| {
                row[columns.clone()]
                    .iter()
                    .filter(|&&p| p != BACKGROUND)
                    .count()
            };
            picture.iter().map(row).sum::<usize>()
        };
        count(32..64) > 2 * count(0..32)
    };
    assert!(tall_is_right(180.0));
    assert!(!tall_is_right(0.0));
}

#[test]
fn the_near_cell_hides_the_far_one() {
    let low = list(LatticeKind::Cubic, &[[0.0; 3]]);
    let both = list(LatticeKind::Cubic, &[[0.0; 3], [0.0, 0.0, 9.0]]);
    let above = RenderOptions {
        elevation_deg: 90.0,
        ..options()
    };
    let (low, both) = (render(&low, &above)[24][32], render(&both, &above)[24][32]);
    // Alone a cell has the colour of the middle, over another one that of the top.
    assert!(both[0] > low[0], "{low:?} {both:?}");
}

#[test]
fn a_tower_throws_its_shadow_away_from_the_sun() {
    let ground = (0..121).map(|i| [f64::from(i % 11 - 5), f64::from(i / 11 - 5), 0.0]);
    let tower = (1..4).map(|z| [0.0, 0.0, f64::from(z)]);
    let cells: Vec<_> = ground.chain(tower).collect();
    // From above, north is up; the sun is in the west-south-west.
    let options = RenderOptions {
        width: 110,
        height: 110,
        azimuth_deg: 180.0,
        elevation_deg: 90.0,
        ..options()
    };
    let picture = render(&list(LatticeKind::Cubic, &cells), &options);
    let brightness = |[r, g, b, _]: [u8; 4]| u32::from(r) + u32::from(g) + u32::from(b);
    let shaded = brightness(picture[49][67]);
    let lit = brightness(picture[61][43]);
    assert!(4 * shaded < 3 * lit, "{shaded} {lit}");
    let flat = RenderOptions {
        contrast: 0.0,
        ..options
    };
    let flat = render(&list(LatticeKind::Cubic, &cells), &flat);
    assert_eq!(flat[49][67], flat[61][43]);
}

#[test]
fn labels_have_their_colours_and_cells_without_are_grey() {
    let places = [[-3.0, 0.0, 0.0], [0.0; 3], [3.0, 0.0, 0.0]];
    let lattice = Lattice::new(LatticeKind::Cubic, 1.0).unwrap();
    let list = VoxelList::new(lattice, Vector3::zeros(), 1000).unwrap();
    let mut list = list.with_payload(lattice_core::voxels::Payload {
        labels: true,
        ..Default::default()
    });
    let points: Vec<_> = places.iter().map(|&p| Vector3::from(p)).collect();
    let cloud = Cloud::from_points(0, Vector3::zeros(), &points);
    list.insert_labelled(&cloud, &[7, 500, 3]);
    let colors = LabelColors::from([(3, [0, 0, 255]), (7, [255, 0, 0])]);
    let options = RenderOptions {
        azimuth_deg: 180.0,
        elevation_deg: 90.0,
        ..options()
    };
    let mut bytes = Vec::new();
    render_labels_png(&list, &colors, &options, &mut bytes).unwrap();
    let row = decoded(bytes, &options).swap_remove(24);
    // 7 cells fill 64 pixels but for a small margin.
    let [red, grey, blue] = [7, 32, 57].map(|x| row[x].map(i32::from));
    assert!(red[0] > 100 && red[2] == 0, "{red:?}");
    assert!(blue[2] > 100 && blue[0] == 0, "{blue:?}");
    let [r, g, b, _] = grey;
    assert!(
        r > 60 && (r - g).abs() < 20 && (g - b).abs() < 20,
        "{grey:?}"
    );
}

#[test]
fn a_focus_does_not_depend_on_what_else_there_is() {
    let focused = |places: &[[f64; 3]]| {
        let datum_m = list(LatticeKind::Cubic, &[]).datum_m();
        let focus = Focus {
            center_m: datum_m.into(),
            width_m: 8.0,
        };
        let options = RenderOptions {
            azimuth_deg: 180.0,
            elevation_deg: 90.0,
            focus: Some(focus),
            ..options()
        };
        render(&list(LatticeKind::Cubic, places), &options)
    };
    let (one, two) = (
        focused(&[[0.0; 3]]),
        focused(&[[0.0; 3], [90.0, 9.0, -9.0]]),
    );
    // One cell is an eighth of the width, with the farther one too.
    let wide = |picture: &[Vec<[u8; 4]>]| {
        let row = picture[24].iter();
        row.filter(|&&p| p != BACKGROUND).count()
    };
    assert_eq!((wide(&one), wide(&two)), (8, 8));
}

#[test]
fn an_empty_map_is_background() {
    let empty = render(&list(LatticeKind::Bcc, &[]), &options());
    assert!(empty.iter().flatten().all(|p| *p == BACKGROUND));
}

#[test]
fn impossible_pictures_are_refused() {
    let list = list(LatticeKind::Bcc, &[[0.0; 3]]);
    let refused = |options: RenderOptions| render_png(&list, &options, Vec::new()).unwrap_err();
    for (width, height) in [(0, 5), (5, 0), (u32::MAX, 1), (16_384, 16_384)] {
        let error = refused(RenderOptions {
            width,
            height,
            ..options()
        });
        assert!(error.to_string().contains("pixels"), "{error}");
    }
    for (azimuth_deg, elevation_deg) in [(f64::NAN, 0.0), (0.0, 91.0)] {
        let error = refused(RenderOptions {
            azimuth_deg,
            elevation_deg,
            ..options()
        });
        assert!(error.to_string().contains("azimuth"), "{error}");
    }
    for (x, width_m) in [(f64::NAN, 1.0), (0.0, 0.0), (0.0, f64::INFINITY)] {
        let center_m = [x, 0.0, 0.0];
        let error = refused(RenderOptions {
            focus: Some(Focus { center_m, width_m }),
            ..options()
        });
        assert!(error.to_string().contains("m wide"), "{error}");
    }
}
