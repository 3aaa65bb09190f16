// The viewer: picture, camera motion, and panel.

import {announce, h} from "../lib/dom.js";

import {Camera} from "./camera.js";
import {
  cameraFragment,
  cameraText,
  fragmentText,
  GridSpace,
  parseCameraFragment,
  parseCameraText
} from "./camera_text.js";
import {Controls} from "./controls.js";
import {framed} from "./framing.js";
import {markKeyUse} from "./key_use.js";
import {keysHelp, listenToKeys} from "./keys.js";
import {Motion} from "./motion.js";
import {Markers} from "./overlay/markers.js";
import {Panel} from "./panel.js";
import {length, subtract} from "./vector.js";

const kDefaultFov = 35;
const kSeenIntervalMs = 250;  // time between two picks that measure the visible distance
const kFirstSeenMs = 2000;    // delay of the first of these picks, which compiles shaders
const kStatisticsIntervalMs = 500;
const kNoPicture = "There is no picture yet.";
const kBookmarkDelayMs = 400;  // browsers refuse more than 100 changes of the address in 30 s

export class Viewer {
  // `renderer` may be started later. `places` has the elements {panel, tools, status},
  // and may have `poster`, a picture that is removed once the viewer has drawn. If `bookmarks` is
  // true, the viewer stores the camera in the fragment of the URL after it has moved. `isKeyed` is
  // true if the user has opened the viewer with the keyboard. The viewer ends when `signal` aborts.
  constructor(
      {canvas, renderer, manifest, places, fileName, signal, bookmarks = true, isKeyed = false}) {
    Object.assign(this, {canvas, renderer, manifest, places, fileName, signal, bookmarks});
    this.space = new GridSpace(manifest);
    this.camera = new Camera(manifest.resolution);
    this.options = this.defaultOptions();
    this.seen = {distance: manifest.resolution, time: -Infinity};
    this.motion = new Motion(this.camera, () => this.seen.distance);
    this.panel = new Panel(this);
    this.markers = new Markers(canvas, this.panel.pick);
    places.panel.replaceChildren(this.panel.element);
    this.controls = new Controls(
        canvas, this.camera, this.motion, {
          pick: async (x, y) => (await renderer.pick(x, y))?.position ?? null,
          onClick: (x, y) => this.pick(x, y),
          onDoubleClick: (x, y) => this.setPivot(x, y),
          onChange: () => this.schedule(),
        },
        signal);
    markKeyUse(canvas, isKeyed, signal);
    listenToKeys(
        bookmarks ? window : canvas, canvas, this.motion, this.actions(), () => this.schedule(),
        signal);
    for (const button of places.tools.querySelectorAll("[data-tool]"))
      button.addEventListener("click", () => this.actions()[button.dataset.tool](), {signal});
    this.saveButton = places.tools.querySelector('[data-tool="screenshot"]');
    this.saveButton.disabled = true;  // until there is a picture
    const resizes = new ResizeObserver(() => this.resize());
    resizes.observe(canvas);
    if (bookmarks)
      window.addEventListener(
          "hashchange", (event) => this.followBookmark(new URL(event.newURL).hash), {signal});
    const timer = setInterval(() => this.showStatistics(), kStatisticsIntervalMs);
    signal.addEventListener("abort", () => {
      clearInterval(timer);
      resizes.disconnect();
      this.markers.dispose();
      renderer.dispose();
    }, {once: true});
    this.resize();
    this.camera.set(this.firstCamera());
    this.followBookmark(location.hash);
    this.showMode();
    // The viewer starts before the distance of the visible surface is known. Until it is known, the
    // viewer uses the distance of the target.
    this.seen.distance = this.camera.distance;
    this.seen.time = performance.now() + kFirstSeenMs;
    this.applyCamera();
  }

  defaultOptions() {
    return {
      level: this.manifest.levels,
      wire: null,
      clip: null,
      occlusion: true,
      shadows: true,
      color: true
    };
  }

  firstCamera() {
    const {
      camera,
      views =
      {
        iso: camera
      }
    } = this.manifest;
    if (!camera) return this.camera.get();
    const text = JSON.stringify(camera),
          name = Object.keys(views).find((view) => JSON.stringify(views[view]) === text);
    return name ? this.namedPlacement(name) : this.space.placement(camera);
  }

  // Returns the placement of the camera for the view `name`, such that the complete scene is
  // visible in the canvas.
  namedPlacement(name) {
    const {camera, views = {iso: camera}, tall_views: tall = {}, box} = this.manifest;
    const {clientWidth, clientHeight} = this.canvas;
    return framed(
        this.space.placement(views[name]), tall[name] ? this.space.placement(tall[name]) : null,
        box, clientWidth / Math.max(1, clientHeight));
  }

