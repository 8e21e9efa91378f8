"""Move both arms at once and let one of them go on while the other waits: asyncio without ROS.

Start `yumi controller` in another terminal, or give a robot's address: `python examples/script_both_arms.py [address]`.
"""

import asyncio
import sys

import yumi

HOME = {
    "right": yumi.degrees(0, -130, -135, 30, 0, 40, 0),
    "left": yumi.degrees(0, -130, 135, 30, 0, 40, 0),
}
WAVE = [yumi.degrees(0, -130, -135, 30, 0, 40, angle) for angle in (45, -45, 0)]


async def wave(arm) -> None:
    for goal in WAVE:
        await arm.move_to(goal, speed_scale=0.8)


async def main(address: str) -> None:
    async with yumi.connect_async(address) as robot:
        await robot.move_to(**HOME)
        waving = asyncio.create_task(wave(robot.right))
        await robot.left.gripper.open()
        await robot.left.gripper.close()
        await waving
        print(f"right arm: {robot.right.mode.value}, left arm: {robot.left.mode.value}")


if __name__ == "__main__":
    try:
        asyncio.run(main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1"))
    except yumi.errors.YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
