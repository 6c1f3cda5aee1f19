use std::fmt;
use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use axum::Router;
use axum::extract::{State, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};

use super::access::Access;
use super::socket::{self, Opening};
use super::{ApiKey, ServeError, ServeLimits, Service, Stop};

/// Threads that talk to the network; the work is done on a thread a connection.
const NETWORK_THREADS: usize = 2;
/// Connections beyond those in conversation: health checks, and clients that are told that it is full.
const SPARE_CONNECTIONS: usize = 32;
/// Until a connection is asked for again where the system has none to give, such as without a free file descriptor.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// A server that has its port, and speaks once it is [run](Self::run).
///
/// A WebSocket on `/` is a conversation; `GET /healthz` answers `OK`.
pub struct Server {
    runtime: Runtime,
    listener: tokio::net::TcpListener,
    address: SocketAddr,
    access: Access,
    limits: ServeLimits,
}

/// What all connections share.
#[derive(Clone)]
struct Shared {
    access: Access,
    limits: ServeLimits,
    conversations: Arc<Semaphore>,
    openings: mpsc::UnboundedSender<Opening>,
    metadata: Arc<[u8]>,
    stop: Stop,
}

impl Server {
    /// Takes a port; 0 takes a free one.
    ///
    /// # Errors
    /// [`ServeError::KeyNeeded`] for an address that other machines reach without a key,
    /// [`ServeError::Bind`] when the port cannot be had, [`ServeError::System`] when the system gives no threads.
    pub fn bind(
        address: SocketAddr,
        key: Option<ApiKey>,
        limits: ServeLimits,
    ) -> Result<Self, ServeError> {
        let access = Access::new(address, key)?;
        let failed = |e: std::io::Error| ServeError::Bind {
            address,
            reason: e.to_string(),
        };
        let runtime = Builder::new_multi_thread()
            .worker_threads(NETWORK_THREADS)
            .enable_all()
            .build()
            .map_err(ServeError::System)?;
        let listener = TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let listener = {
            let _inside = runtime.enter();
            tokio::net::TcpListener::from_std(listener).map_err(failed)?
        };
        Ok(Self {
            runtime,
            listener,
            address,
            access,
            limits,
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Stops when the process is asked to end: SIGINT (Ctrl-C), and SIGTERM where there is such.
    ///
    /// # Errors
    /// [`ServeError::System`] when the system does not let signals be caught.
    pub fn stop_on_signals(&self, stop: &Stop) -> Result<(), ServeError> {
        let _inside = self.runtime.enter();
        let signals = signals().map_err(ServeError::System)?;
        let stop = stop.clone();
        self.runtime.spawn(async move {
            signals.await;
            stop.stop();
        });
        Ok(())
    }

    /// Serves until it is stopped, and returns once the conversations that were going on have had their last
    /// answer. It has an asynchronous runtime of its own: a program that has one, too, calls this on a thread apart.
    ///
    /// # Panics
    /// If it is called within an asynchronous runtime.
    pub fn run(self, service: &dyn Service, stop: &Stop) {
        let (openings, mut opened) = mpsc::unbounded_channel();
        let shared = Shared {
            access: self.access,
            limits: self.limits,
            conversations: Arc::new(Semaphore::new(self.limits.connections)),
            openings,
            metadata: service.metadata().into(),
            stop: stop.clone(),
        };
        self.runtime.spawn(listen(self.listener, shared));
        // The channel closes once the listener and all connections are gone.
        thread::scope(|scope| {
            while let Some(opening) = opened.blocking_recv() {
                // Without a thread the opening is dropped, which ends its connection alone.
                let work = move || opening.work(service);
                let _ = thread::Builder::new().spawn_scoped(scope, work);
            }
        });
        self.runtime.shutdown_timeout(self.limits.patience);
    }
}

impl fmt::Debug for Server {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Server")
            .field("address", &self.address)
            .field("limits", &self.limits)
            .finish_non_exhaustive()
    }
}

#[cfg(unix)]
fn signals() -> std::io::Result<impl Future<Output = ()>> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
    })
}

#[cfg(not(unix))]
fn signals() -> std::io::Result<impl Future<Output = ()>> {
    Ok(async {
        let _ = tokio::signal::ctrl_c().await;
    })
}

async fn listen(listener: tokio::net::TcpListener, shared: Shared) {
    let limits = shared.limits;
    let stop = shared.stop.clone();
    let connections = Arc::new(Semaphore::new(limits.connections + SPARE_CONNECTIONS));
    let router = Router::new()
        .route("/healthz", get(|| async { "OK\n" }))
        .route("/", get(converse))
        .with_state(shared);
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = stop.asked() => return,
        };
        let stream = match accepted {
            Ok((stream, _)) => stream,
            // A client that is gone before it was greeted is no reason to stop.
            Err(e) if is_of_client(e.kind()) => continue,
            Err(_) => {
                tokio::select! {
                    () = tokio::time::sleep(ACCEPT_PAUSE) => {}
                    () = stop.asked() => return,
                }
                continue;
            }
        };
        let Ok(place) = Arc::clone(&connections).try_acquire_owned() else {
            continue;
        };
        let _ = stream.set_nodelay(true);
        let service = TowerToHyperService::new(router.clone());
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(limits.patience)
            .serve_connection(TokioIo::new(stream), service)
            .with_upgrades();
        let stop = stop.clone();
        tokio::spawn(async move {
            let _place = place;
            tokio::select! {
                _ = connection => {}
                () = stop.asked() => {}
            }
        });
    }
}

/// Whether a connection could not be taken for a reason that lies with its client.
fn is_of_client(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::ConnectionAborted | ErrorKind::ConnectionReset | ErrorKind::ConnectionRefused
    )
}

/// A request for a conversation.
async fn converse(
    State(shared): State<Shared>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, axum::extract::ws::rejection::WebSocketUpgradeRejection>,
) -> Response {
    if let Some((status, reason)) = shared.access.refusal(&headers) {
        let status = StatusCode::from_u16(status).unwrap_or(StatusCode::FORBIDDEN);
        return (status, reason).into_response();
    }
    let Ok(upgrade) = upgrade else {
        let reason = "a policy server: connect with a WebSocket, such as openpi-client's WebsocketClientPolicy\n";
        return (StatusCode::UPGRADE_REQUIRED, reason).into_response();
    };
    let Ok(place) = Arc::clone(&shared.conversations).try_acquire_owned() else {
        let reason = format!("all {} connections are taken\n", shared.limits.connections);
        return (StatusCode::SERVICE_UNAVAILABLE, reason).into_response();
    };
    let bytes = shared.limits.message_bytes;
    upgrade
        .max_message_size(bytes)
        .max_frame_size(bytes)
        .on_upgrade(move |socket| talk(socket, shared, place))
}

async fn talk(socket: axum::extract::ws::WebSocket, shared: Shared, place: OwnedSemaphorePermit) {
    let (opening, worker) = socket::opening();
    if shared.openings.send(opening).is_ok() {
        let limits = shared.limits;
        socket::talk(socket, &shared.metadata, worker, &limits, &shared.stop).await;
    }
    drop(place);
}
