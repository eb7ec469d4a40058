"use strict";
// Runs an experiment on the printed kernels, in a Web Worker or in node: what the settings say is
// written into a memory that starts as the description's, then blocks of ticks are made.
// E (the engine's table), M (the memory) and K (the rollouts) stand before this script.
const decode = (text) => new Float64Array(
  Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
const N = E.n, B = E.block, MODES = E.modes, WIDTH = 3 + MODES;
const POINTS = decode(E.points), PAYLOAD = decode(E.payload);
const LAWS = E.laws.map((law) => ({...law, width: Object.keys(law.fields).length,
  robots: law.robots.map((pair) => pair.map(decode)),
  start: Object.entries(law.start).map(([name, text]) => [law.places[name], decode(text)])}));
const STEPS = E.steps.map(({step, poles, weights}) =>
  ({step, poles: decode(poles), weights: decode(weights)}));
const ROWS = E.reference.rows ? decode(E.reference.rows) : null;

// Where in the memory the arrays of the law that runs begin; the place of a field of record k of an
// array; of a law's own number of joint j.
let AT = null, width = 0;
const place = (name, k, field) => {
  const fields = E.fields[name];
  return AT[name] + k * Object.keys(fields).length + fields[field];
};
const write = (name, k, values) => {
  for (const [field, value] of Object.entries(values)) M[place(name, k, field)] = Number(value);
};
const numberOf = (j, column) => AT["c.joints"] + j * width + column;
const own = (value, j) => (Array.isArray(value) ? value[j % value.length] : value);

// c1, c0, c2 and the modes' weights at an order, by the polynomial through Chebyshev's points
// (barycentric form, second kind).
function weightsAt({weights}, order) {
  const out = new Float64Array(WIDTH), last = POINTS.length - 1;
  let total = 0;
  for (let i = 0; i <= last; i++) {
    if (Math.abs(order - POINTS[i]) < 1e-300) return weights.subarray(i * WIDTH, (i + 1) * WIDTH);
    const share = (i % 2 ? -1 : 1) * (i === 0 || i === last ? 0.5 : 1) / (order - POINTS[i]);
    total += share;
    for (let m = 0; m < WIDTH; m++) out[m] += share * weights[i * WIDTH + m];
  }
  return out.map((x) => x / total);
}

// Operators as `control.state` and `fractional.design` make them, for this step and these orders.
function setOperators(S, law, step) {
  const count = law.operators.length, moves = (S.order_learning_rate ?? 1) > 0;
  if (!count) return;
  M.set(step.poles, AT["c.poles"]);
  law.operators.forEach((operator, i) => {
    for (let j = 0; j < N; j++) {
      const k = j * count + i, variable = operator.adapts && moves;
      if (operator.order >= 0) {
        const given = M[numberOf(j, operator.order)];
        write("c.ops", k, {order: operator.integral ? 1 - given : given});
      }
      const order = M[place("c.ops", k, "order")], [c1, c0, c2, ...modes] = weightsAt(step, order);
      write("c.ops", k, {c1, c0, c2, variable, order_column: variable ? operator.order : -1,
        initial_output: law.kick ? step.step ** -order : 0});
      modes.forEach((weight, m) => write("c.modes", k * MODES + m, {weight, x: 0}));
    }
    for (let a = 0; operator.adapts && moves && a < E.nodes; a++) {
      const weights = weightsAt(step, a / (E.nodes - 1));
      for (let m = 0; m < WIDTH; m++) M[AT["c.table"] + m * E.nodes + a] = weights[m];
    }
  });
}

// A law's numbers, as `Controller.numbers` gives them.
function setLaw(S, law) {
  for (let j = 0; j < N; j++) {
    const at = (name) => numberOf(j, law.fields[name]);
    const set = (values) => { for (const name in values) M[at(name)] = values[name]; };
    set({h: S.step, ...(S.knows_limit ? {limit: S.effort_limit[j]} : {})});
    if (!law.guarded && (S.sigma > 0 || S.dead_zone > 0) && "kp_min" in law.fields) {
      set({kp_min: 0, ki_min: 0, kd_min: 0});
    }
    if (S.order_learning_rate === 0) {
      set({integral_order_min: 0, integral_order_max: 1, derivative_order_min: 0,
        derivative_order_max: 1});
    } else if (S.order_learning_rate > 0) {
      // Orders that move start above 0: e - e(0) is the limit of mu.
      set({derivative_order_min: Math.max(M[at("derivative_order_min")], 2 ** -1022)});
    }
    for (const [key, columns] of Object.entries(law.moves)) {
      for (const [column, slope] of columns) M[numberOf(j, column)] = slope[j] * own(S[key], j);
    }
    // Projection counts from the start.
    for (const name of Object.keys(law.fields).filter((one) => `${one}_min` in law.fields)) {
      const start = Math.min(Math.max(M[at(name)], M[at(`${name}_min`)]), M[at(`${name}_max`)]);
      set({[name]: start, [`${name}_0`]: start});
    }
  }
}

// Observer and supervisor, as Python's own robot has them at this step.
function setAssistance(S, law, step) {
  M.set(law.robots[STEPS.indexOf(step)][Number(S.supervised)], AT["c.robot"]);
  // Sizes of V are in proportion to the square of what M_x leaves beside the reference.
  const {m_x, reference_bound} = law.supervisor;
  const size = ((S.m_x - reference_bound) / (m_x - reference_bound)) ** 2;
  for (const name of ["threshold", "target", "trigger"]) M[place("c.robot", 0, name)] *= size;
}

function setPlant(S) {
  const keep = Math.exp(-E.cutoff * S.step);
  PAYLOAD.forEach((more, k) => { M[AT["plant.bodies"] + k] += S.payload * more; });
  for (let i = 0; i < N; i++) {
    for (const [key, array, field] of E.targets) write(array, i, {[field]: own(S[key], i)});
    M[place("plant.bodies", i, "armature")] += S.step * S.viscous_friction[i];
    write("sensing.joints", i, {keep, gain: (1 - keep) / S.step});
    [M[AT["plant.q"] + i], M[AT["plant.v"] + i]] = [S.q0[i], E.v0[i]];
  }
}

// What is given from outside in a block of rows: formulas, or rows that Python sampled.
function sample(S, first) {
  const {reference, disturbance} = E, count = ROWS ? ROWS.length / (3 * N) : 0;
  const parts = [{amplitude: S.disturbance, frequency: S.disturbance_frequency, ...disturbance},
    ...disturbance.others];
  M.fill(0, AT["rows.forces"], AT["rows.forces"] + B * N);
  for (let j = 0; j < N; j++) {
    const at = AT["rows.reference"] + j, forces = AT["rows.forces"] + j;
    const w = own(reference.frequency, j) * S.reference_speed, phase = own(reference.phase, j);
    const a = own(reference.amplitude, j) * S.reference_size, offset = own(reference.offset, j);
    for (let k = 0; k < B; k++) {
      const angle = (first + k) * S.step * w + phase, row = Math.min(first + k, count - 1);
      const motion = ROWS ? [0, 1, 2].map((i) => ROWS[(i * count + row) * N + j])
        : [offset + a * Math.sin(angle), a * w * Math.cos(angle), -a * (w * w) * Math.sin(angle)];
      for (let i = 0; i < 3; i++) M[at + (i * B + k) * N] = motion[i];
    }
    for (const part of parts) {
      const size = own(part.amplitude ?? part.torque, j);
      const rate = own(part.frequency, j), shift = own(part.phase, j);
      for (let k = 0; k < B; k++) {
        const t = (first + k) * S.step;
        M[forces + k * N] += part.kind !== "pulse" ? size * Math.cos(t * rate + shift)
          : t >= part.start - 1e-9 && t < part.end - 1e-9 ? size : 0;
      }
    }
  }
}

// Why a run has ended, in the words of `simulation.engine`; a speed as Python's %.3g writes it.
function outcome(row, S) {
  const at = (name, j) => M[AT[name] + j], slow = (j) => Math.abs(at("plant.v", j)) <= E.runaway;
  const finite = (name, j) => Number.isFinite(at(name, j));
  const sound = (j) => slow(j) && finite("plant.q", j) && finite("torque", j);
  const j = Math.max(E.joints.findIndex((_, k) => !sound(k)), 0), speed = Math.abs(at("plant.v", j));
  const [digits, power] = speed.toExponential(2).split("e");
  const brief = Math.abs(power) < 3 ? String(Number(speed.toPrecision(3)))
    : `${Number(digits)}e${power[0]}${power.slice(1).padStart(2, "0")}`;
  const cause = !finite("plant.v", j) ? "speed is not finite"
    : !slow(j) ? `speed ${brief} ${E.units[j]}/s is beyond ${E.runaway} ${E.units[j]}/s`
      : !finite("torque", j) ? "torque is not finite" : "angle is not finite";
  return {completed: false, time: row * S.step, joint: E.joints[j], cause};
}

function simulate(S) {
  const law = LAWS[S.controller];
  [AT, width] = [law.places, law.width];
  M.fill(0);
  for (const [at, values] of law.start) M.set(values, at);
  setLaw(S, law);
  const step = STEPS.find((each) => each.step === S.step);
  setAssistance(S, law, step);
  setOperators(S, law, step);
  setPlant(S);
  M.set(law.columns, AT["rows.columns"]);
  const rows = Math.round(E.duration / S.step) + 1, out = {};
  const kept = {q: "rows.motion", v: "rows.motion", torque: "rows.motion", q_ref: "rows.reference"};
  law.kept.forEach((name) => { kept[name] = "rows.kept"; });
  const places = Object.entries(kept).map(([name, array], k) =>
    [name, AT[array] + {"rows.motion": k, "rows.reference": 0, "rows.kept": k - 4}[array] * B * N]);
  for (const [name] of places) out[name] = new Float64Array(rows * N);
  const draw = S.position_noise > 0 || S.velocity_noise > 0 ? normals(E.generator) : null;
  const dryFriction = S.dry_friction.some((f) => f > 0);
  let ended = -1;
  for (let first = 0; first < rows && ended < 0; first += B) {
    const count = Math.min(B, rows - first);
    sample(S, first);
    for (let i = 0; draw && i < 2 * B * N; i++) M[AT["sensing.noise"] + i] = draw(i);
    M.set([first, count, 0, rows - 1, dryFriction ? 1 : 0], AT.counts);
    // The kernels have the places of all other arrays in them.
    ended = K[S.controller](AT.inputs, AT.torque, AT.counts);
    for (const [name, at] of places) out[name].set(M.subarray(at, at + count * N), first * N);
  }
  const lost = ended >= 0 && ended < rows, valid = lost ? ended : rows;
  const end = lost ? outcome(valid, S) : {completed: true, time: (rows - 1) * S.step};
  for (const [name] of places) out[name] = out[name].subarray(0, valid * N);
  return {...out, rows: valid, step: S.step, outcome: end, metrics: metrics(S.step)};
}

function metrics(h) {
  const each = (value) => E.joints.map((_, j) => value((field) => M[place("rows.sums", j, field)]));
  return {
    ise: each((sum) => h * sum("square")), iae: each((sum) => h * sum("absolute")),
    itae: each((sum) => h * sum("aged")), energy: each((sum) => h * sum("effort")),
    rms: each((sum) => Math.sqrt(sum("square") / sum("rows"))),
    rms_tail: each((sum) => Math.sqrt(sum("late") / sum("late_rows"))),
    total_variation: each((sum) => sum("changes")), peak_torque: each((sum) => sum("peak"))};
}

// ------------------------------------------------------------------ answers, thinned out to what a screen shows

const SPANS = E.shown / 2;
// Answers to what was asked for last; a law whose settings stay is not run again.
const known = new Map();

// Each of so many spans of time gives the least and the largest sample in it, in their order; where
// there are fewer samples than spans, the one that was held.
function thin({rows, step}, values, j) {
  const out = new Array(2 * SPANS).fill(null), row = (k) => ((k / SPANS) * E.duration) / step;
  for (let k = 0; k < SPANS; k++) {
    const from = Math.ceil(row(k) - 1e-9), to = Math.min(Math.ceil(row(k + 1) - 1e-9), rows);
    let first = from, second = from;
    if (to <= from) first = second = Math.floor(row(k));
    if (first >= rows) continue;
    for (let r = from + 1; r < to; r++) {
      if (values[r * N + j] < values[first * N + j]) first = r;
      if (values[r * N + j] > values[second * N + j]) second = r;
    }
    if (first > second) [first, second] = [second, first];
    // A stretch that only rises or falls is drawn by two of its samples, or it would have steps.
    if (first === from && second === to - 1) second = (from + to) >> 1;
    [out[2 * k], out[2 * k + 1]] = [values[first * N + j], values[second * N + j]];
  }
  return out;
}

// The motion at 30 frames a second.
function frames(run) {
  const end = Math.max(run.rows - 1, 0), count = Math.max(Math.ceil(end * run.step * 30), 1);
  const rows = Array.from({length: count + 1}, (_, k) => Math.round((k / count) * end));
  const motion = (values) => Float32Array.from(rows.flatMap((r) => [...values.subarray(r * N, (r + 1) * N)]));
  return {t: rows.map((row) => row * run.step), q: motion(run.q), q_ref: motion(run.q_ref)};
}

function answer(S, signal) {
  const start = performance.now(), run = simulate(S), {metrics, outcome, rows} = run;
  const curves = (values) => E.joints.map((_, j) => thin(run, values, j));
  return {metrics, outcome, rows, controller: S.controller, milliseconds: performance.now() - start,
    frames: frames(run),
    plots: {error: curves(run.q_ref.map((x, i) => x - run.q[i])), torque: curves(run.torque),
      signal: signal in run ? curves(run[signal]) : null}};
}

self.onmessage = ({data: {runs, signal}}) => {
  try {
    self.postMessage({runs: runs.map((S) => {
      const key = JSON.stringify([S, signal]), found = known.get(key) ?? answer(S, signal);
      known.delete(key);
      known.set(key, found);
      if (known.size > 12) known.delete(known.keys().next().value);
      return found;
    })});
  } catch (error) {
    self.postMessage({fault: String(error)});
  }
};
