// What a page draws of a world, and what happened in a step.

const rounded = (x) => Math.round(x * 1e4) / 1e4;
const round = (values) => Array.from(values, rounded);
// Rows of some numbers each.
const rows = (values, size) => Array.from({ length: values.length / size }, (_, k) => round(values.subarray(k * size, (k + 1) * size)));
const indices = (flags) => [...flags].flatMap((is, i) => (is ? [i] : []));

// The text of a caption: its formats, such as {:.1f}, replaced by numbers.
function text(format, numbers) {
  let k = 0;
  return format.replace(/\{:\.(\d)f\}/g, (_, digits) => { const x = numbers[k++]; return Number.isFinite(x) ? x.toFixed(Number(digits)) : "-"; });
}

// What a page draws of a world, as `messages.drawn`.
export function drawn(world) {
  const { facts } = world, { pucks, blocks } = facts.bodies, at = (name) => world.current(`state.${name}`);
  const [position, velocity, angle] = ["position", "velocity", "angle"].map(at), of = ([first, last], values, size) => rows(values.subarray(size * first, size * last), size);
  world.show();
  const marks = world.shown("marks"), deciders = world.shown("deciders"), eliminated = world.shown("eliminated"), speeds = of(pucks, velocity, 2);
  return {
    time: Math.round(at("time")[0] * 1e3) / 1e3,
    paddles: of([0, world.array("inputs.action").length / 2], position, 2),
    pucks: of(pucks, position, 2).map((row, k) => [...row, ...speeds[k]]),
    puck_angles: round(angle.subarray(...pucks)),
    blocks: of(blocks, position, 2),
    angles: round(angle.subarray(...blocks)),
    marks: marks ? facts.marks.map(([kind, means], k) => [kind, ...round(marks.subarray(6 * k, 6 * k + 5)), means]).filter((_, k) => marks[6 * k + 5]) : [],
    caption: text(facts.caption, world.shown("caption") || []),
    decided_by: deciders ? facts.deciders.find((_, k) => deciders[k]) || "" : "",
    returns: round(world.current("episode.returns")),
    success: indices(world.current("episode.success")),
    eliminated: eliminated ? indices(eliminated) : [],
  };
}

// Rows ["goal", goal line, puck] and ["hit", paddle, puck] of the last step.
export function eventsOf(world) {
  const [first, last] = world.facts.bodies.pucks, count = last - first, crossed = world.current("state.crossed");
  const lines = count ? crossed.length / count : 0;
  const goals = indices(crossed).map((i) => ["goal", i % lines, Math.floor(i / lines)]);
  return [...goals, ...indices(Array.from(world.current("state.touched"), Number)).map((i) => ["hit", Math.floor(i / count), i % count])];
}
