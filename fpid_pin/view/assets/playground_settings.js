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
  const own = Object.entries(now).map(([key, value]) => [key.split("."), value])
    .filter(([[head, name]]) => name === undefined || Number(head) === law)
    .map(([key, value]) => [key.pop(), value]);
  return {...Object.fromEntries(own), controller: law, beside: []};
}

// What a setting may be; the words of a refusal, or null.
function refusal(key, value) {
  const start = PAGE.start[key], name = key.split(".").pop(), law = PAGE.laws[parseInt(key, 10)];
  if (start === undefined) return `${name}: no such setting`;
  const all = [value].flat(), within = (low, high) => all.every((x) => x >= low && x <= high);
  const expect = (fits, words) => (fits ? null : `${name}: expected ${words}`);
  if (typeof start === "boolean") return expect(typeof value === "boolean", "true or false");
  if (key !== "beside" && all.length !== [start].flat().length || !all.every(Number.isFinite)) {
    return expect(false, Array.isArray(start) ? `${start.length} numbers` : "a number");
  }
  const laws = all.every((k) => k in PAGE.laws);
  if (key === "beside" || key === "controller") return laws ? null : `${name}: there is no such controller`;
  if (law?.orders.includes(name)) return expect(within(0, 1), "0 to 1");
  if (name === "m_x") return expect(within(law.bound, NONE), `at least ${law.bound}`);
  if (key === "step") return expect(PAGE.steps.includes(value), `one of ${PAGE.steps.join(", ")} s`);
  if (key === "delay") return expect(within(0, 63) && value % 1 === 0, "0 to 63 samples");
  if (key === "effort_limit") return expect(all.every((x) => x > 0), "more than 0");
  const signed = key === "q0" || [start].flat().some((x) => x < 0);
  return expect(signed || within(0, Infinity), "0 or more");
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
  const {controllers, movable, import: files, ...tables} = clone(PAGE.toml), {arm, simulation, sensors} = tables;
  const law = controllers[S.controller], start = settingsOf(PAGE.start, S.controller);
  const moved = (key) => !same(S[key], start[key]), places = {law, ...tables};
  const scaled = (x, factor) => (Array.isArray(x) ? x.map((y) => scaled(y, factor)) : x * factor);
  // Where a setting is in a configuration its slider says, and whether it is a factor of what is
  // described or comes on top; those that say nothing follow one by one.
  for (const {key, toml} of [...PAGE.laws[S.controller].groups, ...PAGE.groups].flatMap((x) => x.controls)) {
    if (!toml || !moved(key)) continue;
    const [path, how] = toml.split(" "), names = path.split("."), name = names.pop();
    const table = names.reduce((inside, head) => inside[head] ??= {}, places);
    table[name] = how === "times" ? scaled(table[name], S[key])
      : how === "more" ? (table[name] ?? 0) + S[key] : S[key];
  }
  if (moved("q0")) simulation.q0 = S.q0;
  if (moved("differentiated")) sensors.velocity = S.differentiated ? "differentiated" : "measured";
  if (!S.supervised) delete law.supervisor;
  else if (law.supervisor.lookahead) law.supervisor.lookahead = Math.max(law.supervisor.lookahead, S.step);
  // An observer is not faster than its sampling.
  for (const one of [law, law.supervisor ?? {}]) {
    if (one.observer) one.observer = Math.min(one.observer, 1 / S.step);
  }
  if (S.knows_limit && (moved("effort_limit") || moved("knows_limit"))) {
    arm.changes = [...(arm.changes ?? []), {limits: {effort: S.effort_limit}}];
  }
  if (movable || S.disturbance.some((x) => x > 0)) {
    tables.disturbance.unshift({kind: "cosine", amplitude: S.disturbance,
      frequency: S.disturbance_frequency, phase: ENGINE.disturbance.phase});
  }
  const section = (name, table) => ["", name,
    ...Object.entries(table).map(([key, value]) => `${key} = ${tomlValue(value)}`)];
  return ["# From a playground of fpid_pin. Run it:  fpid-pin run THIS_FILE.toml",
    "format = 1", `title = ${tomlValue(PAGE.title)}`,
    ...(files.length ? [`import = ${tomlValue(files)}  # put it beside this file, and --allow-import`] : []),
    ...Object.entries({...tables, controller: [law]}).flatMap(([name, table]) => (Array.isArray(table)
      ? table.flatMap((one) => section(`[[${name}]]`, one)) : section(`[${name}]`, table))), ""].join("\n");
}
