"use strict";
// A real table: its camera's picture, what its devices tell, and what may go wrong.

let pictured = 0, shown = "";

// The next picture is asked for when the last one is here.
function askForPicture() {
  // Beside the video it only shows what lies around the table.
  const wait = Math.max(0, (showsVideo() ? 1000 : 90) - (performance.now() - pictured));
  setTimeout(() => { pictured = performance.now(); $("camera").src = `camera?n=${Math.round(pictured)}&${location.search.slice(1)}`; }, wait);
}
$("camera").onload = askForPicture;
$("camera").onerror = () => setTimeout(askForPicture, 1000);

// The table from above, live: asked for again once it is drawn.
let live = null, fresh = false, wantsVideo = null, stream = null;
function openVideo() {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  stream = new WebSocket(`${scheme}//${location.host}/video${location.search}`);
  stream.binaryType = "blob";
  stream.onmessage = async (event) => {
    if (!event.data.size) { stream.send("none"); return; }
    const next = await createImageBitmap(event.data);
    if (live) live.close();
    live = next; fresh = true;
  };
  stream.onclose = () => { stream = null; if (showsVideo()) setTimeout(() => { if (showsVideo() && !stream) openVideo(); }, 1000); };
}
// Who has a seat steers by what the camera sees; others choose.
function showsVideo() { return Boolean(match && match.camera && now && (wantsVideo === null ? now.seat !== null : wantsVideo)); }
function drawVideo() {
  if (!showsVideo()) { if (stream) stream.close(); return false; }
  if (!stream) openVideo();
  if (!live) return false;
  const { low, high } = match.video;
  const [ox, oy] = toScreen(low[0], high[1]), [ax, ay] = toScreen(high[0], high[1]), [bx, by] = toScreen(low[0], low[1]);
  pen.save();
  pen.setTransform((ax - ox) / live.width, (ay - oy) / live.width, (bx - ox) / live.height, (by - oy) / live.height, ox, oy);
  pen.drawImage(live, 0, 0);
  pen.restore();
  if (fresh) { fresh = false; probe.pictures.push(performance.now()); if (stream && stream.readyState === WebSocket.OPEN) stream.send("drawn"); }
  return true;
}
$("video").onclick = () => { wantsVideo = !showsVideo(); };

function openRealTable() {
  $("real").hidden = $("video").hidden = !match.camera;
  document.body.classList.toggle("with-real", Boolean(match.camera));
  if (!match.camera) return;
  if (!pictured) askForPicture();
  $("faults").textContent = "";
  for (const [name, words] of Object.entries(match.faults)) {
    const button = document.createElement("button");
    button.textContent = name.replaceAll("_", " "); button.title = words; button.setAttribute("aria-pressed", false);
    button.onclick = () => {
      const on = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", on);
      send("fault", { name, on: Number(on) });
    };
    $("faults").append(button);
  }
  resize();
}

function updateRealTable() {
  if (!match.camera || !now.table) return;
  $("video").setAttribute("aria-pressed", showsVideo());
  const t = now.table, pair = (v) => `${v[0].toFixed(2)}, ${v[1].toFixed(2)} m/s`;
  const rows = [
    ["robot", t.fault === "none" ? t.robot.toLowerCase() : `${t.robot.toLowerCase()}: ${t.fault}`],
    ["commanded", pair(t.asked)], ["sent", pair(t.sent)],
    ["paddle above table", `${t.height_mm.toFixed(1)} mm, ${t.force.toFixed(0)} N`],
    ["video", t.drawn_ms === null ? "off" : `displayed ${t.drawn_ms.toFixed(0)} ms after the exposure`],
    ["camera", t.camera || `newest frame ${t.frame_ms.toFixed(0)} ms old, ${t.dropped} dropped`],
    ["puck", t.puck_ms === null ? "none" : `detected ${t.puck_ms.toFixed(0)} ms ago, noise ${t.noise_mm.toFixed(1)} mm`],
    ["cycles", `${t.cycles}, ${t.late} late, ${t.refused} commands rejected`],
  ];
  const text = JSON.stringify(rows);
  if (text === shown) return;
  shown = text;
  $("telemetry").replaceChildren(...rows.flatMap(([name, words]) => {
    const dt = document.createElement("dt"), dd = document.createElement("dd");
    dt.textContent = name; dd.textContent = words; dd.className = name === "robot" ? `state ${t.robot.toLowerCase()}` : "";
    return [dt, dd];
  }));
}

// A courtesy stop: who looks elsewhere does not move an arm.
addEventListener("blur", () => { if (match && match.camera && now && now.seat !== null && now.phase === "play") send("pause"); });
