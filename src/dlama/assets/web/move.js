// The camera's move and the options of the method as the page has them, and the preview of what the camera sees.
import { $, clearErrors, failed, legend } from "/messages.js";
import * as server from "/server.js";

export const UNITS = { yaw: "°", pitch: "°", dolly: " m", pivot: " m" };
let asking = false, again = false;

export function request() {
  return {
    yaw: Number($("yaw").value), pitch: Number($("pitch").value), dolly: Number($("dolly").value),
    pivot: $("auto-pivot").checked ? "auto" : Number($("pivot").value),
    ...Object.fromEntries(new FormData($("method-fields"))),
  };
}

export function showMove() {
  for (const [name, unit] of Object.entries(UNITS)) $(name).nextElementSibling.textContent = `${$(name).value}${unit}`;
  $("pivot").disabled = $("auto-pivot").checked;
}

// One preview at a time: while one is under way only the newest request waits.
export async function showPreview() {
  if (asking) { again = true; return; }
  asking = true;
  try {
    do {
      again = false;
      const { blob, headers } = await server.fetched("preview", request());
      await server.showIn($("preview"), blob);
      showPreviewLegend(headers.get("X-Holes") ?? "");
      clearErrors("move");
    } while (again);
  } catch (error) { failed(error, "move"); } finally { asking = false; }
}

function showPreviewLegend(text) {
  const colors = { crack: [245, 245, 245], disoccluded: [213, 94, 0], flying: [240, 228, 66], out_of_view: [0, 114, 178], sensor: [204, 121, 167], object: [0, 158, 115] };
  const rows = text.split(", ").filter(Boolean).map((row) => { const [name, share] = row.split("="); return { name: name.replaceAll("_", " "), color: colors[name], share: Number(share) }; });
  if (rows.length) legend("preview-legend", rows); else $("preview-legend").textContent = "Nothing is unknown from here.";
}
