// The report of a saved page, and the beginning of any.
// The cells of a line of CSV; those with a comma or a quote, such as names of specs, are quoted.
const cellsOf = line =>
  [...`,${line}`.matchAll(/,(?:"((?:[^"]|"")*)"|([^,]*))/g)].map(([, quoted, plain]) => plain ?? quoted.replaceAll('""', '"'));
function report() {
  for (const t of data.report) {
    if (t.error) { $("report").append(element("section", {class: "card"}, [element("h2", {}, t.title), element("p", {class: "note"}, "Not possible: " + t.error)])); continue; }
    const lines = t.csv.split("\n"), head = cellsOf(lines[0]), body = element("tbody"), rows = lines.slice(1).map(cellsOf);
    const filled = head.map((_, i) => rows.some(row => row[i] !== "")), full = cells => cells.filter((_, i) => filled[i]);  // a column without a value in any row is not shown
    const more = upTo => fill(body, ...rows.slice(0, upTo).map(row => element("tr", {}, full(row).map(cell => element("td", {}, cell)))));
    more(25);
    const all = element("button", {type: "button"}, `Show ${rows.length} rows`), copy = element("button", {type: "button"}, "Copy as CSV");
    all.addEventListener("click", () => { more(rows.length); all.hidden = true; });
    all.hidden = rows.length <= 25;
    copy.addEventListener("click", async () => { try { await navigator.clipboard.writeText(t.csv + "\n"); copy.textContent = "Copied"; } catch { copy.textContent = "Not allowed here"; } });
    const units = t.units.map(u => u === "1" ? "" : u), cut = t.rows > rows.length ? `The first ${rows.length} of ${t.rows} rows.` : `${t.rows} rows.`;
    const table = element("table", {}, [element("thead", {}, element("tr", {}, full(head.map((name, i) => element("th", {}, name + (units[i] ? ` (${units[i]})` : "")))))), body]);
    const note = element("p", {class: "note"}, cut), scrolls = name => ({class: "scroll", tabindex: 0, role: "region", "aria-label": name});
    const wide = element("div", scrolls(t.title), table), facts = "Facts of this run, with the resolved spec", image = element("img", {src: t.figure, alt: `Figure: ${t.title} of ${data.name}`});
    $("report").append(element("section", {class: "card", "data-kind": t.kind}, [element("h2", {}, t.title), element("div", scrolls(`Figure of ${t.title}`), image), note, wide,
      element("p", {class: "row"}, [all, copy]), element("details", {}, [element("summary", {}, facts), element("pre", scrolls(facts), JSON.stringify(t.facts, null, 1))])]));
    if (wide.scrollWidth > wide.clientWidth) note.append(" The table scrolls sideways.");
  }
}

// ---- begin
fill($("name"), data.name, " ", element("small", {}, `${data.kind} · wavesweep ${data.version}`));
build();
buttons();
if (plane) choices();
loopChoices();
$("loop").hidden = saved || !cut;
if (saved) {
  const stops = Object.keys(data.stops).length;
  $("mode").textContent = data.left ? `Saved: the spec's own design. Its sweep has ${data.left} designs, too many for this page; all are in the table.` : stops ? "Saved: sliders with stops choose among the values of the sweep; the others are fixed." : "Saved: the numbers of the spec's own design.";
  document.body.classList.add("saved");
  $("plane").setAttribute("role", "img");
  $("plane").removeAttribute("tabindex");
  $("undo").hidden = $("redo").hidden = $("reset").hidden = !stops;
  chosen();
  report();
} else {
  $("mode").textContent = data.slow ? "This loop is assembled tick by tick: the picture follows more slowly." : "Drag, use the arrow keys, or type a number. A dot marks what has changed.";
  if (plane) pointing();
  new IntersectionObserver(entries => {
    visible = entries.at(-1).isIntersecting;
    if (visible && answer && lacking()) changed();
  }, {rootMargin: "100px"}).observe($(data.hand ? "responses" : "loop"));
  take(data.first, pictureKey());
  timer = setTimeout(certify, 0, moves);
  const alive = new EventSource("alive");
  alive.onerror = () => lost(new Error("the server has ended"));
  alive.onmessage = () => { if (retries && !busy && (isWaiting() || !$("gone").hidden)) { retries--; changed(); } };  // each second
}
new ResizeObserver(() => draw()).observe($("picture"));
window.ready = true;
