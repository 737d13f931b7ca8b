// The tab "Plan": when the robot cleans by itself, and what wears.
import { $, button, get, make, post, refresh, sentence, toast } from "/kit.js";

const DAYS = { mon: "Mon", tue: "Tue", wed: "Wed", thu: "Thu", fri: "Fri", sat: "Sat", sun: "Sun" };
const WHAT = { start: "the whole home", dock: "back to the dock" };

export class Plan {
  constructor(has) {
    this.has = has;
    this.rooms = "";
    for (const [day, label] of Object.entries(DAYS)) $("days").append(make("label", {}, make("input", { type: "checkbox", value: day, id: `day-${day}` }), make("span", {}, label)));
    $("schedule-form").addEventListener("submit", (event) => this.add(event));
  }

  learn() { $("schedule-box").hidden = !this.has("schedules"); $("parts-box").hidden = !this.has("consumables"); }

  async open() {
    if (!this.has("schedules")) return;
    try { this.list((await get("/schedules")).entries); } catch (error) { toast(sentence(error.message)); }
  }

  list(entries) {
    refresh($("schedule"), entries.map(({ days, at, words }) => [days, at, words]), () => entries.map(({ days, at, words }, index) => {
      const when = days.length === 7 ? "Every day" : days.map((day) => DAYS[day]).join(", ");
      const what = WHAT[words.join(" ")] || words.slice(0, 2).join(" ") === "clean rooms" && words.slice(2).join(", ") || words.join(" ");
      return make("li", {}, make("span", {}, make("b", {}, at), ` ${when}`), make("span", { class: "soft" }, what),
        button("Remove", async () => { await post("/schedules/remove", { number: index + 1 }); await this.open(); }, { class: "quiet small", "aria-label": `Remove ${at} ${when}` }));
    }));
    $("noschedule").hidden = entries.length > 0;
  }

  async add(event) {
    event.preventDefault();
    const chosen = (place) => [...$(place).querySelectorAll("input:checked")].map(({ value }) => value);
    const days = chosen("days"), rooms = chosen("schedule-rooms");
    if (!days.length) { toast("Choose a day first."); return; }
    const entry = { days: days.join(","), time: $("schedule-time").value };
    if (rooms.length) entry.words = ["clean rooms", ...rooms];
    if (await post("/schedules/add", entry)) { $("schedule-form").reset(); await this.open(); }
  }

  // Rooms to choose from, and the wear of parts, as the live line tells them.
  show({ rooms = [], parts = {} }) {
    const names = rooms.map(({ name }) => name);
    refresh($("schedule-rooms"), names, () => names.map((name, index) => make("label", {}, make("input", { type: "checkbox", value: name, id: `plan-room-${index}` }), make("span", {}, name))));
    $("schedule-rooms-box").hidden = names.length === 0;
    const { hours = {}, life_h: life = {} } = parts;
    refresh($("parts"), parts, () => Object.keys(hours).map((part) => {
      const left = Math.max(0, 1 - hours[part] / life[part]), bar = make("i", left < 0.1 ? { class: "low" } : {});
      bar.style.width = `${100 * left}%`;
      return make("li", {}, make("span", {}, part[0].toUpperCase() + part.slice(1)), make("span", { class: "bar-of" }, bar), make("b", {}, `${Math.round(100 * left)} %`),
        button("Cared for", () => post("/consumables/reset", { part }), { class: "quiet small", "aria-label": `${part}: cared for` }));
    }));
  }
}
