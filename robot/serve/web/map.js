// The live map on a canvas: floor as tiles, track, landmarks, robot with its uncertainty.
import { Sketch, paintDrawn, paintNames, roomAt } from "/sketch.js";

const TILE = 32;
const SIGMAS = 2;
const DOCK = { front: 0.17, back: 0.26, half: 0.13 };

export class MapView {
  constructor(canvas) {
    this.canvas = canvas;
    this.paint = canvas.getContext("2d");
    this.tiles = new Map(); // "i,j" -> {i, j, cells, image}
    this.track = [];
    this.landmarks = [];
    this.pose = null;
    this.shown = null; // the pose that is drawn, gliding towards `pose`
    this.resolution = 0.025;
    this.radius = 0.17;
    this.showTrack = true;
    this.showLandmarks = false;
    this.centre = { x: 0, y: 0 };
    this.scale = 80; // CSS pixels per metre
    this.inset = { left: 0, top: 0 }; // what lies over the map beside the bars, CSS pixels
    this.following = true; // the view shows everything until a person moves it
    this.pointers = new Map();
    this.drawn = {}; // rooms, annotations
    this.showRooms = true;
    this.chosen = new Set(); // names of rooms
    this.onSketch = this.onRoom = () => {};
    this.sketch = new Sketch(this, () => this.onSketch());
    this.readColours();
    this.listen();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  // ---------------------------------------------------------------- what is known

  setTiles(bytes) {
    const size = 4 + TILE * TILE;
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    for (let at = 0; at + size <= bytes.length; at += size) {
      const i = view.getInt16(at, true), j = view.getInt16(at + 2, true);
      const cells = bytes.slice(at + 4, at + size);
      const key = `${i},${j}`;
      if (cells.some((cell) => cell)) this.tiles.set(key, { i, j, cells, image: this.draw(cells) });
      else this.tiles.delete(key);
    }
    if (this.following) this.fit();
    this.ask();
  }

  setTrack(first, points) {
    this.track.length = Math.min(first, this.track.length);
    for (const point of points) this.track.push(point);
    this.ask();
  }

  setPose(pose) {
    this.pose = pose;
    if (!this.shown) this.shown = { x: pose.x_m, y: pose.y_m, yaw: pose.yaw_rad };
    this.ask();
  }

  get empty() { return this.tiles.size === 0; }

  // ---------------------------------------------------------------- the view

  bounds() {
    let box = { x0: -0.4, y0: -0.4, x1: 0.4, y1: 0.4 };
    const side = TILE * this.resolution;
    for (const { i, j } of this.tiles.values()) {
      box.x0 = Math.min(box.x0, i * side); box.x1 = Math.max(box.x1, (i + 1) * side);
      box.y0 = Math.min(box.y0, j * side); box.y1 = Math.max(box.y1, (j + 1) * side);
    }
    return box;
  }

  fit() {
    const box = this.bounds();
    const top = Math.max(56, this.inset.top), margin = 20, low = this.floorPx(), right = this.narrow ? 0 : 48; // the bars lie over the canvas
    const left = this.inset.left;
    this.scale = Math.min(
      (this.width - 2 * margin - right - left) / (box.x1 - box.x0),
      Math.max(60, this.height - top - margin - low) / (box.y1 - box.y0), 220);
    this.centre = { x: (box.x0 + box.x1) / 2 + (right - left) / 2 / this.scale, y: (box.y0 + box.y1) / 2 + (top - margin - low) / 2 / this.scale };
    this.following = true;
    this.ask();
  }

  // Something has come to lie over the map, or has gone: above it on a phone, at its left elsewhere.
  cover(thing) {
    const { offsetLeft, offsetTop, offsetWidth, offsetHeight } = thing;
    this.inset = thing.hidden ? { left: 0, top: 0 } : this.narrow ? { left: 0, top: offsetTop + offsetHeight } : { left: offsetLeft + offsetWidth, top: 0 };
    if (this.following) this.fit();
  }

  get narrow() { return window.matchMedia("(max-width: 859px)").matches; }

  // What lies over the map's lower edge.
  floorPx() { return (this.narrow ? 48 : 0) + (this.sketch.kind ? 130 : 0); }

  zoom(factor, at = { x: this.width / 2, y: this.height / 2 }) {
    const before = this.world(at);
    this.scale = Math.max(10, Math.min(1200, this.scale * factor));
    const after = this.world(at);
    this.centre.x += before.x - after.x;
    this.centre.y += before.y - after.y;
    this.following = false;
    this.ask();
  }

  move(dx, dy) {
    this.centre.x -= dx / this.scale;
    this.centre.y += dy / this.scale;
    this.following = false;
    this.ask();
  }

  world(at) {
    return { x: this.centre.x + (at.x - this.width / 2) / this.scale, y: this.centre.y - (at.y - this.height / 2) / this.scale };
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    this.width = this.canvas.clientWidth || 1;
    this.height = this.canvas.clientHeight || 1;
    this.canvas.width = Math.round(this.width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    this.ratio = ratio;
    if (this.following) this.fit();
    this.ask();
  }

  // ---------------------------------------------------------------- hands

  listen() {
    const canvas = this.canvas;
    const place = (event) => { const box = canvas.getBoundingClientRect(); return { x: event.clientX - box.left, y: event.clientY - box.top }; };
    let tap = null; // where a touch began that has not moved
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      const at = place(event);
      this.pointers.set(event.pointerId, at);
      tap = this.pointers.size === 1 ? at : null;
      if (!this.sketch.kind) return;
      if (tap) this.sketch.down(this.world(at));
      else this.sketch.cancel();
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.pointers.has(event.pointerId)) return;
      const before = [...this.pointers.values()].map((p) => ({ ...p }));
      const old = this.pointers.get(event.pointerId), now = place(event);
      this.pointers.set(event.pointerId, now);
      if (tap && Math.hypot(now.x - tap.x, now.y - tap.y) > 6) tap = null;
      if (this.sketch.start) { this.sketch.move(this.world(now)); return; }
      if (this.pointers.size === 1) { if (!this.sketch.kind) this.move(now.x - old.x, now.y - old.y); return; }
      const after = [...this.pointers.values()];
      const span = (p) => Math.hypot(p[0].x - p[1].x, p[0].y - p[1].y) || 1;
      const middle = (p) => ({ x: (p[0].x + p[1].x) / 2, y: (p[0].y + p[1].y) / 2 });
      this.zoom(span(after) / span(before), middle(after));
      this.move(middle(after).x - middle(before).x, middle(after).y - middle(before).y);
    });
    canvas.addEventListener("pointerup", (event) => {
      this.pointers.delete(event.pointerId);
      if (this.sketch.start) this.sketch.up();
      else if (tap && !this.sketch.kind) { const name = roomAt(this, this.world(tap)); if (name) this.onRoom(name); }
      tap = null;
    });
    canvas.addEventListener("pointercancel", (event) => { this.pointers.delete(event.pointerId); this.sketch.cancel(); });
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(Math.exp(-event.deltaY * 0.0015), place(event)); }, { passive: false });
    canvas.addEventListener("dblclick", () => this.fit());
    canvas.addEventListener("keydown", (event) => {
      if (this.sketch.kind && this.sketch.key(event)) { event.preventDefault(); return; }
      const steps = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] };
      if (steps[event.key]) this.move(...steps[event.key]);
      else if (event.key === "+" || event.key === "=") this.zoom(1.25);
      else if (event.key === "-") this.zoom(0.8);
      else if (event.key === "0" || event.key === "Home") this.fit();
      else return;
      event.preventDefault();
    });
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { this.readColours(); this.repaint(); });
  }

  // ---------------------------------------------------------------- drawing

  readColours() {
    const style = getComputedStyle(document.documentElement);
    const names = ["paper", "free", "swept", "occupied", "grid", "track", "robot", "landmark", "dock", "card", "ink", "soft", "danger"];
    this.colour = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
    this.rgb = ["free", "swept", "occupied"].map((name) => { const hex = this.colour[name]; return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16)); });
  }

  repaint() {
    for (const tile of this.tiles.values()) tile.image = this.draw(tile.cells);
    this.ask();
  }

  draw(cells) {
    const image = new OffscreenCanvas(TILE, TILE), paint = image.getContext("2d");
    const data = paint.createImageData(TILE, TILE);
    for (let y = 0; y < TILE; y++) for (let x = 0; x < TILE; x++) {
      const cell = cells[y * TILE + x];
      if (!cell) continue;
      const at = 4 * ((TILE - 1 - y) * TILE + x), [r, g, b] = this.rgb[cell - 1];
      data.data.set([r, g, b, 255], at);
    }
    paint.putImageData(data, 0, 0);
    return image;
  }

  ask() {
    if (!this.asked) { this.asked = true; requestAnimationFrame(() => { this.asked = false; this.frame(); }); }
  }

  frame() {
    const p = this.paint, s = this.scale * this.ratio;
    p.setTransform(1, 0, 0, 1, 0, 0);
    p.fillStyle = this.colour.paper;
    p.fillRect(0, 0, this.canvas.width, this.canvas.height);
    p.setTransform(s, 0, 0, -s, this.canvas.width / 2 - this.centre.x * s, this.canvas.height / 2 + this.centre.y * s);
    this.lines();
    this.floor();
    paintDrawn(this, p);
    if (this.showTrack) this.way();
    if (this.pose || !this.empty) this.dock();
    if (this.showLandmarks) for (const [x, y, xx, xy, yy] of this.landmarks) this.landmark(x, y, xx, xy, yy);
    if (this.pose) this.robot();
    if (this.sketch.kind) this.sketch.paint(p);
    paintNames(this, p);
    this.ruler();
  }

  lines() {
    const p = this.paint, a = this.world({ x: 0, y: this.height }), b = this.world({ x: this.width, y: 0 });
    if (b.x - a.x > 60) return;
    p.beginPath();
    for (let x = Math.ceil(a.x); x <= b.x; x++) { p.moveTo(x, a.y); p.lineTo(x, b.y); }
    for (let y = Math.ceil(a.y); y <= b.y; y++) { p.moveTo(a.x, y); p.lineTo(b.x, y); }
    p.strokeStyle = this.colour.grid;
    p.lineWidth = 1 / this.scale;
    p.stroke();
  }

  floor() {
    const p = this.paint, side = TILE * this.resolution, bleed = 0.3 / this.scale;
    p.imageSmoothingEnabled = this.scale * this.resolution < 3;
    for (const { i, j, image } of this.tiles.values()) {
      p.save();
      p.translate(i * side, (j + 1) * side);
      p.scale(1, -1);
      p.drawImage(image, 0, 0, TILE, TILE, 0, 0, side + bleed, side + bleed);
      p.restore();
    }
  }

  way() {
    const p = this.paint;
    if (this.track.length < 2) return;
    p.beginPath();
    for (const [x, y] of this.track) p.lineTo(x, y);
    if (this.shown) p.lineTo(this.shown.x, this.shown.y);
    p.strokeStyle = this.colour.track;
    p.globalAlpha = 0.55;
    p.lineWidth = Math.max(0.014, 1.4 / this.scale);
    p.lineJoin = p.lineCap = "round";
    p.stroke();
    p.globalAlpha = 1;
  }

  dock() {
    const p = this.paint, { front, back, half } = DOCK;
    p.fillStyle = this.colour.dock;
    p.beginPath();
    p.roundRect(front, -half, back - front, 2 * half, 0.03);
    p.fill();
  }

  ellipse(x, y, xx, xy, yy, least) {
    const mean = (xx + yy) / 2, root = Math.hypot((xx - yy) / 2, xy);
    const axis = (value) => Math.max(least, SIGMAS * Math.sqrt(Math.max(0, value)));
    this.paint.beginPath();
    this.paint.ellipse(x, y, axis(mean + root), axis(mean - root), Math.atan2(2 * xy, xx - yy) / 2, 0, 2 * Math.PI);
  }

  landmark(x, y, xx, xy, yy) {
    const p = this.paint;
    p.strokeStyle = p.fillStyle = this.colour.landmark;
    this.ellipse(x, y, xx, xy, yy, 2 / this.scale);
    p.lineWidth = 1 / this.scale;
    p.stroke();
    p.beginPath();
    p.arc(x, y, 1.8 / this.scale, 0, 2 * Math.PI);
    p.fill();
  }

  robot() {
    const p = this.paint, shown = this.shown, pose = this.pose, r = this.radius;
    const turn = Math.atan2(Math.sin(pose.yaw_rad - shown.yaw), Math.cos(pose.yaw_rad - shown.yaw));
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    const share = still || Math.hypot(pose.x_m - shown.x, pose.y_m - shown.y) > 1 ? 1 : 0.25;
    shown.x += share * (pose.x_m - shown.x);
    shown.y += share * (pose.y_m - shown.y);
    shown.yaw += share * turn;
    if (Math.hypot(pose.x_m - shown.x, pose.y_m - shown.y) > 5e-4 || Math.abs(turn) > 2e-3) this.ask();
    const [xx, xy, yy] = pose.cov;
    this.ellipse(shown.x, shown.y, xx, xy, yy, 0);
    p.fillStyle = this.colour.robot;
    p.globalAlpha = 0.22;
    p.fill();
    p.globalAlpha = 1;
    p.save();
    p.translate(shown.x, shown.y);
    p.rotate(shown.yaw);
    p.shadowColor = "#0005";
    p.shadowBlur = 10 * this.ratio;
    p.beginPath();
    p.arc(0, 0, r, 0, 2 * Math.PI);
    p.fillStyle = this.colour.card;
    p.fill();
    p.shadowBlur = 0;
    p.lineWidth = 0.03;
    p.strokeStyle = this.colour.robot;
    p.stroke();
    p.beginPath();
    p.moveTo(r * 0.62, 0); p.lineTo(-r * 0.3, r * 0.42); p.lineTo(-r * 0.08, 0); p.lineTo(-r * 0.3, -r * 0.42);
    p.closePath();
    p.fillStyle = this.colour.robot;
    p.fill();
    p.restore();
    this.ellipse(shown.x, shown.y, xx, xy, yy, 2 / this.scale);
    p.strokeStyle = this.colour.landmark;
    p.lineWidth = 1.2 / this.scale;
    p.stroke();
    // How well the heading is known: a fan of two sigmas.
    const spread = Math.min(Math.PI, SIGMAS * Math.sqrt(Math.max(0, pose.cov[3])));
    if (spread > 0.02) {
      p.beginPath();
      p.moveTo(shown.x, shown.y);
      p.arc(shown.x, shown.y, 2.2 * r, shown.yaw - spread, shown.yaw + spread);
      p.closePath();
      p.fillStyle = this.colour.robot;
      p.globalAlpha = 0.2;
      p.fill();
      p.globalAlpha = 1;
    }
  }

  ruler() {
    const p = this.paint, low = this.height - (this.narrow ? 48 : 0) - 16, length = [0.1, 0.25, 0.5, 1, 2, 5, 10].find((m) => m * this.scale > 56) || 20;
    const px = length * this.scale;
    p.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    p.strokeStyle = p.fillStyle = this.colour.soft;
    p.lineWidth = 2;
    p.lineCap = "round";
    p.beginPath();
    p.moveTo(16, low - 6); p.lineTo(16, low); p.lineTo(16 + px, low); p.lineTo(16 + px, low - 6);
    p.stroke();
    p.font = "12px system-ui, sans-serif";
    p.fillText(length < 1 ? `${length * 100} cm` : `${length} m`, 22, low - 6);
  }
}
