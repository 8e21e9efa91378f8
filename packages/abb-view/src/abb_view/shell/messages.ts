/** Messages between the server and every page, as JSON, and what the scene draws. SI units. */

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

export interface Model {
  program: string; // the command that serves the page
  controller?: { robot: string; units: string[] }; // whose robot it is, on the page of a controller
  links: Record<string, Visual[]>;
  joints: JointModel[];
  arms: PerArm<ArmModel>; // of a robot without a description, an arm has no joints
  limits: { lower: Joints; upper: Joints; velocity: Joints }; // empty without a description
  camera?: Camera; // where it is not that of a YuMi
  tip?: string; // what a person calls the tip, where it is not the fingertips
  gripper: { travel: number; force: number };
}

export interface Box {
  name: string;
  pose: { position: Vector; orientation: [number, number, number, number] };
  size: Vector;
}

export const SIDES = ["right", "left"] as const;
export type Side = (typeof SIDES)[number];
export type PlanPoint = [time: number, position: Joints];

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

/** Ends of what a page has asked for under a number. */
export type Answer =
  | { type: "step"; id: number; step: string }
  | { type: "done"; id: number; result: unknown }
  | { type: "failed"; id: number; error: Pick<Failure, "sentence"> };

export interface Fault {
  name: string;
  meaning: string;
  has_side: boolean;
  has_duration: boolean;
  default_duration: number | null;
  unit: string;
  default: number | null;
}

// ---- to the server

export type PageMessage = { type: string; [field: string]: unknown };
