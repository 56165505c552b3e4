// A result in; before and after, its maps, its pixels, its scene in 3-D and its files out.
import { Compare } from "/compare.js";
import { $, all, chosen, clearErrors, enable, failed, legend, make, offer, onOpen, openTab, ramp, warnings } from "/messages.js";
import { PhotoView } from "/photo3d.js";
import { readGlb } from "/scene.js";
import * as server from "/server.js";

// ---- the result
const compare = new Compare($("compare"), $("split"), readPixel);
let askedPicture = 0, result = null, sceneOf = null, shownBefore = "";

export function noResult() { result = sceneOf = null; }

export async function showResult(answer) {
  result = answer;
  sceneOf = null;
  shownBefore = "";
  for (const name of ["result", "scene"]) enable(name, true);
  $("card-home").hidden = false;
  $("sides").hidden = !answer.pair;
  document.querySelector('input[name="kind"][value="image"]').checked = true;
  document.querySelector('input[name="side"][value="left"]').checked = true;
  warnings("result-warnings", answer.warnings);
  offer(answer.how.files, "single");
  $("single").value = "image.png";
  $("command").textContent = answer.how.command;
  $("python").textContent = answer.how.python;
  $("mask-file").textContent = answer.how.mask_file ? `${answer.how.mask_file} comes with the zip.` : "";
  compare.split(50);
  openTab("result");
  await showKind();
  $("compare").scrollIntoView({ block: "nearest" });
}

const right = () => Boolean(result.pair && chosen("side") === "right");

async function showKind() {
  const number = ++askedPicture, kind = chosen("kind");
  const before = { image: result.moved || right() ? "known" : "source", depth: "depth_known" }[kind] ?? "image";
  const names = { source: "before", known: "known from here", depth_known: "known depth", image: kind === "image" ? "completed" : "completed picture" };
  $("readout").textContent = "drawing …";
  $("cross").hidden = true;
  const wanted = `${before} ${right()}`, kinds = wanted === shownBefore ? [kind] : [kind, before];
  try {
    const [after, first] = await Promise.all(kinds.map((one) => server.fetched("picture", { kind: one, right: right() })));
    if (number !== askedPicture) return;
    shownBefore = wanted;
    await Promise.all([server.showIn($("after"), after.blob), first && server.showIn($("before"), first.blob)]);
    $("before-name").textContent = names[before];
    $("after-name").textContent = { depth: "completed depth", hole_type: "hole types", origin: "origin", confidence: "confidence" }[kind] ?? "completed";
    $("before").alt = names[before];
    $("after").alt = $("after-name").textContent;
    showLegend(kind);
  } catch (error) { failed(error, "home"); } finally {
    if (number === askedPicture) $("readout").textContent = "Click a pixel: its depth, 3-D point, origin and confidence.";
  }
}

function showLegend(kind) {
  const answer = result.legends[right() ? "right" : "left"], rows = answer[kind];
  $("ramp").hidden = kind !== "depth" && kind !== "confidence";
  legend("legend", Array.isArray(rows) ? rows : []);
  if (kind === "depth") ramp("ramp", answer.depth.colors, answer.depth.metres.map((v) => `${v} m`));
  if (kind === "confidence") ramp("ramp", [[0, 0, 0], [255, 255, 255]], ["0 filled, unsure", "0.5", "1 measured"]);
}

async function readPixel(across, down) {
  if (!result) return;
  try {
    const answer = await server.ask("pixel", { x: Math.floor(across * result.width), y: Math.floor(down * result.height), right: right() });
    $("cross").hidden = false;
    $("cross").style.left = `${100 * (answer.x + 0.5) / result.width}%`;
    $("cross").style.top = `${100 * (answer.y + 0.5) / result.height}%`;
    const depth = answer.depth === null ? "no depth" : answer.depth === "sky" ? "sky" : `${answer.depth.toFixed(3)} m`;
    const rows = [["pixel", `${answer.x}, ${answer.y}`], ["depth", depth], ["point", answer.point ? `${answer.point.map((v) => v.toFixed(3)).join(", ")} m` : "none"], ["origin", answer.origin], ["confidence", answer.confidence.toFixed(2)]];
    if (answer.hole_type !== "none") rows.push(["was", answer.hole_type]);
    $("readout").replaceChildren(...rows.flatMap(([name, value], i) => [`${i ? " · " : ""}${name} `, make("b", {}, value)]));
  } catch (error) { failed(error, "home"); }
}

