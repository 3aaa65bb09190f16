// The viewer: the picture, what moves it, and the panel.

import {announce, h} from "../lib/dom.js";
import {Camera} from "./camera.js";
import {camera_fragment, camera_text, fragment_text, GridSpace, parse_camera_fragment, parse_camera_text} from "./camera_text.js";
import {Controls} from "./controls.js";
import {keys_help, listen_to_keys} from "./keys.js";
import {Markers} from "./markers.js";
import {Motion} from "./motion.js";
import {Panel} from "./panel.js";
import {length, scale, subtract} from "./vector.js";

const kDefaultFov = 35;
const kPictureAspect = 16 / 9;   // of the views in the manifest
const kSeenInterval_ms = 250;    // between two looks at how far away things are
const kFirstSeen_ms = 2000;      // until the first: it needs a program of its own
const kStatisticsInterval_ms = 500;
const kNoPicture = "There is no picture yet.";
const kBookmarkDelay_ms = 400;    // browsers refuse more than 100 changes of the address in 30 s

export class Viewer {
  // `renderer` may start later; `places` are the elements {panel, tools, status}. With `bookmarks` the
  // fragment of the address is that of the camera. Ends when `signal` aborts.
  constructor({canvas, renderer, manifest, places, file_name, signal, bookmarks = true}) {
    Object.assign(this, {canvas, renderer, manifest, places, file_name, signal, bookmarks});
    this.space = new GridSpace(manifest);
    this.camera = new Camera(manifest.resolution);
    this.options = this.default_options();
    this.seen = {distance: manifest.resolution, time: -Infinity};
    this.motion = new Motion(this.camera, () => this.seen.distance);
    this.markers = new Markers(canvas.parentElement);
    this.panel = new Panel(this);
    places.panel.replaceChildren(this.panel.element);
    this.controls = new Controls(canvas, this.camera, this.motion, {
      pick: async (x, y) => (await renderer.pick(x, y))?.position ?? null,
      on_click: (x, y) => this.pick(x, y),
      on_double_click: (x, y) => this.set_pivot(x, y),
      on_change: () => this.schedule(),
    }, signal);
    listen_to_keys(bookmarks ? window : canvas, canvas, this.motion, this.actions(), () => this.schedule(), signal);
    for (const button of places.tools.querySelectorAll("[data-tool]"))
      button.addEventListener("click", () => this.actions()[button.dataset.tool](), {signal});
    this.save_button = places.tools.querySelector('[data-tool="screenshot"]');
    this.save_button.disabled = true;  // until there is a picture
    const resizes = new ResizeObserver(() => this.resize());
    resizes.observe(canvas);
    if (bookmarks) window.addEventListener("hashchange", (event) => this.follow_bookmark(new URL(event.newURL).hash), {signal});
    const timer = setInterval(() => this.show_statistics(), kStatisticsInterval_ms);
    signal.addEventListener("abort", () => {
      clearInterval(timer);
      resizes.disconnect();
      this.markers.dispose();
      renderer.dispose();
    }, {once: true});
    this.resize();
    this.camera.set(this.first_camera());
    this.follow_bookmark(location.hash);
    this.show_mode();
    // What is seen first need not be waited for: until then the target is as good.
    this.seen.distance = this.camera.distance;
    this.seen.time = performance.now() + kFirstSeen_ms;
    this.apply_camera();
  }

  default_options() {
    return {level: this.manifest.levels, wire: null, clip: null, occlusion: true, shadows: true, color: true};
  }

  first_camera() {
    const {camera} = this.manifest;
    return camera ? this.fit(this.space.placement(camera)) : this.camera.get();
  }

  // A scene that fits a wide picture is moved away until it fits a narrow one too.
  fit(placement) {
    const aspect = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
    const outside = placement.eye.some((c) => c < 0 || c > this.manifest.resolution);
    if (!outside || aspect >= kPictureAspect) return placement;
    const offset = scale(subtract(placement.eye, placement.target), Math.min(4, kPictureAspect / aspect));
    return {...placement, eye: placement.target.map((c, axis) => c + offset[axis])};
  }

