// Names that players read; the details have those of the command line.

import { capital, game, isPerson, words } from "./state.js";

export function driverTitle(name) {
  if (name.startsWith("zoo/")) {
    const kind = words(name.slice(4).replace(game.match.scenario, "")).trim();
    return `Computer, trained${kind ? ` (${kind})` : ""}`;
  }
  const [driver, strength] = name.split(":strength=");
  return driver.startsWith("shadow:") ? "A hand" : `Computer, ${words(driver)}${strength ? `, ${strength}` : ""}`;
}

export const levelTitle = (name) => (game.match.ladder.includes(name) ? capital(name) : driverTitle(name));

export function titleOf(i) {
  const { now } = game, seat = now.seats[i];
  if (i === now.seat) return "You";
  if (seat.title !== undefined) return seat.title;
  if (isPerson(seat)) return seat.taken ? "A person" : "Nobody yet";
  return seat.level ? levelTitle(seat.level) : driverTitle(seat.driver);
}

export const opponentOf = (seat) => game.now.seats.findIndex((_, i) => i !== seat && game.match.seats[i].team !== game.match.seats[seat].team);
