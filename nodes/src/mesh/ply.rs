//! Meshes from PLY files: the elements `vertex` and `face`.

use super::labelled::Parts;
use super::{LabelledMesh, MeshError};
use crate::files::points::PointFileError;
use crate::files::points::ply::header::{Element, Header, Property};
use crate::files::points::ply::{axes, number, record};
use crate::files::points::source::Source;
use lattice_core::registration::UNLABELED;

/// Limit of corners per polygon.
const MAX_CORNERS: usize = 1024;
/// Limit of memory reserved from the counts of a header.
const TRUSTED: u64 = 1 << 16;

/// Property indices of a face.
struct FaceColumns {
    corners: usize,
    label: Option<usize>,
    instance: Option<usize>,
}

/// Values of one record.
#[derive(Default)]
struct Face {
    corners: Vec<f64>,
    /// Number of corners, including those beyond [`MAX_CORNERS`].
    found: usize,
    label: f64,
    instance: f64,
}

/// Reads vertices with `x`, `y`, `z` (metres), and faces with a list `vertex_indices` or `vertex_index` and optional
/// `label` and `instance`. Polygons become triangle fans. Without labels all are [`UNLABELED`], without
/// instances each label is one instance.
pub(super) fn read(source: &mut Source, max_triangles: usize) -> Result<LabelledMesh, MeshError> {
    let header = Header::read(source)?;
    let mut parts = Parts::default();
    for name in ["vertex", "face"] {
        if !header.elements.iter().any(|element| element.name == name) {
            return Err(line(&header, format!("the header has no element {name}")).into());
        }
    }
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => read_vertices(source, &header, element, max_triangles, &mut parts)?,
            "face" => read_faces(source, &header, element, max_triangles, &mut parts)?,
            _ => record::skip(source, &header, element)?,
        }
    }
    let mesh = parts.mesh();
    mesh.map_err(|error| MeshError::NoMesh(Box::new(error)))
}

fn line(header: &Header, reason: String) -> PointFileError {
    PointFileError::Line {
        format: header.format,
        line: header.lines,
        reason,
    }
}

fn read_vertices(
    source: &mut Source,
    header: &Header,
    element: &Element,
    max_vertices: usize,
    parts: &mut Parts,
) -> Result<(), PointFileError> {
    let axes = axes(element).map_err(|reason| line(header, reason))?;
    let max_points = max_vertices;
    if element.count > max_points as u64 {
        let points = element.count;
        return Err(PointFileError::TooManyPoints { points, max_points });
    }
    parts
        .vertices_m
        .reserve(element.count.min(TRUSTED) as usize);
    for vertex in 1..=element.count {
        let part = format_args!("vertex {vertex} of {}", element.count);
        let mut point_m = [f32::NAN; 3];
        record::read(source, header, element, part, |property, value| {
            for (coordinate, axis) in point_m.iter_mut().zip(axes) {
                if axis == property {
                    *coordinate = value as f32;
                }
            }
        })?;
        parts.vertices_m.push(point_m);
    }
    Ok(())
}

fn read_faces(
    source: &mut Source,
    header: &Header,
    element: &Element,
    max_triangles: usize,
    parts: &mut Parts,
) -> Result<(), MeshError> {
    let columns = face_columns(element).map_err(|reason| line(header, reason))?;
    let max = max_triangles;
    let too_many = |triangles: u64| MeshError::FileTooLarge { triangles, max };
    if element.count > max_triangles as u64 {
        return Err(too_many(element.count));
    }
    parts.triangles.reserve(element.count.min(TRUSTED) as usize);
    let mut face = Face::default();
    for number in 1..=element.count {
        let part = format_args!("face {number} of {}", element.count);
        (face.found, face.label, face.instance) = (0, f64::from(UNLABELED), f64::NAN);
        face.corners.clear();
        let list = Some(columns.corners);
        record::read_with_list(source, header, element, list, part, |property, value| {
            if property == columns.corners {
                face.found += 1;
                if face.corners.len() < MAX_CORNERS {
                    face.corners.push(value);
                }
            } else if Some(property) == columns.label {
                face.label = value;
            } else if Some(property) == columns.instance {
                face.instance = value;
            }
        })?;
        if columns.instance.is_none() {
            face.instance = face.label;
        }
        let pushed = push(&face, parts);
        pushed.map_err(|reason| PointFileError::Data {
            format: header.format,
            byte: source.byte(),
            reason: format!("{reason}, in {part}"),
        })?;
        if parts.triangles.len() > max_triangles {
            return Err(too_many(parts.triangles.len() as u64));
        }
    }
    Ok(())
}

/// Adds the triangle fan of a polygon.
fn push(face: &Face, parts: &mut Parts) -> Result<(), String> {
    if !(3..=MAX_CORNERS).contains(&face.found) {
        let found = face.found;
        return Err(format!(
            "a polygon of {found} corners is outside 3..={MAX_CORNERS}"
        ));
    }
    let label = whole(face.label, f64::from(u16::MAX), "label")? as u16;
    let instance = whole(face.instance, f64::from(u16::MAX), "instance")? as u16;
    let vertex = |value: &f64| whole(*value, f64::from(u32::MAX), "vertex").map(|v| v as u32);
    let corners = face.corners.iter().map(vertex);
    let corners: Vec<u32> = corners.collect::<Result<_, _>>()?;
    let Some((first, others)) = corners.split_first() else {
        return Ok(());
    };
    for pair in others.windows(2) {
        parts.triangles.push([*first, pair[0], pair[1]]);
        parts.labels.push(label);
        parts.instances.push(instance);
    }
    Ok(())
}