  actions() {
    const center = () => [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2];
    return {
      toggle_fly: () => {
        this.motion.flying = !this.motion.flying;
        this.motion.stop();
        this.show_mode();
        announce(this.motion.flying ? "Flight: the keys and drags look around." : "Orbit.");
      },
      reset: () => {
        this.fly_to(this.first_camera());
        announce("The camera is reset.");
      },
      pick_center: () => this.pick(...center()),
      pivot_center: () => this.set_pivot(...center()),
      toggle_color: () => {
        if (!this.manifest.colors) return announce("The file has no colors.");
        this.set_options({color: !this.options.color});
        announce(this.options.color ? "Colors." : "Gray.");
      },
      measure: () => this.panel.pick.toggle_measure(),
      screenshot: () => this.save_picture(),
      toggle_panel: () => this.toggle_panel(),
      help: () => this.show_help(),
    };
  }

  show_mode() {
    const button = this.places.tools.querySelector('[data-tool="toggle_fly"]');
    button.setAttribute("aria-pressed", String(Boolean(this.motion.flying)));
    this.canvas.classList.toggle("flying", Boolean(this.motion.flying));
  }

  toggle_panel() {
    const {panel, tools} = this.places;
    const had_focus = panel.contains(document.activeElement);
    panel.hidden = !panel.hidden;
    tools.querySelector('[data-tool="toggle_panel"]')?.setAttribute("aria-expanded", String(!panel.hidden));
    if (had_focus) this.canvas.focus();
  }

  show_help() {
    const dialog = h("dialog", {class: "help", "aria-labelledby": "help-title"},
      h("form", {method: "dialog"}, h("h2", {id: "help-title"}, "Keys and pointers"), keys_help(),
        h("div", {class: "buttons end"}, h("button", {class: "primary", autofocus: true}, "Close"))));
    document.body.append(dialog);
    dialog.addEventListener("close", () => {
      dialog.remove();
      this.canvas.focus();
    });
    dialog.showModal();
  }

  resize() {
    if (!this.canvas.clientWidth || !this.canvas.clientHeight) return;
    this.renderer.resize(this.canvas.clientWidth, this.canvas.clientHeight, window.devicePixelRatio || 1);
    this.schedule();
  }

