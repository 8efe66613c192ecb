// A match of a person in Node: node run_match.mjs FOLDER PAGE GAME SCRIPT
// FOLDER has the page's modules, PAGE is a static page. SCRIPT is JSON: { ticks, messages: { tick:
// [[name, ...arguments]] } }, with methods of the match, or "aim" with a position. Prints the
// state after each tick as JSON.
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { gunzipSync } from "node:zlib";

const [folder, page, name, script] = process.argv.slice(2);
const { Match } = await import(join(folder, "static/match.js")), { Person } = await import(join(folder, "static/drivers.js"));
const load = (path) => gunzipSync(readFileSync(join(page, "games", path)));
const { clock } = JSON.parse(readFileSync(join(page, "games/index.json"))), game = JSON.parse(load(`${name}.bin`));
game.image = new Uint8Array(Buffer.from(game.image, "base64"));
const { ticks, messages } = JSON.parse(script), match = new Match(new WebAssembly.Module(load("code.bin")), game, { ...clock, goal_stop: 0 });
match.seats.forEach((_, i) => match.setDriver(i, new Person(game.match, i)));
match.begin(0);
match.phase = "lobby";
const states = [];
for (let k = 0; k < ticks; k++) {
  for (const [kind, ...given] of messages[k] || []) kind === "aim" ? match.drivers[0].aim(...given) : match[kind](...given);
  match.tick();
  states.push(match.state());
}
console.log(JSON.stringify(states));
