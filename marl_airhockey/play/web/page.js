"use strict";
// The page of a table: draws what the server says, says where the pointer is.
// Lengths are metres in the table frame; `turn` takes them into a seat's own frame.

const $ = (id) => document.getElementById(id);
const canvas = $("table"), pen = canvas.getContext("2d");
const SEAT = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
const LATE = 20; // ms by which others are drawn late, so that there is a frame after it
const TRAIL = 26;

let court = null, now = null, before = null, nowAt = 0, beforeAt = 0;
let socket = null, down = false, refused = "";
let pointer = null, pointedAt = null, aimed = 0, sentAt = 0, trip = null, flash = 0, flashColour = "";
let mine = null; // predicted own paddle: x, y, vx, vy
let predicted = []; // [aim, x, y] of the last aims
let steered = false; // by a stick or keys: nothing is predicted then
let trails = [], fit = null, drawnAt = performance.now();
const pending = new Map(); // aim -> time of the pointer event
const probe = (window.airhockey = { frames: [], latencies: [], state: () => now });

// A key of this page alone, kept over a reload, by which it gets its seat back.
const key = sessionStorage.getItem("key") || Math.random().toString(36).slice(2) + Date.now().toString(36);
sessionStorage.setItem("key", key);

const unsaid = []; // what was clicked while there was no connection
function say(t, fields = {}) {
  const text = JSON.stringify({ t, ...fields });
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(text);
  else if (["consent", "answer", "withdraw", "next"].includes(t)) unsaid.push(text);
}

function connect() {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  socket = new WebSocket(`${scheme}//${location.host}/ws${location.search}`);
  socket.onopen = () => { down = false; refused = ""; say("hello", { key }); for (const text of unsaid.splice(0)) socket.send(text); };
  socket.onmessage = (event) => {
    const data = JSON.parse(event.data);
    if (data.t === "court") { court = data; trails = []; mine = null; panel = ""; resize(); return; }
    take(data);
  };
  socket.onclose = (event) => { down = true; refused = event.reason; setTimeout(connect, 1000); };
}

// -- A recording instead of a game --

let tape = null; // { steps, at, runs }

async function begin() {
  const { mode } = await (await fetch("mode" + location.search)).json();
  if (mode === "live") { connect(); return; }
  const { meta, steps, end } = await (await fetch("recording" + location.search)).json();
  court = meta.court;
  const seats = meta.players.map((p) => ({ who: p.driver, taken: p.person !== null }));
  tape = { at: 0, runs: true, end, shown: -1, rate: 1 / meta.control_dt };
  tape.steps = [meta.start, ...steps].map((step) => ({ ...step, seats, seat: null, ack: 0, watching: 0, rate: 1 / meta.control_dt, recording: false }));
  $("scrub").max = steps.length;
  $("timeline").hidden = false;
  for (const name of ["swap", "leave", "strength", "stop"]) $(name).hidden = true;
  $("scrub").oninput = () => { tape.at = Number($("scrub").value); trails = []; };
  $("scrub").onchange = () => $("scrub").blur();
  resize();
}

function play(dt) {
  const last = tape.steps.length - 1;
  if (tape.runs) tape.at = Math.min(last, tape.at + dt * Number($("speed").value) * tape.rate);
  const index = Math.floor(tape.at);
  if (index === last) tape.runs = false;
  if (index === tape.shown) return;
  // Steps in between count for trails and sounds, unless it was a jump.
  const from = index > tape.shown && index - tape.shown < 12 ? tape.shown + 1 : index;
  for (let i = from; i <= index; i++) take({ ...tape.steps[i], phase: i === last && tape.end.kind ? "done" : "play" });
  tape.shown = index;
  $("scrub").value = index;
}

