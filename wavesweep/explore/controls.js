// Sliders, fields, axes, the cross, the buttons; and what is wrong, at the field that it is about.
const STEPS = 1000;
const positive = s => s.scale === "log" && !(s.least > 0);
function toPlace(s, v) { return s.scale === "log" ? STEPS * Math.log(v / s.low) / Math.log(s.high / s.low) : STEPS * (v - s.low) / (s.high - s.low); }
function toValue(s, place) {
  if (place <= 0 || place >= STEPS) return place <= 0 ? s.low : s.high;
  const v = s.scale === "log" ? s.low * (s.high / s.low) ** (place / STEPS) : s.low + (s.high - s.low) * place / STEPS;
  return Math.max(s.low, Math.min(s.high, Number(v.toPrecision(5))));
}
function write(field, v) {  // a field is as wide as its number
  if (v !== undefined) field.value = field.defaultValue = v;
  field.style.width = `calc(${Math.max(6, field.value.length) + 1}ch + 16px)`;
}
function number(field) {  // null if it is none
  const v = Number(field.value);
  return field.value.trim() && Number.isFinite(v) ? v : null;
}

// ---- what is wrong
function complain(place, message, fields) {
  place.textContent = message;
  for (const field of fields) { field.setAttribute("aria-invalid", "true"); field.setAttribute("aria-errormessage", place.id); }
}
function calm(place, fields) {
  place.textContent = "";
  for (const field of fields) { field.removeAttribute("aria-invalid"); field.removeAttribute("aria-errormessage"); }
}
let latest = null;  // the number that was changed last
function refuse(found) {  // say what a design or its axes cannot be: at the fields that are named, and at that which was changed last
  for (const s of data.sliders) if (!s.typed) calm(s.fault, [s.number]);
  if (refused && found.error !== refused.error) calm($("axesfault"), ["x0", "x1", "y0", "y1"].map($));
  refused = found.error ? found : null;
  if (!isWaiting()) document.body.classList.remove("nothing");
  fill($("fault"));
  if (!refused) return false;
  blank(found.cut ? "✕ cut" : "✕ not possible");
  const ends = (found.at || []).filter(place => $(place)), at = (found.at || []).filter(path => sliders.has(path));
  if (ends.length) complain($("axesfault"), found.error, ends.map($));
  const named = ends.length ? [] : [...new Set([latest, ...at])].filter(each => each !== null).map(each => sliders.get(each));
  for (const s of named) complain(s.fault, found.error, [s.number]);
  if (found.cut) {
    fill($("fault"), `Cut: an answer about this design ${found.error}. wavesweep check computes it; the spec can be copied.`);
    return true;
  }
  const links = named.flatMap((s, k) => [k ? ", " : "see ", element("a", {href: "#" + s.range.id}, s.name)]);
  fill($("fault"), "Not possible: ", ...(ends.length ? ["these axes, see above"] : named.length ? links : [found.error]), ".");
  return true;
}

