// The page of the viewer. Query parameters of viewer.html:
//
//     job=ID       shows a job of the service; without it, shows the file of `voxdag view`
//     budget=MiB   limits the memory of tiles and colors
//     embed        shows only the picture, for a frame in another page

import {authorization, getJson, Problem, sleep, token} from "../lib/api.js";
import {announce, clear, h, setText} from "../lib/dom.js";
import {countText, gridText, hasEnded, stateText, titleText} from "../lib/format.js";
import {problemBox} from "../views/parts.js";

import {Viewer} from "./app.js";
import {cameraTexts} from "./camera_text.js";
import {takeBegun} from "./early.js";
import {isPublished, sourceOfPage} from "./page_source.js";
import {Renderer, WebGLUnavailable} from "./render/renderer.js";
import {TileSource} from "./tile_source.js";
import {fillTools} from "./tools.js";

const kBudgetMiB = 256;
const kPhoneBudgetMiB = 64;
const kMinBudgetMiB = 0.25;  // minimum for tiles and colors
const kPauseMs = 3000, kMaxPauseMs = 15000;

const place = (id) => document.getElementById(id);
const parameters = new URLSearchParams(location.search);
const askedJob = isPublished() ? null : parameters.get("job");
const jobId = /^[0-9a-f]{1,32}$/.exec(askedJob ?? "")?.[0] ?? null;
const isFramed = parameters.has("embed");
const lifetime = new AbortController();

function budgetBytes() {
  const asked = Number(parameters.get("budget"));
  const small =
      matchMedia("(pointer: coarse)").matches && Math.min(screen.width, screen.height) < 600;
  return (asked > 0 ? Math.max(asked, kMinBudgetMiB) :
              small ? kPhoneBudgetMiB :
                      kBudgetMiB) *
      2 ** 20;
}

// Shows a message instead of the picture, until the next message or a picture replaces it.
function showMessage(...content) {
  place("scene").hidden = place("panel").hidden = place("tools").hidden = true;
  place("poster")?.remove();
  place("message").hidden = false;
  clear(place("message"), h("div", {class: "card stack narrow"}, ...content));
}
function hideMessage() {
  place("scene").hidden = false;
  place("message").hidden = true;
}

// Shows the title of the page. If `manifest` is given, also shows the resolution and the number of
// voxels of its file.
function showTitle(title, manifest = null) {
  const facts = manifest && [
    gridText(manifest.resolution), manifest.voxels && `${countText(manifest.voxels)} voxels`
  ].filter(Boolean);
  document.title = [title, ...(facts ?? []), "voxdag"].join(" · ");
  clear(place("title"), title, facts && h("span", {class: "title-facts"}, facts.join(" · ")));
}

// Adds a link over the picture of a framed viewer. The link opens the viewer without the frame,
// with the current camera.
function addWindowLink() {
  const address = new URL(location.href);
  address.searchParams.delete("embed");
  const link =
      h("a",
        {class: "button small open-window", target: "_blank", rel: "noopener", href: address.href},
        "Open");
  link.addEventListener("click", () => link.href = `${address.href.split("#")[0]}${location.hash}`);
  place("scene").parentElement.append(link);
}

// Resolves to the job when it has a result. Also waits for a failed or canceled job, because the
// user can retry it.
async function finishedJob() {
  let known = null, waits = null, draws = true, pauseMs = kPauseMs;
  for (;;) {
    const job = await jobNow(known !== null);
    if (job) showTitle(titleText(job));
    if (job?.state === "succeeded") return job;
    const isLive = job !== null && !hasEnded(job.state);
    if (draws && isLive) {
      // Shows the growing partial result until the job has a result.
      const {watchJob} = await import("./running/running_job.js");
      try {
        if (await watchJob({
              job,
              place,
              budgetBytes: budgetBytes(),
              showPicture: hideMessage,
              showTools,
              signal: lifetime.signal
            })) {
          known = job;
          continue;
        }
      } catch (error) {
        if (!(error instanceof WebGLUnavailable)) throw error;
        draws = false;
      }
    }
    waits ??= new WaitingMessage(await import("../views/partial_view.js"));
    waits.show(job, known);
    known = job ?? known;
    pauseMs = isLive ? kPauseMs : Math.min(kMaxPauseMs, 1.5 * pauseMs);
    await sleep(pauseMs, lifetime.signal, true);
  }
}

// Resolves to the job. Resolves to null if the service does not answer and `mayBe` is true.
async function jobNow(mayBe) {
  try {
    return await getJson(`/api/v1/jobs/${jobId}`, lifetime.signal);
  } catch (problem) {
    if (!mayBe || !problem.isTransient) throw problem;
    return null;
  }
}

function waitingText(job) {
  if (!job) return "The service does not answer. Trying again.";
  return hasEnded(job.state) ? "It has no result. If it is retried, its result appears here." :
                               "Its result appears here when the job is done.";
}

// The message about a job that has nothing to draw.
class WaitingMessage {
  constructor({PartialView}) {
    this.heading = h("h1", {});
    this.text = h("p", {});
    this.cubes = new PartialView(`/api/v1/jobs/${jobId}/partial`, lifetime.signal);
    this.buttons =
        h("div", {class: "buttons"},
          h("a", {class: "button", href: `/#/jobs/${jobId}`}, "The job's page"));
  }

  // `job` is null while the service does not answer. `before` is the previously known job, or null.
  show(job, before) {
    const said = `${job ? "This job is" : "This job was"} ${stateText((job ?? before).state)}.`;
    if (before && said !== this.heading.textContent)
      announce(job ? said : "The service does not answer.");
    setText(this.heading, said);
    setText(this.text, waitingText(job));
    // Replaces the elements only if necessary, so that the focus is kept.
    if (place("message").hidden || !this.heading.isConnected)
      showMessage(this.heading, this.text, this.cubes.element, this.buttons);
    if (job) this.cubes.update(job);
  }
}

