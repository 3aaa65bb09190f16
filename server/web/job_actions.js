// What may be done to a job in its state.

import {request, send_json, token} from "./api.js";
import {clear, confirm_deed, h} from "./dom.js";
import {has_ended, size_text, title_text} from "./format.js";
import {copy_button, problem_box} from "./parts.js";

const kLargestInMemory = 2 ** 30;

// `reload` is called after each action.
export function actions(job, reload) {
  const trouble = h("div", {role: "alert"});
  const post = (verb) => async () => {
    await send_json("POST", `${job.links.self}/${verb}`);
    await reload();
  };
  const button = (text, action, kind = "") => {
    const element = h("button", {type: "button", class: kind, "data-action": text.toLowerCase()}, text);
    element.addEventListener("click", async () => {
      if (element.hasAttribute("aria-busy")) return;
      element.setAttribute("aria-busy", "true");  // a disabled button would lose the focus
      clear(trouble);
      try {
        await action();
      } catch (problem) {
        if (problem.code === undefined) throw problem;
        clear(trouble, problem_box(problem));
      } finally {
        element.removeAttribute("aria-busy");
      }
    });
    return element;
  };
  const may = (...states) => states.includes(job.state);
  const buttons = [
    may("succeeded") && button("Download", () => download(job), "primary"),
    may("suspended") && button("Resume", post("resume"), "primary"),
    may("failed", "canceled") && button("Retry", post("retry"), "primary"),
    may("queued", "running") && button("Suspend", post("suspend")),
    may("queued", "running", "suspended") && button("Cancel", async () => {
      if (await confirm_deed("Cancel this job?", "What it has built so far is thrown away.", "Cancel the job"))
        await post("cancel")();
    }, "danger"),
    has_ended(job.state) && button("Delete", async () => {
      const what = job.state === "succeeded" ? "Its result, report and log go with it." : "Its log goes with it.";
      if (!await confirm_deed("Delete this job?", what, "Delete the job")) return;
      await send_json("DELETE", job.links.self);
      location.hash = "#/";
    }, "danger"),
    may("succeeded") && h("a", {class: "button quiet", href: `#/new?like=${job.id}`}, "Another like this"),
  ];
  return [h("div", {class: "buttons"}, buttons), trouble];
}

function file_name(job) {
  return `${title_text(job).replace(/\.(glb|gltf)$/, "").replace(/[^A-Za-z0-9._-]+/g, "-") || "scene"}.vdag`;
}

// Without a token the browser's own download does it, which can be resumed. A link cannot carry a
// token; then the bytes go to a file chosen here where the browser can do that, else over memory.
async function download(job) {
  const name = file_name(job);
  if (!token.get()) return click_link(job.links.dag, name);
  if (window.showSaveFilePicker) {
    const handle = await window.showSaveFilePicker({suggestedName: name}).catch(() => null);
    if (!handle) return;
    const response = await request("GET", job.links.dag);
    await response.body.pipeTo(await handle.createWritable());
    return;
  }
  if (job.result.bytes > kLargestInMemory) throw {code: "too_large", detail:
    `This browser cannot save ${size_text(job.result.bytes)} with a token: use the command under "Result".`};
  const url = URL.createObjectURL(await (await request("GET", job.links.dag)).blob());
  click_link(url, name);
  setTimeout(() => URL.revokeObjectURL(url), 60000);
}

function click_link(href, name) {
  const link = h("a", {href, download: name});
  document.body.append(link);
  link.click();
  link.remove();
}

// The same download in a terminal, which goes on after a broken connection.
export function download_command(job) {
  const text = `voxdag download ${job.id} -o ${file_name(job)} --server ${location.origin}` +
               (token.get() ? " --token-file FILE" : "");
  return h("div", {class: "command"}, h("code", {}, text), copy_button(text, "the command"));
}
