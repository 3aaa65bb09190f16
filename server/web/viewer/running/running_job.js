// The viewer of a running job. It draws the partial result from the coarse bricks of the built
// subvolumes, and the wireframe of all subvolumes. The partial result grows while it is viewed;
// fetched tiles remain valid. While the job computes colors, the partial result is the complete DAG
// without colors.

import {authorization, getJson, sleep} from "../../lib/api.js";
import {announce} from "../../lib/dom.js";
import {hasEnded, stateText} from "../../lib/format.js";
import {Viewer} from "../app.js";
import {fragmentText} from "../camera_text.js";
import {Renderer} from "../render/renderer.js";
import {TileError, TileSource} from "../tile_source.js";

import {Banner} from "./banner.js";
import {SubvolumeWires} from "./subvolume_wires.js";

const kPauseMs = 1500, kMaxPauseMs = 15000;
// Statuses that mean: the partial result has a new digest, or the job has a new state.
const kGone = [404, 409, 410];
// After a request for the list of subvolumes, the pause before the next request is kListShare times
// the request's duration, and at least kListPausePerCubeMs per subvolume.
const kListShare = 10, kListPausePerCubeMs = 0.1;
// A change appears in the list slightly later than in the progress report, so the list is fetched
// kListLooks times per change. The start of a subvolume appears only in the list, so the list of a
// running job is also fetched when it is older than kMaxListPauseMs.
const kListLooks = 2, kMaxListPauseMs = 15000;

// Shows the job until it has a result. Resolves to false if there was nothing to show, because the
// subvolumes are not planned yet. Throws WebGLUnavailable, or Problem if the job was deleted.
// Stores the camera in the page's address, so that the next viewer begins with this camera.
// `showTools` fills the page's tools.
export async function watchJob({job, place, budgetBytes, showPicture, showTools, signal}) {
  const path = `/api/v1/jobs/${job.id}`;
  const source = new TileSource({base: `${path}/partial`, headers: authorization()});
  const manifest = await manifestOf(source);
  if (!manifest?.camera || signal.aborted) return false;
  const ended = new AbortController(), end = () => ended.abort();
  signal.addEventListener("abort", end, {once: true});
  const canvas = place("scene");
  let renderer = null, banner = null, wires = null, viewer = null, rests = false;
  try {
    showPicture();
    renderer = new Renderer(
        canvas, source, {budgetBytes: budgetBytes, onChange: () => viewer?.schedule()});
    const started = renderer.start();
    started.catch(() => {});
    showTools();
    viewer = new Viewer({
      canvas,
      renderer,
      manifest,
      signal: ended.signal,
      fileName: `job-${job.id}`,
      places: {panel: place("panel"), tools: place("tools"), status: place("status")}
    });
    wires = viewer.overlay = new SubvolumeWires(canvas, () => viewer.schedule());
    banner = new Banner(wires);
    canvas.parentElement.append(banner.element);
    banner.show(job, manifest, manifest.merged);
    await started;
    window.voxdagViewer = {renderer, source, camera: viewer.camera, viewer, wires, running: true};
    rests = await follow({path, source, renderer, banner, wires, signal: ended.signal});
    history.replaceState(null, "", `#${fragmentText(viewer.bookmarkMembers())}`);
    return true;
  } catch (error) {
    place("panel").hidden = place("tools").hidden = true;
    if (!(error instanceof TileError && kGone.includes(error.status))) throw error;
    rests = true;
    return true;
  } finally {
    signal.removeEventListener("abort", end);
    end();
    renderer?.dispose();
    wires?.dispose();
    banner?.element.remove();
    delete window.voxdagViewer;
    // Pauses before the caller follows the job again, because the reason for ending may recur.
    if (rests) await sleep(kPauseMs, signal, true);
  }
}

// Resolves to the manifest. Resolves to null if the job is not planned yet, if its files were
// deleted, or if the service does not answer.
async function manifestOf(source) {
  try {
    return await source.manifest();
  } catch (error) {
    if (error instanceof TileError && (error.status === 404 || error.isTransient)) return null;
    throw error;
  }
}

// Resolves to the job; to null while the service does not answer.
async function jobOf(path, signal) {
  try {
    return await getJson(path, signal);
  } catch (problem) {
    if (signal.aborted || !problem.isTransient) throw problem;
    return null;
  }
}

// The list of subvolumes. It is fetched again whenever it may have changed.
class SubvolumeList {
  constructor(path) {
    this.path = path;
    this.list = null;
    this.key = null;
    this.looks = 0;  // number of requests after which the list is up to date
    this.nextMs = -Infinity;
    this.latestMs = -Infinity;
  }

  // Resolves to true if the list was fetched.
  async update(job, signal) {
    const {stage, subvolumes} = job.progress ?? {},
                  key = JSON.stringify([job.state, job.attempts, stage, subvolumes]);
    if (key !== this.key) this.looks = kListLooks;
    this.key = key;
    const beginMs = performance.now();
    if (beginMs >= this.latestMs && job.state === "running") this.looks = Math.max(this.looks, 1);
    if (this.looks === 0 || beginMs < this.nextMs) return false;
    const list = await getJson(`${this.path}/subvolumes`, signal).catch(() => null);
    const nowMs = performance.now(), cubes = (list ?? this.list)?.cubes.length ?? 0;
    this.nextMs = nowMs + Math.max(kListShare * (nowMs - beginMs), kListPausePerCubeMs * cubes);
    if (!list) return false;
    this.looks--;
    this.latestMs = nowMs + kMaxListPauseMs;
    this.list = list;
    return true;
  }
}

// Updates the picture until the job has a result, is retried, or has a different DAG as its partial
// result, for example after a restart of the service. Resolves to true if the caller must pause
// before it follows the job again, because the reason for ending may recur.
async function follow({path, source, renderer, banner, wires, signal}) {
  const {digest, merged: isMerged} = renderer.info, wasEmpty = !renderer.info.root;
  const subvolumes = new SubvolumeList(path);
  let state = null, isArriving = false, pauseMs = kPauseMs;
  while (!signal.aborted) {
    const job = await jobOf(path, signal);
    if (job?.state === "succeeded") {
      announce("The job has succeeded: this is its result.");
      return false;
    }
    if (job && hasEnded(state) && !hasEnded(job.state)) return true;
    if (job && job.state !== state) {
      if (state !== null) announce(`The job is ${stateText(job.state)}.`);
      state = job.state;
    }
    const manifest = job && !hasEnded(state) ? await manifestOf(source) : null;
    if (manifest && manifest.digest !== digest) return true;
    if (manifest?.root && wasEmpty) return false;
    if (manifest?.root && manifest.root.offset === renderer.info.root.offset) {
      Object.assign(renderer.info, {built: manifest.built, total: manifest.total});
    } else if (manifest?.root && !isArriving) {
      // Does not wait for the new root's tile, which may take long, so that banner and wireframe
      // are still updated.
      isArriving = true;
      renderer.showRoot(manifest)
          .catch(
              (error) =>
                  console.warn(`voxdag: the partial result is not updated: ${error.message}`))
          .finally(() => isArriving = false);
    }
    if (job && await subvolumes.update(job, signal))
      wires.show(subvolumes.list, state === "running");
    banner.show(job, subvolumes.list ?? source.info, isMerged);
    // Continues with longer pauses if the job has ended or the service does not answer: the job may
    // be retried, and the service may come back.
    pauseMs = manifest ? kPauseMs : Math.min(kMaxPauseMs, 1.5 * pauseMs);
    await sleep(pauseMs, signal, true);
  }
  return false;
}
