// The page's state, its live line to the robot, and everything around the map.
import { MapView } from "/map.js";

const API = "/api/v1";
const TITLES = {
  none: "Waking up", idle: "Waiting", docked: "On the dock", starting: "Starting", undock: "Leaving the dock",
  look: "Looking round", clean: "Cleaning", return: "Driving home", dock: "Docking", recover: "Freeing itself",
  paused: "Paused", done: "Finished", error: "Needs help", unreachable: "Robot not reachable",
};
const $ = (id) => document.getElementById(id);
const map = new MapView($("map"));
const now = { status: {}, caps: new Map(), tab: "now", socket: null, wait: 500, hello: {} };
window.sweeper = { map, now }; // for a look from the browser's console

const text = (id, value) => { if ($(id).textContent !== value) $(id).textContent = value; };
const make = (tag, attributes = {}, ...children) => {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) key.startsWith("on") ? node.addEventListener(key.slice(2), value) : node.setAttribute(key, value);
  node.append(...children);
  return node;
};
const clock = (s) => (s == null ? "–" : `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`);
const sentence = (words) => (words ? words[0].toUpperCase() + words.slice(1) + (/[.!?]$/.test(words) ? "" : ".") : "");

function toast(words) {
  text("toast", words);
  $("toast").hidden = false;
  clearTimeout(toast.timer);
  toast.timer = setTimeout(() => { $("toast").hidden = true; }, 5000);
}

async function get(path, options) {
  const answer = await fetch(API + path, options);
  if (answer.status === 401) location.reload();
  const body = await answer.json();
  if (!answer.ok) throw new Error(body.reason || body.error || `error ${answer.status}`);
  return body;
}

// ------------------------------------------------------------------ what the robot can do

async function learn() {
  try {
    const { name, capabilities } = await get("/capabilities");
    now.caps = new Map(capabilities.map((capability) => [capability.name, capability]));
    text("name", name);
    document.title = name;
    $("show-camera").hidden = !now.caps.has("camera");
    $("show-landmarks").hidden = !now.caps.has("landmarks");
    $("tab-history").hidden = !now.caps.has("history");
    $("recheck").hidden = !now.caps.has("check");
    buttons();
  } catch (error) { toast(sentence(error.message)); }
}

function buttons() {
  const wanted = [...now.caps.values()].filter(({ button }) => button && button.states.includes(now.status.state));
  wanted.sort((a, b) => (b.button.weight === "main") - (a.button.weight === "main"));
  const key = wanted.map(({ name }) => name).join();
  const place = $("buttons");
  if (place.dataset.key === key) return;
  const focused = place.contains(document.activeElement);
  place.dataset.key = key;
  place.replaceChildren(...wanted.map(({ name, summary, button }) =>
    make("button", { type: "button", id: `do-${name}`, class: button.weight, title: summary, onclick: (event) => press(event.currentTarget, button.path) }, button.label)));
  if (focused) place.querySelector("button")?.focus();
}

async function press(button, path) {
  button.setAttribute("aria-busy", "true");
  try { await get(path.slice(API.length), { method: "POST" }); }
  catch (error) { toast(sentence(error.message)); }
  button.removeAttribute("aria-busy");
}

// ------------------------------------------------------------------ the live line

