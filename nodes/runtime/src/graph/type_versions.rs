//! Messages of Lattice whose definition in another process is that of another version.

use std::collections::BTreeSet;
use std::sync::Mutex;

use lattice_msgs::hash_of;

use crate::config::names::shown;
use crate::sync::lock;
use crate::transport::remote::Announced;

/// Package of the messages of Lattice.
const PACKAGE: &str = "lattice_msgs/";

/// Types of Lattice after their warning.
#[derive(Default)]
pub(crate) struct TypeVersions(Mutex<BTreeSet<String>>);

impl TypeVersions {
    /// Warning due to an endpoint of another process: one for each type of this version.
    pub(crate) fn on_found(
        &self,
        topic: &str,
        announced: &Announced,
        node: Option<&str>,
    ) -> Option<String> {
        let name = &announced.type_name;
        let theirs = announced.type_hash.as_deref()?;
        let ours = hash_of(name).filter(|_| name.starts_with(PACKAGE))?;
        if ours == theirs || !lock(&self.0).insert(name.clone()) {
            return None;
        }
        let node = node.map_or_else(|| "another process".to_owned(), shown);
        Some(format!(
            "{}: {node} has {name} of another version of Lattice (type hash {theirs}, here {ours}); its messages are \
             refused where they cannot be decoded; install one version on both sides",
            shown(topic)
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::qos::Qos;

    const MAP: &str = "lattice_msgs/msg/LatticeMap";

    fn announced(type_name: &str, hash: Option<&str>) -> Announced {
        Announced {
            type_name: type_name.to_owned(),
            type_hash: hash.map(str::to_owned),
            reliability: Qos::MAP.reliability,
            durability: Qos::MAP.durability,
        }
    }

    #[test]
    fn another_version_is_named_once() {
        let versions = TypeVersions::default();
        let other = format!("RIHS01_{}", "a".repeat(64));
        let found = |of: &Announced| versions.on_found("/voxel_map", of, None);
        assert_eq!(found(&announced(MAP, hash_of(MAP))), None);
        assert_eq!(found(&announced(MAP, None)), None);
        let foreign = announced("std_msgs/msg/String", Some(&other));
        assert_eq!(found(&foreign), None, "not a message of Lattice");
        let unknown = announced("lattice_msgs/msg/New", Some(&other));
        assert_eq!(found(&unknown), None);
        let map = announced(MAP, Some(&other));
        let line = found(&map).unwrap();
        let begin = "/voxel_map: another process has lattice_msgs/msg/LatticeMap of another version of Lattice";
        assert!(line.starts_with(begin) && line.contains(&other), "{line}");
        assert_eq!(found(&map), None, "logged");
    }
}
