// Goals as moments: play stops, then the last second and a half is shown again slowly.

import { colourOf } from "./colours.js";
import { between } from "./scene.js";
import { game, on, scorerOf } from "./state.js";
import { scoredForMe } from "./sound.js";

const CLIP = 1.5; // s of play before a goal
export const STOP = 0.6; // s for which the goal itself is shown
const SLOW = 0.5; // speed of the replay
const LENGTH = STOP + CLIP / SLOW;

let recent = [], current = null, began = 0;
export let best = null; // clip of the best goal of this match: frames, speed, scorer

on("match", () => { recent = []; current = best = null; });
on("frame", (frame, before, at) => {
  if (before && frame.n < before.n) { recent = []; best = null; }
  const goal = before && frame.n > before.n && frame.events.find(([kind, line]) => kind === "goal" && game.match.goal_lines[line]);
  if (goal && game.recording === null) begin(goal[1], goal[2], before, at);
  if (["play", "done"].includes(frame.phase) && !goal) recent.push(frame);
  while (recent.length && recent[0].time < frame.time - CLIP - 0.2) recent.shift();
  if (goal) recent = [];
  // A goal that play does not stop for is only shown for as long as it would have stopped.
  if (current && frame.phase === "countdown") current = null;
});

function begin(line, k, before, at) {
  const frames = recent.filter((frame) => frame.time > before.time - CLIP);
  if (!frames.length) frames.push(before);
  const last = frames.at(-1), speed = Math.max(...frames.map((frame) => Math.hypot(frame.pucks[k][2], frame.pucks[k][3])));
  frames.push(...into(last, k, game.match.goal_lines[line].ends));
  const scorer = scorerOf(line), mine = scoredForMe(line);
  const clip = { frames, speed, scorer, mine, score: game.now.caption, colour: colourOf(scorer) };
  current = clip; began = at;
  if (mine && (!best || speed > best.speed)) best = clip;
}

// The puck rolls on between the posts for a moment, because the frame of the goal may serve it again.
function into(last, k, [[x, y], [u, v]]) {
  const width = Math.hypot(u - x, v - y), along = [(u - x) / width, (v - y) / width];
  const radius = game.match.puck_radius, [px, py, vx, vy] = last.pucks[k];
  return [1, 2, 3].map((i) => {
    const p = [px + (i * vx) / 60, py + (i * vy) / 60];
    const place = (p[0] - x) * along[0] + (p[1] - y) * along[1];
    const aside = Math.min(Math.max(place, radius), width - radius) - place;
    const puck = [p[0] + aside * along[0], p[1] + aside * along[1], vx, vy];
    return { ...last, n: last.n + i, time: last.time + i / 60, pucks: last.pucks.map((other, j) => (j === k ? puck : other)) };
  });
}

export function skip() { current = null; }
export const runsMoment = () => current !== null;

// The frame of a clip at a time after its start, s.
export function frameOf(clip, time) {
  const { frames } = clip, at = frames[0].time + time;
  const i = frames.findIndex((frame) => frame.time >= at);
  if (i < 0) return frames.at(-1);
  if (i === 0) return frames[0];
  return between(frames[i - 1], frames[i], (at - frames[i - 1].time) / (frames[i].time - frames[i - 1].time));
}

// What is shown instead of the match now; null for the match itself.
export function momentAt(at) {
  if (!current) return null;
  const since = (at - began) / 1000, phase = game.now.phase;
  const stops = phase === "goal" || phase === "done";
  if (since > (stops ? LENGTH : STOP) || phase === "lobby") { current = null; return null; }
  const { mine, colour } = current;
  if (since < STOP) return { frame: stops ? current.frames.at(-1) : null, title: "Goal!", mine, colour, flash: 1 - since / STOP };
  return { frame: frameOf(current, (since - STOP) * SLOW), title: "", label: "Replay", mine, colour, flash: 0 };
}