function take(data) {
  const at = performance.now();
  if (now && data.n < now.n) trails = [];
  before = now; beforeAt = nowAt; now = data; nowAt = at;
  probe.frames.push(at);
  if (probe.frames.length > 5000) probe.frames.splice(0, 2500);
  data.pucks.forEach((p, i) => {
    const trail = (trails[i] = trails[i] || []);
    if (data.phase === "play") trail.push([p[0], p[1]]);
    if (trail.length > TRAIL) trail.shift();
  });
  if (data.ack && pending.has(data.ack)) {
    const spent = at - pending.get(data.ack);
    trip = trip === null ? spent : trip + 0.1 * (spent - trip);
  }
  for (const [kind, which] of data.events) {
    if (kind === "goal" && court.goal_lines[which]) { flash = 1; flashColour = colour(scorer(court.goal_lines[which].owner)); beep(220, 0.35); }
    else beep(520 + 90 * which, 0.05);
  }
  correct(data);
}

// In a game of two teams the other one has scored; else only who conceded is sure.
function scorer(owner) {
  const other = court.seats.findIndex((s) => s.team !== court.seats[owner].team);
  return new Set(court.seats.map((s) => s.team)).size === 2 ? other : owner;
}

// -- Own paddle: moved here at once, by the law of the server's driver --

function seatNow() { return now && now.seat !== null ? court.seats[now.seat] : null; }

function correct(data) {
  if (data.seat === null) { mine = null; return; }
  const [x, y] = data.pads[data.seat];
  if (!mine || data.phase !== "play" || steered) { mine = { x, y, vx: 0, vy: 0 }; predicted = []; return; }
  const past = predicted.find((p) => p[0] === data.ack);
  if (!past) return;
  // What the server has now is what we had when we sent the aim that it has taken.
  const dx = x - past[1], dy = y - past[2], share = Math.hypot(dx, dy) > 0.15 ? 1 : 0.12;
  mine.x += share * dx; mine.y += share * dy;
  for (const p of predicted) { p[1] += share * dx; p[2] += share * dy; }
}

function clampTo(reach, turn, x, y) {
  let u = turn[0][0] * x + turn[0][1] * y, v = turn[1][0] * x + turn[1][1] * y;
  for (let pass = 0; pass < 3; pass++) {
    for (let i = 0; i < reach.length; i++) {
      const [ax, ay] = reach[i], [bx, by] = reach[(i + 1) % reach.length];
      const size = Math.hypot(bx - ax, by - ay), nx = -(by - ay) / size, ny = (bx - ax) / size;
      const inside = (u - ax) * nx + (v - ay) * ny;
      if (inside < 0) { u -= inside * nx; v -= inside * ny; }
    }
  }
  return [turn[0][0] * u + turn[1][0] * v, turn[0][1] * u + turn[1][1] * v];
}

function predict(dt) {
  const seat = seatNow();
  if (!mine || !seat || !pointer || now.phase !== "play") return;
  const wx = pointer[0] - mine.x, wy = pointer[1] - mine.y, far = Math.max(Math.hypot(wx, wy), 1e-9);
  const speed = Math.min(court.mouse.gain * far, Math.sqrt(2 * court.mouse.brake * seat.acceleration * far), seat.speed);
  let ax = (wx / far) * speed - mine.vx, ay = (wy / far) * speed - mine.vy;
  const most = seat.acceleration * dt, size = Math.hypot(ax, ay);
  if (size > most) { ax *= most / size; ay *= most / size; }
  mine.vx += ax; mine.vy += ay;
  const x = mine.x + mine.vx * dt, y = mine.y + mine.vy * dt;
  [mine.x, mine.y] = clampTo(seat.reach, seat.turn, x, y);
}

// -- What the pointer says --

function aim(event) {
  if (!fit) return;
  const box = canvas.getBoundingClientRect();
  pointer = fromScreen(event.clientX - box.left, event.clientY - box.top);
  pointedAt = event.timeStamp;
  steered = false;
  // At once, not with the next frame: that would cost a hundredth of a second.
  if (performance.now() - sentAt > 6) tell(performance.now());
}

