//! Class names of a model, from its metadata or its configuration file.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use serde::Deserialize;

use super::network::MAX_CLASSES;
use crate::files::regular_file::open;

/// Limit of names text, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Class names in one of the usual forms.
#[derive(Deserialize)]
#[serde(untagged)]
enum Written {
    List(Vec<String>),
    Numbered(BTreeMap<u16, String>),
    /// JSON object, whose keys are texts.
    Keyed(BTreeMap<String, String>),
}

impl Written {
    fn names(self) -> Option<Vec<String>> {
        let numbered = match self {
            Self::List(names) => return Some(names).filter(|names| names.len() <= MAX_CLASSES),
            Self::Numbered(names) => names,
            Self::Keyed(names) => names
                .into_iter()
                .map(|(number, name)| Some((number.parse().ok()?, name)))
                .collect::<Option<_>>()?,
        };
        let most = numbered
            .keys()
            .next_back()
            .map_or(0, |n| usize::from(*n) + 1);
        let mut names = vec![String::new(); most];
        for (number, name) in numbered {
            *names.get_mut(usize::from(number))? = name;
        }
        Some(names)
    }
}

/// Parses names: a YAML list or map, or comma-separated words.
fn read(text: &str) -> Option<Vec<String>> {
    if text.len() as u64 > MAX_BYTES {
        return None;
    }
    match serde_yaml::from_str::<Written>(text) {
        Ok(written) => written.names(),
        Err(_) if text.contains(['{', '[', ':']) => None,
        Err(_) => Some(text.split(',').map(|name| name.trim().to_owned()).collect()),
    }
}

/// Names from the metadata of a model (`names`, `class_names`), or from `id2label` of a `config.json` beside it.
pub(super) fn of_model<'a>(
    metadata: impl Iterator<Item = (&'a str, &'a str)>,
    model: &Path,
) -> Result<Vec<String>, String> {
    let mut metadata = metadata.filter(|(key, _)| ["names", "class_names"].contains(key));
    if let Some((key, text)) = metadata.next() {
        return read(text).ok_or_else(|| format!("its metadata `{key}` are not class names"));
    }
    beside(&model.with_file_name("config.json"))
}

#[derive(Deserialize)]
struct Config {
    #[serde(default)]
    id2label: Option<Written>,
}

fn beside(path: &Path) -> Result<Vec<String>, String> {
    let Ok(file) = open(path) else {
        return Ok(Vec::new());
    };
    let mut text = String::new();
    let read = file.take(MAX_BYTES).read_to_string(&mut text);
    let config = read
        .ok()
        .and_then(|_| serde_json::from_str::<Config>(&text).ok());
    let written = config.and_then(|config| config.id2label);
    match written {
        None => Ok(Vec::new()),
        Some(written) => written.names().ok_or_else(|| {
            let path = path.display();
            format!("`id2label` of {path} does not map numbers to names")
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_in_every_form() {
        let none = Path::new("/nowhere/model.onnx");
        for text in [
            "{0: 'wall', 1: 'floor', 3: 'door'}",
            r#"{"0": "wall", "1": "floor", "3": "door"}"#,
            r#"["wall", "floor", "", "door"]"#,
            "wall, floor, , door",
        ] {
            let metadata = [("license", "MIT"), ("names", text)];
            let names = of_model(metadata.into_iter(), none).unwrap();
            assert_eq!(names, ["wall", "floor", "", "door"], "{text}");
        }
        for text in ["{wall: 0}", "{0: [1]}", "{70000: 'a'}"] {
            let error = of_model([("class_names", text)].into_iter(), none).unwrap_err();
            assert!(error.contains("class_names"), "{text}: {error}");
        }
        assert!(of_model([].into_iter(), none).unwrap().is_empty());
    }

    #[test]
    fn the_configuration_beside_a_model_names_its_classes() {
        let folder = tempfile::tempdir().unwrap();
        let model = folder.path().join("model.onnx");
        let write = |text: &str| std::fs::write(folder.path().join("config.json"), text).unwrap();
        write(
            r#"{"architectures": ["SegformerForSemanticSegmentation"], "id2label": {"0": "wall", "1": "floor"}}"#,
        );
        assert_eq!(of_model([].into_iter(), &model).unwrap(), ["wall", "floor"]);
        write(r#"{"id2label": {"wall": "0"}}"#);
        assert!(
            of_model([].into_iter(), &model)
                .unwrap_err()
                .contains("id2label")
        );
        write("{}");
        assert!(of_model([].into_iter(), &model).unwrap().is_empty());
    }
}
