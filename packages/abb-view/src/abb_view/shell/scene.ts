/** The robot in 3-D: links and joints as the description has them, goals as ghosts, frames, held parts and traces. */

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { TransformControls } from "three/addons/controls/TransformControls.js";

import type { Frame } from "./frames";
import { armsOf, type ArmModel, type ArmName, type Box, type Camera, type JointModel, type Joints, type Model, type PerArm, type PlanPoint, type Side, type Vector,
  type Visual } from "./messages";
import { readStl } from "./stl";

const TRACE = 400; // points of a trace
const STILL = 2e-4; // [rad] a smaller change is not drawn
const SLOW = 50; // [ms] a picture that takes longer, as without a graphics card, is drawn with fewer points
const PART: [number, number] = [0.022, 0.032]; // [m] of a part that is held, beside its width, which is measured
const COLOR = 0xe8590c; // of a trace
const LEFT_COLOR = 0x7048e8;
const CAMERA: Camera = { position: [1.45, -1.05, 0.86], target: [0.05, -0.07, 0.22], floor: -0.101 };

/** Where the robot stands in a headset: so far before the person's eyes, and its base so far below them [m]. */
const BEFORE = 0.9;
const BELOW = 0.6;
const HAND_COLORS = { idle: 0x868e96, engaged: 0x2f9e44, limited: 0xf08c00, inert: 0xc1121f } as const;
/** How an arm takes the clutch of a hand. */
export type HandColor = keyof typeof HAND_COLORS;

export type HandleMode = "translate" | "rotate";

function place<T extends THREE.Object3D>(object: T, { xyz, rpy }: { xyz: Vector; rpy: Vector }): T {
  object.position.set(...xyz);
  object.rotation.set(...rpy, "ZYX"); // URDF turns about fixed axes x, y, z
  return object;
}

interface Motion {
  motion: THREE.Group;
  axis: THREE.Vector3;
  type: JointModel["type"];
}

/** One robot of the description; several can be in a scene, such as the ghost. */
class Robot {
  readonly root: THREE.Group;
  private readonly links = new Map<string, THREE.Group>();
  private readonly joints = new Map<string, Motion>();

  constructor(model: Model, geometries: Map<Visual, THREE.BufferGeometry>, paint: (visual: Visual) => THREE.Material) {
    for (const [name, visuals] of Object.entries(model.links)) {
      const link = new THREE.Group();
      for (const visual of visuals) {
        const geometry = geometries.get(visual);
        if (!geometry) continue;
        const mesh = new THREE.Mesh(geometry, paint(visual));
        const placed = new THREE.Group();
        if (visual.shape === "cylinder") mesh.rotation.x = Math.PI / 2; // three.js has the axis along y
        placed.add(mesh);
        link.add(place(placed, visual));
      }
      this.links.set(name, link);
    }
    for (const joint of model.joints) {
      const frame = place(new THREE.Group(), joint);
      const motion = new THREE.Group();
      frame.add(motion);
      motion.add(this.link(joint.child));
      this.link(joint.parent).add(frame);
      this.joints.set(joint.name, { motion, axis: new THREE.Vector3(...joint.axis), type: joint.type });
    }
    const children = new Set(model.joints.map((each) => each.child));
    this.root = this.link(Object.keys(model.links).find((name) => !children.has(name)) ?? "");
  }

  link(name: string): THREE.Group {
    const link = this.links.get(name);
    if (!link) throw new Error(`The description has no link ${name}`);
    return link;
  }

  set(name: string, value: number): void {
    const joint = this.joints.get(name);
    if (joint?.type === "revolute") joint.motion.setRotationFromAxisAngle(joint.axis, value);
    else if (joint?.type === "prismatic") joint.motion.position.copy(joint.axis).multiplyScalar(value);
  }

  setAll(names: readonly string[], values: Joints): void {
    names.forEach((name, index) => this.set(name, values[index] ?? 0));
  }
}

/** What is drawn of an arm, and what of it was drawn last. */
class DrawnArm {
  readonly frame = new THREE.AxesHelper(0.08);
  readonly trace: THREE.Line;
  readonly part: THREE.Mesh;
  readonly points: THREE.Vector3[] = [];
  position: Joints | null = null;
  finger: number | null = null;
  goal: Joints | null | undefined = undefined;

