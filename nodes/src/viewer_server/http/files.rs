//! Files of the page, from `nodes/web/`.

/// A file of the page.
pub struct File {
    /// URL path.
    pub path: &'static str,
    /// Media type of the file.
    pub media_type: &'static str,
    /// Content of the file.
    pub bytes: &'static [u8],
}

const JAVASCRIPT: &str = "text/javascript; charset=utf-8";

/// Lists files by name and media type.
macro_rules! files {
    ($($path:literal $name:literal $media_type:expr;)*) => {
        &[$(File {
            path: $path,
            media_type: $media_type,
            bytes: include_bytes!(concat!("../../../web/", $name)),
        }),*]
    };
}

/// All served files.
const FILES: &[File] = files! {
    "/" "index.html" "text/html; charset=utf-8";
    "/style.css" "style.css" "text/css; charset=utf-8";
    "/calls.js" "calls.js" JAVASCRIPT;
    "/camera.js" "camera.js" JAVASCRIPT;
    "/cdr.js" "cdr.js" JAVASCRIPT;
    "/cell.js" "cell.js" JAVASCRIPT;
    "/colours.js" "colours.js" JAVASCRIPT;
    "/compass.js" "compass.js" JAVASCRIPT;
    "/dialog.js" "dialog.js" JAVASCRIPT;
    "/drawing.js" "drawing.js" JAVASCRIPT;
    "/empty.js" "empty.js" JAVASCRIPT;
    "/follower.js" "follower.js" JAVASCRIPT;
    "/free.js" "free.js" JAVASCRIPT;
    "/headset.js" "headset.js" JAVASCRIPT;
    "/keys.js" "keys.js" JAVASCRIPT;
    "/layers.js" "layers.js" JAVASCRIPT;
    "/legend.js" "legend.js" JAVASCRIPT;
    "/main.js" "main.js" JAVASCRIPT;
    "/math.js" "math.js" JAVASCRIPT;
    "/messages.js" "messages.js" JAVASCRIPT;
    "/mixed.js" "mixed.js" JAVASCRIPT;
    "/panel.js" "panel.js" JAVASCRIPT;
    "/picture.js" "picture.js" JAVASCRIPT;
    "/planning.js" "planning.js" JAVASCRIPT;
    "/player.js" "player.js" JAVASCRIPT;
    "/pointer.js" "pointer.js" JAVASCRIPT;
    "/renderer.js" "renderer.js" JAVASCRIPT;
    "/requests.js" "requests.js" JAVASCRIPT;
    "/scene.js" "scene.js" JAVASCRIPT;
    "/services.js" "services.js" JAVASCRIPT;
    "/shaders.js" "shaders.js" JAVASCRIPT;
    "/sign.js" "sign.js" JAVASCRIPT;
    "/slice.js" "slice.js" JAVASCRIPT;
    "/surfaces.js" "surfaces.js" JAVASCRIPT;
    "/transforms.js" "transforms.js" JAVASCRIPT;
    "/worker.js" "worker.js" JAVASCRIPT;
    "/writing.js" "writing.js" JAVASCRIPT;
};

/// File at a path.
pub fn find(path: &str) -> Option<&'static File> {
    FILES.iter().find(|file| file.path == path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_page_is_served_and_the_page_stays_small() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/web");
        for entry in std::fs::read_dir(folder).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            let path = match name.as_str() {
                "index.html" => "/".to_owned(),
                name => format!("/{name}"),
            };
            assert!(find(&path).is_some(), "{path} is not in the table");
        }
        let bytes: usize = FILES.iter().map(|file| file.bytes.len()).sum();
        assert!(bytes < 185_000, "{bytes} bytes");
        assert!(find("/../Cargo.toml").is_none());
    }
}
