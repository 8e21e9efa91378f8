"""Plan a motion of both arms that cross each other's place, look at it, and execute it; without ROS.

Needs `pip install "yumi-ros2[planning]"`. Start `yumi controller` in another terminal, or give a robot's address:
`python examples/plan_around.py [address]`.
"""

import sys

import yumi

LEFT_LOW = yumi.degrees(-40, -60, 60, 10, 0, 60, 0)
RIGHT_LOW = yumi.degrees(40, -60, -60, 10, 0, 60, 0)


def main(address: str) -> None:
    with yumi.connect(address) as robot:
        robot.move_to(right="home", left="home")
        plan = robot.plan_to(right=RIGHT_LOW, left=LEFT_LOW)
        print(f"found in {plan.planning_time:.1f} s: a motion of {plan.duration:.1f} s")
        robot.execute(plan)
        robot.execute(robot.plan_to(right="home", left="home"))
        print("back at home")


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1")
    except yumi.errors.YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
