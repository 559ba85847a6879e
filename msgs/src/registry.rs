//! All messages of this crate, by type; type hashes of these and of others that a program uses.

use std::collections::HashMap;
use std::sync::{LazyLock, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use crate::interface::{MessageVisitor, RosMessage, RosService, Schema};
use crate::packages::visit_packages;
use crate::rmw_dds_common;
use crate::type_hash::{service_hash, type_hash};

/// Passes every message, and every part of a service or an action, to the visitor.
pub fn visit_messages(visitor: &mut impl MessageVisitor) {
    visit_packages(visitor);
    rmw_dds_common::visit_messages(visitor);
}

/// Definition of a message of this crate with its dependencies (`ros2msg` text).
///
/// ```
/// let definition = lattice_msgs::definition_of("std_msgs/msg/String");
/// assert!(definition.is_some_and(|text| text.contains("string data")));
/// assert_eq!(lattice_msgs::definition_of("my_msgs/msg/Unknown"), None);
/// ```
pub fn definition_of(ros_type: &str) -> Option<String> {
    struct Find<'a>(&'a str, Option<String>);
    impl MessageVisitor for Find<'_> {
        fn visit<M: RosMessage>(&mut self) {
            if self.0 == M::TYPE {
                self.1 = Some(M::definition());
            }
        }
    }
    let mut find = Find(ros_type, None);
    visit_messages(&mut find);
    find.1
}

/// Type hash of a message or service of this crate, of a part of an action, or of a type made known.
pub fn hash_of(ros_type: &str) -> Option<&'static str> {
    known(ros_type).map(|known| known.hash)
}

/// Schema of a message of this crate, of a part of a service or an action, or of a message made known.
pub fn schema_of(ros_type: &str) -> Option<&'static Schema> {
    known(ros_type).and_then(|known| known.schema)
}

/// Makes a message of another crate known to [`hash_of`] and [`schema_of`], with those in its fields.
///
/// Publishers and subscriptions of `lattice_runtime` do so.
pub fn know_message<M: RosMessage>() {
    if known(M::TYPE).is_none() {
        KNOWN.write().add_message(M::SCHEMA);
    }
}

/// Makes a service of another crate known to [`hash_of`], and its request and response as [`know_message`].
pub fn know_service<S: RosService>() {
    if known(S::TYPE).is_none() {
        let mut known = KNOWN.write();
        known.add_message(S::Request::SCHEMA);
        known.add_message(S::Response::SCHEMA);
        known.add_service(S::TYPE, S::Request::SCHEMA, S::Response::SCHEMA);
    }
}

fn known(ros_type: &str) -> Option<Known> {
    KNOWN.read().0.get(ros_type).copied()
}

static KNOWN: LazyLock<Lock> = LazyLock::new(|| {
    let mut types = Types::default();
    visit_messages(&mut types);
    types.add_services();
    Lock(RwLock::new(types))
});

/// Types by name; what a panic left is taken as it is, since entries are only added.
struct Lock(RwLock<Types>);

impl Lock {
    fn read(&self) -> RwLockReadGuard<'_, Types> {
        self.0.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, Types> {
        self.0.write().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Hash of a type; a service has no schema of its own.
#[derive(Clone, Copy)]
struct Known {
    hash: &'static str,
    schema: Option<&'static Schema>,
}

/// Known types by name. They stay as long as the process, as their schemas do.
#[derive(Default)]
struct Types(HashMap<&'static str, Known>);

impl Types {
    fn add(&mut self, name: &'static str, hash: Option<String>, schema: Option<&'static Schema>) {
        if let Some(hash) = hash {
            let hash = hash.leak();
            self.0.entry(name).or_insert(Known { hash, schema });
        }
    }

    /// Adds a message, and those in its fields that are new.
    fn add_message(&mut self, schema: &'static Schema) {
        if !self.0.contains_key(schema.type_name) {
            let hash = type_hash(schema.type_name, &schema.definition());
            self.add(schema.type_name, hash, Some(schema));
            for dependency in schema.dependencies {
                self.add_message(dependency);
            }
        }
    }

    fn add_service(
        &mut self,
        name: &'static str,
        request: &'static Schema,
        response: &'static Schema,
    ) {
        self.add(name, service_hash(name, request, response), None);
    }

    /// Adds the services whose requests and responses are here.
    fn add_services(&mut self) {
        let schema = |name: &str| self.0.get(name)?.schema;
        let service = |request: &&'static str| {
            let name = request.strip_suffix("_Request")?;
            Some((name, schema(request)?, schema(&format!("{name}_Response"))?))
        };
        let services: Vec<_> = self.0.keys().filter_map(service).collect();
        for (name, request, response) in services {
            self.add_service(name, request, response);
        }
    }
}

impl MessageVisitor for Types {
    fn visit<M: RosMessage>(&mut self) {
        self.add_message(M::SCHEMA);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[derive(Default)]
    struct Names(Vec<&'static str>);

    impl MessageVisitor for Names {
        fn visit<M: RosMessage>(&mut self) {
            self.0.push(M::TYPE);
        }
    }

    #[test]
    fn every_message_is_visited_only_once() {
        let mut names = Names::default();
        visit_messages(&mut names);
        let unique: BTreeSet<_> = names.0.iter().collect();
        assert_eq!(unique.len(), names.0.len());
    }
}