// ---- sliders
function show(path) {
  const s = sliders.get(path), v = values[path];
  [s.low, s.high] = [Math.min(s.ends[0], v), Math.max(s.ends[1], v)];
  s.typed = false;
  if (!refused) calm(s.fault, [s.number]);
  s.box.classList.toggle("changed", v !== own[path]);
  write(s.number, exact(v));
  if (!s.range.isConnected) return;
  if (s.step && !s.stops) { s.range.min = s.low; s.range.max = s.high; }
  s.range.value = s.stops ? nearest(s.stops, v) : s.step ? v : toPlace(s, v);
  s.range.setAttribute("aria-valuetext", text(v) + unit(path));
}
function set(path, v) {
  if (values[path] === v) return show(path);
  values[path] = v; latest = path; show(path); moved();
}
function typed(s) {
  const v = number(s.number), above = positive(s);
  if (v !== null && (s.least === null || v >= s.least) && (!above || v > 0) && (!s.step || Number.isInteger(v))) return set(s.path, v);
  const limit = above ? " > 0" : s.least === null ? "" : ` >= ${text(s.least)}`;
  s.typed = true;
  complain(s.fault, `expected a ${s.step ? "whole " : ""}number${limit}, found ${s.number.value.trim() || "nothing"}; the design still has ${values[s.path]}`, [s.number]);
}
function build() {
  let group = "";
  for (const s of data.sliders) {
    const table = s.path.split(".")[0], heading = table.replace("_", " "), name = s.name === s.path ? s.path.slice(table.length + 1) : s.name, spoken = `${heading} ${name}`;
    if (table !== group) { $("sliders").append(element("h3", {}, heading)); group = table; }
    const id = "s-" + s.path, stops = s.stops = saved ? data.stops[s.path] : s.stops.length ? s.stops : null, fixed = saved && !stops;
    s.ends = [s.low, s.high];  // a number that is typed may lie beyond them
    s.range = element("input", {type: "range", id, min: s.step && !stops ? s.low : 0, max: stops ? stops.length - 1 : s.step ? s.high : STEPS, step: s.step || stops ? 1 : "any", title: s.description, "aria-label": `${spoken} ${s.unit}`});
    s.number = element("input", {type: "text", id: id + "-number", inputmode: "decimal", "aria-label": `${spoken}, number`, autocomplete: "off"});
    s.number.readOnly = saved;
    s.fault = element("p", {class: "fault", id: id + "-fault", role: "alert"});
    s.box = element("div", {class: "slider"}, [element("label", {for: fixed ? id + "-number" : id, title: s.description}, [element("b", {}, name), element("span", {}, s.unit)]), ...(fixed ? [] : [s.range]), s.number, ...(s.limited && !fixed ? [element("p", {class: "limited"}, s.limited)] : []), s.fault]);
    s.range.addEventListener("input", () => { const place = Number(s.range.value); set(s.path, stops ? stops[place] : s.step ? place : toValue(s, place)); });
    if (!s.step && !stops) s.range.addEventListener("keydown", event => {
      const by = {ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10}[event.key];
      if (by) { event.preventDefault(); set(s.path, toValue(s, Math.max(0, Math.min(STEPS, toPlace(s, values[s.path]) + by * STEPS / 200)))); }
    });
    s.number.addEventListener("input", () => write(s.number));
    s.number.addEventListener("change", () => typed(s));
    $("sliders").append(s.box);
    show(s.path);
  }
}

// ---- axes
function choices() {
  for (const axis of ["x", "y"]) {
    const smooth = data.sliders.filter(s => s.search);
    fill($(axis), ...smooth.map(s => element("option", {value: s.path}, s.name)));
    $(axis).disabled = saved;
    for (const end of [0, 1]) {
      const box = $(axis + end);
      box.readOnly = saved;
      box.addEventListener("input", () => write(box));
      box.addEventListener("change", () => ranged(axis, end));
    }
    $(axis).addEventListener("change", () => {
      const other = axis === "x" ? "y" : "x", picked = $(axis).value, s = sliders.get(picked);
      if (picked === plane[other]) plane = {x: plane.y, y: plane.x, x_span: plane.y_span, y_span: plane.x_span};
      else plane = {...plane, [axis]: picked, [axis + "_span"]: [s.low, Math.max(s.high, s.low + 1e-9)]};
      chosenAxes = false;
      spans(); moved();
    });
  }
  spans();
}
function ranged(axis, end) {  // an end of an axis that is typed
  const box = $(axis + end), v = number(box), s = sliders.get(plane[axis]), both = [...plane[axis + "_span"]], least = s.least ?? -Infinity;
  both[end] = v;
  const wrong = v === null ? "a number" : both[0] >= both[1] ? `a number ${end ? `above ${both[0]}` : `below ${both[1]}`}` : v < least || (positive(s) && v <= 0) ? `a number ${positive(s) ? "> 0" : `>= ${text(least)}`}` : "";
  if (wrong) return complain($("axesfault"), `${s.name}: expected ${wrong}, found ${box.value.trim() || "nothing"}`, [box]);
  plane = {...plane, [axis + "_span"]: both};
  chosenAxes = true;
  spans(); moved();
}
function spans() {
  calm($("axesfault"), ["x0", "x1", "y0", "y1"].map($));
  for (const axis of ["x", "y"]) { $(axis).value = plane[axis]; for (const end of [0, 1]) write($(axis + end), exact(plane[axis + "_span"][end])); }
}
function zoom(factor) {  // about the design if it is there
  for (const axis of ["x", "y"]) {
    const s = sliders.get(plane[axis]), [a, b] = plane[axis + "_span"], wide = (b - a) * factor, step = 10 ** Math.floor(Math.log10(wide) - 3);
    const about = within(plane[axis]) ? values[plane[axis]] : (a + b) / 2, from = about + (a - about) * factor;
    const [low, high] = [from, from + wide].map(v => Number((Math.round(v / step) * step).toPrecision(12)));
    const limits = saved ? data.plane[axis + "_span"] : [positive(s) ? a / 4 : s.least ?? -Infinity, s.most ?? Infinity];  // a saved page has no more
    plane = {...plane, [axis + "_span"]: [Math.max(low, limits[0]), Math.min(high, limits[1])]};
  }
  chosenAxes = true;
  spans(); moved();
}

