/** The reader of the meshes. */

import { BufferAttribute, BufferGeometry, Vector3 } from "three";

const CREASE = 0.75; // [rad] edges sharper than this stay edges

/** A binary STL as triangles whose normals are smooth, except at edges. */
export function readStl(buffer: ArrayBuffer): BufferGeometry {
  const view = new DataView(buffer);
  const count = view.getUint32(80, true);
  const points = new Float32Array(9 * count);
  const faces: Vector3[] = []; // their normals, as long as the face is large
  const around = new Map<string, number[]>(); // the faces at a corner
  const keys: string[] = [];
  for (let face = 0; face < count; face += 1) {
    const offset = 84 + 50 * face;
    for (let index = 0; index < 9; index += 1) points[9 * face + index] = view.getFloat32(offset + 12 + 4 * index, true);
    const corners = [0, 1, 2].map((corner) => new Vector3().fromArray(points, 9 * face + 3 * corner));
    const [a, b, c] = corners as [Vector3, Vector3, Vector3];
    faces.push(b.clone().sub(a).cross(c.clone().sub(a)));
    for (const { x, y, z } of corners) {
      const key = `${x.toFixed(5)},${y.toFixed(5)},${z.toFixed(5)}`;
      keys.push(key);
      const known = around.get(key);
      if (known) known.push(face);
      else around.set(key, [face]);
    }
  }
  const units = faces.map((normal) => normal.clone().normalize());
  const normals = new Float32Array(9 * count);
  const limit = Math.cos(CREASE);
  keys.forEach((key, corner) => {
    const own = units[Math.floor(corner / 3)]!;
    const sum = new Vector3();
    for (const face of around.get(key)!) if (own.dot(units[face]!) >= limit) sum.add(faces[face]!);
    sum.normalize().toArray(normals, 3 * corner);
  });
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(points, 3));
  geometry.setAttribute("normal", new BufferAttribute(normals, 3));
  return geometry;
}
