/** Numbers as a person reads them; angles are shown in degrees. */

import type { Joints, Vector } from "./messages";

export const DEGREES = 180 / Math.PI;

/** With so many decimals; what rounds to zero has no sign. */
export function fixed(value: number, digits: number): string {
  const shown = value.toFixed(digits);
  return Number(shown) === 0 ? (0).toFixed(digits) : shown;
}

export const millimetres = (value: number): string => fixed(value * 1000, 1);

/** A point [m] in millimetres. */
export const coordinates = (point: Vector): string => point.map((value, axis) => `${"xyz"[axis]}\u00a0${millimetres(value)}`).join(", ");

/** The largest difference of two positions [rad]. */
export function difference(one: Joints, other: Joints): number {
  return Math.max(...one.map((value, index) => Math.abs(value - (other[index] ?? value))));
}

/** The last index of sorted times that is not after a time, or -1. */
export function indexAt(times: readonly number[], time: number): number {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle]! <= time + 1e-6) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}
