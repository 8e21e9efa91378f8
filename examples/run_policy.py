"""Run a policy of a server on both arms: chunk after chunk, without a pause and without a step.

python examples/policy_server.py                     # in another terminal
python examples/run_policy.py [seconds] [address of the robot] [address of the server]
"""

import sys
import time

import numpy as np
from policy_wire import pack, unpack
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

import yumi


def run(robot, server, seconds: float) -> None:
    period = unpack(server.recv())["period"]
    robot.move_to(right="ready", left="ready")
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            follow(robot, server, period, end)
        except yumi.errors.CommandRefused as refusal:
            if not is_with_a_person(robot):
                raise
            print(f"{refusal} Waiting until a person gives the arms back.", flush=True)
            while is_with_a_person(robot) and time.monotonic() < end:
                time.sleep(0.1)


def is_with_a_person(robot) -> bool:
    """Whether a person commands an arm, or has let it go and not given it back."""
    return any(arm.state.command.is_of_person for arm in (robot.right, robot.left))


def follow(robot, server, period: float, end: float) -> None:
    """Follow the policy from where the arms are, until the time is over."""
    start = np.array([*robot.right.position, *robot.left.position])
    with robot.follow_chunks() as chunks:
        begin = time.monotonic()
        behind = 0.0  # [s] that the arms have waited for points
        while (observed := time.monotonic()) < end:
            position = np.array([*robot.right.position, *robot.left.position])
            server.send(pack({"start": start, "position": position, "time": observed - begin - behind}))
            actions = unpack(server.recv())["actions"]
            due = chunks.start_for(observed)
            behind += due - observed
            chunks.send(
                yumi.Chunk(
                    period=period,
                    start=due,
                    right=actions[:, :7],
                    left=actions[:, 7:14],
                    right_gripper=actions[:, 14],
                    left_gripper=actions[:, 15],
                )
            )
            time.sleep(0.2)  # so often this policy looks at the robot; yours may take as long to infer
        state = chunks.state
    print(f"{state.sent} chunks, {state.replaced} points replaced, {state.late} too late")


def main(seconds: float = 10.0, address: str = "127.0.0.1", server: str = "127.0.0.1:8000") -> None:
    """Connect to the policy before the robot: without a policy the robot is left as it is."""
    try:
        with connect(f"ws://{server}", compression=None, max_size=None) as policy, yumi.connect(address) as robot:
            run(robot, policy, seconds)
    except yumi.errors.YumiError as error:
        sys.exit(f"Error: {error}")
    except (OSError, WebSocketException) as error:
        sys.exit(f"Error: the policy server at {server} does not answer, the arms hold: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:2]), *sys.argv[2:4])
