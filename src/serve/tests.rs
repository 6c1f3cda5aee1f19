//! Services and server, over a corridor that a test can check by hand.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::*;
use crate::environment::{Environment, EnvironmentError};
use crate::graph::fakes::{Oracle, PixelEncoder, forward};
use crate::model::{ActionDistribution, LocalPolicy, ModelError};
use crate::planner::fakes::corridor;
use crate::rollout::{Controller, RolloutModel, RolloutOptions};
use crate::trajectory::{Action, ActionSpace, CameraSpec, Image, Observation};

/// Goes on, whatever it sees.
struct Onward;

impl LocalPolicy for Onward {
    fn act(&self, _: &[f32], _: &[f32]) -> Result<ActionDistribution, ModelError> {
        Ok(ActionDistribution {
            heads: vec![vec![1.0]],
        })
    }
}

/// Calls `with` with a service over the corridor.
fn with_policy(with: impl FnOnce(&PolicyService<'_>)) {
    let (eye, oracle) = (PixelEncoder::new(5), Oracle::new(5, forward));
    let model = RolloutModel {
        encoder: &eye,
        traversability: &oracle,
        policy: &Onward,
        landmarks: None,
    };
    let controller = Controller::new(
        model,
        corridor(&["first", "second"]),
        RolloutOptions::default(),
    );
    let label = PolicyLabel {
        name: "corridor".to_owned(),
        ..PolicyLabel::default()
    };
    with(&PolicyService::new(
        controller.expect("the graph fits"),
        &label,
    ));
}

#[derive(Serialize)]
struct Seen<'a> {
    eye: ArrayOf<'a>,
    reset: bool,
}

fn seen_at(x: u8, reset: bool) -> Vec<u8> {
    let pixel = [x, 0, 0];
    pack(&Seen {
        eye: ArrayOf::Bytes(&pixel, vec![1, 1, 3]),
        reset,
    })
}

/// The parts of an answer that do not tell the time.
fn told(answer: &[u8]) -> Vec<String> {
    let answer = Message::read(answer).expect("an answer is a message");
    ["actions", "step", "stage", "done", "end", "goal", "events"]
        .map(|part| format!("{part}: {:?}", answer.get(part)))
        .to_vec()
}

#[test]
fn metadata_says_what_a_client_needs_to_know() {
    with_policy(|service| {
        let bytes = service.metadata();
        let metadata = Message::read(&bytes).expect("metadata is a message");
        assert_eq!(
            metadata.get("composition"),
            Some(&Message::Text("corridor"))
        );
        let Some(Message::List(cameras)) = metadata.get("cameras") else {
            panic!("{metadata:?}")
        };
        assert_eq!(cameras[0].get("name"), Some(&Message::Text("eye")));
        let Some(Message::List(subgoals)) = metadata.get("subgoals") else {
            panic!("{metadata:?}")
        };
        assert_eq!(subgoals.len(), 2);
        for part in [
            "action_space",
            "tasks",
            "step_limit",
            "model",
            "graphs",
            "engine",
        ] {
            assert!(metadata.get(part).is_some(), "{part}");
        }
    });
}

#[test]
fn an_episode_reaches_its_subgoals_and_stays_over_until_it_is_reset() {
    with_policy(|service| {
        let mut robot = service.converse();
        let mut events = Vec::new();
        let mut over = Vec::new();
        for x in (0..17).chain([16; 8]) {
            let bytes = robot.answer(&seen_at(x, x == 0)).expect("an observation");
            let answer = Message::read(&bytes).expect("an answer");
            if let Some(Message::List(news)) = answer.get("events") {
                events.extend(
                    news.iter()
                        .filter_map(|e| match e.get("subgoal")?.get("name")? {
                            Message::Text(name) => Some((*name).to_owned()),
                            _ => None,
                        }),
                );
            }
            if answer.get("done") == Some(&Message::Bool(true)) {
                assert_eq!(answer.get("end"), Some(&Message::Text("finished")));
                // This robot has no primitive that says so.
                let none = NdArray {
                    dtype: "<f4",
                    shape: vec![0, 1],
                    data: &[],
                };
                assert_eq!(answer.get("actions"), Some(&Message::Array(none)));
                over = told(&bytes);
                break;
            }
        }
        assert_eq!(events, ["first", "second"]);
        assert!(!over.is_empty(), "the episode goes on for ever");
        let still = told(&robot.answer(&seen_at(3, false)).expect("an observation"));
        assert_eq!(still[..4], over[..4]);
        let again = robot.answer(&seen_at(0, true)).expect("an observation");
        let again = Message::read(&again).expect("an answer");
        assert_eq!(again.get("done"), Some(&Message::Bool(false)));
        assert_eq!(again.get("step"), Some(&Message::Integer(0)));
    });
}

