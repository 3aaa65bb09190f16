// Gives a canvas the class "keyed" while the user uses keys. Only then, the style sheet shows the
// focus frame and the dot in the center of the canvas. The selector :focus-visible would not be
// sufficient: it also matches if a script has moved the focus to the canvas because of a click.

const kModifiers = ["Shift", "Control", "Alt", "Meta"];

// `isKeyed` is the initial state: true if the user has opened the viewer with the keyboard. Stops
// when `signal` aborts.
export function markKeyUse(canvas, isKeyed, signal) {
  const mark = (keyed) => canvas.classList.toggle("keyed", keyed);
  mark(isKeyed);
  window.addEventListener(
      "keydown", (event) => kModifiers.includes(event.key) || mark(true), {signal, capture: true});
  window.addEventListener("pointerdown", () => mark(false), {signal, capture: true});
}
