"""Measures a policy server: what it adds to a step, and how it does with many clients at once.

Every client sends the observations of one recorded episode, in turn, as an episode of its own.
"""

import argparse
import statistics
import threading
import time

from bedroom_env import BedroomEnv
from drive import drive
from openpi_client.websocket_client_policy import WebsocketClientPolicy

def record(host, policy_port, robot_port, seed):
    """The observations of one episode, as the policy drives it."""
    robot = BedroomEnv(host, robot_port)
    seen = []

    class Kept:
        def reset(self, seed):
            observation, info = robot.reset(seed=seed)
            seen.append(observation)
            return observation, info

        def step(self, action):
            answer = robot.step(action)
            seen.append(answer[0])
            return answer

    drive(WebsocketClientPolicy(host, policy_port), Kept(), seed, tell=lambda _: None)
    robot.close()
    return seen


def replay(host, port, seen, rows, failures, start):
    """One client: a row of round trip, time of the library's own step, and action for every step."""
    try:
        policy = WebsocketClientPolicy(host, port)
        start.wait()
        for step, observation in enumerate(seen):
            message = {**observation, "reset": True, "seed": 0} if step == 0 else observation
            begun = time.perf_counter()
            answer = policy.infer(message)
            spent_ms = 1e3 * (time.perf_counter() - begun)
            if answer["done"]:
                break
            rows.append((spent_ms, answer["server_timing"]["step_ms"], answer["actions"].tolist()))
    except Exception as error:  # whatever it is, the client is lost
        failures.append(error)


def measure(host, port, seen, clients):
    """Rows of all clients, and the errors of those that did not get through."""
    rows, failures, start = [[] for _ in range(clients)], [], threading.Event()
    threads = [
        threading.Thread(target=replay, args=(host, port, seen, rows[i], failures, start)) for i in range(clients)
    ]
    for thread in threads:
        thread.start()
    time.sleep(1.0)
    begun = time.perf_counter()
    start.set()
    for thread in threads:
        thread.join()
    return rows, failures, time.perf_counter() - begun


def percentile(values, share):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--policy-port", type=int, default=8000)
    parser.add_argument("--robot-port", type=int, default=8001)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--clients", type=int, nargs="+", default=[1, 8, 32])
    arguments = parser.parse_args()
    seen = record(arguments.host, arguments.policy_port, arguments.robot_port, arguments.seed)
    print(f"{len(seen)} observations an episode, {sum(image.nbytes for image in seen[0].values())} bytes each\n")
    print("| clients | lost | steps a second | round trip, median | 99th percentile | the library's step, median | added, median |")
    print("|---|---|---|---|---|---|---|")
    for clients in arguments.clients:
        rows, failures, secs = measure(arguments.host, arguments.policy_port, seen, clients)
        all_rows = [row for client in rows for row in client]
        spent = [row[0] for row in all_rows]
        library = [row[1] for row in all_rows]
        added = statistics.median(row[0] - row[1] for row in all_rows)
        print(
            f"| {clients} | {len(failures)} | {len(all_rows) / secs:.0f} | {statistics.median(spent):.2f} ms "
            f"| {percentile(spent, 0.99):.2f} ms | {statistics.median(library):.2f} ms | {added:.2f} ms |"
        )
        for failure in failures[:3]:
            print(f"lost: {failure!r}")


if __name__ == "__main__":
    main()
