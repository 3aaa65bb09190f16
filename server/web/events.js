// Server-sent events read with fetch(), which can send the Authorization header; EventSource cannot.
// Reconnects with Last-Event-ID after a growing pause, until the stream says `end`.

import {Problem, request, sleep} from "./api.js";

const kSilence_ms = 45000;  // three missed keep-alives: the connection is dead
const kLongestPause_ms = 30000;

// Splits a stream's text into events {event, data, id}; `retry` is told of.
export class EventParser {
  constructor(on_event, on_retry = () => {}) {
    this.on_event = on_event;
    this.on_retry = on_retry;
    this.rest = "";
    this.begin();
  }
  begin() {
    this.event = "message";
    this.data = [];
    this.id = null;
  }
  feed(text) {
    const lines = (this.rest + text).split(/\r\n|\n|\r(?!$)/);
    this.rest = lines.pop();
    lines.forEach((line) => this.take(line));
  }
  take(line) {
    if (line === "") {
      if (this.data.length) this.on_event({event: this.event, data: this.data.join("\n"), id: this.id});
      this.begin();
      return;
    }
    const [, name, value] = /^([^:]*):? ?(.*)$/s.exec(line);
    if (name === "event") this.event = value;
    else if (name === "data") this.data.push(value);
    else if (name === "id") this.id = value;
    else if (name === "retry" && /^\d+$/.test(value)) this.on_retry(Number(value));
  }
}

// Calls on_event(name, parsed data) for every event; on_status("live" | "waiting", problem) when the
// connection comes and goes. Returns when the stream has ended or `signal` aborts; throws Problem if
// there is no use in trying again (404, 401, 403).
export async function follow(path, {on_event, on_status, signal}) {
  let last_id = null;
  let retry_ms = 3000;
  let failures = 0;
  let ended = false;
  const parser_for = () => new EventParser((event) => {
    if (event.id !== null) last_id = event.id;
    if (event.event === "end") ended = true;
    on_event(event.event, JSON.parse(event.data));
  }, (ms) => { retry_ms = ms; });

  while (!signal.aborted && !ended) {
    let problem = null;
    try {
      const headers = {Accept: "text/event-stream"};
      if (last_id !== null) headers["Last-Event-ID"] = last_id;
      await read(path, headers, parser_for(), signal, () => {
        failures = 0;
        on_status("live");
      });
    } catch (error) {
      if (signal.aborted) return;
      problem = error instanceof Problem ? error : new Problem(0, "unreachable", "The connection broke.");
      if (problem.status && !problem.may_pass) throw problem;
    }
    if (ended || signal.aborted) return;
    on_status("waiting", problem);
    const pause_ms = Math.min(kLongestPause_ms, retry_ms * 2 ** failures++);
    const jitter = 0.75 + Math.random() / 2;
    await sleep(Math.max(pause_ms * jitter, 1000 * (problem?.retry_after_s || 0)), signal);
  }
}

async function read(path, headers, parser, signal, on_open) {
  const link = new AbortController();
  const hang_up = () => link.abort();
  signal.addEventListener("abort", hang_up, {once: true});
  let watchdog = setTimeout(hang_up, kSilence_ms);
  try {
    const response = await request("GET", path, {headers, signal: link.signal});
    on_open();
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    for (;;) {
      const {done, value} = await reader.read();
      if (done) return;
      clearTimeout(watchdog);
      watchdog = setTimeout(hang_up, kSilence_ms);
      parser.feed(value);
    }
  } finally {
    clearTimeout(watchdog);
    signal.removeEventListener("abort", hang_up);
    link.abort();
  }
}
