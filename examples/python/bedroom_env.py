"""The simulated bedroom as a Gymnasium environment, served by `catena simulate`."""

import gymnasium
import numpy as np
import websockets.sync.client
from openpi_client import msgpack_numpy


class BedroomEnv(gymnasium.Env):
    """A LoCoBot in a bedroom: images of its cameras in, one motion primitive out.

    `info["subgoals"]` and `info["success"]` are the simulator's truth, for judging a policy. No policy is
    to see them.
    """

    metadata = {"render_modes": ["rgb_array"]}

    def __init__(self, host="127.0.0.1", port=8001, render_mode=None):
        self.render_mode = render_mode
        self._socket = websockets.sync.client.connect(f"ws://{host}:{port}", compression=None, max_size=None)
        self._pack = msgpack_numpy.Packer().pack
        self.server_metadata = msgpack_numpy.unpackb(self._socket.recv())
        self.primitives = self.server_metadata["action_space"]["names"]
        self.action_space = gymnasium.spaces.Discrete(len(self.primitives))
        images = {
            camera["name"]: gymnasium.spaces.Box(0, 255, (camera["height"], camera["width"], 3), np.uint8)
            for camera in self.server_metadata["cameras"]
        }
        self.observation_space = gymnasium.spaces.Dict(images)
        self._seen = None
        self._succeeded = False

    def reset(self, *, seed=None, options=None):
        """The same seed gives the same room; without one, a room drawn from the environment's own generator."""
        super().reset(seed=seed)
        seed = int(self.np_random.integers(2**31)) if seed is None else int(seed)
        answer = self._ask({"reset": True, "seed": seed})
        return answer["observation"], self._info(answer)

    def step(self, action):
        """The reward is 1 at the step at which the last subgoal is reached in its order.

        Only the primitive `terminate` ends an episode; whoever wants a limit of steps wraps this in a `TimeLimit`.
        """
        before = self._succeeded
        answer = self._ask({"action": int(action)})
        terminated = self.primitives[int(action)] == "terminate"
        reward = float(answer["success"] and not before)
        return answer["observation"], reward, terminated, False, self._info(answer)

    def render(self):
        """All cameras side by side, as they were seen last."""
        return None if self._seen is None else np.concatenate(list(self._seen.values()), axis=1)

    def close(self):
        self._socket.close()

    def _ask(self, message):
        self._socket.send(self._pack(message))
        answer = self._socket.recv()
        if isinstance(answer, str):
            raise ValueError(answer)
        return msgpack_numpy.unpackb(answer)

    def _info(self, answer):
        self._seen = answer["observation"]
        self._succeeded = answer["success"]
        return {"subgoals": answer["subgoals"], "success": answer["success"], "step": answer["step"]}
