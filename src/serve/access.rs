use std::fmt;
use std::fs;
use std::net::SocketAddr;
use std::path::Path;

use axum::http::HeaderMap;
use axum::http::header::{AUTHORIZATION, ORIGIN};
use sha2::{Digest, Sha256};
use subtle::ConstantTimeEq;

use super::ServeError;

/// Keys shorter than this can be guessed.
const LEAST_KEY_CHARS: usize = 16;
/// How `openpi-client` sends its key.
const SCHEME: &str = "Api-Key ";

/// A secret that clients send as `Authorization: Api-Key ...`. Only its digest is kept.
#[derive(Clone)]
pub struct ApiKey {
    digest: [u8; 32],
}

impl ApiKey {
    /// The key in a file, without the white space around it.
    ///
    /// # Errors
    /// [`ServeError::KeyFile`] when the file cannot be read, or holds no key: at least 16 printable ASCII
    /// characters, which is what fits into a header.
    pub fn read(path: &Path) -> Result<Self, ServeError> {
        let failed = |reason: String| ServeError::KeyFile {
            path: path.to_owned(),
            reason,
        };
        let text = fs::read_to_string(path).map_err(|e| failed(e.to_string()))?;
        Self::new(&text).map_err(failed)
    }

    fn new(text: &str) -> Result<Self, String> {
        let key = text.trim();
        if !key.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err("a key is one word of printable ASCII characters".to_owned());
        }
        if key.len() < LEAST_KEY_CHARS {
            return Err(format!(
                "a key of {} characters can be guessed: at least {LEAST_KEY_CHARS} are asked for",
                key.len()
            ));
        }
        Ok(Self {
            digest: Sha256::digest(key).into(),
        })
    }

    /// Whether the request carries this key. Takes the same time whatever it carries instead: what is
    /// compared are digests, so that nothing is learnt of the key's length either.
    fn is_sent(&self, headers: &HeaderMap) -> bool {
        let sent = headers.get(AUTHORIZATION).and_then(|v| v.to_str().ok());
        let sent = sent
            .and_then(|v| v.strip_prefix(SCHEME))
            .unwrap_or_default();
        let digest: [u8; 32] = Sha256::digest(sent.trim()).into();
        bool::from(digest.ct_eq(&self.digest))
    }
}

impl fmt::Debug for ApiKey {
    /// Nothing of the key, nor of its digest.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ApiKey").finish_non_exhaustive()
    }
}

/// Who may come in.
#[derive(Clone)]
pub(super) struct Access {
    key: Option<ApiKey>,
}

impl Access {
    /// A server that others than this machine reach must have a key.
    pub(super) fn new(address: SocketAddr, key: Option<ApiKey>) -> Result<Self, ServeError> {
        if key.is_none() && !address.ip().is_loopback() {
            return Err(ServeError::KeyNeeded { address });
        }
        Ok(Self { key })
    }

    /// Why a request is refused, if it is, with its status.
    pub(super) fn refusal(&self, headers: &HeaderMap) -> Option<(u16, &'static str)> {
        if headers.contains_key(ORIGIN) {
            // A page that happens to be open in a browser could move the robot.
            return Some((
                403,
                "this server does not talk to web pages (header Origin)\n",
            ));
        }
        match &self.key {
            Some(key) if !key.is_sent(headers) => Some((
                401,
                "send the server's key as 'Authorization: Api-Key ...' (openpi-client: api_key=...)\n",
            )),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: &str = "correct-horse-battery";

    fn request(name: &'static str, value: &str) -> HeaderMap {
        let value = value.parse().expect("a header's value");
        HeaderMap::from_iter([(axum::http::HeaderName::from_static(name), value)])
    }

    #[test]
    fn only_the_key_itself_opens() {
        let access = Access {
            key: ApiKey::new(&format!(" {KEY}\n")).ok(),
        };
        let status = |value: &str| {
            access
                .refusal(&request("authorization", value))
                .map(|r| r.0)
        };
        assert_eq!(status(&format!("Api-Key {KEY}")), None);
        for wrong in ["Api-Key correct-horse-batter", "Api-Key ", KEY, "Bearer x"] {
            assert_eq!(status(wrong), Some(401), "{wrong}");
        }
        assert_eq!(access.refusal(&HeaderMap::new()).map(|r| r.0), Some(401));
    }

    #[test]
    fn a_key_is_not_printed() {
        let key = ApiKey::new(KEY).expect("it is long enough");
        assert_eq!(format!("{key:?}"), "ApiKey { .. }");
    }

    #[test]
    fn web_pages_stay_outside() {
        let access = Access { key: None };
        let page = request("origin", "http://localhost:3000");
        assert_eq!(access.refusal(&page).map(|r| r.0), Some(403));
        assert_eq!(access.refusal(&HeaderMap::new()), None);
    }

    #[test]
    fn other_machines_need_a_key() {
        let open: SocketAddr = "0.0.0.0:8000".parse().expect("an address");
        let error = Access::new(open, None).err().expect("no key").to_string();
        assert!(
            error.contains("0.0.0.0:8000") && error.contains("--api-key-file"),
            "{error}"
        );
        assert!(Access::new(open, ApiKey::new(KEY).ok()).is_ok());
    }

    #[test]
    fn keys_that_are_none_are_refused_with_the_reason() {
        for (text, reason) in [
            ("short", "5 characters"),
            ("two words that are long", "one word"),
            ("", "0 characters"),
            ("schlüssel-mit-umlaut", "printable ASCII"),
        ] {
            let error = ApiKey::new(text).expect_err(text);
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}
