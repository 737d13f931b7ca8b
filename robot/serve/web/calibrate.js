// The calibration wizard: what the robot sees of the board, where it has been, how far rows are apart.
import { $, button, get, post, sentence, text, toast } from "/kit.js";

const OFTEN = 10; // corners in a cell
const EVERY_MS = 700, LOOK_MS = 2000;

export class Calibrate {
  constructor(has, wish) {
    this.has = has;
    this.wish = wish;
    this.timer = 0;
    this.looked = 0;
    for (let k = 0; k < 48; k++) $("cal-cells").append(document.createElement("i"));
    $("cal-open").addEventListener("click", () => this.open());
    $("cal-form").addEventListener("submit", async (event) => { event.preventDefault(); if (await post("/calibration/begin", { board: $("cal-board").value.trim() }, { quiet: true })) this.show(); });
    $("cal-buttons").append(
      button("Save the result", async () => { if (await post("/calibration/save", {}, { quiet: true })) await this.show(); }, { id: "cal-save", class: "quiet main", disabled: true }),
      button("Close", () => $("calibrate").close(), { id: "cal-close", class: "quiet" }));
    $("calibrate").addEventListener("close", () => this.end());
  }

  // What the tab "Health" says of it.
  async tell() {
    $("cal-box").hidden = !this.has("calibrate");
    if (!this.has("calibrate")) return;
    try {
      const { possible, reason } = await get("/calibration/views");
      $("cal-open").hidden = !possible;
      text("cal-why-not", possible ? "After a knock, or when distances are wrong." : sentence(reason));
    } catch (error) { toast(sentence(error.message)); }
  }

  open() {
    $("calibrate").showModal();
    this.timer = setInterval(() => this.show(), EVERY_MS);
    this.show();
  }

  end() {
    clearInterval(this.timer);
    this.timer = 0;
    if (this.running) post("/calibration/end", {}, { quiet: true });
  }

  async show() {
    if (performance.now() - this.looked > LOOK_MS) { this.looked = performance.now(); this.wish({ look: ["left"] }); }
    let s;
    try { s = await get("/calibration/views"); } catch (error) { text("cal-seen", sentence(error.message)); return; }
    this.running = s.running;
    text("cal-seen", sentence(s.running ? s.seen : s.reason));
    text("cal-views", `${s.views ?? 0} of ${s.wanted}`);
    text("cal-covered", s.covered_pct == null ? "–" : `${Math.round(s.covered_pct)} %`);
    const good = rate("cal-rms", s.rms_px, s.max_rms_px), straight = rate("cal-rows", s.epipolar_unseen_px, s.max_epipolar_px);
    text("cal-advice", s.saved ? `Saved. Set camera.calibration = "${s.saved}" in /etc/sweeper/robot.toml, then: sudo systemctl restart sweeper`
      : s.problem ? sentence(s.problem) : s.views ? sentence(s.advice || "the image is covered well") : "");
    const counts = (s.counts || []).flat();
    for (const [k, cell] of [...$("cal-cells").children].entries()) cell.className = counts[k] >= OFTEN ? "often" : counts[k] ? "seldom" : "";
    $("cal-cells").setAttribute("aria-label", `The board has been in ${counts.filter((n) => n).length} of 48 parts of the image`);
    $("cal-save").disabled = !(s.running && good && straight);
  }
}

// A figure in pixels and its limit; true if it is within.
function rate(id, px, most) {
  text(id, px == null ? "–" : `${px.toFixed(2)} px`);
  const fits = px != null && px <= most;
  $(id).className = px == null ? "" : fits ? "ok" : "error";
  return fits;
}
