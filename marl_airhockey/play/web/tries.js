// Ten tries of a task, one after the other.

import { bestToday, noteTries } from "./record.js";
import { brokenOff, ownResult } from "./result.js";
import { $, capital, element, game, isTask, on, put, send } from "./state.js";

const TRIES = 10;
const REST = 1100; // ms between two tries

let results = [], timer = null;
export const triesRun = () => results.length > 0 && results.length < TRIES;
function stop() { clearTimeout(timer); timer = null; }

on("match", () => { results = []; stop(); });
on("frame", (frame, before) => {
  if (!isTask() || frame.seat === null || game.recording || game.match.study || game.match.camera) return;
  if (frame.phase === "lobby") { results = []; stop(); }
  if (frame.phase !== "done" || !before || before.phase === "done") return;
  if (brokenOff()) { stop(); return; }
  if (results.length === TRIES) results = [];
  results.push(ownResult() === "won");
  if (results.length === TRIES) noteTries(game.match.scenario, results.filter(Boolean).length);
  else timer = setTimeout(() => send("start"), REST);
});

export const seriesOver = () => results.length === TRIES;

// The dots of the series, over the table.
export function showTries() {
  const active = isTask() && game.now.seat !== null && results.length > 0 && !game.recording && !game.match.study;
  $("tries").hidden = !active;
  if (!active) return;
  const text = Array.from({ length: TRIES }, (_, i) => (i < results.length ? (results[i] ? "●" : "○") : "·")).join(" ");
  put($("tries"), text);
}

// What the last try lacked, in the measure of the task.
export const lastTry = () => [results.at(-1) ? "Done!" : "Not this time", capital(game.now.caption)];

export function summary() {
  const count = results.filter(Boolean).length, { policy, scenario } = game.match, best = bestToday(scenario);
  const lines = [`Best today: ${best}`];
  if (policy && policy.success !== null) lines.push(`The trained computer: ${(10 * policy.success).toFixed(1)}`);
  return { headline: `${count} of ${TRIES}`, lines };
}