  // Draws until the picture is complete and nothing moves.
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
    this.apply_camera();
    const drawn = this.renderer.frame(now);
    this.save_button.disabled = !this.renderer.has_drawn;
    this.show_markers();
    if (now - this.seen.time > kSeenInterval_ms) this.look_ahead(now);
    if (moving || drawn.moving || !drawn.complete) this.schedule();
  }

  show_markers() {
    this.overlay?.draw(this.camera);
    const {pick, start} = this.panel.pick;
    this.markers.show([pick?.position, start?.position], this.camera, this.canvas.clientWidth, this.canvas.clientHeight);
  }

  apply_camera() {
    const {eye, target, fov_degrees} = this.camera;
    const key = [...eye, ...target, fov_degrees].join();
    if (key === this.camera_key) return;
    if (this.camera_key) this.refusal = "";
    this.camera_key = key;
    this.renderer.setView({eye: [...eye], target: [...target], up: this.camera.axes().up, fovDegrees: fov_degrees});
    this.bookmark();
  }

  // Speeds follow the distance of what is in the center; without anything there, they grow slowly.
  async look_ahead(now) {
    if (this.seen.key === this.camera_key) return;
    this.seen.time = now;
    this.seen.key = this.camera_key;
    const hit = await this.renderer.pick(this.canvas.clientWidth / 2, this.canvas.clientHeight / 2);
    const free = Math.min(1.3 * this.seen.distance, Math.max(this.manifest.resolution / 4, this.camera.distance));
    this.seen.distance = Math.max(1, hit ? hit.distance : free);
  }

  // What the picture shows: {level, wire, clip, occlusion, shadows, color}, any of them.
  set_options(changed) {
    Object.assign(this.options, changed);
    const {level, wire, clip, occlusion, shadows, color} = this.options;
    this.renderer.setOptions({maxLevel: level, wireLevel: wire, clip, ambientOcclusion: occlusion, sunShadows: shadows, color});
    this.panel.show_options(this.options);
    this.bookmark();
    this.schedule();
  }

  fly_to(placement) {
    this.motion.fly_to(placement);
    this.schedule();
  }
  fly_to_text(text) {
    const placement = parse_camera_text(this.space, text, this.camera.fov_degrees);
    new Camera(this.manifest.resolution).set(placement);  // throws if there is no such picture
    this.fly_to(placement);
  }

  async pick(x, y) {
    if (!this.renderer.ready) return announce(kNoPicture);
    this.panel.pick.set(await this.renderer.pick(x, y));
  }

  async set_pivot(x, y) {
    if (!this.renderer.ready) return announce(kNoPicture);
    const hit = await this.renderer.pick(x, y);
    if (!hit) return announce("Nothing there to orbit around.");
    const {eye, fov_degrees} = this.camera.get();
    if (!(length(subtract(hit.position, eye)) > 0)) return;
    this.fly_to({eye, target: hit.position, fov_degrees});
    announce("The camera orbits around this place.");
  }

  // The address bar follows, without an entry in the history for each motion.
  bookmark() {
    if (this.bookmark_timer) return;
    this.bookmark_timer = setTimeout(() => {
      this.bookmark_timer = null;
      if (this.signal.aborted || !this.bookmarks) return;
      this.panel.show_camera(camera_text(this.space, this.camera));
      const fragment = `#${fragment_text(this.bookmark_members())}`;
      try {
        history.replaceState(null, "", fragment);
        this.fragment = fragment;
      } catch {
        // Refused, as after too many changes: the address follows with a later motion.
      }
    }, kBookmarkDelay_ms);
  }

  bookmark_members() {
    const {level, wire, clip, occlusion, shadows, color} = this.options;
    return {...camera_fragment(this.space, this.camera),
            level: level < this.manifest.levels ? level : null, wire,
            clip: clip && [...clip.low, ...clip.high].join(","),
            occlusion: occlusion ? null : 0, shadows: shadows ? null : 0,
            color: color ? null : 0};
  }

  // Takes camera and options from the fragment of an address, which may have changed since. A camera that cannot be used
  // is left out, which the page says until the camera moves.
  follow_bookmark(fragment) {
    if (fragment === this.fragment) return;
    const members = new URLSearchParams(this.bookmarks ? fragment.slice(1) : "");
    this.motion.stop();
    this.refusal = "";
    try {
      const placement = parse_camera_fragment(this.space, members, kDefaultFov);
      if (placement) this.camera.set(placement);
    } catch (error) {
      this.refusal = `The camera of the address cannot be used. ${error.message}`;
      announce(this.refusal);
    }
    this.set_options(this.options_of(members));
  }

  options_of(members) {
    const options = this.default_options();
    const {levels, resolution} = this.manifest;
    const level = (name, coarsest) => /^\d+$/.test(members.get(name) ?? "")
      ? Math.min(Math.max(Number(members.get(name)), coarsest), levels) : null;
    const corners = (members.get("clip") ?? "").split(",").map(Number);
    const box = corners.map((c) => Math.min(Math.max(Math.round(c), 0), resolution));
    const is_box = box.length === 6 && corners.every(Number.isFinite) && [0, 1, 2].every((axis) => box[axis] < box[axis + 3]);
    return {...options, level: level("level", 1) ?? options.level, wire: level("wire", 0),
            clip: is_box ? {low: box.slice(0, 3), high: box.slice(3)} : null,
            occlusion: members.get("occlusion") !== "0", shadows: members.get("shadows") !== "0",
            color: members.get("color") !== "0"};
  }

  // The drawing buffer is only valid until the browser has shown it: draws and reads at once.
  save_picture() {
    if (!this.renderer.has_drawn) return announce(kNoPicture);
    this.renderer.frame(performance.now());
    this.canvas.toBlob((blob) => {
      if (!blob) return announce("The picture could not be saved.");
      const url = URL.createObjectURL(blob);
      const link = h("a", {href: url, download: `${this.file_name}.png`});
      document.body.append(link);
      link.click();
      link.remove();
      setTimeout(() => URL.revokeObjectURL(url), 60000);
      announce("The picture is saved.");
    }, "image/png");
  }

  show_statistics() {
    if (this.signal.aborted) return;
    const statistics = this.renderer.statistics();
    this.panel.show_statistics(statistics);
    const {problem} = this.renderer, {refusal} = this;
    const {loading} = statistics;
    this.show_status(this.renderer.lost ? "The graphics card is not available: waiting for it."
      : problem ? problem_text(problem)
      : refusal ? refusal
      : loading > 0 ? `Loading ${loading} ${loading === 1 ? "tile" : "tiles"}…` : "", problem?.code === "replaced");
    this.places.status.classList.toggle("bad", Boolean(problem || refusal));
  }

  show_status(text, can_reload) {
    if (text === this.status_text) return;
    this.status_text = text;
    this.places.status.replaceChildren(text, ...(can_reload
      ? [" ", h("button", {type: "button", class: "small", on: {click: () => location.reload()}}, "Reload")] : []));
  }
}

function problem_text({code, message}) {
  if (code === "unauthorized") return "The service no longer accepts the token: reload the page.";
  return code === "unreachable" ? `${message} What is missing is drawn coarse and asked for again.` : message;
}
