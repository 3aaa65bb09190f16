// Marks a canvas that is used by keys with the class "keyed". Its focus frame and the dot in its
// center are shown only then. The selector :focus-visible is not sufficient: it also matches after
// a script has moved the focus to the canvas because of a click.

const kModifiers = ["Shift", "Control", "Alt", "Meta"];

// `isKeyed`: true if a key has opened the viewer.
export function markKeyUse(canvas, isKeyed, signal) {
  const mark = (keyed) => canvas.classList.toggle("keyed", keyed);
  mark(isKeyed);
  window.addEventListener(
      "keydown", (event) => kModifiers.includes(event.key) || mark(true), {signal, capture: true});
  window.addEventListener("pointerdown", () => mark(false), {signal, capture: true});
}
