// A recording instead of a match: its frames, its timeline.

import { $, game, receive, receiveMatch } from "./state.js";

let playback = null; // { steps, at, runs, end, shown, rate }

export async function open() { show(await (await fetch("recording" + location.search)).json()); }

export function show({ meta, steps, end }) {
  const rate = 1 / meta.control_dt;
  const seats = meta.players.map((player) => ({ driver: player.driver, level: "", taken: player.person !== null }));
  const notes = { seats, seat: null, ack: 0, watching: 0, rate, recording: false, queue: 0 };
  playback = { at: 0, runs: true, end, shown: -1, rate, steps: steps.map((step) => ({ ...step, ...notes })) };
  game.recording = playback;
  receiveMatch({ ladder: [], games: [], ...meta.match });
  $("scrub").max = steps.length - 1;
  $("timeline").hidden = false;
  $("scrub").oninput = () => { playback.at = Number($("scrub").value); };
  $("scrub").onchange = () => $("scrub").blur();
  $("speed").onchange = () => $("speed").blur();
}

export function close() {
  playback = game.recording = null;
  $("timeline").hidden = true;
}

export function togglePlayback() {
  if (!playback.runs && playback.at >= playback.steps.length - 1) playback.at = 0;
  playback.runs = !playback.runs;
}

export function advance(dt) {
  const last = playback.steps.length - 1;
  if (playback.runs) playback.at = Math.min(last, playback.at + dt * Number($("speed").value) * playback.rate);
  const index = Math.floor(playback.at);
  if (index === last) playback.runs = false;
  if (index === playback.shown) return;
  // Steps in between count for trails and sounds, unless it was a jump.
  const from = index > playback.shown && index - playback.shown < 12 ? playback.shown + 1 : index;
  for (let i = from; i <= index; i++) {
    receive({ ...playback.steps[i], phase: i === last && playback.end.reason ? "done" : "play" });
  }
  playback.shown = index;
  $("scrub").value = index;
}
