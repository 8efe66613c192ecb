// The players of a match, and who may be chosen for each seat.

import { colourOf } from "./colours.js";
import { element, game, isPerson, mayControl, send } from "./state.js";
import { levelTitle, titleOf } from "./titles.js";

export function seatRows() {
  const { match, now } = game, chooses = now.seat !== null && (mayControl() || now.seats.some((s) => isPerson(s) && !s.taken));
  return now.seats.map((seat, i) => {
    const row = element("div", "", "seat" + (i === now.seat ? " me" : "")), dot = element("span", "", "dot");
    dot.style.background = colourOf(i);
    row.append(dot);
    const taken = i === now.seat || (isPerson(seat) && seat.taken);
    if (!taken && chooses) row.append(chooser(seat, i, match));
    else if (!taken && isPerson(seat)) row.append(sitButton(i));
    else row.append(titleOf(i));
    return row;
  });
}

function chooser(seat, i, match) {
  const list = element("select"), now = seat.level || seat.driver;
  list.setAttribute("aria-label", `player ${i + 1}`);
  for (const name of new Set([...(match.alone ? [] : ["person"]), now, ...match.ladder])) {
    list.append(new Option(name === "person" ? "Another person" : levelTitle(name), name, false, name === now));
  }
  list.onchange = () => { send("opponent", { seat: i, name: list.value }); list.blur(); };
  return list;
}

function sitButton(i) {
  const button = element("button", "Sit here");
  button.onclick = () => send("sit", { seat: i });
  return button;
}
