// Sounds, which are synthesised, and vibration.

import { $, game, on, scorerOf } from "./state.js";

let audio = null, quiet = null, muted = localStorage.getItem("muted") === "yes";
const QUIET = 1500; // ms after which the sound device rests
const LAST = 10; // s before the end that are counted

function show() {
  $("sound").setAttribute("aria-pressed", !muted);
  $("sound").title = window.AudioContext ? "Sound (M)" : "This browser cannot play sounds";
  $("sound").disabled = !window.AudioContext;
}
export function toggleSound() { muted = !muted; localStorage.setItem("muted", muted ? "yes" : "no"); show(); }
show();

// Browsers allow no sound before the first tap or key.
for (const kind of ["pointerdown", "keydown"]) {
  addEventListener(kind, () => {
    if (audio || !window.AudioContext) return;
    audio = new AudioContext();
    audio.suspend();
  }, true);
}

// A tone that falls from one pitch to another, Hz, for some seconds.
function tone(from, to, seconds, volume = 0.12, type = "triangle", wait = 0) {
  if (!audio || muted) return;
  audio.resume();
  clearTimeout(quiet); quiet = setTimeout(() => audio.suspend(), QUIET + 1e3 * (wait + seconds));
  const at = audio.currentTime + wait, source = audio.createOscillator(), gain = audio.createGain();
  source.type = type;
  source.frequency.setValueAtTime(from, at); source.frequency.exponentialRampToValueAtTime(to, at + seconds);
  gain.gain.setValueAtTime(volume, at); gain.gain.exponentialRampToValueAtTime(0.001, at + seconds);
  source.connect(gain).connect(audio.destination);
  source.start(at); source.stop(at + seconds);
}

const melody = (pitches, step, type) => pitches.forEach((pitch, i) => tone(pitch, pitch, step * 1.6, 0.12, type, i * step));
const loudness = (speed) => Math.min(0.22, 0.04 + 0.03 * speed);

export const sounds = {
  rail: (speed) => tone(240, 130, 0.05, loudness(speed) / 2, "sine"),
  paddle: (speed) => tone(420 + 90 * Math.min(speed, 8), 260, 0.07, loudness(speed)),
  goalFor: () => melody([523, 659, 784], 0.09, "triangle"),
  goalAgainst: () => tone(220, 90, 0.5, 0.14, "sawtooth"),
  win: () => melody([523, 659, 784, 1047], 0.12, "triangle"),
  loss: () => melody([392, 330, 262], 0.16, "triangle"),
  tick: () => tone(880, 880, 0.04, 0.06, "square"),
};
function vibrate(pattern) { if (navigator.vibrate && !muted) navigator.vibrate(pattern); }

// A bounce off a rail: the velocity of a puck has turned, and no paddle hit it.
function bounces(frame, before) {
  const hit = new Set(frame.events.map((event) => event[2]));
  return frame.pucks.some((p, k) => {
    const q = before.pucks[k];
    if (!q || hit.has(k) || Math.hypot(p[0] - q[0], p[1] - q[1]) > 0.3) return false;
    return (p[2] * q[2] < 0 && Math.abs(p[2] - q[2]) > 0.4) || (p[3] * q[3] < 0 && Math.abs(p[3] - q[3]) > 0.4);
  });
}
const speedOf = (frame, k) => (frame.pucks[k] ? Math.hypot(frame.pucks[k][2], frame.pucks[k][3]) : 0);

// True if the team of this page has scored, or if nobody here plays.
export function scoredForMe(line) {
  const { now, match } = game;
  if (now.seat === null) return true;
  return match.seats[scorerOf(line)].team === match.seats[now.seat].team && match.goal_lines[line].owner !== now.seat;
}

on("frame", (frame, before) => {
  if (!before || frame.n < before.n) return;
  for (const [kind, which, k] of frame.events) {
    if (kind === "goal" && game.match.goal_lines[which]) {
      scoredForMe(which) ? sounds.goalFor() : sounds.goalAgainst();
      if (frame.seat !== null) vibrate(scoredForMe(which) ? [40, 40, 40] : 150);
    } else if (kind === "hit") {
      sounds.paddle(speedOf(frame, k));
      if (which === frame.seat) vibrate(12);
    }
  }
  if (frame.n > before.n && bounces(frame, before)) sounds.rail(speedOf(frame, 0));
  const left = game.match.seconds - frame.time, leftBefore = game.match.seconds - before.time;
  if (game.match.seconds > 2 * LAST && left < LAST && Math.ceil(left) < Math.ceil(leftBefore)) sounds.tick();
  if (frame.phase === "countdown" && Math.ceil(frame.time_left) < Math.ceil(before.time_left)) sounds.tick();
  if (frame.phase === "done" && before.phase !== "done" && !frame.reason && frame.seat !== null) {
    frame.success.includes(frame.seat) ? sounds.win() : sounds.loss();
  }
});
