//! Message definitions: ours, or those of installed ROS packages.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use lattice_msgs::{definition_of, type_hash};

/// Separator between two definitions.
const SEPARATOR: &str =
    "================================================================================";

/// Limit of a definition file, and of a complete definition, bytes.
const MAX_FILE_BYTES: u64 = 1 << 20;
const MAX_PARTS: usize = 500;

/// Folders with a subfolder per package, such as `/opt/ros/jazzy/share`.
pub(super) struct Definitions {
    folders: Vec<PathBuf>,
}

impl Definitions {
    /// The given folders, then those of `AMENT_PREFIX_PATH`.
    pub(super) fn new(folders: &[PathBuf]) -> Self {
        let prefixes = std::env::var_os("AMENT_PREFIX_PATH").unwrap_or_default();
        let shares = std::env::split_paths(&prefixes).map(|prefix| prefix.join("share"));
        Self {
            folders: folders.iter().cloned().chain(shares).collect(),
        }
    }

    /// Definition with all its dependencies, and the type hash; `None` if a part is missing.
    ///
    /// `announced` is the publisher's hash: a definition with another hash is not used.
    pub(super) fn of(&self, ros_type: &str, announced: Option<&str>) -> Option<(String, String)> {
        let found = definition_of(ros_type).into_iter();
        let found = found.chain(
            self.folders
                .iter()
                .filter_map(|folder| read(folder, ros_type)),
        );
        let hashed = found.filter_map(|text| Some((type_hash(ros_type, &text)?, text)));
        let mut fits = hashed.filter(|(hash, _)| announced.is_none_or(|theirs| theirs == hash));
        fits.next().map(|(hash, text)| (text, hash))
    }
}

/// Reads a definition from files below `folder`; dependencies of other packages are taken from our own.
fn read(folder: &Path, ros_type: &str) -> Option<String> {
    let mut text = file(folder, ros_type)?;
    let mut parts = BTreeMap::new();
    let mut wanted = dependencies(&text, ros_type);
    while let Some(name) = wanted.pop_first() {
        if name == ros_type || parts.contains_key(&name) {
            continue;
        }
        let part = file(folder, &name).or_else(|| own_text(&name))?;
        wanted.extend(dependencies(&part, &name));
        parts.insert(name, part);
        if parts.len() > MAX_PARTS {
            return None;
        }
    }
    for (name, part) in parts {
        let name = name.replacen("/msg/", "/", 1);
        text += &format!("\n{SEPARATOR}\nMSG: {name}\n{part}");
    }
    Some(text)
}

/// `FOLDER/PACKAGE/msg/NAME.msg`.
fn file(folder: &Path, ros_type: &str) -> Option<String> {
    let is_plain = |part: &str| part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let plain = ros_type.split('/').count() == 3 && ros_type.split('/').all(is_plain);
    let path = plain.then(|| folder.join(format!("{ros_type}.msg")))?;
    let mut text = String::new();
    let file = File::open(path).ok()?;
    file.take(MAX_FILE_BYTES).read_to_string(&mut text).ok()?;
    Some(text)
}

/// One of our messages without its dependencies.
fn own_text(ros_type: &str) -> Option<String> {
    let text = definition_of(ros_type)?;
    let own = text.split(SEPARATOR).next().unwrap_or_default();
    Some(own.to_owned())
}

/// Full names of the messages that fields refer to.
fn dependencies(text: &str, of: &str) -> BTreeSet<String> {
    let package = of.split('/').next().unwrap_or_default();
    let name = |line: &str| {
        let code = line.split('#').next()?.trim();
        let field = code.split_whitespace().next()?;
        let element = field.split(['[', '<']).next()?;
        let (package, name) = element.rsplit_once('/').unwrap_or((package, element));
        let package = package.split('/').next()?;
        // Built-in types begin with a lower case letter.
        let is_message = name.starts_with(|c: char| c.is_ascii_uppercase());
        is_message.then(|| format!("{package}/msg/{name}"))
    };
    text.lines().filter_map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn definitions_of_ours_and_of_folders_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = folder.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write(
            "pit/msg/Truck.msg",
            "# A truck\nuint8 EMPTY=0\nstd_msgs/Header header\nLoad[<=3] loads\nstring<=9 name\n",
        );
        write(
            "pit/msg/Load.msg",
            "float64 mass_kg # of it\ngeometry_msgs/Point at\n",
        );
        write("pit/msg/Broken.msg", "Missing field\n");
        let definitions = Definitions::new(&[folder.path().to_owned()]);
        let (text, hash) = definitions.of("pit/msg/Truck", None).unwrap();
        for part in [
            "pit/Load",
            "std_msgs/Header",
            "builtin_interfaces/Time",
            "geometry_msgs/Point",
        ] {
            assert!(text.contains(&format!("MSG: {part}\n")), "{part}: {text}");
        }
        assert_eq!(
            definitions.of("pit/msg/Truck", Some(&hash)),
            Some((text, hash))
        );
        assert_eq!(definitions.of("pit/msg/Truck", Some("RIHS01_other")), None);
        assert!(definitions.of("sensor_msgs/msg/Imu", None).is_some());
        for none in [
            "pit/msg/Broken",
            "pit/msg/None",
            "../msg/x",
            "pit/msg/../Load",
        ] {
            assert_eq!(definitions.of(none, None), None, "{none}");
        }
    }
}
