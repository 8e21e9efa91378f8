// The robot in 3-D: links and joints as the description has them, goals as ghosts, frames, and the tools' traces.

import * as THREE from "./vendor/three.module.min.js";
import { OrbitControls } from "./vendor/OrbitControls.js";
import { TransformControls } from "./vendor/TransformControls.js";

const TRACE = 400; // points of a trace
const STILL = 2e-4; // [rad] a smaller change is not drawn
const SLOW = 50; // [ms] a picture that takes longer, as without a graphics card, is drawn with fewer points
const CREASE = 0.75; // [rad] edges sharper than this stay edges

/** A binary STL as triangles whose normals are smooth, except at edges. */
function readStl(buffer) {
  const view = new DataView(buffer);
  const count = view.getUint32(80, true);
  const points = new Float32Array(9 * count);
  const faces = [];
  const around = new Map();
  const keys = new Array(3 * count);
  for (let face = 0; face < count; face += 1) {
    const offset = 84 + 50 * face;
    for (let index = 0; index < 9; index += 1) {
      points[9 * face + index] = view.getFloat32(offset + 12 + 4 * index, true);
    }
    const [ax, ay, az, bx, by, bz, cx, cy, cz] = points.subarray(9 * face, 9 * face + 9);
    const [ux, uy, uz, vx, vy, vz] = [bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az];
    const normal = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx]; // as long as the face is large
    faces.push(normal);
    for (let corner = 0; corner < 3; corner += 1) {
      const at = 9 * face + 3 * corner;
      const key = `${points[at].toFixed(5)},${points[at + 1].toFixed(5)},${points[at + 2].toFixed(5)}`;
      keys[3 * face + corner] = key;
      if (!around.has(key)) around.set(key, []);
      around.get(key).push(face);
    }
  }
  const units = faces.map((normal) => {
    const size = Math.hypot(...normal) || 1;
    return normal.map((value) => value / size);
  });
  const normals = new Float32Array(9 * count);
  const limit = Math.cos(CREASE);
  for (let corner = 0; corner < 3 * count; corner += 1) {
    const own = units[Math.floor(corner / 3)];
    const sum = [0, 0, 0];
    for (const face of around.get(keys[corner])) {
      const other = units[face];
      if (own[0] * other[0] + own[1] * other[1] + own[2] * other[2] >= limit) {
        for (let axis = 0; axis < 3; axis += 1) sum[axis] += faces[face][axis];
      }
    }
    const size = Math.hypot(...sum) || 1;
    for (let axis = 0; axis < 3; axis += 1) normals[3 * corner + axis] = sum[axis] / size;
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
  return geometry;
}

function place(object, { xyz, rpy }) {
  object.position.set(...xyz);
  object.rotation.set(...rpy, "ZYX"); // URDF turns about fixed axes x, y, z
  return object;
}

/** One robot of the description; several can be in a scene, such as the ghost. */
class Robot {
  constructor(model, geometries, paint) {
    this.links = {};
    this.joints = {};
    for (const [name, visuals] of Object.entries(model.links)) {
      const link = new THREE.Group();
      for (const visual of visuals) {
        const geometry = geometries.get(visual);
        if (!geometry) continue;
        const mesh = new THREE.Mesh(geometry, paint(visual));
        if (visual.shape === "cylinder") {
          const inner = new THREE.Group();
          mesh.rotation.x = Math.PI / 2; // three.js has the axis along y
          inner.add(mesh);
          link.add(place(inner, visual));
        } else {
          link.add(place(mesh, visual));
        }
      }
      this.links[name] = link;
    }
    const children = new Set();
    for (const joint of model.joints) {
      const frame = place(new THREE.Group(), joint);
      const motion = new THREE.Group();
      frame.add(motion);
      motion.add(this.links[joint.child]);
      this.links[joint.parent].add(frame);
      children.add(joint.child);
      this.joints[joint.name] = { motion, axis: new THREE.Vector3(...joint.axis), type: joint.type };
    }
    this.root = this.links[Object.keys(model.links).find((name) => !children.has(name))];
  }

  set(name, value) {
    const { motion, axis, type } = this.joints[name];
    if (type === "revolute") motion.setRotationFromAxisAngle(axis, value);
    else if (type === "prismatic") motion.position.copy(axis).multiplyScalar(value);
  }
}

