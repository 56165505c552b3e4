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
      const rows = JSON.parse(headers.get("X-Holes"));
      if (rows.length) legend("preview-legend", rows); else $("preview-legend").textContent = "Nothing is unknown from here.";
      clearErrors("move");
    } while (again);
  } catch (error) { failed(error, "move"); } finally { asking = false; }
}
