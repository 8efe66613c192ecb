// Actions of a policy in JavaScript: node run_policy.mjs FOLDER POLICY.npz OBSERVATIONS SIZE
// OBSERVATIONS is a file of float32 (n, SIZE). Prints the actions as JSON.
import { readFileSync } from "node:fs";
import { join } from "node:path";

const [folder, file, observations, size] = process.argv.slice(2);
const { Policy } = await import(join(folder, "static/policy.js"));
const buffer = (path) => { const data = readFileSync(path); return data.buffer.slice(data.byteOffset, data.byteOffset + data.length); };
const policy = await Policy.read(buffer(file)), rows = new Float32Array(buffer(observations));
const actions = Array.from({ length: rows.length / size }, (_, k) => policy.act(rows.subarray(k * size, (k + 1) * size)));
console.log(JSON.stringify(actions));
