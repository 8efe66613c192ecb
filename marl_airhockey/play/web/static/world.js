// One world as WebAssembly: the same code, the same arrays and the same bits as in Python.
//
// `marl_airhockey.code_export` writes the module, and for each scenario an image of the arrays and
// a description of them (`facts`). Lengths are metres in the table frame.

const TYPES = { float64: Float64Array, float32: Float32Array, int64: BigInt64Array, uint64: BigUint64Array, int16: Int16Array, bool: Uint8Array };
const PAGE = 65536; // bytes

export class World {
  constructor(module, facts, image) {
    if (WebAssembly.Module.imports(module).length) throw new Error("the module has imports");
    const { memory, __heap_base, ...functions } = new WebAssembly.Instance(module).exports;
    const base = Math.ceil(__heap_base.value / 64) * 64, missing = base + image.length - memory.buffer.byteLength;
    if (missing > 0) memory.grow(Math.ceil(missing / PAGE));
    Object.assign(this, { facts, functions, base, buffer: memory.buffer, views: new Map(), now: 0, past: [] });
    this.fresh = image.slice();
    const words = new BigInt64Array(this.fresh.buffer);
    for (const at of facts.offsets) words[at / 8] += BigInt(base);
    this.delayed = Object.keys(facts.arrays).filter((name) => /^observe\.(state|memory)\./.test(name));
    this.reset(0);
  }

  // Begin the episode with a seed, which is a number of a start.
  reset(seed) {
    const { words, values } = this.facts.starts, bytes = values[seed].match(/../g) || [];
    const own = new BigUint64Array(Uint8Array.from(bytes, (text) => parseInt(text, 16)).buffer);
    new Uint8Array(this.buffer, this.base).set(this.fresh);
    const longs = new BigUint64Array(this.buffer, this.base, this.fresh.length / 8);
    words.forEach((at, i) => { longs[at] = own[i]; });
    this.now = 0;
    this.past = [];
    for (let k = 0; k <= this.facts.reaction; k++) this.note();
  }

  array(name) {
    if (!this.views.has(name)) {
      const { offset, shape, dtype } = this.facts.arrays[name];
      this.views.set(name, new TYPES[dtype](this.buffer, this.base + offset, shape.reduce((a, b) => a * b, 1)));
    }
    return this.views.get(name);
  }
  has(name) { return name in this.facts.arrays; }
  // An array of the current moment, for example "state.position".
  current(name) { return this.array(`moment_${this.now}.${name}`); }
  // An array of the display; undefined if the scenario has none. `show` computes them.
  shown(name) { const full = `show_${this.now}.${name}`; return this.has(full) ? this.array(full) : undefined; }

  call(name) {
    for (const { function: f, table, length } of this.facts.calls[name]) {
      const result = this.functions[f](this.base + table, BigInt(length), 1n);
      if (result !== 1) throw new Error(`${name} returned ${result}`);
    }
  }
  show() { const name = `show_${this.now}`; if (name in this.facts.calls) this.call(name); }

  source(name) { return this.current(name.replace(/^observe\.state/, "state").replace(/^observe\.memory/, "verdict.memory")); }
  // Store what seats observe after the reaction time.
  note() {
    const row = this.past.length > this.facts.reaction ? this.past.shift() : this.delayed.map((name) => this.source(name).slice());
    this.delayed.forEach((name, k) => row[k].set(this.source(name)));
    this.past.push(row);
  }
  // An array as the seats observe it now, for example "state.position".
  observed(name) { return this.past[0][this.delayed.indexOf(`observe.${name}`)]; }

  // Move by a control step. `actions` are fractions of the top speed, ego frames.
  step(actions) {
    this.array("inputs.action").set(actions);
    this.eliminate();
    this.call(`step_${this.now}`);
    this.now = 1 - this.now;
    if (this.has(`moment_${this.now}.verdict.outcome.serves`) && this.current("verdict.outcome.serves")[0]) this.serve();
    this.note();
  }

  // Eliminated paddles are behind their sides, which become walls.
  eliminate() {
    const { elimination } = this.facts;
    if (!elimination) return;
    const [action, prescribed, raised, closed] = ["action", "prescribed", "raised", "closed"].map((name) => this.array(`inputs.${name}`));
    prescribed.fill(NaN); raised.fill(0);
    this.show();
    const gone = this.shown("eliminated");
    gone.forEach((is, seat) => { if (is) { action.fill(0, 2 * seat, 2 * seat + 2); raised[seat] = 1; prescribed.set(elimination.parking[seat], 4 * seat); } });
    elimination.owner.forEach((seat, line) => { closed[line] = seat >= 0 && gone[seat] ? 1 : 0; });
  }

  serve() {
    this.show();
    this.shown("headings").forEach((heading, puck) => {
      this.call("draw");
      const [turn, edge] = this.array("draw.unit").map((u) => u * 2 - 1);
      if (Number.isNaN(heading)) return;
      const name = `serve_${this.now}_${puck}`;
      this.array(`${name}.heading`)[0] = heading + 0.3 * turn;
      this.array(`${name}.edge`)[0] = this.facts.spin * edge;
      this.call(name);
    });
    this.call(`place_${this.now}`);
  }

  // The observations of all seats, one after the other. `change` can change the observed
  // positions and velocities of the bodies, pairs of x and y, before.
  observe(change = () => {}) {
    this.delayed.forEach((name, k) => this.array(name).set(this.past[0][k]));
    change(this.array("observe.state.position"), this.array("observe.state.velocity"));
    for (const [own, of] of [["own", "position"], ["own_velocity", "velocity"]]) {
      if (!this.has(`observe.sensor.${own}`)) continue;
      const to = this.array(`observe.sensor.${own}`);
      to.set(this.current(`state.${of}`).subarray(0, to.length));
    }
    this.call("observe");
    return this.array("observe.observation");
  }
}
