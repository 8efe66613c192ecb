// How the computer sees the game: the puck that it observes, the one that it expects, its
// estimate of who scores next, and the stages of its training.

import { alpha, colourOf } from "./colours.js";
import { $, element, game, on, put, send } from "./state.js";

let open = false, shown = "";
export const hasInsight = () => Boolean(game.match && game.match.checkpoints && game.match.checkpoints.length && !game.match.study);

$("think").onclick = () => { open = !open; report(); };
function report() { send("insight", { on: Number(open) }); $("think").setAttribute("aria-pressed", open); shown = ""; }
on("match", () => { shown = ""; $("think").hidden = !hasInsight(); if (open) report(); });

export function drawInsight(view, frame) {
  const { insight } = game.now;
  $("insight").hidden = !open || !insight;
  if ($("insight").hidden) return;
  const { pen } = view, r = game.match.puck_radius, ink = colourOf(insight.seat);
  insight.seen.forEach(([x, y], k) => {
    const [px, py] = insight.predicted[k];
    pen.lineWidth = Math.max(2, 0.006 * view.scale);
    pen.setLineDash([4, 4]);
    view.path([[x, y], [px, py]], false); pen.strokeStyle = alpha(ink, 0.6); pen.stroke();
    view.disc(x, y, r, null, alpha(ink, 0.6));
    pen.setLineDash([]);
    view.disc(px, py, r, alpha(ink, 0.15), ink);
  });
  panel(insight);
}

function panel(insight) {
  const { match, now } = game, driver = now.seats[insight.seat].driver;
  const state = JSON.stringify([driver, insight.latency, match.scenario]);
  if (state !== shown) { shown = state; build(insight, driver); }
  const bar = $("insight").querySelector(".bar");
  if (bar && insight.next_goal !== null) {
    const rows = bar.children, share = insight.next_goal;
    rows[0].style.width = `${100 * share}%`; rows[1].style.width = `${100 - 100 * share}%`;
    put($("insight").querySelector(".share"), `The next goal: ${Math.round(100 * share)} % : ${Math.round(100 - 100 * share)} %`);
  }
}

function build(insight, driver) {
  const { match } = game, stage = match.checkpoints.findIndex((row) => row.name === driver), row = match.checkpoints[stage];
  const parts = [element("h2", "How the computer sees it")];
  parts.push(element("p", `Dashed: the puck that it observes, ${Math.round(1000 * insight.latency)} ms late. Circle: where it expects the puck now.`));
  if (insight.next_goal !== null) {
    const bar = element("div", "", "bar"), halves = [0, 1].map((team) => {
      const half = element("span");
      half.style.background = colourOf(match.seats.findIndex((seat) => seat.team === team));
      return half;
    });
    bar.append(...halves);
    parts.push(element("p", "", "share"), bar, element("p", "An estimate that was learned from games between policies.", "facts"));
  }
  if (row) {
    const slider = Object.assign(element("input"), { type: "range", min: 0, max: match.checkpoints.length - 1, value: stage });
    slider.setAttribute("aria-label", "stage of the training");
    slider.onchange = () => { send("checkpoint", { seat: insight.seat, name: match.checkpoints[slider.value].name }); slider.blur(); };
    parts.push(element("p", `Trained for ${row.minutes < 10 ? row.minutes.toFixed(1) : Math.round(row.minutes)} minutes on one core. Move the slider to an earlier or later stage:`), slider);
  }
  $("insight").replaceChildren(...parts);
}