#[test]
fn conversations_know_nothing_of_each_other() {
    with_policy(|service| {
        let walk = |robot: &mut dyn Conversation, x: u8| {
            told(&robot.answer(&seen_at(x, x == 0)).expect("an observation"))
        };
        let mut alone = service.converse();
        let expected: Vec<_> = (0..12).map(|x| walk(alone.as_mut(), x)).collect();
        let (mut one, mut other) = (service.converse(), service.converse());
        for (x, expected) in (0..12).zip(expected) {
            walk(other.as_mut(), 15 - x);
            assert_eq!(walk(one.as_mut(), x), expected);
        }
    });
}

#[test]
fn a_message_that_is_refused_leaves_the_episode_as_it_was() {
    with_policy(|service| {
        let mut robot = service.converse();
        let mut undisturbed = service.converse();
        for x in 0..12 {
            let message = seen_at(x, false);
            let expected = undisturbed.answer(&message).expect("an observation");
            let error = robot
                .answer(&message[..message.len() - 1])
                .expect_err("cut off");
            assert!(error.contains("cannot be read"), "{error}");
            let error = robot.answer(&pack(&["x"])).expect_err("no observation");
            assert!(error.contains("map of arrays"), "{error}");
            let answer = robot.answer(&message).expect("an observation");
            assert_eq!(told(&answer), told(&expected));
        }
    });
}

/// Counts what it is told to add.
struct Counter(f32);

impl Environment for Counter {
    fn cameras(&self) -> Vec<CameraSpec> {
        self.see().cameras()
    }

    fn action_space(&self) -> ActionSpace {
        ActionSpace::Continuous {
            names: vec!["x".to_owned(), "y".to_owned()],
        }
    }

    fn reset(&mut self, seed: u64) -> Result<Observation, EnvironmentError> {
        self.0 = seed as f32;
        Ok(self.see())
    }

    fn step(&mut self, action: &Action) -> Result<Observation, EnvironmentError> {
        if let Action::Continuous(values) = action {
            self.0 += values.iter().sum::<f32>();
        }
        Ok(self.see())
    }
}

impl Counter {
    fn see(&self) -> Observation {
        let image = Image::new(1, 1, vec![self.0 as u8; 3]).expect("one pixel");
        Observation::new([("eye".to_owned(), image)])
    }
}

impl Simulated for Counter {
    fn outcomes(&self) -> Vec<(String, String)> {
        let outcomes = [("ten", "reached"), ("six", "missed"), ("ten", "missed")];
        let owned = |(name, outcome): (&str, &str)| (format!("count/{name}"), outcome.to_owned());
        outcomes.map(owned).to_vec()
    }

    fn has_succeeded(&self) -> bool {
        self.0 >= 10.0
    }
}

#[derive(Serialize)]
struct Reset {
    reset: bool,
    seed: i64,
}

#[derive(Serialize)]
struct Act<A> {
    action: A,
}

