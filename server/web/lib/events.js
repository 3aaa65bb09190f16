// Reads server-sent events with fetch(), because EventSource cannot send the Authorization header.
// If the connection is lost, reconnects with Last-Event-ID until the event `end` arrives. The
// pauses between attempts grow.

import {Problem, request, sleep} from "./api.js";

const kIdleTimeoutMs = 45000;  // three missed keep-alives
const kMaxPauseMs = 30000;

// Parses the text of a stream into events {event, data, id}.
export class EventParser {
  constructor(onEvent, onRetry = () => {}) {
    this.onEvent = onEvent;
    this.onRetry = onRetry;
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
    lines.forEach((line) => this.parseLine(line));
  }
  parseLine(line) {
    if (line === "") {
      if (this.data.length)
        this.onEvent({event: this.event, data: this.data.join("\n"), id: this.id});
      this.begin();
      return;
    }
    const [, name, value] = /^([^:]*):? ?(.*)$/s.exec(line);
    if (name === "event") this.event = value;
    else if (name === "data") this.data.push(value);
    else if (name === "id") this.id = value;
    else if (name === "retry" && /^\d+$/.test(value)) this.onRetry(Number(value));
  }
}

// Calls onEvent(name, parsed data) for every event. Calls onStatus("live" | "waiting", problem)
// when the connection opens and when it closes. Resolves when the stream has ended or `signal`
// aborts. Throws Problem if a retry is useless (401, 403, 404).
export async function follow(path, {onEvent, onStatus, signal}) {
  let lastId = null;
  let retryMs = 3000;
  let failures = 0;
  let ended = false;
  const parserFor = () => new EventParser(
      (event) => {
        if (event.id !== null) lastId = event.id;
        if (event.event === "end") ended = true;
        onEvent(event.event, JSON.parse(event.data));
      },
      (ms) => {
        retryMs = ms;
      });

  while (!signal.aborted && !ended) {
    let problem = null;
    try {
      const headers = {Accept: "text/event-stream"};
      if (lastId !== null) headers["Last-Event-ID"] = lastId;
      await read(path, headers, parserFor(), signal, () => {
        failures = 0;
        onStatus("live");
      });
    } catch (error) {
      if (signal.aborted) return;
      problem = error instanceof Problem ?
          error :
          new Problem(0, "unreachable", "The connection was lost.");
      if (problem.status && !problem.isTransient) throw problem;
    }
    if (ended || signal.aborted) return;
    onStatus("waiting", problem);
    const pauseMs = Math.min(kMaxPauseMs, retryMs * 2 ** failures++);
    const jitter = 0.75 + Math.random() / 2;
    await sleep(Math.max(pauseMs * jitter, 1000 * (problem?.retryAfterS || 0)), signal);
  }
}

async function read(path, headers, parser, signal, onOpen) {
  const connection = new AbortController();
  const close = () => connection.abort();
  signal.addEventListener("abort", close, {once: true});
  let watchdog = setTimeout(close, kIdleTimeoutMs);
  try {
    const response = await request("GET", path, {headers, signal: connection.signal});
    onOpen();
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    for (;;) {
      const {done, value} = await reader.read();
      if (done) return;
      clearTimeout(watchdog);
      watchdog = setTimeout(close, kIdleTimeoutMs);
      parser.feed(value);
    }
  } finally {
    clearTimeout(watchdog);
    signal.removeEventListener("abort", close);
    connection.abort();
  }
}