  actions() {
    const center = () => [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2];
    return {
      toggleFly: () => {
        this.motion.flying = !this.motion.flying;
        this.motion.stop();
        this.showMode();
        announce(this.motion.flying ? "Flight: the keys and drags look around." : "Orbit.");
      },
      reset: () => {
        this.flyTo(this.firstCamera());
        announce("The camera is reset.");
      },
      pickCenter: () => this.pick(...center()),
      pivotCenter: () => this.setPivot(...center()),
      toggleColor: () => {
        if (!this.manifest.colors) return announce("The file has no colors.");
        this.setOptions({color: !this.options.color});
        announce(this.options.color ? "Colors." : "Gray.");
      },
      measure: () => this.panel.pick.toggleMeasure(),
      screenshot: () => this.savePicture(),
      togglePanel: () => this.togglePanel(),
      help: () => this.showHelp(),
    };
  }

  showMode() {
    const button = this.places.tools.querySelector('[data-tool="toggleFly"]');
    button.setAttribute("aria-pressed", String(Boolean(this.motion.flying)));
    this.canvas.classList.toggle("flying", Boolean(this.motion.flying));
  }

  togglePanel() {
    const {panel, tools} = this.places;
    const hadFocus = panel.contains(document.activeElement);
    panel.hidden = !panel.hidden;
    tools.querySelector('[data-tool="togglePanel"]')
        ?.setAttribute("aria-expanded", String(!panel.hidden));
    if (hadFocus) this.canvas.focus();
  }

  showHelp() {
    const dialog = h(
        "dialog", {class: "viewer help", "aria-labelledby": "help-title"},
        h("form", {method: "dialog"}, h("h2", {id: "help-title"}, "Keys and pointers"), keysHelp(),
          h("div", {class: "buttons end"},
            h("button", {class: "primary", autofocus: true}, "Close"))));
    document.body.append(dialog);
    dialog.addEventListener("close", () => {
      dialog.remove();
      this.canvas.focus();
    });
    dialog.showModal();
    dialog.scrollTop = 0;  // showModal() focuses the last button, and so scrolls down
  }

  resize() {
    if (!this.canvas.clientWidth || !this.canvas.clientHeight) return;
    this.renderer.resize(
        this.canvas.clientWidth, this.canvas.clientHeight, window.devicePixelRatio || 1);
    this.schedule();
  }

  // Requests a frame. More frames follow until the picture is complete and nothing moves.
  schedule() {
    if (this.scheduled || this.signal.aborted) return;
    this.scheduled = true;
    requestAnimationFrame((now) => {
      this.scheduled = false;
      this.frame(now);
    });
  }

  frame(now) {
    if (this.signal.aborted) return;
    const moving = this.motion.step(now);
    this.applyCamera();
    const drawn = this.renderer.frame();
    this.saveButton.disabled = !this.renderer.hasDrawn;
    if (this.renderer.hasDrawn) this.places.poster?.remove();
    this.showMarkers();
    if (now - this.seen.time > kSeenIntervalMs) this.lookAhead(now);
    if (moving || drawn.moving || !drawn.complete) this.schedule();
  }

  showMarkers() {
    this.overlay?.draw(this.camera);
    this.markers.show(this.camera);
  }

  applyCamera() {
    const {eye, target, fovDegrees} = this.camera;
    const key = [...eye, ...target, fovDegrees].join();
    if (key === this.cameraKey) return;
    if (this.cameraKey) this.refusal = "";
    this.cameraKey = key;
    this.renderer.setView(
        {eye: [...eye], target: [...target], up: this.camera.axes().up, fovDegrees: fovDegrees});
    this.bookmark();
  }

  // Measures the distance of the surface in the center of the picture, which determines the speed
  // of motions. If there is no surface, the speed grows slowly.
  async lookAhead(now) {
    if (this.seen.key === this.cameraKey) return;
    this.seen.time = now;
    this.seen.key = this.cameraKey;
    const hit = await this.renderer.pick(this.canvas.clientWidth / 2, this.canvas.clientHeight / 2);
    const free = Math.min(
        1.3 * this.seen.distance, Math.max(this.manifest.resolution / 4, this.camera.distance));
    this.seen.distance = Math.max(1, hit ? hit.distance : free);
  }

  // Sets the options of the picture that `changed` contains: any of {level, wire, clip, occlusion,
  // shadows, color}.
  setOptions(changed) {
    Object.assign(this.options, changed);
    const {level, wire, clip, occlusion, shadows, color} = this.options;
    this.renderer.setOptions({
      maxLevel: level,
      wireLevel: wire,
      clip,
      ambientOcclusion: occlusion,
      sunShadows: shadows,
      color
    });
    this.panel.showOptions(this.options);
    this.bookmark();
    this.schedule();
  }

  flyTo(placement) {
    this.motion.flyTo(placement);
    this.schedule();
  }
  flyToText(text) {
    const placement = parseCameraText(this.space, text, this.camera.fovDegrees);
    new Camera(this.manifest.resolution)
        .set(placement);  // throws if no picture can be taken from there
    this.flyTo(placement);
  }

  async pick(x, y) {
    if (!this.renderer.isReady) return announce(kNoPicture);
    this.panel.pick.set(await this.renderer.pick(x, y));
  }

