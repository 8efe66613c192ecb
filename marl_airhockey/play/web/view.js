// The view of a table on a canvas: metres to pixels. One's own side is at the left, or
// below on a tall canvas.

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.inset = { top: 0, bottom: 0, right: 0 }; // CSS pixels that are covered
    this.margin = 0.07; // m around the table
  }

  fit(match, seat) {
    const { canvas } = this, dense = this.dense;
    const rotation = match.seats[seat === null ? 0 : seat].rotation;
    const top = this.inset.top * dense, height = canvas.height - top - this.inset.bottom * dense;
    const width = canvas.width - (this.inset.right || 0) * dense, tall = height > width * 1.1;
    // Rows: screen right and screen up, in the table frame.
    this.right = tall ? rotation[1].map((v) => -v) : rotation[0];
    this.up = tall ? rotation[0] : rotation[1];
    const along = (axis) => match.table.map((p) => p[0] * axis[0] + p[1] * axis[1]);
    const xs = along(this.right), ys = along(this.up), m = this.margin;
    const low = [Math.min(...xs) - m, Math.min(...ys) - m], high = [Math.max(...xs) + m, Math.max(...ys) + m];
    this.scale = Math.min(width / (high[0] - low[0]), height / (high[1] - low[1]));
    this.centre = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    this.middle = [width / 2, top + height / 2];
    this.lowest = this.middle[1] + ((high[1] - low[1]) / 2 - m) * this.scale; // lower edge of the table, px
    this.tall = tall;
  }

  // Pixels of the canvas per CSS pixel; 1 for a canvas that is not in the page.
  get dense() { return this.canvas.clientWidth ? this.canvas.width / this.canvas.clientWidth : 1; }

  toScreen(x, y) {
    const { right, up, scale, centre, middle } = this;
    return [
      middle[0] + (x * right[0] + y * right[1] - centre[0]) * scale,
      middle[1] - (x * up[0] + y * up[1] - centre[1]) * scale,
    ];
  }

  fromScreen(px, py) {
    const { right, up, scale, centre, middle, dense } = this;
    const a = (px * dense - middle[0]) / scale + centre[0], b = (middle[1] - py * dense) / scale + centre[1];
    return [a * right[0] + b * up[0], a * right[1] + b * up[1]];
  }

  toTableFrame(a, b) {
    return [a * this.right[0] + b * this.up[0], a * this.right[1] + b * this.up[1]];
  }

  path(points, close = true) {
    this.pen.beginPath();
    points.forEach((p, i) => { const [x, y] = this.toScreen(p[0], p[1]); i ? this.pen.lineTo(x, y) : this.pen.moveTo(x, y); });
    if (close) this.pen.closePath();
  }

  disc(x, y, radius, fill, line) {
    const [px, py] = this.toScreen(x, y);
    this.pen.beginPath(); this.pen.arc(px, py, radius * this.scale, 0, 2 * Math.PI);
    if (fill) { this.pen.fillStyle = fill; this.pen.fill(); }
    if (line) { this.pen.strokeStyle = line; this.pen.stroke(); }
  }
}
