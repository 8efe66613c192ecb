// A tournament: one's name, the bracket, and the table.

import { invitation } from "./invite.js";
import { $, element, game, send } from "./state.js";

const button = (text, act, cls = "") => { const node = element("button", text, cls); node.onclick = act; return node; };
let shown = "", typed = "";

export function hideTournament() { shown = ""; }

export function showTournament() {
  const { now, match } = game, { tournament } = now, state = JSON.stringify([tournament, now.name, now.seat, now.seats]);
  $("start").hidden = false;
  const types = document.activeElement && document.activeElement.tagName === "INPUT" && !tournament.rounds.length;
  if (state === shown || types) return;
  shown = state;
  const begun = tournament.rounds.length > 0;
  const parts = [element("h1", tournament.champion ? `${tournament.champion} wins!` : "Tournament")];
  if (begun) parts.push(...bracket(tournament), ...standings(tournament), ...entry(tournament));
  else parts.push(...entering(tournament), ...invitation(match));
  $("start").replaceChildren(...parts);
}

function entering({ players }) {
  const { now } = game, form = element("form"), field = Object.assign(element("input"), { type: "text", maxLength: 20, placeholder: "Your name", value: typed || now.name });
  field.setAttribute("aria-label", "your name");
  field.oninput = () => { typed = field.value; };
  form.append(field, Object.assign(element("button", now.name ? "Change name" : "Enter", now.name ? "" : "main"), { type: "submit" }));
  form.onsubmit = (event) => { event.preventDefault(); field.blur(); if (field.value.trim()) send("name", { text: field.value }); };
  const parts = [form, element("p", players.length ? players.join(", ") : "Nobody has entered yet.", "aim")];
  if (now.name && players.length > 1) parts.push(button(`Begin with ${players.length} players`, () => send("begin"), "main"));
  else parts.push(element("p", "Everybody opens this page and enters a name.", "facts"));
  return parts;
}

function bracket({ rounds }) {
  const box = element("div", "", "bracket");
  for (const pairs of rounds) {
    const column = element("div");
    for (const { players, goals, winner } of pairs) {
      const pair = element("div", "", "pair");
      players.forEach((name, i) => {
        const row = element("div", "", [winner === name ? "winner" : "", game.now.name === name ? "mine" : ""].join(" "));
        row.append(element("span", name), element("span", goals.length ? String(goals[i]) : players.length === 1 ? "bye" : ""));
        pair.append(row);
      });
      column.append(pair);
    }
    box.append(column);
  }
  return [box];
}

function standings({ table }) {
  const rows = table.filter((row) => row.played), list = element("table", "", "standings");
  if (!rows.length) return [];
  for (const values of [["", "played", "won", "goals"], ...rows.map((row) => [row.name, row.played, row.won, row.goals])]) {
    const line = element("tr");
    line.append(...values.map((value) => element("td", String(value))));
    list.append(line);
  }
  return [list];
}

function entry({ current, champion }) {
  const { now } = game;
  if (champion || !current) return [];
  const other = current.players.find((name) => name !== now.name), plays = now.seat !== null;
  const names = element("p", plays ? `You play against ${other}.` : current.players.join(" against "), "aim"), missing = now.seats.filter((seat) => !seat.taken);
  if (!plays) return [names];
  if (missing.length) return [names, element("p", `Waiting for ${missing[0].title}.`, "facts")];
  const go = button("Play", () => send("start"), "main");
  go.id = "go";
  return [names, go];
}
