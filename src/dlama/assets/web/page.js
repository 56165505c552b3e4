// The page: from the picture over marks and camera to the result. What the server says is shown next to the field it is about.
import { rolesOf } from "/files.js";
import { Marker } from "/marker.js";
import { $, TABS, all, chosen, clearErrors, enable, failed, formField, make, offer, onOpen, openTab, percent, ramp, warnings } from "/messages.js";
import { UNITS, request, showMove, showPreview } from "/move.js";
import { noResult, repaint, showResult } from "/result.js";
import * as server from "/server.js";

const NAMES = { picture: "Picture", depth: "Depth", camera: "Camera", right: "Right", calib: "Calibration" };
const STAGES = { prepare: "preparing", render: "rendering", fill: "filling", fuse: "fusing", exchange: "what the other eye saw", estimate: "estimating depth" };
let settings, source = null;

// ---- 1 the picture
function takeFiles(list) {
  const files = [...list];
  if (files.length) server.inTurn(() => shownWhile(() => taken(files), ""));
}

// What is refused is named once the others are read: alone at its field, else where it stays next to what is said of those.
async function taken(files) {
  clearErrors();
  const have = Object.fromEntries(all("#uploads li").map((item) => [item.dataset.role, true]));
  const fits = (file) => file.size <= settings.limits.bytes;
  const { found, left, masks } = rolesOf(files.filter(fits), have, settings.roles);
  const refused = files.filter((file) => !fits(file)).map(tooLarge);
  refused.push(...left.map(([file, why]) => new server.Failure(`${file.name}: ${why}`, "")));
  if (found.picture && have.picture) resetOptions();
  if (found.picture && files.length - refused.length === 1 && have.picture) await server.ask("start_over");
  let sent = 0;
  for (const [role, file] of Object.entries(found)) {
    const error = await send(role, file);
    if (error) refused.push(error); else sent += 1;
  }
  if (sent) await read(); else await refresh();
  refused.push(...masks.map((file) => new server.Failure(`${file.name}: masks are made here, by clicks, a box or the brush; the command line takes the file by --mask`, "")));
  if (refused.length) failed(files.length > 1 ? new server.Failure(refused.map((error) => error.message).join("\n"), "") : refused[0], "");
}

const tooLarge = (file) => new server.Failure(`${file.name}: has ${(file.size / 2 ** 20).toFixed(0)} MB; up to ${(settings.limits.bytes / 2 ** 20).toFixed(0)} MB are taken`, "picture");

// Why the server does not take the file; null: it does.
async function send(role, file) {
  try { await server.upload(role, file); return null; } catch (error) { return error; }
}

async function refresh() { showUploads((await server.ask("state")).files); }

function showUploads(files) {
  $("uploads").replaceChildren(...Object.entries(files).map(([role, name]) => {
    const button = make("button", { type: "button", ariaLabel: `Remove ${name}` }, "✕");
    button.addEventListener("click", () => server.inTurn(async () => { await server.ask("forget", { role }); await read(); }));
    const called = "right" in files && role === "picture" ? "Left" : NAMES[role];
    const item = make("li", { title: name }, make("span", { className: "role" }, called), make("span", { className: "name" }, name), button);
    item.dataset.role = role;
    return item;
  }));
  const any = Object.keys(files).length > 0;
  $("reading").hidden = !any || "right" in files || "calib" in files;
  document.querySelector('[data-for="depth"]').hidden = !("depth" in files);
}

async function read() {
  clearErrors();
  noSource();
  const state = await server.ask("state");
  showUploads(state.files);
  if (!Object.keys(state.files).length) return;
  await shownWhile(async () => showSource(await server.ask("read", Object.fromEntries(new FormData($("fields"))))), "picture");
}

async function shownWhile(work, fallback) {
  document.body.ariaBusy = "true";
  for (const words of all(".busy")) words.hidden = false;
  try { await work(); } catch (error) { failed(error, fallback); } finally {
    document.body.ariaBusy = "false";
    for (const words of all(".busy")) words.hidden = true;
  }
}

