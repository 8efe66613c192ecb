// What moves a paddle: a pointer, a stick, or a policy that is limited to human latency and speed.
// Actions are fractions of the top speed in the ego frame of the seat.

const DEAD = 0.12; // dead zone of a stick, share of full tilt
const CORRELATION = 0.25; // correlation time of the error of an observed puck, s
const OWN_PACE = 0.05; // time between two decisions of a policy without another one, s

const rotated = ([[a, b], [c, d]], x, y) => [a * x + b * y, c * x + d * y];
const clipped = ([x, y]) => [x, y].map((v) => Math.max(-1, Math.min(1, v)));
function normal() { return Math.sqrt(-2 * Math.log1p(-Math.random())) * Math.cos(2 * Math.PI * Math.random()); }

// A person: the paddle moves to the pointer, or as the stick is tilted.
export class Person {
  constructor(match, seat) { this.seat = match.seats[seat]; this.index = seat; this.mouse = match.mouse; this.rest(); }
  reset() {}
  rest() { this.target = this.tilt = null; }
  aim(x, y) { this.target = [x, y]; this.tilt = null; }
  stick(x, y) { this.tilt = [x, y]; this.target = null; }

  act(world) {
    const { rotation, speed: top, acceleration } = this.seat;
    if (this.tilt) {
      const size = Math.hypot(...this.tilt), live = Math.max(Math.min(size, 1) - DEAD, 0) / (1 - DEAD) / Math.max(size, 1e-9);
      return rotated(rotation, live * this.tilt[0], live * this.tilt[1]);
    }
    if (!this.target) return [0, 0];
    const position = world.current("state.position"), i = 2 * this.index;
    const x = this.target[0] - position[i], y = this.target[1] - position[i + 1], far = Math.max(Math.hypot(x, y), 1e-9);
    const speed = Math.min(this.mouse.gain * far, Math.sqrt(2 * this.mouse.brake * acceleration * far), top);
    return clipped(rotated(rotation, (x * speed) / far / top, (y * speed) / far / top));
  }
}

// A policy with a handicap: latency and error of what it observes, and the largest norm of its action.
export class Computer {
  constructor(policy, handicap, seat) {
    this.policy = policy; this.handicap = handicap; this.index = seat;
    this.dt = policy.card.control_dt || OWN_PACE;
    this.delay = Math.round(handicap.reaction / this.dt);
    this.reset();
  }
  reset() { this.past = []; this.error = null; this.held = [0, 0]; }

  act(world, step) {
    if (step % Math.round(this.dt / world.facts.control_dt)) return this.held;
    const limited = this.handicap.reaction > 0 || this.handicap.noise > 0, size = world.facts.observation.length;
    const all = world.observe(limited ? (position, velocity) => this.perceive(world, position, velocity) : undefined);
    const [x, y] = this.policy.act(all.subarray(this.index * size, (this.index + 1) * size));
    const most = Math.min(this.handicap.pace / Math.max(Math.hypot(x, y), 1e-9), 1);
    return (this.held = [x * most, y * most]);
  }

  // Replace the bodies that the seat observes by late and inexact ones, except for its own paddle.
  perceive(world, position, velocity) {
    const [first, last] = world.facts.bodies.pucks, own = [2 * this.index, 2 * this.index + 1];
    const now = [position.slice(), velocity.slice()];
    if (!this.past.length) this.past = Array(this.delay).fill(now);
    this.past.push(now);
    const late = this.past.shift(), keep = this.error ? Math.exp(-this.dt / CORRELATION) : 0;
    this.error = Float64Array.from({ length: 2 * (last - first) }, (_, k) => keep * (this.error ? this.error[k] : 0) + Math.sqrt(1 - keep * keep) * this.handicap.noise * normal());
    late.forEach((row, k) => { const to = k ? velocity : position; row.forEach((value, i) => { if (!own.includes(i)) to[i] = value; }); });
    this.error.forEach((value, k) => { position[2 * first + k] += value; });
  }
}
