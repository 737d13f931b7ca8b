// The tabs "Runs" and "Health": what was, and how the robot is.
import { $, API, clock, get, make, refresh, sentence, text, toast } from "/kit.js";

export async function history() {
  try {
    const { runs } = await get("/runs?limit=30");
    $("noruns").hidden = runs.length > 0;
    $("runs").replaceChildren(...runs.map(card));
  } catch (error) { toast(sentence(error.message)); }
}

function card({ id, files, summary }) {
  const when = id.match(/^(\d{4})(\d{2})(\d{2})-(\d{2})(\d{2})(\d{2})/).slice(1).map(Number);
  const date = new Date(Date.UTC(when[0], when[1] - 1, ...when.slice(2)));
  const words = date.toLocaleString([], { weekday: "short", day: "numeric", month: "short", hour: "2-digit", minute: "2-digit" });
  const s = summary || {};
  const figures = [
    s.covered_m2 != null && `${s.covered_m2.toFixed(1)} m²`, s.covered_pct != null && `${s.covered_pct.toFixed(0)} % covered`,
    s.duration_s != null && `${clock(s.duration_s)} min`, s.path_m != null && `${s.path_m.toFixed(0)} m driven`].filter(Boolean);
  const link = (file, label) => make("a", { href: `${API}/runs/${id}/${file}`, "aria-label": `${label} of ${words}` }, label);
  const saved = Object.keys(files).filter((file) => /^(before-)?log-\d/.test(file)).map((file, index) => [file, `Log ${index + 1}`]);
  const links = [["log.mcap", "Log"], ...saved, ["trajectory.tum", "Track"], ["map.pgm", "Map file"], ["summary.json", "Figures"]].filter(([file]) => file in files);
  const thumb = make("button", { type: "button", class: "thumb", "aria-label": `Map of ${words}`, onclick: () => view(id, words) });
  if ("map.png" in files) thumb.append(make("img", { src: `${API}/runs/${id}/map.png`, alt: "", loading: "lazy" }));
  else { thumb.disabled = true; thumb.append(make("span", {}, "no map yet")); }
  return make("li", { class: "run" }, thumb, make("div", {},
    make("h2", {}, words), make("p", {}, figures.join(" · ") || (summary ? "" : "The log since it was switched on: still growing, or cut off.")),
    make("p", {}, s.state ? sentence(s.reason || s.state) : ""), make("nav", { "aria-label": `Files of ${words}` }, ...links.map(([file, label]) => link(file, label)))));
}

// Segments of the log that the robot keeps in memory.
export async function recent() {
  try {
    const { segments } = await get("/logs");
    $("recent").replaceChildren(...segments.map(({ name, bytes, ended_s: end }) => {
      const until = new Date(1000 * end).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
      return make("li", {}, make("span", {}, `until ${until}`), make("span", { class: "soft" }, `${(bytes / 1e6).toFixed(1)} MB`),
        make("a", { href: `${API}/logs/${name}`, "aria-label": `Log until ${until}` }, "Log"));
    }));
  } catch (error) { toast(sentence(error.message)); }
}

export function view(id, words) {
  $("viewer-image").src = `${API}/runs/${id}/map.png`;
  $("viewer-image").alt = `Map of the run of ${words}`;
  $("viewer").showModal();
}

export function facts(s, hello) {
  const rows = [
    ["Position", { ok: "known well", degraded: "uncertain", lost: "lost" }[s.health] || "–"],
    ["Motor controller", s.link == null ? "–" : s.link ? s.stop_reason ? `holds a stop: ${s.stop_reason}` : "answers" : "silent"],
    ["Battery", s.battery_v == null ? "–" : `${s.battery_v.toFixed(1)} V`],
    ["Processor", s.temperature_c === undefined ? "–" : s.temperature_c === null ? "no thermometer" : `${s.temperature_c.toFixed(0)} °C`],
    ["Bumper", s.bumped == null ? "–" : s.bumped ? "pressed" : "free"],
    ["Software", hello.software ? `${hello.software}, ${hello.body}` : "–"]];
  $("facts").replaceChildren(...rows.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
  const stages = Object.entries(s.stage_ms || {}), most = Math.max(1, ...stages.map(([, ms]) => ms));
  $("stages").replaceChildren(...stages.map(([name, ms]) => {
    const bar = make("i");
    bar.style.width = `${(100 * ms) / most}%`;
    return make("li", {}, make("span", {}, name), make("span", {}, bar), make("b", {}, `${ms.toFixed(1)} ms`));
  }));
  const sum = stages.reduce((all, [, ms]) => all + ms, 0);
  text("stages-sum", stages.length ? `${sum.toFixed(0)} ms together; ten frames a second leave 100 ms.` : "No frame has been seen yet.");
}

// What is installed, and what to type: this page itself installs nothing.
export async function releases() {
  try {
    const { current, previous, trial_starts: starts, update, rollback } = await get("/update");
    const rows = [["Runs now", starts == null ? current : `${current}, on trial (${starts} starts)`], ["Way back", previous || "none"]];
    $("slots").replaceChildren(...rows.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
    text("update-words", update);
    text("rollback-words", rollback);
    $("rollback").hidden = !rollback;
  } catch (error) { toast(sentence(error.message)); }
}

export async function check() {
  try {
    const { checks } = await get("/check");
    $("checks").replaceChildren(...checks.map(({ code, level, cause, remedy }) => make("li", {},
      make("span", { class: level, "aria-hidden": "true" }, { ok: "✓", warn: "!", error: "✕" }[level] || "·"),
      make("span", {}, make("b", {}, `${code}${level === "ok" ? "" : `: ${level}`}`), sentence(cause), remedy ? make("span", { class: "soft" }, ` ${sentence(remedy)}`) : ""))));
  } catch (error) { toast(sentence(error.message)); }
}

// Other robots on the same broker.
export async function fleet() {
  try {
    const { robots } = await get("/fleet");
    refresh($("fleet"), robots, () => robots.map(({ id, name, state, reason, battery_pct: pct, online }) => make("li", { class: online === false ? "away" : "" },
      make("span", {}, make("b", {}, name || id), ` ${id}`), make("span", { class: "soft" }, online === false ? "not reachable" : sentence(reason || state)), make("b", {}, pct == null ? "–" : `${Math.round(pct)} %`))));
    $("fleet-count").textContent = `${robots.length} robots, ${robots.filter(({ online }) => online !== false).length} reachable`;
  } catch (error) { toast(sentence(error.message)); }
}
