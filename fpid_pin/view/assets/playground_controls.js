"use strict";
// Sliders: each a range and a number for the same setting, one for all joints and one for each.
const make = (tag, attributes = {}, ...children) => {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "class") node.className = value; else if (value !== null) node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
};

// How far along its range a value is, 0 to 1, and back.
function scaleOf(control, key, j) {
  const {scale, low, high, least} = control;
  const log = (from, to) => ({
    at: (x) => Math.log(Math.max(x, from) / from) / Math.log(to / from),
    of: (p) => tidy(from * (to / from) ** p)});
  if (scale === "log") return log(low, high);
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
    const last = PAGE.steps.length - 1;
    return {at: (x) => (last ? PAGE.steps.indexOf(x) / last : 0),
      of: (p) => PAGE.steps[Math.round(p * last)], stops: last};
  }
  if (scale === "gain") {
    const base = fresh(model.now.controller)[key][j] || 10;
    return log(base / 10, base * 10);
  }
  const step = control.step || (high - low) / 1000;
  return {at: (x) => (x - low) / (high - low),
    of: (p) => tidy(Math.round((low + p * (high - low)) / step) * step, 12),
    stops: Math.round((high - low) / step)};
}

class Slider {
  // `joint`: of which joint; null: of all, or of a number that is one for all.
  constructor(control, joint, text) {
    Object.assign(this, {control, joint});
    const id = `${control.key}${joint === null ? "" : `-${joint}`}`;
    this.shared = control.joints && joint === null;
    const words = text + (control.unit ? ` [${control.unit}]` : "");
    this.range = make("input", {type: "range", id, min: 0, max: 1, step: 0.002});
    this.number = make("input", {type: "text", inputmode: "decimal", class: "number",
      "aria-label": `${words}, as a number`, autocomplete: "off"});
    const name = make("label", {for: id}, text);
    if (control.unit && joint === null) name.append(make("small", {}, control.unit));
    this.row = make("div", {class: joint === null ? "slider" : "slider joint"}, name, this.range,
      this.number);
    this.range.addEventListener("input", () => this.moved(false));
    this.range.addEventListener("change", () => this.moved(true));
    this.number.addEventListener("change", () => this.typed());
  }

  get factor() { return this.shared && this.control.joints === "factor"; }

  scale() {
    if (this.factor) {
      if (this.control.scale === "limit") {
        return {at: (x) => (x >= NONE ? 1 : Math.min(Math.max(0.5 + Math.log10(x) / 3.4, 0), 0.95)),
          of: (p) => (p > 0.97 ? NONE : tidy(10 ** (3.4 * (p - 0.5))))};
      }
      return {at: (x) => 0.5 + 0.5 * Math.log10(Math.max(x, 0.1)), of: (p) => tidy(10 ** (2 * p - 1))};
    }
    return scaleOf(this.control, this.control.key, this.joint ?? 0);
  }

  // What it shows: a number; for all joints their common one, or their mean.
  value() {
    const all = model.now[this.control.key];
    if (!Array.isArray(all)) return [all, true];
    if (this.joint !== null) return [all[this.joint], true];
    if (this.factor) {
      const base = fresh(model.now.controller)[this.control.key];
      const parts = all.map((x, j) => (x >= NONE ? NONE : base[j] ? x / base[j] : 1));
      return [parts[0], parts.every((x) => Math.abs(x / parts[0] - 1) < 1e-9)];
    }
    const alike = all.every((x) => x === all[0]);
    return [alike ? all[0] : all.reduce((a, b) => a + b) / all.length, alike];
  }

  set(value, final) {
    const {key} = this.control, before = model.now[key];
    let next = value;
    if (Array.isArray(before)) {
      if (this.joint !== null) next = before.map((x, j) => (j === this.joint ? value : x));
      else if (this.factor) {
        next = fresh(model.now.controller)[key].map((x) =>
          (value >= NONE ? NONE : value === 1 ? x : x >= NONE ? x : tidy(x * value, 6)));
      } else next = before.map(() => value);
    }
    model.change({[key]: next}, final);
  }

  moved(final) {
    this.set(this.scale().of(Number(this.range.value)), final);
  }

  typed() {
    const text = this.number.value.trim().replace("×", "").replace(",", ".");
    const value = text === "none" ? NONE : text === "" ? NaN : Number(text);
    const {key} = this.control, probe = model.now[key];
    const wrong = Number.isFinite(value)
      ? refusal(key, Array.isArray(probe) ? probe.map(() => value) : value) : "expected a number";
    if (wrong) {
      say(wrong, true);
      this.show();
    } else this.set(value, true);
  }

  show() {
    const [value, alike] = this.value(), scale = this.scale();
    if (scale.stops) this.range.step = 1 / scale.stops;
    const at = scale.at(value);
    if (Math.abs(Number(this.range.value) - at) > 1e-9) this.range.value = at;
    const text = value >= NONE ? "none" : `${this.factor ? "×" : ""}${label(tidy(value, 5))}`;
    this.number.value = alike ? text : "";
    this.number.placeholder = alike ? "" : "mixed";
    this.range.setAttribute("aria-valuetext", alike
      ? `${text}${this.factor ? " described" : ` ${this.control.unit}`}` : "each joint has its own");
    this.range.style.setProperty("--at", `${100 * Math.min(Math.max(at, 0), 1)}%`);
    this.row.classList.toggle("changed",
      !same(model.now[this.control.key], fresh(model.now.controller)[this.control.key]));
  }
}

class Switch {
  constructor(control) {
    this.control = control;
    this.box = make("input", {type: "checkbox", id: control.key, role: "switch"});
    this.row = make("div", {class: "switch"}, this.box, make("label", {for: control.key}, control.label));
    if (control.note) this.row.append(make("small", {}, control.note));
    this.box.addEventListener("change", () => model.change({[control.key]: this.box.checked}, true));
  }

  show() {
    this.box.checked = model.now[this.control.key];
  }
}

function buildControls(holder) {
  const shown = [];
  PAGE.groups.forEach((group, number) => {
    const box = make("details", {class: "group"}, make("summary", {}, group.name));
    box.open = number < 2 || window.innerWidth >= 1024;
    for (const control of group.controls) {
      if (control.scale === "stops" && PAGE.steps.length < 2) continue;
      const item = control.scale === "switch" ? new Switch(control)
        : new Slider(control, null, control.label);
      const part = make("div", {class: "control"}, item.row);
      if (control.note && control.scale !== "switch") {
        const note = make("small", {class: "note", id: `${control.key}-note`}, control.note);
        item.range.setAttribute("aria-describedby", note.id);
        item.row.append(note);
      }
      shown.push(item);
      if (control.joints && JOINTS.length > 1) {
        const each = make("div", {class: "each", hidden: ""});
        const opener = make("button", {type: "button", class: "opener", "aria-expanded": "false",
          "aria-label": `${control.label}: a slider for each joint`}, "joints");
        JOINTS.forEach((name, j) => {
          const one = new Slider(control, j, name);
          one.row.style.setProperty("--joint", `var(--joint-${j % 7})`);
          shown.push(one);
          each.append(one.row);
        });
        opener.addEventListener("click", () => {
          each.hidden = !each.hidden;
          opener.setAttribute("aria-expanded", String(!each.hidden));
        });
        item.row.append(opener);
        part.append(each);
      }
      box.append(part);
    }
    holder.append(box);
  });
  return () => shown.forEach((item) => item.show());
}
