/** What the server and the page send each other, as JSON. SI units; arms and joints by the names of the driver. */

export type ArmName = "right" | "left";
export const ARMS: readonly ArmName[] = ["right", "left"];
export type PerArm<T> = Record<ArmName, T>;
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

export interface Model {
  links: Record<string, Visual[]>;
  joints: JointModel[];
  arms: PerArm<ArmModel>;
  limits: { lower: Joints; upper: Joints; velocity: Joints };
  gripper: { travel: number; force: number };
}

// ---- the driver's state

/** Why the arms do not move, or what stopped the robot: its code, a sentence, and what ends it, where a button does. */
export interface Reason {
  code: string;
  sentence: string;
  action: string | null;
}

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
  problem: string;
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

export interface LogEvent {
  time: number;
  level: string;
  sentence: string;
}

// ---- from the server

export interface StateMessage {
  type: "state";
  time: number;
  state: DriverState;
  limited: Partial<PerArm<Limited>>;
  nearest: Distance | null;
  reasons: Reason[];
  causes: Reason[];
  stop: string;
}

export interface ViewMessage {
  type: "view";
  is_recording: boolean;
  why_no_robot: string;
  is_virtual: boolean;
  why_not_operated: string;
  control: "none" | "here" | "elsewhere";
  events: LogEvent[];
  surroundings: { boxes: Box[] };
  faults: Fault[];
}

export interface Failure {
  message: string;
}

export type ServerMessage =
  | StateMessage
  | ViewMessage
  | { type: "events"; events: LogEvent[] }
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

export type PageMessage = { type: string; [field: string]: unknown };

/** A plan as the server answers it: of each arm its times [s] and joint positions [rad]. */
export interface Plan {
  plan: number;
  duration: number;
  planning_time: number;
  clearance: number;
  arms: Partial<PerArm<PlanPoint[]>>;
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
  reason?: string;
  cause?: string;
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
