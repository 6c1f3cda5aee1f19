//! One connection: the network on one side, a thread that computes on the other.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, close_code};
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;

use super::{ServeLimits, Service, Stop};

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
        let mut conversation = service.converse();
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
    reason: "the server failed at this message",
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
    let farewell = loop {
        let received = tokio::select! {
            received = timeout(limits.idle, socket.recv()) => received,
            () = stop.asked() => break STOPPING,
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
            Message::Close(_) => return,
            Message::Ping(_) | Message::Pong(_) => continue,
        };
        if send(&mut socket, answer, limits.patience).await.is_none() {
            return;
        }
    };
    let close = Message::Close(Some(CloseFrame {
        code: farewell.code,
        reason: Utf8Bytes::from_static(farewell.reason),
    }));
    let _ = send(&mut socket, close, limits.patience).await;
}

/// Sends, unless the client does not take it in time.
async fn send(socket: &mut WebSocket, message: Message, patience: Duration) -> Option<()> {
    timeout(patience, socket.send(message)).await.ok()?.ok()
}
