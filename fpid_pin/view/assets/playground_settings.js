"use strict";
// Settings: one table of numbers that the sliders move, a link carries and TOML spells out.
const NONE = 1e300;
const tidy = (x, digits = 3) => Number(x.toPrecision(digits));
const clone = (thing) => JSON.parse(JSON.stringify(thing));
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
const fresh = (controller = 0) => clone(PAGE.starts[controller]);
const CONTROLS = PAGE.groups.flatMap((group) => group.controls);
const CONTROL = Object.fromEntries(CONTROLS.map((control) => [control.key, control]));
const JOINTS = PAGE.joints;

// What a setting may be; the words of a refusal, or null.
function refusal(key, value) {
  const start = PAGE.starts[0][key];
  if (start === undefined) return `${key}: no such setting`;
  const one = (x) => typeof x === "number" && Number.isFinite(x);
  if (Array.isArray(start)) {
    if (!Array.isArray(value) || value.length !== start.length || !value.every(one)) {
      return `${key}: expected ${start.length} numbers`;
    }
  } else if (typeof start === "boolean") {
    if (typeof value !== "boolean") return `${key}: expected true or false`;
  } else if (!one(value)) return `${key}: expected a number`;
  const all = [value].flat();
  if (/order$/.test(key) && all.some((x) => x < 0 || x > 1)) return `${key}: expected 0 to 1`;
  if (key !== "q0" && all.some((x) => x < 0)) return `${key}: expected 0 or more`;
  if (key === "step" && !PAGE.steps.includes(value)) {
    return `step: expected one of ${PAGE.steps.join(", ")} s`;
  }
  if (key === "controller" && !(value in PAGE.starts)) return "controller: there is no such one";
  if (key === "m_x" && !(value > CONTROL.m_x.low - 0.05)) {
    return `m_x: expected more than ${tidy(CONTROL.m_x.low - 0.05)}, the reference's own size`;
  }
  if (key === "delay" && (value > 63 || value % 1)) return "delay: expected 0 to 63 samples";
  if (key === "effort_limit" && all.some((x) => x <= 0)) return "effort_limit: expected more than 0";
  return null;
}

// ------------------------------------------------------------------ the link

const spell = (value) => [value].flat().map((x) => (x === NONE ? "none" : String(x))).join(",");

function toLink(now, pinned) {
  const query = new URLSearchParams();
  const add = (settings, head) => {
    const start = fresh(settings.controller);
    if (settings.controller) query.set(`${head}controller`, settings.controller);
    for (const key of Object.keys(start)) {
      if (key !== "controller" && !same(settings[key], start[key])) {
        query.set(head + key, spell(settings[key]));
      }
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
  const take = (head) => {
    const index = Number(query.get(`${head}controller`) ?? 0);
    const settings = fresh(index in PAGE.starts ? index : 0);
    for (const [name, spelt] of query) {
      if (!name.startsWith(head) || name === "pinned") continue;
      const key = name.slice(head.length);
      if (key.includes(".") || key === "controller" || key === "t") continue;
      const start = settings[key];
      const number = (x) => (x === "none" ? NONE : x.trim() === "" ? NaN : Number(x));
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
    return '"' + value.replace(/[\u0000-\u001f"\\\u007f]/g, (c) => (c === '"' || c === "\\" ? "\\" + c
      : "\\u" + c.charCodeAt(0).toString(16).padStart(4, "0"))) + '"';
  }
  if (typeof value === "number") {
    return Math.abs(value) >= NONE ? (value < 0 ? "-inf" : "inf") : Object.is(value, -0) ? "0"
      : String(value);
  }
  if (typeof value === "boolean") return String(value);
  if (Array.isArray(value)) return `[${value.map(tomlValue).join(", ")}]`;
  const pairs = Object.entries(value).map(([key, item]) => `${key} = ${tomlValue(item)}`);
  return pairs.length ? `{ ${pairs.join(", ")} }` : "{}";
}

function toToml(settings) {
  const S = settings, start = fresh(S.controller), base = clone(PAGE.toml);
  const own = (value) => (value.every((x) => x === value[0]) ? value[0] : value);
  const law = base.controllers[S.controller];
  for (const key of ["kp", "ki", "kd", "integral_order", "derivative_order", "k0", "k1"]) {
    law[key] = own(S[key]);
  }
  if (S.learning_rate !== 1) {
    const scaled = (x) => (Array.isArray(x) ? x.map(scaled) : x * S.learning_rate);
    law.learning_rate = scaled(law.learning_rate);
  }
  law.order_learning_rate = S.order_learning_rate;
  if (law.safeguards || S.sigma > 0 || S.dead_zone > 0) {
    law.safeguards = {...law.safeguards, sigma: S.sigma, dead_zone: S.dead_zone};
  }
  if (S.supervised) {
    law.supervisor.m_x = S.m_x;
    if (law.supervisor.lookahead) law.supervisor.lookahead = Math.max(law.supervisor.lookahead, S.step);
  } else delete law.supervisor;
  // An observer is not faster than its sampling.
  for (const one of [law, law.supervisor ?? {}]) {
    if (one.observer) one.observer = Math.min(one.observer, 1 / S.step);
  }
  const arm = base.arm, plant = base.plant;
  const limited = !same(S.effort_limit, start.effort_limit);
  if (S.knows_limit && (limited || !start.knows_limit)) {
    arm.changes = [...(arm.changes ?? []), {limits: {effort: own(S.effort_limit)}}];
  }
  plant.effort_limit = own(S.effort_limit);
  plant.viscous_friction = own(S.viscous_friction);
  plant.dry_friction = own(S.dry_friction);
  if (S.payload > 0) plant.payload = {mass: S.payload};
  const reference = base.reference;
  if (S.reference_size !== 1 || S.reference_speed !== 1) {
    const times = (x, factor) => (Array.isArray(x) ? x.map((y) => y * factor) : x * factor);
    reference.amplitude = times(reference.amplitude, S.reference_size);
    reference.frequency = times(reference.frequency, S.reference_speed);
  }
  const disturbances = [...base.others];
  if (base.movable || S.disturbance.some((x) => x > 0)) {
    disturbances.unshift({kind: "cosine", amplitude: own(S.disturbance),
      frequency: S.disturbance_frequency, phase: ENGINE.disturbance.phase});
  }
  const sensors = {...base.sensors, position_noise: S.position_noise,
    velocity_noise: S.velocity_noise, position_resolution: S.position_resolution,
    velocity: S.differentiated ? "differentiated" : "measured", delay: S.delay};
  const simulation = {...base.simulation, q0: S.q0, step: S.step};
  const lines = ["# From a playground of fpid_pin. Run it:  fpid-pin run THIS_FILE.toml",
    "format = 1", `title = ${tomlValue(PAGE.title)}`];
  const section = (head, table) => {
    lines.push("", head);
    for (const [key, value] of Object.entries(table)) {
      if (head !== "[sensors]" || key !== "kind") lines.push(`${key} = ${tomlValue(value)}`);
    }
  };
  section("[arm]", arm);
  section("[reference]", reference);
  disturbances.forEach((one) => section("[[disturbance]]", one));
  section("[plant]", plant);
  section("[sensors]", sensors);
  section("[simulation]", simulation);
  section("[[controller]]", law);
  return lines.join("\n") + "\n";
}