function tell(at) {
  if (!now || now.seat === null) return;
  const pad = stick();
  if (pad) { steered = true; pointer = null; sentAt = at; say("stick", { x: pad[0], y: pad[1], q: ++aimed, rtt: trip || 0 }); pending.set(aimed, at); return; }
  const fresh = pointedAt !== null;
  if (!pointer || (!fresh && at - sentAt < 250)) return;
  pending.set(++aimed, fresh ? pointedAt : at);
  predicted.push([aimed, mine ? mine.x : 0, mine ? mine.y : 0]);
  if (predicted.length > 90) predicted.shift();
  if (pending.size > 240) pending.delete(pending.keys().next().value);
  pointedAt = null;
  sentAt = at;
  const limit = (v) => Math.max(-10, Math.min(10, v));
  say("aim", { x: limit(pointer[0]), y: limit(pointer[1]), q: aimed, rtt: trip || 0 });
}

let stickUsed = 0;
const held = new Set(); // arrow keys
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
function stick() {
  const pad = (navigator.getGamepads ? [...navigator.getGamepads()] : []).find(Boolean);
  let x = pad ? pad.axes[0] || 0 : 0, y = pad ? -(pad.axes[1] || 0) : 0;
  for (const code of held) { x += ARROWS[code][0]; y += ARROWS[code][1]; }
  if (Math.hypot(x, y) > 0.12) stickUsed = performance.now();
  if (!stickUsed || performance.now() - stickUsed > 2000) return null;
  // Right on the stick is right on the screen, whatever seat it is.
  const a = toWorldWay(x, y);
  return [Math.max(-1, Math.min(1, a[0])), Math.max(-1, Math.min(1, a[1]))];
}
addEventListener("keyup", (event) => held.delete(event.code));
addEventListener("blur", () => held.clear());

// Raw updates come at once; others wait for the next picture.
canvas.addEventListener("onpointerrawupdate" in window ? "pointerrawupdate" : "pointermove", aim);
canvas.addEventListener("pointerdown", (event) => { aim(event); canvas.focus(); });
function toggle() {
  if (tape) { if (!tape.runs && tape.at >= tape.steps.length - 1) tape.at = 0; tape.runs = !tape.runs; return; }
  say(now && (now.phase === "play" || now.phase === "countdown") ? "pause" : "start");
}
addEventListener("keydown", (event) => {
  if (["SELECT", "INPUT"].includes(event.target.tagName) || event.repeat) return;
  if (event.code in ARROWS) { event.preventDefault(); held.add(event.code); }
  if (event.code === "Space" || event.code === "Enter") { if (event.target.tagName === "BUTTON") return; event.preventDefault(); toggle(); }
  if (event.code === "KeyS" && court && !court.study) say("swap");
  if (event.code === "KeyM") $("sound").click();
});
$("go").onclick = () => say("start");
$("pause").onclick = toggle;
$("swap").onclick = () => say("swap");
$("stop").onclick = () => say("stop");
// What was clicked must not keep the keyboard: Space starts and pauses.
addEventListener("click", (event) => { const button = event.target.closest("button"); if (button) button.blur(); });
$("speed").onchange = () => $("speed").blur();
$("leave").onclick = () => say("leave");
$("withdraw").onclick = () => { leaving = true; };
$("strength").onchange = () => { say("strength", { name: $("strength").value }); $("strength").blur(); };

let audio = null;
$("sound").onclick = () => {
  const on = $("sound").getAttribute("aria-pressed") !== "true";
  $("sound").setAttribute("aria-pressed", on);
  audio = on ? new AudioContext() : null;
};
function beep(pitch, seconds) {
  if (!audio) return;
  const tone = audio.createOscillator(), gain = audio.createGain();
  tone.frequency.value = pitch; tone.type = "triangle";
  gain.gain.setValueAtTime(0.12, audio.currentTime);
  gain.gain.exponentialRampToValueAtTime(0.001, audio.currentTime + seconds);
  tone.connect(gain).connect(audio.destination); tone.start(); tone.stop(audio.currentTime + seconds);
}