#[test]
fn a_simulated_robot_is_reset_and_acts() {
    let service = EnvironmentService::new("counter", || Box::new(Counter(0.0)));
    let mut world = service.converse();
    let early = world.answer(&pack(&Act { action: [1, 2] }));
    assert!(early.expect_err("not begun").contains("has not begun"));
    let reset = Reset {
        reset: true,
        seed: 5,
    };
    world.answer(&pack(&reset)).expect("a reset");
    // As a list, and as the row of an array that a policy answers with.
    world
        .answer(&pack(&Act { action: [1.0, 2.0] }))
        .expect("an action");
    let row = ArrayOf::Floats(vec![3.0, -1.0], vec![1, 2]);
    let bytes = world
        .answer(&pack(&Act { action: row }))
        .expect("an action");
    let answer = Message::read(&bytes).expect("an answer");
    assert_eq!(answer.get("step"), Some(&Message::Integer(2)));
    assert_eq!(answer.get("success"), Some(&Message::Bool(true)));
    let outcome = |name| answer.get("subgoals").and_then(|s| s.get(name));
    assert_eq!(outcome("count/ten"), Some(&Message::Text("reached")));
    assert_eq!(outcome("count/ten#2"), Some(&Message::Text("missed")));
    let metadata = service.metadata();
    let metadata = Message::read(&metadata).expect("metadata");
    let names = ["count/ten", "count/six", "count/ten#2"].map(Message::Text);
    assert_eq!(
        metadata.get("subgoals"),
        Some(&Message::List(names.to_vec()))
    );
    let seen = answer.get("observation").and_then(|o| o.get("eye"));
    let array = NdArray {
        dtype: "|u1",
        shape: vec![1, 1, 3],
        data: &[10; 3],
    };
    assert_eq!(seen, Some(&Message::Array(array)));
}

#[test]
fn actions_that_do_not_fit_are_refused_with_what_does() {
    let service = EnvironmentService::new("counter", || Box::new(Counter(0.0)));
    let mut world = service.converse();
    let reset = Reset {
        reset: true,
        seed: 0,
    };
    world.answer(&pack(&reset)).expect("a reset");
    for (message, expected) in [
        (pack(&Act { action: [1.0] }), "send 2 finite numbers"),
        (
            pack(&Act {
                action: [1.0, f64::NAN],
            }),
            "send 2 finite numbers",
        ),
        (
            pack(&Act {
                action: [1.0, 1e300],
            }),
            "send 2 finite numbers",
        ),
        (
            pack(&Act { action: "forward" }),
            "is the text 'forward': send 2",
        ),
        (pack(&Act { action: true }), "is a truth value: send 2"),
        (
            pack(&Reset {
                reset: true,
                seed: -1,
            }),
            "whole number from 0",
        ),
        (pack(&["reset"]), "neither `reset` nor `action`"),
    ] {
        let error = world.answer(&message).expect_err(expected);
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
}

/// Runs a server over the corridor while `with` talks to it.
fn while_serving(limits: ServeLimits, with: impl FnOnce(SocketAddr)) {
    with_policy(|service| while_serving_with(service, limits, with));
}

/// Runs a server of a service while `with` talks to it.
fn while_serving_with(service: &dyn Service, limits: ServeLimits, with: impl FnOnce(SocketAddr)) {
    let address: SocketAddr = "127.0.0.1:0".parse().expect("an address");
    let server = Server::bind(address, None, limits).expect("a free port");
    let (address, stop) = (server.address(), Stop::default());
    thread::scope(|scope| {
        let serving = scope.spawn(|| server.run(service, &stop));
        with(address);
        stop.stop();
        serving
            .join()
            .expect("a server that stops when it is asked to");
    });
}

/// A conversation that a client has asked for and been granted.
fn conversation(address: SocketAddr) -> TcpStream {
    let mut stream = TcpStream::connect(address).expect("a server");
    let patience = Some(Duration::from_secs(20));
    stream.set_read_timeout(patience).expect("a time limit");
    let request = "GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
                   Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
    stream
        .write_all(request.as_bytes())
        .expect("a server that listens");
    let mut head = [0; 12];
    stream.read_exact(&mut head).expect("an answer");
    assert_eq!(&head, b"HTTP/1.1 101");
    stream
}

/// Reads for a moment; whether the server has closed the connection.
fn is_closed(stream: &mut TcpStream) -> bool {
    let moment = Some(Duration::from_millis(50));
    stream.set_read_timeout(moment).expect("a time limit");
    match stream.read(&mut [0; 4096]) {
        Ok(bytes) => bytes == 0,
        Err(e) => !matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
    }
}

#[test]
fn pings_do_not_keep_a_connection_that_sends_nothing() {
    let limits = ServeLimits {
        idle: Duration::from_millis(400),
        ..ServeLimits::default()
    };
    while_serving(limits, |address| {
        let begun = Instant::now();
        let mut stream = conversation(address);
        while !is_closed(&mut stream) {
            assert!(begun.elapsed() < Duration::from_secs(20), "it stays open");
            // Empty, with the mask that a client's frames must have; no matter if the server is gone by now.
            let _ = stream.write_all(&[0x89, 0x80, 0, 0, 0, 0]);
        }
        assert!(begun.elapsed() >= limits.idle);
    });
}

#[test]
fn a_client_that_takes_its_leave_is_answered() {
    while_serving(ServeLimits::default(), |address| {
        let mut stream = conversation(address);
        // Code 1000, with the mask that a client's frames must have.
        let leave = [0x88, 0x82, 0, 0, 0, 0, 3, 232];
        stream.write_all(&leave).expect("a server that listens");
        let mut rest = Vec::new();
        stream.read_to_end(&mut rest).expect("an end");
        assert!(rest.ends_with(&[0x88, 2, 3, 232]), "{rest:?}");
    });
}

#[test]
fn a_time_without_end_is_no_idle_time() {
    let limits = ServeLimits {
        idle: Duration::MAX,
        ..ServeLimits::default()
    };
    while_serving(limits, |address| {
        let mut stream = conversation(address);
        for _ in 0..4 {
            assert!(!is_closed(&mut stream));
        }
    });
}

/// Falls over before it has heard anything.
struct Fainting;

impl Service for Fainting {
    fn metadata(&self) -> Vec<u8> {
        pack(&["fainting"])
    }

    fn converse(&self) -> Box<dyn Conversation + Send + '_> {
        panic!("this service has no conversations")
    }
}

