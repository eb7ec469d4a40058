"use strict";
// Tables are sorted by a click on a heading, numbers as numbers; the replay shows another group.
const number = (text) => (text === "" || text === "inf" ? Infinity : Number(text));

function compare(a, b) {
  const [x, y] = [number(a), number(b)];
  return Number.isNaN(x) || Number.isNaN(y) ? a.localeCompare(b) : x === y ? 0 : x - y;
}

for (const table of document.querySelectorAll("table")) {
  const body = table.tBodies[0];
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const sort = () => {
      const down = head.ariaSort === "ascending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      head.ariaSort = down ? "descending" : "ascending";
      const text = (row) => row.cells[column].textContent;
      const rows = [...body.rows].sort((a, b) => compare(text(a), text(b)));
      body.append(...(down ? rows.reverse() : rows));
    };
    head.tabIndex = 0;
    head.title = "sort";
    head.addEventListener("click", sort);
    head.addEventListener("keydown", (event) => {
      if (event.key === "Enter" || event.key === " ") { event.preventDefault(); sort(); }
    });
  });
}

const menu = document.getElementById("group"), frame = document.querySelector("iframe");
if (menu) {
  menu.addEventListener("change", () => {
    // The first of these is the scene's; the title before it has its quotes written out.
    frame.srcdoc = frame.srcdoc.replace(/"shown":\d+/, `"shown":${menu.value}`);
  });
}
