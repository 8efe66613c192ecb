// A real table: its video, what its devices report, and which faults are switched on.

import { steering } from "./input.js";
import { $, element, game, on, probe, send } from "./state.js";
import { Stream } from "./stream.js";

const BESIDE = 1000; // ms between two images of the camera beside the video
const ALONE = 90; // ms between two images of the camera without it
const RETRY = 1000;

let pictured = 0, shown = "", wantsVideo = null;

// A page with a seat steers by what the camera sees; others choose.
function showsVideo() { return Boolean(game.match && game.match.camera && game.now && (wantsVideo === null ? game.now.seat !== null : wantsVideo)); }

function askForImage() {
  const wait = Math.max(0, (showsVideo() ? BESIDE : ALONE) - (performance.now() - pictured));
  setTimeout(() => {
    pictured = performance.now();
    $("camera").src = `camera?n=${Math.round(pictured)}&${location.search.slice(1)}`;
  }, wait);
}
$("camera").onload = askForImage;
$("camera").onerror = () => setTimeout(askForImage, RETRY);

// The table from above, live.
const stream = new Stream("video", showsVideo);

export function drawVideo(view) {
  stream.update();
  const live = stream.image;
  if (!showsVideo() || !live) return false;
  const { low, high } = game.match.video, { pen } = view;
  const [ox, oy] = view.toScreen(low[0], high[1]), [ax, ay] = view.toScreen(high[0], high[1]), [bx, by] = view.toScreen(low[0], low[1]);
  pen.save();
  pen.setTransform((ax - ox) / live.width, (ay - oy) / live.width, (bx - ox) / live.height, (by - oy) / live.height, ox, oy);
  pen.drawImage(live, 0, 0);
  pen.restore();
  if (stream.drawn()) probe.pictures.push(performance.now());
  return true;
}
$("video").onclick = () => { wantsVideo = !showsVideo(); };

on("match", (match) => {
  $("real").hidden = $("video").hidden = !match.camera;
  document.body.classList.toggle("with-real", Boolean(match.camera));
  if (!match.camera) return;
  if (!pictured) askForImage();
  $("fault-title").hidden = !Object.keys(match.faults).length;
  $("faults").replaceChildren(...Object.entries(match.faults).map(([name, meaning]) => {
    const button = element("button", name.replaceAll("_", " "));
    button.title = meaning; button.dataset.fault = name;
    button.onclick = () => send("fault", { name, on: Number(!isOn(name)) });
    return button;
  }));
});
const isOn = (name) => Boolean(game.now && game.now.faults && game.now.faults.includes(name));

export function updateArm() {
  const { match, now } = game;
  if (!match.camera || !now.table) return;
  $("video").setAttribute("aria-pressed", showsVideo());
  for (const button of $("faults").children) {
    button.setAttribute("aria-pressed", isOn(button.dataset.fault));
    button.disabled = now.seat === null && now.seats.some((seat) => seat.driver === "person");
  }
  const t = now.table, pair = (v) => `${v[0].toFixed(2)}, ${v[1].toFixed(2)} m/s`;
  const rows = [
    ["robot", t.fault === "none" ? t.robot.toLowerCase() : `${t.robot.toLowerCase()}: ${t.fault}`],
    ["commanded", pair(t.asked)], ["sent", pair(t.sent)],
    ["paddle above table", `${t.height_mm.toFixed(1)} mm, ${t.force.toFixed(0)} N`],
    ["video", t.drawn_ms === null ? "off" : `displayed ${t.drawn_ms.toFixed(0)} ms after the exposure`],
    ["camera", t.camera || `newest frame ${t.frame_ms.toFixed(0)} ms old, ${t.dropped} dropped`],
    ["puck", t.puck_ms === null ? "none" : `detected ${t.puck_ms.toFixed(0)} ms ago, noise ${t.noise_mm.toFixed(1)} mm`],
    ["cycles", `${t.cycles}, ${t.late} late, ${t.refused} commands rejected`],
  ];
  const text = JSON.stringify(rows);
  if (text === shown) return;
  shown = text;
  $("telemetry").replaceChildren(...rows.flatMap(([name, value]) => {
    return [element("dt", name), element("dd", value, name === "robot" ? `state ${t.robot.toLowerCase()}` : "")];
  }));
}

// Why an episode cannot start, which is more important than an invitation to start; "" if it can.
export function robotFault() {
  const { table } = game.now;
  if (!game.match.camera || !table) return "";
  return table.trouble || table.camera || "";
}

// Why a paddle that a person moves rests; "" if none does.
export function atRest() {
  if (game.match.camera && game.now.seat !== null && !steering.held && !steering.byStick) return "Hold the button down on the table to move the arm";
  return (game.now.troubles || []).find(Boolean) || "";
}

// A courtesy stop: a person who looks elsewhere does not move an arm.
addEventListener("blur", () => { if (game.match && game.match.camera && game.now && game.now.seat !== null && game.now.phase === "play") send("pause"); });