function noSource() {
  source = null;
  noResult();
  $("run-words").textContent = "";
  marker.reset();
  $("empty").hidden = false;
  document.body.classList.remove("loaded");
  for (const id of ["marker", "source-bar", "card-marks", "card-move", "card-do", "card-home"]) $(id).hidden = true;
  for (const name of TABS.slice(1)) enable(name, false);
  for (const line of all("[data-fact]")) line.textContent = "";
  for (const id of ["read-warnings", "result-warnings"]) warnings(id, []);
  $("mask-fact").textContent = "";
  $("candidate-row").hidden = true;
  openTab("source");
}

async function showSource(state) {
  source = state.source;
  showUploads(state.files);
  for (const [name, value] of Object.entries(state.fields ?? {})) {
    const field = $("fields").elements[name];
    if (field && field.type !== "checkbox") field.value = value; else if (field) field.checked = Boolean(value);
  }
  for (const line of all("[data-fact]")) line.textContent = source.facts[line.dataset.fact] ?? "";
  warnings("read-warnings", state.warnings);
  for (const id of ["marker", "source-bar", "card-marks", "card-move", "card-do"]) $(id).hidden = false;
  $("empty").hidden = true;
  document.body.classList.add("loaded");
  document.documentElement.style.setProperty("--aspect", source.width / source.height);
  fitBrush(Math.max(source.width, source.height));
  document.querySelector('input[name="shown"][value="color"]').checked = true;
  $("source-ramp").hidden = true;
  marker.reset();
  marker.show(await server.bitmap("source"), source.width, source.height);
  showMarkButtons();
  enable("preview", true);
  openTab("source");
}

$("files").addEventListener("change", () => { takeFiles($("files").files); $("files").value = ""; });
for (const name of ["dragover", "dragenter"]) document.addEventListener(name, (event) => { event.preventDefault(); $("drop").classList.add("over"); $("empty").classList.add("over"); });
for (const name of ["dragleave", "drop"]) document.addEventListener(name, () => { $("drop").classList.remove("over"); $("empty").classList.remove("over"); });
document.addEventListener("drop", (event) => { event.preventDefault(); takeFiles(event.dataTransfer.files); });
$("fields").addEventListener("submit", (event) => { event.preventDefault(); server.inTurn(read); });
$("method-fields").addEventListener("submit", (event) => event.preventDefault());
for (const input of all('input[name="shown"]')) input.addEventListener("change", () => shownWhile(async () => {
  const { blob, headers } = await server.fetched("source", { kind: chosen("shown") });
  marker.show(await createImageBitmap(blob), source.width, source.height);
  const scale = JSON.parse(headers.get("X-Ramp") ?? "null");
  $("source-ramp").hidden = !scale;
  if (scale) ramp("source-ramp", scale.colors, scale.metres.map((v) => `${v} m`));
}, "picture"));

function showSettings() {
  $("examples").replaceChildren(...Object.entries(settings.examples).map(([name, title]) => {
    const button = make("button", { type: "button" }, title);
    button.dataset.example = name;
    button.addEventListener("click", () => server.inTurn(() => shownWhile(async () => {
      clearErrors();
      noSource();
      $("fields").reset();
      resetOptions();
      await showSource(await server.ask("example", { name }));
    }, "")));
    return button;
  }));
  $("role-inputs").replaceChildren(...Object.entries(settings.roles).map(([role, endings]) => {
    const input = make("input", { type: "file", id: `file-${role}`, accept: endings.join(",") });
    input.addEventListener("change", () => {
      const [file] = input.files;
      input.value = "";
      if (file) server.inTurn(async () => {
        clearErrors();
        // Depth that was taken for the right picture before.
        if (role === "depth" && all("#uploads li").some((one) => one.dataset.role === "right" && one.title === file.name)) await server.ask("forget", { role: "right" });
        const error = file.size > settings.limits.bytes ? tooLarge(file) : await send(role, file);
        if (role === "picture") resetOptions();
        if (error) failed(error, role); else await read();
      });
    });
    return make("div", { className: "file-row" }, make("label", { htmlFor: `file-${role}` }, NAMES[role]), input);
  }));
  $("files").accept = [...new Set(Object.values(settings.roles).flat())].join(",");
  for (const box of all("[data-form]")) box.replaceChildren(...settings.form[box.dataset.form].map((field) => formField(field, box.dataset.factOf)));
}