function connect() {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${API}/live`);
  socket.binaryType = "arraybuffer";
  now.socket = socket;
  let inflating = Promise.resolve(); // tiles are unpacked one after the other, in order
  socket.onopen = () => { now.wait = 500; wish({ landmarks: map.showLandmarks }); };
  socket.onmessage = ({ data }) => {
    if (typeof data === "string") { hear(JSON.parse(data)); return; }
    const bytes = new Uint8Array(data);
    if (bytes[0] === 73) picture(bytes);
    else inflating = inflating.then(() => inflate(bytes.subarray(1))).then((cells) => { map.setTiles(cells); $("nomap").hidden = !map.empty; now.maps = (now.maps || 0) + 1; });
  };
  socket.onclose = async () => {
    light(false);
    setTimeout(connect, now.wait);
    now.wait = Math.min(8000, now.wait * 2);
    const answer = await fetch(`${API}/status`).catch(() => null);
    if (answer?.status === 401) location.reload();
    if (!answer) status({ state: "unreachable", reason: "this page has lost its robot; it keeps trying" });
  };
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function wish(words) { if (now.socket?.readyState === 1) now.socket.send(JSON.stringify(words)); }

function hear(news) {
  if (news.type === "hello") {
    const known = JSON.stringify([now.hello.verbs, now.hello.eyes, now.hello.connected]);
    now.hello = news;
    if (news.radius_m) map.radius = news.radius_m;
    light(news.connected);
    if (JSON.stringify([news.verbs, news.eyes, news.connected]) !== known) learn();
  } else if (news.type === "status") status(news);
  else if (news.type === "pose") { map.setPose(news); speed(news); }
  else if (news.type === "track") map.setTrack(news.first, news.xy_m);
  else if (news.type === "map") { if (news.resolution_m) map.resolution = news.resolution_m; if (!now.caps.has("map")) learn(); }
  else if (news.type === "landmarks") { map.landmarks = news.points; map.ask(); }
}

function light(on) { $("dot").className = `dot ${on ? "on" : "off"}`; }

// ------------------------------------------------------------------ now

function status(news) {
  now.status = news;
  text("state", TITLES[news.state] || news.state);
  text("reason", sentence(news.reason));
  buttons();
  battery(news);
  text("covered", news.covered_m2 == null ? "–" : `${news.covered_m2.toFixed(1)} m²`);
  text("time", clock(news.run_s));
  const total = (news.covered_m2 || 0) + (news.remaining_m2 || 0);
  const known = news.remaining_m2 != null && total > 0 && news.state !== "docked" && news.state !== "idle";
  $("progress").hidden = !known;
  if (known) {
    const pct = Math.round((100 * news.covered_m2) / total);
    $("progress-fill").style.width = `${pct}%`;
    text("progress-text", `${pct} % of the floor that is known so far`);
  }
  if (news.landmarks === undefined && !now.caps.has("landmarks") && news.state === "clean") learnSoon();
  $("map").setAttribute("aria-label", `Map of the floor. ${TITLES[news.state] || news.state}. ${news.covered_m2 == null ? "" : `${news.covered_m2.toFixed(1)} square metres cleaned.`} Arrow keys move, plus and minus zoom, 0 shows everything.`);
  if (now.tab === "health") facts();
}

function learnSoon() {
  if (learnSoon.timer) return;
  learnSoon.timer = setTimeout(() => { learnSoon.timer = 0; learn(); }, 5000);
}

function battery({ battery_pct: pct, charging }) {
  const label = pct == null ? "Battery unknown" : `Battery ${Math.round(pct)} percent${charging ? ", charging" : ""}`;
  if ($("battery").getAttribute("aria-label") === label && $("battery").children.length) return;
  $("battery").setAttribute("aria-label", label);
  const fill = pct == null ? 0 : (pct / 100) * 18;
  $("battery").innerHTML = `<svg viewBox="0 0 26 14" aria-hidden="true"><rect x="1" y="1" width="21" height="12" rx="3.5" fill="none" stroke="currentColor" stroke-width="1.5"/><rect x="23.5" y="4.5" width="2" height="5" rx="1" fill="currentColor"/><rect x="2.5" y="2.5" width="${fill}" height="9" rx="2" fill="${pct != null && pct < 20 ? "var(--danger)" : "var(--ok)"}"/>${charging ? '<path d="M13 2l-4 6h3l-1 4 4-6h-3z" fill="currentColor"/>' : ""}</svg>`;
  $("battery").append(pct == null ? "–" : `${Math.round(pct)} %`);
}

function speed({ v_mps, health }) {
  text("speed", health === "lost" ? "lost" : `${Math.abs(v_mps).toFixed(2)} m/s`);
}

function picture(bytes) {
  const eye = $(bytes[1] === 0 ? "eye-left" : "eye-disparity");
  const url = URL.createObjectURL(new Blob([bytes.subarray(2)], { type: "image/jpeg" }));
  eye.onload = () => URL.revokeObjectURL(url);
  eye.src = url;
}

// ------------------------------------------------------------------ history

async function history() {
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
  const links = [["log.mcap", "Log"], ["trajectory.tum", "Track"], ["map.pgm", "Map file"], ["summary.json", "Figures"]].filter(([file]) => file in files);
  const thumb = make("button", { type: "button", class: "thumb", "aria-label": `Map of ${words}`, onclick: () => view(id, words) });
  if ("map.png" in files) thumb.append(make("img", { src: `${API}/runs/${id}/map.png`, alt: "", loading: "lazy" }));
  else thumb.disabled = true;
  return make("li", { class: "run" }, thumb, make("div", {},
    make("h2", {}, words), make("p", {}, figures.join(" · ") || (summary ? "" : "Still going on, or it was cut off.")),
    make("p", {}, s.state ? sentence(s.reason || s.state) : ""), make("nav", { "aria-label": `Files of ${words}` }, ...links.map(([file, label]) => link(file, label)))));
}

function view(id, words) {
  $("viewer-image").src = `${API}/runs/${id}/map.png`;
  $("viewer-image").alt = `Map of the run of ${words}`;
  $("viewer").showModal();
}

// ------------------------------------------------------------------ health

function facts() {
  const s = now.status;
  const rows = [
    ["Position", { ok: "known well", degraded: "uncertain", lost: "lost" }[s.health] || "–"],
    ["Motor controller", s.link == null ? "–" : s.link ? s.stop_reason ? `holds a stop: ${s.stop_reason}` : "answers" : "silent"],
    ["Battery", s.battery_v == null ? "–" : `${s.battery_v.toFixed(1)} V`],
    ["Processor", s.temperature_c == null ? "no thermometer" : `${s.temperature_c.toFixed(0)} °C`],
    ["Bumper", s.bumped ? "pressed" : "free"],
    ["Software", now.hello.software ? `${now.hello.software}, ${now.hello.body}` : "–"]];
  $("facts").replaceChildren(...rows.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
  const stages = Object.entries(s.stage_ms || {}), most = Math.max(1, ...stages.map(([, ms]) => ms));
  $("stages").replaceChildren(...stages.map(([name, ms]) => {
    const bar = make("i");
    bar.style.width = `${(100 * ms) / most}%`;
    return make("li", {}, make("span", {}, name), make("span", {}, bar), make("b", {}, `${ms.toFixed(1)} ms`));
  }));
}

async function check() {
  try {
    const { checks } = await get("/check");
    $("checks").replaceChildren(...checks.map(({ code, level, cause, remedy }) => make("li", {},
      make("span", { class: level, "aria-hidden": "true" }, { ok: "✓", warn: "!", error: "✕" }[level] || "·"),
      make("span", {}, make("b", {}, `${code}${level === "ok" ? "" : `: ${level}`}`), sentence(cause), remedy ? make("span", { class: "soft" }, ` ${sentence(remedy)}`) : ""))));
  } catch (error) { toast(sentence(error.message)); }
}

// ------------------------------------------------------------------ hands

function open(name) {
  now.tab = name;
  for (const tab of document.querySelectorAll('[role="tab"]')) {
    const chosen = tab.id === `tab-${name}`;
    tab.setAttribute("aria-selected", chosen);
    tab.tabIndex = chosen ? 0 : -1;
    $(tab.getAttribute("aria-controls")).hidden = !chosen;
  }
  if (name === "history") history();
  if (name === "health") { facts(); if (now.caps.has("check")) check(); }
}

const tabs = [...document.querySelectorAll('[role="tab"]')];
for (const [index, tab] of tabs.entries()) {
  tab.addEventListener("click", () => open(tab.id.slice(4)));
  tab.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const visible = tabs.filter((t) => !t.hidden);
    const next = visible[(visible.indexOf(tabs[index]) + step + visible.length) % visible.length];
    next.focus();
    next.click();
  });
}
function toggle(id, change) {
  $(id).addEventListener("click", () => {
    const pressed = $(id).getAttribute("aria-pressed") !== "true";
    $(id).setAttribute("aria-pressed", pressed);
    change(pressed);
  });
}
$("closer").addEventListener("click", () => map.zoom(1.4));
$("farther").addEventListener("click", () => map.zoom(1 / 1.4));
$("fit").addEventListener("click", () => map.fit());
toggle("show-track", (on) => { map.showTrack = on; map.ask(); });
toggle("show-landmarks", (on) => { map.showLandmarks = on; wish({ landmarks: on }); map.ask(); });
toggle("show-camera", (on) => { $("camera").hidden = !on; look(); });
$("recheck").addEventListener("click", check);
$("viewer-close").addEventListener("click", () => $("viewer").close());
$("logout").addEventListener("click", async () => { await get("/logout", { method: "POST" }).catch(() => {}); location.reload(); });
function look() { if (!$("camera").hidden && !document.hidden) wish({ look: ["left", "disparity"] }); }
setInterval(look, 2000);

light(false);
connect();
learn();
