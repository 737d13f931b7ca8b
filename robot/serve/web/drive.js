// Driving by hand: the page speaks while a control is held, and stops at once when it is let go,
// when the page loses focus, or when its line ends. The server and the robot watch, too.
import { $, sentence, toast } from "/kit.js";

const EVERY_MS = 100;
const WAYS = { forward: [1, 0], back: [-1, 0], left: [0, 1], right: [0, -1] };
const KEYS = { ArrowUp: "forward", ArrowDown: "back", ArrowLeft: "left", ArrowRight: "right", w: "forward", s: "back", a: "left", d: "right" };
const YAW_RATE_RADPS = 1.0;

export class Drive {
  constructor(say) {
    this.say = say; // hands words to the robot; false when there is no line
    this.held = new Set();
    this.timer = 0;
    this.number = this.seen = 0;
    for (const button of document.querySelectorAll("#pad button")) {
      const way = button.dataset.way;
      button.addEventListener("pointerdown", (event) => { event.preventDefault(); button.setPointerCapture(event.pointerId); button.focus(); this.hold(way); });
      for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(name, () => this.release(way));
      button.addEventListener("keydown", (event) => { if (event.key === " " || event.key === "Enter") { event.preventDefault(); if (!event.repeat) this.hold(way); } });
      button.addEventListener("keyup", (event) => { if (event.key === " " || event.key === "Enter") this.release(way); });
      button.addEventListener("contextmenu", (event) => event.preventDefault());
    }
    $("pad").addEventListener("keydown", (event) => { const way = KEYS[event.key]; if (way) { event.preventDefault(); if (!event.repeat) this.hold(way); } });
    $("pad").addEventListener("keyup", (event) => { if (KEYS[event.key]) this.release(KEYS[event.key]); });
    $("pad").addEventListener("focusout", (event) => { if (!$("pad").contains(event.relatedTarget)) this.stop(); });
    window.addEventListener("blur", () => this.stop());
    window.addEventListener("pagehide", () => this.stop());
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.stop(); });
  }

  hold(way) {
    this.held.add(way);
    this.mark();
    if (!this.timer) { this.number = this.seen = 0; this.timer = setInterval(() => this.speak(), EVERY_MS); }
    this.speak();
  }

  release(way) {
    this.held.delete(way);
    if (this.timer && this.held.size === 0) this.stop();
    this.mark();
  }

  stop() {
    this.held.clear();
    this.mark();
    if (!this.timer) return;
    clearInterval(this.timer);
    this.timer = 0;
    this.say({ drive: null, n: 0, seen: 0 });
  }

  speak() {
    const most = Number($("pace").value);
    let v = 0, turn = 0;
    for (const way of this.held) { v += WAYS[way][0]; turn += WAYS[way][1]; }
    this.number += 1;
    const line = this.say({ drive: [v * most, Math.sign(turn) * YAW_RATE_RADPS], n: this.number, seen: this.seen });
    if (!line) this.stop();
  }

  hear({ n, refused }) {
    this.seen = Math.max(this.seen, n);
    if (!refused || !this.timer) return;
    this.stop();
    toast(sentence(refused));
  }

  mark() { for (const button of document.querySelectorAll("#pad button")) button.classList.toggle("held", this.held.has(button.dataset.way)); }
}