for (const input of all('input[name="kind"], input[name="side"]')) input.addEventListener("change", showKind);

// ---- 3-D
let view3d = null;

// Fill what is hidden from all sides; false where that was cancelled. `words` says how far it is.
async function turn(words) {
  const bar = [$("scene-cancel"), $("scene-progress")];
  $(words).textContent = "filling what is hidden from all sides …";
  await server.inTurn(() => server.ask("turn"));
  for (const one of bar) one.hidden = false;
  try {
    const { state } = await server.follow(({ share }) => {
      $("scene-progress").value = share ?? 0;
      if (words === "home-words") $(words).textContent = `filling what is hidden from all sides, ${Math.round(100 * (share ?? 0))} %`;
    });
    return state !== "cancelled";
  } finally { for (const one of bar) one.hidden = true; }
}

async function showScene() {
  if (!result || sceneOf === result) { view3d?.draw(); return; }
  const wanted = result;
  try {
    if (!(await turn("scene-fact"))) { $("scene-fact").textContent = "cancelled; open this tab again to fill it"; return; }
    const { blob, headers } = await server.fetched("scene");
    const glb = await readGlb(blob);
    if (wanted !== result) return;
    const { start, box, under } = JSON.parse(headers.get("X-Box"));
    view3d ??= new PhotoView($("scene"));
    for (const [name, value] of [["--aspect", start.aspect], ["--under", under]]) $("scene").style.setProperty(name, value);
    view3d.show(glb, start, result.palette, box);
    sceneOf = wanted;
    const points = glb.parts.reduce((sum, { attributes }) => sum + attributes.position.accessor.count, 0);
    $("scene-fact").textContent = `${points.toLocaleString("en")} points; turns by ${box.angle.toFixed(1)}° to each side: drag, or the wheel to come nearer`;
    showSceneLegend();
  } catch (error) { $("scene-fact").textContent = ""; failed(error, "home"); }
}

function showSceneLegend() {
  const mode = Number(chosen("scene-color"));
  if (mode === 1) legend("scene-legend", result.legends.scene.map(({ name, color }) => ({ name, color })));
  else if (mode === 2) legend("scene-legend", [{ name: "0 filled, unsure", color: [212, 56, 26] }, { name: "0.5", color: [250, 217, 89] }, { name: "1 measured", color: [41, 140, 204] }]);
  else legend("scene-legend", []);
}

for (const input of all('input[name="scene-color"]')) input.addEventListener("change", () => { if (view3d) { view3d.mode = Number(input.value); view3d.draw(); } showSceneLegend(); });
onOpen.scene = showScene;
$("scene-cancel").addEventListener("click", () => server.ask("cancel").catch((error) => failed(error, "home")));
$("scene-home").addEventListener("click", () => view3d?.home());

export function repaint() { view3d?.draw(); }

// ---- take home
async function download(action, fields, name) {
  clearErrors("home");
  $("home-words").textContent = "packing …";
  try { server.save((await server.fetched(action, fields)).blob, name); } catch (error) { failed(error, "home"); } finally { $("home-words").textContent = ""; }
}

$("photo3d").addEventListener("click", async () => {
  try {
    if (await turn("home-words")) await download("photo3d", {}, "photo3d.html"); else $("home-words").textContent = "cancelled";
  } catch (error) { $("home-words").textContent = ""; failed(error, "home"); }
});
$("zip").addEventListener("click", () => download("zip", {}, "dlama.zip"));
$("get-single").addEventListener("click", () => download("file", { name: $("single").value }, $("single").value.split("/").at(-1)));
for (const button of all("[data-copy]")) button.addEventListener("click", async () => {
  await navigator.clipboard?.writeText($(button.dataset.copy).textContent).catch(() => {});
  button.textContent = "Copied";
  setTimeout(() => { button.textContent = "Copy"; }, 1500);
});
