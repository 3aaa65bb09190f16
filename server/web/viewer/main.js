// The page of the viewer: viewer.html?job=ID shows a job of the service, viewer.html alone the file of
// `voxdag view`. ?budget=MiB limits the memory of the tiles.

import {authorization, get_json, Problem, sleep, token} from "../lib/api.js";
import {announce, clear, h, set_text} from "../lib/dom.js";
import {has_ended, state_text, title_text} from "../lib/format.js";
import {problem_box} from "../views/parts.js";
import {Viewer} from "./app.js";
import {take_begun} from "./early.js";
import {Renderer, WebGLUnavailable} from "./renderer.js";
import {TileSource} from "./tile_source.js";
import {fill_tools} from "./tools.js";

const kBudgetMiB = 256;
const kPhoneBudgetMiB = 64;
const kMinBudgetMiB = 0.25;  // that tiles and colors can do with
const kPause_ms = 3000, kMaxPause_ms = 15000;

const place = (id) => document.getElementById(id);
const parameters = new URLSearchParams(location.search);
const asked_job = parameters.get("job");
const job_id = /^[0-9a-f]{1,32}$/.exec(asked_job ?? "")?.[0] ?? null;
const lifetime = new AbortController();

function budget_bytes() {
  const asked = Number(parameters.get("budget"));
  const small = matchMedia("(pointer: coarse)").matches && Math.min(screen.width, screen.height) < 600;
  return (asked > 0 ? Math.max(asked, kMinBudgetMiB) : small ? kPhoneBudgetMiB : kBudgetMiB) * 2 ** 20;
}

// Instead of the picture; nothing hides it again but a new message.
function show_message(...content) {
  place("scene").hidden = place("panel").hidden = place("tools").hidden = true;
  place("message").hidden = false;
  clear(place("message"), h("div", {class: "card stack narrow"}, ...content));
}
function hide_message() {
  place("scene").hidden = false;
  place("message").hidden = true;
}

function show_title(title) {
  document.title = `${title} · voxdag`;
  set_text(place("title"), title);
}

