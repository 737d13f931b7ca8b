// The tab "Map": rooms, areas, walls, kept versions, and what is being drawn.
import { $, button, make, post, refresh, text, toast } from "/kit.js";
import { KINDS, hue } from "/sketch.js";

export class Rooms {
  constructor(map, has) {
    this.map = map;
    this.has = has; // whether the robot has a capability
    map.onSketch = () => this.sketching();
    map.onRoom = (name) => this.choose(name);
    $("draw-zones").addEventListener("click", () => this.draw("zones"));
    $("draw-no-go").addEventListener("click", () => this.draw("no-go"));
    $("draw-wall").addEventListener("click", () => this.draw("wall"));
    $("draw-go-to").addEventListener("click", () => this.draw("go-to"));
    $("rooms-split").addEventListener("click", () => this.draw("split"));
    $("sketch-save").addEventListener("submit", (event) => this.save(event));
    $("sketch-done").addEventListener("click", () => this.finish());
    $("sketch-cancel").addEventListener("click", () => map.sketch.stop());
    $("rooms-clean").addEventListener("click", async () => { if (await post("/rooms/clean", { rooms: [...map.chosen] })) this.forget(); });
    $("rooms-join").addEventListener("click", async () => { const [room, other] = map.chosen; if (await post("/rooms/join", { room, other })) this.forget(); });
    $("rooms-name").addEventListener("submit", (event) => this.name(event));
    $("drawings-undo").addEventListener("click", () => post("/drawings/undo"));
    $("drawings-keep").addEventListener("submit", (event) => this.keep(event));
  }

  // What this robot has.
  learn() {
    for (const [id, name] of [["draw-zones", "zones"], ["draw-no-go", "no_go"], ["draw-wall", "walls"], ["draw-go-to", "go_to"], ["rooms-box", "rooms"], ["drawings-box", "drawings"]]) $(id).hidden = !this.has(name);
  }

  show(drawn) {
    this.map.drawn = drawn;
    const names = (drawn.rooms || []).map(({ name }) => name);
    for (const name of this.map.chosen) if (!names.includes(name)) this.map.chosen.delete(name);
    this.list();
    this.map.ask();
  }

  choose(name) {
    const { chosen } = this.map;
    chosen.has(name) ? chosen.delete(name) : chosen.add(name);
    this.list();
    this.map.ask();
  }

  forget() { this.map.chosen.clear(); this.list(); this.map.ask(); }

  list() {
    const { rooms = [], annotations = {}, snapshots = [] } = this.map.drawn, { chosen } = this.map;
    refresh($("rooms"), [rooms.map(({ name, area_m2 }) => [name, area_m2])], () => rooms.map(({ name, area_m2 }, index) => {
      const swatch = make("i", { "aria-hidden": "true" });
      swatch.style.background = `hsl(${hue(index)} 75% 50%)`;
      return make("li", {}, make("label", {}, make("input", { type: "checkbox", id: `room-${index}`, "data-name": name, onchange: () => this.choose(name) }), swatch, make("span", {}, name), make("span", { class: "soft" }, `${area_m2.toFixed(1)} m²`)));
    }));
    for (const box of $("rooms").querySelectorAll("input")) box.checked = chosen.has(box.dataset.name);
    $("norooms").hidden = rooms.length > 0;
    $("rooms-clean").disabled = chosen.size === 0;
    text("rooms-clean", chosen.size ? `Clean ${chosen.size} room${chosen.size > 1 ? "s" : ""}` : "Clean rooms");
    $("rooms-join").disabled = chosen.size !== 2;
    $("rooms-split").disabled = rooms.length === 0;
    $("rooms-name").hidden = chosen.size !== 1;
    const marks = [["no-go", "no_go"], ["walls", "walls"], ["zones", "zones"]].flatMap(([kind, key]) => (annotations[key] || []).map(({ name }) => [kind, name]));
    refresh($("marks"), marks, () => marks.map(([kind, name]) => make("li", {}, make("span", {}, name), kind === "zones"
      ? button("Clean", () => post("/zones/clean-named", { zones: [name] }), { class: "quiet small", "aria-label": `Clean ${name}` })
      : make("span", { class: "soft" }, kind === "walls" ? "virtual wall" : "no-go area"),
      button("Remove", () => post(`/${kind}/remove`, { name }), { class: "quiet small", "aria-label": `Remove ${name}` }))));
    $("nomarks").hidden = marks.length > 0;
    refresh($("snapshots"), snapshots, () => snapshots.map((name) => make("li", {}, make("span", {}, name), make("span"),
      button("Restore", () => post("/drawings/restore", { name }), { class: "quiet small", "aria-label": `Restore ${name}` }))));
  }

  async name(event) {
    event.preventDefault();
    const field = $("room-name"), [room] = this.map.chosen;
    if (await post("/rooms/name", { room, name: field.value.trim() })) { field.value = ""; this.forget(); }
  }

  async keep(event) {
    event.preventDefault();
    const field = $("snapshot-name");
    if (await post("/drawings/keep", { name: field.value.trim() })) field.value = "";
  }

  // ---------------------------------------------------------------- drawing

  draw(kind) {
    this.map.sketch.begin(kind);
    this.map.canvas.focus({ preventScroll: true });
    $("map").scrollIntoView({ block: "nearest" });
  }

  sketching() {
    const { kind, shapes } = this.map.sketch;
    $("sketchbar").hidden = !kind;
    document.body.classList.toggle("sketching", Boolean(kind));
    if (!kind) return;
    text("sketch-hint", `${KINDS[kind].hint} With the keyboard: arrows and Enter.`);
    const words = { zones: shapes.length > 1 ? `Clean ${shapes.length} zones` : "Clean the zone", "no-go": "Keep it out", wall: "Put the wall up", split: "Split", "go-to": "Go there" }[kind];
    text("sketch-done", words);
    $("sketch-done").disabled = shapes.length === 0;
    $("sketch-save").hidden = kind !== "zones" || shapes.length !== 1;
  }

  // Keep the zone under a name; it can be cleaned from the list then.
  async save(event) {
    event.preventDefault();
    const { sketch } = this.map, [[x0, y0, x1, y1]] = sketch.shapes, field = $("sketch-name");
    if (await post("/zones/add", { name: field.value.trim(), corners_m: [[x0, y0], [x1, y1]] })) { field.value = ""; sketch.stop(); }
  }

  async finish() {
    const { sketch } = this.map, { kind, shapes } = sketch;
    if (!shapes.length) { toast("Draw something first."); return; }
    const [x_m, y_m, end_x_m, end_y_m] = shapes.at(-1), line = { x_m, y_m, end_x_m, end_y_m };
    const done = await {
      zones: () => post("/zones/clean", { zones_m: shapes }),
      "no-go": () => post("/no-go/add", { corners_m: [[x_m, y_m], [end_x_m, end_y_m]] }),
      wall: () => post("/walls/add", line),
      split: () => post("/rooms/split", line),
      "go-to": () => post("/go-to", { x_m: end_x_m, y_m: end_y_m }),
    }[kind]();
    if (done) sketch.stop();
  }
}
