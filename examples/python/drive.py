"""Drives the simulated robot through one episode of a composition, over two servers:

    catena serve tasks/sequences/sock_then_trash.yaml
    catena simulate tasks/sequences/sock_then_trash.yaml
    python examples/python/drive.py --seed 111
"""

import argparse

from bedroom_env import BedroomEnv
from openpi_client.websocket_client_policy import WebsocketClientPolicy


def drive(policy, robot, seed, tell=print):
    """One episode. Returns what became of it by the simulator's truth, and all answers of the policy."""
    observation, info = robot.reset(seed=seed)
    answers = []
    while True:
        # The first observation of an episode says so; every other one is the images alone.
        first = {"reset": True, "seed": seed} if not answers else {}
        answer = policy.infer({**observation, **first})
        answers.append(answer)
        for event in answer["events"]:
            tell(event["message"])
        if answer["done"]:
            return info, answers
        # One row of actions: of a robot with primitives the index, of others a value a dimension.
        action = answer["actions"][0]
        observation, _, _, _, info = robot.step(action.item() if len(action) == 1 else action)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--policy-port", type=int, default=8000)
    parser.add_argument("--robot-port", type=int, default=8001)
    parser.add_argument("--seed", type=int, default=111)
    arguments = parser.parse_args()
    policy = WebsocketClientPolicy(arguments.host, arguments.policy_port)
    robot = BedroomEnv(arguments.host, arguments.robot_port)
    metadata = policy.get_server_metadata()
    subgoals = ", ".join(subgoal["name"] for subgoal in metadata["subgoals"])
    print(f"{metadata['composition']}: {subgoals}")
    info, answers = drive(policy, robot, arguments.seed)
    print(f"ended after {answers[-1]['step']} steps: {answers[-1]['end']}")
    for subgoal, outcome in info["subgoals"].items():
        print(f"  {subgoal:<24} {outcome}")
    robot.close()


if __name__ == "__main__":
    main()
