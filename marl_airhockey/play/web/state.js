"use strict";
// State of the page, its connection to the server, and recordings.
// Lengths are metres in the table frame; a seat's `rotation` takes them into its ego frame.

const $ = (id) => document.getElementById(id);
const canvas = $("table"), pen = canvas.getContext("2d");
const SEAT = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
const LATE = 20; // ms by which others are drawn late, so that there is a frame after it
const ACKNOWLEDGED = 45; // ms between two acknowledgements of frames
const GAP = { 60: 6, 30: 25, 10: 70 }; // ms between two aims, by the frames a second that the link takes
const TRAIL = 26;

let match = null, now = null, before = null, nowAt = 0, beforeAt = 0;
let socket = null, down = false, refused = "";
let pointer = null, pointedAt = null, aimed = 0, sentAt = 0, roundTrip = null, flash = 0, flashColour = "";
let ownPaddle = null; // predicted own paddle: x, y, vx, vy
let predicted = []; // [aim, x, y] of the last aims
let held = false; // a button or a finger is down on the table
let finger = null; // pointerId of the finger that steers, the first one on the table
let acknowledgedAt = 0, openedAt = 0;
let steered = false; // by a stick or keys: nothing is predicted then
let trails = [], fit = null, drawnAt = performance.now();
const pending = new Map(); // aim -> time of the pointer event
const probe = (window.airhockey = { frames: [], numbers: [], latencies: [], pictures: [], state: () => now });

// A key of this page alone, kept over a reload, by which it gets its seat back.
const newKey = () => [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");
const key = sessionStorage.getItem("key") || newKey();
sessionStorage.setItem("key", key);

const unsent = []; // messages of clicks while there was no connection
function send(t, fields = {}) {
  const text = JSON.stringify({ t, ...fields });
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(text);
  else if (["consent", "answer", "comment", "withdraw", "next"].includes(t)) unsent.push(text);
}

let answering = false;
function acknowledge() {
  if (answering) return;
  answering = true;
  setTimeout(() => { answering = false; acknowledgedAt = performance.now(); send("seen", { f: now.f }); }, acknowledgedAt + ACKNOWLEDGED - performance.now());
}

function connect() {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  socket = new WebSocket(`${scheme}//${location.host}/ws${location.search}`);
  socket.onopen = () => { down = false; refused = ""; openedAt = performance.now(); send("hello", { key }); tellDevice(inputKind); for (const text of unsent.splice(0)) socket.send(text); };
  socket.onmessage = (event) => {
    const data = JSON.parse(event.data);
    if (data.t === "match") { match = data; trails = []; ownPaddle = null; panel = ""; resize(); openRealTable(); return; }
    receive(data);
    acknowledge();
  };
  socket.onclose = (event) => { down = true; refused = event.reason; setTimeout(connect, 1000); };
}

// -- A recording instead of a game --

const OF_PLAYERS = ["swap", "leave", "stop", "golden"]; // controls of a live open table
let recording = null; // { steps, at, runs }

async function begin() {
  const { mode } = await (await fetch("mode" + location.search)).json();
  if (mode === "live") { connect(); return; }
  const { meta, steps, end } = await (await fetch("recording" + location.search)).json();
  match = meta.match;
  const seats = meta.players.map((p) => ({ driver: p.driver, taken: p.person !== null }));
  recording = { at: 0, runs: true, end, shown: -1, rate: 1 / meta.control_dt };
  recording.steps = steps.map((step) => ({ ...step, seats, seat: null, ack: 0, watching: 0, rate: 1 / meta.control_dt, recording: false }));
  $("scrub").max = steps.length - 1;
  $("timeline").hidden = false;
  for (const name of OF_PLAYERS) $(name).hidden = true;
  $("scrub").oninput = () => { recording.at = Number($("scrub").value); trails = []; };
  $("scrub").onchange = () => $("scrub").blur();
  resize();
}

function advanceRecording(dt) {
  const last = recording.steps.length - 1;
  if (recording.runs) recording.at = Math.min(last, recording.at + dt * Number($("speed").value) * recording.rate);
  const index = Math.floor(recording.at);
  if (index === last) recording.runs = false;
  if (index === recording.shown) return;
  // Steps in between count for trails and sounds, unless it was a jump.
  const from = index > recording.shown && index - recording.shown < 12 ? recording.shown + 1 : index;
  for (let i = from; i <= index; i++) receive({ ...recording.steps[i], phase: i === last && recording.end.reason ? "done" : "play" });
  recording.shown = index;
  $("scrub").value = index;
}

function receive(data) {
  const at = performance.now();
  if (now && data.n < now.n) trails = [];
  before = now; beforeAt = nowAt; now = data; nowAt = at;
  probe.frames.push(at); probe.numbers.push(data.f);
  if (probe.frames.length > 5000) { probe.frames.splice(0, 2500); probe.numbers.splice(0, 2500); }
  data.pucks.forEach((p, i) => {
    const trail = (trails[i] = trails[i] || []);
    if (data.phase === "play") trail.push([p[0], p[1]]);
    if (trail.length > TRAIL) trail.shift();
  });
  if (data.ack && pending.has(data.ack)) {
    const spent = at - pending.get(data.ack);
    roundTrip = roundTrip === null ? spent : roundTrip + 0.1 * (spent - roundTrip);
  }
  for (const [kind, which] of data.events) {
    if (kind === "goal" && match.goal_lines[which]) { flash = 1; flashColour = colour(scorer(match.goal_lines[which].owner)); beep(220, 0.35); }
    else beep(520 + 90 * which, 0.05);
  }
  correct(data);
}

// In a game of two teams the other one has scored; else only who conceded is sure.
function scorer(owner) {
  const other = match.seats.findIndex((s) => s.team !== match.seats[owner].team);
  return new Set(match.seats.map((s) => s.team)).size === 2 ? other : owner;
}
