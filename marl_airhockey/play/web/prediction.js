// One's own paddle: moved here immediately, with the pointer controller of the server.

import { game, mySeat, on } from "./state.js";

export const own = { paddle: null }; // predicted paddle: x, y, vx, vy
let past = []; // [aim, x, y] of the last aims

export function remember(aim) {
  past.push([aim, own.paddle ? own.paddle.x : 0, own.paddle ? own.paddle.y : 0]);
  if (past.length > 90) past.shift();
}

on("match", () => { own.paddle = null; past = []; });

export function correct(frame, predicts) {
  if (frame.seat === null) { own.paddle = null; return; }
  const [x, y] = frame.paddles[frame.seat];
  if (!own.paddle || frame.phase !== "play" || !predicts) { own.paddle = { x, y, vx: 0, vy: 0 }; past = []; return; }
  const then = past.find((p) => p[0] === frame.ack);
  if (!then) return;
  // The server's position belongs to the aim that it acknowledges: compare with ours of then.
  const dx = x - then[1], dy = y - then[2], share = Math.hypot(dx, dy) > 0.15 ? 1 : 0.12;
  own.paddle.x += share * dx; own.paddle.y += share * dy;
  for (const p of past) { p[1] += share * dx; p[2] += share * dy; }
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

export function predict(dt, pointer) {
  const seat = mySeat(), paddle = own.paddle;
  if (!paddle || !seat || !pointer || game.now.phase !== "play") return;
  const { gain, brake } = game.match.mouse;
  const wx = pointer[0] - paddle.x, wy = pointer[1] - paddle.y, far = Math.max(Math.hypot(wx, wy), 1e-9);
  const speed = Math.min(gain * far, Math.sqrt(2 * brake * seat.acceleration * far), seat.speed);
  let ax = (wx / far) * speed - paddle.vx, ay = (wy / far) * speed - paddle.vy;
  const most = seat.acceleration * dt, size = Math.hypot(ax, ay);
  if (size > most) { ax *= most / size; ay *= most / size; }
  paddle.vx += ax; paddle.vy += ay;
  [paddle.x, paddle.y] = clampTo(seat.reach, seat.rotation, paddle.x + paddle.vx * dt, paddle.y + paddle.vy * dt);
}