/// Checks an integer in 0..=`most`.
fn whole(value: f64, most: f64, what: &str) -> Result<f64, String> {
    if value.fract() == 0.0 && (0.0..=most).contains(&value) {
        return Ok(value);
    }
    Err(format!("{what} {value} is not an integer in 0..={most}"))
}

fn face_columns(face: &Element) -> Result<FaceColumns, String> {
    let list = |p: &Property| matches!(p, Property::List { name, .. } if name == "vertex_indices" || name == "vertex_index");
    let corners = face.properties.iter().position(list);
    Ok(FaceColumns {
        corners: corners.ok_or("element face has no list named vertex_indices")?,
        label: number(face, "label"),
        instance: number(face, "instance"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(bytes: impl Into<Vec<u8>>) -> Result<LabelledMesh, String> {
        let mut source = Source::new(Box::new(std::io::Cursor::new(bytes.into())));
        read(&mut source, 100).map_err(|error| error.to_string())
    }

    const VERTICES: &str =
        "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
    const FACES: &str = "element face 2\nproperty list uchar int vertex_indices\n";

    fn text(face_properties: &str, faces: &str) -> Result<LabelledMesh, String> {
        let corners = "0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n";
        mesh(format!(
            "ply\nformat ascii 1.0\n{VERTICES}{FACES}{face_properties}end_header\n{corners}{faces}"
        ))
    }

    #[test]
    fn text_and_binary_give_the_same_mesh_and_polygons_become_fans() {
        let properties = "property uchar label\nproperty ushort instance\n";
        let expected = text(properties, "3 0 1 2 7 300\n4 0 1 2 3 9 301\n").unwrap();
        assert_eq!(expected.triangles(), [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
        assert_eq!(expected.labels(), [7, 9, 9]);
        assert_eq!(expected.instances(), [300, 301, 301]);
        assert_eq!(expected.vertices_m()[3], [0.0, 1.0, 0.5]);

        let head = format!(
            "ply\nformat binary_little_endian 1.0\n{VERTICES}{FACES}{properties}end_header\n"
        );
        let mut bytes = head.into_bytes();
        for c in expected.vertices_m().iter().flatten() {
            bytes.extend(c.to_le_bytes());
        }
        for (corners, label, instance) in [(3, 7, 300_u16), (4, 9, 301)] {
            bytes.push(corners as u8);
            (0..corners).for_each(|c: i32| bytes.extend(c.to_le_bytes()));
            bytes.push(label);
            bytes.extend(instance.to_le_bytes());
        }
        assert_eq!(mesh(bytes.clone()), Ok(expected));
        for cut in [bytes.len() - 1, bytes.len() - 9] {
            let fault = mesh(&bytes[..cut]).unwrap_err();
            assert!(fault.contains("face 2 of 2"), "{fault}");
        }
    }

    #[test]
    fn without_instances_each_label_is_one_and_labels_may_be_missing() {
        let labelled = text("property int label\n", "3 0 1 2 7\n3 0 2 3 9\n").unwrap();
        assert_eq!(labelled.instances(), [7, 9]);
        let plain = text("", "3 0 1 2\n3 0 2 3\n").unwrap();
        assert_eq!(plain.labels(), [UNLABELED; 2]);
    }

    #[test]
    fn what_is_no_mesh_is_refused_with_the_place() {
        let faults = "\
            : 3 0 1 4; 3 0 1 2: triangle 0 refers to vertex 4, outside 0..4
            : 3 0 1 2; 2 0 1: a polygon of 2 corners is outside 3..=1024, in face 2 of 2
            : 3 0 1 -1; 3 0 1 2: vertex -1 is not an integer
            : 3 0 1 2; 3 0 1 x: vertex NaN is not an integer
            property float label: 3 0 1 2 0.5; 3 0 1 2 1: label 0.5 is not an integer
            property int label: 3 0 1 2 65536; 3 0 1 2 1: label 65536 is not an integer
            property int instance: 3 0 1 2 -3; 3 0 1 2 1: instance -3 is not an integer";
        for row in faults.lines() {
            let [properties, faces, message] = [0, 1, 2].map(|i| row.split(": ").nth(i).unwrap());
            let properties = format!("{}\n", properties.trim()).trim_start().to_owned();
            let faces = format!("{}\n", faces.replace("; ", "\n"));
            let fault = text(&properties, &faces).unwrap_err();
            assert!(fault.contains(message), "{fault}");
        }
        let of = |elements: String| mesh(format!("ply\nformat ascii 1.0\n{elements}end_header\n"));
        let none = VERTICES.replace(" 4", " 0");
        let many = VERTICES.replace(" 4", " 99999999999");
        for (elements, message) in [
            (VERTICES.to_owned(), "the header has no element face"),
            (many.clone(), "the header has no element face"),
            (
                none.clone() + &FACES.replace("vertex_indices", "corners"),
                "no list named vertex_indices",
            ),
            (many + FACES, "99999999999 points or more, but at most 100"),
            (
                none + &FACES.replace(" 2", " 101"),
                "101 triangles or more, more than 100",
            ),
        ] {
            let fault = of(elements).unwrap_err();
            assert!(fault.contains(message), "{fault}");
        }
    }
}
