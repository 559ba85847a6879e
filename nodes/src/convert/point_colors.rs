//! Colours of the points of a cloud.

use lattice_core::cloud::{CloudError, CloudLimits, CloudView, Datatype, PointField};
use lattice_msgs::sensor_msgs::PointCloud2;

use super::cloud::layout_of;

/// Names of fields with packed colours, as PCL writes them.
const PACKED: [&str; 2] = ["rgb", "rgba"];

/// Colour fields of a cloud.
enum ColorFields<'a> {
    /// Blue, green, red and alpha from the lowest byte on, as float32, uint32 or int32.
    Packed(&'a PointField),
    /// A byte each.
    Bytes([&'a PointField; 3]),
}

impl<'a> ColorFields<'a> {
    fn find(fields: &'a [PointField]) -> Option<Self> {
        let of = |name: &str, bytes: u32| {
            let datatype = |f: &PointField| Datatype::from_code(f.datatype).map(Datatype::bytes);
            let fits = |f: &&PointField| f.name == name && datatype(f) == Some(bytes);
            fields.iter().find(fits)
        };
        if let Some(packed) = PACKED.iter().find_map(|name| of(name, 4)) {
            return Some(ColorFields::Packed(packed));
        }
        let [r, g, b] = ["r", "g", "b"].map(|name| of(name, 1));
        Some(ColorFields::Bytes([r?, g?, b?]))
    }

    fn at(&self, view: &CloudView, i: usize) -> Option<[u8; 3]> {
        match self {
            ColorFields::Packed(field) => {
                let [_, r, g, b] = view.packed(field, i)?.to_be_bytes();
                Some([r, g, b])
            }
            // Signed bytes wrap to those that the driver meant.
            ColorFields::Bytes(fields) => {
                Some(fields.map(|field| view.scalar(field, i) as i16 as u8))
            }
        }
    }
}

/// Red, green and blue of each point, NaN points included; `None` if the cloud has no colours.
///
/// Colours are the first present of the fields `rgb`, `rgba` (packed, four bytes), and `r`, `g`, `b` (a byte each).
pub fn colors_from_message(
    cloud: &PointCloud2,
    limits: &CloudLimits,
) -> Result<Option<Vec<Option<[u8; 3]>>>, CloudError> {
    let layout = layout_of(cloud);
    let view = layout.view(&cloud.data, limits)?;
    let fields = ColorFields::find(view.fields());
    Ok(fields.map(|fields| (0..view.len()).map(|i| fields.at(&view, i)).collect()))
}

#[cfg(test)]
mod tests {
    use lattice_msgs::sensor_msgs;
    use lattice_msgs::std_msgs::Header;

    use super::*;
    use crate::convert::cloud::{dense_cloud, field, xyz_fields};

    const LIMITS: CloudLimits = CloudLimits { max_points: 10 };

    fn cloud(fields: &[(&str, u32, u8)], point: &[u8]) -> PointCloud2 {
        let mut all = xyz_fields(sensor_msgs::PointField::FLOAT32, 4);
        all.extend(
            fields
                .iter()
                .map(|(name, at, datatype)| field(name, *at, *datatype)),
        );
        let xyz = [1.0_f32, 2.0, 3.0].map(f32::to_le_bytes).concat();
        let data = [&xyz, point].concat();
        dense_cloud(Header::default(), all, data.len() as u32, 1, data)
    }

    fn colors(cloud: &PointCloud2) -> Option<Vec<Option<[u8; 3]>>> {
        colors_from_message(cloud, &LIMITS).unwrap()
    }

    #[test]
    fn packed_colours_are_read_in_the_order_of_pcl() {
        const BGRA: [u8; 4] = [3, 2, 250, 255];
        let expected = Some(vec![Some([250, 2, 3])]);
        for name in ["rgb", "rgba"] {
            for datatype in [Datatype::Float32, Datatype::Uint32, Datatype::Int32] {
                let cloud = cloud(&[(name, 12, datatype as u8)], &BGRA);
                assert_eq!(colors(&cloud), expected, "{name} {datatype:?}");
            }
        }
        let mut big = cloud(&[("rgb", 12, Datatype::Uint32 as u8)], &[255, 250, 2, 3]);
        big.is_bigendian = true;
        assert_eq!(colors(&big), expected);
    }

    #[test]
    fn single_bytes_are_read_and_other_types_are_no_colours() {
        let bytes = |datatype| {
            [
                ("r", 12, datatype),
                ("g", 13, datatype),
                ("b", 14, datatype),
            ]
        };
        for datatype in [Datatype::Uint8, Datatype::Int8] {
            let cloud = cloud(&bytes(datatype as u8), &[250, 2, 3, 0]);
            assert_eq!(
                colors(&cloud),
                Some(vec![Some([250, 2, 3])]),
                "{datatype:?}"
            );
        }
        let wide = cloud(&[("rgb", 12, Datatype::Float64 as u8)], &[0; 8]);
        assert_eq!(colors(&wide), None);
        assert_eq!(
            colors(&cloud(&[("r", 12, Datatype::Uint8 as u8)], &[1])),
            None
        );
    }
}
