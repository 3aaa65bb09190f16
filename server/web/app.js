// The frame of all pages: routing by URL fragment, the login, the menu.

import {authorization, getJson, Problem, request, token} from "./lib/api.js";
import {clear, h, setText} from "./lib/dom.js";
import {sizeText} from "./lib/format.js";
import {jobPage} from "./pages/job_page.js";
import {jobsPage} from "./pages/jobs_page.js";
import {loginPage} from "./pages/login_page.js";
import {newJobPage} from "./pages/new_job_page.js";
import {scenesPage} from "./pages/scenes_page.js";
import {problemBox} from "./views/parts.js";

const main = document.getElementById("main");
const signOut = document.getElementById("sign-out");
let pageLifetime = new AbortController();  // aborts the requests of the page that the user leaves

// A page is a function (params, query, signal) -> {title, content}.
const kRoutes = [
  [/^\/$/, "jobs", jobsPage],
  [/^\/new$/, "new", newJobPage],
  [/^\/scenes$/, "scenes", scenesPage],
  [/^\/jobs\/([0-9a-f]{1,32})$/, "job", jobPage],
];

function show(page) {
  pageLifetime.abort();
  pageLifetime = new AbortController();
  const {title, content} = page(pageLifetime.signal);
  document.title = `${title} · voxdag`;
  clear(main, content);
  window.scrollTo(0, 0);
  signOut.hidden = !token.get();
}

function route({focus = true} = {}) {
  const [path, query = ""] = (location.hash.slice(1) || "/").split("?");
  const found = kRoutes.map(([pattern, name, page]) => [pattern.exec(path), name, page])
                    .find(([match]) => match);
  for (const link of document.querySelectorAll("nav a")) {
    if (found && link.dataset.page === found[1]) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  if (found) {
    const [match, , page] = found;
    show((signal) => page(match.slice(1), new URLSearchParams(query), signal));
  } else {
    show(() => ({
           title: "Not found",
           content: problemBox(new Problem(404, "not_found", `There is no page ${path}.`))
         }));
  }
  if (focus) main.focus({preventScroll: true});
}

window.addEventListener("hashchange", () => {
  route();
  showMachine().catch(() => {});
});
window.addEventListener("voxdag-login", () => {
  const tokenRejected = Boolean(token.get());
  token.remove();
  show(() => loginPage(tokenRejected, () => route()));
});
signOut.addEventListener("click", async () => {
  token.remove();
  await request("GET", "/api/v1/jobs?limit=1").catch(() => {});
});

// Shows the version of the service, and facts about its machine if the user may read them.
async function showMachine() {
  const place = document.getElementById("version");
  const {version} = await getJson("/version");
  setText(place, `voxdag ${version}`);
  // Uses fetch() and ignores errors. getJson() would open the login page if the user has no token.
  const response = await fetch("/api/v1/machine", {headers: authorization()});
  if (!response.ok) return;
  const machine = await response.json();
  setText(place, [
    `voxdag ${version}`,
    `${machine.cores} ${machine.cores === 1 ? "core" : "cores"}`,
    `${sizeText(machine.job_memory_bytes)} of memory for jobs`,
    `${sizeText(machine.free_disk_bytes)} of disk free`,
  ].join(" · "));
}

route({focus: false});
showMachine().catch(() => {});
