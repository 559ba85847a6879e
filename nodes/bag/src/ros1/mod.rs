//! ROS 1 bags (format 2.0), whose messages are converted to those of ROS 2.

mod added;
mod chunk;
mod contents;
mod definition;
mod index;
mod record;
mod ros2_text;
mod scan;
mod stream;
#[cfg(test)]
mod tests;
mod transcode;
mod visit;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tempfile::TempPath;

use super::BagError;
use super::storage::{Filter, StorageInfo, StorageStream};
use contents::{Contents, Routes};
pub(crate) use contents::{is_true, topic};
pub(crate) use definition::ros2_name;
use record::MAGIC;
use stream::Ros1Stream;
pub(crate) use transcode::Transcoder;

/// First bytes of a ROS 1 bag of any version.
pub(crate) const ROS1_MAGIC: &[u8] = b"#ROSBAG V";

/// An indexed ROS 1 bag.
pub(crate) struct Ros1File {
    path: PathBuf,
    temporary: Option<Arc<TempPath>>,
    contents: Contents,
    routes: Arc<Routes>,
    size: u64,
    index_pos: u64,
    /// Number of messages by the index, if readable.
    pub(crate) claimed: Option<u64>,
    pub(crate) info: StorageInfo,
}

impl Ros1File {
    /// Opens `path`, which may be a temporary copy that is deleted with the last reader.
    pub(crate) fn open(
        path: &Path,
        temporary: Option<Arc<TempPath>>,
    ) -> Result<Ros1File, BagError> {
        let mut file = File::open(path).map_err(BagError::io(path, "open"))?;
        let size = file
            .metadata()
            .map_err(BagError::io(path, "examine"))?
            .len();
        let mut magic = Vec::new();
        let mut head = file.by_ref().take(MAGIC.len() as u64);
        head.read_to_end(&mut magic)
            .map_err(BagError::io(path, "read"))?;
        if magic.starts_with(b"#ROSBAG V1") {
            return Err(BagError::unsupported(
                path,
                "a ROS 1 bag of format 1".to_owned(),
                "rewrite it in format 2.0 with `rosbag compress` of ROS 1",
            ));
        }
        let header = index::bag_header(&mut file, size);
        let index_pos = header.as_ref().map_or(0, |header| header.index_pos);
        let index = match &header {
            Ok(header) if !matches!(header.encryptor.as_str(), "" | "rosbag/NoEncryptor") => {
                let what = format!("a bag encrypted by {}", header.encryptor);
                let remedy = "decrypt it with `rosbag decompress` of ROS 1";
                return Err(BagError::unsupported(path, what, remedy));
            }
            Ok(header) => index::read_index(&mut file, header, size),
            Err(_) => Err("its header is damaged".to_owned()),
        };
        let claimed = index.as_ref().ok().map(Contents::messages);
        let contents = index.unwrap_or_else(|reason| {
            let path = path.display();
            log::info!("{path}: {reason}; reading the whole file once to index it");
            Contents::default()
        });
        let contents = match claimed {
            Some(_) => contents,
            None => scan::scan(&mut file, path, (size, index_pos), contents),
        };
        let (info, routes) = contents.topics(path);
        Ok(Ros1File {
            path: path.to_path_buf(),
            temporary,
            contents,
            routes: Arc::new(routes),
            size,
            index_pos,
            claimed,
            info,
        })
    }

    /// Notes the damage of the compressed file of which this is the sound part.
    pub(crate) fn note_damage(&mut self, damage: BagError) {
        // The part has no end.
        let damages = &mut self.contents.damages;
        damages.retain(|(damage, _)| !matches!(damage, BagError::Truncated { .. }));
        damages.push((damage, false));
        self.info.damage = damages.first().map(|(damage, _)| damage.clone());
    }

    /// Selected messages in order of log time.
    pub(crate) fn stream(&self, filter: Filter) -> Result<StorageStream, BagError> {
        let mut file = File::open(&self.path).map_err(BagError::io(&self.path, "open"))?;
        let (temporary, routes) = (self.temporary.clone(), self.routes.clone());
        let scanned = (filter.past_damage && self.claimed.is_some()).then(|| {
            // The index does not lead behind a damage.
            let known = Contents {
                connections: self.contents.connections.clone(),
                ..Contents::default()
            };
            let lengths = (self.size, self.index_pos);
            let mut scanned = scan::scan(&mut file, &self.path, lengths, known);
            let (found, claimed) = (scanned.messages(), self.claimed.unwrap_or(0));
            if scanned.damages.is_empty() && found != claimed {
                let reason = format!("it counts {claimed} messages, the chunks have {found}");
                let remedy = "the messages of the chunks are read";
                let wrong = BagError::corrupt(&self.path, "its index", reason, remedy);
                scanned.damages.push((wrong, false));
            }
            scanned
        });
        let contents = scanned.as_ref().unwrap_or(&self.contents);
        let source = (file, self.path.clone(), self.size);
        let stream = Ros1Stream::new(source, temporary, contents, routes, filter);
        Ok(Box::new(stream))
    }
}