  constructor(name: ArmName) {
    (this.frame.material as THREE.Material).depthTest = false;
    this.frame.renderOrder = 2;
    const line = new THREE.BufferGeometry();
    line.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * TRACE), 3));
    line.setDrawRange(0, 0);
    this.trace = new THREE.Line(line, new THREE.LineBasicMaterial({ color: name === "left" ? LEFT_COLOR : COLOR }));
    this.trace.frustumCulled = false;
    const material = new THREE.MeshStandardMaterial({ color: 0x2f9e44, roughness: 0.6 });
    this.part = new THREE.Mesh(new THREE.BoxGeometry(1, 1, 1), material);
    this.part.visible = false;
  }
}

function line(points: THREE.Vector3[], color: number): THREE.Line {
  const geometry = new THREE.BufferGeometry().setFromPoints(points);
  return new THREE.Line(geometry, new THREE.LineBasicMaterial({ color, depthTest: false, transparent: true }));
}

/** What is drawn of a hand of the person. */
function hand(): THREE.Mesh {
  const made = new THREE.Mesh(new THREE.SphereGeometry(0.02, 16, 12), new THREE.MeshBasicMaterial({ color: HAND_COLORS.idle }));
  made.add(new THREE.AxesHelper(0.08));
  made.matrixAutoUpdate = false;
  made.visible = false;
  return made;
}

function withSun(scene: THREE.Scene): void {
  scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 1.9));
  const lights: [number, Vector][] = [[2.1, [1.2, -1.4, 2.2]], [0.7, [0.6, 1.6, 0.6]]];
  for (const [intensity, position] of lights) {
    const light = new THREE.DirectionalLight(0xffffff, intensity);
    light.position.set(...position);
    scene.add(light);
  }
}

export class Scene {
  /** Called when a person begins to drag the handle, and when that ends. */
  onDrag: (isDragged: boolean) => void = () => undefined;

  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(32, 1, 0.05, 20);
  private readonly controls: OrbitControls;
  private readonly gizmo: TransformControls;
  private readonly handle = new THREE.Object3D(); // what a person drags
  private readonly boxes = new THREE.Group();
  private readonly nearest = line([new THREE.Vector3(), new THREE.Vector3()], 0xd6336c);
  private readonly path = new THREE.Group(); // of the fingertips on a plan
  private readonly workObject = new THREE.AxesHelper(0.12);
  private readonly arms: PerArm<DrawnArm> = {};
  private readonly gl: WebGLRenderingContext | WebGL2RenderingContext;
  private readonly person = new THREE.Group(); // where a headset's space is
  private readonly eyes = new THREE.PerspectiveCamera(60, 1, 0.05, 20); // of a headset
  private readonly hands: Record<Side, THREE.Mesh> = { right: hand(), left: hand() };
  private base: XRReferenceSpace | null = null;
  private robot!: Robot;
  private ghost!: Robot;
  private isDue = false;
  private slow = 0;
  private pause = 0; // [ms] after a slow picture, as long as that took: the page is read and operated meanwhile

