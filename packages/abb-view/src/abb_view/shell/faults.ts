/** The faults of a virtual robot, in groups and in words. */

import { capitalised, type ArmName, type Fault } from "./messages";

/** By group: the faults' names in commands, and what a person reads. */
export const GROUPS: Record<string, Record<string, string>> = {
  EGM: {
    "egm-silence": "No datagrams, both ways",
    "egm-repair": "All EGM faults end",
    "egm-loss": "Datagrams are lost",
    "egm-delay": "Datagrams arrive later",
    "egm-duplicate": "Datagrams arrive several times",
    "egm-reorder": "Datagrams overtake each other",
    "egm-stale": "An old datagram comes again",
    "egm-truncate": "Datagrams are truncated",
    "egm-forge": "Forged datagram, next number",
    "egm-forge-old": "Forged datagram, old number",
    "egm-forge-ahead": "Forged datagram, number far ahead",
    "egm-offset": "Measured joints are shifted",
    "egm-swap-arms": "The arms' datagrams are swapped",
    "egm-foreign-port": "Datagrams from another port",
    "comm-timeout": "Robot receives nothing (CommTimeout)",
    "egm-convergence": "EGM motion ends by itself",
  },
  "Stops and modes": {
    "emergency-stop": "Emergency stop is pressed",
    "emergency-stop-reset": "Emergency stop is released",
    "motors-off": "Motors Off is pressed",
    "program-stop": "Stop is pressed on the FlexPendant",
    collision: "Collision of an arm",
    "dynamic-load": "A drive is overloaded",
    "arm-pushed": "A person pushes an elbow",
    "manual-mode": "Key is turned to manual",
    "auto-mode": "Key is turned to AUTO",
    "wrong-program": "Another RAPID program is loaded",
    "right-program": "The right RAPID program is loaded",
  },
  "Web services (RWS)": {
    "warm-restart": "Controller restarts",
    "rws-reset": "Connections break",
    "rws-busy": "Busy: 503 to everything",
    "rws-sessions-expired": "Sessions are forgotten",
    "web-socket-drop": "Subscriptions' WebSockets break",
  },
  Gripper: {
    "gripper-not-calibrated": "Gripper loses its calibration",
    "gripper-error": "Gripper reports an error",
    "object-placed": "Part between the fingers",
    "object-under-cups": "Part under the cups",
    "object-lost": "Part is taken away",
  },
};

/** What a fault does, in a sentence of its own; then the arm that is chosen, if any is, and whether the fault stays. */
export function explanation(fault: Fault, arm: ArmName | null): string {
  const ofArm = fault.has_side && arm ? ` Chosen: the ${arm} arm.` : "";
  const endless = fault.has_duration && fault.default_duration === null ? " Without a duration it does not end by itself." : "";
  return `${capitalised(fault.meaning)}.${ofArm}${endless}`;
}

export interface FaultGroup {
  label: string;
  faults: { name: string; label: string }[];
}

/** The faults that a robot takes, in the order of the groups; what has no words here stands in a group of its own. */
export function faultGroups(faults: readonly Fault[]): FaultGroup[] {
  const offered = new Map(faults.map((each) => [each.name, each]));
  const known = Object.entries(GROUPS).map(([label, words]) => ({
    label,
    faults: Object.entries(words).filter(([name]) => offered.delete(name)).map(([name, word]) => ({ name, label: word })),
  }));
  const others = [...offered.values()].map(({ name, meaning }) => ({ name, label: meaning }));
  return [...known, { label: "Others", faults: others }].filter((group) => group.faults.length);
}
