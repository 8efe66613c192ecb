"use strict";
// Pointer, stick, keys and buttons; sounds.

// A real arm moves only while a button or a finger is down: the dead-man's switch.
const grips = () => !match.camera || held;
const ABOVE = 60; // px from a finger up to the paddle
const UNSENT = 2000; // bytes that may wait to be sent when an aim is added
// What a study needs to know of the page: by what it is steered, how large and fast it is.
let inputKind = "", pictureRate = 0;
function tellDevice(kind) {
  inputKind = kind;
  const { innerWidth: width, innerHeight: height, devicePixelRatio: density } = window;
  send("device", { input: inputKind || "none", width, height, density, hz: Math.round(pictureRate) });
}
function measurePictures(count = 0, began = performance.now()) {
  if (count === 60) { pictureRate = 60000 / (performance.now() - began); tellDevice(inputKind); return; }
  requestAnimationFrame(() => measurePictures(count + 1, began));
}
function steersBy(kind) { if (kind !== inputKind) tellDevice(kind); }

let byTouch = matchMedia("(pointer: coarse)").matches;

// The first finger steers, and nothing else while it is down.
function steers(event) { return event.pointerType === "touch" ? event.pointerId === finger : finger === null; }

const linkRate = () => (now && now.link ? now.link.rate : 60);

function aim(event) {
  if (!fit || !steers(event)) return;
  const box = canvas.getBoundingClientRect(), held_before = held;
  held = Boolean(event.buttons & 1);
  if (!grips() && !held_before) return;
  // A finger hides what is below it: the paddle goes above.
  const above = event.pointerType === "touch" ? ABOVE : 0;
  pointer = fromScreen(event.clientX - box.left, event.clientY - box.top - above);
  pointedAt = event.timeStamp;
  steersBy(event.pointerType);
  steered = false;
  // At once, not with the next frame: that would cost a hundredth of a second.
  if (performance.now() - sentAt > GAP[linkRate()]) sendInput(performance.now());
}

function sendInput(at) {
  if (!now || now.seat === null || (socket && socket.bufferedAmount > UNSENT)) return;
  const pad = stick();
  if (pad) { steersBy(pressed.size ? "keys" : "gamepad"); steered = true; pointer = null; sentAt = at; send("stick", { x: pad[0], y: pad[1], q: ++aimed, rtt: roundTrip || 0 }); pending.set(aimed, at); return; }
  const fresh = pointedAt !== null;
  if (!pointer || at - sentAt < (fresh ? GAP[linkRate()] : match.camera ? 80 : 250)) return;
  pending.set(++aimed, fresh ? pointedAt : at);
  predicted.push([aimed, ownPaddle ? ownPaddle.x : 0, ownPaddle ? ownPaddle.y : 0]);
  if (predicted.length > 90) predicted.shift();
  if (pending.size > 240) pending.delete(pending.keys().next().value);
  pointedAt = null;
  sentAt = at;
  const limit = (v) => Math.max(-10, Math.min(10, v));
  send("aim", { x: limit(pointer[0]), y: limit(pointer[1]), held: Number(held), q: aimed, rtt: roundTrip || 0 });
  if (!grips()) pointer = null;
}

let stickUsed = 0;
const pressed = new Set(); // arrow keys
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
function stick() {
  const pad = (navigator.getGamepads ? [...navigator.getGamepads()] : []).find(Boolean);
  let x = pad ? pad.axes[0] || 0 : 0, y = pad ? -(pad.axes[1] || 0) : 0;
  for (const code of pressed) { x += ARROWS[code][0]; y += ARROWS[code][1]; }
  if (Math.hypot(x, y) > 0.12) stickUsed = performance.now();
  if (!stickUsed || performance.now() - stickUsed > 2000) return null;
  // Right on the stick is right on the screen, whatever seat it is.
  const a = toTableFrame(x, y);
  return [Math.max(-1, Math.min(1, a[0])), Math.max(-1, Math.min(1, a[1]))];
}
addEventListener("keyup", (event) => pressed.delete(event.code));
addEventListener("blur", () => pressed.clear());

// Raw updates come at once; others wait for the next picture.
canvas.addEventListener("onpointerrawupdate" in window ? "pointerrawupdate" : "pointermove", aim);
canvas.addEventListener("pointerdown", (event) => {
  if (event.pointerType === "touch" && finger === null) finger = event.pointerId;
  if (!steers(event)) return;
  canvas.setPointerCapture(event.pointerId); aim(event); canvas.focus();
});
function letGo() { finger = null; if (held) { held = false; if (fit && match.camera && pointer) sendInput(performance.now() + 1e3); } }
for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) canvas.addEventListener(kind, (event) => { if (steers(event)) letGo(); });
addEventListener("blur", letGo);
addEventListener("pointerdown", (event) => { byTouch = event.pointerType === "touch"; }, true);
function toggle() {
  if (recording) { if (!recording.runs && recording.at >= recording.steps.length - 1) recording.at = 0; recording.runs = !recording.runs; return; }
  send(now && ["play", "countdown", "arrange"].includes(now.phase) ? "pause" : "start");
}
addEventListener("keydown", (event) => {
  if (["SELECT", "INPUT", "TEXTAREA"].includes(event.target.tagName) || event.repeat) return;
  if (event.code in ARROWS) { event.preventDefault(); pressed.add(event.code); }
  if (event.code === "Space" || event.code === "Enter") { if (event.target.tagName === "BUTTON") return; event.preventDefault(); toggle(); }
  if (event.code === "KeyS" && match && !match.study) send("swap");
  if (event.code === "KeyM") $("sound").click();
});
$("go").onclick = () => send(deed);
$("golden").onclick = () => send("golden_goal");
$("pause").onclick = toggle;
$("swap").onclick = () => send("swap");
$("stop").onclick = () => send("stop");
// What was clicked must not keep the keyboard: Space starts and pauses.
addEventListener("click", (event) => { const button = event.target.closest("button"); if (button) button.blur(); });
$("speed").onchange = () => $("speed").blur();
$("leave").onclick = () => send("leave");
$("withdraw").onclick = () => { leaving = true; };

// On from the first tap or key: before it, browsers let no page make a sound.
let audio = null, muted = localStorage.getItem("muted") === "yes";
function setMuted(value) { muted = value; localStorage.setItem("muted", value ? "yes" : "no"); $("sound").setAttribute("aria-pressed", !value); }
setMuted(muted);
$("sound").onclick = () => setMuted(!muted);
for (const kind of ["pointerdown", "keydown"]) addEventListener(kind, () => { if (!audio) { audio = new AudioContext(); audio.suspend(); } }, true);
let quiet = null; // timer after which the device for sound rests
function beep(pitch, seconds) {
  if (!audio || muted) return;
  audio.resume();
  clearTimeout(quiet); quiet = setTimeout(() => audio.suspend(), 1500);
  const tone = audio.createOscillator(), gain = audio.createGain();
  tone.frequency.value = pitch; tone.type = "triangle";
  gain.gain.setValueAtTime(0.12, audio.currentTime);
  gain.gain.exponentialRampToValueAtTime(0.001, audio.currentTime + seconds);
  tone.connect(gain).connect(audio.destination); tone.start(); tone.stop(audio.currentTime + seconds);
}
