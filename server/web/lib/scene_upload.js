// Uploads a scene in parts, each with its digest. The service stores each complete part, so a lost
// connection, a pause or a closed page loses at most one part.

import {authorization, Problem, request, sleep} from "./api.js";

const kPartBytes = 8 << 20;
const kMaxFailures = 6;  // consecutive failures; the pauses between them grow

const kSuffixes = "{{scene_suffixes}}";  // the service fills this in: "glb|gltf|ply|obj|stl"
export const kSceneEndings = kSuffixes.split("|").map((suffix) => `.${suffix}`);
export const kSceneName = new RegExp(`^[A-Za-z0-9][A-Za-z0-9._-]{0,122}\\.(${kSuffixes})$`, "i");

// "My scene (2).glb" -> "My-scene-2.glb"
export function sceneName(fileName) {
  return fileName.replace(/[^A-Za-z0-9._-]+/g, "-")
      .replace(/^[^A-Za-z0-9]+/, "")
      .replace(/-+\./g, ".");
}

// Resolves to the SCENE (docs/api.md). Calls onProgress(bytes received) often. Throws Problem, or
// AbortError when `signal` aborts. Later, the same call resumes the upload.
export async function upload(file, name, onProgress, signal) {
  const path = `/api/v1/scenes/${name}`;
  if (file.size === 0) throw new Problem(0, "invalid_input", `${file.name} is empty.`);
  let offset = await resumeOffset(path, file, name, signal);
  let failures = 0;
  for (;;) {
    onProgress(offset);
    try {
      remember(name, file);
      const scene = await putPart(path, file, offset, onProgress, signal);
      failures = 0;
      offset += kPartBytes;
      if (offset >= file.size) {
        forget(name);
        return scene;
      }
    } catch (problem) {
      if (signal.aborted) throw problem;
      const expected = Number(problem.headers?.get("Upload-Offset") ?? NaN);
      if (problem.status === 409 && expected >= 0 && expected !== offset) {
        offset = expected;
      } else if (problem.isTransient && ++failures <= kMaxFailures) {
        await sleep(Math.max(1000 * problem.retryAfterS, 500 * 2 ** failures), signal);
        if (signal.aborted) throw problem;
        offset = await resumeOffset(path, file, name, signal).catch(() => offset);
      } else {
        throw problem;
      }
    }
  }
}

// Resolves to the offset at which the upload resumes: the number of bytes that the service has, or
// 0 if this browser did not send them.
async function resumeOffset(path, file, name, signal) {
  if (localStorage.getItem(keyOf(name)) !== fingerprintOf(file)) return 0;
  try {
    const {headers} = await request("HEAD", path, {signal});
    const length = headers.get("Upload-Length");
    if (length !== null && Number(length) !== file.size) return 0;
    const offset = Number(headers.get("Upload-Offset"));
    return offset > 0 && offset <= file.size ? offset : 0;
  } catch (problem) {
    if (problem.status === 404) return 0;
    throw problem;
  }
}

// Sends one part. Uses XMLHttpRequest, because fetch() does not report the progress of an upload.
async function putPart(path, file, offset, onProgress, signal) {
  const end = Math.min(file.size, offset + kPartBytes);
  const part = await file.slice(offset, end).arrayBuffer();
  const range =
      // An empty part completes an upload of which the service has all bytes.
      end > offset ? `${offset}-${end - 1}` : "*";
  const headers = {
    ...authorization(),
    "Content-Type": "application/octet-stream",
    "Content-Range": `bytes ${range}/${file.size}`,
    ...await digestHeader(part)
  };
  return new Promise((resolve, reject) => {
    const put = new XMLHttpRequest();
    const cancel = () => put.abort();
    signal.addEventListener("abort", cancel, {once: true});
    put.open("PUT", path);
    for (const [name, value] of Object.entries(headers)) put.setRequestHeader(name, value);
    put.upload.addEventListener(
        "progress", (event) => onProgress(offset + Math.min(event.loaded, end - offset)));
    put.addEventListener("loadend", () => {
      signal.removeEventListener("abort", cancel);
      if (put.status >= 200 && put.status < 300) resolve(parse(put.responseText));
      else reject(problemOf(put));
    });
    put.send(part);
  });
}

// Resolves to the headers with the digest of a part. Without crypto.subtle, which exists only on
// https and localhost, resolves to no headers, because the digest is optional.
async function digestHeader(part) {
  if (!crypto.subtle) return {};
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", part));
  return {"Content-Digest": `sha-256=:${btoa(String.fromCharCode(...digest))}:`};
}

function problemOf(put) {
  if (put.status === 0) return new Problem(0, "unreachable", "The connection was lost.");
  if (put.status === 401) window.dispatchEvent(new Event("voxdag-login"));
  const members = parse(put.responseText);
  const headers = {get: (name) => put.getResponseHeader(name)};
  return new Problem(
      put.status, members.code || `http_${put.status}`, members.detail || put.statusText, members,
      headers);
}

function parse(text) {
  try {
    return JSON.parse(text);
  } catch {
    return {};
  }
}

const keyOf = (name) => `voxdag-upload ${name}`;
const fingerprintOf = (file) => `${file.name} ${file.size} ${file.lastModified}`;
const remember = (name, file) => localStorage.setItem(keyOf(name), fingerprintOf(file));
const forget = (name) => localStorage.removeItem(keyOf(name));
