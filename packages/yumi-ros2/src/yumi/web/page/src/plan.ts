/** A plan: where the planned arm is at a time. */

import type { Joints, PlanPoint } from "./messages";
import { indexAt } from "abb-view/numbers";

/** Between two points of the plan [rad]. */
export function pointOf(points: readonly PlanPoint[], time: number): Joints {
  const index = Math.max(0, Math.min(points.length - 2, indexAt(points.map(([each]) => each), time)));
  const [begin, from] = points[index]!;
  const [end, to] = points[index + 1] ?? points[index]!;
  const share = Math.min(1, Math.max(0, (time - begin) / (end - begin || 1)));
  return from.map((value, joint) => value + share * (to[joint]! - value));
}
