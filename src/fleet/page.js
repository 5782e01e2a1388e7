// Tables of the fleet's page: sorted by a click on a heading, searched, fifty rows at a time. Texts are set as text alone.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const rowsShown = 50;
  const digits = (n) => (value) => (value === null ? "–" : Number(value).toPrecision(n).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, ""));
  const whole = (value) => (value === null ? "–" : String(value));
  const words = (value) => value || "";
  const tables = {
    units: [
      ["unit", 0, words, "words"], ["vehicle", 1, words, "words"], ["drives", 2, whole], ["mountings usable", 3, whole],
      ["angle random walk, deg/√h", 4, digits(3)], ["velocity random walk, m/s/√h", 5, digits(3)],
      ["samples lost", 6, whole], ["frames damaged", 7, whole], ["remarks", 8, words, "words wide"],
    ],
    drives: [
      ["drive", 0, words, "words"], ["vehicle", 2, words, "words"], ["mounting", 3, words, "words"], ["began, UTC", 4, words, "words"],
      ["min", 5, (value) => (value === null ? "–" : (value / 60).toFixed(1))],
      ["km", 6, (value) => (value === null ? "–" : (value / 1000).toFixed(1))], ["mountings usable", 7, whole], ["remarks", 8, words, "words wide"],
    ],
  };
  const link = (row) => {
    const a = document.createElement("a");
    a.href = `studies/${encodeURIComponent(row[1])}/run/report.html`;
    a.textContent = row[0];
    return a;
  };
  for (const place of document.querySelectorAll(".live")) {
    const name = place.dataset.table;
    const columns = tables[name];
    const all = data[name].map((row, i) => ({ row, i, text: row.join(" ").toLowerCase() }));
    let order = null, falling = false, first = 0, wanted = "";

    const controls = place.appendChild(document.createElement("div"));
    controls.className = "controls";
    const search = controls.appendChild(document.createElement("input"));
    search.type = "search";
    search.placeholder = "Search";
    search.setAttribute("aria-label", `Search ${name}`);
    const sorter = controls.appendChild(document.createElement("select"));
    sorter.setAttribute("aria-label", `Order of ${name}`);
    sorter.append(new Option("remarks first", ""), ...columns.map(([heading], i) => new Option(`by ${heading}`, i)));
    const before = controls.appendChild(document.createElement("button"));
    before.textContent = "Before";
    const after = controls.appendChild(document.createElement("button"));
    after.textContent = "After";
    const where = controls.appendChild(document.createElement("span"));
    const scroll = place.appendChild(document.createElement("div"));
    scroll.className = "scroll";
    const table = scroll.appendChild(document.createElement("table"));
    const head = table.createTHead().insertRow();
    const body = table.createTBody();
    const headings = columns.map(([heading, , , css], i) => {
      const cell = head.appendChild(document.createElement("th"));
      if (css) cell.className = css;
      const button = cell.appendChild(document.createElement("button"));
      button.textContent = heading;
      button.addEventListener("click", () => { falling = order === i && !falling; order = i; first = 0; show(); });
      return cell;
    });

    const compare = (a, b) => {
      if (order === null) return a.i - b.i;
      const at = columns[order][1], x = a.row[at], y = b.row[at];
      if (x === y) return a.i - b.i;
      if (x === null || x === "") return 1;  // what is not known comes last, whatever the order
      if (y === null || y === "") return -1;
      const less = typeof x === "number" ? x - y : x.localeCompare(y, "en", { numeric: true });
      return falling ? -less : less;
    };
    const show = () => {
      const found = all.filter((one) => one.text.includes(wanted)).sort(compare);
      first = Math.max(0, Math.min(first, found.length - 1));
      first -= first % rowsShown;
      headings.forEach((cell, i) => cell.setAttribute("aria-sort", order === i ? (falling ? "descending" : "ascending") : "none"));
      sorter.value = order === null ? "" : order;
      body.replaceChildren(...found.slice(first, first + rowsShown).map(({ row }) => {
        const line = document.createElement("tr");
        columns.forEach(([heading, at, form, css], i) => {
          const cell = line.insertCell();
          if (css) cell.className = css;
          cell.dataset.label = i === 0 ? "" : heading;
          if (name === "drives" && i === 0) cell.append(link(row)); else cell.textContent = form(row[at]);
        });
        return line;
      }));
      const last = Math.min(first + rowsShown, found.length);
      where.textContent = found.length === 0 ? "none" : `${first + 1} to ${last} of ${found.length}`;
      before.disabled = first === 0;
      after.disabled = last >= found.length;
      before.hidden = after.hidden = found.length <= rowsShown;
    };
    search.addEventListener("input", () => { wanted = search.value.trim().toLowerCase(); first = 0; show(); });
    sorter.addEventListener("change", () => { order = sorter.value === "" ? null : Number(sorter.value); falling = false; first = 0; show(); });
    before.addEventListener("click", () => { first -= rowsShown; show(); });
    after.addEventListener("click", () => { first += rowsShown; show(); });
    show();
  }
})();
