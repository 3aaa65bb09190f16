// The end of the log of a job, refreshed while it is open.

import {poll, request} from "../lib/api.js";
import {h, setText} from "../lib/dom.js";

const kMaxBytes = 32768;
const kLiveMs = 2500;   // between two requests while the job has not ended
const kIdleMs = 20000;  // between two requests after the job has ended

export class LogView {
  constructor(path, signal) {
    this.path = `${path}?max_bytes=${kMaxBytes}`;
    this.signal = signal;
    this.isLive = false;
    this.text = h("pre", {class: "log", tabindex: "0", "aria-label": "The end of the log"});
    this.element =
        h("details", {class: "card log-card"}, h("summary", {}, h("h2", {}, "Log")), this.text);
    this.element.addEventListener(
        "toggle", () => this.element.open ? this.begin() : this.closing?.abort());
  }

  setLive(isLive) {
    if (this.isLive && !isLive && this.element.open)
      setTimeout(() => this.begin(), 500);  // fetches the last lines
    this.isLive = isLive;
  }

  begin() {
    this.closing?.abort();
    const closing = this.closing = new AbortController();
    const signal = closing.signal;
    this.signal.addEventListener("abort", () => closing.abort(), {once: true, signal});
    poll(async () => {
      this.show(await (await request("GET", this.path, {signal})).text());
      return this.isLive ? kLiveMs : kIdleMs;
    }, (problem) => setText(this.text, problem.message), signal);
  }

  show(text) {
    const atEnd = this.text.scrollTop + this.text.clientHeight >= this.text.scrollHeight - 8;
    setText(this.text, text || "The log is empty.");
    if (atEnd) this.text.scrollTop = this.text.scrollHeight;
  }
}
