// The keys of the canvas and their help. Held keys move the camera; all other keys are actions.

import {h} from "../lib/dom.js";

const kHeld = {
  ArrowLeft: "left",
  ArrowRight: "right",
  ArrowUp: "up",
  ArrowDown: "down",
  KeyW: "forward",
  KeyS: "back",
  KeyA: "strafeLeft",
  KeyD: "strafeRight",
  KeyE: "rise",
  KeyQ: "sink",
};
// Keys that are identified by their character. Other keys are identified by their position, but
// these keys have different positions on different keyboards.
const kHeldCharacters = {
  "+": "zoomIn",
  "=": "zoomIn",
  "-": "zoomOut",
  "_": "zoomOut"
};
const kActions = {
  f: "toggleFly",
  r: "reset",
  home: "reset",
  enter: "pickCenter",
  " ": "pickCenter",
  c: "pivotCenter",
  g: "toggleColor",
  m: "measure",
  p: "screenshot",
  o: "togglePanel",
  "?": "help",
  h: "help",
};

const kHelp = [
  ["Drag, one finger, arrow keys", "orbit; in flight look around"],
  ["Right button, Shift and drag, two fingers", "pan"],
  ["Wheel, pinch, + and −", "zoom, by wheel and pinch to the place under the pointer"],
  ["W A S D, E and Q", "fly forward, left, back, right, up and down; Shift: faster"],
  ["F", "switch between orbit and flight"],
  [
    "Double click or tap; C",
    "orbit around the place under the pointer; around the center of the picture"
  ],
  ["Click or tap; Enter", "pick a voxel; the one in the center of the picture"],
  ["M", "measure from the picked voxel"],
  ["R", "reset the camera"],
  ["G", "colors of the file, or gray"],
  ["P", "save the picture"],
  ["O", "show or hide the panel"],
  ["H", "this help"],
];

// Calls actions[name]() when the key of an action is pressed. `root` is the canvas or the window.
// With the window, the keys also work while nothing has the focus.
export function listenToKeys(root, canvas, motion, actions, onChange, signal) {
  const held = new Map();  // by event.code: a character may change while its key is down
  root.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target !== canvas && event.target !== document.body) return;
    const action = kActions[event.key.toLowerCase()];
    const motionKey = kHeld[event.code] ?? kHeldCharacters[event.key];
    if (!action && !motionKey) return;
    event.preventDefault();
    if (motionKey) {
      held.set(event.code, motionKey);
      motion.press(motionKey, event.shiftKey);
      onChange();
    } else if (!event.repeat) {
      actions[action]();
    }
  }, {signal});
  const release = (event) => {
    motion.fast = event.shiftKey;
    if (held.has(event.code)) motion.release(held.get(event.code));
    held.delete(event.code);
  };
  const releaseAll = () => {
    held.clear();
    motion.releaseAll();
  };
  root.addEventListener("keyup", release, {signal});
  canvas.addEventListener("blur", releaseAll, {signal});
  window.addEventListener("blur", releaseAll, {signal});
}

export function keysHelp() {
  return h(
      "dl", {class: "keys"},
      kHelp.map(([keys, what]) => h("div", {}, h("dt", {}, keys), h("dd", {}, what))));
}