// -- From metres to pixels: one's own side is at the left, or below on a tall screen --

function resize() {
  const dense = window.devicePixelRatio || 1;
  canvas.width = Math.round(canvas.clientWidth * dense);
  canvas.height = Math.round(canvas.clientHeight * dense);
  fit = null;
}
new ResizeObserver(resize).observe(canvas);

function frameOfView() {
  const turn = court.seats[now && now.seat !== null ? now.seat : 0].turn;
  const tall = canvas.height > canvas.width * 1.1;
  // Rows: screen right and screen up, in the table frame.
  const right = tall ? turn[1].map((v) => -v) : turn[0], up = tall ? turn[0] : turn[1];
  const xs = court.table.map((p) => p[0] * right[0] + p[1] * right[1]);
  const ys = court.table.map((p) => p[0] * up[0] + p[1] * up[1]);
  const margin = 0.07, low = [Math.min(...xs) - margin, Math.min(...ys) - margin];
  const high = [Math.max(...xs) + margin, Math.max(...ys) + margin];
  const scale = Math.min(canvas.width / (high[0] - low[0]), canvas.height / (high[1] - low[1]));
  const centre = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  return { right, up, scale, centre, seat: now ? now.seat : null, court };
}

function spot(x, y) {
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

function toWorldWay(a, b) {
  return [a * fit.right[0] + b * fit.up[0], a * fit.right[1] + b * fit.up[1]];
}

// -- Drawing --

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
let inks = {};
function readInks() { for (const n of ["field", "rail", "print", "faint", "ink", "puck", "mark", "room"]) inks[n] = style("--" + n); }
readInks();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readInks);

function colour(seat) {
  if (seat < 0 || !court) return SEAT[0];
  const teams = court.seats.map((s) => s.team), kinds = new Set(teams).size;
  return SEAT[(kinds === 1 || kinds === teams.length ? seat : teams[seat]) % SEAT.length];
}
function path(points, close = true) {
  pen.beginPath();
  points.forEach((p, i) => { const [x, y] = spot(p[0], p[1]); i ? pen.lineTo(x, y) : pen.moveTo(x, y); });
  if (close) pen.closePath();
}
function disc(x, y, radius, fill, line) {
  const [px, py] = spot(x, y);
  pen.beginPath(); pen.arc(px, py, radius * fit.scale, 0, 2 * Math.PI);
  if (fill) { pen.fillStyle = fill; pen.fill(); }
  if (line) { pen.strokeStyle = line; pen.stroke(); }
}
function alpha(hex, share) { return hex + Math.round(share * 255).toString(16).padStart(2, "0"); }

function drawTable() {
  const corners = court.table, count = corners.length;
  pen.lineJoin = "round";
  path(corners); pen.strokeStyle = inks.rail; pen.lineWidth = 0.08 * fit.scale; pen.stroke();
  pen.fillStyle = inks.field; pen.fill();
  pen.lineWidth = Math.max(1, 0.004 * fit.scale);
  if (count === 4 && new Set(court.seats.map((s) => s.side)).size <= 2) {
    const half = Math.abs(corners[0][1]), long = Math.abs(corners[0][0]);
    pen.strokeStyle = inks.faint;
    for (const x of [-long / 2, long / 2]) { path([[x, -half], [x, half]], false); pen.stroke(); }
    pen.strokeStyle = inks.print; path([[0, -half], [0, half]], false); pen.stroke();
  }
  disc(0, 0, 0.14, null, inks.print); disc(0, 0, 0.012, inks.print);
  court.seats.forEach((seat, i) => {
    const t = seat.turn, back = seat.reach.map(([u, v]) => [t[0][0] * u + t[1][0] * v, t[0][1] * u + t[1][1] * v]);
    path(back); pen.strokeStyle = alpha(colour(i), 0.22); pen.stroke();
  });
  for (const goalLine of court.goal_lines) {
    if (now.retired.includes(goalLine.owner)) continue;
    const [a, b] = goalLine.ends, n = court.normals[goalLine.side];
    path([a, b, [b[0] - 0.04 * n[0], b[1] - 0.04 * n[1]], [a[0] - 0.04 * n[0], a[1] - 0.04 * n[1]]]);
    pen.fillStyle = colour(goalLine.owner); pen.fill();
  }
  for (const [ax, ay, bx, by, r] of court.obstacles) {
    path([[ax, ay], [bx, by]], false); pen.strokeStyle = inks.rail; pen.lineWidth = 2 * r * fit.scale; pen.lineCap = "round"; pen.stroke();
  }
  pen.lineCap = "butt"; pen.lineWidth = Math.max(1, 0.004 * fit.scale);
}

