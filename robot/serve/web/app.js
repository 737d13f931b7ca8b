// The page's state, its live line to the robot, and everything around the map.
import { $, API, button as pressable, clock, get, make, post, sentence, text, toast } from "/kit.js";
import { Calibrate } from "/calibrate.js";
import { Drive } from "/drive.js";
import { fan } from "/fan.js";
import { check, facts, fleet, history, recent, releases } from "/health.js";
import { MapView } from "/map.js";
import { Plan } from "/plan.js";
import { Rooms } from "/rooms.js";

const TITLES = {
  none: "Waking up", idle: "Waiting", docked: "On the dock", starting: "Starting", undock: "Leaving the dock",
  look: "Looking round", clean: "Cleaning", return: "Driving home", dock: "Docking", recover: "Freeing itself",
  paused: "Paused", done: "Finished", error: "Needs help", unreachable: "Robot not reachable",
  spot: "Cleaning a spot", zone: "Cleaning a zone", room: "Cleaning rooms", goto: "On its way", manual: "Driven by hand",
  charge: "Charging", lifted: "In somebody's hands", lost: "Finding out where it is", retrace: "Going back its way", "wheel-only": "Feeling its way home",
};
const map = new MapView($("map"));
const now = { status: {}, caps: new Map(), tab: "now", socket: null, wait: 500, hello: {} };
window.sweeper = { map, now }; // for a look from the browser's console

const has = (name) => now.caps.has(name);
const rooms = new Rooms(map, has), plan = new Plan(has), drive = new Drive(wish), calibrate = new Calibrate(has, wish);

// ------------------------------------------------------------------ what the robot can do

async function learn() {
  try {
    const { name, capabilities } = await get("/capabilities");
    now.caps = new Map(capabilities.map((capability) => [capability.name, capability]));
    text("name", name);
    document.title = name;
    for (const [id, needed] of [["show-camera", "camera"], ["show-landmarks", "landmarks"], ["tab-history", "history"], ["recheck", "check"], ["checks-title", "check"], ["drive-box", "manual"], ["bundle", "bundle"], ["fleet-box", "fleet"], ["update-box", "update"], ["recent-box", "logs"]]) $(id).hidden = !has(needed);
    $("tab-map").hidden = !["zones", "rooms", "no_go", "walls", "go_to"].some(has);
    $("tab-plan").hidden = !["schedules", "consumables"].some(has);
    $("show-rooms").hidden = !has("rooms");
    rooms.learn();
    plan.learn();
    fan(map.drawn.fan, has);
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
    pressable(button.label, () => post(button.path.slice(API.length), {}, { quiet: true }), { id: `do-${name}`, class: button.weight, title: summary })));
  if (focused) place.querySelector("button")?.focus();
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
    drive.stop();
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

// Whether there is a line, and it takes what is said at once.
function wish(words) {
  const open = now.socket?.readyState === 1 && now.socket.bufferedAmount < 2000;
  if (open) now.socket.send(JSON.stringify(words));
  return open;
}

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
  else if (news.type === "map") { if (news.resolution_m) map.resolution = news.resolution_m; if (!has("map")) learn(); }
  else if (news.type === "drawn") { rooms.show(news); plan.show(news); fan(news.fan, has); }
  else if (news.type === "drove") drive.hear(news);
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
  if (news.landmarks === undefined && !has("landmarks") && news.state === "clean") learnSoon();
  $("map").setAttribute("aria-label", `Map of the floor. ${TITLES[news.state] || news.state}. ${news.covered_m2 == null ? "" : `${news.covered_m2.toFixed(1)} square metres cleaned.`} Arrow keys move, plus and minus zoom, 0 shows everything.`);
  if (now.tab === "health") facts(news, now.hello);
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
  for (const id of bytes[1] === 0 ? ["eye-left", "cal-eye"] : ["eye-disparity"]) {
    const eye = $(id), url = URL.createObjectURL(new Blob([bytes.subarray(2)], { type: "image/jpeg" }));
    eye.onload = () => URL.revokeObjectURL(url);
    eye.src = url;
  }
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
  if (name === "history") { history(); if (has("logs")) recent(); }
  if (name === "plan") plan.open();
  if (name === "health") { facts(now.status, now.hello); calibrate.tell(); if (has("check")) check(); if (has("fleet")) fleet(); if (has("update")) releases(); }
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
toggle("show-rooms", (on) => { map.showRooms = on; map.ask(); });
toggle("show-landmarks", (on) => { map.showLandmarks = on; wish({ landmarks: on }); map.ask(); });
toggle("show-camera", (on) => { $("camera").hidden = !on; map.cover($("camera")); look(); });
for (const tool of document.querySelectorAll(".tools button")) tool.title = tool.getAttribute("aria-label");
$("drive-box").addEventListener("toggle", () => { if ($("drive-box").open) $("drive-box").scrollIntoView({ block: "end" }); });
$("recheck").addEventListener("click", check);
$("viewer-close").addEventListener("click", () => $("viewer").close());
$("logout").addEventListener("click", async () => { await get("/logout", { method: "POST" }).catch(() => {}); location.reload(); });
function look() { if (!$("camera").hidden && !document.hidden) wish({ look: ["left", "disparity"] }); }
setInterval(look, 2000);

light(false);
connect();
learn();
