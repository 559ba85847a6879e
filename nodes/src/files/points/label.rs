//! Field names of point classes in common programs.

/// Names in order of precedence, in any case; CloudCompare prefixes them with `scalar_`.
const NAMES: [&str; 4] = ["label", "labels", "class", "classification"];
const PREFIX: &str = "scalar_";

/// Index of the class among field names.
pub(super) fn label_among<'a>(names: impl Iterator<Item = &'a str> + Clone) -> Option<usize> {
    let bare = |name: &'a str| match name.split_at_checked(PREFIX.len()) {
        Some((prefix, rest)) if prefix.eq_ignore_ascii_case(PREFIX) => rest,
        _ => name,
    };
    let place = |wanted: &&str| {
        let mut bare_names = names.clone().map(bare);
        bare_names.position(|name| name.eq_ignore_ascii_case(wanted))
    };
    NAMES.iter().find_map(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_found_by_the_names_of_other_programs() {
        for (names, expected) in [
            ("x y z label", Some(3)),
            ("x y z scalar_Label", Some(3)),
            ("X Y Z Classification", Some(3)),
            ("scalar_Classification x y z", Some(0)),
            ("x y z class label", Some(4)),
            ("x y z LABELS scalar_class", Some(3)),
            ("x y z labelled scalar_", None),
            ("x y z scalar_Intensity", None),
            ("", None),
        ] {
            assert_eq!(label_among(names.split(' ')), expected, "{names}");
        }
    }
}
