// Games as a file: their seeds, the actions of all seats, and a hash of all states.
//
// The first line is JSON. The second one is the SHA-256 of the first line and of the states, so that
// a change of the file or another result on another machine is found. `data/saved_games.py` reads it.

import { drawn, eventsOf } from "./frame.js";
import { World } from "./world.js";

export const SUFFIX = ".airhockey";
const FORMAT = "airhockey-games-1";
const HASHED = ["state.position", "state.velocity", "state.angle", "state.spin", "verdict.outcome.reward"];

// The numbers of a step that are hashed; adding 0 removes the sign of zeros.
const numbersOf = (world) => Float64Array.from(HASHED.flatMap((name) => [...world.current(name)]), (x) => x + 0);

function joined(parts) {
  const bytes = new Uint8Array(parts.reduce((size, part) => size + part.byteLength, 0));
  let at = 0;
  for (const part of parts) { bytes.set(new Uint8Array(part.buffer, part.byteOffset, part.byteLength), at); at += part.byteLength; }
  return bytes;
}

async function hashOf(line, states) {
  if (!crypto.subtle) throw new Error("hashes need https, or the address localhost");
  const digest = await crypto.subtle.digest("SHA-256", joined([new TextEncoder().encode(line), ...states]));
  return [...new Uint8Array(digest)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

const toText = (bytes) => btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
const toBytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));

// The episodes of a match, one after the other.
export class GameLog {
  constructor(scenario, control_dt) { Object.assign(this, { scenario, control_dt, episodes: [] }); }
  begin(seed) { this.episodes = [...this.played, { seed, actions: [], states: [], reason: "cut off" }]; }
  add(actions, world) { const { actions: all, states } = this.episodes.at(-1); all.push(actions); states.push(numbersOf(world)); }
  end(reason) { this.episodes.at(-1).reason = reason; }
  get played() { return this.episodes.filter(({ actions }) => actions.length); }

  // The content of the file. `players` are rows { driver, handicap, person }.
  async file(players) {
    const { scenario, control_dt, played } = this, episodes = played.map(({ seed, actions, reason }) => ({ seed, steps: actions.length, reason }));
    const actions = toText(joined(played.flatMap((episode) => episode.actions)));
    const line = JSON.stringify({ format: FORMAT, scenario, control_dt, players, episodes, actions });
    return `${line}\n${await hashOf(line, played.flatMap(({ states }) => states))}\n`;
  }
}

export function read(file) {
  const [line, hash] = file.split("\n");
  let head = null;
  try { head = JSON.parse(line); } catch { /* see below */ }
  if (!head || head.format !== FORMAT) throw new Error("it is not a saved game");
  return { ...head, line, hash, actions: new Float32Array(toBytes(head.actions).buffer) };
}

// Play a saved game again: the data of a recording (see `recording.js`), or an error if a result differs.
export async function replayed(saved, module, game) {
  const world = new World(module, game.facts, game.image), size = 2 * game.match.seats.length, states = [], frames = [];
  const notes = { time_left: 0, reason: "", golden_goal: false, offers_golden_goal: false, mixed: false, tally: null };
  let at = 0;
  for (const { seed, steps } of saved.episodes) {
    if (!(seed in game.facts.starts.values) || saved.actions.length < (at + steps) * size) throw new Error("its seeds or its actions do not fit");
    world.reset(seed);
    frames.push({ ...notes, n: 0, ...drawn(world), events: [] });
    for (let n = 1; n <= steps; n++, at++) {
      world.step(saved.actions.subarray(at * size, (at + 1) * size));
      states.push(numbersOf(world));
      frames.push({ ...notes, n, ...drawn(world), events: eventsOf(world) });
    }
  }
  if ((await hashOf(saved.line, states)) !== saved.hash) throw new Error("it was changed, or this browser computes other results: its hash differs");
  const { reason } = saved.episodes.at(-1);
  return { meta: { match: game.match, control_dt: game.facts.control_dt, players: saved.players }, steps: frames, end: { reason, steps: at } };
}