function drawMarks() {
  for (const [kind, ax, ay, bx, by, r] of now.marks) {
    pen.lineWidth = Math.max(1.5, 0.006 * fit.scale);
    if (kind === "circle") { disc(ax, ay, r, alpha(inks.mark, 0.18), inks.mark); continue; }
    pen.strokeStyle = pen.fillStyle = kind === "arrow" ? inks.mark : inks.print;
    path([[ax, ay], [bx, by]], false); pen.stroke();
    const size = Math.hypot(bx - ax, by - ay);
    if (kind === "arrow" && size > 1e-6) {
      const u = (bx - ax) / size, v = (by - ay) / size;
      path([[bx + 0.012 * u, by + 0.012 * v], [bx - 0.03 * u - 0.014 * v, by - 0.03 * v + 0.014 * u], [bx - 0.03 * u + 0.014 * v, by - 0.03 * v - 0.014 * u]]); pen.fill();
    }
  }
}

function drawBodies(share) {
  const mix = (a, b) => (a === undefined ? b : a + share * (b - a));
  const old = before && before.n <= now.n && now.n - before.n < 12 ? before : now;
  const far = (p, q) => p && Math.hypot(p[0] - q[0], p[1] - q[1]) > 0.3; // served anew: no glide
  trails.forEach((trail) => {
    for (let i = 1; i < trail.length; i++) {
      const [ax, ay] = trail[i - 1], [bx, by] = trail[i], age = i / trail.length;
      if (Math.hypot(bx - ax, by - ay) > 0.3) continue;
      path([[ax, ay], [bx, by]], false); pen.strokeStyle = alpha(inks.puck, 0.22 * age);
      pen.lineWidth = 1.6 * court.puck * age * fit.scale; pen.stroke();
    }
  });
  pen.lineWidth = Math.max(1, 0.004 * fit.scale);
  now.blocks.forEach((b, i) => {
    const o = old.blocks[i] || b, x = mix(o[0], b[0]), y = mix(o[1], b[1]), r = court.blocks[i];
    if (court.block_shape === "disc") { disc(x, y, r, "#c9a26b", "#7d5f33"); return; }
    const c = Math.cos(now.angles[i]) * r, s = Math.sin(now.angles[i]) * r;
    path([[x + c - s, y + s + c], [x - c - s, y - s + c], [x - c + s, y - s - c], [x + c + s, y + s - c]]);
    pen.fillStyle = "#c9a26b"; pen.fill(); pen.strokeStyle = "#7d5f33"; pen.stroke();
  });
  now.pads.forEach((p, i) => {
    if (now.retired.includes(i)) return;
    const o = old.pads[i] || p, own = i === now.seat && mine;
    const x = own ? mine.x : mix(o[0], p[0]), y = own ? mine.y : mix(o[1], p[1]);
    disc(x, y, court.paddle, colour(i), alpha("#000000", 0.45));
    disc(x, y, court.paddle * 0.52, alpha("#ffffff", 0.28), alpha("#000000", 0.25));
    if (i === now.seat) disc(x, y, court.paddle * 0.16, "#ffffff");
  });
  now.pucks.forEach((p, i) => {
    const o = old.pucks[i] || p, jump = far(o, p);
    disc(jump ? p[0] : mix(o[0], p[0]), jump ? p[1] : mix(o[1], p[1]), court.puck, inks.puck, alpha("#888888", 0.7));
  });
  if (pointer && now.seat !== null) disc(pointer[0], pointer[1], 0.012, null, colour(now.seat));
}

