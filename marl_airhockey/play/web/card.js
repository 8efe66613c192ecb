// The card with the result of a match.

import { colourOf } from "./colours.js";
import { videoKind, videoOf, save } from "./goal_video.js";
import { best } from "./moments.js";
import { noteGame } from "./record.js";
import { ownResult, verdict, why } from "./result.js";
import { $, capital, element, game, isPerson, mayControl, on, send, teams } from "./state.js";
import { levelTitle, opponentOf } from "./titles.js";

let noted = false, making = "";

on("frame", (frame, before) => {
  if (frame.phase !== "done") { noted = false; return; }
  const { match } = game, result = ownResult();
  if (noted || !result || !match.ladder.length || teams().size < 2 || frame.mixed || !before || before.phase === "done") return;
  noted = true;
  const opponent = frame.seats[opponentOf(frame.seat)];
  if (match.seats.length === 2 && opponent.level) noteGame(match.scenario, opponent.level, result);
});

const button = (text, act, cls = "") => { const node = element("button", text, cls); node.onclick = act; return node; };
let shown = "";
export function hideCard() { $("card").hidden = true; shown = ""; }

export function showCard() {
  $("card").hidden = false;
  const state = JSON.stringify([game.now.caption, game.now.seats, game.now.seat, mayControl(), making, Boolean(best), game.now.reason]);
  if (state === shown) return;
  shown = state;
  const headline = element("h1", verdict());
  if (game.now.success.length && ownResult() !== "lost") headline.style.color = colourOf(game.now.success[0]);
  $("card").replaceChildren(headline, element("p", capital(why()), "facts"), ...(game.now.reason ? [] : [score(), figures()]), buttons());
}

function score() {
  const { scores } = game.now.tally, row = element("p", "", "score");
  if (!scores || teams().size < 2) return row;
  scores.forEach((value, i) => {
    if (i) row.append(" : ");
    const number = element("span", String(value));
    number.style.color = colourOf(game.match.seats.findIndex((seat) => seat.team === i));
    row.append(number);
  });
  return row;
}

// What one's own seat did, or the first one for a page that watches.
function figures() {
  const { tally, seat } = game.now, i = seat ?? 0, team = game.match.seats[i].team, list = element("dl", "", "figures");
  const add = (name, value) => { if (value !== undefined && value !== null) list.append(element("dt", name), element("dd", value)); };
  add("fastest shot", tally.fastest[i] ? `${tally.fastest[i].toFixed(1)} m/s` : null);
  add("hits", String(tally.hits[i]));
  if (tally.scores && teams().size === 2) {
    add("shots on goal", String(tally.scores[team] + tally.stopped[team]));
    add("saves", String(tally.stopped[1 - team]));
    add("longest streak", String(tally.streak[team]));
  }
  return list;
}

function buttons() {
  const { now, match } = game, row = element("div", "", "row"), next = nextLevel();
  if (match.tournament) {
    if (now.seat !== null && !now.reason && now.success.length) row.append(button("Next match", () => send("start"), "main"));
    else if (!now.success.length) row.append(element("p", "The next goal wins.", "aim"));
  } else if (mayControl()) {
    if (next) row.append(button(`Next: ${levelTitle(next)}`, () => { send("opponent", { seat: opponentOf(now.seat), name: next }); send("start"); }, "main"));
    row.append(button(next ? "Again" : "Play again", () => send("start"), next ? "" : "main"));
    if (now.offers_golden_goal) row.append(button("Golden goal: the next goal wins", () => send("golden_goal")));
    row.append(button("Menu", () => send("lobby")));
  }
  if (best && now.seat !== null && videoKind()) row.append(button(making || "Save the best goal as a video", makeVideo));
  return row;
}

function nextLevel() {
  const { now, match } = game;
  if (ownResult() !== "won" || match.seats.length !== 2) return null;
  const opponent = now.seats[opponentOf(now.seat)];
  return isPerson(opponent) || !opponent.level ? null : match.ladder[match.ladder.indexOf(opponent.level) + 1] ?? null;
}

async function makeVideo() {
  if (making) return;
  making = "Making the video, 7 s…";
  try { await save(await videoOf(best)); making = "Saved"; setTimeout(() => { making = ""; }, 3000); } catch (error) { making = `No video: ${error.message}`; }
}
