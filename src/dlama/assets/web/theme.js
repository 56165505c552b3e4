// The theme chosen last, before anything is painted; without one the system's counts.
"use strict";
try {
  const chosen = localStorage.getItem("dlama-theme");
  if (chosen === "dark" || chosen === "light") document.documentElement.dataset.theme = chosen;
} catch { /* storage is closed: the system's theme counts */ }
