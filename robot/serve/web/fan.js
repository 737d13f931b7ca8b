// How hard the fan works: one of the levels that the robot has.
import { $, make, post, refresh, sentence } from "/kit.js";

let level = ""; // as the robot last told it

export function fan({ level: told = "", levels = [] } = {}, has) {
  level = told;
  $("fan-box").hidden = !has("fan") || levels.length === 0;
  refresh($("fan"), levels, () => levels.map((name) => make("label", {},
    make("input", { type: "radio", name: "fan", value: name, id: `fan-${name}`, onchange: () => choose(name) }),
    make("span", {}, sentence(name).slice(0, -1)))));
  mark();
}

async function choose(name) { if (!await post("/fan", { level: name })) mark(); }

function mark() { for (const input of $("fan").querySelectorAll("input")) input.checked = input.value === level; }
