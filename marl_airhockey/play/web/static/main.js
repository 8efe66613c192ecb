// The page without a server: games and policies are files, and the match runs in this page.

import { inflated } from "./npz.js";
import { Policy } from "./policy.js";
import { read, replayed, SUFFIX } from "./saved.js";
import { Table } from "./table.js";
import { close, show } from "../recording.js";
import { $, element, game, on, probe } from "../state.js";

const BEHIND = 6; // ticks that a delayed loop catches up
const GZIP = [0x1f, 0x8b];
const READ = 6000; // ms for which a message is shown

// A file of the folder; it may be compressed, even if the server does not say so.
async function load(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw new Error(`${path} is missing`);
  const bytes = new Uint8Array(await answer.arrayBuffer());
  return GZIP.every((byte, i) => bytes[i] === byte) ? inflated(bytes, "gzip") : bytes;
}
const loadJson = async (path) => JSON.parse(new TextDecoder().decode(await load(path)));

class Assets {
  constructor(module) { this.module = module; this.games = new Map(); this.policies = new Map(); }

  async game(name) {
    if (!this.games.has(name)) {
      const found = await loadJson(`games/${name}.bin`);
      this.games.set(name, { ...found, image: Uint8Array.from(atob(found.image), (c) => c.charCodeAt(0)) });
    }
    return this.games.get(name);
  }
  async policy(name) {
    if (!this.policies.has(name)) this.policies.set(name, await Policy.read((await load(`policies/${name.replace("zoo/", "")}.npz`)).buffer));
    return this.policies.get(name);
  }
  keep(name, policy) { this.policies.set(name, policy); }
}

let table = null, clock = null;

export async function begin() {
  const index = await loadJson("games/index.json");
  ({ clock } = index);
  const assets = new Assets(await WebAssembly.compile(await load("games/code.bin")));
  table = new Table(assets, clock, index.games);
  game.send = (kind, fields) => table.handle(kind, fields);
  probe.table = table;
  const wanted = new URLSearchParams(location.search).get("game");
  await table.open(index.games.some(({ name }) => name === wanted) ? wanted : index.games[0].name);
  addTools();
  loop(performance.now());
}

let rate = 60, mark = 0, count = 0;
function loop(due) {
  const now = performance.now();
  if (game.recording === null) {
    for (let k = 0; due <= now && k < BEHIND; k++, count++, due += 1000 / clock.rate) table.tick(rate);
    if (now - mark >= 1000) { rate = (1000 * count) / (now - mark); mark = now; count = 0; }
  }
  if (due <= now) due = now + 1000 / clock.rate;
  setTimeout(() => loop(due), Math.max(0, due - performance.now()));
}

// -- Files --

const tool = (text, act) => { const node = element("button", text); node.onclick = act; $("tools").prepend(node); return node; };
let message = null, hides = 0;
function say(text) {
  message.textContent = text; message.hidden = false;
  clearTimeout(hides);
  hides = setTimeout(() => { message.hidden = true; }, READ);
}

function addTools() {
  message = element("p", "", "message");
  message.hidden = true; message.setAttribute("role", "status");
  document.body.append(message);
  const input = Object.assign(element("input"), { type: "file", accept: `${SUFFIX},.npz`, hidden: true });
  document.body.append(input);
  input.onchange = () => { if (input.files.length) take(input.files[0]); input.value = ""; };
  const save = tool("Save the games", saveGame), open = tool("Open a file", () => input.click());
  const leave = tool("Close the replay", () => { close(); table.describe(); });
  open.title = "A saved game, or a policy (.npz)";
  function update() {
    const busy = game.recording !== null;
    leave.hidden = !busy; open.hidden = busy || !table.match.between; save.hidden = busy || !table.match.log.played.length || !table.match.between;
  }
  on("frame", update); on("match", update);
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => { event.preventDefault(); if (event.dataTransfer.files.length) take(event.dataTransfer.files[0]); });
}

async function saveGame() {
  try {
    const link = element("a"), stamp = new Date().toISOString().slice(0, 19).replace(/[-:]/g, "");
    link.href = URL.createObjectURL(new Blob([await table.file()], { type: "application/json" }));
    link.download = `${table.match.log.scenario}-${stamp}${SUFFIX}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), READ);
  } catch (error) { say(`The games were not saved: ${error.message}.`); }
}

// Show a saved game, or play against a policy.
async function take(file) {
  try {
    if (!table.match.between) throw new Error("end the match first");
    if (file.name.endsWith(".npz")) {
      const title = file.name.replace(/\.npz$/, "");
      await table.add(title, await Policy.read(await file.arrayBuffer()));
      say(`${title} plays against you now.`);
      return;
    }
    const saved = read(await file.text());
    if (!table.games.some(({ name }) => name === saved.scenario)) throw new Error(`there is no game ${saved.scenario}`);
    show(await replayed(saved, table.assets.module, await table.assets.game(saved.scenario)));
    say("The replay has the same hash as the games.");
  } catch (error) { say(`${file.name}: ${error.message}.`); }
}
