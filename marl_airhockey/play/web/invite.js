// A code and a link by which other people open this page.

import { element } from "./state.js";

const SVG = "http://www.w3.org/2000/svg";
const QUIET = 2; // modules around the code

function image(rows) {
  const size = rows.length + 2 * QUIET, svg = document.createElementNS(SVG, "svg"), dark = document.createElementNS(SVG, "path");
  svg.setAttribute("viewBox", `0 0 ${size} ${size}`); svg.setAttribute("class", "code");
  svg.setAttribute("role", "img"); svg.setAttribute("aria-label", "Code with the address of this page");
  const cells = rows.flatMap((row, y) => [...row].map((cell, x) => (cell === "1" ? `M${x + QUIET} ${y + QUIET}h1v1h-1z` : "")));
  dark.setAttribute("d", cells.join(""));
  svg.append(dark);
  return svg;
}

export function invitation(match) {
  if (!match.invite) return [];
  const box = element("div", "", "invite");
  box.append(image(match.invite.code), element("p", match.invite.link, "link"));
  return [box];
}
