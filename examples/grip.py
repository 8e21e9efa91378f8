"""Open and close both grippers; needs `yumi up` in another terminal."""

import sys

from yumi.errors import YumiError
from yumi.robot.joints import Side
from yumi.ros.clients import GripperClient, application


def main() -> None:
    with application("grip") as spinner:
        grippers = {side: GripperClient(spinner, side) for side in Side}
        for position in (0.025, 0.0):
            results = {side: gripper.begin(position) for side, gripper in grippers.items()}
            for side, wait in results.items():
                grip = wait()
                print(f"{side.word} gripper: {grip.word}, {grip.position * 2e3:.1f} mm between the fingers")


if __name__ == "__main__":
    try:
        main()
    except YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
