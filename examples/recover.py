"""Bring the robot back to ready after a stop, then guide the left arm alone; needs `yumi up` in another terminal."""

import sys
import termios

from yumi.driver.state import Mode
from yumi.errors import StopNotConfirmed, YumiError
from yumi.ros.clients import RobotManagerClient, application


def main() -> None:
    with application("recover") as spinner:
        manager = RobotManagerClient(spinner)

        try:
            print(manager.recover(on_step=show))
        except StopNotConfirmed as error:  # an emergency stop, a guard stop or a collision: a person decides
            print(error)
            if sys.stdin.isatty():
                termios.tcflush(sys.stdin, termios.TCIFLUSH)  # what was typed before the question is no answer
            if input("Look at the robot. Type yes when it may move again: ") != "yes":
                raise
            print(manager.recover(on_step=show, confirm=error.stop))
        print(manager.set_mode(Mode.EGM_LEFT, on_step=show))
        state = manager.wait_for_state(lambda state: state.left_egm == "running", 5.0, "EGM on the left arm")
        print(f"left arm {state.left_state_machine}, right arm {state.right_state_machine}")
        print(manager.stop_egm())


def show(step: str) -> None:
    print(f"  {step}")


if __name__ == "__main__":
    try:
        main()
    except YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
