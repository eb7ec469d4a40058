"use strict";
// Settings: one table that the sliders move, a link carries and TOML spells out.
const NONE = 1e300;
const JOINTS = PAGE.joints;
const tidy = (x, digits = 3) => Number(x.toPrecision(digits));
const clone = (thing) => JSON.parse(JSON.stringify(thing));
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
const fresh = () => clone(PAGE.start);

// A law's setting has the law's number before its name; all laws share the others.
const keyOf = (name, law) => (name in PAGE.start ? name : `${law}.${name}`);

// What the run of one law is made with, by plain names.
function settingsOf(now, law) {
  const found = {};
  for (const [key, value] of Object.entries(now)) {
    const [head, name] = key.split(".");
    if (name === undefined) found[key] = value;
    else if (Number(head) === law) found[name] = value;
  }
  return {...found, controller: law, beside: []};
}

// What a setting may be; the words of a refusal, or null.
function refusal(key, value) {
  const start = PAGE.start[key], name = key.split(".").pop(), law = PAGE.laws[parseInt(key, 10)];
  if (start === undefined) return `${name}: no such setting`;
  const all = [value].flat(), laws = key === "beside";
  if (typeof start === "boolean") {
    return typeof value === "boolean" ? null : `${name}: expected true or false`;
  }
  if (!all.every(Number.isFinite) || (!laws && all.length !== [start].flat().length)) {
    return `${name}: expected ${Array.isArray(start) ? `${start.length} numbers` : "a number"}`;
  }
  const beyond = (low, high) => all.some((x) => x < low || x > high);
  if (laws || key === "controller") {
    return all.every((k) => k in PAGE.laws) ? null : `${name}: there is no such controller`;
  }
  if (law?.orders.includes(name)) return beyond(0, 1) ? `${name}: expected 0 to 1` : null;
  if (name === "m_x") return beyond(law.bound, NONE) ? `m_x: expected at least ${law.bound}` : null;
  if (key === "step") {
    return PAGE.steps.includes(value) ? null : `step: expected one of ${PAGE.steps.join(", ")} s`;
  }
  if (key === "delay" && (beyond(0, 63) || value % 1)) return "delay: expected 0 to 63 samples";
  if (key === "effort_limit" && all.some((x) => x <= 0)) return "effort_limit: expected more than 0";
  const negative = key === "q0" || [start].flat().some((x) => x < 0);
  return !negative && beyond(0, Infinity) ? `${name}: expected 0 or more` : null;
}

// ------------------------------------------------------------------ the link

function toLink(now, pinned) {
  const query = new URLSearchParams();
  const add = (settings, head) => {
    for (const key of Object.keys(PAGE.start).filter((k) => !same(settings[k], PAGE.start[k]))) {
      const [law, name] = key.split("."), own = Number(law) === settings.controller;
      const text = [settings[key]].flat().map((x) => (x === NONE ? "none" : String(x))).join(",");
      query.set(head + (name && own ? name : key), text);
    }
  };
  add(now, "");
  if (pinned) {
    query.set("pinned", "yes");
    add(pinned, "pin.");
  }
  return query.toString().replaceAll("%2C", ",");
}

function fromLink(text) {
  const query = new URLSearchParams(text), faults = [];
  const number = (x) => (x === "none" ? NONE : x.trim() === "" ? NaN : Number(x));
  const take = (head) => {
    const settings = fresh(), law = Number(query.get(`${head}controller`) ?? 0);
    for (const [name, spelt] of query) {
      if (!name.startsWith(head) || name === "pinned" || (!head && name.startsWith("pin."))) continue;
      const key = keyOf(name.slice(head.length), law), start = PAGE.start[key];
      const value = typeof start === "boolean" ? {true: true, false: false}[spelt]
        : Array.isArray(start) ? spelt.split(",").map(number) : number(spelt);
      const wrong = refusal(key, value);
      if (wrong) faults.push(wrong); else settings[key] = value;
    }
    return settings;
  };
  return {now: take(""), pinned: query.get("pinned") === "yes" ? take("pin.") : null, faults};
}

