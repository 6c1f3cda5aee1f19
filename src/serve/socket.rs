//! One connection: the network on one side, a thread that computes on the other.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, close_code};
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, timeout, timeout_at};

use super::{ServeLimits, Service, Stop};

/// A longer time than a server is up, and one that can be added to any.
const LONGEST_IDLE: Duration = Duration::from_hours(24 * 365 * 30);

/// A message, and where its answer goes.
struct Job {
    message: Bytes,
    answer: oneshot::Sender<Result<Vec<u8>, String>>,
}

/// A conversation that waits for a thread.
pub(super) struct Opening {
    jobs: mpsc::Receiver<Job>,
}

/// The network's end of a thread that computes.
pub(super) struct Worker {
    jobs: mpsc::Sender<Job>,
}

/// Both ends of a conversation.
pub(super) fn opening() -> (Opening, Worker) {
    let (sender, receiver) = mpsc::channel(1);
    (Opening { jobs: receiver }, Worker { jobs: sender })
}

impl Opening {
    /// Answers messages until the connection is gone. A panic ends this conversation alone.
    pub(super) fn work(mut self, service: &dyn Service) {
        let begun = catch_unwind(AssertUnwindSafe(|| service.converse()));
        let Ok(mut conversation) = begun else {
            return;
        };
        while let Some(job) = self.jobs.blocking_recv() {
            let answer = || conversation.answer(&job.message);
            let Ok(answer) = catch_unwind(AssertUnwindSafe(answer)) else {
                return;
            };
            if job.answer.send(answer).is_err() {
                return;
            }
        }
    }
}

impl Worker {
    /// The answer; none when the thread is gone.
    async fn ask(&self, message: Bytes) -> Option<Result<Vec<u8>, String>> {
        let (answer, answered) = oneshot::channel();
        self.jobs.send(Job { message, answer }).await.ok()?;
        answered.await.ok()
    }

    /// Returns once the thread is gone, or there was none to be had.
    async fn gone(&self) {
        self.jobs.closed().await;
    }
}

/// How a conversation ends from the server's side.
struct Farewell {
    code: u16,
    reason: &'static str,
}

const STOPPING: Farewell = Farewell {
    code: close_code::AWAY,
    reason: "the server stops",
};
const IDLE: Farewell = Farewell {
    code: close_code::POLICY,
    reason: "nothing was sent for too long",
};
const TOO_LARGE: Farewell = Farewell {
    code: close_code::SIZE,
    reason: "the message is too large, or no WebSocket frame",
};
const BROKEN: Farewell = Farewell {
    code: close_code::ERROR,
    reason: "the server failed at a message, or has no thread left for this connection",
};

/// Talks until the client leaves, is refused more, or the server stops.
pub(super) async fn talk(
    mut socket: WebSocket,
    metadata: &[u8],
    worker: Worker,
    limits: &ServeLimits,
    stop: &Stop,
) {
    let greeting = Message::Binary(Bytes::copy_from_slice(metadata));
    if send(&mut socket, greeting, limits.patience).await.is_none() {
        return;
    }
    // A library's own pings say nothing, so only messages put it off.
    let mut deadline = idle_from_now(limits);
    let farewell = loop {
        let received = tokio::select! {
            received = timeout_at(deadline, socket.recv()) => received,
            () = stop.asked() => break STOPPING,
            () = worker.gone() => break BROKEN,
        };
        let message = match received {
            Err(_) => break IDLE,
            Ok(None) => return,
            Ok(Some(Err(_))) => break TOO_LARGE,
            Ok(Some(Ok(message))) => message,
        };
        let answer = match message {
            Message::Binary(message) => match worker.ask(message).await {
                None => break BROKEN,
                Some(Ok(answer)) => Message::Binary(answer.into()),
                Some(Err(reason)) => Message::Text(reason.into()),
            },
            Message::Text(_) => Message::Text(Utf8Bytes::from_static(
                "the message is text: send msgpack in binary messages, as openpi-client does",
            )),
            Message::Close(_) => {
                // The answer, which its client waits for, goes out where the next message is looked for.
                let _ = timeout(limits.patience, socket.recv()).await;
                return;
            }
            Message::Ping(_) | Message::Pong(_) if Instant::now() >= deadline => break IDLE,
            Message::Ping(_) | Message::Pong(_) => continue,
        };
        if send(&mut socket, answer, limits.patience).await.is_none() {
            return;
        }
        deadline = idle_from_now(limits);
    };
    let close = Message::Close(Some(CloseFrame {
        code: farewell.code,
        reason: Utf8Bytes::from_static(farewell.reason),
    }));
    let _ = send(&mut socket, close, limits.patience).await;
}

/// When a client that sends nothing from now on has been idle for too long.
fn idle_from_now(limits: &ServeLimits) -> Instant {
    Instant::now() + limits.idle.min(LONGEST_IDLE)
}

/// Sends, unless the client does not take it in time.
async fn send(socket: &mut WebSocket, message: Message, patience: Duration) -> Option<()> {
    timeout(patience, socket.send(message)).await.ok()?.ok()
}
