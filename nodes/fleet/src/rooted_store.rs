//! Files for the queries of a cluster: read below the roots only, and never written.

use std::fmt::{self, Display, Formatter};
use std::sync::Arc;

use async_trait::async_trait;
use datafusion::execution::object_store::{DefaultObjectStoreRegistry, ObjectStoreRegistry};
use datafusion::execution::runtime_env::{RuntimeEnv, RuntimeEnvBuilder};
use futures::StreamExt;
use futures::stream::BoxStream;
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta,
    ObjectStore, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use url::Url;

use crate::roots::Roots;

/// Builds the environment of queries whose files lie below the roots; it spills to a folder.
pub fn runtime(roots: &Roots, spill: &std::path::Path) -> crate::Result<Arc<RuntimeEnv>> {
    let registry = DefaultObjectStoreRegistry::new();
    let store = RootedStore {
        files: LocalFileSystem::new(),
        roots: roots.clone(),
    };
    registry.register_store(&Url::parse("file:///")?, Arc::new(store));
    let runtime = RuntimeEnvBuilder::new()
        .with_object_store_registry(Arc::new(registry))
        .with_temp_file_path(spill);
    Ok(runtime.build_arc()?)
}

#[derive(Debug)]
struct RootedStore {
    files: LocalFileSystem,
    roots: Roots,
}

impl RootedStore {
    fn admit(&self, location: &Path) -> Result<()> {
        let path = std::path::Path::new("/").join(location.as_ref());
        let admitted = self.roots.admit(&path);
        let denied = |source| Error::PermissionDenied {
            path: path.display().to_string(),
            source,
        };
        admitted.map(|_| ()).map_err(denied)
    }
}

fn read_only() -> Error {
    Error::NotSupported {
        source: "queries write no files".into(),
    }
}

impl Display for RootedStore {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "RootedStore")
    }
}

#[async_trait]
impl ObjectStore for RootedStore {
    async fn put_opts(&self, _: &Path, _: PutPayload, _: PutOptions) -> Result<PutResult> {
        Err(read_only())
    }

    async fn put_multipart_opts(
        &self,
        _: &Path,
        _: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        Err(read_only())
    }

    async fn get_opts(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        self.admit(location)?;
        self.files.get_opts(location, options).await
    }

    fn delete_stream(
        &self,
        _: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        futures::stream::once(async { Err(read_only()) }).boxed()
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        match self.admit(prefix.unwrap_or(&Path::default())) {
            Ok(()) => self.files.list(prefix),
            Err(error) => futures::stream::once(async { Err(error) }).boxed(),
        }
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.admit(prefix.unwrap_or(&Path::default()))?;
        self.files.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, _: &Path, _: &Path, _: CopyOptions) -> Result<()> {
        Err(read_only())
    }
}
