"use strict";
// Tables: a click on a heading sorts by that column; numbers by value, rows without one last.
function keyOf(row, column) {
  const cell = row.cells[column];
  const value = cell.dataset.value;
  return value === undefined ? cell.textContent.trim() : Number(value);
}
function compare(a, b, sign) {
  const words = [typeof a === "string", typeof b === "string"];
  if (words[0] && words[1]) return sign * a.localeCompare(b, undefined, { numeric: true });
  if (words[0] !== words[1]) return words[0] ? 1 : -1;
  return sign * (a - b);
}
for (const head of document.querySelectorAll("table.sorts th")) {
  head.querySelector("button").addEventListener("click", () => {
    const falling = head.getAttribute("aria-sort") === "ascending";
    for (const other of head.parentNode.children) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", falling ? "descending" : "ascending");
    const body = head.closest("table").tBodies[0];
    const rows = Array.from(body.rows);
    rows.sort((a, b) => compare(keyOf(a, head.cellIndex), keyOf(b, head.cellIndex), falling ? -1 : 1));
    body.append(...rows);
  });
}
// Panels: shown are those that every choice above them agrees with; a choice offers what the ones before it leave.
for (const pick of document.querySelectorAll(".pick[data-panels]")) {
  const panels = document.getElementById(pick.dataset.panels).querySelectorAll(".panel");
  const choices = Array.from(pick.querySelectorAll("select"));
  const agrees = (panel, some) => some.every((one) => one.value === "" || panel.dataset[one.name] === one.value);
  const show = () => {
    choices.forEach((choice, number) => {
      const left = Array.from(panels).filter((panel) => agrees(panel, choices.slice(0, number)));
      for (const option of choice.options)
        option.disabled = option.value !== "" && !left.some((panel) => panel.dataset[choice.name] === option.value);
      if (choice.selectedOptions[0].disabled) choice.value = Array.from(choice.options).find((one) => !one.disabled).value;
    });
    for (const panel of panels) panel.hidden = !agrees(panel, choices);
  };
  for (const one of choices) one.addEventListener("change", show);
  show();
}
