/** The page's state, in one place: messages and a person's choices change it, and views show all of it. */

import { frameOfBox, type Frame } from "abb-view/frames";
import { CONNECTING, newestFirst, Store as ShellStore } from "abb-view/store";
import { armsOf, type ArmName, type Distance, type DriverState, type Limited, type LogEvent, type Model, type PerArm, type Plan,
  type Recording, type Said, type StateMessage, type TeleoperatedMessage, type ViewMessage } from "./messages";

export { CONNECTING };

export const TABS = ["joints", "tool", "poses", "teleop", "virtual"] as const;
export type Tab = (typeof TABS)[number];

/** What the handle in the picture is for: nothing, to jog the tool, or a goal for a plan; and how it is dragged. */
export type Handle = "none" | "jog translate" | "jog rotate" | "goal translate" | "goal rotate";

export const DEVICES = ["keyboard", "gamepad", "spacemouse", "headset"] as const;
export type DeviceName = (typeof DEVICES)[number];

export const JOINT_GOAL = "joint positions";
export const HANDLE_GOAL = "the handle";

export interface Page {
  model: Model;
  view: Omit<ViewMessage, "type" | "events">;
  state: DriverState | null; // the newest, or that of a recording
  stateTime: number; // of it, on the server's clock, or in the recording [s]
  reasons: Said[]; // why the arms do not move
  causes: Said[]; // what stopped the robot
  stop: string; // id of the stop that a person has to confirm
  problems: PerArm<Said>; // why an arm holds, of those that do
  commanding: PerArm<string>; // who commands an arm, where there is anything to say
  limited: PerArm<Limited>; // two parts of each arm that must not come nearer to each other
  nearest: Distance | null; // those that limit an arm, else those nearest to each other
  silentSince: number; // when the robot began to run EGM without its datagrams, on the server's clock [s]
  arm: ArmName; // that the panel shows
  tab: Tab;
  jogSpeed: number; // a share
  frame: string; // that the tool is jogged in: base, tool, work object, or "box NAME"
  handle: Handle;
  goal: string; // a pose's name, JOINT_GOAL or HANDLE_GOAL
  isForBoth: boolean; // whether the goal is for both arms
  isPreviewed: boolean; // whether the goal that is chosen is shown as a ghost
  device: DeviceName; // that teleoperates
  teleoperatedArms: "both" | "right" | "left"; // by it
  scale: number; // of what the person's hand does
  yaw: number; // [rad] how the person is turned from the robot: 0 stands behind it, pi opposite
  teleoperated: (TeleoperatedMessage & { delay: number }) | null; // what became of a frame, and how long that took to come [s]
  plan: (Plan & { time: number }) | null; // and the time of it that is shown [s]
  workObject: Frame | null;
  events: readonly LogEvent[]; // the newest first
  recording: Recording | null;
}

export function initialPage(model: Model, workObject: Frame | null): Page {
  const arm = armsOf(model)[0]!;
  return {
    model,
    view: {
      is_recording: false, why_no_robot: CONNECTING, is_virtual: false, why_not_operated: "", may_stop: false, may_pair: false,
      control: "none", surroundings: { boxes: [] }, faults: [], why_no_faults: "",
    },
    state: null, stateTime: 0, reasons: [], causes: [], stop: "", problems: {}, commanding: {}, limited: {}, nearest: null,
    silentSince: Infinity, arm, tab: "joints", jogSpeed: 0.6, frame: "base", handle: "none",
    goal: posesOf(model)[0] ?? JOINT_GOAL, isForBoth: false, isPreviewed: false, plan: null,
    device: "keyboard", teleoperatedArms: "both", scale: 1, yaw: 0, teleoperated: null, workObject, events: [], recording: null,
  };
}

/** Whether this page may inject faults into a virtual robot: one on the robot's own machine may. */
export function takesFaults({ view }: Page): boolean {
  return view.faults.length > 0;
}

/** The poses that have names, of every arm. */
export function posesOf(model: Model): string[] {
  return Object.keys(model.arms[armsOf(model)[0]!]!.poses);
}

/** What a state of the driver changes. */
export function ofState(page: Page, message: StateMessage): Partial<Page> {
  const { state, time: stateTime, reasons, causes, stop, problems, commanding, limited, nearest } = message;
  const silentSince = silentArms(state).length ? Math.min(page.silentSince, stateTime) : Infinity;
  return { state, stateTime, reasons, causes, stop, problems, commanding, limited, nearest, silentSince };
}

/** What the server's words on control and robot change. */
export function ofView(page: Page, { type: _, events, ...view }: ViewMessage): Partial<Page> {
  const isControlLost = page.view.control === "here" && view.control !== "here";
  return {
    view, ...ofEvents([], events), ...(isControlLost ? { plan: null, teleoperated: null } : {}), ...(view.why_no_robot ? { state: null } : {}),
  };
}

/** What new lines of the log change. */
export function ofEvents(known: readonly LogEvent[], events: readonly LogEvent[]): Partial<Page> {
  return { events: newestFirst(known, events) };
}

/** What the loss of the connection changes. */
export function ofLoss(page: Page, sentence: string): Partial<Page> {
  return { view: { ...page.view, control: "none", why_no_robot: sentence }, plan: null, teleoperated: null };
}

/** The arms that the robot runs EGM on while its datagrams do not arrive. */
export function silentArms(state: DriverState): ArmName[] {
  return armsOf(state).filter((name) => state.egm[name] !== "running" && state.machines[name] === "RUN_EGM_ROUTINE");
}

export const hasControl = ({ view }: Page): boolean => view.control === "here";

/** Where an arm is [rad], as EGM measures or the controller reports it; null where neither does. */
export function jointsOf({ state }: Page, name: ArmName): number[] | null {
  return state?.arms[name]?.position ?? state?.arms[name]?.resting ?? null;
}

/** The frame that the tool is jogged in; null for base and tool, and for a work object that was not set. */
export function frameOf(page: Page): Frame | null {
  if (page.frame === "work object") return page.workObject;
  const box = page.view.surroundings.boxes.find((each) => page.frame === `box ${each.name}`);
  return box ? frameOfBox(box) : null;
}

/** The page's state, with the views that show it. */
export class Store extends ShellStore<Page> {}
