// What every part of the page needs: the API, nodes, words.
export const API = "/api/v1";
export const $ = (id) => document.getElementById(id);
export const text = (id, value) => { if ($(id).textContent !== value) $(id).textContent = value; };

export function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (value === true) node.setAttribute(key, "");
    else if (value !== false && value != null) node.setAttribute(key, value);
  }
  node.append(...children.filter((child) => child != null && child !== false));
  return node;
}

export const clock = (s) => (s == null ? "–" : `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`);
// With a capital and a full stop; names such as camera.calibration stay as they are.
export const sentence = (words) => (words ? (/^[a-z_]+[._/]\w/.test(words) ? words[0] : words[0].toUpperCase()) + words.slice(1) + (/[.!?]$/.test(words) ? "" : ".") : "");

export function toast(words, good = false) {
  text("toast", words);
  $("toast").classList.toggle("good", good);
  $("toast").hidden = false;
  clearTimeout(toast.timer);
  toast.timer = setTimeout(() => { $("toast").hidden = true; }, 5000);
}

export async function get(path, options) {
  const answer = await fetch(API + path, options);
  if (answer.status === 401) location.reload();
  const body = await answer.json();
  if (!answer.ok) throw new Error(body.reason || body.error || `error ${answer.status}`);
  return body;
}

// Ask for something; true if the robot does it. What it says is shown either way.
export async function post(path, body = {}, { quiet = false } = {}) {
  try {
    const told = await get(path, { method: "POST", body: JSON.stringify(body), headers: { "content-type": "application/json" } });
    if (!quiet) toast(sentence(told.reason), true);
    return true;
  } catch (error) {
    toast(sentence(error.message));
    return false;
  }
}

// A button that tells while it works.
export function button(label, press, attributes = {}) {
  return make("button", { type: "button", ...attributes, onclick: async (event) => {
    const node = event.currentTarget;
    node.setAttribute("aria-busy", "true");
    await press(node);
    node.removeAttribute("aria-busy");
  } }, label);
}

// Redraw a list only when it has changed, so that focus and scrolling stay.
export function refresh(place, key, nodes) {
  const words = JSON.stringify(key);
  if (place.dataset.key === words) return;
  const inside = place.contains(document.activeElement) ? document.activeElement.id : "";
  place.dataset.key = words;
  place.replaceChildren(...nodes());
  if (inside) $(inside)?.focus();
}
