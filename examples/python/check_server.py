"""Starts both servers and tries them as clients do, honest ones and others. Exits with 1 at the first fault.

    python examples/python/check_server.py target/release/catena
"""

import contextlib
import http.client
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

import msgpack
import numpy as np
import websockets.exceptions
import websockets.sync.client
from bedroom_env import BedroomEnv
from drive import drive
from many_clients import measure, record
from openpi_client import msgpack_numpy
from openpi_client.websocket_client_policy import WebsocketClientPolicy

ROOT = pathlib.Path(__file__).resolve().parents[2]
COMPOSITION = "tasks/sequences/sock_then_trash.yaml"
HOST = "127.0.0.1"
SEED = 111


@contextlib.contextmanager
def serving(catena, command, *options, composition=COMPOSITION, root=ROOT):
    """A server on a free port, ended by SIGTERM, which must be enough."""
    words = [catena, command, composition, "--root", str(root), "--bind", f"{HOST}:0", *options]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        for line in process.stdout:
            if line.startswith("serving"):
                break
        else:
            raise SystemExit(f"catena {command} did not come up: {process.wait()}")
        yield int(line.split("//")[1].split(";")[0].rsplit(":", 1)[1]), process
    finally:
        process.send_signal(signal.SIGTERM)
        code = process.wait(timeout=30)
    expect(code == 0, f"catena {command} ends by itself after SIGTERM, with code {code}")


def expect(holds, what):
    print(("ok   " if holds else "FAIL ") + what, flush=True)
    if not holds:
        raise SystemExit(1)


def connect(port, **options):
    return websockets.sync.client.connect(f"ws://{HOST}:{port}", compression=None, max_size=None, **options)


def refused(port, headers):
    """The status that a connection with these headers is refused with."""
    try:
        with connect(port, additional_headers=headers):
            pass
    except websockets.exceptions.InvalidStatus as error:
        return error.response.status_code
    return None


def answer_to(port, message):
    """What a new connection answers to one message: a text, a map, or how it was closed."""
    with connect(port) as connection:
        connection.recv()
        try:
            connection.send(message)
            answer = connection.recv(timeout=20)
        except websockets.exceptions.ConnectionClosed as closed:
            return closed
    return answer if isinstance(answer, str) else msgpack_numpy.unpackb(answer)


