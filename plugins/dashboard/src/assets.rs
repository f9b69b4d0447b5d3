//! Files of the built page, `plugins/dashboard/page/dist`. `build.rs` lists them, and the binary embeds them.

include!(concat!(env!("OUT_DIR"), "/assets.rs"));

/// Returns a file of the page by its path below `dist`.
pub(crate) fn asset(path: &str) -> Option<&'static [u8]> {
    ASSETS.iter().find(|(name, _)| *name == path).map(|(_, bytes)| *bytes)
}

/// Returns the page, `index.html`.
pub fn index() -> &'static [u8] {
    asset("index.html")
        .unwrap_or(b"<!doctype html><title>headrace</title><p>This program was built without its page.")
}

/// Returns the page as one file with inline scripts and styles; `None` if the program was built without the page.
pub fn single() -> Option<&'static str> {
    core::str::from_utf8(asset("single.html")?).ok()
}

/// Returns the content type for a file name.
pub(crate) fn content_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map_or("", |(_, extension)| extension) {
        "html" => "text/html; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        "woff2" => "font/woff2",
        "wasm" => "application/wasm",
        "json" | "webmanifest" => "application/json",
        "mp3" => "audio/mpeg",
        "wav" => "audio/wav",
        "txt" => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_and_all_its_files_are_embedded() {
        let page = core::str::from_utf8(index()).unwrap();
        assert!(page.to_lowercase().contains("<!doctype html>"));
        let referred: Vec<&str> =
            page.split(['"', '\'']).filter_map(|part| part.strip_prefix("./assets/")).collect();
        assert_eq!(
            referred.len(),
            3,
            "script, style and icon, by relative addresses, because proxies add a path"
        );
        for path in referred {
            assert!(asset(&format!("assets/{path}")).is_some(), "{path}");
        }
    }
}
