"use strict";
// What the page knows: the spec's own design, the numbers that are set, the plane, and the steps that can be taken back.
const data = JSON.parse(document.getElementById("data").textContent);
const $ = id => document.getElementById(id);
const saved = Boolean(data.designs);
const sliders = new Map(data.sliders.map(s => [s.path, s]));
const own = Object.fromEntries(data.sliders.map(s => [s.path, s.value]));
let values = {...own}, plane = data.plane && {...data.plane}, chosenAxes = false;  // whether somebody has set the axes
let answer = null, picture = null, ranges = {}, ghost = {plane: null, key: "", response: null};

// ---- texts and elements
const text = (v, digits = 6) => v === null || v === undefined || Number.isNaN(v) ? "not known" : String(Number(Number(v).toPrecision(digits)));
// a bound of so many digits that is no lower (side 1) or no higher (side -1) than the value
function rounded(v, side, digits = 6) {
  const near = Number(Number(v).toPrecision(digits));
  if (!Number.isFinite(near) || near === v || v === null || (near - v) * side > 0) return text(v, digits);
  return text(near + side * 10 ** (Math.floor(Math.log10(Math.abs(v))) + 1 - digits), digits);
}
const exact = v => String(Number(Number(v).toPrecision(15)));  // without the rounding of a product, as in 0.000029999999999999997
const short = v => { const said = text(v, 4); return said.length > 7 ? Number(Number(v).toPrecision(4)).toExponential() : said; };
const unit = path => sliders.get(path).unit ? " " + sliders.get(path).unit : "";
const title = path => sliders.get(path).name;
const axisName = path => title(path) + (sliders.get(path).unit ? ` (${sliders.get(path).unit})` : "");
function element(tag, attributes = {}, content) {
  const made = tag.startsWith("svg:") ? document.createElementNS("http://www.w3.org/2000/svg", tag.slice(4)) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) if (value !== null && value !== undefined) made.setAttribute(name, value);
  if (content !== undefined) made.append(...[].concat(content));
  return made;
}
const fill = (place, ...parts) => place.replaceChildren(...parts);

// ---- keys of what is shown
const changedValues = () => Object.fromEntries(Object.entries(values).filter(([path, value]) => value !== own[path]));
const away = () => Object.keys(changedValues()).length > 0;
const axesKey = () => JSON.stringify(plane && [plane.x, plane.y, plane.x_span, plane.y_span]);
const startAxes = axesKey();
const pictureKey = () => saved ? "saved" : axesKey() + JSON.stringify(Object.entries(values).filter(([path]) => !plane || (path !== plane.x && path !== plane.y)));
const span = path => plane.x === path ? plane.x_span : plane.y_span;
const within = path => values[path] >= span(path)[0] && values[path] <= span(path)[1];

// ---- steps that can be taken back; all changes of one gesture, such as a drag, are one step
const snapshot = () => ({values: {...values}, plane: plane && {...plane}, chosenAxes});
const past = [], future = [];
let gesture = 0, here = {gesture: -1, state: snapshot()};
for (const kind of ["pointerdown", "keyup", "change"]) document.addEventListener(kind, () => gesture++, true);
function record() {
  if (gesture !== here.gesture) { past.push(here.state); future.length = 0; }
  here = {gesture, state: snapshot()};
}
function travel(from, to) {
  if (!from.length) return;
  to.push(here.state);
  here = {gesture: -1, state: from.pop()};
  ({values, plane, chosenAxes} = structuredClone(here.state));
  shown();
}
