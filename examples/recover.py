"""Bring the robot back to ready after a stop, then guide the left arm alone; needs `yumi up` in another terminal."""

import sys

from yumi.errors import YumiError
from yumi.hardware.manager_state import Mode
from yumi.ros.clients import RobotManagerClient, application


def main() -> None:
    with application("recover") as spinner:
        manager = RobotManagerClient(spinner)

        print(manager.recover(on_step=lambda step: print(f"  {step}")))
        print(manager.set_mode(Mode.EGM_LEFT, on_step=lambda step: print(f"  {step}")))
        state = manager.wait_for_state(lambda state: state.left_egm == "running", 5.0, "EGM on the left arm")
        print(f"left arm {state.left_state_machine}, right arm {state.right_state_machine}")
        print(manager.stop_egm())


if __name__ == "__main__":
    try:
        main()
    except YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