def an_episode(policy_port, robot_port):
    policy = WebsocketClientPolicy(HOST, policy_port)
    metadata = policy.get_server_metadata()
    names = [camera["name"] for camera in metadata["cameras"]]
    expect(names == ["head", "wrist"], f"metadata names the cameras: {names}")
    expect(len(metadata["model"]) == 64 and len(metadata["graphs"]) == 2, "metadata has digests of model and graphs")
    robot = BedroomEnv(HOST, robot_port)
    info, answers = drive(policy, robot, SEED, tell=lambda message: print("     " + message))
    expect(answers[-1]["done"] and answers[-1]["end"] == "finished", "an episode from Python ends by itself")
    expect(info["success"], f"its subgoals are reached in order: {info['subgoals']}")
    expect(answers[0]["actions"].shape == (1, 1), "actions have the shape [1, dimensions]")
    expect({"task", "trajectory", "step"} <= answers[0]["goal"].keys(), "an answer names its goal state")
    expect(any(event["event"] == "subgoal_reached" for a in answers for event in a["events"]), "events are typed")
    again = policy.infer({name: np.zeros((90, 160, 3), np.uint8) for name in names})
    expect(again["done"], "an episode that is over stays so until it is reset")

    # Over the wire or in one process, the same seed is the same episode.
    with tempfile.TemporaryDirectory() as folder:
        words = [CATENA, "run", COMPOSITION, "--root", str(ROOT), "--seed", str(SEED), "--out", folder]
        subprocess.run(words, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
        summary = json.loads(pathlib.Path(folder, "summary.json").read_text())
    steps = summary["result"]["steps"]
    expect(answers[-1]["step"] == steps, f"`catena run` takes as many steps: {steps}")
    robot.close()


def many(policy_port, robot_port):
    seen = record(HOST, policy_port, robot_port, SEED)
    rows, failures, _ = measure(HOST, policy_port, seen, 32)
    expect(not failures, f"32 clients at once get through {failures[:1]}")
    actions = {tuple(tuple(map(tuple, row[2])) for row in client) for client in rows}
    expect(len(actions) == 1, "all of them get the same actions: none sees another's episode")


def clients_that_lie(port):
    frames = {"head": np.zeros((90, 160, 3), np.uint8), "wrist": np.zeros((90, 160, 3), np.uint8)}
    pack = msgpack_numpy.packb
    large = {name: np.zeros((480, 640, 3), np.uint8) for name in frames}
    expect("actions" in answer_to(port, pack(large)), "images of another size are resized")
    cases = [
        ("a missing camera", pack({"head": frames["head"]}), "no camera 'wrist'"),
        ("a camera of floats", pack({**frames, "head": np.zeros((90, 160, 3), np.float32)}), "send uint8"),
        ("channels first", pack({**frames, "head": np.zeros((3, 90, 160), np.uint8)}), "[height, width, 3]"),
        ("a list", pack([1, 2]), "a map of arrays"),
        ("no msgpack", b"\xc1\xc1\xc1", "cannot be read"),
        ("nothing", b"", "cannot be read"),
        ("a text", "hello", "is text"),
        ("a reset that is a text", pack({**frames, "reset": "yes"}), "send true or false"),
        ("a negative seed", pack({**frames, "reset": True, "seed": -1}), "whole number from 0"),
        ("a promise of 4 GB", b"\x81\xa4head\xc6\xff\xff\xff\xff", "cannot be read"),
        ("a list of a million", b"\xdd\x00\x0f\x42\x40" + b"\xc0" * 1_000_000, "more than"),
        ("deep nesting", b"\x91" * 100_000, "depth"),
        ("pickled objects", msgpack.packb({"head": {b"__ndarray__": True, b"data": b"x" * 8, b"dtype": "|O8", b"shape": [1]}}), "send uint8"),
    ]
    for what, message, expected in cases:
        answer = answer_to(port, message)
        expect(isinstance(answer, str) and expected in answer, f"{what}: {str(answer)[:110]}")
    closed = answer_to(port, b"\x00" * (33 << 20))
    expect(isinstance(closed, websockets.exceptions.ConnectionClosed), "33 MiB: the connection is closed")

    # One that stops in the middle of a frame, one of a header, one that leaves without a word.
    with connect(port, close_timeout=0.1) as half, connect(port) as gone:
        half.recv()
        half.socket.sendall(b"\x82\xfe\xff")
        slow = socket.create_connection((HOST, port))
        slow.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n")
        gone.recv()
        gone.socket.shutdown(socket.SHUT_RDWR)
        expect("actions" in answer_to(port, pack(frames)), "another client notices none of it")
    answers = []
    with connect(port) as connection:
        connection.recv()
        for message in (pack({"head": frames["head"]}), pack(frames)):
            connection.send(message)
            answers.append(connection.recv(timeout=20))
    expect(isinstance(answers[0], str) and isinstance(answers[1], bytes), "a connection survives its own mistakes")
    slow.settimeout(30)
    expect(slow.recv(1000) == b"", "a request that never ends is given up")


def health(port):
    connection = http.client.HTTPConnection(HOST, port, timeout=10)
    connection.request("GET", "/healthz")
    answer = connection.getresponse()
    expect(answer.status == 200 and answer.read() == b"OK\n", "GET /healthz answers OK")
    connection.request("GET", "/")
    expect(connection.getresponse().status in (400, 426), "a browser is told what this is")
    expect(refused(port, {"Origin": "http://example.com"}) == 403, "a web page is refused")


def keys_and_limits(catena):
    with tempfile.NamedTemporaryFile("w", suffix=".key") as file:
        file.write("a-key-that-is-long-enough\n")
        file.flush()
        options = ("--api-key-file", file.name, "--max-connections", "2", "--idle-secs", "2")
        with serving(catena, "serve", *options) as (port, _):
            expect(refused(port, {}) == 401, "without the key a client is refused")
            expect(refused(port, {"Authorization": "Api-Key wrong"}) == 401, "so it is with another key")
            key = {"Authorization": "Api-Key a-key-that-is-long-enough"}
            policy = WebsocketClientPolicy(HOST, port, api_key="a-key-that-is-long-enough")
            expect("cameras" in policy.get_server_metadata(), "with it, it is let in")
            with connect(port, additional_headers=key) as second:
                second.recv()
                expect(refused(port, key) == 503, "a third of two is told that it is full")
                time.sleep(3)
                try:
                    second.recv(timeout=5)
                    closed = None
                except websockets.exceptions.ConnectionClosed as error:
                    closed = error
                expect(closed is not None and closed.rcvd.code == 1008, f"who says nothing is sent away: {closed}")
            expect(refused(port, key) is None, "and makes room")
    words = [catena, "serve", COMPOSITION, "--root", str(ROOT), "--bind", "0.0.0.0:0"]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT)
    expect(done.returncode == 1 and "--api-key-file" in done.stderr, "no open server without a key")


