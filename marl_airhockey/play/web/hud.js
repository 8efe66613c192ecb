// Score, time and link, above and below the table during play.

import { colourOf } from "./colours.js";
import { steering } from "./input.js";
import { runsMoment } from "./moments.js";
import { triesRun } from "./tries.js";
import { $, element, game, linkRate, mayControl, put, runs } from "./state.js";

const SETTLED = 3000; // ms after the connection until a slow link is reported
let scored = null;

// The score in the colours of its teams: large numbers, and the rest of the caption.
function scoreboard() {
  const text = game.now.caption;
  if (text === scored) return;
  scored = text;
  const [score, ...rest] = text.split(", ");
  const found = score.match(/^(\D*?)\s*(\d+(?: : \d+)+)$/), box = $("score");
  box.textContent = "";
  if (!found) { box.append(element("span", text, "measure")); return; }
  if (found[1] !== "goals") box.append(element("span", found[1], "word"));
  found[2].split(" : ").forEach((value, i) => {
    if (i) box.append(element("span", ":", "colon"));
    const number = element("span", value, "value");
    number.style.color = colourOf(game.match.seats.findIndex((seat) => seat.team === i));
    box.append(number);
  });
  box.title = rest.join(", ");
}
export function forgetScore() { scored = null; }

export function updateHud() {
  const { match, now } = game, name = match.tournament && now.seats[0].title ? now.seats.map((seat) => seat.title).join(" : ") : match.title, left = Math.max(0, match.seconds - now.time);
  put($("game"), now.golden_goal ? "The next goal wins" : name);
  const title = `Air hockey: ${name}`;
  if (document.title !== title) document.title = title;
  scoreboard();
  put($("clock"), `${left.toFixed(0)} s`);
  $("clock").classList.toggle("last", left < 10 && match.seconds > 20 && now.phase === "play");
  // A participant of a study can withdraw in a pause; a real table keeps its controls.
  const playing = (runs() || (now.phase === "pause" && !match.study) || runsMoment() || (now.phase === "done" && triesRun())) && !game.recording && !match.camera;
  document.body.classList.toggle("study", Boolean(match.study));
  document.body.classList.toggle("lobby", now.phase === "lobby" && !game.recording);
  document.body.classList.toggle("playing", playing && now.phase !== "arrange");
  put($("pause").firstElementChild, match.camera ? "Stop" : game.recording ? (game.recording.runs ? "Pause" : "Play") : "Pause");
  $("pause").hidden = !game.recording && (!mayControl() || !["play", "countdown", "goal", "arrange"].includes(now.phase));
  $("leave").hidden = now.seat === null || Boolean(game.recording || match.study || match.alone);
  $("table").classList.toggle("mine", now.seat !== null && now.phase === "play");
  details();
  link();
}

function details() {
  const { now } = game, trip = steering.roundTrip;
  put($("trip"), trip === null ? "" : `round trip ${trip.toFixed(0)} ms`);
  put($("rate"), `loop ${now.rate.toFixed(1)} Hz`);
  put($("drivers"), game.match.scenario + ": " + now.seats.map((seat) => seat.driver).join(", "));
  put($("caption"), now.caption);
  put($("watching"), now.watching ? `${now.watching} watching` : "");
  $("recording").hidden = !now.recording && !now.not_recorded;
  put($("recording"), now.not_recorded ? `not recorded: ${now.not_recorded}` : "● recording");
}

// An overlay, so that the table stays where it is.
function link() {
  const { now } = game, slow = linkRate() < 60 && performance.now() - game.openedAt > SETTLED && !game.recording;
  const late = slow && now.link.ms > 50 ? `, ${(now.link.ms / 1000).toFixed(1)} s delay` : "";
  const next = now.queue === 1 ? "You are next." : now.queue ? `${now.queue - 1} before you.` : "";
  const waits = next && now.phase !== "lobby" ? next : "", idle = Number.isInteger(now.idle) ? `Move to keep your seat: ${now.idle} s` : "";
  const text = [idle || waits, slow ? `slow link: ${linkRate()} frames per second${late}` : ""].filter(Boolean).join(" · ");
  $("link").hidden = !text;
  put($("link"), text);
}
