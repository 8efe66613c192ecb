// Run exported code in Node: node run_code.mjs FOLDER DESCRIPTION.json ACTIONS
// FOLDER has the page's modules. ACTIONS is a file of float64 (steps, seats, 2). Prints the
// SHA-256 of all states, rewards, observations and displays after serves.
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";

const [folder, description, actions] = process.argv.slice(2);
const { World } = await import(join(folder, "static/world.js"));
const facts = JSON.parse(readFileSync(description)), file = (name) => readFileSync(join(dirname(description), name));
const world = new World(new WebAssembly.Module(file(facts.code)), facts, new Uint8Array(file(facts.image)));
const bytes = readFileSync(actions), given = new Float64Array(bytes.buffer, bytes.byteOffset, bytes.length / 8);
const size = world.array("inputs.action").length, steps = given.length / size;
const hash = createHash("sha256"), began = process.hrtime.bigint();
let served = 0, eliminated = 0;
const serve = world.serve;
world.serve = function () { served++; serve.call(this); };
for (let k = 0; k < steps; k++) {
  world.step(given.subarray(k * size, (k + 1) * size));
  for (const name of ["state.position", "state.velocity", "state.angle", "state.spin", "verdict.outcome.reward"]) hash.update(world.current(name));
  if ("observe" in facts.calls) hash.update(world.observe());
  world.show();
  for (const name of facts.shown) hash.update(world.shown(name));
  eliminated = Math.max(eliminated, (world.shown("eliminated") || []).reduce((a, b) => a + b, 0));
}
console.log(JSON.stringify({ hash: hash.digest("hex"), served, eliminated, us: Number(process.hrtime.bigint() - began) / 1000 / steps }));
