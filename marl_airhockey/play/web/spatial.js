// The 3D scene of simulated arms, beside the table.

import { $, game, on, probe, put } from "./state.js";
import { Stream } from "./stream.js";

const stream = new Stream("scene", () => Boolean(game.match && game.match.scene && game.now && !game.now.scene));

on("match", (match) => {
  $("spatial").hidden = !match.scene;
  document.body.classList.toggle("with-scene", Boolean(match.scene));
});

export function updateSpatial() {
  if (!game.match.scene) return;
  stream.update();
  put($("scene-failure"), game.now.scene || "");
  if (!stream.image || !stream.fresh) return;
  const canvas = $("scene"), { width, height } = stream.image;
  if (canvas.width !== width) { canvas.width = width; canvas.height = height; }
  canvas.getContext("2d").drawImage(stream.image, 0, 0);
  if (stream.drawn()) probe.pictures.push(performance.now());
}
