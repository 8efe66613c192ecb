// The device of the person: by what it steers, size and frame rate of the screen.

import { send } from "./state.js";

let kind = "none", rate = 0;

export function reportDevice() {
  const { innerWidth: width, innerHeight: height, devicePixelRatio: density } = window;
  send("device", { input: kind, width, height, density, hz: Math.round(rate) });
}

export function steersBy(device) {
  if (device === kind) return;
  kind = device;
  reportDevice();
}

export function measureRate(count = 0, began = performance.now()) {
  if (count === 60) { rate = 60000 / (performance.now() - began); reportDevice(); return; }
  requestAnimationFrame(() => measureRate(count + 1, began));
}

export const touch = { used: matchMedia("(pointer: coarse)").matches };
addEventListener("pointerdown", (event) => { touch.used = event.pointerType === "touch"; }, true);
