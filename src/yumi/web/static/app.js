// The page: shows what the driver says of the robot, and asks for what a person presses. Angles are shown in degrees.

import * as program from "./program.js";
import { Scene } from "./scene.js";

const DEGREES = 180 / Math.PI;
const fixed = (value, digits) => value.toFixed(digits).replace(/^-(?=[0.]+$)/, ""); // zero has no sign
const MAX_JOINT_SPEED = 0.5; // [rad/s] as the server allows
const BEGINNING = 1; // [s] EGM that begins may be without datagrams for so long
const MAX_LINEAR = 0.15; // [m/s]
const MAX_ANGULAR = 0.5; // [rad/s]
const JOG_PERIOD = 20; // [ms] between two messages while a key is held; 60 ms after the last one the arm brakes
const PULL = 4; // [1/s] a tool follows its handle so fast
const STRIP = 300; // samples of a strip
let ARMS = ["right", "left"]; // as the model has them
const LOST = "The connection to yumi view is lost; is it still running? Where it was started anew, open the address that it has printed.";
const NOT_SENT = "Nothing was sent: the connection to yumi view is lost. To stop the robot, press the emergency stop.";

const at = (id) => document.getElementById(id);
const make = (tag, properties = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
};

let model;
let scene = null;
let stateTime = 0; // of the newest state, on the server's clock [s]
let limited = {}; // arms, with the two parts that must not come nearer to each other
let silentSince = Infinity; // when the robot began to run EGM without its datagrams, on the server's clock [s]
let nearest = null; // the parts that limit an arm, else those nearest to each other
let plan = null; // that is shown: {plan, duration, arms, time}
let workObject = JSON.parse(localStorage.getItem("work object") ?? "null"); // {position, quaternion x, y, z, w}
let state = null; // the newest, as the driver's DriverState
let view = { control: "none", why_no_robot: "The page is connecting.", why_not_operated: "", faults: [], events: [] };
let socket = null;
let shownArm = "right"; // the arm that is shown in the panel
let lastId = 0; // of requests
const pending = new Map();
let jog = null;
let holds = Date.now() % 1e9; // a hold has a number of its own, in each page
const rows = [];

// ---- the connection

/** What shows the server that this page may see the robot: the token of the address that was opened. It is kept for this
 * origin alone, port included, and in no cookie, which the servers of other ports would get, too. */
function withToken(path) {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given) {
    localStorage.setItem("token", given);
    history.replaceState(null, "", location.pathname); // so that the token is not left in the address bar
  }
  return `${path}?token=${encodeURIComponent(localStorage.getItem("token") ?? "")}`;
}

// The address of a server that was started anew, opened in this tab: a browser does not load the page again for it.
window.addEventListener("hashchange", () => location.reload());

