// The start screen: a ladder of opponents, tasks, and games for several people.

import { invitation } from "./invite.js";
import { bestToday, recordOf } from "./record.js";
import { seatRows } from "./seats.js";
import { $, element, freeSeat, game, isPerson, isTask, mayControl, send, teams } from "./state.js";
import { levelTitle, opponentOf } from "./titles.js";
import { touch } from "./device.js";

const TABS = { ladder: "Ladder", tasks: "Tasks", together: "Together" };
const LOCAL = "Another person can open this page in a second window. For other devices, start it with --host 0.0.0.0.";
const PATIENCE = 2000; // ms for which a chosen tab waits for its game
let wantedAt = 0, shown = "", wanted = null; // tab that was chosen, until the game of it is open

const kindOf = () => (isTask() ? "tasks" : teams().size > 1 && game.match.seats.length === 2 && !forTwo() ? "ladder" : "together");
const forTwo = () => game.now.seats.filter(isPerson).length > 1;
const tabNow = () => wanted || kindOf();

const button = (text, act, cls = "") => { const node = element("button", text, cls); node.onclick = act; return node; };
const open = (name) => send("game", { name });

export function hideStart() { $("start").hidden = true; shown = ""; wanted = null; }

export function showStart() {
  const { match, now } = game, tab = tabNow();
  $("start").hidden = false;
  if (document.activeElement && document.activeElement.tagName === "SELECT" && $("start").contains(document.activeElement)) return; // being chosen
  const state = JSON.stringify([match.scenario, now.seats, now.seat, now.queue, now.opening, tab, touch.used]);
  if (state === shown) return;
  shown = state;
  const parts = [element("h1", "Air hockey"), ...tabs(tab)];
  if (!isReady(tab)) {
    parts.push(element("p", "Preparing…", "aim"));
    if (!now.opening && performance.now() - wantedAt > PATIENCE) wanted = null; // another page has chosen
    shown = "";
  } else if (now.opening) parts.push(element("p", `Preparing ${match.games.find((g) => g.name === now.opening).title}…`, "aim"));
  else parts.push(...{ ladder, tasks, together }[tab](), ...entry());
  $("start").replaceChildren(...parts);
}

function tabs(tab) {
  const { match } = game;
  if (!match.games.length || !mayChoose()) return [];
  const row = element("nav", "", "tabs");
  for (const [name, text] of Object.entries(TABS)) {
    const node = button(text, () => choose(name), "tab");
    node.setAttribute("aria-pressed", name === tab);
    row.append(node);
  }
  return [row];
}

const mayChoose = () => game.now.seat !== null || mayControl();

// True if the open game is one of a tab.
const isReady = (tab) => (tab === "tasks" ? isTask() : !isTask() && (tab === "together" || kindOf() === "ladder"));

function choose(tab) {
  wanted = tab; wantedAt = performance.now();
  const { match, now } = game;
  if (tab === "ladder" && match.scenario !== "duel") open("duel");
  else if (tab === "ladder" && forTwo()) alone();
  else if (tab === "tasks" && kindOf() !== "tasks") open(match.games.find((g) => g.seats === 1).name);
  else if (tab === "together" && match.scenario === "duel" && !forTwo() && now.seat !== null) send("opponent", { seat: opponentOf(now.seat), name: "person" });
  else if (tab === "together" && isTask()) open("duel");
  shown = "";
}

function alone() {
  const { match, now } = game;
  now.seats.forEach((seat, i) => { if (i !== now.seat && isPerson(seat) && !seat.taken) send("opponent", { seat: i, name: match.usual }); });
}

function ladder() {
  const { match, now } = game, seat = opponentOf(now.seat ?? 0), list = element("div", "", "ladder");
  const beaten = match.ladder.filter((name) => recordOf(match.scenario, name).won).length;
  const top = match.ladder.at(-1), done = recordOf(match.scenario, top).won;
  match.ladder.forEach((name, i) => {
    const { won, drawn, lost } = recordOf(match.scenario, name), row = button("", () => send("opponent", { seat, name }), "rung");
    row.setAttribute("aria-pressed", now.seats[seat].level === name);
    row.disabled = !mayChoose();
    const counts = drawn ? `${won} – ${drawn} – ${lost}` : `${won} – ${lost}`;
    row.style.setProperty("--height", i / Math.max(match.ladder.length - 1, 1));
    row.append(element("span", name === top ? "♛" : won ? "★" : "", "star"), element("span", levelTitle(name)), element("span", won + drawn + lost ? counts : "", "count"));
    list.prepend(row);
  });
  const named = now.seats[seat].level || isPerson(now.seats[seat]) ? [] : [element("p", `Opponent: ${levelTitle(now.seats[seat].driver)}`, "aim")];
  const best = top === "champion" ? "the champion" : top;
  const aim = done ? `You have beaten ${best}.` : beaten ? `${beaten} of ${match.ladder.length} beaten. Beat ${best}!` : `Beat ${best}!`;
  return [element("p", aim, "aim"), ...named, list];
}

function tasks() {
  const { match } = game, parts = [];
  if (match.games.length) {
    const list = element("div", "", "tiles");
    for (const { name, title } of match.games.filter((g) => g.seats === 1)) {
      const tile = button("", () => open(name), "tile"), best = bestToday(name);
      tile.setAttribute("aria-pressed", name === match.scenario);
      tile.append(element("span", title), element("span", best === null ? "" : `${best} of 10`, "count"));
      list.append(tile);
    }
    parts.push(list);
  }
  const { policy } = match, best = bestToday(match.scenario);
  const facts = [`Ten tries.`, best === null ? "" : `Your best today: ${best}.`, policy && policy.success !== null ? `The trained computer: ${(10 * policy.success).toFixed(1)}.` : ""];
  return [...parts, element("p", match.what, "aim"), element("p", facts.filter(Boolean).join(" "), "facts")];
}

function together() {
  const { match } = game, parts = [];
  if (match.games.length) {
    const list = element("div", "", "tiles");
    for (const { name, title } of match.games.filter((g) => g.seats > 1)) {
      const tile = button(title, () => { wanted = "together"; open(name); }, "tile");
      tile.setAttribute("aria-pressed", name === match.scenario);
      list.append(tile);
    }
    parts.push(list);
  }
  const rows = element("div", "", "seats");
  rows.append(...seatRows());
  if (game.now.seat !== null && game.now.seats.length > 1) rows.append(button("Swap sides", () => send("swap")));
  return [...parts, element("p", match.what, "aim"), rows, ...invitation(match), ...(match.invite || match.alone ? [] : [element("p", LOCAL, "facts")])];
}

// The big button, or what this page waits for.
function entry() {
  const { now } = game, sits = now.seat !== null;
  if (mayControl()) {
    const go = button(sits ? "Play" : "Watch them play", () => send("start"), "main");
    go.id = "go";
    return [go, element("p", sits ? howTo() : "", "facts")];
  }
  if (sits) return [element("p", "Waiting for another player, who has to open this page.", "aim")];
  if (now.queue === 1) return [element("p", "You are next.", "aim")];
  if (now.queue) return [element("p", `${now.queue - 1} before you.`, "aim")];
  const go = button(freeSeat() >= 0 ? "Play" : "Wait for a seat", () => send("join"), "main");
  go.id = "go";
  return [element("p", "You are watching.", "aim"), go];
}

export const howTo = () => {
  if (game.match.camera) return "Hold the button down on the table to move the arm. Nothing moves before Start.";
  return touch.used ? "Drag a finger on the table: your paddle is above it." : "Move the pointer to move your paddle. Space starts.";
};
