/** The connection of a page that shows the robot of a driver: it also asks the driver, and words the results. */

import { Connection as ShellConnection } from "abb-view/connection";
import type { ServerMessage } from "./messages";

export class Connection extends ShellConnection<ServerMessage> {
  /** Ask the driver for a method. */
  request(method: string, values: Record<string, unknown>, pressed?: HTMLElement): Promise<unknown> {
    return this.ask({ type: "ask", request: { method, ...values } }, pressed);
  }

  protected override outcomeOf(result: unknown): string {
    return outcomeOf(result);
  }
}

/** What a person reads of a result; empty where there is nothing to read. */
export function outcomeOf(result: unknown): string {
  if (typeof result === "string") return result;
  const { outcome, width } = (result ?? {}) as { outcome?: string; width?: number };
  if (!outcome || width === undefined) return "";
  const size = `${(width * 1000).toFixed(1)} mm`;
  return outcome === "holding" ? `The gripper holds something ${size} wide.` : `The gripper is ${outcome}, ${size} wide.`;
}
