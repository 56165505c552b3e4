// A picture and a pointer in; marks (clicks, a box, strokes) on it out. Coordinates of marks are pixels of the picture.
const LONGEST = 1600;
const RED = [214, 40, 57];

export class Marker {
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;
    this.tool = "click";
    this.brush = 14;
    this.reset();
    this.cursor = null;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", () => { this.drag = null; this.draw(); });
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("blur", () => { this.cursor = null; this.draw(); });
  }

  reset() { this.picture = null; this.marks = this.accepted = []; this.mask = null; this.drag = null; }

  show(picture, width, height) {
    this.picture = picture;
    if (this.width !== width || this.height !== height || !this.canvas.width) {
      const factor = Math.min(1, LONGEST / Math.max(width, height));
      [this.width, this.height, this.factor] = [width, height, factor];
      this.canvas.width = Math.round(width * factor);
      this.canvas.height = Math.round(height * factor);
    }
    this.draw();
  }

  setMarks(marks) { this.marks = this.accepted = marks; this.draw(); }

  // Marks that the server refused go, else they would be sent again with the next one.
  refuse(sent) {
    this.marks = this.marks.filter((one) => this.accepted.includes(one) || !sent.includes(one));
    this.draw();
  }

  // The mask that the server found (an ImageBitmap, white = to go), tinted, with its rim.
  setMask(picture) {
    if (!picture) { this.mask = null; this.draw(); return; }
    const { width, height } = this.canvas;
    const sheet = new OffscreenCanvas(width, height);
    const pen = sheet.getContext("2d", { willReadFrequently: true });
    pen.drawImage(picture, 0, 0, width, height);
    const image = pen.getImageData(0, 0, width, height), data = image.data;
    const set = new Uint8Array(width * height);
    for (let i = 0; i < set.length; i++) set[i] = data[4 * i] > 127 ? 1 : 0;
    for (let y = 0, i = 0; y < height; y++) for (let x = 0; x < width; x++, i++) {
      const inside = set[i] && x > 0 && y > 0 && x < width - 1 && y < height - 1;
      const rim = set[i] && !(inside && set[i - 1] && set[i + 1] && set[i - width] && set[i + width]);
      [data[4 * i], data[4 * i + 1], data[4 * i + 2], data[4 * i + 3]] = [...RED, set[i] ? (rim ? 255 : 120) : 0];
    }
    pen.putImageData(image, 0, 0);
    this.mask = sheet;
    this.draw();
  }

  at(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width * this.width, y = (event.clientY - box.top) / box.height * this.height;
    return [Math.min(Math.max(x, 0), this.width - 0.01), Math.min(Math.max(y, 0), this.height - 0.01)].map((v) => Math.round(v * 10) / 10);
  }

  down(event) {
    if (!this.picture || event.button !== 0) return;
    this.canvas.setPointerCapture(event.pointerId);
    const at = this.at(event);
    this.drag = { from: at, to: at, points: [at], tool: this.tool };
    this.draw();
  }

  move(event) {
    if (!this.drag) return;
    this.drag.to = this.at(event);
    const last = this.drag.points.at(-1);
    if (Math.hypot(last[0] - this.drag.to[0], last[1] - this.drag.to[1]) > this.brush / 4) this.drag.points.push(this.drag.to);
    this.draw();
  }

  up() {
    if (!this.drag) return;
    const { from, to, points, tool } = this.drag;
    this.drag = null;
    if (tool === "click" || tool === "not") this.add({ kind: tool, at: from.map((v) => Math.floor(v)) });
    else if (tool === "box") {
      const x = Math.floor(Math.min(from[0], to[0])), y = Math.floor(Math.min(from[1], to[1]));
      const w = Math.round(Math.abs(from[0] - to[0])), h = Math.round(Math.abs(from[1] - to[1]));
      if (w > 2 && h > 2) this.add({ kind: "box", box: [x, y, w, h] });
      else this.draw();
    } else this.add({ kind: tool, points, radius: this.brush });
  }

  add(mark) {
    if (mark.kind === "box") this.marks = this.marks.filter((one) => one.kind !== "box");
    this.marks = [...this.marks, mark];
    this.draw();
    this.changed();
  }

  undo() { this.marks = this.marks.slice(0, -1); this.draw(); this.changed(); }

  clear() { this.marks = []; this.mask = null; this.draw(); this.changed(); }

  key(event) {
    if (!this.picture) return;
    const step = event.shiftKey ? 1 : Math.max(2, this.width / 64);
    const move = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[event.key];
    if (move) {
      this.cursor ??= [this.width / 2, this.height / 2];
      this.cursor = [Math.min(Math.max(this.cursor[0] + move[0], 0), this.width - 1), Math.min(Math.max(this.cursor[1] + move[1], 0), this.height - 1)];
      if (this.corner) this.drag = { from: this.corner, to: this.cursor, points: [], tool: "box" };
      this.draw();
    } else if ((event.key === "Enter" || event.key === " ") && this.cursor) {
      const at = this.cursor.map((v) => Math.floor(v));
      if (this.tool === "box" && !this.corner) { this.corner = at; } else if (this.tool === "box") {
        this.drag = { from: this.corner, to: at, points: [], tool: "box" };
        this.corner = null;
        this.up();
      } else if (this.tool === "click" || this.tool === "not") this.add({ kind: this.tool, at });
      else this.add({ kind: this.tool, points: [at], radius: this.brush });
    } else if (event.key === "Backspace" && this.marks.length) this.undo();
    else if (event.key === "Escape") { this.corner = this.drag = null; this.draw(); } else return;
    event.preventDefault();
  }

  draw() {
    const pen = this.canvas.getContext("2d"), f = this.factor ?? 1;
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (!this.picture) return;
    pen.drawImage(this.picture, 0, 0, this.canvas.width, this.canvas.height);
    if (this.mask) pen.drawImage(this.mask, 0, 0);
    const unit = Math.max(1, this.canvas.width / (this.canvas.clientWidth || this.canvas.width));
    const pending = this.drag ? [...this.marks, this.pending()] : this.marks;
    for (const mark of pending) if (mark) this.drawMark(pen, mark, f, unit, this.drag && mark === pending.at(-1));
    if (this.cursor) this.drawCross(pen, this.cursor.map((v) => v * f), unit);
  }

  pending() {
    const { from, to, points, tool } = this.drag;
    if (tool === "box") return { kind: "box", box: [Math.min(from[0], to[0]), Math.min(from[1], to[1]), Math.abs(from[0] - to[0]), Math.abs(from[1] - to[1])] };
    if (tool === "add" || tool === "erase") return { kind: tool, points, radius: this.brush };
    return { kind: tool, at: from };
  }

  drawMark(pen, mark, f, unit, live) {
    if (mark.at) {
      const [x, y] = [(mark.at[0] + 0.5) * f, (mark.at[1] + 0.5) * f], good = mark.kind === "click";
      pen.beginPath();
      pen.arc(x, y, 7 * unit, 0, 2 * Math.PI);
      pen.fillStyle = good ? "#fff" : "#222";
      pen.strokeStyle = good ? "#0b63b8" : "#fff";
      pen.lineWidth = 2.5 * unit;
      pen.fill();
      pen.stroke();
      pen.beginPath();
      pen.moveTo(x - 3 * unit, y); pen.lineTo(x + 3 * unit, y);
      if (good) { pen.moveTo(x, y - 3 * unit); pen.lineTo(x, y + 3 * unit); }
      pen.lineWidth = 2 * unit;
      pen.stroke();
    } else if (mark.box) {
      pen.setLineDash([6 * unit, 4 * unit]);
      for (const [color, width] of [["#000a", 4], ["#fff", 2]]) {
        pen.strokeStyle = color;
        pen.lineWidth = width * unit;
        pen.strokeRect(...mark.box.map((v) => v * f));
      }
      pen.setLineDash([]);
    } else if (live) {
      pen.strokeStyle = mark.kind === "add" ? "rgb(214 40 57 / 55%)" : "rgb(255 255 255 / 60%)";
      pen.lineWidth = 2 * mark.radius * f;
      pen.lineCap = pen.lineJoin = "round";
      pen.beginPath();
      mark.points.forEach(([x, y], i) => (i ? pen.lineTo(x * f, y * f) : pen.moveTo(x * f, y * f)));
      if (mark.points.length === 1) pen.lineTo(mark.points[0][0] * f + 0.1, mark.points[0][1] * f);
      pen.stroke();
    }
  }

  drawCross(pen, [x, y], unit) {
    for (const [color, width] of [["#000", 4], ["#fff", 1.5]]) {
      pen.strokeStyle = color;
      pen.lineWidth = width * unit;
      pen.beginPath();
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) { pen.moveTo(x + 4 * unit * dx, y + 4 * unit * dy); pen.lineTo(x + 14 * unit * dx, y + 14 * unit * dy); }
      pen.stroke();
    }
  }
}
