// Requests to /api/v1. Every failure is a Problem, including network failures.

const kTokenKey = "voxdag-token";

export class Problem extends Error {
  constructor(status, code, detail, members = {}, headers = null) {
    super(detail);
    this.status = status;
    this.code = code;
    this.members = members;
    this.headers = headers;
  }
  // True if the same request can succeed later.
  get isTransient() {
    return this.code === "unreachable" || [408, 429, 502, 503, 504].includes(this.status);
  }
  // The pause in seconds that the service has requested.
  get retryAfterS() {
    return Number(this.headers?.get("Retry-After")) || 0;
  }
}

// The bearer token is stored until the tab is closed.
export const token = {
  get: () => sessionStorage.getItem(kTokenKey) || "",
  set: (text) => sessionStorage.setItem(kTokenKey, text),
  remove: () => sessionStorage.removeItem(kTokenKey),
};

export function authorization() {
  return token.get() ? {Authorization: `Bearer ${token.get()}`} : {};
}

// Resolves to the Response of a successful request, otherwise throws Problem. The status 401 also
// shows the login page.
export async function request(method, path, {headers = {}, body, signal} = {}) {
  let response;
  try {
    response = await fetch(
        path, {method, body, signal, cache: "no-store", headers: {...authorization(), ...headers}});
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Problem(0, "unreachable", "The service does not answer.");
  }
  if (response.ok) return response;
  throw await problemOf(response);
}

async function problemOf(response) {
  const members = await response.json().catch(() => ({}));
  const problem = new Problem(
      response.status, members.code || `http_${response.status}`,
      members.detail || response.statusText, members, response.headers);
  if (response.status === 401) window.dispatchEvent(new Event("voxdag-login"));
  return problem;
}

export async function getJson(path, signal) {
  return (await request("GET", path, {signal})).json();
}

export async function sendJson(method, path, body, {headers = {}, signal} = {}) {
  const options = {signal, headers};
  if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers = {"Content-Type": "application/json", ...headers};
  }
  const response = await request(method, path, options);
  return response.status === 204 ? null : response.json();
}

// Returns a value for Idempotency-Key. Does not use crypto.randomUUID(), because it is not
// available on plain http.
export function randomKey() {
  return Array
      .from(
          crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0"))
      .join("");
}

// Resolves after `ms`, or immediately when `signal` aborts. With `untilVisible`, also waits until
// the page is visible.
export function sleep(ms, signal, untilVisible = false) {
  return new Promise((resolve) => {
    const listening = new AbortController();
    const done = () => {
      clearTimeout(timer);
      listening.abort();
      resolve();
    };
    const doneIfVisible = () => {
      if (!untilVisible || !document.hidden) done();
    };
    const timer = setTimeout(doneIfVisible, ms);
    if (untilVisible)
      document.addEventListener("visibilitychange", doneIfVisible, {signal: listening.signal});
    signal.addEventListener("abort", done, {signal: listening.signal});
    if (signal.aborted) done();
  });
}

// Calls `update` repeatedly until `signal` aborts. `update` must return the pause in ms before its
// next call. While the page is hidden, the next call waits until the page is visible. If `update`
// throws, calls onFailure(problem).
export async function poll(update, onFailure, signal) {
  while (!signal.aborted) {
    let pauseMs = 5000;
    try {
      pauseMs = await update();
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof Problem)) throw error;
      onFailure(error);
      if (error.status === 401) return;
    }
    await sleep(pauseMs, signal, true);
  }
}
