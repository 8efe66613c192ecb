// Run exported code in Node: node run_code.mjs DESCRIPTION.json ACTIONS STEPS
// ACTIONS is a file of float64 (steps, seats, 2). Writes the SHA-256 of all states.
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";

const [description, actions, count] = process.argv.slice(2);
const facts = JSON.parse(readFileSync(description)), folder = dirname(description);
const image = readFileSync(join(folder, facts.code.replace(".wasm", ".bin")));
const module = new WebAssembly.Module(readFileSync(join(folder, facts.code)));
if (WebAssembly.Module.imports(module).length) throw new Error("the module has imports");
const { memory, __heap_base, ...functions } = new WebAssembly.Instance(module).exports;
const base = Math.ceil(__heap_base.value / 64) * 64;
memory.grow(Math.ceil((base + image.length - memory.buffer.byteLength) / 65536 + 1));
new Uint8Array(memory.buffer, base).set(image);
for (const at of facts.offsets) new BigInt64Array(memory.buffer, base + at, 1)[0] += BigInt(base);

const bytes = (name) => {
  const { offset, shape, dtype } = facts.arrays[name];
  const size = shape.reduce((a, b) => a * b, 1) * (dtype === "bool" ? 1 : Number(dtype.match(/\d+/)[0]) / 8);
  return new Uint8Array(memory.buffer, base + offset, size);
};
const given = readFileSync(actions), hash = createHash("sha256"), input = bytes("inputs.action");
const began = process.hrtime.bigint();
for (let k = 0; k < Number(count); k++) {
  input.set(given.subarray(k * input.length, (k + 1) * input.length));
  for (const call of facts.steps[k % 2]) {
    const result = functions[call.function](base + call.table, BigInt(call.length), 1n);
    if (result !== 1) throw new Error(`${call.function} returned ${result}`);
  }
  for (const name of ["position", "velocity", "angle", "spin"]) hash.update(bytes(`moment_${1 - (k % 2)}.state.${name}`));
  hash.update(bytes(`moment_${1 - (k % 2)}.verdict.outcome.reward`));
}
const us = Number(process.hrtime.bigint() - began) / 1000 / Number(count);
console.log(JSON.stringify({ hash: hash.digest("hex"), us }));
