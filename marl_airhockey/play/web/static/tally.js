// What each player did in a match, as in `Tally`.

export class Tally {
  constructor(seats) {
    this.hits = Array(seats).fill(0); this.fastest = Array(seats).fill(0); this.touching = Array(seats).fill(false);
    this.goals = null; this.streak = []; this.longest = [];
  }

  // Add a step.
  note(world) {
    const { pucks: [first, last] } = world.facts.bodies, count = last - first, touched = world.current("state.touched"), velocity = world.current("state.velocity");
    this.hits.forEach((_, i) => {
      let hit = false;
      for (let k = 0; k < count; k++) {
        if (!touched[i * count + k]) continue;
        hit = true;
        this.fastest[i] = Math.max(this.fastest[i], Math.hypot(velocity[2 * (first + k)], velocity[2 * (first + k) + 1]));
      }
      if (hit && !this.touching[i]) this.hits[i]++;
      this.touching[i] = hit;
    });
    world.show();
    const goals = world.shown("scores.goals");
    if (!goals) return;
    const gained = Array.from(goals, (n, i) => n - (this.goals ? this.goals[i] : 0));
    if (!this.streak.length) this.streak = gained.map(() => 0);
    if (gained.some(Boolean)) this.streak = this.streak.map((n, i) => (gained[i] ? n + gained[i] : 0));
    this.longest = this.streak.map((n, i) => Math.max(n, this.longest[i] || 0));
    this.goals = [...goals]; this.shots = [...(world.shown("scores.shots") || goals)];
  }

  state() {
    const { hits, goals } = this, fastest = this.fastest.map((v) => Math.round(v * 100) / 100);
    return { hits, fastest, scores: goals, stopped: goals && this.shots, streak: goals && this.longest };
  }
}