function draw(at) {
  const dt = Math.min((at - drawnAt) / 1000, 0.05); drawnAt = at;
  if (tape) play(dt);
  if (court && now) {
    if (!fit || fit.seat !== now.seat || fit.court !== court) { fit = frameOfView(); pointer = pointedAt = null; }
    predict(dt);
    tell(at);
    const gap = Math.max(nowAt - beforeAt, 1);
    const share = before ? Math.max(0, Math.min(1.2, (at - LATE - beforeAt) / gap)) : 1;
    pen.clearRect(0, 0, canvas.width, canvas.height);
    drawTable(); drawMarks(); drawBodies(share);
    if (flash > 0) {
      pen.fillStyle = alpha(flashColour, 0.3 * flash); path(court.table); pen.fill(); flash = Math.max(0, flash - dt * 1.6);
    }
    if (now.ack && pending.has(now.ack)) {
      probe.latencies.push(performance.now() - pending.get(now.ack));
      for (const q of pending.keys()) { if (q > now.ack) break; pending.delete(q); }
    }
    words();
  } else if (down) { show("No connection", refused || "trying again…", ""); }
  requestAnimationFrame(draw);
}

// -- Words around the table --

const put = (node, text) => { if (node.textContent !== text) node.textContent = text; };
function show(headline, detail, go, bare = false) {
  $("notice").hidden = false; $("notice").classList.toggle("bare", bare);
  put($("headline"), headline); put($("detail"), detail); $("go").hidden = !go; put($("go"), go);
}

function words() {
  put($("name"), court.scenario.replaceAll("_", " "));
  scoreboard();
  put($("clock"), `${Math.max(0, court.seconds - now.time).toFixed(0)} s`);
  put($("trip"), trip === null ? "" : `round trip ${trip.toFixed(0)} ms`);
  put($("rate"), `loop ${now.rate.toFixed(1)} Hz`);
  put($("watching"), now.watching ? `${now.watching} watching` : "");
  $("recording").hidden = !now.recording;
  if (tape) { replayWords(); return; }
  if (court.study) { studyWords(); return; }
  const runs = now.phase === "play" || now.phase === "countdown", sits = now.seat !== null;
  const free = now.seats.findIndex((s) => s.who === "person" && !s.taken);
  const say = (sits || now.seats.every((s) => s.who !== "person")) && free < 0;
  put($("pause"), runs ? "Pause" : "Start"); $("pause").disabled = !say;
  $("swap").hidden = now.seats.length < 2; $("swap").disabled = runs || now.phase === "pause" || !say;
  $("leave").hidden = !sits;
  canvas.classList.toggle("mine", sits && now.phase === "play");
  seats(free);
  strength(say && !runs && now.phase !== "pause");
  notice(sits, free, say);
}

function replayWords() {
  const over = now.phase === "done", ended = tape.end.reason;
  put($("pause"), tape.runs ? "Pause" : "Play");
  seats(-1);
  if (over) show(verdict(), ended === "played to the end" ? "" : ended, "");
  else if (flash > 0.3) show("Goal!", "", "", true);
  else $("notice").hidden = true;
}

function notice(sits, free, say) {
  $("stop").hidden = Boolean(court.study) || now.phase !== "pause" || !say;
  if (down) show("No connection", refused || "trying again…", "");
  else if (now.phase === "countdown") show(String(Math.ceil(now.left)), "", "", true);
  else if (now.phase === "lobby") show(sits ? "Ready?" : "Watching", sits && free >= 0 ? "Waiting for another player: they open this page, too." : sits ? `${court.what} Move the pointer to move your paddle. Space starts.` : free >= 0 ? "A seat is free below." : "Waiting for the players.", say ? "Start" : "");
  else if (now.phase === "pause") show("Paused", now.reason, say ? "Go on" : "");
  else if (now.phase === "done") show(verdict(), now.reason, say ? "Again" : "");
  else if (flash > 0.3) show("Goal!", "", "", true);
  else $("notice").hidden = true;
}

