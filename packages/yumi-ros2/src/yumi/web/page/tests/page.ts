/** A page as tests begin with it: both arms stand at zero, EGM runs on both, and joint_goal commands them. */

import type { ArmState, DriverState, Fault, Model, PerArm, StateMessage, ViewMessage } from "../src/messages";
import { initialPage, ofState, ofView, type Page } from "../src/store";

const byArm = <T>(value: () => T): PerArm<T> => ({ right: value(), left: value() });
const zeros = () => [0, 0, 0, 0, 0, 0, 0];

export const MODEL: Model = {
  program: "yumi view", links: {}, joints: [],
  arms: byArm(() => ({ joints: [], axes: [1, 2, 7, 3, 4, 5, 6], fingers: [], tip: "tip", tool0: "tool0", poses: { home: zeros(), ready: zeros() } })),
  limits: { lower: zeros(), upper: zeros(), velocity: zeros() },
  gripper: { travel: 0.025, force: 20 }, commands: [],
};

export function arm(changes: Partial<ArmState> = {}): ArmState {
  return {
    mode: "holding", session: 1, position: zeros(), velocity: zeros(), sent: zeros(), goal: null, cycles: null,
    ...changes,
  };
}

export function driverState(changes: Partial<DriverState> = {}): DriverState {
  return {
    robot: "127.0.0.1:80", operating_mode: "AUTO", motors: "motoron", program: "running", speed_scale: 1,
    machines: byArm(() => "RUN_EGM_ROUTINE"), egm: byArm(() => "running"), arms: byArm(() => arm()),
    controllers: byArm(() => [{ name: "joint_goal_controller", commands: true }]), grippers: byArm(() => null), ...changes,
  };
}

export function stateMessage(changes: Partial<StateMessage> = {}): StateMessage {
  return { type: "state", time: 10, state: driverState(), limited: {}, commanding: {}, nearest: null, reasons: [], causes: [], stop: "", problems: {}, ...changes };
}

export function viewMessage(changes: Partial<ViewMessage> = {}): ViewMessage {
  return {
    type: "view", is_recording: false, why_no_robot: "", is_virtual: false, why_not_operated: "", may_stop: true, may_pair: false, control: "here",
    events: [], surroundings: { boxes: [] }, faults: [], why_no_faults: "", ...changes,
  };
}

export function page({ view = {}, ...state }: Partial<StateMessage> & { view?: Partial<ViewMessage> } = {}): Page {
  const begun = initialPage(MODEL, null);
  const seen = { ...begun, ...ofView(begun, viewMessage(view)) };
  return { ...seen, ...ofState(seen, stateMessage(state)) };
}

export const FAULT: Fault = {
  name: "motors-off", meaning: "Motors Off is pressed", has_side: false, has_duration: false, default_duration: null, unit: "", default: null,
};

export const off = () => ({ right: "off", left: "off" });
export const reason = (sentence: string, action: string | null = null) => ({ code: "", sentence, action });
