/** The state of the page of a controller, and what messages change of it. */

import type { Verdict } from "abb-view/banner";
import { armsOf, type ArmName, type ControllerKind, type ControllerMessage, type ControllerViewMessage, type LogLine, type Model } from "./messages";
import { CONNECTING, newestFirst } from "abb-view/store";

export interface ControllerPage {
  model: Model;
  view: Omit<ControllerViewMessage, "type" | "log" | "controller"> & { controller: ControllerKind | null };
  state: ControllerMessage | null; // the newest, or the one last seen
  arm: ArmName; // that the panel shows; empty of a controller without an arm
  log: readonly LogLine[]; // the newest first
}

export function initialPage(model: Model): ControllerPage {
  const view = { controller: null, is_virtual: false, why_no_robot: CONNECTING, faults: [] };
  return { model, view, state: null, arm: armsOf(model)[0] ?? "", log: [] };
}

/** What the server's words on the controller change. */
export function ofView({ type: _, log, ...view }: ControllerViewMessage): Partial<ControllerPage> {
  return { view, ...ofLog([], log), ...(view.why_no_robot ? { state: null } : {}) };
}

/** What new lines of the log change. */
export function ofLog(known: readonly LogLine[], lines: readonly LogLine[]): Partial<ControllerPage> {
  return { log: newestFirst(known, lines) };
}

/** What the loss of the connection changes. */
export function ofLoss(page: ControllerPage, sentence: string): Partial<ControllerPage> {
  return { view: { ...page.view, why_no_robot: sentence } };
}

/** Whether the model is that of another robot: another controller answers where the one of the model did. */
export function isOther({ controller }: Model, { robot, units }: ControllerKind): boolean {
  return controller !== undefined && (controller.robot !== robot || controller.units.join() !== units.join());
}

export function nameOf({ robot, address }: ControllerKind): string {
  return robot ? `${robot} at ${address}` : address;
}

/** Whether RAPID runs, and what is not shown; or why nothing is known. */
export function verdict({ view, state }: ControllerPage): Verdict {
  const say = (level: Verdict["level"], head: string, ...lines: string[]): Verdict => ({ level, kind: "", head, lines });
  if (view.why_no_robot === CONNECTING) return say("wait", CONNECTING);
  if (view.why_no_robot) return say("error", state ? "No connection" : "No robot", view.why_no_robot);
  if (!state) return say("wait", "Waiting for the robot");
  const runs = state.program === "running" ? "RAPID runs" : state.program ? "RAPID is stopped" : "RAPID is being read";
  return say(state.program === "running" ? "good" : "wait", view.faults.length ? runs : `View only: ${runs}`, ...state.missing);
}