// ---- the cross
function place(u, v) {
  const limit = (path, value) => {
    if (value === values[path]) return value;
    const s = sliders.get(path), [a, b] = span(path), low = s.least !== null && !positive(s) ? Math.max(a, s.least) : a;
    return Math.max(low, Math.min(b, Number(value.toPrecision(5))));
  };
  const [x, y] = [limit(plane.x, u), limit(plane.y, v)];
  if (x === values[plane.x] && y === values[plane.y]) return;
  values[plane.x] = x; values[plane.y] = y; latest = plane.y;
  show(plane.x); show(plane.y); moved();
}
function pointing() {
  const svg = $("plane"), at = (path, share) => span(path)[0] + share * (span(path)[1] - span(path)[0]);
  const back = event => {
    const box = svg.getBoundingClientRect(), r = corner;
    place(at(plane.x, (event.clientX - box.left - r.left) / (r.right - r.left)), at(plane.y, (r.bottom - event.clientY + box.top) / (r.bottom - r.top)));
  };
  svg.addEventListener("pointerdown", event => { svg.setPointerCapture(event.pointerId); back(event); });
  svg.addEventListener("pointermove", event => { if (svg.hasPointerCapture(event.pointerId)) back(event); });
  svg.addEventListener("keydown", event => {
    const by = {ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}[event.key], share = event.shiftKey ? 0.1 : 0.01;
    if (!by) return;
    event.preventDefault();
    place(...[plane.x, plane.y].map((path, k) => values[path] + by[k] * share * (span(path)[1] - span(path)[0])));
  });
}

// ---- the buttons
function buttons() {
  $("undo").disabled = !past.length;
  $("redo").disabled = !future.length;
  $("reset").disabled = !away() && axesKey() === startAxes;
}
function shown() {  // all controls after a step back or on
  latest = null;
  data.sliders.forEach(s => show(s.path));
  if (plane) spans();
  changed();
}
$("undo").addEventListener("click", () => travel(past, future));
$("redo").addEventListener("click", () => travel(future, past));
document.addEventListener("keydown", event => {
  const key = event.key.toLowerCase(), field = event.target.closest("input[type=text], textarea");
  if (!(event.ctrlKey || event.metaKey) || event.altKey || !["z", "y"].includes(key) || (field && field.value !== field.defaultValue)) return;
  event.preventDefault();
  if (key === "y" || event.shiftKey) travel(future, past); else travel(past, future);
});
$("reset").addEventListener("click", () => {
  values = {...own}; plane = data.plane && {...data.plane}; chosenAxes = false;
  record();
  shown();
});
$("out").addEventListener("click", () => zoom(2));
$("in").addEventListener("click", () => zoom(0.5));
$("fit").addEventListener("click", async () => {
  chosenAxes = false;
  if (saved) { plane = {...data.plane}; spans(); return moved(); }
  try { if (await fit(() => false)) moved(); } catch (error) { lost(error); }
});
$("copy").addEventListener("click", async () => {
  let found;
  try { found = saved ? {text: answer.toml} : await ask("toml", {values: changedValues()}); } catch (error) { return lost(error); }
  if (refuse(found)) return;
  $("toml").value = found.text;
  $("spec").showModal();
  let done = false;
  try { await navigator.clipboard.writeText(found.text); done = true; } catch { $("toml").select(); done = document.execCommand("copy"); }
  $("copied").textContent = done ? "Copied. Every command takes it as a file." : "Select the text and copy it.";
});
