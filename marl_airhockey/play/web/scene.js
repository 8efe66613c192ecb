// The image of a table: rails, goals, marks and bodies of one frame.

import { alpha, colourOf, inks, mixed } from "./colours.js";

const TRAIL = 0.32; // s
const THIN = 0.004; // m

// Lines of a sign in the middle of a region, in quarters of its radius.
const SIGNS = { goal: [], reward: [[-1, 0, 1, 0], [0, -1, 0, 1]], cost: [[-1, 0, 1, 0]], drag: [[-1, -0.5, 1, -0.5], [-1, 0.5, 1, 0.5]] };

// The frame between two others. `share` is 0 for the first and 1 for the second one.
export function between(old, now, share) {
  if (!old || old.n > now.n || now.n - old.n >= 12) return now;
  const mix = (a, b) => (a === undefined ? b : a + share * (b - a));
  const rows = (name) => now[name].map((row, i) => {
    const last = old[name][i];
    // A puck that is served again does not glide.
    if (!last || Math.hypot(last[0] - row[0], last[1] - row[1]) > 0.3) return row;
    return [mix(last[0], row[0]), mix(last[1], row[1]), ...row.slice(2)];
  });
  return {
    ...now, paddles: rows("paddles"), pucks: rows("pucks"), blocks: rows("blocks"),
    time: mix(old.time, now.time), puck_angles: now.puck_angles.map((a, i) => mix(old.puck_angles[i], a)),
  };
}

// Recent positions of the pucks, by the time of the match.
export class Trails {
  constructor() { this.rows = []; }
  add(frame) {
    const last = this.rows.at(-1);
    if (last && (frame.time < last.time || frame.time > last.time + 0.5)) this.rows = [];
    if (frame.phase === "play") this.rows.push({ time: frame.time, pucks: frame.pucks.map((p) => [p[0], p[1]]) });
    while (this.rows.length && this.rows[0].time < frame.time - 1.5 * TRAIL) this.rows.shift();
  }
  clear() { this.rows = []; }
  // The trail of puck k up to the drawn puck, oldest first: rows age (0 to 1), x, y.
  of(k, frame) {
    const from = frame.time - TRAIL;
    const points = this.rows.filter((row) => row.time > from && row.time < frame.time && row.pucks[k])
      .map((row) => [(row.time - from) / TRAIL, ...row.pucks[k]]);
    return [...points, [1, frame.pucks[k][0], frame.pucks[k][1]]];
  }
}

// What is drawn besides the frame: `own`, index of the paddle of this page; `trails`;
// `video`, a function that draws the table instead, and returns true if it did.
export function drawScene(view, match, frame, { own = null, trails = null, video = () => false } = {}) {
  const filmed = drawTable(view, match, frame, video);
  drawMarks(view, frame);
  drawObstacles(view, match);
  if (trails) frame.pucks.forEach((_, k) => drawTrail(view, match, trails.of(k, frame)));
  drawBlocks(view, match, frame);
  drawPaddles(view, match, frame, own, filmed);
  drawPucks(view, match, frame, filmed);
}

function drawTable(view, match, frame, video) {
  const { pen, scale } = view, corners = match.table;
  pen.lineJoin = "round";
  const filmed = video(view);
  if (!filmed) {
    view.path(corners); pen.strokeStyle = inks.rail; pen.lineWidth = 0.08 * scale; pen.stroke();
    pen.fillStyle = inks.field; pen.fill();
  }
  pen.lineWidth = Math.max(1, THIN * scale);
  if (corners.length === 4 && new Set(match.seats.map((s) => s.side)).size <= 2) {
    const half = Math.abs(corners[0][1]), long = Math.abs(corners[0][0]);
    pen.strokeStyle = inks.faint;
    for (const x of [-long / 2, long / 2]) { view.path([[x, -half], [x, half]], false); pen.stroke(); }
    pen.strokeStyle = inks.print; view.path([[0, -half], [0, half]], false); pen.stroke();
  }
  if (!filmed) { view.disc(0, 0, 0.14, null, inks.print); view.disc(0, 0, 0.012, inks.print); }
  match.seats.forEach((seat, i) => {
    const t = seat.rotation, reach = seat.reach.map(([u, v]) => [t[0][0] * u + t[1][0] * v, t[0][1] * u + t[1][1] * v]);
    view.path(reach); pen.strokeStyle = alpha(colourOf(i), 0.22); pen.stroke();
  });
  for (const line of match.goal_lines) {
    if (frame.eliminated.includes(line.owner)) continue;
    const [a, b] = line.ends, n = match.normals[line.side], out = (p) => [p[0] - 0.04 * n[0], p[1] - 0.04 * n[1]];
    view.path([a, b, out(b), out(a)]); pen.fillStyle = colourOf(line.owner); pen.fill();
  }
  return filmed;
}