function verdict() {
  if (now.reason || (tape && tape.end.reason !== "played to the end")) return "Broken off";
  const teams = new Set(court.seats.map((s) => s.team)), won = new Set(now.success.map((i) => court.seats[i].team));
  if (teams.size === 1) return won.size ? "Done!" : "Not this time";
  if (won.size !== 1) return "A draw";
  if (now.seat !== null) return won.has(court.seats[now.seat].team) ? "You win!" : "You lose";
  return `${titleOf(now.success[0])} wins`;
}

let scored = "";
function scoreboard() {
  const text = now.caption || `return ${now.score[0].toFixed(1)}`;
  if (text === scored) return;
  scored = text;
  const match = text.match(/^(\D*?)\s*(-?[\d.]+(?: : -?[\d.]+)*)$/), box = $("score");
  box.textContent = "";
  if (!match) { box.textContent = text; return; }
  const add = (cls, words, ink) => { const s = document.createElement("span"); s.className = cls; s.textContent = words; if (ink) s.style.color = ink; box.append(s); };
  add("word", match[1]);
  match[2].split(" : ").forEach((value, i, all) => {
    if (i) add("colon", ":");
    add("value", value, all.length > 1 ? SEAT[i % SEAT.length] : "");
  });
}

function titleOf(i) {
  const { who, title } = now.seats[i];
  if (title !== undefined) return i === now.seat ? "You" : title;
  return who === "person" ? (i === now.seat ? "You" : now.seats[i].taken ? "A person" : "Free seat") : who.replace("zoo/", "policy ").replace(":strength=", ", ");
}

let panel = "";
function seats(free) {
  const can = !tape && (now.phase === "lobby" || now.phase === "done");
  const state = JSON.stringify([now.seats, now.seat, can, free]);
  if (state === panel) return;
  if (document.activeElement && document.activeElement.closest && document.activeElement.closest("#seats")) return; // being chosen
  panel = state;
  $("seats").textContent = "";
  now.seats.forEach((seat, i) => {
    const box = document.createElement("span"), dot = document.createElement("span");
    box.className = "seat" + (i === now.seat ? " me" : ""); dot.className = "dot"; dot.style.background = colour(i); box.append(dot);
    if (i === now.seat || (seat.who === "person" && seat.taken)) box.append(titleOf(i));
    else if (now.seat !== null && can && !court.study) {
      const list = document.createElement("select");
      list.setAttribute("aria-label", `who plays seat ${i + 1}`);
      for (const name of [...new Set(["person", seat.who, ...court.choices])]) {
        const option = new Option(name === "person" ? "another person" : name.replace("zoo/", "policy ").replace(":strength=", ", "), name);
        option.selected = name === seat.who; list.append(option);
      }
      list.onchange = () => { say("opponent", { seat: i, name: list.value }); list.blur(); panel = ""; };
      box.append(list);
    } else if (seat.who === "person" && !court.study) {
      const sit = document.createElement("button"); sit.textContent = "Take this seat"; sit.onclick = () => say("sit", { seat: i }); box.append(sit);
    } else box.append(titleOf(i));
    $("seats").append(box);
  });
}

function strength(can) {
  const list = $("strength"), names = [...new Set([...court.strengths, now.strength])];
  list.hidden = now.seats.every((s) => s.who === "person");
  list.disabled = !can;
  if (list.options.length !== names.length) { list.textContent = ""; for (const name of names) list.append(new Option(name)); }
  if (document.activeElement !== list) list.value = now.strength;
}

resize();
begin();
requestAnimationFrame(draw);
