"use strict";
// Steps of a calibration: each shows what it found, and the orders that belong to it.

const $ = (id) => document.getElementById(id);
const picture = $("picture");
let clicking = ""; // order that the next click in the picture gives
let state = null, busy = false;
let wide = 0; // width of the pictures, px: an image that loads the next one has none

const px = (v) => `${v.toFixed(2)} px`;
const STEPS = [
  { title: "Lens", done: (s) => s.lens !== null, orders: { show_board: "Hold up the board", board: "Take picture", lens: "Find the lens", board_away: "Put the board away" },
    words: (s) => s.lens !== null ? `Corners of the board fit to ${px(s.lens)}.` : `Show the ChArUco board, tilted, in all parts of the picture: ${s.boards} of ${s.boards_needed} pictures.` },
  { title: "Table", done: (s) => s.table !== null, orders: { corner: "Click corners", clear: "Clear them", table: "Find the table" },
    words: (s) => s.table !== null ? `Found to ${px(s.table)}; tags ${s.tags.join(", ") || "none"} are its check from now on.` : s.corners_needed ? `Click ${s.kind === "hand" ? "the corners of the field" : "where the rails meet"}, counter-clockwise as seen from above, beginning at the near ${s.kind === "hand" ? "right corner, as you see it" : "left corner as seen from the arm"}: ${s.corners} of ${s.corners_needed}. Their edges make them exact.` : "All tags must be visible." },
  { title: "Puck", done: (s) => s.puck !== null, clicks: "puck", orders: { puck: "Click the puck" },
    words: (s) => s.puck !== null ? `Hue ${s.puck} of 180; a cross marks where it is found.` : "Put it on the table and click it." },
  { title: "Block", done: (s) => s.block !== null, clicks: "block", orders: { block: "Click the block" },
    words: (s) => s.block !== null ? `Hue ${s.block} of 180; a cross marks where it is found.` : "Only for tasks with a block: put it on the table and click it." },
  { title: "Paddle", done: (s) => s.paddle !== null, orders: { paddle: "Click the paddle" },
    words: (s) => s.paddle !== null ? `Hue ${s.paddle} of 180.` : "Click the paddle where it is not hidden by the arm." },
  { title: "Arm", done: (s) => s.robot !== null, orders: { guide: "Guide the arm on", touch: "Take place", robot: "Find the arm" },
    words: (s) => s.robot !== null ? `Places fit to ${s.robot.toFixed(2)} mm; the table is tilted by ${s.tilt.toFixed(2)}°.` : `Guide the arm by hand (freedrive) so that the paddle stands flat on the table, let go, take the place: ${s.touches} of ${s.touches_needed}.` },
  { title: "File", done: (s) => s.saved !== "", orders: { save: "Save" },
    words: (s) => s.saved ? `Written: ${s.saved}` : "All of the above goes into one file." },
];
const CLICKS = ["corner", "puck", "block", "paddle"];

async function order(name, place = {}) {
  if (busy) return;
  busy = true; document.body.classList.toggle("busy", true);
  try {
    const answer = await fetch("do" + location.search, { method: "POST", body: JSON.stringify({ do: name, ...place }) });
    const told = await answer.json();
    $("error").hidden = !told.error; $("error").textContent = told.error || "";
    if (!told.error) state = { ...state, ...told };
    if (name !== "corner" || state.corners >= state.corners_needed) clicking = "";
  } finally { busy = false; }
  show();
}

function show() {
  if (!state) return;
  $("camera").textContent = state.camera;
  picture.classList.toggle("aim", clicking !== "");
  // A hand has no puck and no arm.
  const steps = STEPS.filter((step) => Object.keys(step.orders).some((name) => state.orders.includes(name)));
  $("steps").replaceChildren(...steps.map((step) => {
    const row = document.createElement("li"), title = document.createElement("div"), words = document.createElement("p");
    row.className = step.done(state) ? "done" : ""; title.className = "title"; title.textContent = step.title;
    words.className = "words"; words.textContent = step.words(state);
    row.append(title, words);
    for (const [name, text] of Object.entries(step.orders)) {
      if (!state.orders.includes(name)) continue;
      const button = document.createElement("button");
      button.textContent = text; button.id = `do-${name}`;
      button.setAttribute("aria-pressed", clicking === name);
      button.onclick = () => { if (CLICKS.includes(name)) { clicking = clicking === name ? "" : name; show(); } else order(name); };
      row.append(button);
    }
    return row;
  }));
}

picture.onclick = (event) => {
  if (!clicking || !wide) return;
  const box = picture.getBoundingClientRect(), scale = wide / box.width;
  order(clicking, { x: (event.clientX - box.left) * scale, y: (event.clientY - box.top) * scale });
};

function look() { picture.src = `picture?n=${Math.round(performance.now())}&${location.search.slice(1)}`; }
picture.onload = () => { wide = picture.naturalWidth; setTimeout(look, 120); };
picture.onerror = () => setTimeout(look, 1000);

(async () => { state = await (await fetch("state" + location.search)).json(); show(); look(); })();
