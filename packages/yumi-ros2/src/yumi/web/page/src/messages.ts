/** Messages between server and page, as JSON. SI units; arms and joints by the names of the driver. */

import type { Answer, Box, Failure, Fault, Joints, Model as ShellModel, ArmName, PerArm, PlanPoint, Said, Side, Vector } from "abb-view/messages";

export * from "abb-view/messages";

/** A command of the driver without arguments: its method, and its button. */
export interface CommandButton {
  method: string;
  button: string;
  title: string;
}

export interface Model extends ShellModel {
  commands: CommandButton[];
}

// ---- what the server says

/** A line of the driver's log: its number from 1, UNIX time [s], level (info, warning, error), and what it says. */
export interface LogEvent extends Said {
  number: number;
  time: number;
  level: string;
}

// ---- the driver's state; its reasons, causes, problems and events come beside it, in the page's words

export interface CycleCounts {
  missed: number;
  lost: number;
  jitter: number;
  period: number;
}

export interface ArmState {
  mode: string;
  session: number;
  position: Joints | null;
  resting?: Joints | null;
  velocity: Joints | null;
  sent: Joints | null;
  goal: Joints | null;
  cycles: CycleCounts | null;
}

export interface ControllerStatus {
  name: string;
  commands: boolean;
}

export interface GripperState {
  state: string;
  is_calibrated: boolean;
  is_holding: boolean;
  width: number;
  force: number;
  error: number;
}

export interface DriverState {
  robot: string;
  operating_mode: string | null;
  motors: string | null;
  program: string | null;
  machines: PerArm<string | null>;
  egm: PerArm<string>;
  speed_scale: number;
  arms: PerArm<ArmState>;
  controllers: PerArm<ControllerStatus[]>;
  grippers: PerArm<GripperState | null>;
}

export interface Limited {
  part: string;
  other: string;
}

export interface Distance extends Limited {
  distance: number;
  start: Vector;
  end: Vector;
}

// ---- from the server

export interface StateMessage {
  type: "state";
  time: number;
  state: DriverState;
  limited: PerArm<Limited>; // of the arms that something limits
  nearest: Distance | null;
  reasons: Said[];
  causes: Said[];
  stop: string;
  problems: PerArm<Said>; // of the arms that have one
  commanding: PerArm<string>; // who commands an arm, where there is anything to say
}

/** What the clutch of a teleoperated arm does; why a held one moves nothing, what the arm is kept apart from, and why the
 * gripper did not take its goal. */
export interface TeleoperatedArm {
  clutch: "released" | "engaging" | "engaged" | "inert";
  why: Said | null;
  limited: Limited | null;
  gripper: Said | null;
}

/** What became of a frame of the device: its time, the frames that were dropped so far, and why it was refused. */
export interface TeleoperatedMessage {
  type: "teleoperated";
  time: number;
  dropped: number;
  arms: PerArm<TeleoperatedArm>; // none where it was refused
  error: Failure | null;
}

export interface ViewMessage {
  type: "view";
  is_recording: boolean;
  why_no_robot: string;
  is_virtual: boolean;
  why_not_operated: string;
  may_stop: boolean;
  may_pair: boolean; // this page, once a person has typed the code
  control: "none" | "here" | "elsewhere";
  events: LogEvent[];
  surroundings: { boxes: Box[] };
  faults: Fault[]; // that this page may inject
  why_no_faults: string; // of a virtual robot
}

export type ServerMessage =
  | StateMessage
  | ViewMessage
  | TeleoperatedMessage
  | { type: "events"; events: LogEvent[] }
  | { type: "refused"; sentence: string }
  | { type: "jog_refused"; hold: number; error: Failure }
  | { type: "motions"; id: number }
  | Answer;

// ---- to the server

export type Jog =
  | { type: "jog_joints"; arm: ArmName; speeds: Joints }
  | { type: "jog_tool"; arm: ArmName; frame: "base" | "tool"; linear?: Vector; angular?: Vector; elbow?: number };

/** What a device reports for an arm, as yumi.driver.device_frame has it. */
export interface Hand {
  clutch: boolean;
  pose?: number[]; // x, y, z [m], quaternion w, x, y, z
  twist?: number[]; // [m/s], [rad/s]
  gripper?: number; // 0 is open, 1 is closed
  elbow?: number; // [rad] beside a pose, [rad/s] beside a twist
}

/** Of each arm; an arm that is left out is not seen by the device. */
export type Hands = Partial<Record<Side, Hand>>;

/** A plan as the server answers it: of each arm its times [s] and joint positions [rad]. */
export interface Plan {
  plan: number;
  duration: number;
  planning_time: number;
  clearance: number;
  arms: PerArm<PlanPoint[]>; // of those that move
}

// ---- a recording, /recording.json

export interface RecordedArm {
  time: number[];
  position: (Joints | null)[];
  velocity: (Joints | null)[];
  sent: (Joints | null)[];
  reference: (Joints | null)[];
  is_running: boolean[];
}

export interface RecordedGripper {
  time: number;
  state: string;
  position: number;
  force: number;
  is_calibrated: boolean;
  error: number;
}

export interface RecordedState {
  time: number;
  operating_mode?: string | null;
  controller_state?: string | null;
  execution?: string | null;
  egm?: Record<string, string>;
  speed_scale?: number;
  reasons?: string[]; // sentences
  causes?: string[];
  stop?: string;
}

export interface Recording {
  name: string;
  duration: number;
  arms: PerArm<RecordedArm>;
  grippers: PerArm<RecordedGripper[]>;
  states: RecordedState[];
  events: { time: number; sentence: string; is_fault: boolean }[];
}
