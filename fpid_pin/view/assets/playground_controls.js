"use strict";
// Sliders: each a range and a number for the same setting, one for all joints and one for each.
// How far along its range a value is, 0 to 1, and back.
function scaleOf({scale, low, high, least, step}) {
  if (scale === "stops") {
    const stops = Math.max(PAGE.steps.length - 1, 1);
    return {at: (x) => PAGE.steps.indexOf(x) / stops, of: (p) => PAGE.steps[Math.round(p * stops)], stops};
  }
  if (scale === "linear") {
    const width = step || (high - low) / 1000;
    return {at: (x) => (x - low) / (high - low), stops: Math.round((high - low) / width),
      of: (p) => tidy(Math.round((low + p * (high - low)) / width) * width, 12)};
  }
  // Logarithmic; with 0 at the left end, or none at the right one.
  const zero = scale === "log0", none = scale === "limit", from = zero ? least : low;
  const left = zero ? 0.04 : 0, wide = none ? 0.95 : 1 - left, ratio = high / from;
  return {
    at: (x) => (zero && x < from ? 0 : none && x >= NONE ? 1
      : left + (wide * Math.log(Math.max(none ? Math.min(x, high) : x, from) / from)) / Math.log(ratio)),
    of: (p) => (zero && p < 0.02 ? 0 : none && p > 0.975 ? NONE
      : tidy(from * ratio ** Math.min(Math.max((p - left) / wide, 0), 1)))};
}

class Slider {
  // `joint`: of which joint; null: of all, or of a number that is one for all.
  constructor(control, key, joint, text) {
    Object.assign(this, {control, key, joint});
    const id = `${control.key}${joint === null ? "" : `-${joint}`}`, {unit} = control;
    // One slider for all joints multiplies what each has.
    this.factor = joint === null && Array.isArray(PAGE.start[key]) && control.joints === "factor";
    this.range = make("input", {type: "range", id, min: 0, max: 1, step: 0.002});
    this.number = make("input", {type: "text", inputmode: "decimal", class: "number", autocomplete: "off",
      "aria-label": `${text}${unit ? ` [${unit}]` : ""}, as a number`});
    this.row = make("div", {class: joint === null ? "slider" : "slider joint"},
      make("label", {for: id}, text, ...(unit && joint === null ? [make("small", {}, unit)] : [])),
      this.range, this.number);
    const moved = (final) => this.set(this.scale().of(Number(this.range.value)), final);
    this.range.addEventListener("input", () => moved(false));
    this.range.addEventListener("change", () => moved(true));
    this.number.addEventListener("change", () => this.typed());
  }

  scale() {
    const {scale} = this.control, base = this.factor ? 1 : [PAGE.start[this.key]].flat()[this.joint ?? 0] || 10;
    if (scale === "gain") return scaleOf({scale, low: base / 10, high: 10 * base});
    return scaleOf(this.factor ? {scale, low: 0.02, high: 50} : this.control);
  }

  // What it shows: a number; for all joints their common one, or the first of several.
  value() {
    const all = [model.now[this.key]].flat(), start = [PAGE.start[this.key]].flat();
    if (this.joint !== null) return [all[this.joint], true];
    const parts = this.factor
      ? all.map((x, j) => (x >= NONE || !start[j] ? x || 1 : x / start[j])) : all;
    return [parts[0], parts.every((x) => Math.abs(x - parts[0]) <= 1e-9 * Math.abs(parts[0]))];
  }

  set(value, final) {
    const before = model.now[this.key];
    const times = (x) => (value >= NONE ? NONE : value === 1 || x >= NONE ? x : tidy(x * value, 6));
    const next = !Array.isArray(before) ? value : this.joint !== null ? before.with(this.joint, value)
      : this.factor ? PAGE.start[this.key].map(times) : before.map(() => value);
    model.change({[this.key]: next}, final);
  }

  typed() {
    const text = this.number.value.trim().replace("×", "").replace(",", "."), probe = model.now[this.key];
    const value = text === "none" ? NONE : text === "" ? NaN : Number(text);
    const wrong = Number.isFinite(value)
      ? refusal(this.key, Array.isArray(probe) ? probe.map(() => value) : value) : "expected a number";
    if (!wrong) return this.set(value, true);
    say(wrong, true);
    return this.show();
  }

  show() {
    const [value, alike] = this.value(), scale = this.scale(), at = scale.at(value);
    if (scale.stops) this.range.step = 1 / scale.stops;
    if (Math.abs(Number(this.range.value) - at) > 1e-9) this.range.value = at;
    const text = value >= NONE ? "none" : `${this.factor ? "×" : ""}${label(tidy(value, 5))}`;
    this.number.value = alike ? text : "";
    this.number.placeholder = alike ? "" : "mixed";
    this.range.setAttribute("aria-valuetext", alike
      ? `${text}${this.factor ? " described" : ` ${this.control.unit}`}` : "each joint has its own");
    this.row.classList.toggle("changed", !same(model.now[this.key], PAGE.start[this.key]));
  }
}

function switchOf({key: id, label: text, note}, key) {
  const box = make("input", {type: "checkbox", id, role: "switch"});
  box.addEventListener("change", () => model.change({[key]: box.checked}, true));
  return {row: make("div", {class: "switch"}, box, make("label", {for: id}, text), make("small", {}, note)),
    show() { box.checked = model.now[key]; }};
}

// The sliders of a law and those that all share; returns what sets them to the settings of now.
function buildControls(holder, law) {
  const shown = [], before = new Map([...holder.children].map(({id, open}) => [id, open]));
  holder.replaceChildren(...[...PAGE.laws[law].groups, ...PAGE.groups].map((group, number) => {
    const controls = group.controls.filter(({scale}) => scale !== "stops" || PAGE.steps.length > 1);
    const box = make("details", {class: "group", id: `group-${group.name}`},
      make("summary", {}, group.name), ...controls.map((control) => controlOf(control, law, shown)));
    box.open = before.get(box.id) ?? (before.size > 0 || number < 2 || window.innerWidth >= 1024);
    return box;
  }));
  return () => shown.forEach((item) => item.show());
}

// A setting's row, with what it means and, on demand, a slider for each joint.
function controlOf(control, law, shown) {
  const key = keyOf(control.key, law), part = make("div", {class: "control"});
  const item = control.scale === "switch" ? switchOf(control, key) : new Slider(control, key, null, control.label);
  shown.push(item);
  part.append(item.row);
  if (control.note && item.range) {
    const note = make("small", {class: "note", id: `${control.key}-note`}, control.note);
    item.range.setAttribute("aria-describedby", note.id);
    item.row.append(note);
  }
  if (!Array.isArray(PAGE.start[key]) || JOINTS.length < 2) return part;
  const each = make("div", {class: "each", hidden: ""}, ...JOINTS.map((name, j) => {
    const one = new Slider(control, key, j, name);
    one.row.style.setProperty("--joint", colour(j));
    shown.push(one);
    return one.row;
  }));
  const opener = make("button", {type: "button", class: "opener", "aria-expanded": "false",
    "aria-label": `${control.label}: a slider for each joint`}, "joints");
  opener.addEventListener("click", () => {
    each.hidden = !each.hidden;
    opener.setAttribute("aria-expanded", String(!each.hidden));
  });
  item.row.append(opener);
  part.append(each);
  return part;
}
