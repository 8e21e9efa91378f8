/** Messages between server and page, as JSON. SI units; arms and joints by the names of the driver. */

/** right or left of a YuMi; of another robot the name of its mechanical unit. */
export type ArmName = string;
export type PerArm<T> = Record<ArmName, T>;
export const armsOf = ({ arms }: { arms: PerArm<unknown> }): ArmName[] => Object.keys(arms);
/** A clause as a sentence begins. */
export const capitalised = (clause: string): string => clause.charAt(0).toUpperCase() + clause.slice(1);
export type Vector = [number, number, number];
export type Joints = number[];

// ---- the robot's description, /model.json

export interface Visual {
  shape: "mesh" | "box" | "cylinder" | "sphere";
  mesh: string;
  xyz: Vector;
  rpy: Vector;
  color: Vector;
  size?: Vector;
  radius?: number[];
  length?: number[];
}

export interface JointModel {
  name: string;
  type: "revolute" | "prismatic" | "fixed";
  parent: string;
  child: string;
  axis: Vector;
  xyz: Vector;
  rpy: Vector;
}

export interface ArmModel {
  joints: string[];
  axes: number[];
  fingers: string[];
  tip: string;
  tool0: string;
  poses: Record<string, Joints>;
}

export interface Camera {
  position: Vector;
  target: Vector;
  floor: number;
}

/** A command of the driver without arguments: its method, and its button. */
export interface CommandButton {
  method: string;
  button: string;
  title: string;
}

export interface Model {
  links: Record<string, Visual[]>;
  joints: JointModel[];
  arms: PerArm<ArmModel>; // of a robot without a description, an arm has no joints
  limits: { lower: Joints; upper: Joints; velocity: Joints }; // empty without a description
  camera?: Camera; // where it is not that of a YuMi
  tip?: string; // what a person calls the tip, where it is not the fingertips
  gripper: { travel: number; force: number };
  commands: CommandButton[];
}

// ---- what the server says

/** A message in the page's words: its code, a sentence, and the first thing that a person can do, by a name of abb_protocols.catalogue. */
export interface Said {
  code: string;
  sentence: string;
  action: string | null;
}

/** Why a request failed: the kind of error, and the id of the stop that a person has to confirm, empty where there is none. */
export interface Failure extends Said {
  kind: string;
  stop: string;
}

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

export interface Box {
  name: string;
  pose: { position: Vector; orientation: [number, number, number, number] };
  size: Vector;
}

export interface Fault {
  name: string;
  meaning: string;
  has_side: boolean;
  has_duration: boolean;
  default_duration: number | null;
  unit: string;
  default: number | null;
}

// ---- a controller without a driver

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

export interface ViewMessage {
  type: "view";
  is_recording: boolean;
  controller: ControllerKind | null; // where no driver can run for it
  log: LogLine[]; // of the controller, oldest first
  why_no_robot: string;
  is_virtual: boolean;
  why_not_operated: string;
  may_stop: boolean;
  may_pair: boolean; // this page, once a person has typed the code
  control: "none" | "here" | "elsewhere";
  events: LogEvent[];
  surroundings: { boxes: Box[] };
  faults: Fault[];
}

export type ServerMessage =
  | StateMessage
  | ViewMessage
  | ControllerMessage
  | TeleoperatedMessage
  | { type: "events"; events: LogEvent[] }
  | { type: "log"; lines: LogLine[] }
  | { type: "refused"; sentence: string }
  | { type: "jog_refused"; hold: number; error: Failure }
  | { type: "step"; id: number; step: string }
  | { type: "motions"; id: number }
  | { type: "done"; id: number; result: unknown }
  | { type: "failed"; id: number; error: Failure };

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

export const SIDES = ["right", "left"] as const;
export type Side = (typeof SIDES)[number];
/** Of each arm; an arm that is left out is not seen by the device. */
export type Hands = Partial<Record<Side, Hand>>;

export type PageMessage = { type: string; [field: string]: unknown };

/** A plan as the server answers it: of each arm its times [s] and joint positions [rad]. */
export interface Plan {
  plan: number;
  duration: number;
  planning_time: number;
  clearance: number;
  arms: PerArm<PlanPoint[]>; // of those that move
}

export type PlanPoint = [time: number, position: Joints];

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
