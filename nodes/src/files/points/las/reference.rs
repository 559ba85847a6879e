//! Coordinate reference system of a LAS file, checked for units other than metres.

/// Record ids of `LASF_Projection`.
const WKT: u16 = 2112;
const GEO_KEYS: u16 = 34735;

/// GeoTIFF keys and values.
const MODEL_TYPE: u16 = 1024;
const GEOGRAPHIC: u16 = 2;
const LINEAR_UNIT: u16 = 3076;
const VERTICAL_UNIT: u16 = 4099;
const METRE: u16 = 9001;
/// GeoTIFF linear units, from 9001 on; 0 is undefined, 32767 user-defined.
const UNITS: std::ops::Range<u16> = 9001..9100;

/// Rejects a system whose coordinates are degrees or another unit than metres.
pub(super) fn check(record: u16, data: &[u8]) -> Result<(), String> {
    match record {
        GEO_KEYS => check_keys(data),
        WKT => check_text(&String::from_utf8_lossy(data)),
        _ => Ok(()),
    }
}

/// Checks keys of four numbers: key, location of its value (0: inline), count, value. The first four are a header.
fn check_keys(data: &[u8]) -> Result<(), String> {
    let (numbers, _) = data.as_chunks::<2>();
    let numbers: Vec<u16> = numbers.iter().map(|b| u16::from_le_bytes(*b)).collect();
    let (keys, _) = numbers.as_chunks::<4>();
    for key in keys.iter().skip(1) {
        match *key {
            [MODEL_TYPE, 0, _, GEOGRAPHIC] => return Err(refusal("degrees")),
            [LINEAR_UNIT | VERTICAL_UNIT, 0, _, unit] if UNITS.contains(&unit) && unit != METRE => {
                let name = match unit {
                    9002 => "feet",
                    9003 => "US survey feet",
                    _ => return Err(refusal(&format!("the unit {unit} of EPSG"))),
                };
                return Err(refusal(name));
            }
            _ => {}
        }
    }
    Ok(())
}

fn check_text(wkt: &str) -> Result<(), String> {
    let wkt = wkt.trim_start().to_ascii_lowercase();
    let is_geographic = ["geogcs[", "geogcrs[", "geodcrs["];
    if is_geographic.iter().any(|start| wkt.starts_with(start)) {
        return Err(refusal("degrees"));
    }
    // A length unit whose name contains "foot" is not metres; names of datums and projections never contain it.
    let units = wkt.split("unit[\"").skip(1);
    let mut names = units.filter_map(|rest| rest.split('"').next());
    match names.find(|name| name.contains("foot") || name.contains("feet")) {
        Some(name) => Err(refusal(name)),
        None => Ok(()),
    }
}

fn refusal(unit: &str) -> String {
    format!(
        "its coordinates are in {unit}, not metres: project it, for example with `pdal translate IN OUT \
         reprojection --filters.reprojection.out_srs=EPSG:32633` and the number of your UTM zone"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(keys: &[[u16; 4]]) -> Vec<u8> {
        let all = [&[[1, 1, 0, keys.len() as u16]], keys].concat();
        all.into_iter()
            .flatten()
            .flat_map(u16::to_le_bytes)
            .collect()
    }

    #[test]
    fn metres_pass_and_degrees_and_feet_are_named() {
        let metres = keys(&[[MODEL_TYPE, 0, 1, 1], [LINEAR_UNIT, 0, 1, METRE]]);
        assert_eq!(check(GEO_KEYS, &metres), Ok(()));
        let utm = "PROJCS[\"WGS 84 / UTM zone 33N\",GEOGCS[\"WGS 84\",UNIT[\"degree\",0.0174]],UNIT[\"metre\",1]]";
        assert_eq!(check(WKT, utm.as_bytes()), Ok(()));
        for (record, data, unit) in [
            (
                GEO_KEYS,
                keys(&[[MODEL_TYPE, 0, 1, GEOGRAPHIC]]),
                "in degrees",
            ),
            (
                GEO_KEYS,
                keys(&[[LINEAR_UNIT, 0, 1, 9003]]),
                "in US survey feet",
            ),
            (GEO_KEYS, keys(&[[VERTICAL_UNIT, 0, 1, 9002]]), "in feet"),
            (GEO_KEYS, keys(&[[LINEAR_UNIT, 0, 1, 9036]]), "unit 9036"),
            (WKT, b"GEOGCS[\"WGS 84\"]".to_vec(), "in degrees"),
            (
                WKT,
                b"PROJCS[\"x\",UNIT[\"US survey foot\",0.3]]".to_vec(),
                "us survey foot",
            ),
        ] {
            let error = check(record, &data).unwrap_err();
            assert!(error.contains(unit) && error.contains("pdal"), "{error}");
        }
        for cut in 0..metres.len() {
            assert_eq!(check(GEO_KEYS, &metres[..cut]), Ok(()));
        }
    }
}
