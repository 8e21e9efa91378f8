/** Messages between the server and the page of a controller, as JSON. SI units. */

import type { Answer, Fault, Joints, PerArm } from "abb-view/messages";

export * from "abb-view/messages";

/** What does not change of it: its address, ABB's name of the robot or nothing, its robots' units, and whether it is drawn. */
export interface ControllerKind {
  address: string;
  robot: string;
  units: string[];
  is_drawn: boolean;
}

/** Where a program pointer stands, with the lines around it, the first of which has a number, too. */
export interface Pointer {
  module: string;
  routine: string;
  line: number;
  first_line: number;
  text: string[];
}

export interface RapidTask {
  name: string;
  execution: string;
  is_active: boolean;
  is_motion_task: boolean;
  pointer: Pointer | null;
}

/** A line of the event log, or one that a program wrote to the FlexPendant. */
export interface LogLine {
  source: "event log" | "TPWrite";
  text: string;
  level: string;
  clock: string; // empty where it is not known
  task: string; // that wrote it; empty in the event log
  code: number; // ABB's number of the event; 0 of TPWrite
  detail: string;
}

export interface ControllerMessage {
  type: "controller";
  time: number;
  operating_mode: string | null;
  motors: string | null;
  program: string | null;
  speed_ratio: number | null; // [%]
  arms: PerArm<Joints | null>;
  tasks: RapidTask[];
  missing: string[];
}

/** What does not change of the controller, its log so far, oldest first, why there is no state, and the faults it takes. */
export interface ControllerViewMessage {
  type: "view";
  controller: ControllerKind;
  is_virtual: boolean;
  log: LogLine[];
  why_no_robot: string;
  faults: Fault[];
}

export type ControllerServerMessage =
  | ControllerMessage
  | ControllerViewMessage
  | { type: "log"; lines: LogLine[] }
  | { type: "refused"; sentence: string }
  | Answer;