function connect() {
  socket = new WebSocket(withToken(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`));
  socket.onmessage = ({ data }) => take(JSON.parse(data));
  socket.onclose = ({ reason }) => {
    endJog();
    forgetPlan();
    for (const { reject } of pending.values()) reject({ message: "The connection to yumi view is lost." });
    pending.clear();
    view = { ...view, control: "none", why_no_robot: reason || LOST };
    show();
    setTimeout(connect, 1000);
  };
}

/** Send to the server; whether it was sent: a person must not think that a stop was. */
function send(message) {
  const isOpen = socket && socket.readyState === WebSocket.OPEN;
  if (isOpen) socket.send(JSON.stringify(message));
  else if (message.type !== "seen") toast(NOT_SENT);
  return isOpen;
}

function take(message) {
  if (message.type === "state") {
    state = message.state;
    stateTime = message.time;
    limited = message.limited;
    nearest = message.nearest;
    silentSince = silentArms().length ? Math.min(silentSince, stateTime) : Infinity;
    sample();
    show();
    setTimeout(() => send({ type: "seen" }), 0); // after what is drawn
  } else if (message.type === "controller") {
    state = program.stateOf(message, view.controller);
    stateTime = message.time;
    program.show(message);
    show();
    setTimeout(() => send({ type: "seen" }), 0);
  } else if (message.type === "log") {
    program.addLog(message.lines);
  } else if (message.type === "events") {
    addEvents(message.events);
  } else if (message.type === "view") {
    if (view.control === "here" && message.control !== "here") {
      endJog();
      forgetPlan();
    }
    view = message;
    showSurroundings();
    at("events").replaceChildren();
    addEvents(message.events);
    if (message.why_no_robot) state = null;
    fillFaults();
    if (message.is_recording) openRecording();
    program.introduce(message);
    show();
  } else if (message.type === "refused") {
    endJog(); // control may be lost
    toast(message.sentence);
  } else if (message.type === "jog_refused") {
    if (jog?.hold !== message.hold) return; // it has ended already
    endJog();
    toast(message.error.message);
  } else if (message.type === "step" || message.type === "motions") {
    const waiting = pending.get(message.id);
    if (waiting && message.step) toast(message.step, "info");
  } else if (pending.has(message.id)) {
    const { resolve, reject } = pending.get(message.id);
    pending.delete(message.id);
    if (message.type === "done") resolve(message.result);
    else reject(message.error);
  }
}

/** Ask for something, and show how it ends. */
async function ask(message, button) {
  lastId += 1;
  const id = lastId;
  const end = new Promise((resolve, reject) => pending.set(id, { resolve, reject }));
  if (!send({ ...message, id })) {
    pending.delete(id);
    return null;
  }
  if (button) button.setAttribute("aria-busy", "true");
  try {
    const result = await end;
    const outcome = typeof result === "string" ? result : describe(result);
    if (outcome) toast(sentence(outcome), "info");
    return result;
  } catch (error) {
    toast(error.message);
    return null;
  } finally {
    if (button) button.removeAttribute("aria-busy");
  }
}

const request = (method, values, button) => ask({ type: "ask", request: { method, ...values } }, button);

function describe(result) {
  if (!result || !result.outcome) return "";
  const width = `${(result.width * 1000).toFixed(1)} mm`;
  return result.outcome === "holding" ? `The gripper holds something ${width} wide.` : `The gripper is ${result.outcome}, ${width} wide.`;
}

let toastTimer = 0;
function toast(message, level = "error") {
  const box = at("toast");
  box.textContent = withButtons(message);
  box.dataset.level = level;
  box.hidden = false;
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => (box.hidden = true), level === "error" ? 20000 : 4000);
}

// ---- showing

/** A sentence of the driver, with the page's buttons in place of the methods to call. */
function withButtons(message) {
  return model.buttons.reduce((named, [method, button]) => named.replace(new RegExp(method, "g"), button), message);
}

/** What to do about a reason, with the button that does it where there is one. */
function remedies(reason) {
  const found = view.is_recording ? [] : model.remedies.filter(({ pattern }) => new RegExp(pattern).test(reason));
  return found
    .map((each) => (view.is_virtual && each.on_virtual ? { remedy: each.on_virtual, button: each.button_on_virtual } : each))
    .filter(({ remedy }) => !(state.stop && remedy.startsWith("“Recover…”"))); // what confirms the stop does that, too
}

/** The id of the button that brings the robot nearer to motion; empty where there is none. */
function remedyButton() {
  if (view.control !== "here" || !state || view.why_no_robot) return "";
  const todo = remedies(state.reason);
  if (state.reason) return todo.every(({ button }) => button) ? (todo[0]?.button ?? "") : "";
  return ARMS.every((name) => state.egm[name] === "running") ? "" : "start";
}

/** The arms that the robot runs EGM on while its datagrams do not arrive. */
function silentArms() {
  return ARMS.filter((name) => state.egm[name] !== "running" && state.reason.includes(`${name} arm: RUN_EGM_ROUTINE`));
}

/** In a sentence whether the robot moves, else why not, and what to do. */
function verdict() {
  if (view.why_no_robot) return ["error", "No robot", view.why_no_robot];
  if (!state) return ["wait", "Waiting for the robot", ""];
  if (view.controller) return program.verdict(view.controller, state);
  let todo = remedies(state.reason).map(({ remedy }) => remedy).join("; ");
  if (todo && view.control === "none" && !view.why_not_operated) todo = `take control, then: ${todo}`;
  const silent = silentArms();
  if (stateTime - silentSince > BEGINNING && !state.stop && !state.cause) {
    const head = `Cannot move: the robot runs EGM on the ${silent.join(" and the ")} arm, but its datagrams do not arrive`;
    const check = view.is_virtual
      ? "end the faults of EGM with egm-repair"
      : "check the network cable, the UDP ports in this machine's firewall and the address in the controller's UDPUC device";
    const first = view.control === "none" && !view.why_not_operated ? "take control, then: " : "";
    return ["error", head, sentence(`${first}${check}; then press “Recover…”`)];
  }
  if (state.stop || state.cause) {
    // What the event log says to do is of use where nothing else is in the way now but a person who has to confirm.
    const [cause, ...advice] = (state.cause || state.reason).split("; ");
    const open = state.cause ? state.reason.split("; ").filter((each) => each && !(state.stop && each.includes(state.stop))) : [];
    const next = open.length ? `Now: ${sentence(open.join("; "), false)}.` : advice.length ? sentence(advice.join("; ")) : "";
    return ["error", `Stopped: ${sentence(cause, false)}`, [next, todo && sentence(todo)].filter(Boolean).join(" ")];
  }
  if (state.reason) return ["warn", `Cannot move: ${sentence(state.reason, false)}`, todo ? sentence(todo) : ""];
  for (const [name, arm] of Object.entries(state.arms)) {
    if (arm.problem) return ["warn", `The ${name} arm holds: ${sentence(arm.problem, false)}`, ""];
  }
  const held = view.is_recording ? [] : ARMS.filter((name) => limited[name]);
  if (held.length) {
    const pairs = held.map((name) => `the ${name} arm is kept apart: ${limited[name].part} – ${limited[name].other}`);
    return ["warn", sentence(pairs.join("; ")).slice(0, -1), `Move ${held.length > 1 ? "them" : "it"} away from there.`];
  }
  const moving = ARMS.filter((name) => state.arms[name].mode === "moving");
  if (moving.length) return ["good", `The ${moving.join(" and the ")} arm ${moving.length > 1 ? "move" : "moves"}`, ""];
  const running = ARMS.filter((name) => state.egm[name] === "running");
  if (running.length > 1) return ["good", "Ready: EGM holds both arms", ""];
  if (running.length) {
    const other = ARMS.find((name) => name !== running[0]);
    const start = view.is_recording || view.why_not_operated ? "" : `; ${view.control === "here" ? "" : "take control, then: "}press “Start EGM”`;
    return ["good", `Ready: EGM holds the ${running[0]} arm`, `The ${other} arm follows no commands${start}.`];
  }
  return ["warn", "Ready: EGM is off, the arms follow no commands", view.is_recording || view.why_not_operated ? "" : `${view.control === "here" ? "" : "Take control, then: "}press “Start EGM”.`.replace(/^p/, "P")];
}

function sentence(text, isWhole = true) {
  const bare = text.trim().replace(/\.$/, "");
  const begin = /^\w*_/.test(bare) ? bare.charAt(0) : bare.charAt(0).toUpperCase(); // cartesian_controller is a name
  return isWhole ? `${begin}${bare.slice(1)}.` : bare;
}

function text(element, value) {
  if (element.textContent !== value) element.textContent = value;
}

function show() {
  if (!model) return;
  const [level, ...sentences] = verdict();
  const [head, remedy] = view.is_recording ? sentences : sentences.map(withButtons); // a recording is shown as it was
  at("banner").dataset.level = level;
  text(at("verdict"), head);
  text(at("remedy"), remedy);
  showChips();
  showControl();
  if (state) {
    showArm();
    if (scene) {
      for (const name of ARMS) {
        const arm = state.arms[name];
        const gripper = state.grippers[name];
        scene.showArm(name, arm.position ?? arm.resting ?? (scene.arms[name].isPlaced ? null : model.arms[name].poses.home), gripper ? gripper.width / 2 : null);
        scene.showGhost(name, ghostOf(name, arm));
        if (arm.position && !view.is_recording) scene.addTrace(name);
      }
      if (handleMode() === "jog" && !scene.isDragged) scene.placeHandle(shownArm);
      at("scene").dataset.handle = scene.handlePlace() ?? "";
    }
    showNearest();
    const unmeasured = ARMS.filter((name) => !state.arms[name].position && !state.arms[name].resting);
    at("not-measured").hidden = !unmeasured.length;
    const which = unmeasured.length > 1 ? "The positions of both arms are not known: they are" : `The position of the ${unmeasured[0]} arm is not known: it is`;
    text(at("not-measured"), `${which} drawn where last seen, or at home.`);
    if (document.activeElement !== at("speed")) at("speed").value = Math.round(state.speed_scale * 100);
    text(at("speed-value"), `${Math.round(state.speed_scale * 100)} %`);
    const key = state.operating_mode === "AUTO" ? "Turn the key to MANUAL" : "Turn the key to AUTO";
    text(at("key"), key);
  }
}

/** What is drawn around the robot, and in which frames the tool may be jogged. */
function showSurroundings() {
  const boxes = view.surroundings?.boxes ?? [];
  scene?.showBoxes(boxes);
  const choice = at("jog-frame");
  const names = ["base", "tool", "work object", ...boxes.map((each) => each.name)];
  if ([...choice.options].map((each) => each.text).join() !== names.join()) {
    choice.replaceChildren(...names.map((name, index) => new Option(name, index < 3 ? name : `box ${name}`)));
  }
}

/** The line between the two parts nearest to each other, with their distance. */
function showNearest() {
  const apart = (distance) => (distance > 0 ? `${(distance * 1000).toFixed(0)} mm` : "at the limit");
  const place = scene?.showNearest(nearest && !view.is_recording ? [nearest.start, nearest.end] : null);
  const label = at("nearest");
  label.hidden = !nearest || Boolean(view.is_recording);
  if (!label.hidden) {
    const { part, other, distance } = nearest;
    text(label, `${part} – ${other}: ${apart(distance)}`);
    label.classList.toggle("limited", ARMS.some((name) => limited[name]));
    const { clientWidth, clientHeight } = at("scene");
    const within = (value, most) => Math.min(Math.max(value, 8), most);
    if (place) {
      label.style.left = `${within(place[0] + 10, clientWidth - label.offsetWidth - 8)}px`;
      label.style.top = `${within(place[1] - 28, clientHeight - 60)}px`;
    }
  }
}

/** The plan or pose that is previewed, or the goal of the active controller where it is not where the arm is. */
function ghostOf(name, arm) {
  if (plan) return plan.arms[name] ? pointOf(plan.arms[name], plan.time) : null;
  if (at("preview").getAttribute("aria-pressed") === "true" && (name === shownArm || at("both").checked)) return goalOf(name).joints;
  if (!arm.goal || !arm.position) return null;
  const away = Math.max(...arm.goal.map((value, index) => Math.abs(value - arm.position[index])));
  return away > 0.03 ? arm.goal : null;
}

const chips = new Map();
function chip(name, value, level = "") {
  if (!chips.has(name)) {
    const box = make("span", { className: "chip" }, make("em", { textContent: name }), make("b"));
    at("chips").append(box);
    chips.set(name, box);
  }
  const box = chips.get(name);
  text(box.lastChild, value);
  if (box.dataset.level !== level) box.dataset.level = level;
  box.hidden = Boolean(view.is_recording) && value === "unknown"; // a flight record has the cycles alone
}

const MOTORS = {
  motoron: "on", motoroff: "off", emergencystop: "emergency stop", emergencystopreset: "off after emergency stop",
  guardstop: "guard stop", sysfail: "system failure", init: "starting",
};

function showChips() {
  at("chips").hidden = !state;
  if (!state) return;
  const robot = [view.controller?.robot, state.robot].filter(Boolean).join(" at ");
  chip("robot", view.is_virtual ? `${robot}, virtual` : robot);
  chip("mode", state.operating_mode ?? "unknown", state.operating_mode === "AUTO" ? "good" : "warn");
  chip("motors", MOTORS[state.motors] ?? state.motors ?? "unknown", state.motors === "motoron" ? "good" : "warn");
  chip("program", state.program ?? "unknown", state.program === "running" ? "good" : "warn");
  for (const name of view.controller ? [] : ARMS) {
    const leading = state.controllers[name].filter((each) => each.commands).map((each) => each.name.replace("_controller", ""));
    const egm = state.egm[name] === "running" && leading.length ? leading.join(", ").replaceAll("_", " ") : state.egm[name];
    chip(`EGM ${name}`, egm, state.egm[name] === "running" ? "good" : "");
  }
  chip("speed", `${Math.round(state.speed_scale * 100)} %`, state.speed_scale < 1 ? "warn" : "");
}

let isOperated = false;
function showControl() {
  const has = view.control === "here";
  document.body.classList.toggle("operates", has);
  document.body.classList.toggle("records", Boolean(view.is_recording));
  at("take").hidden = Boolean(view.is_recording) || Boolean(view.why_not_operated && !has);
  text(at("take"), has ? "Give control back" : "Take control");
  at("take").classList.toggle("primary", !has);
  const mends = at(remedyButton() || "remedy-button");
  at("remedy-button").hidden = mends === at("remedy-button");
  at("remedy-button").dataset.presses = mends.id;
  if (!at("remedy-button").hidden) text(at("remedy-button"), mends.textContent);
  at("stop").hidden = at("take").hidden;
  at("robot-panel").hidden = !has;
  if (has !== isOperated) {
    isOperated = has;
    showHandle();
  }
  at("virtual-panel").hidden = !(has && view.is_virtual);
  const note = view.control === "elsewhere" ? "Another page has control." : view.why_not_operated;
  text(at("control-note"), has || view.is_recording || view.controller || view.why_no_robot ? "" : note || "You are looking only.");
}

function buildJoints() {
  const body = at("joints");
  for (let index = 0; index < Math.max(...ARMS.map((name) => model.arms[name].axes.length)); index += 1) {
    const marker = make("i", { className: "now" });
    const goal = make("i", { className: "goal" });
    const bar = make("div", { className: "bar" }, goal, marker);
    const value = make("td", { className: "number" });
    const error = make("td", { className: "number error" });
    const axis = model.arms[ARMS[0]].axes[index];
    const less = make("button", { textContent: "−", className: "hold", ariaLabel: `Jog axis ${axis} down` });
    const more = make("button", { textContent: "+", className: "hold", ariaLabel: `Jog axis ${axis} up` });
    less.dataset.jog = `joint ${index} -1`;
    more.dataset.jog = `joint ${index} 1`;
    const speeds = (sign) => () => ({
      type: "jog_joints", arm: shownArm,
      speeds: Array.from({ length: 7 }, (_, each) => (each === index ? sign * MAX_JOINT_SPEED * jogSpeed() : 0)),
    });
    holdable(less, speeds(-1));
    holdable(more, speeds(1));
    const { lower, upper } = model.limits;
    if (lower.length) bar.title = `${(lower[index] * DEGREES).toFixed(1)}° to ${(upper[index] * DEGREES).toFixed(1)}°`;
    body.append(
      make("tr", {}, make("th", { scope: "row", textContent: axis }), value, make("td", { className: "bar-cell" }, bar), error,
        make("td", { className: "jog-cell" }, less, more)),
    );
    rows.push({ marker, goal, value, error });
  }
}

function showArm() {
  const arm = state.arms[shownArm];
  const { lower, upper } = model.limits;
  const share = (value, index) => `${Math.min(100, Math.max(0, (100 * (value - lower[index])) / (upper[index] - lower[index])))}%`;
  rows.forEach(({ marker, goal, value, error }, index) => {
    const position = (arm.position ?? arm.resting)?.[index];
    text(value, position === undefined ? "–" : `${fixed(position * DEGREES, 2)}°`);
    marker.hidden = position === undefined || !lower.length;
    goal.hidden = !arm.goal;
    if (position !== undefined) {
      marker.style.left = share(position, index);
      const away = Math.min(position - lower[index], upper[index] - position);
      marker.classList.toggle("near", away < 0.09);
    }
    if (arm.goal) goal.style.left = share(arm.goal[index], index);
    const off = arm.position && arm.sent && state.egm[shownArm] === "running" ? (arm.sent[index] - position) * DEGREES : null;
    text(error, off === null ? "–" : `${fixed(off, 2)}°`);
  });
  const tip = scene && (arm.position ?? arm.resting) ? scene.tip(shownArm).toArray() : null;
  const frame = frameOf(at("jog-frame").value);
  const seen = tip && frame ? rotate(frame.quaternion, tip.map((value, axis) => value - frame.position[axis]), true) : tip;
  const numbers = seen?.map((value, axis) => `${"xyz"[axis]} ${fixed(value * 1000, 1)}`).join(", ");
  const source = arm.position ? "" : ", as the controller reports while EGM is off";
  const where = frame ? ` in ${at("jog-frame").selectedOptions[0].text}` : "";
  text(at("tool-pose"), seen ? `${model.tip ?? "Fingertips"} at ${numbers} mm${where}${source}` : arm.position || view.controller ? "" : "No positions: EGM does not run on this arm.");

  const gripper = state.grippers[shownArm];
  const parts = gripper
    ? [...(gripper.is_holding ? [] : [gripper.state]), `${(gripper.width * 1000).toFixed(1)} mm`, ...(gripper.is_holding ? [`holding with ${gripper.force.toFixed(0)} N`] : []),
      ...(gripper.is_calibrated ? [] : ["not calibrated"]), ...(gripper.error ? [`error ${gripper.error}`] : [])]
    : ["unknown"];
  text(at("gripper-text"), parts.join(", "));
  const apart = gripper ? Math.min(1, gripper.width / (2 * model.gripper.travel)) : 0;
  const [one, two] = at("gripper-bar").children;
  one.style.left = `${50 - 42 * apart}%`;
  two.style.left = `${50 + 42 * apart}%`;
  at("gripper-bar").classList.toggle("holding", Boolean(gripper?.is_holding));

  const controllers = state.controllers[shownArm].filter(({ name }) => !name.includes("broadcaster"));
  const choice = at("controller");
  if ([...choice.options].map((each) => each.value).join() !== controllers.map(({ name }) => name).join()) {
    choice.replaceChildren(...controllers.map(({ name }) => new Option("", name)));
  }
  controllers.forEach(({ name, commands }, index) => {
    text(choice.options[index], `${name.replace(/_controller$/, "").replaceAll("_", " ")}${commands ? " ✓" : ""}`);
  });
}

function addEvents(events) {
  for (const event of events) {
    const clock = new Date(event.time * 1000).toLocaleTimeString([], { hour12: false });
    const item = make("li", {}, make("time", { textContent: clock }), ` ${withButtons(event.sentence)}`);
    item.dataset.level = event.level;
    at("events").prepend(item);
  }
  while (at("events").childElementCount > 100) at("events").lastChild.remove();
}

// ---- strips

const strips = [
  { name: "tracking error", unit: "°", digits: 2, of: (arm) => (arm.position && arm.sent ? Math.max(...arm.sent.map((value, index) => Math.abs(value - arm.position[index]))) * DEGREES : null) },
  { name: "missed cycles", unit: "", digits: 0, of: (arm, before) => (arm.cycles && before?.cycles ? Math.max(0, arm.cycles.missed + arm.cycles.lost - before.cycles.missed - before.cycles.lost) : null), total: (arm) => (arm.cycles ? arm.cycles.missed + arm.cycles.lost : null) },
  { name: "jitter", unit: " ms", digits: 2, of: (arm) => (arm.cycles && arm.session ? arm.cycles.jitter * 1000 : null) },
  { name: "period", unit: " ms", digits: 2, of: (arm) => (arm.cycles && arm.session ? arm.cycles.period * 1000 : null) },
];
let before = null;
let isStripDue = 0;

function buildStrips() {
  for (const strip of strips) {
    strip.values = Object.fromEntries(ARMS.map((name) => [name, []]));
    strip.canvas = make("canvas", { width: 300, height: 40, className: "strip" });
    strip.label = make("span", { className: "strip-value" });
    strip.canvas.setAttribute("role", "img");
    strip.canvas.setAttribute("aria-label", strip.name);
    at("strips").append(make("div", { className: "strip-row" }, make("span", { className: "strip-name", textContent: strip.name }), strip.canvas, strip.label));
  }
}

function sample() {
  for (const strip of strips) {
    for (const name of ARMS) {
      const values = strip.values[name];
      values.push(strip.of(state.arms[name], before?.arms[name]));
      if (values.length > STRIP) values.shift();
    }
  }
  before = state;
  isStripDue += 1;
  if (isStripDue % 6 === 0) drawStrips();
}

function drawStrips() {
  const style = getComputedStyle(document.documentElement);
  for (const strip of strips) {
    const context = strip.canvas.getContext("2d");
    const { width, height } = strip.canvas;
    context.clearRect(0, 0, width, height);
    const all = ARMS.flatMap((name) => strip.values[name]).filter((value) => value !== null);
    const top = Math.max(1e-3, ...all) * 1.15;
    for (const name of ARMS) {
      context.strokeStyle = style.getPropertyValue(`--${name}`);
      context.lineWidth = 1.5;
      context.beginPath();
      strip.values[name].forEach((value, index) => {
        if (value === null) return;
        const x = width - (strip.values[name].length - index) * (width / STRIP);
        const y = height - 2 - ((height - 4) * value) / top;
        context.lineTo(x, y);
      });
      context.stroke();
    }
    const newest = (name) => (strip.total && state ? strip.total(state.arms[name]) : strip.values[name].at(-1));
    const shown = (value) => (value === null || value === undefined ? "–" : value.toFixed(strip.digits));
    text(strip.label, `${shown(newest("right"))} | ${shown(newest("left"))}${strip.unit}`);
  }
}

// ---- jogging: it moves while a key is held

const jogSpeed = () => Number(at("jog-speed").value) / 100;

function holdable(button, message) {
  const begin = () => beginJog(button, message);
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    begin();
  });
  const end = () => jog?.button === button && endJog(); // a button loses the focus after the next one was pressed
  for (const event of ["pointerup", "pointercancel", "lostpointercapture", "blur", "keyup"]) button.addEventListener(event, end);
  button.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    if (!event.repeat) begin();
  });
  button.addEventListener("contextmenu", (event) => event.preventDefault());
}

function beginJog(button, message, isDragged = false) {
  endJog();
  if (view.control !== "here") return;
  holds += 1;
  const first = message();
  if (!first) return;
  jog = { hold: holds, message: first, button };
  button.classList.add("held");
  // A speed that was chosen when the key was pressed stays; a handle is dragged on.
  const beat = () => {
    if (isDragged) jog.message = message();
    send({ ...jog.message, hold: jog.hold, seen: stateTime });
  };
  beat();
  jog.timer = setInterval(beat, JOG_PERIOD);
}

function endJog() {
  if (!jog) return;
  clearInterval(jog.timer);
  jog.button.classList.remove("held");
  const { type, arm, frame } = jog.message;
  const seen = stateTime;
  if (type === "jog_tool") send({ type, arm, frame, hold: jog.hold, seen });
  else send({ type, arm, hold: jog.hold, seen, speeds: [0, 0, 0, 0, 0, 0, 0] });
  jog = null;
}

function buildPad() {
  const axes = ["X", "Y", "Z"];
  const cells = [];
  axes.forEach((name, index) => {
    for (const sign of [-1, 1]) {
      cells.push([`${name}${sign < 0 ? "−" : "+"}`, `linear ${name.toLowerCase()} ${sign}`, { linear: unit(index, sign * MAX_LINEAR) }]);
    }
    for (const sign of [-1, 1]) {
      cells.push([`R${name.toLowerCase()}${sign < 0 ? "−" : "+"}`, `angular ${name.toLowerCase()} ${sign}`, { angular: unit(index, sign * MAX_ANGULAR) }]);
    }
  });
  cells.push(["elbow −", "elbow -1", { elbow: -MAX_JOINT_SPEED }], ["elbow +", "elbow 1", { elbow: MAX_JOINT_SPEED }]);
  for (const [label, name, speeds] of cells) {
    const button = make("button", { textContent: label, className: "hold" });
    button.dataset.jog = name;
    if (label.startsWith("elbow")) button.classList.add("wide");
    holdable(button, () => toolJog(speeds));
    at("pad").append(button);
  }
}

const unit = (axis, value) => [0, 1, 2].map((each) => (each === axis ? value : 0));

/** Speeds of the tool in the frame that is chosen, as a message; null, with a reason for a person, where there is no such frame. */
function toolJog({ linear, angular, elbow }) {
  const name = at("jog-frame").value;
  const frame = frameOf(name);
  if (!frame && !["base", "tool"].includes(name)) {
    toast("There is no work object yet: bring the fingertips to it and press “Work object here”.");
    return null;
  }
  const turned = (speeds) => speeds.map((each) => each * jogSpeed());
  const message = { type: "jog_tool", arm: shownArm, frame: name === "tool" ? "tool" : "base" };
  if (linear) message.linear = frame ? rotate(frame.quaternion, turned(linear)) : turned(linear);
  if (angular) message.angular = frame ? rotate(frame.quaternion, turned(angular)) : turned(angular);
  if (elbow) message.elbow = elbow * jogSpeed();
  return message;
}

/** The frame of the work object or of a box: its position [m] and quaternion x, y, z, w; null for the base and the tool. */
function frameOf(name) {
  if (name === "work object") return workObject;
  const box = view.surroundings?.boxes.find((each) => name === `box ${each.name}`);
  if (!box) return null;
  const { position, orientation: [w, x, y, z] } = box.pose;
  return { position, quaternion: [x, y, z, w] };
}

/** A vector turned by a quaternion x, y, z, w, or back. */
function rotate([x, y, z, w], [a, b, c], isBack = false) {
  const [i, j, k] = isBack ? [-x, -y, -z] : [x, y, z];
  const [p, q, r] = [2 * (j * c - k * b), 2 * (k * a - i * c), 2 * (i * b - j * a)];
  return [a + w * p + j * r - k * q, b + w * q + k * p - i * r, c + w * r + i * q - j * p];
}

// The handle in the picture: the tool follows it while it is dragged, or it is a goal for a plan.

const handleMode = () => (view.control === "here" && scene ? at("handle").value.split(" ")[0] : "none");

function showHandle() {
  if (!scene) return;
  const [mode, kind] = at("handle").value.split(" ");
  const isShown = view.control === "here" && mode !== "none";
  scene.showHandle(isShown ? shownArm : null, kind, at("jog-frame").value === "tool" ? "tool" : "base");
}

function followHandle() {
  const { way, turn } = scene.pull(shownArm);
  const toward = (vector, most) => {
    const size = Math.hypot(...vector) || 1;
    return vector.map((value) => (value / size) * Math.min(PULL * size, most * jogSpeed()));
  };
  const isTurned = at("handle").value.endsWith("rotate");
  const still = [0, 0, 0];
  return {
    type: "jog_tool", arm: shownArm, frame: "base",
    linear: isTurned ? still : toward(way, MAX_LINEAR), angular: isTurned ? toward(turn, MAX_ANGULAR) : still,
  };
}

// Keys on the picture: arrows and page keys move the tool, with Shift they turn it, Home and End turn the elbow.

const KEYS = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [1, 1], ArrowRight: [1, -1], PageUp: [2, 1], PageDown: [2, -1] };

function jogByKey(event) {
  const elbow = { Home: -MAX_JOINT_SPEED, End: MAX_JOINT_SPEED }[event.key];
  if (view.is_recording || event.ctrlKey || event.altKey || event.metaKey || !(event.key in KEYS || elbow)) return;
  event.preventDefault();
  if (event.repeat) return;
  if (view.control !== "here") {
    toast(view.why_not_operated || "Take control first; then this key jogs the tool while it is held.", "info");
    return;
  }
  const [axis, sign] = KEYS[event.key] ?? [];
  const speeds = elbow ? { elbow } : event.shiftKey ? { angular: unit(axis, sign * MAX_ANGULAR) } : { linear: unit(axis, sign * MAX_LINEAR) };
  beginJog(at("scene"), () => toolJog(speeds));
  if (jog) jog.key = event.key;
}

// ---- plans

/** The number in a field; null where it is empty, no number or not allowed: empty does not mean zero. */
const numberOf = (input) => (input.checkValidity() && Number.isFinite(input.valueAsNumber) ? input.valueAsNumber : null);

/** The goal that is chosen for an arm: as the driver takes it, and joint positions [rad] where they are known here; null where a field has no number. */
function goalOf(name) {
  const choice = at("pose").value;
  if (choice === "the handle") return { goal: scene.handlePose(), isPose: true, joints: null };
  if (choice === "joint positions") {
    const angles = [...at("joint-goal").querySelectorAll("input")].map(numberOf);
    const joints = angles.includes(null) ? null : angles.map((angle) => angle / DEGREES);
    return { goal: joints, isPose: false, joints };
  }
  return { goal: choice, isPose: false, joints: model.arms[name].poses[choice] };
}

/** The goals of the arms that are meant; null, with a reason for a person, where one is incomplete. */
function chosenGoals() {
  const names = at("both").checked && !at("both").disabled ? ARMS : [shownArm];
  const goals = Object.fromEntries(names.map((name) => [name, goalOf(name).goal]));
  if (!Object.values(goals).includes(null)) return goals;
  const wrong = [...at("joint-goal").querySelectorAll("input")].find((input) => numberOf(input) === null);
  toast(`Nothing was sent: ${wrong ? `axis ${wrong.dataset.axis} takes a number from ${wrong.title}` : "the goal needs a number for each axis"}.`);
  return null;
}

async function makePlan(button) {
  forgetPlan();
  const goals = chosenGoals();
  if (!goals) return;
  const made = await ask({ type: "plan", is_pose: goalOf(shownArm).isPose, ...goals }, button);
  if (!made) return;
  plan = { ...made, time: 0 };
  at("plan-box").hidden = false;
  const slider = at("plan-time");
  slider.max = made.duration;
  const apart = made.clearance > 0 ? `at least ${(made.clearance * 1000).toFixed(0)} mm from everything` : "touching nothing";
  text(at("plan-text"), `A motion of ${made.duration.toFixed(1)} s, ${apart}, found in ${made.planning_time.toFixed(1)} s. Nothing moves before Execute.`);
  scene?.showPath(made.arms);
  const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
  let last = performance.now();
  const play = (now) => {
    if (plan?.plan !== made.plan) return;
    if (document.activeElement !== slider && !isStill) showPlan((plan.time + Math.min(0.2, (now - last) / 1000)) % (made.duration + 0.6));
    last = now;
    requestAnimationFrame(play);
  };
  requestAnimationFrame(play);
  showPlan(isStill ? made.duration : 0);
}

function showPlan(time) {
  plan.time = time;
  at("plan-time").value = Math.min(time, plan.duration);
  for (const name of ARMS) if (state) scene?.showGhost(name, ghostOf(name, state.arms[name]));
}

/** Where a planned arm is at a time: between two of its points. */
function pointOf(points, time) {
  const index = Math.max(0, Math.min(points.length - 2, indexAt(points.map(([each]) => each), time)));
  const [[begin, from], [end, to]] = [points[index], points[index + 1]];
  const share = Math.min(1, Math.max(0, (time - begin) / (end - begin || 1)));
  return from.map((value, joint) => value + share * (to[joint] - value));
}

function forgetPlan() {
  plan = null;
  at("plan-box").hidden = true;
  scene?.showPath(null);
}

function fillGoals() {
  const isHandle = at("pose").value === "the handle";
  at("both").disabled = !(at("pose").value in model.arms[ARMS[0]].poses);
  at("joint-goal").hidden = at("pose").value !== "joint positions";
  at("preview").disabled = isHandle;
  if (isHandle) at("preview").setAttribute("aria-pressed", "false");
  at("move").disabled = isHandle;
  const arm = state?.arms[shownArm];
  const now = arm?.position ?? arm?.resting;
  if (!at("joint-goal").hidden) {
    at("joint-goal").querySelectorAll("input").forEach((each, index) => (each.value = now ? (now[index] * DEGREES).toFixed(1) : ""));
  }
  if (isHandle && !at("handle").value.startsWith("goal")) {
    at("handle").value = "goal translate";
    showHandle();
  }
  show();
}

// ---- buttons

function choose(name) {
  endJog();
  shownArm = name;
  showHandle();
  for (const each of ARMS) at(`tab-${each}`).setAttribute("aria-selected", String(each === name));
  at("arm-panel").setAttribute("aria-labelledby", `tab-${name}`);
  at("preview").setAttribute("aria-pressed", "false");
  fillGoals(); // with what this arm does: the goal of the other one is not meant
}

function fillFaults() {
  const choice = at("fault");
  if (choice.options.length === view.faults.length) return;
  choice.replaceChildren(...view.faults.map((each) => new Option(each.name, each.name)));
  explainFault();
}

function explainFault() {
  const fault = view.faults.find((each) => each.name === at("fault").value);
  text(at("fault-meaning"), fault ? sentence(`${fault.meaning}${fault.has_side ? `, of the ${shownArm} arm` : ""}`) : "");
  at("fault-by").parentElement.hidden = !fault?.unit;
  at("fault-by").value = fault?.default ?? "";
  text(at("fault-unit"), fault?.unit ?? "");
  at("fault-duration").parentElement.hidden = !fault?.has_duration;
  at("fault-duration").value = fault?.default_duration ?? "";
}

function inject(name, form, button) {
  return ask({ type: "inject", name, form }, button);
}

function confirmStop() {
  text(at("confirm-cause"), sentence((state.cause || state.reason).split("; ")[0]));
  const dialog = at("confirm");
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), { once: true });
    dialog.returnValue = "no";
    dialog.showModal();
  });
}

function bind() {
  const closeToast = () => (at("toast").hidden = true);
  at("toast").addEventListener("click", closeToast);
  document.addEventListener("keydown", (event) => event.key === "Escape" && closeToast());
  const press = (id, action) => at(id).addEventListener("click", () => action(at(id)));
  press("take", () => send({ type: view.control === "here" ? "give_back" : "take_control" }));
  press("remedy-button", (button) => at(button.dataset.presses).click());
  press("stop", (button) => {
    endJog();
    request("stop_egm", {}, button);
  });
  press("start", (button) => request("start_egm", {}, button));
  press("recover", async (button) => {
    const { stop } = state;
    if (stop && !(await confirmStop())) return;
    await request("recover", { confirm: stop }, button);
  });
  press("calibrate", (button) => request("calibrate", {}, button));
  at("speed").addEventListener("change", () => request("set_speed_scale", { speed_scale: Number(at("speed").value) / 100 }));
  const shown = () => text(at("jog-speed-value"), `${at("jog-speed").value} %`);
  at("jog-speed").addEventListener("input", shown);
  shown();
  for (const name of ARMS) {
    press(`tab-${name}`, () => choose(name));
    at(`tab-${name}`).addEventListener("keydown", (event) => {
      if (!["ArrowLeft", "ArrowRight"].includes(event.key)) return;
      const other = ARMS.find((each) => each !== name);
      choose(other);
      at(`tab-${other}`).focus();
    });
  }
  const goals = [...Object.keys(model.arms[ARMS[0]].poses), "joint positions", "the handle"];
  at("pose").replaceChildren(...goals.map((name) => new Option(name, name)));
  model.arms[ARMS[0]].axes.forEach((axis, index) => {
    if (!model.limits.lower.length) return;
    const [lower, upper] = [model.limits.lower[index], model.limits.upper[index]].map((each) => each * DEGREES);
    const range = `${lower.toFixed(1)}° to ${upper.toFixed(1)}°`;
    const input = make("input", { type: "number", step: "any", min: lower, max: upper, title: range, ariaLabel: `Axis ${axis}, degrees` });
    input.dataset.axis = axis;
    input.addEventListener("input", show);
    at("joint-goal").append(make("label", {}, `${axis}`, input));
  });
  press("preview", (button) => {
    button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
    show();
  });
  at("pose").addEventListener("change", fillGoals);
  at("both").addEventListener("change", show);
  press("move", (button) => {
    forgetPlan();
    const goals = chosenGoals();
    if (goals) request("move", goals, button);
  });
  press("plan", makePlan);
  press("discard", forgetPlan);
  press("execute", async (button) => {
    const { plan: planned } = plan;
    await ask({ type: "execute", plan: planned }, button);
    if (plan?.plan === planned) forgetPlan();
  });
  at("plan-time").addEventListener("input", () => plan && showPlan(Number(at("plan-time").value)));
  at("jog-frame").addEventListener("change", () => {
    at("work-object").hidden = at("jog-frame").value !== "work object";
    scene?.showWorkObject(at("work-object").hidden ? null : workObject);
    showHandle();
    show();
  });
  press("work-object", () => {
    if (!scene) return;
    const { position, quaternion } = scene.tipPose(shownArm);
    workObject = { position: position.toArray(), quaternion: quaternion.toArray() };
    localStorage.setItem("work object", JSON.stringify(workObject));
    scene.showWorkObject(workObject);
    show();
  });
  at("handle").addEventListener("change", () => {
    if (at("handle").value.startsWith("goal")) at("pose").value = "the handle";
    else if (at("pose").value === "the handle") at("pose").value = Object.keys(model.arms[ARMS[0]].poses)[0];
    fillGoals();
    showHandle();
  });
  at("scene").addEventListener("keydown", jogByKey);
  at("scene").addEventListener("keyup", (event) => jog?.key === event.key && endJog());
  for (const event of ["blur", "pointercancel", "lostpointercapture"]) {
    at("scene").addEventListener(event, () => jog?.button === at("scene") && endJog());
  }
  press("activate", (button) => {
    const leading = state.controllers[shownArm].filter((each) => each.commands).map((each) => each.name);
    const activate = at("controller").value;
    request("switch_controllers", { arm: shownArm, activate: [activate], deactivate: leading.filter((name) => name !== activate) }, button);
  });
  const withNumber = (id, what, unit, action) => (button) => {
    const value = numberOf(at(id));
    if (value !== null) action(value, button);
    else toast(`Nothing was sent: the ${what} must be a number from ${at(id).min} to ${at(id).max} ${unit}.`);
  };
  const grip = (asked, button) => request("grip", { arm: shownArm, ...asked }, button);
  press("open", withNumber("open-width", "width", "mm", (width, button) => grip({ action: "open", width: width / 1000 }, button)));
  press("close", withNumber("grip-force", "force", "N", (force, button) => grip({ action: "close", force }, button)));
  press("press-stop", (button) => inject("emergency-stop", {}, button));
  press("release-stop", (button) => inject("emergency-stop-reset", {}, button));
  press("key", (button) => inject(state.operating_mode === "AUTO" ? "manual-mode" : "auto-mode", {}, button));
  press("put-part", withNumber("part-width", "width", "mm", (by, button) => inject("object-placed", { side: shownArm, by: `${by}` }, button)));
  press("put-cup", (button) => inject("object-under-cups", { side: shownArm }, button));
  press("take-part", (button) => inject("object-lost", { side: shownArm }, button));
  press("push", withNumber("push-by", "angle", "degrees", (by, button) => inject("arm-pushed", { side: shownArm, by: `${by}` }, button)));
  at("fault").addEventListener("change", explainFault);
  press("inject", (button) => {
    const fault = view.faults.find((each) => each.name === at("fault").value);
    const by = fault.unit && at("fault-by").value !== "" ? { by: at("fault-by").value } : {};
    const duration = fault.has_duration && at("fault-duration").value !== "" ? { duration: at("fault-duration").value } : {};
    inject(fault.name, { ...(fault.has_side ? { side: shownArm } : {}), ...by, ...duration }, button);
  });
  at("show-trace").addEventListener("change", ({ target }) => scene?.setShown("trace", target.checked));
  at("show-frame").addEventListener("change", ({ target }) => scene?.setShown("frame", target.checked));
  press("reset-view", () => scene?.resetCamera());
  press("clear-trace", () => scene?.clearTraces());
  for (const end of ["blur", "pagehide"]) window.addEventListener(end, endJog);
  document.addEventListener("visibilitychange", () => document.hidden && endJog());
}

// ---- recordings

let recording = null;

async function openRecording() {
  if (recording) return;
  recording = await (await fetch(withToken("/recording.json"))).json();
  document.title = recording.name;
  const slider = at("time");
  slider.max = recording.duration;
  at("player").hidden = false;
  at("control-note").textContent = "";
  recording.events.forEach((event) => {
    const mark = make("i", { title: event.sentence });
    mark.style.left = `${(100 * event.time) / (recording.duration || 1)}%`;
    mark.dataset.level = event.is_fault ? "error" : "info";
    at("marks").append(mark);
    const seek = make("button", { className: "link", textContent: `${event.time.toFixed(2)} s` });
    seek.addEventListener("click", () => showTime(event.time));
    const item = make("li", {}, seek, ` ${event.sentence}`);
    item.dataset.level = event.is_fault ? "error" : "info";
    item.dataset.time = event.time;
    at("events").append(item);
  });
  slider.addEventListener("input", () => showTime(Number(slider.value)));
  let last = 0;
  const play = (now) => {
    if (at("play").getAttribute("aria-pressed") !== "true") return;
    const time = Number(slider.value) + Math.min(0.2, (now - last) / 1000);
    last = now;
    showTime(Math.min(time, recording.duration));
    if (time >= recording.duration) pressed(false);
    else requestAnimationFrame(play);
  };
  const pressed = (isPlaying) => {
    at("play").setAttribute("aria-pressed", String(isPlaying));
    text(at("play"), isPlaying ? "Pause" : "Play");
  };
  at("play").addEventListener("click", () => {
    const begins = at("play").getAttribute("aria-pressed") !== "true";
    if (begins && Number(slider.value) >= recording.duration) showTime(0);
    pressed(begins);
    if (begins) requestAnimationFrame((now) => { last = now; play(now); });
  });
  fillStrips();
  showTime(0);
  const recorded = ARMS.find((name) => recording.arms[name].time.length);
  if (recorded) choose(recorded); // a flight record has one arm alone
}

/** The last index of sorted times that is not after a time, or -1. */
function indexAt(times, time) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time + 1e-6) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

function showTime(time) {
  at("time").value = time;
  text(at("clock"), `${time.toFixed(2)} s`);
  state = recordedState(time);
  const events = [...at("events").children];
  events.forEach((item) => item.classList.toggle("past", Number(item.dataset.time) <= time + 1e-6));
  const current = events.filter((item) => Number(item.dataset.time) <= time + 1e-6).at(-1);
  events.forEach((item) => item.classList.toggle("current", item === current));
  show();
}

/** What the driver would have said at a time of the recording. */
function recordedState(time) {
  const newest = (items) => items[indexAt(items.map((each) => each.time), time)] ?? null;
  const robot = newest(recording.states) ?? {};
  const arms = {};
  const grippers = {};
  const egm = {};
  for (const name of ARMS) {
    const cycles = recording.arms[name];
    const index = indexAt(cycles.time, time);
    const running = index >= 0 && cycles.is_running[index] && time - cycles.time[index] < 1;
    arms[name] = {
      mode: running ? "holding" : "no_egm", problem: "", cycles: null, session: 0,
      position: cycles.position[Math.max(index, 0)] ?? null,
      velocity: cycles.velocity[Math.max(index, 0)] ?? null,
      sent: index < 0 ? null : cycles.sent[index],
      goal: index < 0 ? null : cycles.reference[index],
    };
    if (running && Math.max(...arms[name].velocity.map(Math.abs)) > 0.01) arms[name].mode = "moving";
    egm[name] = running ? "running" : robot.egm?.[name[0]] === "running" ? "running" : "off";
    const gripper = newest(recording.grippers[name]);
    grippers[name] = gripper && {
      state: String(gripper.state).toLowerCase().replaceAll("_", " "), width: 2 * gripper.position, force: gripper.force,
      is_holding: gripper.state === "KEEP_OBJECT", is_calibrated: gripper.is_calibrated, error: gripper.error,
    };
  }
  const event = recording.events[indexAt(recording.events.map((each) => each.time), time)];
  const fault = event && event.is_fault && time - event.time < 2 ? event.sentence : "";
  return {
    robot: recording.name, operating_mode: robot.operating_mode, motors: robot.controller_state, program: robot.execution,
    speed_scale: robot.speed_scale ?? 1, reason: robot.reason ?? "", cause: robot.cause || fault, stop: robot.stop ?? "",
    arms, grippers, egm, controllers: { right: [], left: [] },
  };
}

function fillStrips() {
  for (const strip of strips.slice(1)) strip.canvas.parentElement.hidden = true;
  for (const name of ARMS) {
    const { time, position, sent } = recording.arms[name];
    strips[0].values[name] = Array.from({ length: STRIP }, (_, index) => {
      const found = indexAt(time, (recording.duration * index) / (STRIP - 1));
      return found < 0 ? null : strips[0].of({ position: position[found], sent: sent[found] });
    });
  }
  drawStrips();
}

// ---- begin

async function begin() {
  model = await (await fetch("/model.json")).json();
  ARMS = Object.keys(model.arms);
  [shownArm] = ARMS;
  program.buildTabs(ARMS);
  buildJoints();
  buildPad();
  buildStrips();
  bind();
  try {
    scene = new Scene(at("scene"), model);
    await scene.load();
    scene.onDrag = (isDragged) => {
      if (isDragged && handleMode() === "jog") beginJog(at("scene"), followHandle, true);
      else if (!isDragged && jog?.button === at("scene")) endJog();
    };
  } catch (error) {
    console.error(error);
    scene = null;
    at("no-webgl").hidden = false;
  }
  connect();
}

begin();
