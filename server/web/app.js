// The frame of all pages: routing by URL fragment, the login, the menu.

import {get_json, Problem, request, token} from "./lib/api.js";
import {clear, h, set_text} from "./lib/dom.js";
import {job_page} from "./pages/job_page.js";
import {jobs_page} from "./pages/jobs_page.js";
import {login_page} from "./pages/login_page.js";
import {new_job_page} from "./pages/new_job_page.js";
import {problem_box} from "./views/parts.js";

const main = document.getElementById("main");
const sign_out = document.getElementById("sign-out");
let page_lifetime = new AbortController();  // aborts the requests of the page being left

// A page is a function (params, query, signal) -> {title, content}.
const kRoutes = [
  [/^\/$/, "jobs", jobs_page],
  [/^\/new$/, "new", new_job_page],
  [/^\/jobs\/([0-9a-f]{1,32})$/, "job", job_page],
];

function show(page) {
  page_lifetime.abort();
  page_lifetime = new AbortController();
  const {title, content} = page(page_lifetime.signal);
  document.title = `${title} · voxdag`;
  clear(main, content);
  window.scrollTo(0, 0);
  sign_out.hidden = !token.get();
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
    show(() => ({title: "Not found", content:
      problem_box(new Problem(404, "not_found", `There is no page ${path}.`))}));
  }
  if (focus) main.focus({preventScroll: true});
}

window.addEventListener("hashchange", () => route());
window.addEventListener("voxdag-login", () => {
  const token_rejected = Boolean(token.get());
  token.remove();
  show(() => login_page(token_rejected, () => route()));
});
sign_out.addEventListener("click", async () => {
  token.remove();
  await request("GET", "/api/v1/jobs?limit=1").catch(() => {});
});

route({focus: false});
get_json("/version").then(({version}) => set_text(document.getElementById("version"), `voxdag ${version}`))
                    .catch(() => {});
