"use strict";
// The loop of the page: predict, send, draw.

function draw(at) {
  const dt = Math.min((at - drawnAt) / 1000, 0.05); drawnAt = at;
  if (recording) advanceRecording(dt);
  if (match && now) {
    if (!fit || fit.seat !== now.seat || fit.match !== match) { fit = frameOfView(); pointer = pointedAt = null; }
    predict(dt);
    sendInput(at);
    const gap = Math.max(nowAt - beforeAt, 1);
    const late = linkRate() < 60 ? gap : LATE;
    const share = before ? Math.max(0, Math.min(1.2, (at - late - beforeAt) / gap)) : 1;
    pen.clearRect(0, 0, canvas.width, canvas.height);
    drawTable(); drawMarks(); drawObstacles(); drawBodies(share);
    if (flash > 0) {
      pen.fillStyle = alpha(flashColour, 0.3 * flash); path(match.table); pen.fill(); flash = Math.max(0, flash - dt * 1.6);
    }
    if (now.ack && pending.has(now.ack)) {
      probe.latencies.push(performance.now() - pending.get(now.ack));
      for (const q of pending.keys()) { if (q > now.ack) break; pending.delete(q); }
    }
    updateWords();
  } else if (down) { show("No connection", refused || "trying again…", ""); }
  requestAnimationFrame(draw);
}

resize();
begin();
measurePictures();
requestAnimationFrame(draw);