export class Scene {
  /** @param canvas where it is drawn. @param model of the robot, as /model.json has it. */
  constructor(canvas, model) {
    this.model = model;
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.05, 20);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.draw());
    this.resetCamera();
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 1.9));
    const sun = new THREE.DirectionalLight(0xffffff, 2.1);
    sun.position.set(1.2, -1.4, 2.2);
    this.scene.add(sun);
    const fill = new THREE.DirectionalLight(0xffffff, 0.7);
    fill.position.set(0.6, 1.6, 0.6);
    this.scene.add(fill);
    this.grid = new THREE.GridHelper(2.4, 24, 0x888888, 0x888888);
    this.grid.rotation.x = Math.PI / 2;
    this.grid.position.z = model.camera?.floor ?? -0.101;
    this.grid.material.transparent = true;
    this.grid.material.opacity = 0.28;
    this.scene.add(this.grid);
    this.boxes = new THREE.Group();
    this.scene.add(this.boxes);
    this.nearest = new THREE.Line(
      new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3()]),
      new THREE.LineBasicMaterial({ color: 0xd6336c, depthTest: false, transparent: true }),
    );
    this.nearest.frustumCulled = false;
    this.nearest.renderOrder = 3;
    this.nearest.visible = false;
    this.scene.add(this.nearest);
    this.path = new THREE.Group(); // of the fingertips on a plan
    this.scene.add(this.path);
    this.workObject = new THREE.AxesHelper(0.12);
    this.workObject.visible = false;
    this.scene.add(this.workObject);
    this.handle = new THREE.Object3D(); // what a person drags
    this.scene.add(this.handle);
    this.gizmo = new TransformControls(this.camera, canvas);
    this.gizmo.setSize(0.8);
    this.gizmo.enabled = false;
    this.scene.add(this.gizmo.getHelper());
    this.gizmo.addEventListener("change", () => this.draw());
    this.gizmo.addEventListener("dragging-changed", ({ value }) => {
      this.controls.enabled = !value;
      this.onDrag?.(value);
    });
    this.arms = {};
    this.isDue = false;
    this.slow = 0;
    this.gl = this.renderer.getContext();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
  }

  /** Load the meshes and build the robot and its ghost. */
  async load() {
    const geometries = new Map();
    const meshes = new Map();
    const visuals = Object.values(this.model.links).flat();
    await Promise.all(
      [...new Set(visuals.map((each) => each.mesh).filter(Boolean))].map(async (name) => {
        const answer = await fetch(`/meshes/${name}`);
        if (answer.ok) meshes.set(name, readStl(await answer.arrayBuffer()));
      }),
    );
    for (const visual of visuals) {
      if (visual.shape === "mesh") geometries.set(visual, meshes.get(visual.mesh));
      else if (visual.shape === "box") geometries.set(visual, new THREE.BoxGeometry(...visual.size));
      else if (visual.shape === "sphere") geometries.set(visual, new THREE.SphereGeometry(visual.radius[0], 32, 24));
      else geometries.set(visual, new THREE.CylinderGeometry(visual.radius[0], visual.radius[0], visual.length[0], 40));
    }
    const paints = new Map();
    const paint = (visual) => {
      const key = visual.color.join();
      if (!paints.has(key)) {
        const [r, g, b] = visual.color;
        const color = new THREE.Color().setRGB(r, g, b, THREE.SRGBColorSpace);
        paints.set(key, new THREE.MeshStandardMaterial({ color, roughness: 0.55, metalness: 0.04 }));
      }
      return paints.get(key);
    };
    this.robot = new Robot(this.model, geometries, paint);
    this.scene.add(this.robot.root);
    const glass = new THREE.MeshStandardMaterial({
      color: 0x2f7ff0, transparent: true, opacity: 0.32, depthWrite: false, roughness: 1,
      polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8, // behind the arm where it is as the arm is
    });
    this.ghost = new Robot(this.model, geometries, () => glass);
    this.scene.add(this.ghost.root);
    for (const [name, link] of Object.entries(this.ghost.links)) {
      if (/body|base_link/.test(name)) link.children.filter((each) => each.isMesh).forEach((each) => (each.visible = false));
    }
    for (const [word, arm] of Object.entries(this.model.arms)) {
      const frame = new THREE.AxesHelper(0.08);
      frame.material.depthTest = false;
      frame.renderOrder = 2;
      this.robot.links[arm.tip].add(frame);
      const line = new THREE.BufferGeometry();
      line.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * TRACE), 3));
      line.setDrawRange(0, 0);
      const trace = new THREE.Line(line, new THREE.LineBasicMaterial({ color: word === "left" ? 0x7048e8 : 0xe8590c }));
      trace.frustumCulled = false;
      this.scene.add(trace);
      this.arms[word] = { frame, trace, points: [] };
      this.showGhost(word, null);
    }
    this.resize();
  }

  /** Show boxes around the robot: their poses (position [m], orientation w, x, y, z) and edges [m]. */
  showBoxes(boxes) {
    for (const each of this.boxes.children) each.geometry.dispose();
    this.boxes.clear();
    for (const { pose: { position: [x, y, z], orientation: [w, i, j, k] }, size } of boxes) {
      const geometry = new THREE.BoxGeometry(...size);
      const solid = new THREE.MeshStandardMaterial({ color: 0x9a8468, transparent: true, opacity: 0.45, roughness: 0.9, depthWrite: false });
      const box = new THREE.Mesh(geometry, solid);
      box.add(new THREE.LineSegments(new THREE.EdgesGeometry(geometry), new THREE.LineBasicMaterial({ color: 0x8a6d3b })));
      box.position.set(x, y, z);
      box.quaternion.set(i, j, k, w);
      this.boxes.add(box);
    }
    this.draw();
  }

  /** Draw a line between two points [m]; null removes it. Where its middle is on the canvas [pixels]. */
  showNearest(line) {
    const was = this.nearest.visible;
    this.nearest.visible = Boolean(line);
    if (!line) {
      if (was) this.draw();
      return null;
    }
    const [start, end] = line.map((point) => new THREE.Vector3(...point));
    const { position } = this.nearest.geometry.attributes;
    if (!was || start.distanceTo(new THREE.Vector3().fromBufferAttribute(position, 0)) > 5e-4) {
      position.setXYZ(0, ...start.toArray());
      position.setXYZ(1, ...end.toArray());
      position.needsUpdate = true;
      this.draw();
    }
    const middle = start.add(end).multiplyScalar(0.5).project(this.camera);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [((middle.x + 1) * width) / 2, ((1 - middle.y) * height) / 2];
  }

  /** Draw the paths of the fingertips on a plan: of each arm its joint positions [rad] one after the other. */
  showPath(arms) {
    for (const each of this.path.children) each.geometry.dispose();
    this.path.clear();
    for (const [word, points] of Object.entries(arms ?? {})) {
      const tips = points.map(([, position]) => {
        this.model.arms[word].joints.forEach((name, index) => this.ghost.set(name, position[index]));
        this.ghost.root.updateMatrixWorld(true);
        return new THREE.Vector3().setFromMatrixPosition(this.ghost.links[this.model.arms[word].tip].matrixWorld);
      });
      const line = new THREE.Line(
        new THREE.BufferGeometry().setFromPoints(tips),
        new THREE.LineBasicMaterial({ color: 0x2f7ff0, depthTest: false, transparent: true }),
      );
      line.renderOrder = 2;
      this.path.add(line);
    }
    this.draw();
  }

  /** Where the fingertips of an arm are and how they are turned. */
  tipPose(word) {
    const pose = { position: this.tip(word), quaternion: new THREE.Quaternion() };
    this.robot.links[this.model.arms[word].tip].getWorldQuaternion(pose.quaternion);
    return pose;
  }

  /** Show the handle at the fingertips of an arm; null removes it. @param mode translate or rotate. @param frame of its axes. */
  showHandle(word, mode = "translate", frame = "base", turned = null) {
    this.gizmo.enabled = Boolean(word);
    if (!word) {
      this.gizmo.detach();
      this.draw();
      return;
    }
    this.gizmo.setMode(mode);
    this.gizmo.setSpace(frame === "base" && !turned ? "world" : "local");
    if (this.gizmo.object !== this.handle) this.gizmo.attach(this.handle);
    this.placeHandle(word);
  }

  /** The handle is where the fingertips are. */
  placeHandle(word) {
    const { position, quaternion } = this.tipPose(word);
    if (this.handle.position.distanceTo(position) < 2e-4 && this.handle.quaternion.angleTo(quaternion) < 1e-3) return;
    this.handle.position.copy(position);
    this.handle.quaternion.copy(quaternion);
    this.draw();
  }

  /** Where the handle is on the canvas [pixels]; null while there is none. */
  handlePlace() {
    if (!this.gizmo.enabled) return null;
    const middle = this.handle.position.clone().project(this.camera);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [((middle.x + 1) * width) / 2, ((1 - middle.y) * height) / 2];
  }

  get isDragged() {
    return this.gizmo.dragging;
  }

  /** The handle's pose as x, y, z, w, x, y, z. */
  handlePose() {
    const { position, quaternion: turn } = this.handle;
    return [...position.toArray(), turn.w, turn.x, turn.y, turn.z];
  }

  /** By how much the handle is away from the fingertips of an arm: [m], and as a rotation vector [rad], in the body's frame. */
  pull(word) {
    const { position, quaternion } = this.tipPose(word);
    const turn = this.handle.quaternion.clone().multiply(quaternion.invert());
    if (turn.w < 0) turn.set(-turn.x, -turn.y, -turn.z, -turn.w);
    const size = Math.hypot(turn.x, turn.y, turn.z);
    const angle = size < 1e-9 ? 0 : (2 * Math.atan2(size, turn.w)) / size;
    return { way: this.handle.position.clone().sub(position).toArray(), turn: [turn.x * angle, turn.y * angle, turn.z * angle] };
  }

  /** Draw the work object's frame: {position, quaternion} as numbers; null removes it. */
  showWorkObject(pose) {
    this.workObject.visible = Boolean(pose);
    if (pose) {
      this.workObject.position.set(...pose.position);
      this.workObject.quaternion.set(...pose.quaternion);
    }
    this.draw();
  }

  resetCamera() {
    this.camera.position.set(...(this.model.camera?.position ?? [1.45, -1.05, 0.86]));
    this.controls.target.set(...(this.model.camera?.target ?? [0.05, -0.07, 0.22]));
    this.controls.update();
  }

  /** Show an arm at joint positions [rad] and its fingers at a distance from the middle [m]. */
  showArm(word, position, finger) {
    const arm = this.model.arms[word];
    const known = this.arms[word];
    const away = (values) => !values || position.some((value, index) => Math.abs(value - values[index]) > STILL);
    if (!(position && away(known.position)) && !(finger >= 0 && !(Math.abs(finger - known.finger) < 2e-5))) return;
    if (position) known.position = [...position];
    if (finger >= 0) known.finger = finger;
    if (position) {
      this.arms[word].isPlaced = true;
      arm.joints.forEach((name, index) => {
        this.robot.set(name, position[index]);
        this.ghost.set(name, this.arms[word].goal ? this.arms[word].goal[index] : position[index]);
      });
    }
    if (finger !== null && finger !== undefined) {
      for (const name of arm.fingers) {
        this.robot.set(name, finger);
        this.ghost.set(name, finger);
      }
    }
    this.draw();
  }

  /** Show a goal of an arm [rad]; null removes it. */
  showGhost(word, goal) {
    const before = this.arms[word].goal;
    if (before !== undefined && String(before) === String(goal)) return;
    this.arms[word].goal = goal;
    const first = this.model.joints.find((each) => each.name === this.model.arms[word].joints[0]);
    if (!first) return; // a robot without a description
    this.ghost.links[first.child].visible = Boolean(goal);
    if (goal) this.model.arms[word].joints.forEach((name, index) => this.ghost.set(name, goal[index]));
    this.draw();
  }

  /** Where the fingertips of an arm are [m]. */
  tip(word) {
    this.robot.root.updateMatrixWorld(true);
    return new THREE.Vector3().setFromMatrixPosition(this.robot.links[this.model.arms[word].tip].matrixWorld);
  }

  /** Append where the fingertips are to the trace of an arm. */
  addTrace(word) {
    const { points, trace } = this.arms[word];
    const tip = this.tip(word);
    const last = points[points.length - 1];
    if (last && last.distanceTo(tip) < 0.002) return;
    points.push(tip);
    if (points.length > TRACE) points.shift();
    const positions = trace.geometry.attributes.position;
    points.forEach((each, index) => positions.setXYZ(index, each.x, each.y, each.z));
    positions.needsUpdate = true;
    trace.geometry.setDrawRange(0, points.length);
  }

  clearTraces() {
    for (const arm of Object.values(this.arms)) {
      arm.points.length = 0;
      arm.trace.geometry.setDrawRange(0, 0);
    }
    this.draw();
  }

  setShown(what, isShown) {
    for (const arm of Object.values(this.arms)) arm[what].visible = isShown;
    this.draw();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.fov = width / height < 0.9 ? 40 : 30;
    this.camera.updateProjectionMatrix();
    this.renderer.render(this.scene, this.camera); // a canvas of another size is empty, and would be shown so
  }

  /** Draw soon, once for all that has changed. */
  draw() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      const begun = performance.now();
      this.renderer.render(this.scene, this.camera);
      this.gl.finish();
      this.slow = performance.now() - begun > SLOW ? this.slow + 1 : 0;
      if (this.slow >= 3 && this.renderer.getPixelRatio() > 0.5) {
        this.slow = 0;
        this.renderer.setPixelRatio(Math.max(0.5, this.renderer.getPixelRatio() * 0.7));
        this.resize();
      }
    });
  }
}
