// A match in this page: drivers, phases and clock, as in `LiveMatch`.

import { drawn, eventsOf } from "./frame.js";
import { GameLog } from "./saved.js";
import { Tally } from "./tally.js";
import { World } from "./world.js";

const PLAYED = "played to the end";

export class Match {
  // `game` has the description of the table, the facts and the image; `clock` has times, s.
  constructor(module, game, clock) {
    this.game = game; this.clock = clock; this.seats = game.match.seats;
    this.world = new World(module, game.facts, game.image);
    this.drivers = this.seats.map(() => null);
    this.phase = "lobby"; this.number = 0; this.timeLeft = 0;
    this.seed = 0;
    this.forget();
    this.begin();
  }

  begin(seed = Math.floor(Math.random() * this.world.facts.starts.values.length)) {
    this.world.reset(seed);
    this.seed = seed; this.ticks = 0; this.events = []; this.reason = ""; this.number++;
    this.tally = new Tally(this.seats.length);
    this.log.begin(seed);
    for (const driver of this.drivers) if (driver) driver.reset();
  }

  // Forget the games for the file, which has the same players in all games.
  forget() { this.log = new GameLog(this.game.match.scenario, this.game.facts.control_dt); this.log.begin(this.seed); }
  setDriver(seat, driver) { this.drivers[seat] = driver; this.forget(); }
  get between() { return this.phase === "lobby" || this.phase === "done"; }

  start() {
    const { countdown, resume, retry } = this.clock;
    if (this.phase === "pause") { this.phase = "countdown"; this.timeLeft = Math.max(this.timeLeft, resume); }
    else if (this.phase === "goal") { this.phase = "play"; this.timeLeft = 0; }
    else if (this.between) {
      const again = this.phase === "done";
      if (again) this.begin();
      this.phase = "countdown"; this.timeLeft = again && this.seats.length === 1 ? retry : countdown;
    }
    this.reason = "";
  }
  pause(reason = "") { if (["play", "countdown", "goal"].includes(this.phase)) { this.phase = "pause"; this.reason = reason; } }
  abort(reason) { if (!this.between) { this.phase = "done"; this.reason = reason; this.log.end(reason); } }
  clear() { this.abort("cleared"); if (this.phase === "done") { this.begin(); this.phase = "lobby"; } }

  // Advance the clock by a tick.
  tick() {
    this.events = [];
    if (this.phase === "countdown" || this.phase === "goal") {
      this.timeLeft -= 1 / this.clock.rate;
      if (this.timeLeft <= 1e-9) { this.phase = "play"; this.timeLeft = 0; }
    }
    if (this.phase !== "play") return;
    this.step(Float32Array.from(this.drivers.flatMap((driver) => driver.act(this.world, this.ticks))));
    if (this.phase === "play" && this.events.some(([kind]) => kind === "goal")) { this.phase = "goal"; this.timeLeft = this.clock.goal_stop; }
  }

  step(actions) {
    const { world } = this;
    world.step(actions);
    this.ticks++;
    this.log.add(actions, world);
    this.events = eventsOf(world);
    this.tally.note(world);
    if (world.current("verdict.outcome.terminated")[0] || world.current("verdict.outcome.truncated")[0]) { this.phase = "done"; this.reason = ""; this.log.end(PLAYED); }
  }

  state() {
    const { phase, ticks, timeLeft, reason, events, tally, world } = this;
    const notes = { golden_goal: false, offers_golden_goal: false, mixed: false };
    return { phase, n: ticks, time_left: Math.round(timeLeft * 100) / 100, ...drawn(world), reason, events, ...notes, tally: phase === "done" ? tally.state() : null };
  }
}
