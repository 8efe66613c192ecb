// Which screen covers the table: start, card, notice or none.

import { atRest, robotFault } from "./arm.js";
import { hideCard, showCard } from "./card.js";
import { lostFor } from "./connection.js";
import { runsMoment } from "./moments.js";
import { hide, show } from "./notice.js";
import { brokenOff, verdict, why } from "./result.js";
import { hideStart, howTo, showStart } from "./start.js";
import { capital, freeSeat, game, mayControl, send } from "./state.js";
import { lastTry, seriesOver, showTries, summary, triesRun } from "./tries.js";
import { updateStudy } from "./study.js";
import { hideTournament, showTournament } from "./tournament.js";

const LONG = 10; // s without a connection after which the page explains what to do

const start = (text) => [[text, () => send("start")]];
const sentence = (text) => (text ? `${capital(text)}${/[.?!]$/.test(text) ? "" : "."}` : "");

export function lostNotice() {
  const detail = lostFor() < LONG ? "Trying again…" : "The server does not answer. When it runs again, this page continues by itself.";
  show(game.refused ? "Please wait" : "No connection", game.refused || detail);
}

export function updateScreens() {
  const { match, now } = game, phase = now.phase;
  showTries();
  const screen = game.outdated || game.down || match.study || game.recording || match.camera ? "notice" : phase === "lobby" ? "start" : phase === "done" && !runsMoment() && !(triesRun() && !brokenOff()) ? "card" : "notice";
  if (screen !== "start") hideStart();
  if (screen !== "card") hideCard();
  if (screen !== "notice") hide();
  if (screen !== "start" || !match.tournament) hideTournament();
  if (screen === "start") match.tournament ? showTournament() : showStart();
  else if (screen === "card") seriesOver() ? showSeries() : showCard();
  else if (game.outdated) show("A new version", "The server was updated while this page was open.", [["Load the page again", () => location.reload()]]);
  else if (match.study) updateStudy();
  else if (game.down) lostNotice();
  else if (game.recording) replayNotice();
  else playNotice(mayControl());
}

function showSeries() {
  hideCard();
  const { headline, lines } = summary(), again = mayControl() ? [["Ten more tries", () => send("start")], ["Menu", () => send("lobby")]] : [];
  show(headline, lines.join(". ") + ".", again);
}

function replayNotice() {
  if (game.now.phase === "done") show(verdict(), why());
  else hide();
}

export function playNotice(may) {
  const { match, now } = game, sits = now.seat !== null, free = freeSeat() >= 0;
  const alone = sits && free && !match.camera && !match.study; // others have left
  const end = [match.camera ? "Stop" : "End match", () => send("stop")], pause = may || alone;
  if (now.phase === "arrange") show("Getting ready", sentence(now.reason));
  else if (now.phase === "countdown") show(String(Math.ceil(now.time_left)), now.golden_goal ? "The next goal wins" : "", [], true);
  else if (match.camera && robotFault() && ["lobby", "done"].includes(now.phase)) show("A device has a fault", `${sentence(robotFault())} ${Object.keys(match.faults).length ? "Switch its fault off" : "Clear it at the device"}, then start again.`, may ? start("Start") : []);
  else if (now.phase === "lobby") show(sits ? "Ready?" : "Watching", sits ? `${match.what} ${howTo()}` : free ? "A seat is free: reload the page to take it." : "Waiting for the players.", may ? start("Start") : []);
  else if (now.phase === "pause" && alone) show("Paused", `${sentence(now.reason)} You can wait, continue against the computer, or end the match.`, [["Continue against the computer", () => send("substitute")], end]);
  else if (now.phase === "pause" && free && !match.study) show("Paused", `${sentence(now.reason)} ${now.queue === 1 ? "You are next." : "The next player starts a new match."}`);
  else if (now.phase === "pause") show(match.camera ? "Please confirm" : "Paused", sentence(now.reason), pause ? [...start("Continue"), ...(match.study ? [] : [end])] : []);
  else if (now.phase === "done" && triesRun() && !brokenOff()) show(...lastTry(), [], true);
  else if (now.phase === "done" && !runsMoment()) show(verdict(), why(), may ? start("Again") : []);
  else if (now.phase === "play" && atRest()) show("", atRest(), [], true);
  else hide();
}
