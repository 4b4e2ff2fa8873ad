// On narrow screens, each cell of a wide table shows the name of its column: see site.css.
addEventListener("DOMContentLoaded", () => {
  for (const table of document.querySelectorAll("table.docutils")) {
    const names = [...table.querySelectorAll("thead th")].map((cell) => cell.textContent.trim());
    if (names.length < 3) continue;
    for (const row of table.querySelectorAll("tbody tr")) {
      [...row.cells].forEach((cell, index) => {
        if (!cell.textContent.trim()) cell.hidden = matchMedia("(max-width: 46em)").matches;
        else if (names[index]) cell.setAttribute("data-label", names[index].replace(/:$/, ""));
      });
    }
  }
});
