// The questions to the server: a preview while something moves, and the certified answer if all rests.
const REST = 220, PATIENCE = 2400;  // ms without a move before a proof, and without an answer before nothing is shown; the server cuts one after 2000
let visible = saved, moves = 0, busy = false, again = false, timer = 0, overdue = 0, retries = 2, stamps = [], refused = null, late = "", proving = Promise.resolve();

async function ask(name, question) {
  const reply = await fetch(name, {method: "POST", headers: {"Content-Type": "application/json"}, body: JSON.stringify(question)});
  if (!reply.ok) throw new Error(`the server answered ${reply.status}`);
  const found = await reply.json();
  $("gone").hidden = true;
  return found;
}
function moved() {  // a step
  record();
  retries = 2;
  changed();
}
function changed() {
  moves++;
  buttons();
  if (saved) return chosen();
  waiting(true);
  clearTimeout(timer);
  timer = setTimeout(certify, REST, moves);
  if (busy) again = true; else follow();
}
const isWaiting = () => document.body.classList.contains("waiting"), isBlank = () => document.body.classList.contains("nothing");
function waiting(on) {  // the numbers shown are those of an earlier design, and before long none are
  document.body.classList.toggle("waiting", on);
  if (on && !isBlank()) chip("proof", "… preview", "preview");
  if (on) { overdue ||= setTimeout(blank, PATIENCE, "… no answer for these numbers"); return; }
  clearTimeout(overdue);
  overdue = 0;
}
function blank(state) {  // nothing of another design stands beside these sliders
  picture = null; ranges = {};
  document.body.classList.add("nothing");
  if (plane) { drawPlane(); legend(); }
  how();
  chip("proof", "", "");
  chip("state", state, "no");
}
function chip(id, words, look) { $(id).textContent = words; $(id).className = "chip " + look; }
function send() {
  again = false;
  const key = pictureKey(), drawn = picture && picture.key === key;
  const search = plane ? {[plane.y]: reach(plane.y), [plane.x]: reach(plane.x)} : {};
  const question = {values: changedValues(), plane, preview: !drawn, search, response: visible, ...(visible ? loopQuestion() : {})};
  return {key, drawn, reply: ask("quick", question).catch(error => ({lost: error}))};
}
async function follow() {
  busy = true;
  for (let sent = send(); sent;) {
    const {key, drawn, reply} = sent, found = await reply;
    sent = again && !found.lost ? send() : null;  // the server is at work while this answer is drawn
    if (found.lost) { lost(found.lost); again = false; break; }
    waiting(false);
    const wrong = refuse(found);
    if (again) waiting(true);
    if (wrong) continue;
    if (drawn) delete found.plane;
    stamps = [...stamps, performance.now()];
    setTimeout(how, 1010);
    take(found, key);
  }
  busy = false;
  if (again) follow();
}
function take(found, key) {
  answer = found;
  if (found.plane) picture = {...found.plane, key};
  else if (picture?.key !== key) picture = null;
  if (key === pictureKey() && !away() && found.response && !ghost.response) ghost.response = found.response;
  if (visible && lacking()) changed();  // they came into view after the question
  else if (!again) proveMargins(false);
  ranges = Object.fromEntries((found.ranges || []).map(each => [each.path, each]));
  draw();
}
const lacking = () => (data.hand && !answer.response) || (cut && !answer.open);  // charts, which are asked for while something moves only if they are in view
function certify(at) {  // one after another: a proof that nobody waits for any more keeps the server from the next
  proving = proving.then(() => certified(() => at !== moves)).catch(lost);
}
async function certified(stale) {
  while (busy) await new Promise(done => setTimeout(done, 15));
  if (stale() || !answer || await refit(stale) || refused || isWaiting()) return;
  proveMargins(true);
  const set = {values: changedValues()};
  if (lacking()) {  // also what is not in view is printed
    const found = await ask("quick", {...set, response: true, ...loopQuestion()});
    if (stale()) return;
    if (!found.error) { answer = {...answer, ...found}; draw(); }
  }
  const along = plane ? [plane.y, plane.x] : data.sliders.filter(s => s.search).slice(0, 1).map(s => s.path);
  for (const path of along) {
    if (ranges[path] && "certified" in ranges[path]) continue;
    const found = await ask("certified", {...set, along: path, span: reach(path)});
    if (stale()) return;
    ranges[path] = found.error ? {path, span: reach(path), intervals: [], certified: false, doubt: found.error} : found;
    draw();
  }
  if (plane && late !== pictureKey() && !(picture?.key === pictureKey() && picture.how === "certified")) {
    const key = pictureKey(), found = await ask("certified", {...set, plane});
    if (stale()) return;
    if (found.cut) { late = key; draw(); return; }
    if (refuse(found)) return;
    picture = {...found, key};
    draw();
    if (await refit(stale)) return;
  }
  if (!plane || ghost.key === axesKey()) return;
  const start = away() ? await ask("certified", {values: {}, plane}) : picture;
  if (!stale() && !start.error) { Object.assign(ghost, {plane: start, key: axesKey()}); draw(); }
}
async function refit(stale) {  // other axes, if these show no boundary or not the design, unless somebody has set them
  const start = !away() && axesKey() === startAxes;
  if (!plane || chosenAxes || start || !(refused ? refused.at?.some($) : blind())) return false;
  if (!await fit(stale)) return stale();
  here.state = snapshot();
  changed();
  return true;
}
async function fit(stale) {  // whether there are better axes
  const before = axesKey(), {x, y} = plane, found = await ask("fit", {values: changedValues(), x, y});
  if (found.error || stale()) return false;
  plane = found.plane;
  spans();
  return axesKey() !== before;
}
function blind() {  // whether the picture has not the design or no boundary, or that only near its lower edge
  if (!within(plane.x) || !within(plane.y)) return true;
  if (picture?.key !== pictureKey()) return false;
  const [low, high] = plane.y_span, {whole, top} = extent(picture, low, high);
  return whole || top < low + 0.2 * (high - low);
}
function extent(p, low, high) {  // of the stable set: whether it is all of the picture, and its lowest and highest place
  const cells = p.how === "cells", columns = cells ? p.stable : p.columns;
  const whole = columns.every(column => cells ? column.every(Boolean) : column.some(each => each[0] <= low && each[1] >= high));
  const place = at => low + (high - low) * at / columns[0].length;
  const bottoms = columns.map(column => cells ? column.includes(1) ? place(column.indexOf(1)) : high : Math.min(high, ...column.map(each => each[0])));
  const tops = columns.map(column => cells ? place(column.lastIndexOf(1) + 1) : Math.max(low, ...column.map(each => each[1])));
  return {whole, bottom: Math.min(...bottoms), top: Math.max(...tops)};
}
function reach(path) {  // where stable intervals are searched: the range of the spec, with the design and the axes in it
  const {search, low, high} = sliders.get(path), more = plane && (path === plane.x || path === plane.y) ? span(path) : [];
  const ends = [...(search || [low, high]), values[path], ...more];
  return [Math.min(...ends), Math.max(...ends)];
}
function lost(error) {  // until the next answer
  $("gone").hidden = false;
  $("gone").textContent = `No answer: ${error.message}. If none comes, start wavesweep explore again.`;
  if (isWaiting()) blank("… no answer for these numbers");
}

// ---- a saved page: the designs of the sweep
function chosen() {
  const design = data.designs.find(d => Object.entries(d.values).every(([path, value]) => value === values[path]));
  if (refuse({error: design ? "" : "this combination of the sweep makes no loop"})) return;
  answer = design;
  picture = plane ? {...data.planes[design.plane], key: "saved"} : null;
  ranges = Object.fromEntries(design.ranges.map(r => [r.path, r]));
  draw();
}
