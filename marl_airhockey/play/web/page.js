// The loop of the page: predict, send, draw; and its buttons.

import { drawVideo, updateArm } from "./arm.js";
import { alpha, inks } from "./colours.js";
import { connect, key } from "./connection.js";
import { measureRate } from "./device.js";
import { forgetScore, updateHud } from "./hud.js";
import { drawInsight } from "./insight.js";
import { forget, listen, noteDrawn, ownFrame, sendInput, steering } from "./input.js";
import { momentAt, runsMoment, skip } from "./moments.js";
import { mainAction } from "./notice.js";
import { predict } from "./prediction.js";
import { advance, open, togglePlayback } from "./recording.js";
import { between, drawScene, Trails } from "./scene.js";
import { updateScreens, lostNotice } from "./screens.js";
import { updateSpatial } from "./spatial.js";
import { toggleSound } from "./sound.js";
import { $, game, linkRate, on, probe, runs, send } from "./state.js";
import { View } from "./view.js";

const LATE = 20; // ms by which others are drawn late, so that there is a frame after it
const WIDE = 900; // CSS px of width from which a panel has a place beside the table
const SHORT = 12; // characters of a score that fits on a small table
const SMALL = 600; // CSS px of width or height below which play has no margins

const view = new View($("table"));
const trails = new Trails(), demoTrails = new Trails();
let drawnAt = performance.now(), fitted = null;

function resize() {
  const dense = window.devicePixelRatio || 1, { canvas } = view;
  canvas.width = Math.round(canvas.clientWidth * dense); canvas.height = Math.round(canvas.clientHeight * dense);
  fitted = null;
}
new ResizeObserver(resize).observe(view.canvas);
on("match", () => { fitted = null; trails.clear(); forgetScore(); });
on("frame", (frame) => {
  trails.add(frame);
  if (frame.events.some(([kind]) => kind === "goal")) trails.clear();
});

// The table keeps its place while a match runs: only another match, seat or size moves it.
function fit() {
  const { match, now } = game, beside = !$("insight").hidden && innerWidth >= WIDE ? $("insight").offsetWidth : 0;
  const isPlaying = document.body.classList.contains("playing"), bars = isPlaying ? 0 : $("hud").offsetHeight + 1e4 * $("foot").offsetHeight;
  const state = [match, now.seat, isPlaying, beside, bars];
  if (fitted && fitted.every((value, i) => value === state[i])) return;
  if (!fitted || fitted[0] !== match || fitted[1] !== now.seat) forget();
  fitted = state;
  const small = Math.min(innerWidth, innerHeight) < SMALL, playing = state[2];
  view.margin = small ? 0.045 : 0.07;
  view.inset = small && playing ? { top: 0, bottom: 0 } : match.camera || match.scene ? { top: 0, bottom: 0 } : { top: $("hud").offsetHeight, bottom: $("foot").offsetHeight };
  view.inset.right = beside;
  view.fit(match, now.seat);
}

function interpolated(at) {
  const gap = Math.max(game.nowAt - game.beforeAt, 1), late = linkRate() < 60 ? gap : LATE;
  return between(game.before, game.now, Math.max(0, Math.min(1.2, (at - late - game.beforeAt) / gap)));
}

function draw(at) {
  requestAnimationFrame(draw); // first, so that no error ends the loop
  const dt = Math.min((at - drawnAt) / 1000, 0.05);
  drawnAt = at;
  if (game.recording) advance(dt);
  if (game.match && game.now) { drawMatch(at, dt); noteDrawn(); updateHud(); updateArm(); updateSpatial(); updateScreens(); }
  else if (game.down) lostNotice();
}

function drawMatch(at, dt) {
  const { match, now } = game, { pen, canvas } = view;
  fit();
  predict(dt, steering.pointer);
  sendInput(at);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  const demo = now.phase === "lobby" && now.demo ? { ...now, ...now.demo } : null, moment = momentAt(at);
  if (demo) demoTrails.add({ ...demo, phase: "play" });
  const frame = demo || (moment && moment.frame) || ownFrame(interpolated(at));
  const own = demo ? null : now.seat;
  drawScene(view, match, frame, { own, trails: demo ? demoTrails : trails, video: drawVideo });
  if (!demo && !moment) { drawScore(); drawInsight(view, frame); drawPointer(); }
  showMoment(moment);
}

// On a small screen the score is on the table.
function drawScore() {
  if (!document.body.classList.contains("playing") || game.now.phase === "countdown" || Math.min(innerWidth, innerHeight) >= SMALL) return;
  const { pen } = view, [x, y] = view.middle, text = game.now.caption.split(",")[0].replace(/^goals |^lives /, "");
  if (text.length > SHORT) return;
  pen.font = `700 ${Math.round(0.12 * view.scale)}px system-ui, sans-serif`;
  pen.textAlign = "center"; pen.textBaseline = "middle";
  pen.fillStyle = alpha(inks.ink, 0.16); pen.fillText(text, x, y);
  pen.textBaseline = "alphabetic";
}

function drawPointer() {
  if (steering.pointer && game.now.seat !== null) view.disc(...steering.pointer, 0.012, null, inks.soft);
}

function showMoment(moment) {
  $("moment").hidden = !moment;
  if (!moment) return;
  $("moment").className = moment.mine ? "for" : "against";
  $("moment").style.setProperty("--tint", moment.colour);
  $("moment").firstElementChild.textContent = moment.title || "";
  $("moment").lastElementChild.textContent = moment.label || "";
  if (moment.flash > 0) { view.pen.fillStyle = alpha(moment.colour, 0.3 * moment.flash); view.path(game.match.table); view.pen.fill(); }
}

// -- Buttons and keys --

function toggle() {
  if (game.recording) { togglePlayback(); return; }
  if (runsMoment()) { skip(); if (game.now.phase === "goal") send("start"); return; }
  if (game.now && runs()) { send("pause"); return; }
  const main = mainAction() || ($("go") && $("go").onclick) || (() => send("start"));
  main();
}

function fullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.documentElement.requestFullscreen().catch(() => {});
}

$("pause").onclick = toggle;
$("moment").onclick = toggle;
$("sound").onclick = toggleSound;
$("leave").onclick = () => send("leave");
$("full").onclick = fullScreen;
$("full").hidden = !document.fullscreenEnabled;
addEventListener("keydown", (event) => {
  if (["SELECT", "INPUT", "TEXTAREA"].includes(event.target.tagName) || event.repeat) return;
  if (event.code === "Space" || event.code === "Enter") { if (event.target.tagName === "BUTTON") return; event.preventDefault(); toggle(); }
  if (event.code === "KeyS" && game.match && !game.match.study) send("swap");
  if (event.code === "KeyM") toggleSound();
});
// A clicked button must not keep the keyboard: Space starts and pauses.
addEventListener("click", (event) => { const button = event.target.closest("button"); if (button) button.blur(); });
// A browser hardly runs a page in the background, so its player cannot play. A page that is
// loaded again is hidden for a moment, too.
const AWAY = 300; // ms
function pauseIfAway() { if (document.hidden && game.now && game.now.seat !== null && game.now.phase === "play") send("pause"); }
document.addEventListener("visibilitychange", () => setTimeout(pauseIfAway, AWAY));

async function begin() {
  const { mode } = await (await fetch("mode" + location.search)).json();
  document.body.classList.add(mode);
  if (mode === "live") connect();
  else if (mode === "static") await (await import("./static/main.js")).begin();
  else await open();
}

Object.assign(probe, { key, view });
resize();
listen(view);
begin();
measureRate();
requestAnimationFrame(draw);
