// Connection to the server of a table.

import { game, receive, receiveMatch, send } from "./state.js";
import { reportDevice } from "./device.js";

const ACKNOWLEDGED = 45; // ms between two acknowledgements of frames
const KEPT = ["consent", "answer", "comment", "withdraw", "next"]; // sent later if the connection is lost

// A key of this page alone, kept over a reload, by which it gets its seat back.
const newKey = () => [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");
export const key = sessionStorage.getItem("key") || newKey();
sessionStorage.setItem("key", key);

let socket = null, acknowledgedAt = 0, answering = false, version = null, lostAt = 0;
const unsent = [];

function post(t, fields = {}) {
  const text = JSON.stringify({ t, ...fields });
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(text);
  else if (KEPT.includes(t)) unsent.push(text);
}

function acknowledge() {
  if (answering) return;
  answering = true;
  const wait = acknowledgedAt + ACKNOWLEDGED - performance.now();
  setTimeout(() => { answering = false; acknowledgedAt = performance.now(); post("seen", { f: game.now.f }); }, wait);
}

export const isCongested = (bytes) => Boolean(socket && socket.bufferedAmount > bytes);
export const isOutdated = (match) => version !== null && match.version !== version;
export const lostFor = () => (game.down ? (performance.now() - lostAt) / 1000 : 0);

export const addressOf = (path) => `${location.protocol === "https:" ? "wss:" : "ws:"}//${location.host}/${path}${location.search}`;

export function connect() {
  game.send = post;
  socket = new WebSocket(addressOf("ws"));
  socket.onopen = () => {
    game.down = false; game.refused = ""; game.openedAt = performance.now();
    send("hello", { key }); reportDevice();
    for (const text of unsent.splice(0)) socket.send(text);
  };
  socket.onmessage = (event) => {
    const data = JSON.parse(event.data);
    if (data.t === "match") {
      game.outdated = isOutdated(data); version ??= data.version;
      receiveMatch(data);
      return;
    }
    receive(data);
    acknowledge();
  };
  socket.onclose = (event) => {
    if (!game.down) lostAt = performance.now();
    game.down = true; game.refused = event.reason;
    setTimeout(connect, 1000);
  };
}
