// A video of a goal, made by the browser: at full speed, then slowly.

import { alpha, colourOf, inks } from "./colours.js";
import { frameOf } from "./moments.js";
import { drawScene, Trails } from "./scene.js";
import { game } from "./state.js";
import { View } from "./view.js";

const WIDTH = 1280, HEIGHT = 720, RATE = 60;
const KINDS = ["video/mp4;codecs=avc1.42E01F", "video/mp4;codecs=avc1", "video/webm;codecs=vp9", "video/webm"];
const LENGTH = 1.55; // s of a clip
const PARTS = [[1, 0.35], [0.4, 0.6]]; // speed, and time for which the last frame stays, s

export function videoKind() {
  if (!window.MediaRecorder || !HTMLCanvasElement.prototype.captureStream) return "";
  return KINDS.find((kind) => MediaRecorder.isTypeSupported(kind)) || "";
}

// The video as a Blob. It takes as long as the video: about seven seconds.
export async function videoOf(clip) {
  const canvas = Object.assign(document.createElement("canvas"), { width: WIDTH, height: HEIGHT });
  const view = new View(canvas), kind = videoKind(), chunks = [];
  view.inset = { top: 90, bottom: 50 };
  view.fit(game.match, null);
  const recorder = new MediaRecorder(canvas.captureStream(RATE), { mimeType: kind, videoBitsPerSecond: 6e6 });
  recorder.ondataavailable = (event) => chunks.push(event.data);
  const ended = new Promise((resolve) => { recorder.onstop = resolve; });
  recorder.start();
  for (const [speed, rest] of PARTS) await play(view, clip, speed, rest);
  recorder.stop();
  await ended;
  return new Blob(chunks, { type: kind.split(";")[0] });
}

function play(view, clip, speed, rest) {
  const trails = new Trails(), began = performance.now(), length = LENGTH / speed;
  return new Promise((resolve) => {
    const step = () => {
      const since = (performance.now() - began) / 1000;
      if (since > length + rest) { resolve(); return; }
      const frame = frameOf(clip, Math.min(since, length) * speed);
      trails.add({ ...frame, phase: "play" });
      paint(view, clip, frame, trails, speed);
      requestAnimationFrame(step);
    };
    step();
  });
}

function paint(view, clip, frame, trails, speed) {
  const { pen } = view;
  pen.fillStyle = inks.room; pen.fillRect(0, 0, WIDTH, HEIGHT);
  drawScene(view, game.match, frame, { trails });
  const text = (words, x, y, size, ink, align) => {
    pen.font = `600 ${size}px system-ui, sans-serif`; pen.fillStyle = ink; pen.textAlign = align; pen.fillText(words, x, y);
  };
  text("Air hockey", 40, 58, 36, inks.ink, "left");
  text(clip.score.split(",")[0].replace(/^\D+/, ""), WIDTH / 2, 60, 44, colourOf(clip.scorer), "center");
  text(`${clip.speed.toFixed(1)} m/s`, WIDTH - 40, 58, 36, inks.ink, "right");
  text("marl_airhockey", WIDTH - 40, HEIGHT - 18, 22, inks.soft, "right");
  if (speed < 1) text("slow motion", 40, HEIGHT - 18, 22, alpha(inks.ink, 0.7), "left");
}

export async function save(blob) {
  const name = `air-hockey-goal.${blob.type.includes("mp4") ? "mp4" : "webm"}`;
  const file = new File([blob], name, { type: blob.type });
  if (navigator.canShare && navigator.canShare({ files: [file] }) && matchMedia("(pointer: coarse)").matches) {
    try { await navigator.share({ files: [file], title: "Air hockey" }); return; } catch (error) { if (error.name === "AbortError") return; }
  }
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob); link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}
