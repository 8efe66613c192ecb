"use strict";
// The view, from metres to pixels, and the picture of the table.

// -- From metres to pixels: one's own side is at the left, or below on a tall screen --

function resize() {
  const dense = window.devicePixelRatio || 1;
  canvas.width = Math.round(canvas.clientWidth * dense);
  canvas.height = Math.round(canvas.clientHeight * dense);
  fit = null;
}
new ResizeObserver(resize).observe(canvas);

function frameOfView() {
  const rotation = match.seats[now && now.seat !== null ? now.seat : 0].rotation;
  const tall = canvas.height > canvas.width * 1.1;
  // Rows: screen right and screen up, in the table frame.
  const right = tall ? rotation[1].map((v) => -v) : rotation[0], up = tall ? rotation[0] : rotation[1];
  const xs = match.table.map((p) => p[0] * right[0] + p[1] * right[1]);
  const ys = match.table.map((p) => p[0] * up[0] + p[1] * up[1]);
  const margin = 0.07, low = [Math.min(...xs) - margin, Math.min(...ys) - margin];
  const high = [Math.max(...xs) + margin, Math.max(...ys) + margin];
  const scale = Math.min(canvas.width / (high[0] - low[0]), canvas.height / (high[1] - low[1]));
  const centre = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  return { right, up, scale, centre, seat: now ? now.seat : null, match };
}

function toScreen(x, y) {
  const { right, up, scale, centre } = fit;
  return [
    canvas.width / 2 + (x * right[0] + y * right[1] - centre[0]) * scale,
    canvas.height / 2 - (x * up[0] + y * up[1] - centre[1]) * scale,
  ];
}

function fromScreen(px, py) {
  const dense = canvas.width / canvas.clientWidth, { right, up, scale, centre } = fit;
  const a = (px * dense - canvas.width / 2) / scale + centre[0];
  const b = (canvas.height / 2 - py * dense) / scale + centre[1];
  return [a * right[0] + b * up[0], a * right[1] + b * up[1]];
}

function toTableFrame(a, b) {
  return [a * fit.right[0] + b * fit.up[0], a * fit.right[1] + b * fit.up[1]];
}

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
let inks = {};
function readInks() { for (const n of ["field", "rail", "print", "faint", "ink", "puck", "mark", "reward", "cost", "drag", "room"]) inks[n] = style("--" + n); }
readInks();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readInks);

function colour(seat) {
  if (seat < 0 || !match) return SEAT[0];
  const teams = match.seats.map((s) => s.team), kinds = new Set(teams).size;
  return SEAT[(kinds === 1 || kinds === teams.length ? seat : teams[seat]) % SEAT.length];
}
function path(points, close = true) {
  pen.beginPath();
  points.forEach((p, i) => { const [x, y] = toScreen(p[0], p[1]); i ? pen.lineTo(x, y) : pen.moveTo(x, y); });
  if (close) pen.closePath();
}
function disc(x, y, radius, fill, line) {
  const [px, py] = toScreen(x, y);
  pen.beginPath(); pen.arc(px, py, radius * fit.scale, 0, 2 * Math.PI);
  if (fill) { pen.fillStyle = fill; pen.fill(); }
  if (line) { pen.strokeStyle = line; pen.stroke(); }
}
function alpha(hex, share) { return hex + Math.round(share * 255).toString(16).padStart(2, "0"); }

function drawTable() {
  const corners = match.table, count = corners.length;
  pen.lineJoin = "round";
  const video = drawVideo();
  if (!video) {
    path(corners); pen.strokeStyle = inks.rail; pen.lineWidth = 0.08 * fit.scale; pen.stroke();
    pen.fillStyle = inks.field; pen.fill();
  }
  pen.lineWidth = Math.max(1, 0.004 * fit.scale);
  if (count === 4 && new Set(match.seats.map((s) => s.side)).size <= 2) {
    const half = Math.abs(corners[0][1]), long = Math.abs(corners[0][0]);
    pen.strokeStyle = inks.faint;
    for (const x of [-long / 2, long / 2]) { path([[x, -half], [x, half]], false); pen.stroke(); }
    pen.strokeStyle = inks.print; path([[0, -half], [0, half]], false); pen.stroke();
  }
  if (!video) { disc(0, 0, 0.14, null, inks.print); disc(0, 0, 0.012, inks.print); }
  match.seats.forEach((seat, i) => {
    const t = seat.rotation, back = seat.reach.map(([u, v]) => [t[0][0] * u + t[1][0] * v, t[0][1] * u + t[1][1] * v]);
    path(back); pen.strokeStyle = alpha(colour(i), 0.22); pen.stroke();
  });
  for (const goalLine of match.goal_lines) {
    if (now.eliminated.includes(goalLine.owner)) continue;
    const [a, b] = goalLine.ends, n = match.normals[goalLine.side];
    path([a, b, [b[0] - 0.04 * n[0], b[1] - 0.04 * n[1]], [a[0] - 0.04 * n[0], a[1] - 0.04 * n[1]]]);
    pen.fillStyle = colour(goalLine.owner); pen.fill();
  }
}

function drawObstacles() {
  pen.lineCap = "round"; pen.strokeStyle = inks.rail;
  for (const [ax, ay, bx, by, r] of match.obstacles) {
    path([[ax, ay], [bx, by]], false); pen.lineWidth = 2 * r * fit.scale; pen.stroke();
  }
  pen.lineCap = "butt"; pen.lineWidth = Math.max(1, 0.004 * fit.scale);
}

