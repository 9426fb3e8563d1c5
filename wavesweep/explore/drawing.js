// The pictures and the numbers.
function nice(low, high, count) {
  const raw = (high - low) / Math.max(1, count), power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].find(m => m * power >= raw * 0.999) * power;
  const first = Math.ceil(low / step - 1e-9);
  return [...Array(Math.max(0, Math.floor(high / step + 1e-9) - first + 1)).keys()].map(k => Number(((first + k) * step).toPrecision(12)));
}
function decades(low, high) {
  const found = [];
  for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++) for (const m of high / low > 200 ? [1] : [1, 2, 5]) found.push(Number((m * 10 ** e).toPrecision(3)));
  return found.filter(v => v >= low * 0.999 && v <= high * 1.001);
}
function room(svg, left, right, top, bottom) {
  const box = svg.getBoundingClientRect(), w = Math.max(120, box.width), h = Math.max(80, box.height);
  svg.setAttribute("viewBox", `0 0 ${w} ${h}`);
  return {left, top, right: w - right, bottom: h - bottom, w, h};
}
const scale = (low, high, from, to, log) => log ? v => from + (to - from) * Math.log(v / low) / Math.log(high / low) : v => from + (to - from) * (v - low) / (high - low);
const path = points => points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)},${y.toFixed(1)}`).join("");
function axes(r, X, Y, xs, ys, xName, yName) {
  const g = element("svg:g");
  for (const v of xs) {
    const half = 3.6 * short(v).length, x = Math.min(Math.max(X(v), half), r.w - half);  // whole, at the edges too
    g.append(element("svg:path", {class: "grid", d: `M${X(v)},${r.top}V${r.bottom}`}), element("svg:text", {x, y: r.bottom + 15, "text-anchor": "middle"}, short(v)));
  }
  for (const v of ys) g.append(element("svg:path", {class: "grid", d: `M${r.left},${Y(v)}H${r.right}`}), element("svg:text", {x: r.left - 6, y: Y(v) + 4, "text-anchor": "end"}, short(v)));
  g.append(element("svg:path", {class: "frame", d: `M${r.left},${r.top}H${r.right}V${r.bottom}H${r.left}Z`}));
  if (xName) g.append(element("svg:text", {class: "title", x: r.right, y: r.h - 4, "text-anchor": "end"}, xName));
  if (yName) g.append(element("svg:text", {class: "title", x: r.left, y: r.top - 7}, yName));
  return g;
}

const isProved = p => p.how === "certified" && p.known.every(Boolean) && p.columns.every((c, i) => !p.partly[i] && c.every(each => each[2]));
// ---- the plane: filled is what is proved stable between proved columns, dotted a preview, hatched what nobody knows
const isKnown = p => p.how === "cells" || p.known.some(Boolean);
function region(p, r, X, Y, ghostly) {
  const g = element("svg:g"), proved = p.how === "certified";
  const add = (name, parts) => { if (parts.length) g.append(element("svg:path", {class: name, d: parts.join("")})); };
  const line = points => path(points.map(([x, y]) => [X(x), Y(y)]));
  if (p.how === "cells") {
    if (!ghostly) add("point", p.x.flatMap((x, i) => p.y.map((y, k) => p.stable[i][k] ? `M${X(x).toFixed(1)},${Y(y).toFixed(1)}h0` : "")));
    return g;
  }
  if (ghostly) { add("ghost", [...p.lines, ...p.doubtful].map(line)); return g; }
  const open = isKnown(p) ? p.unknown : p.x.slice(1).map((x, i) => [p.x[i], x, null, null]);  // single columns
  const hatch = whole => add("unknown", open.filter(each => (each[2] === null) === whole).map(([from, to, low, high]) => {
    const [bottom, top] = whole ? [r.bottom, r.top] : [Y(low), Y(high)].map(y => Math.min(Math.max(y, r.top), r.bottom).toFixed(1));
    return `M${X(from).toFixed(1)},${top}H${X(to).toFixed(1)}V${bottom}H${X(from).toFixed(1)}z`;
  }));
  hatch(true);
  if (open.length) add("clear", p.areas.map(points => line(points) + "Z"));
  add(proved ? "stable" : "quick", p.areas.map(points => line(points) + "Z"));
  if (proved) { add("clear", p.unproved.map(points => line(points) + "Z")); add("unproved", p.unproved.map(points => line(points) + "Z")); }
  hatch(false);  // open places, also within what is drawn as stable
  const bars = certain => p.bars.filter(bar => bar[3] === certain).map(([x, low, high]) => line([[x, low], [x, high]]));
  if (!proved) add("quickedge", [...p.lines, ...p.doubtful].map(line));
  else { add("edge", p.lines.map(line)); add("doubt", [...p.doubtful.map(line), ...bars(false)]); }
  add("bar", bars(true));
  return g;
}
const nearest = (list, v) => list.reduce((best, each, i) => Math.abs(each - v) < Math.abs(list[best] - v) ? i : best, 0);
function isStable(p, x, y) {  // null if it is not known
  const cell = p.how === "cells" && p.stable[nearest(p.x, x)][nearest(p.y, y)];
  if (p.how === "cells") return cell === null ? null : Boolean(cell);
  const at = nearest(p.x, x), gap = x < p.x[at] ? at - 1 : at;
  if (p.x[at] !== x && !p.known[gap]) return null;
  const found = p.columns[at].find(([low, high]) => y >= low && y <= high);
  return found ? p.how !== "certified" || found[2] || null : p.partly[at] ? null : false;
}
function labels(p, r, X, Y) {
  const g = element("svg:g"), seen = {}, at = (u, v) => [plane.x_span[0] + u * (plane.x_span[1] - plane.x_span[0]), plane.y_span[0] + v * (plane.y_span[1] - plane.y_span[0])];
  for (const v of [0.5, 0.25, 0.75, 0.9, 0.1]) for (const u of [0.5, 0.3, 0.7, 0.15, 0.85]) {
    const here = isStable(p, ...at(u, v)), alike = [[u - .07, v], [u + .07, v], [u, v - .06], [u, v + .06]].every(q => isStable(p, ...at(...q)) === here);
    const x = X(at(u, v)[0]), y = Y(at(u, v)[1]), far = Math.hypot(x - X(values[plane.x]), y - Y(values[plane.y])) > 34;
    const clear = Object.values(seen).every(([a, b]) => Math.abs(a - x) > 80 || Math.abs(b - y) > 22);
    if (here === null || !alike || !far || !clear || seen[here]) continue;
    seen[here] = [x, y];
    g.append(element("svg:text", {class: "label", x, y: y + 4, "text-anchor": "middle"}, here ? "stable" : "unstable"));
  }
  return g;
}
// ---- what was measured: a diamond is a limit, a disc a wall that was stable, a ring one that was not, or a point of a response
const POINTS = {limit: "m-4.5,0l4.5,-4.5l4.5,4.5l-4.5,4.5z", held: "m-3.2,0a3.2,3.2,0,1,0,6.4,0a3.2,3.2,0,1,0,-6.4,0z", failed: "m-3.8,0a3.8,3.8,0,1,0,7.6,0a3.8,3.8,0,1,0,-7.6,0z", seen: "m-2.5,0a2.5,2.5,0,1,0,5,0a2.5,2.5,0,1,0,-5,0z"};
function measuredWalls() {  // [x, y, kind] of those of the plane
  const walls = data.measured.walls, across = walls && walls.damping === plane.x && walls.stiffness === plane.y;
  if (!across && !(walls && walls.damping === plane.y && walls.stiffness === plane.x)) return [];
  return walls.points.map(([B, K, stable]) => [...(across ? [B, K] : [K, B]), stable === null ? "limit" : stable ? "held" : "failed"]);
}
const marks = (name, places) => element("svg:path", {class: name, d: places.map(([x, y]) => `M${x.toFixed(1)},${y.toFixed(1)}${POINTS[name]}`).join("")});
let corner = null;
function drawPlane() {
  const svg = $("plane"), r = corner = room(svg, 58, 14, 22, 36);
  const X = scale(...plane.x_span, r.left, r.right), Y = scale(...plane.y_span, r.bottom, r.top);
  const inside = element("svg:g", {"clip-path": "url(#inside)"});
  if (picture) inside.append(region(picture, r, X, Y, false));
  const x = X(values[plane.x]), y = Y(values[plane.y]), x0 = X(own[plane.x]), y0 = Y(own[plane.y]);
  if (away() && ghost.plane && ghost.key === axesKey()) inside.append(region(ghost.plane, r, X, Y, true));
  if (away()) inside.append(element("svg:path", {class: "ghostmark", d: `M${x0},${y0 - 7}l7,7l-7,7l-7,-7z`}, element("svg:title", {}, "the design at the start")));
  inside.append(element("svg:path", {class: "cross", d: `M${x},${r.top}V${r.bottom}M${r.left},${y}H${r.right}`}), element("svg:path", {class: "mark", d: `M${x - 8},${y}h16M${x},${y - 8}v16`}));
  if (picture) inside.append(labels(picture, r, X, Y));
  const walls = measuredWalls();
  for (const name of new Set(walls.map(each => each[2]))) inside.append(marks(name, walls.filter(each => each[2] === name).map(([a, b]) => [X(a), Y(b)])));
  const clip = element("svg:clipPath", {id: "inside"}, element("svg:rect", {x: r.left, y: r.top, width: r.right - r.left, height: r.bottom - r.top}));
  const ticks = Math.max(3, Math.min(9, (r.right - r.left) / 80)), up = Math.max(3, (r.bottom - r.top) / 55);
  fill(svg, clip, axes(r, X, Y, nice(...plane.x_span, ticks), nice(...plane.y_span, up), axisName(plane.x), axisName(plane.y)), inside);
  for (const each of svg.children) each.setAttribute("aria-hidden", true);
  const [vertical, horizontal] = [plane.y, plane.x].map(path => `${title(path)} from ${span(path).map(end => text(end)).join(" to ")}${unit(path)}`);
  svg.setAttribute("aria-label", `Stable designs, ${vertical} over ${horizontal}; the design at ${text(values[plane.y])} and ${text(values[plane.x])} is ${verdict()}.${saved ? "" : " Arrow keys move it."}`);
}
const KEYS = {stable: "stable", unproved: "stable, not certified", quick: "stable, preview", point: "stable here, preview", bar: "stable at this value", doubt: "boundary, not certified", unknown: "not known", ghost: "at the start", ghostmark: "design at the start", limit: "measured limit", held: "measured stable", failed: "measured unstable"};
function legend() {  // of what is in the picture
  const shapes = {point: "M3,6h0M9,6h0M15,6h0", bar: "M9,0V12", ghost: "M0,6H18", doubt: "M0,6H18", ghostmark: "M9,1l5,5l-5,5l-5,-5z"};
  for (const name in POINTS) shapes[name] = "M9,6" + POINTS[name];
  const there = Object.keys(KEYS).filter(name => $("plane").querySelector("." + name));
  fill($("legend"), ...there.map(name => element("span", {}, [element("svg:svg", {viewBox: "0 0 18 12"}, element("svg:path", {class: name, d: shapes[name] || "M0,0H18V12H0z"})), KEYS[name]])));
}
function how() {
  if (!answer) return;
  const now = performance.now();
  stamps = stamps.filter(at => now - at < 1000);
  const rate = stamps.length, p = picture, parts = [], say = (word, rest) => parts.push(element("b", {}, word), rest);
  if (!plane) parts.push("This loop has a single number that varies smoothly: no plane.");
  else if (!p || (p.how === "certified" && p.key !== pictureKey())) parts.push("…");
  else if (p.how === "cells") say("Preview: ", `eigenvalues of ${p.x.length} × ${p.y.length} designs, not certified.`);
  else {
    const all = p.known.every(Boolean);
    say(p.how === "columns" ? "Preview: " : isProved(p) ? "Certified: " : "Not all certified: ", `${p.x.length} values of ${title(plane.x)}; ` +
      (isKnown(p) ? `lines between them are right to ${p.how === "columns" ? "two pixels" : "half a pixel"}${saved && axesKey() !== startAxes ? " of the whole plane" : ""}${all ? "." : ", or nothing is known there."}` : "nothing is known between them."));
  }
  if (plane && p && p.key === pictureKey()) parts.push(...beyond(p));
  if (plane) {
    const walls = measuredWalls(), [x0, x1] = plane.x_span, [y0, y1] = plane.y_span, out = walls.filter(([x, y]) => x < x0 || x > x1 || y < y0 || y > y1).length;
    if (out) parts.push(` Of ${walls.length} measured walls ${out} lie${out === 1 ? "s" : ""} outside the axes.`);
  }
  if (plane && late === pictureKey()) parts.push(" Certifying it takes longer than 2 s, and was cut: wavesweep stability-region does it.");
  if (rate > 3) parts.push(` ${rate} updates in the last second.`);
  $("how").dataset.updates = rate;
  fill($("how"), ...parts);
}
function beyond(p) {  // what is known outside the axes, and what is not
  const [low, high] = plane.y_span, {whole, bottom, top} = extent(p, low, high), parts = [], least = sliders.get(plane.y).least;
  const edges = [top >= high ? "upper" : "", bottom <= low && low !== least ? "lower" : ""].filter(Boolean).join(" and the ");
  if (whole) parts.push(` All within the axes is stable${saved && axesKey() === startAxes ? "" : "; zoom out to see more"}.`);
  else if (top <= low) parts.push(" Nothing within the axes is stable.");
  else if (edges) parts.push(` Stable designs reach the ${edges} edge; what lies beyond is not shown.`);
  for (const each of [plane.y, plane.x]) {
    const [a, b] = span(each), found = (ranges[each]?.intervals || []).flatMap(i => [[i.low, Math.min(i.high, a)], [Math.max(i.low, b), i.high]]).filter(([from, to]) => from < to);
    if (found.length) parts.push(` Outside the axes, ${title(each)} through the design is stable in ${found.map(([from, to]) => `${rounded(from, 1)} to ${rounded(to, -1)}`).join(" and ")}${unit(each)}.`);
    if (!within(each)) parts.push(` The design lies outside: ${title(each)} is ${text(values[each])}.`);
  }
  return parts;
}
function chart(id, name, column, log, factor = 1) {
  const svg = $(id), found = answer.response, old = ghost.response, r = room(svg, 56, 10, 20, 22);
  const seen = data.measured.response?.[column] ? data.measured.response : null;
  const f = found.frequency_hz, many = [found, old, seen].filter(Boolean), flat = many.flatMap(each => each[column]).filter(v => v !== null && (!log || v > 0)).map(v => v * factor);
  let low = Math.min(...flat), high = Math.max(...flat);
  if (column.endsWith("deg")) [low, high] = [-180, 180];
  else if (log) [low, high] = high / low < 3 ? [low / 2, high * 2] : [low / 1.2, high * 1.2];
  if (!flat.length || !(low < high)) return fill(svg, element("svg:text", {x: 10, y: 40}, "not known"));
  const places = [...f, ...(data.measured.response?.frequency_hz || [])], least = Math.min(...places), most = Math.max(...places);
  const X = scale(least, most, r.left, r.right, true), Y = scale(low, high, r.bottom, r.top, log);
  const g = axes(r, X, Y, decades(least, most), column.endsWith("deg") ? [-180, -90, 0, 90, 180] : decades(low, high).length > 1 ? decades(low, high) : nice(low, high, 3), "", name);
  const lines = each => {
    const parts = [];
    let part = [];
    each[column].map(v => log && v <= 0 ? null : v).forEach((v, i) => {
      const last = part.length ? each[column][i - 1] : null;
      if (v === null || (last !== null && column.endsWith("deg") && Math.abs(v - last) > 180)) { parts.push(part); part = []; }
      if (v !== null) part.push([X(each.frequency_hz[i]), Y(v * factor)]);
    });
    return [...parts, part].map(path).join("");
  };
  if (found.slow_nyquist_hz && found.slow_nyquist_hz < f[f.length - 1] && found.slow_nyquist_hz > f[0]) g.append(element("svg:path", {class: "thin", d: `M${X(found.slow_nyquist_hz)},${r.top}V${r.bottom}`}));
  if (old && old !== found) g.append(element("svg:path", {class: "ghost", d: lines(old)}));
  g.append(element("svg:path", {class: "curve", d: lines(found)}));
  if (seen) g.append(marks("seen", seen.frequency_hz.map((hz, i) => [X(hz), Y(seen[column][i] * factor)])));
  fill(svg, g);
  svg.classList.toggle("dim", !answer.own.stable);
  svg.setAttribute("aria-label", `${name.replace(" over Hz", "")} over frequency in Hz, from ${text(f[0])} to ${text(f[f.length - 1])}`);
}

// ---- the numbers
const SIGNS = {stable: "● ", unstable: "✕ ", "not known": "? "};
const verdict = () => isBlank() || answer.own.spectral_radius === null ? "not known" : answer.own.stable ? "stable" : "unstable";
function numbers() {
  const o = answer.own, item = (id, name, shown, value) => element("div", {}, [element("dt", {}, name), element("dd", {id, "data-value": value ?? ""}, shown)]);
  const rows = [item("n-radius", `spectral radius, per frame of ${text(1e3 * o.period_s, 5)} ms`, text(o.spectral_radius), o.spectral_radius)];
  if (o.felt) rows.push(item("n-felt", "felt stiffness", o.stable ? (o.felt.rigid ? "rigid: a constant force moves nothing in the end" : text(o.felt.stiffness) + " " + data.units.felt[0]) : o.spectral_radius === null ? "not known" : "none: unstable", o.felt.stiffness));
  const band = o.stable && o.felt?.over_band, beyond = (band && band.outweighed_bands_hz) || [];
  if (band) {
    const seen = band.hz.map((hz, i) => [hz, band.impedance[i]]).filter(([hz]) => !beyond.some(([low, high]) => low <= hz && (high === null || hz <= high)));
    const holds = band.holds_to_hz, bands = beyond.map(([low, high]) => `from ${text(low, 3)}${high === null ? " Hz on" : ` to ${text(high, 3)} Hz`}`).join(" and ");
    const parts = [seen.map(([, size]) => text(size, 4)).join(", "), holds ? `within a tenth up to ${rounded(holds, -1, 3)} Hz` : "", bands ? `outweighed by free motion ${bands}` : ""];
    rows.push(item("n-band", seen.length ? `felt at ${seen.map(([hz]) => hz).join(", ")} Hz` : "felt over frequency", parts.filter(Boolean).join("; ")));
  }
  if (o.slowest) {
    const damped = o.least_damped ?? o.slowest;
    rows.push(item("n-slow", "slowest mode falls to 1/e in", text(o.slowest.time_constant_s, 4) + " s", o.slowest.time_constant_s), item("n-ratio", "least damping ratio of all modes", text(damped.damping_ratio, 3) + (damped.omega ? `, at ${text(damped.omega / 2 / Math.PI, 4)} Hz` : ""), damped.damping_ratio));
  }
  if (o.channel_norm != null) rows.push(item("n-norm", "wave channel's norm (passive up to 1)", rounded(o.channel_norm, 1, 7), o.channel_norm));
  fill($("own"), ...rows);
  const more = data.asked.length ? `The spec asks ${data.asked.join(" and ")}: wavesweep check answers that; this page is of these numbers alone. ` : "";
  $("assumes").textContent = more + (o.assumes ? "Assumes: " + o.assumes : "");
  const these = data.asked.length ? " with these numbers" : "";
  if (!isBlank()) chip("state", SIGNS[verdict()] + verdict() + these, o.stable ? "yes" : "no");
}
const HEADS = ["along", "from", "to", "oscillation there", "felt at the ends", "proof"];
function intervals() {
  const rows = [], row = (attributes, ...cells) => {
    const made = [];
    cells.forEach((cell, k) => { if (cell === null) { made.at(-1).colSpan++; made.at(-1).dataset.name = ""; } else made.push(element("td", {"data-name": HEADS[k]}, cell)); });
    rows.push(element("tr", attributes, made));
  };
  for (const each of plane ? [plane.y, plane.x] : Object.keys(ranges)) {
    const found = ranges[each];
    if (!found) { row({}, title(each), "follows when the sliders rest", null, null, null, null); continue; }
    const proof = !("certified" in found) ? "… preview" : found.certified ? "✓ certified" : `not certified (${found.doubt || "see the README"})`, names = {"data-along": each, "data-certified": found.certified};
    if (!found.intervals.length) row(names, title(each), `${found.certified === false ? "nothing known to be" : "nowhere"} stable in ${rounded(found.span[0], 1)} to ${rounded(found.span[1], -1)}${unit(each)}`, null, null, null, proof);
    for (const i of found.intervals) {
      const hz = [i.low_hz, i.high_hz].map(f => (f ?? null) === null ? "–" : text(f, 4)).join(" / "), ends = (omega, open) => omega !== null ? "" : open ? " (not known beyond)" : " (range ends)";
      const felt = (i.felt_low ?? i.felt_high ?? null) === null ? "–" : `${text(i.felt_low, 4)} / ${text(i.felt_high, 4)} ${data.units.felt[0]}`;
      row({...names, "data-low": i.low, "data-high": i.high, class: values[each] >= i.low && values[each] <= i.high ? "own" : null}, title(each),
        rounded(i.low, 1) + unit(each) + ends(i.low_omega, i.open_places && i.open_low < i.low), rounded(i.high, -1) + unit(each) + ends(i.high_omega, i.open_places && i.open_high > i.high), hz === "– / –" ? "–" : hz + " Hz", felt, proof);
    }
  }
  fill($("intervals"), ...rows);
}
function proof() {
  if (isBlank() || isWaiting()) return;
  const p = picture && picture.key === pictureKey() && picture.how === "certified" ? picture : null;
  const ended = Object.values(ranges).filter(each => "certified" in each).length >= (plane ? 2 : 1) && (!plane || p || late === pictureKey());
  const done = ended && answer.own.spectral_radius !== null && Object.values(ranges).every(each => each.certified) && (!plane || (p && isProved(p)));
  chip("proof", done ? "✓ certified" : ended ? "not all certified" : "… preview", done ? "yes" : ended ? "no" : "preview");
}
function draw() {
  if (!answer) return;
  numbers(); intervals(); proof();
  $("picture").querySelectorAll("svg, #choice").forEach(each => each.toggleAttribute("hidden", !plane));
  if (plane) { drawPlane(); legend(); }
  how();
  $("responses").hidden = !data.hand;
  drawLoop();
  $("responses").classList.toggle("nothing", !answer.response);
  if (answer.response) {
    chart("c0", `admittance (m${data.units.admittance}) over Hz`, "admittance_abs", true, 1e3); chart("c1", `impedance (${data.units.impedance}) over Hz`, "impedance_abs", true);
    chart("c2", "admittance phase (deg)", "admittance_deg", false); chart("c3", "impedance phase (deg)", "impedance_deg", false);
    const r = answer.response;
    $("bound").textContent = answer.own.stable ? `Relative error at most ${rounded(r.error, 1, 2)}${r.doubt.length ? "; doubt: " + r.doubt.join(", ") : ""}.${r.slow_nyquist_hz ? " Dotted: half the slow rate." : ""}${data.measured.response ? " Rings: measured." : ""}` : "An unstable loop has no steady response: the numbers are those of its equations.";
  }
}