function drawObstacles(view, match) {
  const { pen, scale } = view;
  pen.lineCap = "round"; pen.strokeStyle = inks.rail;
  for (const [ax, ay, bx, by, r] of match.obstacles) {
    view.path([[ax, ay], [bx, by]], false); pen.lineWidth = 2 * r * scale; pen.stroke();
  }
  pen.lineCap = "butt";
}

function drawMarks(view, frame) {
  const { pen, scale } = view;
  for (const [kind, ax, ay, bx, by, r, means] of frame.marks) {
    pen.lineWidth = Math.max(1.5, 0.006 * scale);
    if (kind === "circle") {
      const ink = inks[means];
      view.disc(ax, ay, r, alpha(ink, 0.18), ink);
      const [x, y] = view.toScreen(ax, ay), unit = 0.25 * r * scale;
      pen.beginPath(); pen.strokeStyle = alpha(ink, 0.6);
      for (const [a, b, c, d] of SIGNS[means]) { pen.moveTo(x + unit * a, y + unit * b); pen.lineTo(x + unit * c, y + unit * d); }
      pen.stroke();
      continue;
    }
    pen.strokeStyle = pen.fillStyle = kind === "arrow" ? inks.goal : inks.print;
    view.path([[ax, ay], [bx, by]], false); pen.stroke();
    const size = Math.hypot(bx - ax, by - ay);
    if (kind === "arrow" && size > 1e-6) {
      const u = (bx - ax) / size, v = (by - ay) / size;
      view.path([[bx + 0.012 * u, by + 0.012 * v], [bx - 0.03 * u - 0.014 * v, by - 0.03 * v + 0.014 * u], [bx - 0.03 * u + 0.014 * v, by - 0.03 * v - 0.014 * u]]);
      pen.fill();
    }
  }
}

function drawTrail(view, match, points) {
  const { pen, scale } = view;
  pen.lineCap = "round";
  for (let i = 1; i < points.length; i++) {
    const [, ax, ay] = points[i - 1], [age, bx, by] = points[i];
    if (Math.hypot(bx - ax, by - ay) > 0.3) continue;
    view.path([[ax, ay], [bx, by]], false);
    // Opaque, because transparent pieces would show where they overlap.
    pen.strokeStyle = mixed(inks.field, inks.puck, 0.25 * age); pen.lineWidth = 1.7 * match.puck_radius * age * scale; pen.stroke();
  }
  pen.lineCap = "butt";
}

function drawBlocks(view, match, frame) {
  const { pen, scale } = view, rim = mixed(inks.block, "#000000", 0.4);
  pen.lineWidth = Math.max(1, THIN * scale);
  frame.blocks.forEach(([x, y], i) => {
    const r = match.block_radii[i];
    if (match.block_shape === "disc") { view.disc(x, y, r, inks.block, rim); return; }
    const c = Math.cos(frame.angles[i]) * r, s = Math.sin(frame.angles[i]) * r;
    view.path([[x + c - s, y + s + c], [x - c - s, y - s + c], [x - c + s, y - s - c], [x + c + s, y + s - c]]);
    pen.fillStyle = inks.block; pen.fill(); pen.strokeStyle = rim; pen.stroke();
  });
}

// Over a video, which shows the bodies themselves, only outlines are drawn.
function drawPaddles(view, match, frame, own, filmed) {
  const { pen, scale } = view, r = match.paddle_radius;
  frame.paddles.forEach(([x, y], i) => {
    if (frame.eliminated.includes(i)) return;
    if (filmed) { pen.lineWidth = Math.max(2, 0.006 * scale); view.disc(x, y, r, null, colourOf(i)); return; }
    pen.lineWidth = Math.max(1, THIN * scale);
    view.disc(x, y, r, colourOf(i), alpha("#000000", 0.45));
    view.disc(x, y, r * 0.52, alpha("#ffffff", 0.28), alpha("#000000", 0.25));
    if (i === own) view.disc(x, y, r * 0.16, "#ffffff");
  });
}

function drawPucks(view, match, frame, filmed) {
  const { pen, scale } = view, r = match.puck_radius;
  frame.pucks.forEach(([x, y], i) => {
    if (filmed) { pen.lineWidth = Math.max(2, 0.006 * scale); view.disc(x, y, r, null, inks.estimate); return; }
    pen.lineWidth = Math.max(1, THIN * scale);
    view.disc(x, y, r, inks.puck, alpha("#888888", 0.7));
    // A stripe shows the spin.
    const c = 0.55 * r * Math.cos(frame.puck_angles[i]), s = 0.55 * r * Math.sin(frame.puck_angles[i]);
    view.path([[x - c, y - s], [x + c, y + s]], false); pen.strokeStyle = alpha("#888888", 0.7); pen.stroke();
  });
}
