// One short message over the table, with up to three buttons.

import { $, element, put } from "./state.js";

let shown = "";

// `buttons` are rows [text, function]; the first one is the main one. A bare notice has no panel.
export function show(headline, detail = "", buttons = [], bare = false) {
  $("notice").hidden = false;
  $("notice").classList.toggle("bare", bare);
  put($("headline"), headline); put($("detail"), detail);
  $("headline").classList.toggle("words", Number.isNaN(Number(headline)));
  const key = JSON.stringify(buttons.map(([text]) => text));
  if (key !== shown) {
    shown = key;
    $("choices").replaceChildren(...buttons.map(([text], i) => {
      const button = element("button", text, i ? "" : "main");
      button.onclick = () => current[i][1]();
      return button;
    }));
  }
  current = buttons;
}
let current = [];

export function hide() { $("notice").hidden = true; }

// What Enter and Space do while a notice is shown.
export const mainAction = () => (!$("notice").hidden && current.length ? current[0][1] : null);
