// Drawing on the map with a finger, a mouse or the keyboard; and what is drawn there already.
const HUES = [212, 150, 28, 280, 340, 95, 185, 48];
const STEP_M = 0.1, FINE_M = 0.02;
export const KINDS = {
  zones: { shape: "box", many: true, hint: "Draw one or more rectangles to clean." },
  "no-go": { shape: "box", hint: "Draw a rectangle that the robot stays out of." },
  wall: { shape: "line", hint: "Draw a line that the robot does not cross." },
  split: { shape: "line", hint: "Draw a line through the room, from wall to wall." },
  "go-to": { shape: "point", hint: "Tap the place to drive to." },
};
export const hue = (index) => HUES[index % HUES.length];

export class Sketch {
  constructor(view, changed) {
    this.view = view;
    this.changed = changed;
    this.kind = null;
    this.clear();
  }

  clear() { this.shapes = []; this.start = null; this.end = null; this.cursor = null; }

  begin(kind) { this.clear(); this.kind = kind; this.seen(); }

  stop() { this.kind = null; this.clear(); this.seen(); }

  seen() { this.changed(); if (this.view.following) this.view.fit(); this.view.ask(); }

  down(at) { this.start = at; this.end = at; this.cursor = null; this.view.ask(); }

  move(at) { if (this.start) { this.end = at; this.view.ask(); } }

  cancel() { this.start = this.end = null; this.view.ask(); }

  up() {
    if (!this.start) return;
    const { shape, many } = KINDS[this.kind], a = this.start, b = this.end;
    const large = shape === "point" || (shape === "line" ? Math.hypot(b.x - a.x, b.y - a.y) > 0.05 : Math.abs(b.x - a.x) > 0.1 && Math.abs(b.y - a.y) > 0.1);
    if (large) this.shapes = [...(many ? this.shapes : []), [a.x, a.y, b.x, b.y].map((v) => Math.round(v * 1000) / 1000)].slice(-10);
    this.cancel();
    this.changed();
  }

  // Arrow keys move a cross, Enter sets a corner, Escape ends. True if the key was meant for us.
  key(event) {
    const step = event.shiftKey ? FINE_M : STEP_M;
    const move = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] }[event.key];
    this.cursor = this.cursor || { ...this.view.centre };
    if (move) {
      this.cursor = { x: this.cursor.x + move[0], y: this.cursor.y + move[1] };
      if (this.start) this.end = this.cursor;
    } else if (event.key === "Enter" || event.key === " ") {
      const at = { ...this.cursor };
      if (KINDS[this.kind].shape === "point") { this.start = this.end = at; this.up(); } else if (this.start) { this.end = at; this.up(); } else { this.start = this.end = at; }
      this.cursor = at;
    } else if (event.key === "Escape") this.stop();
    else return false;
    this.view.ask();
    return true;
  }

  paint(p) {
    const view = this.view, px = 1 / view.scale;
    const shapes = this.start ? [...this.shapes, [this.start.x, this.start.y, this.end.x, this.end.y]] : this.shapes;
    p.lineWidth = 2.5 * px;
    p.strokeStyle = this.kind === "zones" || this.kind === "go-to" ? view.colour.robot : view.colour.danger;
    p.fillStyle = p.strokeStyle;
    for (const [x0, y0, x1, y1] of shapes) {
      p.beginPath();
      const { shape } = KINDS[this.kind];
      if (shape === "box") {
        p.rect(x0, y0, x1 - x0, y1 - y0);
        p.globalAlpha = 0.2; p.fill(); p.globalAlpha = 1;
      } else if (shape === "line") { p.moveTo(x0, y0); p.lineTo(x1, y1); } else p.arc(x1, y1, 7 * px, 0, 2 * Math.PI);
      p.stroke();
    }
    if (this.cursor) {
      const { x, y } = this.cursor, arm = 12 * px;
      p.beginPath();
      p.moveTo(x - arm, y); p.lineTo(x + arm, y); p.moveTo(x, y - arm); p.lineTo(x, y + arm);
      p.stroke();
    }
  }
}

// Rooms, areas and walls as the robot knows them.
export function paintDrawn(view, p) {
  const px = 1 / view.scale, { rooms = [], annotations = {} } = view.drawn;
  if (view.showRooms) for (const [index, { name, outline_m: corners = [] }] of rooms.entries()) {
    if (corners.length < 3) continue;
    path(p, corners);
    const chosen = view.chosen.has(name);
    p.fillStyle = p.strokeStyle = `hsl(${hue(index)} 75% 50%)`;
    p.globalAlpha = chosen ? 0.34 : 0.14; p.fill();
    p.globalAlpha = chosen ? 1 : 0.5; p.lineWidth = (chosen ? 2.5 : 1) * px; p.stroke();
    p.globalAlpha = 1;
  }
  p.strokeStyle = p.fillStyle = view.colour.danger;
  for (const { corners_m: corners } of annotations.no_go || []) {
    path(p, corners);
    p.globalAlpha = 0.22; p.fill(); p.globalAlpha = 1;
    p.lineWidth = 1.5 * px; p.stroke();
  }
  p.strokeStyle = view.colour.robot;
  p.lineWidth = 1.5 * px;
  p.setLineDash([6 * px, 4 * px]);
  for (const { corners_m: corners } of annotations.zones || []) { path(p, corners); p.stroke(); }
  p.setLineDash([]);
  p.strokeStyle = view.colour.danger;
  p.lineWidth = 3.5 * px;
  p.lineCap = "round";
  for (const { start_m: a, end_m: b } of annotations.walls || []) { p.beginPath(); p.moveTo(...a); p.lineTo(...b); p.stroke(); }
}

// Names, upright, after everything else.
export function paintNames(view, p) {
  const { rooms = [], annotations = {} } = view.drawn, s = view.scale;
  const put = (words, x, y, colour, size) => {
    const at = [view.width / 2 + (x - view.centre.x) * s, view.height / 2 - (y - view.centre.y) * s];
    p.font = `600 ${size}px system-ui, sans-serif`;
    p.lineWidth = 3; p.strokeStyle = view.colour.card; p.fillStyle = colour;
    p.strokeText(words, ...at); p.fillText(words, ...at);
  };
  p.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
  p.textAlign = "center"; p.textBaseline = "middle"; p.lineJoin = "round";
  if (view.showRooms && s > 14) for (const { name, at_m: [x, y] } of rooms) put(name, x, y, view.colour.ink, 13);
  const middle = (corners, axis) => corners.reduce((sum, corner) => sum + corner[axis], 0) / corners.length;
  for (const [key, colour] of s > 30 ? [["no_go", view.colour.danger], ["zones", view.colour.robot]] : []) {
    for (const { name, corners_m: c } of annotations[key] || []) put(name, middle(c, 0), middle(c, 1), colour, 11);
  }
  p.textAlign = "start"; p.textBaseline = "alphabetic";
}

export function roomAt(view, { x, y }) {
  for (const { name, outline_m: corners = [] } of view.drawn.rooms || []) {
    let inside = false, [ax, ay] = corners.at(-1) || [0, 0];
    for (const [bx, by] of corners) {
      if ((ay > y) !== (by > y) && x < ax + ((y - ay) * (bx - ax)) / (by - ay)) inside = !inside;
      [ax, ay] = [bx, by];
    }
    if (inside) return name;
  }
  return null;
}

function path(p, corners) {
  p.beginPath();
  for (const [x, y] of corners) p.lineTo(x, y);
  p.closePath();
}
