// Creates elements by code, because the content security policy forbids inline scripts and styles.
// Text that is set by code is never parsed as markup.

const kSvg = "http://www.w3.org/2000/svg";

// Returns a new element: h("a", {class: "x", href: "…", on: {click: f}}, "text", other). Children
// and attributes with the value null, undefined or false are left out.
export function h(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes = {}, ...children) {
  return fill(document.createElementNS(kSvg, tag), attributes, children);
}

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "on") {
      for (const [event, listener] of Object.entries(value))
        element.addEventListener(event, listener);
    } else if (value !== null && value !== undefined && value !== false) {
      element.setAttribute(name, value === true ? "" : value);
    }
  }
  element.append(...children.flat().filter(
      (child) => child !== null && child !== false && child !== undefined));
  return element;
}

// Sets the text only if it has changed. So selections are preserved and screen readers are not
// disturbed.
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function clear(element, ...children) {
  element.replaceChildren(...children.flat().filter(Boolean));
  return element;
}

// Announces a text to screen readers only.
export function announce(text) {
  document.getElementById("announcer").textContent = text;
}

// Returns a labeled control; `hint` is the control's accessible description.
export function field(label, control, hint = null) {
  const id = control.id || `f-${++field.count}`;
  control.id = id;
  if (hint) control.setAttribute("aria-describedby", `${id}-hint`);
  return h("div", {class: "field"}, h("label", {for: id
           }, label), control, hint && h("p", {class: "hint", id: `${id}-hint`}, hint));
}
field.count = 0;

// Returns an entry of a definition list.
export function fact(name, ...value) {
  return h("div", {class: "fact"}, h("dt", {}, name), h("dd", {}, ...value));
}

// Opens a modal dialog. Resolves to true if the user confirms `action`.
export function confirmAction(title, text, action) {
  const dialog =
      h("dialog", {class: "ask", "aria-labelledby": "ask-title"},
        h("form", {method: "dialog"}, h("h2", {id: "ask-title"}, title), h("p", {}, text),
          h("div", {class: "buttons end"}, h("button", {value: "no", class: "quiet"}, "No"),
            h("button", {value: "yes", class: "danger"}, action))));
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) => dialog.addEventListener("close", () => {
    dialog.remove();
    resolve(dialog.returnValue === "yes");
  }));
}
