//! The parts of a glTF 2.0 document that define a mesh.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, de};

/// Limit of nodes, meshes, accessors and so on in a document: each needs only a few bytes of text.
const MAX_OBJECTS: usize = 100_000;

/// A document. Other properties do not affect triangle positions.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Document {
    pub asset: Asset,
    pub extensions_required: Few<String>,
    pub scene: Option<usize>,
    pub scenes: Few<Scene>,
    pub nodes: Few<Node>,
    pub meshes: Few<Mesh>,
    pub accessors: Few<Accessor>,
    pub buffer_views: Few<BufferView>,
    pub buffers: Few<Buffer>,
}

/// Metadata of the document.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Asset {
    pub version: String,
}

/// Nodes of one scene.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub nodes: Few<usize>,
}

/// Node: a transform with a mesh or child nodes.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub children: Few<usize>,
    pub mesh: Option<usize>,
    pub skin: Option<usize>,
    /// Column-major matrix.
    pub matrix: Option<Box<[f64; 16]>>,
    pub translation: Option<[f64; 3]>,
    /// x, y, z, w.
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    pub extras: Extras,
}

/// Mesh: a list of primitives.
#[derive(Debug, Deserialize)]
pub(super) struct Mesh {
    pub primitives: Few<Primitive>,
    #[serde(default)]
    pub extras: Extras,
}

/// Primitive: triangles or another mode.
#[derive(Debug, Deserialize)]
pub(super) struct Primitive {
    pub attributes: Attributes,
    pub indices: Option<usize>,
    pub mode: Option<u32>,
    #[serde(default)]
    pub extras: Extras,
}

/// Vertex attributes, as accessors.
#[derive(Debug, Deserialize)]
pub(super) struct Attributes {
    #[serde(rename = "POSITION")]
    pub position: Option<usize>,
}

/// Typed view of numbers.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub buffer_view: Option<usize>,
    #[serde(default)]
    pub byte_offset: u64,
    pub component_type: u32,
    #[serde(default)]
    pub normalized: bool,
    pub count: u64,
    #[serde(rename = "type")]
    pub kind: String,
    pub sparse: Option<IgnoredAny>,
}

/// Part of a buffer.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub byte_length: u64,
    pub byte_stride: Option<u64>,
}

/// Buffer: the binary chunk of the file if `uri` is missing.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub uri: Option<String>,
    pub byte_length: u64,
}

/// A list of bounded length.
#[derive(Debug)]
pub(super) struct Few<T>(pub Vec<T>);

impl<T> Default for Few<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Few<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(FewVisitor(PhantomData))
    }
}

struct FewVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for FewVisitor<T> {
    type Value = Few<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of at most {MAX_OBJECTS}")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Few<T>, A::Error> {
        let mut all = Vec::new();
        while let Some(one) = list.next_element()? {
            if all.len() == MAX_OBJECTS {
                return Err(A::Error::invalid_length(all.len() + 1, &self));
            }
            all.push(one);
        }
        Ok(Few(all))
    }
}

/// Application data of a node, a mesh or a primitive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Extras {
    pub label: Option<f64>,
    pub instance: Option<f64>,
}

impl<'de> Deserialize<'de> for Extras {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Given { extras, .. } = Given::deserialize(deserializer)?;
        Ok(extras)
    }
}

/// An application value, kept only if it is a number.
#[derive(Default)]
struct Given {
    number: Option<f64>,
    extras: Extras,
}

impl<'de> Deserialize<'de> for Given {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(GivenVisitor)
    }
}

impl Given {
    fn of(number: f64) -> Self {
        Self {
            number: Some(number),
            ..Self::default()
        }
    }
}

struct GivenVisitor;

impl<'de> Visitor<'de> for GivenVisitor {
    type Value = Given;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("anything")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Given, A::Error> {
        let mut extras = Extras::default();
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "label" => extras.label = map.next_value::<Given>()?.number,
                "instance" => extras.instance = map.next_value::<Given>()?.number,
                _ => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        Ok(Given {
            extras,
            ..Given::default()
        })
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Given, A::Error> {
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Given::default())
    }

    fn visit_bool<E: de::Error>(self, _: bool) -> Result<Given, E> {
        Ok(Given::default())
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<Given, E> {
        Ok(Given::of(number as f64))
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<Given, E> {
        Ok(Given::of(number as f64))
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<Given, E> {
        Ok(Given::of(number))
    }

    fn visit_str<E: de::Error>(self, _: &str) -> Result<Given, E> {
        Ok(Given::default())
    }

    fn visit_unit<E: de::Error>(self) -> Result<Given, E> {
        Ok(Given::default())
    }
}