  /** @param canvas where it is drawn. @param model of the robot, as /model.json has it. */
  constructor(private readonly canvas: HTMLCanvasElement, private readonly model: Model) {
    for (const name of armsOf(model)) this.arms[name] = new DrawnArm(name);
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.gl = this.renderer.getContext();
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.draw());
    this.resetCamera();
    withSun(this.scene);
    const grid = new THREE.GridHelper(2.4, 24, 0x888888, 0x888888);
    grid.rotation.x = Math.PI / 2;
    grid.position.z = (model.camera ?? CAMERA).floor;
    Object.assign(grid.material, { transparent: true, opacity: 0.28 });
    this.nearest.frustumCulled = false;
    this.nearest.renderOrder = 3;
    this.nearest.visible = false;
    this.workObject.visible = false;
    this.gizmo = new TransformControls(this.camera, canvas);
    this.gizmo.setSize(0.8);
    this.gizmo.enabled = false;
    this.gizmo.addEventListener("change", () => this.draw());
    this.gizmo.addEventListener("dragging-changed", ({ value }) => {
      this.controls.enabled = !value;
      this.onDrag(Boolean(value));
    });
    this.person.matrixAutoUpdate = false;
    this.person.add(this.eyes, this.hands.right, this.hands.left);
    this.scene.add(grid, this.boxes, this.nearest, this.path, this.workObject, this.handle, this.gizmo.getHelper());
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
  }

  /** Load the meshes and build the robot and its ghost. */
  async load(): Promise<void> {
    const geometries = await this.geometries();
    const paints = new Map<string, THREE.Material>();
    const paint = ({ color: [r, g, b] }: Visual): THREE.Material => {
      const key = `${r},${g},${b}`;
      const color = new THREE.Color().setRGB(r, g, b, THREE.SRGBColorSpace);
      const known = paints.get(key) ?? new THREE.MeshStandardMaterial({ color, roughness: 0.55, metalness: 0.04 });
      paints.set(key, known);
      return known;
    };
    this.robot = new Robot(this.model, geometries, paint);
    const glass = new THREE.MeshStandardMaterial({
      color: 0x2f7ff0, transparent: true, opacity: 0.32, depthWrite: false, roughness: 1,
      polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8, // behind the arm where it is as the arm is
    });
    const ofArms = new Map([...geometries].filter(([visual]) => !this.isOfBody(visual)));
    this.ghost = new Robot(this.model, ofArms, () => glass);
    this.scene.add(this.robot.root, this.ghost.root);
    for (const name of armsOf(this.model)) {
      const { frame, trace, part } = this.drawn(name);
      this.robot.link(this.arm(name).tip).add(frame, part);
      this.scene.add(trace);
      this.showGhost(name, null);
    }
    this.resize();
  }

  private async geometries(): Promise<Map<Visual, THREE.BufferGeometry>> {
    const visuals = Object.values(this.model.links).flat();
    const meshes = new Map<string, THREE.BufferGeometry>();
    await Promise.all(
      [...new Set(visuals.map((each) => each.mesh).filter(Boolean))].map(async (name) => {
        const answer = await fetch(`/meshes/${name}`);
        if (answer.ok) meshes.set(name, readStl(await answer.arrayBuffer()));
      }),
    );
    const geometries = new Map<Visual, THREE.BufferGeometry>();
    for (const visual of visuals) {
      const [radius, length] = [visual.radius?.[0] ?? 0, visual.length?.[0] ?? 0];
      const mesh = meshes.get(visual.mesh);
      if (visual.shape === "box") geometries.set(visual, new THREE.BoxGeometry(...(visual.size ?? [0, 0, 0])));
      else if (visual.shape === "sphere") geometries.set(visual, new THREE.SphereGeometry(radius, 32, 24));
      else if (visual.shape === "cylinder") geometries.set(visual, new THREE.CylinderGeometry(radius, radius, length, 40));
      else if (mesh) geometries.set(visual, mesh);
    }
    return geometries;
  }

  /** Whether a shape is of no arm: the ghost has none of these. */
  private isOfBody(visual: Visual): boolean {
    const firsts = new Set(armsOf(this.model).map((name) => this.firstLink(name)));
    const isOfArm = (link: string): boolean => {
      const joint = this.model.joints.find((each) => each.child === link);
      return firsts.has(link) || (joint !== undefined && isOfArm(joint.parent));
    };
    const link = Object.entries(this.model.links).find(([, visuals]) => visuals.includes(visual))![0];
    return !isOfArm(link);
  }

  /** That an arm begins with; nothing where the robot has no description. */
  private firstLink(name: ArmName): string | undefined {
    return this.model.joints.find((each) => each.name === this.arm(name).joints[0])?.child;
  }

  private arm(name: ArmName): ArmModel {
    return this.model.arms[name]!;
  }

  private drawn(name: ArmName): DrawnArm {
    return this.arms[name]!;
  }

  /** Show boxes around the robot: their poses (position [m], orientation w, x, y, z) and edges [m]. */
  showBoxes(boxes: readonly Box[]): void {
    for (const each of this.boxes.children) (each as THREE.Mesh).geometry.dispose();
    this.boxes.clear();
    for (const { pose: { position, orientation: [w, i, j, k] }, size } of boxes) {
      const geometry = new THREE.BoxGeometry(...size);
      const solid = new THREE.MeshStandardMaterial({ color: 0x9a8468, transparent: true, opacity: 0.45, roughness: 0.9, depthWrite: false });
      const box = new THREE.Mesh(geometry, solid);
      box.add(new THREE.LineSegments(new THREE.EdgesGeometry(geometry), new THREE.LineBasicMaterial({ color: 0x8a6d3b })));
      box.position.set(...position);
      box.quaternion.set(i, j, k, w);
      this.boxes.add(box);
    }
    this.draw();
  }

  /** Draw a line between two points [m]; null removes it. Where its middle is on the canvas [pixels]. */
  showNearest(ends: [Vector, Vector] | null): [number, number] | null {
    const was = this.nearest.visible;
    this.nearest.visible = ends !== null;
    if (!ends) {
      if (was) this.draw();
      return null;
    }
    const [start, end] = ends.map((point) => new THREE.Vector3(...point)) as [THREE.Vector3, THREE.Vector3];
    const position = this.nearest.geometry.getAttribute("position");
    if (!was || start.distanceTo(new THREE.Vector3().fromBufferAttribute(position, 0)) > 5e-4) {
      position.setXYZ(0, ...start.toArray());
      position.setXYZ(1, ...end.toArray());
      position.needsUpdate = true;
      this.draw();
    }
    return this.onCanvas(start.add(end).multiplyScalar(0.5));
  }

  private onCanvas(point: THREE.Vector3): [number, number] {
    const seen = point.clone().project(this.camera);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [((seen.x + 1) * width) / 2, ((1 - seen.y) * height) / 2];
  }

  /** Draw the paths of the fingertips on a plan; null removes them. */
  showPath(arms: PerArm<PlanPoint[]> | null): void {
    for (const each of this.path.children) (each as THREE.Line).geometry.dispose();
    this.path.clear();
    for (const name of armsOf(this.model)) {
      const tips = (arms?.[name] ?? []).map(([, position]) => {
        this.ghost.setAll(this.arm(name).joints, position);
        this.ghost.root.updateMatrixWorld(true);
        return new THREE.Vector3().setFromMatrixPosition(this.ghost.link(this.arm(name).tip).matrixWorld);
      });
      if (!tips.length) continue;
      const path = line(tips, 0x2f7ff0);
      path.renderOrder = 2;
      this.path.add(path);
    }
    this.draw();
  }

  /** Where the fingertips of an arm are and how they are turned. */
  tipFrame(name: ArmName): Frame {
    const { position, quaternion } = this.tipPose(name);
    return { position: position.toArray(), quaternion: quaternion.toArray() as Frame["quaternion"] };
  }

  /** Where tool0 of an arm is [m]. */
  flange(name: ArmName): Vector {
    return this.placeOf(this.arm(name).tool0).toArray();
  }

  private tipPose(name: ArmName): { position: THREE.Vector3; quaternion: THREE.Quaternion } {
    const { tip } = this.arm(name);
    return { position: this.placeOf(tip), quaternion: this.robot.link(tip).getWorldQuaternion(new THREE.Quaternion()) };
  }

  private placeOf(link: string): THREE.Vector3 {
    this.robot.root.updateMatrixWorld(true);
    return new THREE.Vector3().setFromMatrixPosition(this.robot.link(link).matrixWorld);
  }

  /** Show the handle at the fingertips of an arm; null removes it. @param inTool whether its axes are the tool's. */
  showHandle(name: ArmName | null, mode: HandleMode = "translate", inTool = false): void {
    this.gizmo.enabled = name !== null;
    if (!name) {
      this.gizmo.detach();
      this.draw();
      return;
    }
    this.gizmo.setMode(mode);
    this.gizmo.setSpace(inTool ? "local" : "world");
    if (this.gizmo.object !== this.handle) this.gizmo.attach(this.handle);
    this.placeHandle(name);
  }

  /** The handle is where the fingertips are. */
  placeHandle(name: ArmName): void {
    const { position, quaternion } = this.tipPose(name);
    if (this.handle.position.distanceTo(position) < 2e-4 && this.handle.quaternion.angleTo(quaternion) < 1e-3) return;
    this.handle.position.copy(position);
    this.handle.quaternion.copy(quaternion);
    this.draw();
  }

  /** Where the handle is on the canvas [pixels]; null while there is none. */
  handlePlace(): [number, number] | null {
    if (!this.gizmo.enabled) return null;
    this.handle.updateMatrixWorld();
    this.gizmo.getHelper().updateMatrixWorld(); // what a pointer takes there is right before the next picture, too
    return this.onCanvas(this.handle.position);
  }

  get isDragged(): boolean {
    return this.gizmo.dragging;
  }

  /** The handle's pose as x, y, z, w, x, y, z. */
  handlePose(): number[] {
    const { position, quaternion: turn } = this.handle;
    return [...position.toArray(), turn.w, turn.x, turn.y, turn.z];
  }

  /** By how much the handle is away from the fingertips of an arm: [m], and as a rotation vector [rad], in the body's frame. */
  pull(name: ArmName): { offset: Vector; turn: Vector } {
    const { position, quaternion } = this.tipPose(name);
    const turn = this.handle.quaternion.clone().multiply(quaternion.invert());
    if (turn.w < 0) turn.set(-turn.x, -turn.y, -turn.z, -turn.w);
    const size = Math.hypot(turn.x, turn.y, turn.z);
    const angle = size < 1e-9 ? 0 : (2 * Math.atan2(size, turn.w)) / size;
    return { offset: this.handle.position.clone().sub(position).toArray(), turn: [turn.x * angle, turn.y * angle, turn.z * angle] };
  }

  /** Draw the work object's frame; null removes it. */
  showWorkObject(frame: Frame | null): void {
    this.workObject.visible = frame !== null;
    if (frame) {
      this.workObject.position.set(...frame.position);
      this.workObject.quaternion.set(...frame.quaternion);
    }
    this.draw();
  }

  resetCamera(): void {
    const { position, target } = this.model.camera ?? CAMERA;
    this.camera.position.set(...position);
    this.controls.target.set(...target);
    this.controls.update();
  }

  /** Whether an arm was drawn where it is known to be. */
  isPlaced(name: ArmName): boolean {
    return this.drawn(name).position !== null;
  }

  /** Show an arm at joint positions [rad], its fingers at a distance from the middle [m], and a part that they hold. */
  showArm(name: ArmName, position: Joints | null, finger: number | null, isHolding: boolean): void {
    const { joints, fingers } = this.arm(name);
    const drawn = this.drawn(name);
    const isAway = position !== null && !drawn.position?.every((value, index) => Math.abs(position[index]! - value) <= STILL);
    const isOpened = finger !== null && !(drawn.finger !== null && Math.abs(finger - drawn.finger) < 2e-5);
    if (!isAway && !isOpened && drawn.part.visible === isHolding) return;
    if (isAway) {
      drawn.position = [...position];
      this.robot.setAll(joints, position);
      this.ghost.setAll(joints, drawn.goal ?? position);
    }
    if (isOpened) {
      drawn.finger = finger;
      for (const each of fingers) {
        this.robot.set(each, finger);
        this.ghost.set(each, finger);
      }
    }
    drawn.part.visible = isHolding;
    drawn.part.scale.set(2 * (drawn.finger ?? 0), ...PART);
    this.draw();
  }

  /** The arms between whose fingers a part is drawn. */
  heldParts(): ArmName[] {
    return armsOf(this.model).filter((name) => this.drawn(name).part.visible);
  }

  /** Show a goal of an arm [rad]; null removes it. */
  showGhost(name: ArmName, goal: Joints | null): void {
    const drawn = this.drawn(name);
    if (drawn.goal !== undefined && String(drawn.goal) === String(goal)) return;
    drawn.goal = goal;
    const first = this.firstLink(name);
    if (!first) return;
    this.ghost.link(first).visible = goal !== null;
    if (goal) this.ghost.setAll(this.arm(name).joints, goal);
    this.draw();
  }

  /** Append where the fingertips are to the trace of an arm. */
  addTrace(name: ArmName): void {
    const { points, trace } = this.drawn(name);
    const tip = this.placeOf(this.arm(name).tip);
    if (points.length && points[points.length - 1]!.distanceTo(tip) < 0.002) return;
    points.push(tip);
    if (points.length > TRACE) points.shift();
    const positions = trace.geometry.getAttribute("position");
    points.forEach((each, index) => positions.setXYZ(index, each.x, each.y, each.z));
    positions.needsUpdate = true;
    trace.geometry.setDrawRange(0, points.length);
  }

  clearTraces(): void {
    for (const { points, trace } of Object.values(this.arms)) {
      points.length = 0;
      trace.geometry.setDrawRange(0, 0);
    }
    this.draw();
  }

  setShown(what: "trace" | "frame", isShown: boolean): void {
    for (const arm of Object.values(this.arms)) arm[what].visible = isShown;
    this.draw();
  }

  /** Show the scene in a headset until its session ends; the space that it is seen in.
   *
   * @param yaw of the person from the robot [rad]. @param isDark whether nothing else is seen: then there is a background.
   * @param onFrame is called before each picture. */
  async enter(
    session: XRSession, yaw: number, isDark: boolean, onFrame: (time: number, frame: XRFrame) => void,
  ): Promise<XRReferenceSpace> {
    const { renderer, scene, person } = this;
    const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    // The headset's x, y, z are the robot's -y, z, -x where the person stands behind it.
    const turn = new THREE.Matrix4().set(s, 0, -c, 0, -c, 0, -s, 0, 0, 1, 0, 0, 0, 0, 0, 1);
    person.matrix.makeTranslation(-BEFORE * c, -BEFORE * s, BELOW).multiply(turn);
    person.matrixWorldNeedsUpdate = true; // three.js sees no change of a matrix that it does not make itself
    scene.add(person);
    if (isDark) scene.background = new THREE.Color(0xdfe4ea);
    renderer.xr.enabled = true;
    renderer.xr.setReferenceSpaceType("local");
    session.addEventListener("end", () => {
      renderer.setAnimationLoop(null);
      renderer.xr.enabled = false;
      scene.remove(person);
      for (const each of Object.values(this.hands)) each.visible = false;
      scene.background = null;
      this.resize();
    });
    await renderer.xr.setSession(session);
    this.base = renderer.xr.getReferenceSpace()!;
    renderer.setAnimationLoop((time: number, frame?: XRFrame) => {
      if (!frame) return;
      onFrame(time, frame);
      renderer.render(scene, this.eyes);
    });
    return this.base;
  }

  /** The space that a headset has begun with. */
  origin(): XRReferenceSpace {
    return this.base!;
  }

  /** See the scene from a space with another origin in the first one. */
  moveOrigin(offset: XRRigidTransform): XRReferenceSpace {
    const space = this.base!.getOffsetReferenceSpace(offset);
    this.renderer.xr.setReferenceSpace(space);
    return space;
  }

  /** Draw a hand of the person, at a matrix of the headset's. */
  showHand(name: Side, matrix: Float32Array): void {
    this.hands[name].matrix.fromArray(matrix);
    this.hands[name].matrixWorldNeedsUpdate = true;
    this.hands[name].visible = true;
  }

  colorHand(name: Side, color: HandColor): void {
    (this.hands[name].material as THREE.MeshBasicMaterial).color.setHex(HAND_COLORS[color]);
  }

  private resize(): void {
    if (this.renderer.xr.isPresenting) return; // the headset has a size of its own
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.fov = width / height < 0.9 ? 40 : 30;
    this.camera.updateProjectionMatrix();
    this.renderer.render(this.scene, this.camera); // a canvas of another size is empty, and would be shown so
  }

  /** Draw soon, once for all that has changed; a headset draws all of its pictures. */
  draw(): void {
    if (this.isDue || this.renderer.xr.isPresenting) return;
    this.isDue = true;
    const due = () => requestAnimationFrame(() => {
      this.isDue = false;
      if (this.renderer.xr.isPresenting) return;
      const begun = performance.now();
      this.renderer.render(this.scene, this.camera);
      this.gl.finish();
      const took = performance.now() - begun;
      this.pause = took > SLOW ? took : 0;
      this.slow = took > SLOW ? this.slow + 1 : 0;
      if (this.slow >= 3 && this.renderer.getPixelRatio() > 0.5) {
        this.slow = 0;
        this.renderer.setPixelRatio(Math.max(0.5, this.renderer.getPixelRatio() * 0.7));
        this.resize();
      }
    });
    if (this.pause) setTimeout(due, this.pause);
    else due();
  }
}
