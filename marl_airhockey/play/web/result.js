// How a match has ended, in words.

import { game, teams } from "./state.js";
import { titleOf } from "./titles.js";

export function brokenOff() {
  const { now, recording } = game;
  if (now.reason) return now.reason;
  return recording && recording.end.reason !== "played to the end" ? recording.end.reason : "";
}

// "won", "drawn" or "lost" for the seat of this page; "" if it has none, or the match was ended early.
export function ownResult() {
  const { now, match } = game;
  if (brokenOff() || now.seat === null) return "";
  if (now.success.some((i) => match.seats[i].team === match.seats[now.seat].team)) return "won";
  return teams().size > 1 && !now.success.length ? "drawn" : "lost";
}

export function verdict() {
  const { now, match } = game;
  if (brokenOff()) return "Ended early";
  const won = new Set(now.success.map((i) => match.seats[i].team));
  if (teams().size === 1) return won.size ? "Done!" : "Not this time";
  if (won.size !== 1) return "A draw";
  if (now.seat !== null) return won.has(match.seats[now.seat].team) ? "You win!" : "You lose";
  return `${titleOf(now.success[0])} wins`;
}

// How a result has come about, where the goals alone do not show it.
export function why() {
  const { now } = game;
  if (brokenOff()) return brokenOff();
  if (teams().size === 1) return now.caption;
  if (now.decided_by === "shots on goal") return `Same number of goals. The team with more shots on goal wins: ${now.caption}.`;
  return now.success.length ? "" : `Same score: ${now.caption}.`;
}
