// A learned policy: a network with ReLU layers, with the operations of `NumpyPolicy`.

import { readNpz } from "./npz.js";

export class Policy {
  // Read an .npz file that `NumpyPolicy.save` wrote.
  static async read(buffer) {
    const arrays = await readNpz(buffer), part = (name) => { if (!arrays[name]) throw new Error(`the array ${name} is missing`); return arrays[name]; };
    const layers = Object.keys(arrays).filter((name) => name.startsWith("weight_")).map((_, i) => [part(`weight_${i}`), part(`bias_${i}`)]);
    return new Policy(layers, part("centre"), part("unit"), JSON.parse(part("card").data));
  }

  constructor(layers, centre, unit, card) {
    let size = centre.data.length;
    this.card = card; this.inputs = size;
    if (unit.data.length !== size || unit.data.includes(0)) throw new Error("centre and unit do not fit");
    for (const [weight, bias] of layers) {
      if (weight.shape[0] !== bias.data.length || weight.shape[1] !== size) throw new Error(`a layer of shape ${weight.shape} after ${size} numbers`);
      size = bias.data.length;
    }
    const numbers = [centre, unit, ...layers.flat()].map(({ data }) => data);
    if (!layers.length || size !== 2) throw new Error("its actions do not have the shape (2,)");
    if (!numbers.every((data) => data.every(Number.isFinite))) throw new Error("every element must be a finite number");
    this.type = numbers.every((data) => data instanceof Float32Array) ? Float32Array : Float64Array;
    this.round = this.type === Float32Array ? Math.fround : (x) => x;
    this.centre = centre.data; this.unit = unit.data;
    // Weights by input, so that inputs that are 0 cost nothing.
    this.layers = layers.map(([{ data, shape: [rows, columns] }, bias]) => [this.type.from({ length: data.length }, (_, k) => data[(k % rows) * columns + Math.floor(k / rows)]), bias.data]);
  }

  // The mean action for an observation.
  act(observation) {
    const { round, type } = this;
    let before = type.from(observation, (x, i) => round(round(x - this.centre[i]) / this.unit[i]));
    this.layers.forEach(([weights, bias], layer) => {
      const after = type.from(bias), rows = after.length, last = layer + 1 === this.layers.length;
      for (let i = 0; i < before.length; i++) {
        const x = before[i], at = i * rows;
        if (x !== 0) for (let o = 0; o < rows; o++) after[o] += round(weights[at + o] * x);
      }
      before = last ? after : after.map((x) => (x < 0 ? 0 : x));
    });
    const action = this.card.bounded ? before.map(Math.tanh) : before;
    return Array.from(action, (x) => Math.max(-1, Math.min(1, x)));
  }
}
