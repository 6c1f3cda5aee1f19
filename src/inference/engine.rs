use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::ffi::OsString;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};

use ort::environment::Environment;
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;

use super::InferenceError;
use super::loader;

/// Which engine is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EngineChoice {
    /// The native engine if its library is found, otherwise the compiled-in one. With
    /// `ORT_DYLIB_PATH` set, that library or an error.
    #[default]
    Auto,
    /// The native engine or an error.
    Native,
    /// The compiled-in engine, whatever else there is.
    Tract,
}

impl FromStr for EngineChoice {
    type Err = InferenceError;

    /// `auto`, `native`, and `tract` or, as the command line has it, `embedded`.
    fn from_str(name: &str) -> Result<Self, Self::Err> {
        match name {
            "auto" => Ok(Self::Auto),
            "native" => Ok(Self::Native),
            "tract" | "embedded" => Ok(Self::Tract),
            _ => Err(InferenceError::EngineUnknown {
                name: name.to_owned(),
            }),
        }
    }
}

/// The two engines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EngineKind {
    /// ONNX Runtime, from a shared library.
    Native,
    /// tract, compiled into this program.
    Tract,
}

impl fmt::Display for EngineKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Native => "native",
            Self::Tract => "tract",
        })
    }
}

/// What computes the networks of this process. There is one, chosen by the first call of
/// [`Engine::select`] that succeeds.
#[derive(Debug)]
pub struct Engine {
    kind: EngineKind,
    name: String,
    /// What follows the name in its description.
    origin: String,
    environment: Environment,
}

static ENGINE: Mutex<Option<&'static Engine>> = Mutex::new(None);

impl Engine {
    /// The process's engine, chosen now if this is the first call.
    ///
    /// The native library is looked for in `ORT_DYLIB_PATH`, next to the executable, and where the
    /// system keeps libraries.
    ///
    /// # Errors
    /// [`InferenceError::LibraryUnusable`] when `ORT_DYLIB_PATH` names something unusable,
    /// [`InferenceError::NativeMissing`] when the native engine is asked for and not found,
    /// [`InferenceError::EngineAlreadyChosen`] when the other engine runs already,
    /// [`InferenceError::EngineFailed`] when the engine does not start.
    pub fn select(choice: EngineChoice) -> Result<&'static Self, InferenceError> {
        let mut chosen = ENGINE.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(engine) = *chosen {
            return match (choice, engine.kind) {
                (EngineChoice::Native, EngineKind::Tract) => Err(engine.refuse(EngineKind::Native)),
                (EngineChoice::Tract, EngineKind::Native) => Err(engine.refuse(EngineKind::Tract)),
                _ => Ok(engine),
            };
        }
        let engine: &'static Self = Box::leak(Box::new(Self::start(choice)?));
        *chosen = Some(engine);
        Ok(engine)
    }

    /// Which of the two it is.
    #[must_use]
    pub fn kind(&self) -> EngineKind {
        self.kind
    }

    /// Name and version: what results hold.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Name, version, and the file or the reason that it is this one: for the person at this machine.
    #[must_use]
    pub fn description(&self) -> String {
        format!("{}{}", self.name, self.origin)
    }

    fn start(choice: EngineChoice) -> Result<Self, InferenceError> {
        let named = std::env::var_os("ORT_DYLIB_PATH").filter(|path| !path.is_empty());
        let Started {
            api,
            kind,
            name,
            origin,
        } = match choice {
            EngineChoice::Tract => tract("asked for"),
            EngineChoice::Native | EngineChoice::Auto => match native(named) {
                Ok(found) => found,
                Err(InferenceError::NativeMissing { .. }) if choice == EngineChoice::Auto => {
                    tract("no usable ONNX Runtime library found")
                }
                Err(error) => return Err(error),
            },
        };
        let failed = |reason: String| InferenceError::EngineFailed {
            engine: kind.to_string(),
            place: "its start".to_owned(),
            reason,
        };
        if !ort::set_api(api) {
            return Err(failed(
                "another part of this process has set up ort before".to_owned(),
            ));
        }
        let environment = ort::init()
            .with_name("catena")
            .with_telemetry(false)
            .build()
            .map_err(|e| failed(e.to_string()))?;
        Ok(Self {
            kind,
            name,
            origin,
            environment,
        })
    }

    fn refuse(&self, wanted: EngineKind) -> InferenceError {
        InferenceError::EngineAlreadyChosen {
            running: self.kind.to_string(),
            wanted: wanted.to_string(),
        }
    }

    /// A session that computes on the calling thread: the callers bring their own threads.
    pub(super) fn session(&self, network: &[u8]) -> Result<Session, String> {
        let mut builder = Session::builder(&self.environment)
            .map_err(|e| e.to_string())?
            .with_optimization_level(GraphOptimizationLevel::All)
            .map_err(|e| e.to_string())?;
        // The compiled-in engine has neither threads nor settings, and says so with an error.
        if self.kind == EngineKind::Native {
            builder = builder
                .with_intra_threads(1)
                .map_err(|e| e.to_string())?
                .with_intra_op_spinning(false)
                .map_err(|e| e.to_string())?;
        }
        builder
            .commit_from_memory(network)
            .map_err(|e| e.to_string())
    }
}