// Lines of a sign in the middle of a region, in quarters of its radius.
const SIGNS = { goal: [], reward: [[-1, 0, 1, 0], [0, -1, 0, 1]], cost: [[-1, 0, 1, 0]], drag: [[-1, -0.5, 1, -0.5], [-1, 0.5, 1, 0.5]] };

function drawMarks() {
  for (const [kind, ax, ay, bx, by, r, means] of now.marks) {
    pen.lineWidth = Math.max(1.5, 0.006 * fit.scale);
    if (kind === "circle") {
      const ink = means === "goal" ? inks.mark : inks[means];
      disc(ax, ay, r, alpha(ink, 0.18), ink);
      const [x, y] = toScreen(ax, ay), unit = 0.25 * r * fit.scale;
      pen.beginPath(); pen.strokeStyle = alpha(ink, 0.6);
      for (const [a, b, c, d] of SIGNS[means]) { pen.moveTo(x + unit * a, y + unit * b); pen.lineTo(x + unit * c, y + unit * d); }
      pen.stroke();
      continue;
    }
    pen.strokeStyle = pen.fillStyle = kind === "arrow" ? inks.mark : inks.print;
    path([[ax, ay], [bx, by]], false); pen.stroke();
    const size = Math.hypot(bx - ax, by - ay);
    if (kind === "arrow" && size > 1e-6) {
      const u = (bx - ax) / size, v = (by - ay) / size;
      path([[bx + 0.012 * u, by + 0.012 * v], [bx - 0.03 * u - 0.014 * v, by - 0.03 * v + 0.014 * u], [bx - 0.03 * u + 0.014 * v, by - 0.03 * v - 0.014 * u]]); pen.fill();
    }
  }
}

// True while the video shows the bodies themselves: what is believed is outlined then.
const filmed = () => showsVideo() && live !== null;

function drawBodies(share) {
  const mix = (a, b) => (a === undefined ? b : a + share * (b - a));
  const old = before && before.n <= now.n && now.n - before.n < 12 ? before : now;
  const far = (p, q) => p && Math.hypot(p[0] - q[0], p[1] - q[1]) > 0.3; // served anew: no glide
  trails.forEach((trail) => {
    for (let i = 1; i < trail.length; i++) {
      const [ax, ay] = trail[i - 1], [bx, by] = trail[i], age = i / trail.length;
      if (Math.hypot(bx - ax, by - ay) > 0.3) continue;
      path([[ax, ay], [bx, by]], false); pen.strokeStyle = alpha(inks.puck, 0.22 * age);
      pen.lineWidth = 1.6 * match.puck_radius * age * fit.scale; pen.stroke();
    }
  });
  pen.lineWidth = Math.max(1, 0.004 * fit.scale);
  now.blocks.forEach((b, i) => {
    const o = old.blocks[i] || b, x = mix(o[0], b[0]), y = mix(o[1], b[1]), r = match.block_radii[i];
    if (match.block_shape === "disc") { disc(x, y, r, "#c9a26b", "#7d5f33"); return; }
    const c = Math.cos(now.angles[i]) * r, s = Math.sin(now.angles[i]) * r;
    path([[x + c - s, y + s + c], [x - c - s, y - s + c], [x - c + s, y - s - c], [x + c + s, y + s - c]]);
    pen.fillStyle = "#c9a26b"; pen.fill(); pen.strokeStyle = "#7d5f33"; pen.stroke();
  });
  now.paddles.forEach((p, i) => {
    if (now.eliminated.includes(i)) return;
    const o = old.paddles[i] || p, own = i === now.seat && ownPaddle;
    const x = own ? ownPaddle.x : mix(o[0], p[0]), y = own ? ownPaddle.y : mix(o[1], p[1]);
    if (filmed()) { pen.lineWidth = Math.max(2, 0.006 * fit.scale); disc(x, y, match.paddle_radius, null, colour(i)); return; }
    disc(x, y, match.paddle_radius, colour(i), alpha("#000000", 0.45));
    disc(x, y, match.paddle_radius * 0.52, alpha("#ffffff", 0.28), alpha("#000000", 0.25));
    if (i === now.seat) disc(x, y, match.paddle_radius * 0.16, "#ffffff");
  });
  now.pucks.forEach((p, i) => {
    const o = old.pucks[i] || p, jump = far(o, p);
    const x = jump ? p[0] : mix(o[0], p[0]), y = jump ? p[1] : mix(o[1], p[1]), turn = mix(old.puck_angles[i], now.puck_angles[i]);
    if (filmed()) { pen.lineWidth = Math.max(2, 0.006 * fit.scale); disc(x, y, match.puck_radius, null, "#e6c700"); return; }
    disc(x, y, match.puck_radius, inks.puck, alpha("#888888", 0.7));
    const c = 0.55 * match.puck_radius * Math.cos(turn), s = 0.55 * match.puck_radius * Math.sin(turn); // a stripe shows how it spins
    path([[x - c, y - s], [x + c, y + s]], false); pen.strokeStyle = alpha("#888888", 0.7); pen.stroke();
  });
  if (pointer && now.seat !== null) disc(pointer[0], pointer[1], 0.012, null, colour(now.seat));
}
