// Run exported code in Node: node run_code.mjs DESCRIPTION.json ACTIONS
// ACTIONS is a file of float64 (steps, seats, 2). Prints the SHA-256 of all states,
// rewards and observations after serves.
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";

const TYPES = { float64: Float64Array, float32: Float32Array, int64: BigInt64Array, uint64: BigUint64Array, bool: Uint8Array };

class World {
  constructor(facts, code, image) {
    const module = new WebAssembly.Module(code);
    if (WebAssembly.Module.imports(module).length) throw new Error("the module has imports");
    const { memory, __heap_base, ...functions } = new WebAssembly.Instance(module).exports;
    this.base = Math.ceil(__heap_base.value / 64) * 64;
    memory.grow(Math.max(0, Math.ceil((this.base + image.length - memory.buffer.byteLength) / 65536)));
    new Uint8Array(memory.buffer, this.base).set(image);
    for (const at of facts.offsets) new BigInt64Array(memory.buffer, this.base + at, 1)[0] += BigInt(this.base);
    this.facts = facts; this.functions = functions; this.memory = memory;
    this.now = 0; this.past = [];
    this.delayed = Object.keys(facts.arrays).filter((name) => /^observe\.(state|memory)\./.test(name));
    for (let k = 0; k <= facts.reaction; k++) this.note();
  }
  array(name) {
    const { offset, shape, dtype } = this.facts.arrays[name];
    return new TYPES[dtype](this.memory.buffer, this.base + offset, shape.reduce((a, b) => a * b, 1));
  }
  call(name) {
    for (const { function: f, table, length } of this.facts.calls[name]) {
      const result = this.functions[f](this.base + table, BigInt(length), 1n);
      if (result !== 1) throw new Error(`${name} returned ${result}`);
    }
  }
  // The array of the current moment with the name of an array that is observed.
  source(name) { return this.array(name.replace(/^observe\.state/, `moment_${this.now}.state`).replace(/^observe\.memory/, `moment_${this.now}.verdict.memory`)); }
  // What seats observe with the reaction time.
  note() {
    this.past.push(this.delayed.map((name) => this.source(name).slice()));
    if (this.past.length > this.facts.reaction + 1) this.past.shift();
  }
  step(actions) {
    this.array("inputs.action").set(actions);
    this.call(`step_${this.now}`);
    this.now = 1 - this.now;
    const serves = `moment_${this.now}.verdict.outcome.serves`;
    if (serves in this.facts.arrays && this.array(serves)[0]) this.serve();
    this.note();
  }
  serve() {
    const toward = this.array(`moment_${this.now}.verdict.memory.serve`);
    toward.forEach((side, k) => {
      this.call("draw");
      const [first, second] = this.array("draw.unit").map((u) => u * 2 - 1);
      if (side === 0) return;
      const name = `serve_${this.now}_${k}`;
      this.array(`${name}.heading`)[0] = (side > 0 ? 0 : Math.PI) + 0.3 * first;
      this.array(`${name}.edge`)[0] = this.facts.spin * second;
      this.call(name);
    });
    this.call(`place_${this.now}`);
  }
  observe() {
    this.delayed.forEach((name, k) => this.array(name).set(this.past[0][k]));
    for (const [own, of] of [["own", "position"], ["own_velocity", "velocity"]]) {
      const name = `observe.sensor.${own}`;
      if (name in this.facts.arrays) { const to = this.array(name); to.set(this.array(`moment_${this.now}.state.${of}`).subarray(0, to.length)); }
    }
    this.call("observe");
    return this.array("observe.observation");
  }
}

const [description, actions] = process.argv.slice(2);
const facts = JSON.parse(readFileSync(description)), folder = dirname(description);
const world = new World(facts, readFileSync(join(folder, facts.code)), readFileSync(join(folder, facts.image)));
const bytes = readFileSync(actions), given = new Float64Array(bytes.buffer, bytes.byteOffset, bytes.length / 8);
const size = world.array("inputs.action").length, steps = given.length / size;
const hash = createHash("sha256"), began = process.hrtime.bigint();
let served = 0;
const serve = world.serve; world.serve = function () { served++; serve.call(this); };
for (let k = 0; k < steps; k++) {
  world.step(given.subarray(k * size, (k + 1) * size));
  for (const name of ["state.position", "state.velocity", "state.angle", "state.spin", "verdict.outcome.reward"]) hash.update(world.array(`moment_${world.now}.${name}`));
  if ("observe" in facts.calls) hash.update(world.observe());
}
console.log(JSON.stringify({ hash: hash.digest("hex"), served, us: Number(process.hrtime.bigint() - began) / 1000 / steps }));
