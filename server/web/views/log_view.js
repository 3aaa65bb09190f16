// The end of the log of a job, refreshed while it is open.

import {poll, request} from "../lib/api.js";
import {h, set_text} from "../lib/dom.js";

const kMaxBytes = 32768;
const kLive_ms = 2500;
const kIdle_ms = 20000;

export class LogView {
  constructor(path, signal) {
    this.path = `${path}?max_bytes=${kMaxBytes}`;
    this.signal = signal;
    this.is_live = false;
    this.text = h("pre", {class: "log", tabindex: "0", "aria-label": "The end of the log"});
    this.element = h("details", {class: "card log-card"}, h("summary", {}, h("h2", {}, "Log")), this.text);
    this.element.addEventListener("toggle", () => this.element.open ? this.begin() : this.closing?.abort());
  }

  set_live(is_live) {
    if (this.is_live && !is_live && this.element.open) setTimeout(() => this.begin(), 500);  // fetches the last lines
    this.is_live = is_live;
  }

  begin() {
    this.closing?.abort();
    const closing = this.closing = new AbortController();
    const signal = closing.signal;
    this.signal.addEventListener("abort", () => closing.abort(), {once: true, signal});
    poll(async () => {
      this.show(await (await request("GET", this.path, {signal})).text());
      return this.is_live ? kLive_ms : kIdle_ms;
    }, (problem) => set_text(this.text, problem.message), signal);
  }

  show(text) {
    const at_end = this.text.scrollTop + this.text.clientHeight >= this.text.scrollHeight - 8;
    set_text(this.text, text || "The log is empty.");
    if (at_end) this.text.scrollTop = this.text.scrollHeight;
  }
}