#[test]
fn a_conversation_that_cannot_begin_ends_alone() {
    while_serving_with(&Fainting, ServeLimits::default(), |address| {
        let mut stream = conversation(address);
        let begun = Instant::now();
        while !is_closed(&mut stream) {
            assert!(begun.elapsed() < Duration::from_secs(20), "it stays open");
        }
        let request = "GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
        assert!(answer_to(address, request).ends_with("OK\n"));
    });
}

/// What a server sends back to these bytes until it closes the connection.
fn answer_to(address: SocketAddr, request: &str) -> String {
    let mut stream = TcpStream::connect(address).expect("a server");
    let patience = Some(Duration::from_secs(20));
    stream.set_read_timeout(patience).expect("a time limit");
    stream
        .write_all(request.as_bytes())
        .expect("a server that listens");
    let mut answer = String::new();
    stream
        .read_to_string(&mut answer)
        .expect("an answer that ends");
    answer
}

#[test]
fn health_and_refusals_over_plain_http() {
    while_serving(ServeLimits::default(), |address| {
        let get = |path: &str, more: &str| {
            let request =
                format!("GET {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n{more}\r\n");
            answer_to(address, &request)
        };
        assert!(get("/healthz", "").ends_with("OK\n"));
        assert!(get("/", "").contains("426"));
        assert!(get("/", "Origin: http://example.com\r\n").contains("403"));
        assert!(get("/metrics", "").contains("404"));
    });
}

#[test]
fn a_request_that_never_ends_is_given_up() {
    let limits = ServeLimits {
        patience: Duration::from_millis(200),
        ..ServeLimits::default()
    };
    while_serving(limits, |address| {
        // Returns when the server closes the connection; the read would fail otherwise.
        answer_to(address, "GET / HTTP/1.1\r\nHost:");
    });
}

#[test]
fn a_port_that_is_taken_is_named() {
    while_serving(ServeLimits::default(), |address| {
        let error = Server::bind(address, None, ServeLimits::default()).err();
        let error = error.expect("the port is taken").to_string();
        assert!(error.contains(&address.to_string()), "{error}");
        assert!(error.contains("--bind"), "{error}");
    });
}
