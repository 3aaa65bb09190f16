// Asks for the bearer token.

import {request, token} from "./api.js";
import {field, h} from "./dom.js";
import {problem_box} from "./parts.js";

export function login_page(was_wrong, signed_in) {
  const input = h("input", {type: "password", autocomplete: "off", required: true, spellcheck: "false"});
  const trouble = h("div", {role: "alert"},
                    was_wrong && h("p", {class: "bad"}, "The service does not know this token."));
  const form = h("form", {class: "card narrow stack"},
    h("h1", {}, "Sign in"),
    h("p", {}, "This service answers only to those who have a token."),
    field("Token", input, "Kept until this tab is closed."), trouble,
    h("div", {class: "buttons"}, h("button", {class: "primary"}, "Sign in")));
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    token.set(input.value.trim());
    try {
      await request("GET", "/api/v1/jobs?limit=1");
      signed_in();
    } catch (problem) {
      if (problem.status !== 401) trouble.replaceChildren(problem_box(problem));
    }
  });
  queueMicrotask(() => input.focus());
  return {title: "Sign in", content: form};
}
