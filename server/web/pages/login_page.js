// The form for the bearer token.

import {request, token} from "../lib/api.js";
import {field, h} from "../lib/dom.js";
import {problemBox} from "../views/parts.js";

export function loginPage(tokenRejected, signedIn) {
  const input =
      h("input", {type: "password", autocomplete: "off", required: true, spellcheck: "false"});
  const error =
      h("div", {role: "alert"},
        tokenRejected && h("p", {class: "bad"}, "The service does not know this token."));
  const form =
      h("form", {class: "card narrow stack"}, h("h1", {}, "Sign in"),
        h("p", {}, "This service requires an access token."),
        field("Token", input, "Stored until this tab is closed."), error,
        h("div", {class: "buttons"}, h("button", {class: "primary"}, "Sign in")));
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    token.set(input.value.trim());
    try {
      await request("GET", "/api/v1/jobs?limit=1");
      signedIn();
    } catch (problem) {
      if (problem.status !== 401) error.replaceChildren(problemBox(problem));
    }
  });
  queueMicrotask(() => input.focus());
  return {title: "Sign in", content: form};
}
