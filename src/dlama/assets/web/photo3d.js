// A GLB of a 3-D photo and its head box in; the photo on a canvas out, turned by mouse, touch, keys, the wheel or the device's tilt.
import { SceneView, along, cross, spin, sub, unit } from "/scene.js";

const IDLE = 2500, EASE = 0.12, STILL = matchMedia("(prefers-reduced-motion: reduce)");
const within = (value) => Math.max(-1, Math.min(1, value));

export class PhotoView extends SceneView {
  // box: { angle (degrees), distance (share of the pivot's) }; the camera stays in it.
  show(glb, start, palette, box) {
    this.box = box;
    this.at = [0, 0, 0];
    this.aim = [0, 0, 0];
    this.touched = performance.now();
    super.show(glb, start, palette);
    this.running ||= requestAnimationFrame(() => this.step());
  }

  home() {
    this.aim = [0, 0, 0];
    this.place();
  }

  // The camera at a place of the box, -1..1 to the right, up and forward.
  place() {
    const pose = this.start.world_from_cam, column = (c) => [pose[0][c], -pose[1][c], -pose[2][c]];
    const turn = this.box.angle * Math.PI / 180, up = unit(column(1).map((v) => -v)), source = column(3);
    const target = along(source, column(2), this.start.pivot);
    const aside = spin(sub(source, target), up, this.at[0] * turn);
    const away = spin(aside, unit(cross(up, aside)), -this.at[1] * turn);
    this.eye = along(target, away, 1 - this.at[2] * this.box.distance);
    this.target = along(target, unit(away), 0);
    this.up = up;
    this.draw();
  }

  step() {
    this.running = requestAnimationFrame(() => this.step());
    if (!this.ready || document.hidden || !this.canvas.clientWidth) return;
    const idle = performance.now() - this.touched - IDLE;
    if (idle > 0 && !this.pointers.size && !STILL.matches) {
      const t = idle / 1000, wide = 0.6 * Math.min(1, t / 2);
      this.aim = [wide * Math.sin(0.9 * t), 0.5 * wide * Math.sin(0.6 * t), 0];
    }
    const far = Math.max(...this.aim.map((v, i) => Math.abs(v - this.at[i])));
    if (far < 1e-3) return;
    this.at = this.at.map((v, i) => v + EASE * (this.aim[i] - v));
    this.place();
  }

  // Places are -1..1 along each axis of the box.
  go(x, y, z = this.aim[2]) {
    this.aim = [x, y, z].map(within);
    this.touched = performance.now();
  }

  turn(dx, dy) { this.go(this.aim[0] - 1.5 * dx, this.aim[1] + 1.5 * dy); }
  zoom(factor) { this.go(this.aim[0], this.aim[1], this.aim[2] - 4 * Math.log(factor)); }
  pan(dx, dy) { this.turn(2 * dx, 2 * dy); }

  // A mouse that hovers steers, as a head before a window does.
  hover(event) {
    if (event.pointerType !== "mouse" || event.buttons || !this.ready) return;
    const size = this.canvas.getBoundingClientRect();
    this.go(2 * (event.clientX - size.left) / size.width - 1, 1 - 2 * (event.clientY - size.top) / size.height);
  }

  // Degrees of the device; the first reading is the middle.
  tilt(event) {
    if (event.beta === null || event.gamma === null) return;
    const turned = (screen.orientation?.angle ?? 0) * Math.PI / 180, c = Math.cos(turned), s = Math.sin(turned);
    const [x, y] = [event.gamma * c + event.beta * s, event.beta * c - event.gamma * s];
    this.level ??= [x, y];
    this.level = [0.995 * this.level[0] + 0.005 * x, 0.995 * this.level[1] + 0.005 * y];
    if (Math.hypot(x - this.level[0], y - this.level[1]) > 0.5) this.go((x - this.level[0]) / 15, (y - this.level[1]) / 15);
  }
}
