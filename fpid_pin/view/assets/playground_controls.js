"use strict";
// Sliders: each a range and a number for the same setting, one for all joints and one for each.
// How far along its range a value is, 0 to 1, and back.
function scaleOf({scale, low, high, least, step}, base) {
  const log = (from, to) => ({
    at: (x) => Math.log(Math.max(x, from) / from) / Math.log(to / from),
    of: (p) => tidy(from * (to / from) ** p)});
  if (scale === "log") return log(low, high);
  if (scale === "gain") return log((base || 10) / 10, (base || 10) * 10);
  if (scale === "log0") {
    const inner = log(least, high);
    return {at: (x) => (x < least ? 0 : 0.04 + 0.96 * inner.at(x)),
      of: (p) => (p < 0.02 ? 0 : inner.of(Math.max(p - 0.04, 0) / 0.96))};
  }
  if (scale === "limit") {
    const inner = log(low, high);
    return {at: (x) => (x >= NONE ? 1 : 0.95 * inner.at(Math.min(x, high))),
      of: (p) => (p > 0.975 ? NONE : inner.of(Math.min(p / 0.95, 1)))};
  }
  if (scale === "stops") {
    const last = Math.max(PAGE.steps.length - 1, 1);
    return {at: (x) => PAGE.steps.indexOf(x) / last, of: (p) => PAGE.steps[Math.round(p * last)],
      stops: last};
  }
  const width = step || (high - low) / 1000;
  return {at: (x) => (x - low) / (high - low),
    of: (p) => tidy(Math.round((low + p * (high - low)) / width) * width, 12),
    stops: Math.round((high - low) / width)};
}

class Slider {
  // `joint`: of which joint; null: of all, or of a number that is one for all.
  constructor(control, key, joint, text) {
    Object.assign(this, {control, key, joint});
    const id = `${control.key}${joint === null ? "" : `-${joint}`}`;
    // One slider for all joints multiplies what each has.
    this.factor = joint === null && Array.isArray(PAGE.start[key]) && control.joints === "factor";
    const words = text + (control.unit ? ` [${control.unit}]` : "");
    this.range = make("input", {type: "range", id, min: 0, max: 1, step: 0.002});
    this.number = make("input", {type: "text", inputmode: "decimal", class: "number",
      "aria-label": `${words}, as a number`, autocomplete: "off"});
    const name = make("label", {for: id}, text);
    if (control.unit && joint === null) name.append(make("small", {}, control.unit));
    this.row = make("div", {class: joint === null ? "slider" : "slider joint"}, name, this.range,
      this.number);
    const moved = (final) => this.set(this.scale().of(Number(this.range.value)), final);
    this.range.addEventListener("input", () => moved(false));
    this.range.addEventListener("change", () => moved(true));
    this.number.addEventListener("change", () => this.typed());
  }

  scale() {
    const base = [PAGE.start[this.key]].flat()[this.joint ?? 0], {scale} = this.control;
    if (!this.factor) return scaleOf(this.control, base);
    return scaleOf(scale === "limit" ? {scale, low: 0.02, high: 50} : {scale: "gain"}, 1);
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
    let next = value;
    if (Array.isArray(before)) {
      if (this.joint !== null) next = before.with(this.joint, value);
      else next = this.factor ? PAGE.start[this.key].map(times) : before.map(() => value);
    }
    model.change({[this.key]: next}, final);
  }

  typed() {
    const text = this.number.value.trim().replace("×", "").replace(",", ".");
    const value = text === "none" ? NONE : text === "" ? NaN : Number(text);
    const probe = model.now[this.key];
    const wrong = Number.isFinite(value)
      ? refusal(this.key, Array.isArray(probe) ? probe.map(() => value) : value) : "expected a number";
    if (wrong) {
      say(wrong, true);
      this.show();
    } else this.set(value, true);
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

class Switch {
  constructor({key: id, label: text, note}, key) {
    this.key = key;
    this.box = make("input", {type: "checkbox", id, role: "switch"});
    this.row = make("div", {class: "switch"}, this.box, make("label", {for: id}, text),
      make("small", {}, note));
    this.box.addEventListener("change", () => model.change({[key]: this.box.checked}, true));
  }

  show() {
    this.box.checked = model.now[this.key];
  }
}

// The sliders of a law and those that all share; returns what sets them to the settings of now.
function buildControls(holder, law) {
  const shown = [], closed = [...holder.querySelectorAll("details:not([open])")].map((x) => x.id);
  const built = holder.childElementCount > 0;
  holder.replaceChildren();
  [...PAGE.laws[law].groups, ...PAGE.groups].forEach((group, number) => {
    const id = `group-${group.name}`;
    const box = make("details", {class: "group", id}, make("summary", {}, group.name));
    box.open = built ? !closed.includes(id) : number < 2 || window.innerWidth >= 1024;
    for (const control of group.controls) {
      if (control.scale === "stops" && PAGE.steps.length < 2) continue;
      const key = keyOf(control.key, law);
      const item = control.scale === "switch" ? new Switch(control, key)
        : new Slider(control, key, null, control.label);
      const part = make("div", {class: "control"}, item.row);
      shown.push(item);
      if (control.note && item.range) {
        const note = make("small", {class: "note", id: `${control.key}-note`}, control.note);
        item.range.setAttribute("aria-describedby", note.id);
        item.row.append(note);
      }
      if (Array.isArray(PAGE.start[key]) && JOINTS.length > 1) part.append(jointSliders(control, key, item, shown));
      box.append(part);
    }
    holder.append(box);
  });
  return () => shown.forEach((item) => item.show());
}

function jointSliders(control, key, {row}, shown) {
  const each = make("div", {class: "each", hidden: ""});
  const opener = make("button", {type: "button", class: "opener", "aria-expanded": "false",
    "aria-label": `${control.label}: a slider for each joint`}, "joints");
  JOINTS.forEach((name, j) => {
    const one = new Slider(control, key, j, name);
    one.row.style.setProperty("--joint", `var(--joint-${j % 7})`);
    shown.push(one);
    each.append(one.row);
  });
  opener.addEventListener("click", () => {
    each.hidden = !each.hidden;
    opener.setAttribute("aria-expanded", String(!each.hidden));
  });
  row.append(opener);
  return each;
}
