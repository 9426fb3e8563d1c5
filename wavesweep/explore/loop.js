// Of a loop without a hand: its step response, L of the loop that is broken at a signal, and the margins of that.
let cut = data.cuts?.[0] ?? null, route = data.routes?.[0] ?? null, margins = null, took = 0, proving2 = Promise.resolve();
const SLOWEST = 150;  // ms up to which margins are asked for while something moves
const marginsKey = () => JSON.stringify({values: changedValues(), cut});
const loopQuestion = () => cut ? {cut, route} : {};
function proveMargins(rests) {
  if (saved || !cut || (!rests && (!visible || took > SLOWEST))) return;
  const key = marginsKey(), question = JSON.parse(key);
  if (margins?.key === key) return;
  proving2 = proving2.then(async () => {
    if (key !== marginsKey() || margins?.key === key) return;
    const started = performance.now(), found = await ask("margins", question);
    took = performance.now() - started;
    if (key !== marginsKey() || (found.error && !found.cut)) return;
    margins = {margins: [], ...found, key};
    drawLoop();
  }).catch(lost);
}
const known = () => margins?.key === marginsKey() && !refused ? margins.margins : [];

// ---- the pictures
const SHAPES = {gain_up: "m0,-5l4.5,8h-9z", gain_down: "m0,5l4.5,-8h-9z", phase: "m-4,0a4,4,0,1,0,8,0a4,4,0,1,0,-8,0z", delay: "m-4.5,0l4.5,-4.5l4.5,4.5l-4.5,4.5z", rise: "m-3,-3h6v6h-6z", peak: "m-4,-4l8,8m-8,0l8,-8", settled: "m-4,-4l8,4l-8,4z"};
const tag = (name, x, y) => element("svg:path", {class: name === "delay" || name === "rise" || name === "peak" ? "open" : "full", d: `M${x.toFixed(1)},${y.toFixed(1)}${SHAPES[name]}`});
const part = (name, d) => element("svg:path", {class: name, d});
function panel(id, x, y, log, xs, ys, xName, yName) {
  const svg = $(id), r = room(svg, 56, 12, 20, 34), X = scale(...x, r.left, r.right, log), Y = scale(...y, r.bottom, r.top);
  const inside = element("svg:g", {"clip-path": `url(#in-${id})`}), clip = element("svg:clipPath", {id: "in-" + id}, element("svg:rect", {x: r.left, y: r.top, width: r.right - r.left, height: r.bottom - r.top}));
  fill(svg, clip, axes(r, X, Y, xs, ys, xName, yName), inside);
  return {svg, r, X, Y, inside, say: words => svg.setAttribute("aria-label", words)};
}
function nothing(id, name, words) {
  const svg = $(id);
  room(svg, 0, 0, 0, 0);
  fill(svg, element("svg:text", {class: "title", x: 10, y: 16}, name), element("svg:text", {x: 10, y: 46}, words));
  svg.setAttribute("aria-label", `${name}: ${words}`);
}
function drawStep() {
  const s = answer.step, name = route ? `${route[1]} after a step of ${route[0]}` : `T at ${cut} after a step`, wide = s.value?.length;
  if (s.error) return nothing("l0", name, s.error);
  const last = s.time_s.at(-1), ms = last < 1 ? 1e3 : 1, ends = [...s.value, s.final, 0], least = Math.min(...ends), most = Math.max(...ends), more = 0.06 * (most - least || 1);
  const x = [0, last * ms], y = [least - more, most + more], p = panel("l0", x, y, false, nice(...x, 5), nice(...y, 4), `time (${ms > 1 ? "ms" : "s"})`, name + (s.unit === "ratio" ? "" : ` (${s.unit})`));
  if (s.settling_s) p.inside.append(part("band", `M${p.r.left},${p.Y(s.final * 1.02)}H${p.r.right}V${p.Y(s.final * 0.98)}H${p.r.left}z`));
  p.inside.append(part("thin", `M${p.r.left},${p.Y(s.final)}H${p.r.right}`));
  p.inside.append(part("curve", s.value.map((v, i) => i ? `H${p.X(s.time_s[i] * ms).toFixed(1)}V${p.Y(v).toFixed(1)}` : `M${p.X(0)},${p.Y(v).toFixed(1)}`).join("")));
  for (const [t, v] of s.rise) p.inside.append(tag("rise", p.X(t * ms), p.Y(v)));
  if (s.overshoot || !s.known) p.inside.append(tag("peak", p.X(s.peak[0] * ms), p.Y(s.peak[1])));
  if (s.settling_s) p.inside.append(tag("settled", p.X(s.settling_s * ms), p.Y(s.final)));
  p.say(`${name}, ${wide} samples up to ${text(last, 3)} s, ${text(s.final, 4)} in the end`);
}
function drawNyquist() {
  const o = answer.open, rows = known(), disk = rows.find(each => each.name === "disk_gain" && each.hz), marked = rows.filter(each => each.at && SHAPES[each.name]);
  const far = Math.max(1, ...marked.map(each => Math.hypot(...each.at)), disk ? disk.value : 0), near = o.re.map((x, i) => [x, o.im[i]]).filter(([x, y]) => Math.hypot(x, y) <= Math.min(4, 1.15 * far));
  const xs = [-1, 1, ...near.map(each => each[0]), ...(disk ? [-disk.value, -1 / disk.value] : [])], tall = Math.max(1, ...near.map(each => Math.abs(each[1])), disk ? (disk.value - 1 / disk.value) / 2 : 0);
  const box = $("l1").getBoundingClientRect(), w = Math.max(120, box.width) - 68, h = Math.max(80, box.height) - 54, middle = (Math.min(...xs) + Math.max(...xs)) / 2;
  const size = 1.12 * Math.max((Math.max(...xs) - Math.min(...xs)) / w, 2 * tall / h), x = [middle - size * w / 2, middle + size * w / 2], y = [-size * h / 2, size * h / 2];
  const p = panel("l1", x, y, false, nice(...x, 5), nice(...y, 4), "real part of L", `imaginary part of L at ${cut}`);
  const circle = (a, b) => { const c = p.X((a + b) / 2), q = Math.abs(p.X(b) - p.X(a)) / 2; return `M${c - q},${p.Y(0)}a${q},${q},0,1,0,${2 * q},0a${q},${q},0,1,0,${-2 * q},0z`; };
  if (disk) p.inside.append(part("disk", circle(-disk.value, -1 / disk.value)));
  p.inside.append(part("thin", circle(-1, 1)));
  const line = sign => o.several ? o.re.map((v, i) => `M${p.X(v).toFixed(1)},${p.Y(sign * o.im[i]).toFixed(1)}h0`).join("") : path(o.re.map((v, i) => [p.X(v), p.Y(sign * o.im[i])]).filter(each => each.every(v => Math.abs(v) < 1e5)));
  p.inside.append(part(o.several ? "point" : "thin", line(-1)), part(o.several ? "point" : "curve", line(1)));
  p.inside.append(part("mark", `M${p.X(-1) - 6},${p.Y(0)}h12M${p.X(-1)},${p.Y(0) - 6}v12`), ...marked.map(each => tag(each.name, p.X(each.at[0]), p.Y(each.at[1]))));
  p.say(`Nyquist curve of L at ${cut}`);
}
function drawBode() {
  const o = answer.open, most = o.hertz.at(-1), x = [Math.max(o.hertz[0], most / 1e4), most], shown = o.hertz.map(f => f >= x[0]), marked = known().filter(each => each.at && SHAPES[each.name]);
  for (const [id, values, limit, name] of [["l2", o.decibels, 0, `gain of L at ${cut} (dB)`], ["l3", o.degrees, -180, "phase of L (deg)"]]) {
    const seen = values.filter((v, i) => shown[i] && v !== null), low = Math.min(limit, ...seen), high = Math.max(limit, ...seen), more = 0.06 * (high - low || 1), y = [low - more, high + more];
    const steps = id === "l2" ? [5, 10, 20, 40, 80, 200] : [15, 45, 90, 180, 360, 720], step = steps.find(each => high - low <= 6 * each) || steps.at(-1);
    const ys = [...Array(Math.floor(y[1] / step) - Math.ceil(y[0] / step) + 1).keys()].map(k => (Math.ceil(y[0] / step) + k) * step);
    const p = panel(id, x, y, true, decades(...x), ys, id === "l3" ? "frequency (Hz)" : "", name);
    p.inside.append(part("thin", `M${p.r.left},${p.Y(limit)}H${p.r.right}`));
    const points = o.hertz.map((f, i) => [p.X(f), values[i] === null ? null : p.Y(values[i])]).filter(each => each[1] !== null);
    p.inside.append(part(o.several ? "point" : "curve", o.several ? points.map(([a, b]) => `M${a.toFixed(1)},${b.toFixed(1)}h0`).join("") : path(points)));
    for (const each of marked) {
      const near = nearest(o.hertz, each.hz), turned = Math.atan2(each.at[1], each.at[0]) * 180 / Math.PI, here = o.several ? -(((-turned % 360) + 360) % 360) : turned + 360 * Math.round((o.degrees[near] - turned) / 360);
      const level = id === "l2" ? 20 * Math.log10(Math.hypot(...each.at)) : here, end = id === "l2" ? 0 : -180 + 360 * Math.round((here + 180) / 360);
      if ((id === "l2") === each.name.startsWith("gain")) p.inside.append(part("margin", `M${p.X(each.hz)},${p.Y(level)}V${p.Y(end)}`));
      p.inside.append(tag(each.name, p.X(each.hz), p.Y(level)));
    }
    p.say(`${name} over frequency in Hz, from ${text(x[0], 3)} to ${text(x[1], 3)}`);
  }
}
const MARGINS = {gain_up: "▲ gain may grow to", gain_down: "▼ gain may fall to", phase: "● phase margin", delay: "◇ dead time up to", delay_frames: "◇ whole frames of delay below", disk: "disk margin", sensitivity: "peak sensitivity Ms", complementary: "peak of T, Mt"};
function drawLoop() {
  $("loop").hidden = saved || !cut;
  $("loop").classList.toggle("nothing", !answer?.open);
  if ($("loop").hidden || !answer?.open) return;
  drawStep(); drawNyquist(); drawBode();
  const s = answer.step, item = (name, shown, id, value) => element("div", {}, [element("dt", {}, name), element("dd", {id, "data-value": value ?? ""}, shown)]), time = v => v === null || v === undefined ? "not known" : v < 1 ? `${text(1e3 * v, 4)} ms` : `${text(v, 4)} s`;
  const rows = s.error ? [] : s.known ? [item("□ rise time, 10 to 90 %", time(s.rise_s), "m-rise", s.rise_s), item("× overshoot", s.overshoot === null ? "not known" : `${text(100 * s.overshoot, 4)} % at ${time(s.peak[0])}`, "m-overshoot", s.overshoot), item("▸ within 2 % after", time(s.settling_s), "m-settling", s.settling_s)] : [item("× farthest", `${text(s.peak[1], 4)} at ${time(s.peak[0])}`, "m-farthest", s.peak[1])];
  const now = margins?.key === marginsKey() && !refused;
  for (const [name, words] of Object.entries(MARGINS)) {
    const each = now ? margins.margins.find(row => row.name === name) : null, gain = name.startsWith("gain");
    if (now ? !each : name === "delay_frames") continue;
    const side = ["gain_down", "sensitivity", "complementary"].includes(name) ? 1 : -1, to = v => rounded(v, side, 4);
    const value = !now ? "…" : each.value === null ? `not known (${each.doubt})` : !each.limited ? "no limit" : (each.unit === "deg" ? `${to(each.value)}°` : each.unit === "s" ? (each.value < 1 ? `${to(1e3 * each.value)} ms` : `${to(each.value)} s`) : to(each.value) + (gain ? ` (${rounded(20 * Math.log10(each.value), side, 3)} dB)` : "")) + (each.line_hz ? ` at ${text(each.line_hz, 4)} Hz` : "") + (each.doubt ? `, not certified (${each.doubt})` : "");
    rows.push(item(words, value, "m-" + name, each?.value));
  }
  fill($("margins"), ...rows);
  const cutShort = now && margins.cut === true, bad = now && !cutShort && !margins.margins.length;
  $("loopnote").textContent = (cutShort ? "Margins take longer than 2 s, and were cut: choose a signal that is made less often, or wavesweep margins computes them. " : bad ? `No margins: the loop is not ${margins.doubt ? "known to be " : ""}stable${margins.doubt ? ` (${margins.doubt})` : ""}. ` : now ? "Margins as the table of wavesweep margins has them. " : "… margins follow. ") + (o => o.several ? "L is made several times in a frame: its eigenvalues. " : "")(answer.open) + "The samples of a step response, and what comes after them, are bounded.";
}
function loopChoices() {
  if (saved || !cut) return;
  fill($("cut"), ...data.cuts.map(each => element("option", {value: each}, each)));
  fill($("route"), ...[...(data.routes || []), null].map((each, k) => element("option", {value: k}, each ? `${each[0]} → ${each[1]}` : "what comes back to the cut: T")));
  $("cut").addEventListener("change", () => { cut = $("cut").value; changed(); });
  $("route").addEventListener("change", () => { route = data.routes[Number($("route").value)] ?? null; changed(); });
}