  async setPivot(x, y) {
    if (!this.renderer.isReady) return announce(kNoPicture);
    const hit = await this.renderer.pick(x, y);
    if (!hit) return announce("There is no surface to orbit around.");
    const {eye, fovDegrees} = this.camera.get();
    if (!(length(subtract(hit.position, eye)) > 0)) return;
    this.flyTo({eye, target: hit.position, fovDegrees});
    announce("The camera orbits around this place.");
  }

  // Updates the page's address without adding a history entry for each motion.
  bookmark() {
    if (this.bookmarkTimer) return;
    this.bookmarkTimer = setTimeout(() => {
      this.bookmarkTimer = null;
      if (this.signal.aborted || !this.bookmarks) return;
      this.panel.showCamera(cameraText(this.space, this.camera));
      const fragment = `#${fragmentText(this.bookmarkMembers())}`;
      try {
        history.replaceState(null, "", fragment);
        this.fragment = fragment;
      } catch {
        // The browser refuses a change after too many changes. The next motion updates the address.
      }
    }, kBookmarkDelayMs);
  }

  bookmarkMembers() {
    const {level, wire, clip, occlusion, shadows, color} = this.options;
    return {
      ...cameraFragment(this.space, this.camera),
      level: level < this.manifest.levels ? level : null,
      wire,
      clip: clip && [...clip.low, ...clip.high].join(","),
      occlusion: occlusion ? null : 0,
      shadows: shadows ? null : 0,
      color: color ? null : 0
    };
  }

  // Sets camera and options from the fragment of the page's address, which may have changed. An
  // invalid camera in the fragment is ignored; a message reports this until the camera moves.
  followBookmark(fragment) {
    if (fragment === this.fragment) return;
    const members = new URLSearchParams(this.bookmarks ? fragment.slice(1) : "");
    this.motion.stop();
    this.refusal = "";
    try {
      const placement = parseCameraFragment(this.space, members, kDefaultFov);
      if (placement) this.camera.set(placement);
    } catch (error) {
      this.refusal = `The camera of the address cannot be used. ${error.message}`;
      announce(this.refusal);
    }
    this.setOptions(this.optionsOf(members));
  }

  optionsOf(members) {
    const options = this.defaultOptions();
    const {levels, resolution} = this.manifest;
    const level = (name, coarsest) => /^\d+$/.test(members.get(name) ?? "") ?
        Math.min(Math.max(Number(members.get(name)), coarsest), levels) :
        null;
    const corners = (members.get("clip") ?? "").split(",").map(Number);
    const box = corners.map((c) => Math.min(Math.max(Math.round(c), 0), resolution));
    const isBox = box.length === 6 && corners.every(Number.isFinite) &&
        [0, 1, 2].every((axis) => box[axis] < box[axis + 3]);
    return {
      ...options,
      level: level("level", 1) ?? options.level,
      wire: level("wire", 0),
      clip: isBox ? {low: box.slice(0, 3), high: box.slice(3)} : null,
      occlusion: members.get("occlusion") !== "0",
      shadows: members.get("shadows") !== "0",
      color: members.get("color") !== "0"
    };
  }

  // Draws a picture and saves it immediately, because the drawing buffer is valid only until the
  // browser has shown it.
  savePicture() {
    if (!this.renderer.hasDrawn) return announce(kNoPicture);
    this.renderer.frame();
    this.canvas.toBlob((blob) => {
      if (!blob) return announce("The picture could not be saved.");
      const url = URL.createObjectURL(blob);
      const link = h("a", {href: url, download: `${this.fileName}.png`});
      document.body.append(link);
      link.click();
      link.remove();
      setTimeout(() => URL.revokeObjectURL(url), 60000);
      announce("The picture is saved.");
    }, "image/png");
  }

  showStatistics() {
    if (this.signal.aborted) return;
    const statistics = this.renderer.statistics();
    this.panel.showStatistics(statistics);
    const {problem} = this.renderer;
    this.showStatus(this.currentStatus(problem, statistics.loading), problem?.code === "replaced");
    this.places.status.classList.toggle("bad", Boolean(problem || this.refusal));
  }

  currentStatus(problem, loading) {
    if (this.renderer.context.isLost) return "The graphics card is not available: waiting for it.";
    if (problem) return problemText(problem);
    if (this.refusal) return this.refusal;
    return loading > 0 ? `Loading ${loading} ${loading === 1 ? "tile" : "tiles"}…` : "";
  }

  showStatus(text, canReload) {
    if (text === this.statusText) return;
    this.statusText = text;
    const {status} = this.places, on = {click: () => location.reload()};
    status.replaceChildren(text);
    if (canReload) status.append(" ", h("button", {type: "button", class: "small", on}, "Reload"));
  }
}

function problemText({code, message}) {
  if (code === "unauthorized") return "The service no longer accepts the token: reload the page.";
  return code === "unreachable" ? `${message} Missing parts are drawn coarse and requested again.` :
                                  message;
}