// Waits until the job has a result, and returns it. One that has failed or was canceled may be tried again.
async function finished_job() {
  let known = null, waits = null, draws = true, pause_ms = kPause_ms;
  for (;;) {
    const job = await job_now(known !== null);
    if (job) show_title(title_text(job));
    if (job?.state === "succeeded") return job;
    const is_live = job !== null && !has_ended(job.state);
    if (draws && is_live) {
      // The same page as that of a result; what it shows grows.
      const {watch_job} = await import("./running/running_job.js");
      try {
        if (await watch_job({job, place, budget_bytes: budget_bytes(), show_picture: hide_message, show_tools, signal: lifetime.signal})) {
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
    pause_ms = is_live ? kPause_ms : Math.min(kMaxPause_ms, 1.5 * pause_ms);
    await sleep(pause_ms, lifetime.signal, true);
  }
}

// null while the service does not answer, if that `may_be` so.
async function job_now(may_be) {
  try {
    return await get_json(`/api/v1/jobs/${job_id}`, lifetime.signal);
  } catch (problem) {
    if (!may_be || !problem.is_transient) throw problem;
    return null;
  }
}

// What is said of a job that has nothing to draw.
class WaitingMessage {
  constructor({PartialView}) {
    this.heading = h("h1", {});
    this.text = h("p", {});
    this.cubes = new PartialView(`/api/v1/jobs/${job_id}/partial`, lifetime.signal);
    this.buttons = h("div", {class: "buttons"}, h("a", {class: "button", href: `/#/jobs/${job_id}`}, "The job's page"));
  }

  // `job` is null while the service does not answer; `before` is what was known of the job, if anything.
  show(job, before) {
    const said = `${job ? "This job is" : "This job was"} ${state_text((job ?? before).state)}.`;
    if (before && said !== this.heading.textContent) announce(job ? said : "The service does not answer.");
    set_text(this.heading, said);
    set_text(this.text, !job ? "The service does not answer. It is asked again."
      : has_ended(job.state) ? "It has no result to look at. If it is tried again, it is shown here."
      : "Its result is shown here when it is done.");
    // What has the focus keeps it.
    if (place("message").hidden || !this.heading.isConnected)
      show_message(this.heading, this.text, this.cubes.element, this.buttons);
    if (job) this.cubes.update(job);
  }
}

// The address may be anybody's, and this is copied to a shell: only what consists of numbers is taken.
function camera_of_address() {
  const members = new URLSearchParams(location.hash.slice(1));
  return ["camera", "target", "fov"].filter((name) => /^[-+0-9.eE,]+$/.test(members.get(name) ?? ""))
                                    .map((name) => ` --${name} ${members.get(name)}`).join("");
}

// Without WebGL2 there is still a picture.
async function show_without_webgl(reason, job) {
  const content = [h("h1", {}, "This browser cannot draw the scene."),
    h("p", {}, `The viewer needs WebGL2: ${reason}`)];
  if (job?.preview) {
    const response = await fetch(job.links.preview, {headers: authorization()});
    const url = URL.createObjectURL(await response.blob());
    content.push(h("img", {class: "still", src: url, alt: `Rendering of the voxels of ${title_text(job)}`}));
  }
  content.push(h("p", {}, "A picture from any place is rendered by"),
    h("code", {}, `voxdag render FILE.vdag -o picture.png${camera_of_address()}`));
  show_message(...content);
}

async function start() {
  if (asked_job !== null && !job_id)
    return show_failure(new Problem(404, "not_found", "no such job: its id in the address of this page is malformed"));
  const job = job_id ? await finished_job() : null;
  const begun = take_begun();
  const source = begun?.source ?? new TileSource({base: job_id ? `/api/v1/jobs/${job_id}` : "/api/v1/view", headers: authorization()});
  const canvas = place("scene"), ended = new AbortController();
  let viewer = null;
  let renderer = null;
  hide_message();
  try {
    // The context and the programs take longer than the manifest.
    const arrives = (begun?.manifest ?? source.manifest()).then((manifest) => {
      if (!job) show_title(manifest.name ?? "voxdag view");
      return manifest;
    });
    arrives.catch(() => {});
    renderer = new Renderer(canvas, source, {budgetBytes: budget_bytes(), onChange: () => viewer?.schedule(), begun});
    const manifest = await arrives;
    const started = renderer.start();  // the first tile need not wait for the panel
    started.catch(() => {});
    show_tools();
    viewer = new Viewer({canvas, renderer, manifest, signal: ended.signal,
      file_name: (job ? title_text(job) : document.title).replace(/[^A-Za-z0-9._-]+/g, "-"),
      places: {panel: place("panel"), tools: place("tools"), status: place("status")}});
    await started;
  } catch (error) {
    ended.abort();
    renderer?.dispose();
    place("panel").hidden = place("tools").hidden = true;
    if (!(error instanceof WebGLUnavailable)) throw error;
    return show_without_webgl(error.message, job);
  }
  window.voxdagViewer = {renderer, source, camera: viewer.camera, viewer};
}

// The panel stays open or closed when another picture of the job follows.
function show_tools() {
  const before = place("tools").querySelector('[data-tool="toggle_panel"]')?.getAttribute("aria-expanded");
  const open = before ? before === "true" : !matchMedia("(max-width: 700px)").matches;
  place("panel").hidden = !open;
  place("tools").hidden = false;
  fill_tools(place("tools"), h("button", {type: "button", class: "small", "data-tool": "toggle_panel",
                                          "aria-expanded": String(open), "aria-controls": "panel"}, "Panel"));
}

function show_failure(error) {
  if (!(error instanceof Problem) && error.status === undefined) {
    show_message(h("h1", {}, "The viewer failed."), h("p", {}, error.message));
    throw error;
  }
  const code = error.code || (error.status ? `http_${error.status}` : "unreachable");
  const is_missing = code === "not_found" && asked_job === null;
  // The id of a job that is not there is never given to another.
  const is_final = code === "not_found" && error instanceof Problem;
  show_message(is_missing && [h("h1", {}, "The file is not there."),
      h("p", {}, "This page shows the file of ", h("code", {}, "voxdag view"), ". A job of a service is viewed from its page.")],
    problem_box({code, status: error.status, message: error.message}),
    h("div", {class: "buttons"}, is_final ? h("a", {class: "button", href: "/"}, "Start page")
      : h("button", {type: "button", on: {click: () => location.reload()}}, "Try again")));
}

// The service asks for a token: the page of the dashboard that does so is loaded only then.
async function sign_in() {
  const rejected = Boolean(token.get());
  token.remove();
  const {login_page} = await import("../pages/login_page.js");
  place("scene").hidden = true;
  place("message").hidden = false;
  clear(place("message"), login_page(rejected, run).content);
}

function run() {
  hide_message();
  start().catch((error) => {
    if (error.status !== 401) show_failure(error);
    else if (!(error instanceof Problem)) sign_in();  // a Problem has asked for it already
  });
}

if (job_id) {
  place("home").href = `/#/jobs/${job_id}`;
  set_text(place("home-text"), "Job");
  window.addEventListener("voxdag-login", sign_in);
}
run();
