/** Frames in which the tool is jogged and its place is shown. */

import type { Box, Vector } from "./messages";

/** Position [m] and quaternion x, y, z, w. */
export interface Frame {
  position: Vector;
  quaternion: [number, number, number, number];
}

export const unit = (axis: number, value: number): Vector => [0, 1, 2].map((each) => (each === axis ? value : 0)) as Vector;

/** A vector turned by a quaternion x, y, z, w, or back. */
export function rotate([x, y, z, w]: Frame["quaternion"], [a, b, c]: Vector, isBack = false): Vector {
  const [i, j, k] = isBack ? [-x, -y, -z] : [x, y, z];
  const [p, q, r] = [2 * (j * c - k * b), 2 * (k * a - i * c), 2 * (i * b - j * a)];
  return [a + w * p + j * r - k * q, b + w * q + k * p - i * r, c + w * r + i * q - j * p];
}

/** A point of the body's frame, seen from a frame. */
export function seenFrom({ position, quaternion }: Frame, point: Vector): Vector {
  return rotate(quaternion, point.map((value, axis) => value - position[axis]!) as Vector, true);
}

/** The frame of a box. */
export function frameOfBox({ pose: { position, orientation: [w, x, y, z] } }: Box): Frame {
  return { position, quaternion: [x, y, z, w] };
}

/** A vector that is no longer than `most`, in the same direction. */
export function shortened(vector: Vector, most: number): Vector {
  const size = Math.hypot(...vector) || 1;
  return vector.map((value) => (value / size) * Math.min(size, most)) as Vector;
}