struct Started {
    api: ort::sys::OrtApi,
    kind: EngineKind,
    name: String,
    origin: String,
}

fn tract(why: &str) -> Started {
    Started {
        api: ort_tract::api(),
        kind: EngineKind::Tract,
        name: "tract".to_owned(),
        origin: format!(", compiled in ({why})"),
    }
}

fn native(named: Option<OsString>) -> Result<Started, InferenceError> {
    if let Some(path) = named {
        return open(Path::new(&path)).map_err(|reason| InferenceError::LibraryUnusable { reason });
    }
    let mut tried = Vec::new();
    for path in usual_places() {
        match open(&path) {
            Ok(found) => return Ok(found),
            Err(reason) => tried.push(reason),
        }
    }
    Err(InferenceError::NativeMissing {
        tried: tried.join("; "),
    })
}

fn open(path: &Path) -> Result<Started, String> {
    let api = loader::load(path)?;
    Ok(Started {
        api: api.table,
        kind: EngineKind::Native,
        name: format!("ONNX Runtime {}", api.version),
        origin: format!(" from {}", path.display()),
    })
}

/// Files next to the executable first, then names that the system's loader resolves.
fn usual_places() -> Vec<PathBuf> {
    let stem = format!("{DLL_PREFIX}onnxruntime");
    let library = format!("{stem}{DLL_SUFFIX}");
    let mut places = std::env::current_exe()
        .ok()
        .and_then(|exe| exe.parent().map(|folder| libraries_in(folder, &library)))
        .unwrap_or_default();
    places.push(PathBuf::from(&library));
    if DLL_SUFFIX == ".so" {
        places.push(PathBuf::from(format!("{library}.1")));
    }
    places
}

/// Libraries of that name in a folder, those with a version appended included: the ones in Python
/// packages are called `libonnxruntime.so.1.31.1`.
fn libraries_in(folder: &Path, library: &str) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut found: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            path.file_name()
                .is_some_and(|name| name.to_string_lossy().starts_with(library))
        })
        .collect();
    found.sort();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versioned_libraries_next_to_the_executable_are_found() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for name in [
            "libonnxruntime.so.1.31.1",
            "libonnxruntime_providers_shared.so",
        ] {
            std::fs::write(folder.path().join(name), b"").expect("writing a file");
        }
        let found = libraries_in(folder.path(), "libonnxruntime.so");
        assert_eq!(found, [folder.path().join("libonnxruntime.so.1.31.1")]);
    }

    #[test]
    fn a_named_library_that_is_not_there_is_an_error_and_no_fall_back() {
        let error = native(Some(OsString::from("/nowhere/libonnxruntime.so"))).err();
        assert!(
            matches!(&error, Some(InferenceError::LibraryUnusable { reason })
                if reason.contains("/nowhere/libonnxruntime.so")),
            "{error:?}"
        );
    }

    #[test]
    fn engines_go_by_their_names() {
        for name in ["tract", "embedded"] {
            let choice = name.parse::<EngineChoice>().ok();
            assert_eq!(choice, Some(EngineChoice::Tract), "{name}");
        }
        assert!("tracts".parse::<EngineChoice>().is_err());
    }
}
