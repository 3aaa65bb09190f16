// Numbers, sizes and times in the formats of the command line.

const kThinSpace = "\u2009";

// Returns a count with a thin space between groups of digits: 2567687158 -> "2 567 687 158".
export function countText(count) {
  return String(Math.round(count)).replace(/\B(?=(\d{3})+$)/g, kThinSpace);
}

// 1234567 -> "1.23 M"
export function shortCount(count) {
  let suffix = "";
  for (const larger of ["k", "M", "G", "T"]) {
    if (count < 999.5) break;
    count /= 1000;
    suffix = larger;
  }
  if (suffix) return `${threeDigits(count)} ${suffix}`;
  return count >= 100 || Number.isInteger(count) ? count.toFixed(0) : count.toPrecision(2);
}

function threeDigits(number) {
  return number.toFixed(number < 9.995 ? 2 : number < 99.95 ? 1 : 0);
}

// Returns a count with its unit: 12, "subvolumes" -> "12 subvolumes"; 1, "files" -> "1 file".
export function unitText(text, unit) {
  return `${text} ${text === "1" ? unit.replace(/s$/, "") : unit}`;
}

// Joins the texts of two values to a range. If both have the same unit, the unit is written once:
// "1.40 MiB", "3.20 MiB" -> "1.40 – 3.20 MiB".
export function rangeText(low, high) {
  const unit = / [A-Za-z]+$/.exec(high)?.[0];
  return `${unit && low.endsWith(unit) ? low.slice(0, -unit.length) : low} – ${high}`;
}

// 1342177280 -> "1.25 GiB"
export function sizeText(bytes) {
  const units = ["B", "KiB", "MiB", "GiB", "TiB", "PiB"];
  let unit = 0;
  for (; bytes >= 1000 && unit < 5; ++unit) bytes /= 1024;
  return unit === 0 ? `${Math.round(bytes)} B` : `${threeDigits(bytes)} ${units[unit]}`;
}

// Returns the text of a duration: 64 -> "1 m 04 s", 0.046 -> "46 ms".
export function durationText(seconds) {
  if (seconds > 0 && seconds < 0.9995) return `${Math.max(1, Math.round(1000 * seconds))} ms`;
  const whole = Math.round(seconds);
  const two = (n) => String(n).padStart(2, "0");
  if (whole >= 86400)
    return `${Math.floor(whole / 86400)} d ${two(Math.floor(whole / 3600) % 24)} h`;
  if (whole >= 3600) return `${Math.floor(whole / 3600)} h ${two(Math.floor(whole / 60) % 60)} m`;
  if (whole >= 60) return `${Math.floor(whole / 60)} m ${two(whole % 60)} s`;
  return `${seconds.toFixed(1)} s`;
}

// Returns the distance of a time from now: "just now", "5 min ago", "in 3 min".
export function agoText(time) {
  const seconds = (Date.now() - Date.parse(time)) / 1000;
  const away = Math.abs(seconds);
  if (away < 45) return seconds >= 0 ? "just now" : "in a moment";
  const [n, unit] = away < 5400 ? [away / 60, "min"] :
      away < 129600             ? [away / 3600, "h"] :
                                  [away / 86400, "days"];
  const text = `${Math.round(n)} ${unit}`;
  return seconds >= 0 ? `${text} ago` : `in ${text}`;
}

// Returns the text of a time in the local time zone: "2026-11-21 07:00:00".
export function timeText(time) {
  const date = new Date(time);
  const two = (n) => String(n).padStart(2, "0");
  return `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())} ` +
      `${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
}

export function gridText(resolution) {
  return `${resolution}³`;
}

export function sceneText(job) {
  const scenes = Array.isArray(job.scene) ? job.scene : [job.scene];
  return scenes.map((scene) => scene.split("/").pop()).join(", ");
}

export function titleText(job) {
  return job.name || sceneText(job);
}

// Returns a warning of a job as a sentence.
export function warningText({place, message, count}) {
  return (place ? `${place}: ` : "") + message + (count > 1 ? ` (${count} times)` : "");
}

export function stateText(state) {
  return state === "canceling" ? "canceling…" : state;
}

export function hasEnded(state) {
  return ["canceled", "failed", "succeeded"].includes(state);
}

// Returns the labels of a job as text, "#a #b", or "" if it has none.
export function labelsText(job) {
  return (job.labels ?? []).map((label) => `#${label}`).join(" ");
}
