// Server-sent events read with fetch(), because EventSource cannot send the Authorization header.
// Reconnects with Last-Event-ID after growing pauses, until the event `end`.

import {Problem, request, sleep} from "./api.js";

const kIdleTimeout_ms = 45000;  // three missed keep-alives
const kMaxPause_ms = 30000;

// Parses the text of a stream into events {event, data, id}.
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
    lines.forEach((line) => this.parse_line(line));
  }
  parse_line(line) {
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

// Calls on_event(name, parsed data) for every event, and on_status("live" | "waiting", problem) when
// the connection opens and closes. Returns when the stream has ended or `signal` aborts; throws Problem
// if a retry is useless (401, 403, 404).
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
      problem = error instanceof Problem ? error : new Problem(0, "unreachable", "The connection was lost.");
      if (problem.status && !problem.is_transient) throw problem;
    }
    if (ended || signal.aborted) return;
    on_status("waiting", problem);
    const pause_ms = Math.min(kMaxPause_ms, retry_ms * 2 ** failures++);
    const jitter = 0.75 + Math.random() / 2;
    await sleep(Math.max(pause_ms * jitter, 1000 * (problem?.retry_after_s || 0)), signal);
  }
}

async function read(path, headers, parser, signal, on_open) {
  const connection = new AbortController();
  const close = () => connection.abort();
  signal.addEventListener("abort", close, {once: true});
  let watchdog = setTimeout(close, kIdleTimeout_ms);
  try {
    const response = await request("GET", path, {headers, signal: connection.signal});
    on_open();
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    for (;;) {
      const {done, value} = await reader.read();
      if (done) return;
      clearTimeout(watchdog);
      watchdog = setTimeout(close, kIdleTimeout_ms);
      parser.feed(value);
    }
  } finally {
    clearTimeout(watchdog);
    signal.removeEventListener("abort", close);
    connection.abort();
  }
}