// ------------------------------------------------------------------ TOML

function tomlValue(value) {
  if (typeof value === "string") {
    const escaped = (c) => (c === '"' || c === "\\" ? `\\${c}`
      : `\\u${c.charCodeAt(0).toString(16).padStart(4, "0")}`);
    return `"${value.replace(/[\u0000-\u001f"\\\u007f]/g, escaped)}"`;
  }
  if (typeof value === "number" && Math.abs(value) >= NONE) return value < 0 ? "-inf" : "inf";
  if (typeof value !== "object") return String(value);
  if (Array.isArray(value)) return `[${value.map(tomlValue).join(", ")}]`;
  const pairs = Object.entries(value).map(([key, item]) => `${key} = ${tomlValue(item)}`);
  return `{ ${pairs.join(", ")} }`;
}

// The described configuration with what was moved in its place; of one law, see settingsOf.
function toToml(S) {
  const {arm, reference, plant, sensors, simulation, others, movable, controllers} = clone(PAGE.toml);
  const law = controllers[S.controller], start = settingsOf(PAGE.start, S.controller);
  const {fpid, groups} = PAGE.laws[S.controller], moved = (key) => !same(S[key], start[key]);
  const scaled = (x, factor) => (Array.isArray(x) ? x.map((y) => scaled(y, factor)) : x * factor);
  // What a setting is in a configuration its slider says; those that say nothing follow one by one.
  const tables = {law, plant, sensors, simulation};
  for (const {key, toml} of [...groups, ...PAGE.groups].flatMap(({controls}) => controls)) {
    if (toml && moved(key)) tables[toml][key] = S[key];
  }
  if (moved("q0")) simulation.q0 = S.q0;
  if (fpid) {
    law.learning_rate = scaled(law.learning_rate, S.learning_rate);
    if (moved("sigma") || moved("dead_zone")) {
      law.safeguards = {...law.safeguards, sigma: S.sigma, dead_zone: S.dead_zone};
    }
  }
  if (S.supervised) {
    law.supervisor.m_x = S.m_x;
    if (law.supervisor.lookahead) law.supervisor.lookahead = Math.max(law.supervisor.lookahead, S.step);
  } else delete law.supervisor;
  // An observer is not faster than its sampling.
  for (const one of [law, law.supervisor ?? {}]) {
    if (one.observer) one.observer = Math.min(one.observer, 1 / S.step);
  }
  if (S.knows_limit && (moved("effort_limit") || moved("knows_limit"))) {
    arm.changes = [...(arm.changes ?? []), {limits: {effort: S.effort_limit}}];
  }
  if (S.payload > 0) plant.payload = {mass: S.payload};
  if (moved("reference_size")) reference.amplitude = scaled(reference.amplitude, S.reference_size);
  if (moved("reference_speed")) reference.frequency = scaled(reference.frequency, S.reference_speed);
  if (moved("differentiated")) sensors.velocity = S.differentiated ? "differentiated" : "measured";
  if (movable || S.disturbance.some((x) => x > 0)) {
    others.unshift({kind: "cosine", amplitude: S.disturbance, frequency: S.disturbance_frequency,
      phase: ENGINE.disturbance.phase});
  }
  const lines = ["# From a playground of fpid_pin. Run it:  fpid-pin run THIS_FILE.toml",
    "format = 1", `title = ${tomlValue(PAGE.title)}`];
  if (PAGE.toml.import.length) {
    lines.push(`import = ${tomlValue(PAGE.toml.import)}  # put it beside this file, and --allow-import`);
  }
  const section = (head, table) => lines.push("", head,
    ...Object.entries(table).map(([key, value]) => `${key} = ${tomlValue(value)}`));
  section("[arm]", arm);
  section("[reference]", reference);
  others.forEach((one) => section("[[disturbance]]", one));
  section("[plant]", plant);
  section("[sensors]", sensors);
  section("[simulation]", simulation);
  section("[[controller]]", law);
  return `${lines.join("\n")}\n`;
}
