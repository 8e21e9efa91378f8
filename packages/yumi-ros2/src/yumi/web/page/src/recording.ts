/** A recording as the page shows it: what the driver would have reported at a time of it. */

import { armsOf, type ArmName, type ArmState, type DriverState, type GripperState, type PerArm, type Recording, type Said } from "./messages";
import { indexAt } from "abb-view/numbers";
import type { Page } from "./store";

const LIVES = 1; // [s] an arm without a cycle for so long ran no EGM
const MOVES = 0.01; // [rad/s]
const SHOWN_FOR = 2; // [s] after a fault

const byArm = <T>(value: (name: ArmName) => T): PerArm<T> => ({ right: value("right"), left: value("left") });

function newest<T extends { time: number }>(items: readonly T[], time: number): T | null {
  return items[indexAt(items.map((each) => each.time), time)] ?? null;
}

/** What a time of the recording changes on the page. */
export function ofTime(recording: Recording, time: number): Partial<Page> {
  const robot = newest(recording.states, time);
  const isRunning = byArm((name) => {
    const cycles = recording.arms[name]!;
    const index = indexAt(cycles.time, time);
    return index >= 0 && Boolean(cycles.is_running[index]) && time - cycles.time[index]! < LIVES;
  });
  const event = newest(recording.events, time);
  const fault = event?.is_fault && time - event.time < SHOWN_FOR ? [event.sentence] : [];
  const asMessages = (sentences: readonly string[] = []): Said[] => sentences.map((sentence) => ({ code: "text", sentence, action: null }));
  const state: DriverState = {
    robot: recording.name,
    operating_mode: robot?.operating_mode ?? null,
    motors: robot?.controller_state ?? null,
    program: robot?.execution ?? null,
    machines: { right: null, left: null },
    egm: byArm((name) => (isRunning[name] || robot?.egm?.[name.charAt(0)] === "running" ? "running" : "off")),
    speed_scale: robot?.speed_scale ?? 1,
    arms: byArm((name) => recordedArm(recording, name, time, Boolean(isRunning[name]))),
    controllers: { right: [], left: [] },
    grippers: byArm((name) => recordedGripper(recording, name, time)),
  };
  return {
    state, stateTime: time, reasons: asMessages(robot?.reasons), causes: asMessages(robot?.causes?.length ? robot.causes : fault), stop: robot?.stop ?? "",
    problems: {}, commanding: {}, limited: {}, nearest: null,
  };
}

function recordedArm(recording: Recording, name: ArmName, time: number, isRunning: boolean): ArmState {
  const cycles = recording.arms[name]!;
  const index = indexAt(cycles.time, time);
  const velocity = cycles.velocity[Math.max(index, 0)] ?? null;
  const isMoving = isRunning && velocity !== null && Math.max(...velocity.map(Math.abs)) > MOVES;
  return {
    mode: isMoving ? "moving" : isRunning ? "holding" : "no_egm",
    session: 0, cycles: null, velocity,
    position: cycles.position[Math.max(index, 0)] ?? null,
    sent: cycles.sent[index] ?? null,
    goal: cycles.reference[index] ?? null,
  };
}

function recordedGripper(recording: Recording, name: ArmName, time: number): GripperState | null {
  const gripper = newest(recording.grippers[name]!, time);
  return gripper && {
    state: String(gripper.state).toLowerCase().replaceAll("_", " "), width: 2 * gripper.position, force: gripper.force,
    is_holding: gripper.state === "KEEP_OBJECT", is_calibrated: gripper.is_calibrated, error: gripper.error,
  };
}

/** The arm to show first: a flight record has one alone. */
export function recordedArmName(recording: Recording): ArmName {
  return armsOf(recording).find((name) => recording.arms[name]!.time.length) ?? "right";
}