def a_real_arm(catena):
    """The steps of docs/your-own-robot.md, and a client for what they end in."""
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder)
        (place / "tests").symlink_to(ROOT / "tests")  # its recordings
        root = place / "examples" / "bridge"
        shutil.copytree(ROOT / "examples" / "bridge", root, ignore=shutil.ignore_patterns("out"))
        follow_the_page(catena, root)


def follow_the_page(catena, root):
    """In a copy, since whoever followed the page has a model in the folder."""
    model = str(root / "out" / "model")
    demos = [str(root / "cup.yaml"), str(root / "carrot.yaml")]
    steps = [["train", *demos, "--preset", "tiny", "--seed", "2", "--out", model]]
    for task in ("cup", "carrot"):
        steps.append(["graph", "build", str(root / "tasks" / f"{task}.yaml"), "--model", model, "--root", str(root)])
    for step in steps:
        subprocess.run([catena, *step], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    sequence = str(root / "tasks" / "sequences" / "cup_then_carrot.yaml")
    with serving(catena, "serve", composition=sequence, root=root) as (port, _):
        policy = WebsocketClientPolicy(HOST, port)
        space = policy.get_server_metadata()["action_space"]
        names = [dimension["name"] for dimension in space["dimensions"]]
        expect(names == ["x", "y", "z", "roll", "pitch", "yaw", "gripper"], f"a real arm's actions: {names}")
        image = np.random.default_rng(1).integers(0, 256, (256, 256, 3), np.uint8)
        answer = policy.infer({"observation": {"images": {"head": image}}, "reset": True})
        actions = answer["actions"]
        ranges = [(dimension["low"], dimension["high"]) for dimension in space["dimensions"]]
        inside = all(low <= value <= high for value, (low, high) in zip(actions[0], ranges))
        expect(actions.shape == (1, 7) and inside, f"one row of values in the robot's units: {actions[0].round(4)}")
        expect(answer["action"] is None, "and no primitive")


def main():
    with serving(CATENA, "serve") as (policy_port, policy), serving(CATENA, "simulate") as (robot_port, _):
        health(policy_port)
        an_episode(policy_port, robot_port)
        many(policy_port, robot_port)
        clients_that_lie(policy_port)
        with connect(policy_port) as waiting:
            waiting.recv()
            policy.send_signal(signal.SIGTERM)
            try:
                waiting.recv(timeout=10)
                code = None
            except websockets.exceptions.ConnectionClosed as closed:
                code = closed.rcvd and closed.rcvd.code
            expect(code == 1001, "SIGTERM tells clients that the server goes")
    keys_and_limits(CATENA)
    a_real_arm(CATENA)
    print("all of it holds")


if __name__ == "__main__":
    CATENA = os.path.abspath(sys.argv[1])
    main()
