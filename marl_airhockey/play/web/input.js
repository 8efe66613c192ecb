// Steering: pointer, stick and arrow keys.

import { isCongested } from "./connection.js";
import { steersBy } from "./device.js";
import { game, linkRate, on, probe, send } from "./state.js";
import { correct, own, remember } from "./prediction.js";

const ABOVE = 60; // CSS px from a finger up to the paddle
const SHRINKS = 0.5; // share of the height above the lower edge of the table, which bounds that
const GAP = { 60: 6, 30: 25, 10: 70 }; // ms between two aims, by the frames a second of the link
const UNSENT = 2000; // bytes that may wait when an aim is added
const STICK = 2000; // ms for which a stick that rests still steers
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export const steering = {
  pointer: null, // aim, table frame, m
  held: false, // a button or a finger is down on the table
  byStick: false, // nothing is predicted then
  roundTrip: null, // ms
};
let view = null, pointedAt = null, aimed = 0, sentAt = 0, finger = null, stickUsed = 0;
const pending = new Map(); // aim -> time of the pointer event
const pressed = new Set(); // arrow keys

// A real arm moves only while a button or a finger is down: the dead-man's switch.
const grips = () => !game.match.camera || steering.held;

export function forget() { steering.pointer = pointedAt = null; }

// The first finger steers, and nothing else while it is down.
const steers = (event) => (event.pointerType === "touch" ? event.pointerId === finger : finger === null);

// A finger hides what is below it: the paddle goes above, but reaches the lower edge.
function above(event, y) {
  if (event.pointerType !== "touch") return 0;
  return Math.max(0, Math.min(ABOVE, SHRINKS * (view.lowest / view.dense - y)));
}

function aim(event) {
  if (!game.now || !view.scale || !steers(event)) return;
  const box = view.canvas.getBoundingClientRect(), before = steering.held;
  steering.held = Boolean(event.buttons & 1);
  if (!grips() && !before) return;
  const x = event.clientX - box.left, y = event.clientY - box.top;
  steering.pointer = view.fromScreen(x, y - above(event, y));
  pointedAt = event.timeStamp;
  steersBy(event.pointerType);
  steering.byStick = false;
  // Not with the next image: that would cost a hundredth of a second.
  if (performance.now() - sentAt > GAP[linkRate()]) sendInput(performance.now());
}

export function sendInput(at) {
  const { now } = game;
  if (!now || now.seat === null || isCongested(UNSENT)) return;
  const rtt = steering.roundTrip || 0, pad = stick();
  if (pad) {
    steersBy(pressed.size ? "keys" : "gamepad");
    steering.byStick = true; steering.pointer = null; sentAt = at;
    send("stick", { x: pad[0], y: pad[1], q: ++aimed, rtt });
    pending.set(aimed, at);
    return;
  }
  const fresh = pointedAt !== null, gap = fresh ? GAP[linkRate()] : game.match.camera ? 80 : 250;
  if (!steering.pointer || at - sentAt < gap) return;
  pending.set(++aimed, fresh ? pointedAt : at);
  remember(aimed);
  if (pending.size > 240) pending.delete(pending.keys().next().value);
  pointedAt = null; sentAt = at;
  const [x, y] = steering.pointer.map((v) => Math.max(-10, Math.min(10, v)));
  send("aim", { x, y, held: Number(steering.held), q: aimed, rtt });
  if (!grips()) steering.pointer = null;
}

function stick() {
  const pads = navigator.getGamepads ? [...navigator.getGamepads()] : [], pad = pads.find(Boolean);
  let x = pad ? pad.axes[0] || 0 : 0, y = pad ? -(pad.axes[1] || 0) : 0;
  for (const code of pressed) { x += ARROWS[code][0]; y += ARROWS[code][1]; }
  if (Math.hypot(x, y) > 0.12) stickUsed = performance.now();
  if (!stickUsed || performance.now() - stickUsed > STICK) return null;
  // Right on the stick is right on the screen, whatever seat it is.
  return view.toTableFrame(x, y).map((v) => Math.max(-1, Math.min(1, v)));
}

// The time from an aim to the image that shows it.
export function noteDrawn() {
  const { ack } = game.now;
  if (!ack || !pending.has(ack)) return;
  probe.latencies.push(performance.now() - pending.get(ack));
  for (const q of pending.keys()) { if (q > ack) break; pending.delete(q); }
}

on("frame", (frame, _, at) => {
  if (frame.ack && pending.has(frame.ack)) {
    const spent = at - pending.get(frame.ack), trip = steering.roundTrip;
    steering.roundTrip = trip === null ? spent : trip + 0.1 * (spent - trip);
  }
  correct(frame, !steering.byStick);
});

function letGo() {
  finger = null;
  if (!steering.held) return;
  steering.held = false;
  if (game.match && game.match.camera && steering.pointer) sendInput(performance.now() + 1e3);
}

export function listen(to) {
  view = to;
  const { canvas } = view;
  // Raw updates come without delay; others wait for the next image.
  canvas.addEventListener("onpointerrawupdate" in window ? "pointerrawupdate" : "pointermove", aim);
  canvas.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "touch" && finger === null) finger = event.pointerId;
    if (!steers(event)) return;
    canvas.setPointerCapture(event.pointerId); aim(event); canvas.focus();
  });
  for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) {
    canvas.addEventListener(kind, (event) => { if (steers(event)) letGo(); });
  }
  addEventListener("blur", () => { pressed.clear(); letGo(); });
  addEventListener("keyup", (event) => pressed.delete(event.code));
  addEventListener("keydown", (event) => {
    if (["SELECT", "INPUT", "TEXTAREA"].includes(event.target.tagName) || !(event.code in ARROWS)) return;
    event.preventDefault();
    if (!event.repeat) pressed.add(event.code);
  });
}

export const ownFrame = (frame) => {
  if (frame.seat === null || !own.paddle) return frame;
  const paddles = frame.paddles.map((p, i) => (i === frame.seat ? [own.paddle.x, own.paddle.y] : p));
  return { ...frame, paddles };
};