// ---- 2 marks
const marker = new Marker($("canvas"), () => sendMarks());
let marking = 0;
onOpen.source = () => marker.draw();

function showMarkButtons() {
  $("undo").disabled = $("clear").disabled = !marker.marks.length;
}

// Only the newest marks are sent; those before them that still wait for their turn are not.
function sendMarks() {
  showMarkButtons();
  const number = ++marking;
  server.inTurn(() => (number === marking && source ? findMask() : null));
}

async function findMask() {
  clearErrors("marks");
  await shownWhile(async () => {
    const sent = marker.marks;
    const answer = await server.ask("mark", { marks: sent, with_shadow: $("shadow").checked, candidate: $("candidate").value || "object", grow: Number($("grow").value) })
      .catch((error) => { if (error.status === 400) { marker.refuse(sent); showMarkButtons(); } throw error; });
    marker.accepted = sent;
    await showMask(answer);
    askPreview(true);
  }, "marks");
}

async function showMask({ share, notes, candidates, chosen }) {
  marker.setMask(share > 0 ? await server.bitmap("mask") : null);
  $("mask-fact").textContent = share > 0 ? [`${percent(share)} of the picture`, ...notes].join("; ") : "";
  $("candidate-row").hidden = candidates.length < 2;
  offer(candidates, "candidate");
  $("candidate").value = chosen;
}

for (const input of all('input[name="tool"]')) input.addEventListener("change", () => {
  marker.tool = chosen("tool");
  $("brush-row").hidden = !["add", "erase"].includes(marker.tool);
  if ($("pane-source").hidden) openTab("source");
});
$("brush").addEventListener("input", takeBrush);
function takeBrush() {
  marker.brush = Number($("brush").value);
  $("brush").nextElementSibling.textContent = `${marker.brush} px`;
}
// On the screen it is as wide whatever the size of the picture: pixels of the picture are smaller in a larger one.
function fitBrush(longest) {
  const widest = Math.min(500, Math.max(80, Math.round(longest / 6.4)));
  if (Number($("brush").max) === widest) return;
  $("brush").max = widest;
  $("brush").value = Math.max(14, Math.round(longest / 36.6));
  takeBrush();
}
$("grow").addEventListener("input", () => { $("grow").nextElementSibling.textContent = `${$("grow").value} px`; });
$("grow").addEventListener("change", () => { if (marker.marks.length) sendMarks(); });
$("shadow").addEventListener("change", () => { if (marker.marks.length) sendMarks(); });
$("candidate").addEventListener("change", () => sendMarks());
$("undo").addEventListener("click", () => marker.undo());
$("clear").addEventListener("click", () => marker.clear());

// ---- 3 camera
function askPreview(quiet = false) {
  if (source && !(quiet && $("pane-preview").hidden)) showPreview();
}

for (const name of Object.keys(UNITS)) $(name).addEventListener("input", () => { showMove(); openTab("preview"); askPreview(); });
$("auto-pivot").addEventListener("change", () => { showMove(); openTab("preview"); askPreview(); });
$("reset-move").addEventListener("click", () => {
  for (const [name, value] of Object.entries({ yaw: 0, pitch: 0, dolly: 0, pivot: 2.5 })) $(name).value = value;
  $("auto-pivot").checked = true;
  showMove();
  askPreview();
});
$("tab-preview").addEventListener("click", () => askPreview());

