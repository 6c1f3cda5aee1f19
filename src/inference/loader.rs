//! Loads the native ONNX Runtime library. The only file of this crate that needs `unsafe`: calling
//! into a shared library cannot be checked by the compiler.
#![allow(unsafe_code)]

use std::error::Error;
use std::ffi::CStr;
use std::path::Path;
use std::ptr;

use libloading::{Library, Symbol};
use ort::sys::{ORT_API_VERSION, OrtApi, OrtApiBase};

/// The function table of an ONNX Runtime library, and its version.
pub(super) struct NativeApi {
    pub(super) table: OrtApi,
    pub(super) version: String,
}

/// Opens a library and takes its function table; an error says which library and why not.
///
/// The library is never unloaded, not even when it is refused: it may have started threads.
pub(super) fn load(path: &Path) -> Result<NativeApi, String> {
    let name = path.display();
    // SAFETY: opening a library runs its initialisers. The caller named the library, or it bears ONNX
    // Runtime's name in a place where the system or the user keeps libraries.
    let library = unsafe { Library::new(path) }.map_err(|e| {
        // The system's reason mostly begins with the file.
        let reason = e
            .source()
            .map_or_else(|| e.to_string(), ToString::to_string);
        let reason = reason.strip_prefix(&format!("{name}: ")).unwrap_or(&reason);
        format!("{name} cannot be loaded: {reason}")
    })?;
    let library: &'static Library = Box::leak(Box::new(library));

    // SAFETY: in every release of ONNX Runtime `OrtGetApiBase` takes nothing and returns this pointer.
    let base_of: Symbol<'_, unsafe extern "C" fn() -> *const OrtApiBase> =
        unsafe { library.get(b"OrtGetApiBase\0") }
            .map_err(|_| format!("{name} is not ONNX Runtime: it has no OrtGetApiBase"))?;
    // SAFETY: the function returns null or a table that lives as long as the library: for ever.
    let base = unsafe { base_of().as_ref() }
        .ok_or_else(|| format!("{name}: OrtGetApiBase returned nothing"))?;

    // SAFETY: the version is a constant C string of the library.
    let version = unsafe { CStr::from_ptr((base.GetVersionString)()) }
        .to_string_lossy()
        .into_owned();
    // Asked before `GetApi`, which prints to the standard error of the process when it refuses.
    if !is_new_enough(&version) {
        return Err(format!(
            "{name} is ONNX Runtime {version}, version 1.{ORT_API_VERSION} or newer is needed"
        ));
    }
    // SAFETY: `GetApi` returns null or a table of at least the functions of the version asked for.
    let table = unsafe { (base.GetApi)(ORT_API_VERSION) };
    if table.is_null() {
        return Err(format!(
            "{name} (ONNX Runtime {version}) refused to give interface version {ORT_API_VERSION}"
        ));
    }
    // SAFETY: the table is plain function pointers, valid as long as the library; `OrtApi` as compiled
    // here is that of interface version `ORT_API_VERSION`, which newer libraries only extend.
    let table = unsafe { ptr::read(table) };
    Ok(NativeApi { table, version })
}

fn is_new_enough(version: &str) -> bool {
    let mut parts = version.split('.').map(str::parse::<u32>);
    match (parts.next(), parts.next()) {
        (Some(Ok(1)), Some(Ok(minor))) => minor >= ORT_API_VERSION,
        (Some(Ok(major)), _) => major > 1,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn older_and_unreadable_versions_are_refused() {
        assert!(is_new_enough(&format!("1.{ORT_API_VERSION}.0")));
        assert!(!is_new_enough(&format!("1.{}.9", ORT_API_VERSION - 1)));
        assert!(is_new_enough("2.0.0"));
        assert!(!is_new_enough("nightly"));
    }

    #[test]
    fn a_file_that_is_no_library_is_named_with_the_reason() {
        let file = tempfile::Builder::new()
            .suffix(".so")
            .tempfile()
            .expect("a temporary file");
        std::fs::write(file.path(), b"not a library").expect("writing it");
        let Err(message) = load(file.path()) else {
            panic!("a text file was loaded as a library");
        };
        assert!(
            message.starts_with(&file.path().display().to_string()),
            "{message}"
        );
    }
}
