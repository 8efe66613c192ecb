// Colours of the table and of seats, which palette.css defines.

import { game } from "./state.js";

const NAMES = ["room", "field", "rail", "print", "faint", "ink", "soft", "puck", "block", "estimate", "goal", "reward", "cost", "drag"];
export const inks = {};
const SEATS = [];
function read() {
  const style = getComputedStyle(document.documentElement), value = (name) => style.getPropertyValue("--" + name).trim();
  for (const name of NAMES) inks[name] = value(name);
  for (let i = 0; value(`seat-${i}`); i++) SEATS[i] = value(`seat-${i}`);
}
read();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", read);

// Seats of a team have one colour, unless everybody plays alone.
export function colourOf(seat) {
  if (seat < 0 || !game.match) return SEATS[0];
  const teams = game.match.seats.map((s) => s.team), kinds = new Set(teams).size;
  return SEATS[(kinds === 1 || kinds === teams.length ? seat : teams[seat]) % SEATS.length];
}
export const alpha = (hex, share) => hex + Math.round(Math.max(0, Math.min(1, share)) * 255).toString(16).padStart(2, "0");

const channels = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
export function mixed(from, to, share) {
  const [a, b] = [channels(from), channels(to)];
  return `rgb(${a.map((v, i) => Math.round(v + share * (b[i] - v))).join(",")})`;
}