// ---- 4 complete
async function complete() {
  clearErrors();
  setRunning(true);
  try {
    await server.inTurn(() => server.ask("complete", request()));
    await follow();
  } catch (error) { failed(error, "method"); } finally { setRunning(false); }
}

async function follow() {
  const answer = await server.follow(({ state, stage, share }) => {
    $("progress").value = share ?? 0;
    $("run-words").textContent = { waiting: "waiting for its turn", running: STAGES[stage?.split(" ")[0]] ?? stage ?? "" }[state] ?? "";
  });
  if (answer.state !== "done") { $("run-words").textContent = "cancelled"; return; }
  $("run-words").textContent = `${answer.result.filler}, ${answer.seconds.toFixed(1)}\u00a0s`;
  await showResult(answer.result);
}

function setRunning(on) {
  $("complete").disabled = on;
  $("cancel").hidden = $("progress").hidden = !on;
  if (on) { $("progress").value = 0; $("run-words").textContent = ""; }
}

$("complete").addEventListener("click", complete);
// In turn: before "complete" was answered nothing would be there to cancel.
$("cancel").addEventListener("click", () => server.inTurn(() => server.ask("cancel")).catch((error) => failed(error, "method")));

// ---- the page itself
$("theme").addEventListener("click", () => {
  const dark = document.documentElement.dataset.theme === "dark" || (!document.documentElement.dataset.theme && matchMedia("(prefers-color-scheme: dark)").matches);
  document.documentElement.dataset.theme = dark ? "light" : "dark";
  try { localStorage.setItem("dlama-theme", document.documentElement.dataset.theme); } catch { /* it is chosen for this page alone */ }
  repaint();
});
$("start-over").addEventListener("click", () => server.inTurn(async () => {
  clearErrors();
  await server.ask("start_over").catch((error) => failed(error));
  $("fields").reset();
  $("method-fields").reset();
  resetOptions();
  showUploads({});
  noSource();
}));
addEventListener("pagehide", () => server.leave({ ...request(), shadow: $("shadow").checked, grow: $("grow").value }));
addEventListener("pageshow", (event) => { if (event.persisted) server.comeBack(); });
setInterval(() => { if (source) server.ask("alive").catch(() => {}); }, 60000);

// The camera and the options of the mask as they are for a new picture: a turn meant for the one before would go unseen.
function resetOptions() {
  restore({ yaw: 0, pitch: 0, dolly: 0, pivot: "auto", grow: 0, shadow: false });
  offer([], "candidate");
}

// The camera, the method and the options of the mask as they were before the page was loaded again.
function restore({ pivot, shadow, ...values }) {
  $("auto-pivot").checked = pivot === "auto";
  if (pivot !== "auto") $("pivot").value = pivot;
  for (const [name, value] of Object.entries(values)) $(name).value = value;
  $("grow").nextElementSibling.textContent = `${values.grow} px`;
  $("shadow").checked = shadow;
  showMove();
}

async function start(message = "") {
  try {
    const begun = await server.begin((why) => { noSource(); showUploads({}); start(why); });
    settings = begun.settings;
    showSettings();
    showMove();
    if (message) { $("general").textContent = message; $("general").hidden = false; }
    if (!begun.state) return;
    showUploads(begun.state.files);
    if (begun.form) restore(begun.form);
    setRunning(Boolean(begun.state.run)); // a picture of 12 megapixels takes seconds to come
    if (begun.state.source) await shownWhile(async () => {
      await showSource(begun.state);
      marker.setMarks(begun.state.marks ?? []);
      showMarkButtons();
      if (begun.state.marked) await showMask(begun.state.marked);
    }, "picture");
    if (begun.state.result) await showResult(begun.state.result);
    if (begun.state.run) await follow().finally(() => setRunning(false));
  } catch (error) { failed(error); }
}

start();
