// The actions that the state of a job allows.

import {sendJson, token} from "../lib/api.js";
import {clear, confirmAction, h} from "../lib/dom.js";
import {hasEnded} from "../lib/format.js";
import {saveFile} from "../lib/save_file.js";

import {copyButton, problemBox} from "./parts.js";

// Returns the elements for the actions on a job. `reload` is called after each action.
export function actions(job, reload) {
  const error = h("div", {role: "alert"});
  const button = (text, action, kind = "") => actionButton(text, action, kind, error);
  const post = (name) => async () => {
    await sendJson("POST", `${job.links.self}/${name}`);
    await reload();
  };
  const cancel = async () => {
    if (await confirmAction(
            "Cancel this job?", "Its partial result will be deleted.", "Cancel the job"))
      await post("cancel")();
  };
  const may = (...states) => states.includes(job.state);
  const buttons = [
    may("succeeded") && button("Download", () => saveFile(resultFile(job)), "primary"),
    may("succeeded") && viewLink(job),
    may("suspended") && button("Resume", post("resume"), "primary"),
    may("failed", "canceled") && button("Retry", post("retry"), "primary"),
    may("queued", "running") && button("Suspend", post("suspend")),
    may("running", "suspended") && viewLink(job),
    may("queued", "running", "suspended") && button("Cancel", cancel, "danger"),
    hasEnded(job.state) && button("Delete", () => deleteJob(job), "danger"),
    may("succeeded") && copyLink(job),
  ];
  return [h("div", {class: "buttons"}, buttons), error];
}

// Returns a button that is busy while its action runs. If the action throws Problem, the element
// `error` shows it.
export function actionButton(text, action, kind, error) {
  const element =
      h("button", {type: "button", class: kind, "data-action": text.toLowerCase()}, text);
  element.addEventListener("click", async () => {
    if (element.hasAttribute("aria-busy")) return;
    element.setAttribute("aria-busy", "true");  // a disabled button would lose the focus
    clear(error);
    try {
      await action();
    } catch (problem) {
      if (problem.code === undefined) throw problem;
      clear(error, problemBox(problem));
    } finally {
      element.removeAttribute("aria-busy");
    }
  });
  return element;
}

function viewLink(job) {
  return h("a", {class: "button", href: `/viewer.html?job=${job.id}`}, "View");
}

function copyLink(job) {
  return h("a", {class: "button quiet", href: `#/new?like=${job.id}`}, "Copy to new job");
}

async function deleteJob(job) {
  const text = job.state === "succeeded" ? "Its result, report and log will be deleted." :
                                           "Its log will be deleted.";
  if (!await confirmAction("Delete this job?", text, "Delete the job")) return;
  await sendJson("DELETE", job.links.self);
  location.hash = "#/";
}

// Returns the name of the result's file: the same as the service gives to a download.
function fileName(job) {
  const scene = Array.isArray(job.scene) ? job.scene[0] : job.scene;
  const base = job.name || scene.split("/").pop().replace(/\.[^.]*$/, "");
  return `${base.replace(/[^A-Za-z0-9._-]+/g, "-").slice(0, 100)}-${job.resolution}.vdag`;
}

function resultFile(job) {
  return {href: job.links.dag, name: fileName(job), bytes: job.result.bytes};
}

// Returns an element with a shell command that downloads the job's result. This command can resume
// the download after a lost connection.
export function downloadCommand(job) {
  const text = `voxdag download ${job.id} -o ${fileName(job)} --server ${location.origin}` +
      (token.get() ? " --token-file FILE" : "");
  return h("div", {class: "command"}, h("code", {}, text), copyButton(text, "the command"));
}
