"use strict";
// One's own paddle: moved here at once, by the law of the server's driver.

function seatNow() { return now && now.seat !== null ? match.seats[now.seat] : null; }

function correct(data) {
  if (data.seat === null) { ownPaddle = null; return; }
  const [x, y] = data.paddles[data.seat];
  if (!ownPaddle || data.phase !== "play" || steered) { ownPaddle = { x, y, vx: 0, vy: 0 }; predicted = []; return; }
  const past = predicted.find((p) => p[0] === data.ack);
  if (!past) return;
  // The server's position belongs to the aim that it acknowledges: compare with ours of then.
  const dx = x - past[1], dy = y - past[2], share = Math.hypot(dx, dy) > 0.15 ? 1 : 0.12;
  ownPaddle.x += share * dx; ownPaddle.y += share * dy;
  for (const p of predicted) { p[1] += share * dx; p[2] += share * dy; }
}

function clampTo(reach, rotation, x, y) {
  let u = rotation[0][0] * x + rotation[0][1] * y, v = rotation[1][0] * x + rotation[1][1] * y;
  for (let pass = 0; pass < 3; pass++) {
    for (let i = 0; i < reach.length; i++) {
      const [ax, ay] = reach[i], [bx, by] = reach[(i + 1) % reach.length];
      const size = Math.hypot(bx - ax, by - ay), nx = -(by - ay) / size, ny = (bx - ax) / size;
      const inside = (u - ax) * nx + (v - ay) * ny;
      if (inside < 0) { u -= inside * nx; v -= inside * ny; }
    }
  }
  return [rotation[0][0] * u + rotation[1][0] * v, rotation[0][1] * u + rotation[1][1] * v];
}

function predict(dt) {
  const seat = seatNow();
  if (!ownPaddle || !seat || !pointer || now.phase !== "play") return;
  const wx = pointer[0] - ownPaddle.x, wy = pointer[1] - ownPaddle.y, far = Math.max(Math.hypot(wx, wy), 1e-9);
  const speed = Math.min(match.mouse.gain * far, Math.sqrt(2 * match.mouse.brake * seat.acceleration * far), seat.speed);
  let ax = (wx / far) * speed - ownPaddle.vx, ay = (wy / far) * speed - ownPaddle.vy;
  const most = seat.acceleration * dt, size = Math.hypot(ax, ay);
  if (size > most) { ax *= most / size; ay *= most / size; }
  ownPaddle.vx += ax; ownPaddle.vy += ay;
  const x = ownPaddle.x + ownPaddle.vx * dt, y = ownPaddle.y + ownPaddle.vy * dt;
  [ownPaddle.x, ownPaddle.y] = clampTo(seat.reach, seat.rotation, x, y);
}
