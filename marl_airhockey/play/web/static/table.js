// A table for one person in this page: what the server does in `Session` and `OpenTable`.

import { Computer, Person } from "./drivers.js";
import { Match } from "./match.js";
import { capital, receive, receiveMatch } from "../state.js";

const DRAWN = ["time", "paddles", "pucks", "puck_angles", "blocks", "angles", "marks", "eliminated"];
const ANOTHER = 100_000; // more than the number of steps of an episode

export class Table {
  // `assets` load the games and policies; `clock` has times, s.
  constructor(assets, clock, games) {
    Object.assign(this, { assets, clock, games, match: null, demo: null, seat: 0, opening: "", frames: 0, ack: 0, players: [] });
    this.handlers = {
      aim: ({ x, y, q }) => { this.person.aim(x, y); this.ack = q; },
      stick: ({ x, y, q }) => { this.person.stick(x, y); this.ack = q; },
      start: () => this.match.start(),
      pause: () => this.match.pause(),
      stop: () => this.match.abort("ended by a player"),
      lobby: () => { if (this.match.phase === "done") this.match.clear(); },
      swap: () => this.swap(),
      game: ({ name }) => this.open(name),
      opponent: ({ seat, name }) => this.choose(seat, name),
    };
  }

  get person() { return this.match.drivers[this.seat]; }

  handle(kind, fields) { if (this.match && kind in this.handlers) this.handlers[kind](fields); }

  // Open a game: the person at the first seat, and computers of the usual level at the others.
  async open(name) {
    if (this.opening || (this.match && !this.match.between)) return;
    this.opening = name;
    try {
      const game = await this.assets.game(name), usual = game.ladder.find((level) => level.name === game.usual), best = game.ladder.at(-1);
      const policies = await Promise.all([usual, best].map((level) => this.assets.policy(level.driver)));
      const match = new Match(this.assets.module, game, this.clock), demo = new Match(this.assets.module, game, this.clock);
      match.seats.forEach((_, i) => { match.setDriver(i, new Computer(policies[0], usual.handicap, i)); demo.setDriver(i, new Computer(policies[1], best.handicap, i)); });
      this.seat = 0;
      match.setDriver(0, new Person(game.match, 0));
      this.players = match.seats.map((_, i) => (i ? { driver: usual.driver, level: usual.name, handicap: usual.handicap } : this.you()));
      Object.assign(this, { match, demo, game });
    } finally { this.opening = ""; }
    this.describe();
  }

  you() { return { driver: "person", level: "", handicap: {} }; }

  describe() {
    const { game, games } = this, rest = { invite: null, checkpoints: [], scene: false, camera: false, faults: {} };
    receiveMatch({ ...game.match, ...rest, games, ladder: game.ladder.map((level) => level.name), usual: game.usual, policy: game.policy, alone: true });
  }

  async choose(seat, name) {
    const { match } = this, level = this.game.ladder.find((one) => one.name === name);
    if (!level || seat === this.seat || !match.between) return;
    const policy = await this.assets.policy(level.driver);
    if (match !== this.match) return;
    if (!match.between && match.ticks) match.clear();
    match.setDriver(seat, new Computer(policy, level.handicap, seat));
    this.players[seat] = { driver: level.driver, level: level.name, handicap: level.handicap };
    if (match.phase === "done") match.clear();
  }

  // All players move to the next seat.
  swap() {
    const { match, players } = this, count = players.length;
    if (!match.between) return;
    if (match.phase === "done") match.clear();
    const drivers = [...match.drivers], rows = [...players];
    drivers.forEach((driver, i) => {
      const to = (i + 1) % count;
      match.setDriver(to, driver instanceof Person ? new Person(this.game.match, to) : new Computer(driver.policy, driver.handicap, to));
      players[to] = rows[i];
    });
    this.seat = (this.seat + 1) % count;
  }

  // Add a policy from a file as a level of the open game.
  add(title, policy) {
    const { game } = this, { labels, scenario } = policy.card;
    if (labels ? String(labels) !== String(game.facts.observation) : policy.inputs !== game.facts.observation.length) {
      throw new Error(`its observations do not fit ${game.match.title}${scenario ? `; it was trained on ${scenario}` : ""}`);
    }
    if (!this.match.between) throw new Error("end the match first");
    this.assets.keep(title, policy);
    game.ladder = [{ name: title, driver: title, handicap: { reaction: 0, noise: 0, pace: 1 } }, ...game.ladder.filter((level) => level.name !== title)];
    this.describe();
    return Promise.all(this.match.seats.map((_, i) => this.choose(i, title)));
  }

  // The content of the file of the last games.
  file() {
    const rows = this.players.map(({ driver, handicap }) => ({ driver, handicap, person: driver === "person" ? "anonymous" : null }));
    return this.match.log.file(rows);
  }

  tick(rate) {
    this.match.tick();
    if (this.match.phase === "lobby") this.show();
    const seats = this.players.map((player, i) => ({ driver: player.driver, level: player.level, taken: i === this.seat }));
    const own = { seat: this.seat, ack: this.ack, link: { rate: 60, ms: 0 }, queue: 0, idle: null };
    const server = { troubles: [], watching: 0, rate, recording: false, not_recorded: "" };
    const demo = this.match.phase === "lobby" ? { demo: this.shown } : {};
    receive({ t: "state", f: ++this.frames, ...this.match.state(), seats, ...server, opening: this.opening, ...demo, ...own });
  }

  // Advance the demonstration behind the start screen.
  show() {
    const { demo } = this;
    if (demo.between) { demo.start(); demo.timeLeft = 0; }
    demo.tick();
    if (demo.phase === "goal") demo.start();
    const state = demo.state();
    this.shown = { ...Object.fromEntries(DRAWN.map((name) => [name, state[name]])), n: demo.number * ANOTHER + demo.ticks };
  }
}