// Returns the camera in the page's address. The address is untrusted and the result is copied to a
// shell, so only numbers are used.
function cameraOfAddress() {
  const camera = cameraTexts(new URLSearchParams(location.hash.slice(1))) ?? {};
  return ["camera", "target", "fov"]
      .filter((name) => /^[-+0-9.eE,]+$/.test(camera[name] ?? ""))
      .map((name) => ` --${name} ${camera[name]}`)
      .join("");
}

// Shows that the browser has no WebGL2, the preview of the job if it has one, and a command that
// renders a picture.
async function showWithoutWebgl(reason, job) {
  const content = [
    h("h1", {}, "This browser cannot draw the scene."),
    h("p", {}, `The viewer needs WebGL2: ${reason}`)
  ];
  const poster = place("poster");
  if (poster)
    content.push(h("img", {class: "still", src: poster.src, alt: "Rendering of the voxels"}));
  if (job?.preview) {
    const response = await fetch(job.links.preview, {headers: authorization()});
    const url = URL.createObjectURL(await response.blob());
    content.push(
        h("img", {class: "still", src: url, alt: `Rendering of the voxels of ${titleText(job)}`}));
  }
  content.push(
      h("p", {}, "A picture from any place is rendered by"),
      h("code", {}, `voxdag render FILE.vdag -o picture.png${cameraOfAddress()}`));
  showMessage(...content);
}

async function start() {
  if (askedJob !== null && !jobId)
    return showFailure(new Problem(
        404, "not_found", "no such job: its id in the address of this page is malformed"));
  const job = jobId ? await finishedJob() : null;
  const begun = takeBegun();
  const source = begun?.source ??
      (jobId ? new TileSource({base: `/api/v1/jobs/${jobId}`, headers: authorization()}) :
               sourceOfPage(authorization()));
  const canvas = place("scene"), ended = new AbortController();
  let viewer = null;
  let renderer = null;
  hideMessage();
  try {
    // The manifest is requested first, so that it arrives while the context and the programs are
    // created.
    const arrives = (begun?.manifest ?? source.manifest()).then((manifest) => {
      showTitle(job ? titleText(job) : manifest.name ?? "voxdag view", manifest);
      return manifest;
    });
    arrives.catch(() => {});
    renderer = new Renderer(
        canvas, source, {budgetBytes: budgetBytes(), onChange: () => viewer?.schedule(), begun});
    const manifest = await arrives;
    const started = renderer.start();  // loads the first tile while the panel is built
    started.catch(() => {});
    showTools();
    viewer = new Viewer({
      canvas,
      renderer,
      manifest,
      signal: ended.signal,
      fileName:
          (job ? titleText(job) : manifest.name ?? "voxdag").replace(/[^A-Za-z0-9._-]+/g, "-"),
      places: {
        panel: place("panel"),
        tools: place("tools"),
        status: place("status"),
        poster: place("poster")
      }
    });
    await started;
  } catch (error) {
    ended.abort();
    renderer?.dispose();
    place("panel").hidden = place("tools").hidden = true;
    if (!(error instanceof WebGLUnavailable)) throw error;
    return showWithoutWebgl(error.message, job);
  }
  window.voxdagViewer = {renderer, source, camera: viewer.camera, viewer};
}

// Shows the tools. When the result of a job replaces its partial result, the panel remains as the
// user left it, open or closed.
function showTools() {
  const before =
      place("tools").querySelector('[data-tool="togglePanel"]')?.getAttribute("aria-expanded");
  const open = before ? before === "true" : !matchMedia("(max-width: 700px)").matches;
  place("panel").hidden = !open;
  place("tools").hidden = false;
  fillTools(
      place("tools"),
      h("button", {
        type: "button",
        class: "small",
        "data-tool": "togglePanel",
        "aria-expanded": String(open),
        "aria-controls": "panel"
      },
        "Panel"));
}

function showFailure(error) {
  if (!(error instanceof Problem) && error.status === undefined) {
    showMessage(h("h1", {}, "The viewer failed."), h("p", {}, error.message));
    throw error;
  }
  const code = error.code || (error.status ? `http_${error.status}` : "unreachable");
  const isMissing = code === "not_found" && askedJob === null;
  // A job that is not found never comes back, because ids are never used again.
  const isFinal = code === "not_found" && error instanceof Problem;
  showMessage(
      isMissing &&
          [
            h("h1", {}, "The file does not exist."),
            h("p", {}, "This page shows the file of ", h("code", {}, "voxdag view"),
              ". A job of a service is viewed from its page.")
          ],
      problemBox({code, status: error.status, message: error.message}),
      h("div", {class: "buttons"},
        isFinal ?
            h("a", {class: "button", href: "/"}, "Start page") :
            h("button", {type: "button", on: {click: () => location.reload()}}, "Try again")));
}

// Shows the login page of the dashboard, which is loaded only when the service requires a token.
async function signIn() {
  const rejected = Boolean(token.get());
  token.remove();
  const {loginPage} = await import("../pages/login_page.js");
  place("scene").hidden = true;
  place("message").hidden = false;
  clear(place("message"), loginPage(rejected, run).content);
}

function run() {
  hideMessage();
  start().catch((error) => {
    if (error.status !== 401 || isPublished()) showFailure(error);
    else if (!(error instanceof Problem)) signIn();  // a Problem has already shown the login page
  });
}

if (isFramed) {
  document.body.classList.add("framed");
  addWindowLink();
}
if (jobId) {
  place("home").href = `/#/jobs/${jobId}`;
  setText(place("home-text"), "Job");
  window.addEventListener("voxdag-login", signIn);
}
run();
