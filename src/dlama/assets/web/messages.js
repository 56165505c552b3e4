// Messages, legends, scales and tabs: what the page says, and which pane is open.
import { Failure } from "/server.js";

export const $ = (id) => document.getElementById(id);
export const all = (selector) => [...document.querySelectorAll(selector)];
export const chosen = (name) => document.querySelector(`input[name="${name}"]:checked`).value;
// An element with these properties, and what is in it.
export function make(tag, about = {}, ...inside) {
  const made = Object.assign(document.createElement(tag), about);
  made.append(...inside);
  return made;
}
const choices = (list) => list.map((name) => make("option", { value: name }, name));
export function offer(list, id) { $(id).replaceChildren(...choices(list)); }

// A field of the form, as the server describes it: several choices, a single one to tick, or a text; `fact` describes it, too.
export function formField({ name, label, choices: words, hint, help }, fact) {
  const about = { id: name, name, title: help }, ticked = words.length === 1;
  const field = words.length > 1 ? make("select", about, ...choices(words))
    : make("input", { ...about, ...(ticked ? { type: "checkbox", value: words[0] } : { autocomplete: "off", placeholder: hint }) });
  if (fact) field.setAttribute("aria-describedby", fact);
  if (ticked) return make("div", {}, make("label", { htmlFor: name, className: "check" }, field, label));
  return make("div", {}, make("label", { htmlFor: name }, label), field);
}

// ---- messages
export function clearErrors(...fields) {
  for (const line of all("[data-error]")) if (!fields.length || fields.includes(line.dataset.error)) line.hidden = true;
  if (!fields.length) $("general").hidden = true;
}

export function failed(error, fallback = "") {
  const text = error?.message ?? String(error), field = error?.field || fallback;
  const place = (field && document.querySelector(`[data-error="${field}"]`)) || (fallback && document.querySelector(`[data-error="${fallback}"]`));
  const shown = place && (place.offsetParent !== null || place.closest("section")?.offsetParent != null || !place.closest("[hidden]")) ? place : $("general");
  shown.textContent = text;
  shown.hidden = false;
  const folded = shown.closest("details");
  if (folded) { folded.hidden = false; folded.open = true; }
  const pane = shown.closest('[role="tabpanel"]');
  if (pane?.hidden) openTab(pane.id.replace("pane-", ""));
  shown.scrollIntoView({ block: "nearest" });
  if (!error?.status && !(error instanceof Failure)) console.error(error);
}

export function warnings(id, list) {
  $(id).replaceChildren(...(list ?? []).map((text) => make("p", { className: "note warning" }, text)));
}

const rgb = (color) => `rgb(${color.join(" ")})`;

function swatch(color) {
  const box = make("span", { className: "swatch" });
  box.style.background = rgb(color);
  return box;
}

export const percent = (share) => (share >= 0.0005 ? `${(100 * share).toFixed(1)} %` : "<0.1 %");

export function legend(id, rows) {
  $(id).replaceChildren(...rows.map(({ name, color, share }) => make("li", {}, swatch(color), share === undefined ? name : `${name} ${percent(share)}`)));
}

export function ramp(id, colors, ticks) {
  $(id).querySelector(".bar").style.background = `linear-gradient(to right, ${colors.map(rgb).join(", ")})`;
  $(id).querySelector(".ticks").replaceChildren(...ticks.map((text) => make("span", {}, text)));
}

// ---- tabs
export const TABS = ["source", "preview", "result", "scene"];
// What is to happen when one of them is opened.
export const onOpen = {};

export function openTab(name, focus = false) {
  for (const one of TABS) {
    const tab = $(`tab-${one}`), on = one === name;
    tab.setAttribute("aria-selected", on);
    tab.tabIndex = on ? 0 : -1;
    $(`pane-${one}`).hidden = !on;
    if (on && focus) tab.focus();
  }
  onOpen[name]?.();
}

export const enable = (name, on) => { $(`tab-${name}`).disabled = !on; };
for (const name of TABS) $(`tab-${name}`).addEventListener("click", () => openTab(name));
$("tabs").addEventListener("keydown", (event) => {
  const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (!step) return;
  const open = TABS.filter((name) => !$(`tab-${name}`).disabled);
  const now = open.findIndex((name) => $(`tab-${name}`).getAttribute("aria-selected") === "true");
  openTab(open[(now + step + open.length) % open.length], true);
  event.preventDefault();
});
