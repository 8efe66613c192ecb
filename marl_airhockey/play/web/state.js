// What the page knows: the match, its newest frames, and who listens to them.
//
// Frames come from a connection, a recording or a match in this page; all of them call
// `receiveMatch` and `receive`. Lengths are metres in the table frame. A seat's `rotation`
// takes them into its ego frame.

export const $ = (id) => document.getElementById(id);
export const put = (node, text) => { if (node.textContent !== text) node.textContent = text; };
export const element = (tag, text = "", cls = "") => {
  const node = document.createElement(tag);
  node.textContent = text; node.className = cls;
  return node;
};

// `send` and `rate` belong to the source of the frames.
export const game = {
  match: null, now: null, before: null, nowAt: 0, beforeAt: 0,
  down: false, refused: "", openedAt: 0,
  recording: null,
  send: () => {},
};
export const send = (kind, fields = {}) => game.send(kind, fields);
export const probe = (window.airhockey = { frames: [], numbers: [], latencies: [], pictures: [], state: () => game.now });

const listeners = { match: [], frame: [] };
export const on = (kind, listener) => listeners[kind].push(listener);

export function receiveMatch(match) {
  game.match = match; game.now = game.before = null;
  for (const listener of listeners.match) listener(match);
}

export function receive(frame) {
  const at = performance.now();
  game.before = game.now; game.beforeAt = game.nowAt; game.now = frame; game.nowAt = at;
  probe.frames.push(at); probe.numbers.push(frame.f);
  if (probe.frames.length > 5000) { probe.frames.splice(0, 2500); probe.numbers.splice(0, 2500); }
  for (const listener of listeners.frame) listener(frame, game.before, at);
}

// -- Questions that several modules ask --

export const mySeat = () => (game.now && game.now.seat !== null ? game.match.seats[game.now.seat] : null);
export const linkRate = () => (game.now && game.now.link ? game.now.link.rate : 60);
export const teams = () => new Set(game.match.seats.map((seat) => seat.team));
export const isTask = () => game.match.seats.length === 1;
export const isPerson = (seat) => seat.driver === "person";
export const freeSeat = () => game.now.seats.findIndex((seat) => isPerson(seat) && !seat.taken);
export const mayControl = () => (game.now.seat !== null || !game.now.seats.some(isPerson)) && freeSeat() < 0;
export const runs = () => ["play", "countdown", "arrange", "goal"].includes(game.now.phase);
export const words = (name) => name.replaceAll("_", " ");
export const capital = (text) => (text ? text[0].toUpperCase() + text.slice(1) : "");

// In a game of two teams the other one has scored; else only who conceded is sure.
export function scorerOf(line) {
  const owner = game.match.goal_lines[line].owner, seats = game.match.seats;
  return teams().size === 2 ? seats.findIndex((seat) => seat.team !== seats[owner].team) : owner;
}
