"""A policy on the network, in thirty lines: it speaks the wire of openpi's policy servers, and waves both arms.

    python examples/policy_server.py [port]

A client connects by WebSocket and gets `METADATA`, then sends observations and gets actions: 50 points of 14 joints and
two grippers. `infer` is where yours runs.
"""

import sys
from contextlib import suppress

import numpy as np
from policy_wire import pack, unpack
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

METADATA = {"name": "wave", "period": 0.02, "joints": "right arm, left arm [rad], right gripper, left gripper [0 to 1]"}
POINTS = 50
RATE = 2.0  # [rad/s] of the wave
SWING = np.array([0.1] * 7 + [-0.1, 0.1, -0.1, 0.1, -0.1, 0.1, -0.1])  # [rad] the left arm mirrors the right one


def infer(observation: dict) -> np.ndarray:
    """The next points from the positions (14,) [rad] at the policy's time [s]: back to the wave within a second."""
    since = np.arange(POINTS)[:, None] * METADATA["period"]
    begin = observation["start"]  # where the arms were when the policy began
    times = observation["time"] + since
    wave = begin + SWING * (1.0 - np.cos(RATE * times))
    away = observation["position"] - (begin + SWING * (1.0 - np.cos(RATE * observation["time"])))
    grippers = np.repeat((np.sin(RATE * times) > 0.0).astype(float), 2, axis=1)
    return np.hstack([wave + away * np.exp(-since), grippers])


def answer(connection) -> None:
    with suppress(ConnectionClosed):  # a client that was stopped has no last word
        connection.send(pack(METADATA))
        for received in connection:
            connection.send(pack({"actions": infer(unpack(received))}))


if __name__ == "__main__":
    port = int(sys.argv[1]) if len(sys.argv) > 1 else 8000
    try:
        with serve(answer, "127.0.0.1", port, compression=None, max_size=None) as server:
            print(f"ready on port {server.socket.getsockname()[1]}", flush=True)
            with suppress(KeyboardInterrupt):
                server.serve_forever()
    except OSError as error:
        sys.exit(f"Error: port {port} cannot be opened ({error.strerror}); give another one.")
