"use strict";
// Runs an experiment on the printed kernels, in a Web Worker or in node: what the settings say is
// written into a memory that starts as the description's, then blocks of ticks are made.
// E (the engine's table), M (the memory) and K (the kernels) stand before this script.
const decode = (text) => new Float64Array(
  Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
const AT = E.places;
const START = Object.entries(E.memory).map(([name, text]) => [AT[name], decode(text)]);
const POINTS = decode(E.points), PAYLOAD = decode(E.payload);
const STEPS = E.steps.map((one) => ({step: one.step, poles: decode(one.poles),
  weights: decode(one.weights), known: decode(one.known), exact: decode(one.exact)}));
const N = E.shapes.torque[0], MODES = E.shapes["c.modes"][2], WIDTH = 3 + MODES, B = E.block;

// The place of a field of record k of an array.
const place = (name, k, field) => {
  const fields = E.fields[name];
  return AT[name] + k * Object.keys(fields).length + fields[field];
};
const write = (name, k, values) => {
  for (const [field, value] of Object.entries(values)) M[place(name, k, field)] = Number(value);
};
const read = (name, k, field) => M[place(name, k, field)];
const clip = (x, low, high) => Math.min(Math.max(x, low), high);

// c1, c0, c2 and the modes' weights at an order: those of the description to the last bit, others
// by the polynomial through Chebyshev's points (barycentric form, second kind).
function weightsAt(one, order) {
  const k = one.known.indexOf(order);
  if (k >= 0) return one.exact.subarray(k * WIDTH, (k + 1) * WIDTH);
  const out = new Float64Array(WIDTH), last = POINTS.length - 1;
  let total = 0;
  for (let i = 0; i <= last; i++) {
    if (order === POINTS[i]) return one.weights.subarray(i * WIDTH, (i + 1) * WIDTH);
    const share = (i % 2 ? -1 : 1) * (i === 0 || i === last ? 0.5 : 1) / (order - POINTS[i]);
    total += share;
    for (let m = 0; m < WIDTH; m++) out[m] += share * one.weights[i * WIDTH + m];
  }
  for (let m = 0; m < WIDTH; m++) out[m] /= total;
  return out;
}

function setOperators(S, one, law) {
  M.set(one.poles, AT["c.poles"]);
  const moves = S.order_learning_rate > 0;
  for (let j = 0; j < N; j++) {
    [1 - read("c.joints", j, "integral_order"), read("c.joints", j, "derivative_order")]
      .forEach((order, which) => {
        const k = 2 * j + which, w = weightsAt(one, order);
        write("c.ops", k, {order, c1: w[0], c0: w[1], c2: w[2], variable: moves,
          order_column: moves ? E.orderColumns[which] : -1,
          initial_output: law.kick ? one.step ** -order : 0});
        for (let m = 0; m < MODES; m++) write("c.modes", k * MODES + m, {weight: w[3 + m], x: 0});
      });
  }
  for (let a = 0; moves && a < E.nodes; a++) {
    const w = weightsAt(one, a / (E.nodes - 1));
    for (let i = 0; i < WIDTH; i++) M[AT["c.table"] + i * E.nodes + a] = w[i];
  }
}

function setLaw(S, law) {
  for (const [name, text] of Object.entries(law.start)) M.set(decode(text), AT[name]);
  const guards = !law.guarded && (S.sigma > 0 || S.dead_zone > 0), moves = S.order_learning_rate > 0;
  for (let j = 0; j < N; j++) {
    const old = (field) => read("c.joints", j, field), set = (values) => write("c.joints", j, values);
    if (guards) set({kp_min: 0, ki_min: 0, kd_min: 0});
    for (const gain of ["kp", "ki", "kd"]) {
      const value = clip(S[gain][j], old(`${gain}_min`), old(`${gain}_max`));
      const gamma = `gamma_${gain[1]}`;
      set({[gain]: value, [`${gain}_0`]: value, [gamma]: old(gamma) * S.learning_rate});
    }
    // Orders that move start within their bounds, and mu above 0: e - e(0) is its limit.
    for (const name of ["integral_order", "derivative_order"]) {
      if (!moves) set({[`${name}_min`]: 0, [`${name}_max`]: 1});
      const least = moves && name[0] === "d" ? 2 ** -1022 : 0;
      const order = clip(Math.max(S[name][j], least), old(`${name}_min`), old(`${name}_max`));
      set({[name]: order, [`${name}_0`]: order, [`${name}_rate`]: S.order_learning_rate});
    }
    set({h: S.step, k0: S.k0[j], k1: S.k1[j], sigma: S.sigma, dead_zone: S.dead_zone});
    if (S.knows_limit) set({limit: S.effort_limit[j]});
  }
}

// Observer and supervisor, as `control.state` and `control.supervisor` set them, for this step.
function setAssistance(S, law) {
  const s = law.supervisor, robot = (values) => write("c.robot", 0, values);
  const bandwidth = Math.min(law.observer || (S.supervised ? s.observer : 0), 1 / S.step);
  const pole = Math.exp(-bandwidth * S.step);
  robot({h: S.step, observes: bandwidth > 0, l1: 1 - pole * pole, l2: (1 - pole) * (1 - pole) / S.step,
    supervised: S.supervised});
  if (!S.supervised) return;
  const size = S.m_x - s.reference_bound, most = s.half_smallest * (size * size);
  const {p11, p12, p22, k0, k1, layer, own_gravity} = s;
  robot({p11, p12, p22, k0, k1, [s.kind]: true});
  if (s.kind === "paper") robot({threshold: most, layer, own_gravity});
  else {
    robot({lookahead: Math.max(s.lookahead, S.step), target: s.target * most,
      trigger: s.trigger * most});
  }
  s.bound.forEach((bound, j) => write("c.joints", j, {bound}));
}

function setPlant(S) {
  const fields = Object.keys(E.fields["plant.bodies"]).length;
  const keep = Math.exp(-E.cutoff * S.step);
  for (let i = 0; i < N; i++) {
    for (let f = 0; f < fields; f++) {
      M[AT["plant.bodies"] + i * fields + f] += S.payload * PAYLOAD[i * fields + f];
    }
    M[place("plant.bodies", i, "armature")] += S.step * S.viscous_friction[i];
    write("plant.joints", i, {limit: S.effort_limit[i], viscous: S.viscous_friction[i],
      dry: S.dry_friction[i]});
    write("sensing.joints", i, {noise_q: S.position_noise, noise_v: S.velocity_noise,
      resolution: S.position_resolution, delay: S.delay, derived: S.differentiated, keep,
      gain: (1 - keep) / S.step});
    [M[AT["plant.q"] + i], M[AT["plant.v"] + i]] = [S.q0[i], E.v0[i]];
  }
}

// Signals from outside are formulas, or rows that Python sampled.
const own = (value, j) => (Array.isArray(value) ? value[j % value.length] : value);
function sampler(S) {
  const {reference, disturbance} = E, d = S.disturbance_frequency;
  const table = reference.rows ? decode(reference.rows) : null;
  const count = table ? table.length / (3 * N) : 0;
  return (first) => {
    for (let k = 0; k < B; k++) {
      const t = (first + k) * S.step;
      for (let j = 0; j < N; j++) {
        const at = AT["rows.reference"] + k * N + j, part = B * N;
        if (table) {
          const row = Math.min(first + k, count - 1);
          for (let i = 0; i < 3; i++) M[at + i * part] = table[(i * count + row) * N + j];
        } else {
          const w = own(reference.frequency, j) * S.reference_speed;
          const a = own(reference.amplitude, j) * S.reference_size;
          const angle = t * w + own(reference.phase, j);
          M[at] = own(reference.offset, j) + a * Math.sin(angle);
          M[at + part] = a * w * Math.cos(angle);
          M[at + 2 * part] = -a * (w * w) * Math.sin(angle);
        }
        let force = S.disturbance[j] * Math.cos(t * d + own(disturbance.phase, j));
        for (const other of disturbance.others) {
          force += other.kind === "pulse"
            ? (t >= other.start - 1e-9 && t < other.end - 1e-9 ? own(other.torque, j) : 0)
            : own(other.amplitude, j) * Math.cos(t * own(other.frequency, j) + own(other.phase, j));
        }
        M[AT["rows.forces"] + k * N + j] = force;
      }
    }
  };
}

// A number as Python's %.3g writes it.
function brief(x) {
  const [digits, power] = x.toExponential(2).split("e");
  if (power >= -4 && power < 3) return String(Number(x.toPrecision(3)));
  return `${Number(digits)}e${power[0]}${power.slice(1).padStart(2, "0")}`;
}

// Why a run has ended, in the words of `simulation.simulator`.
function outcome(row, S) {
  for (let j = 0; j < N; j++) {
    const q = M[AT["plant.q"] + j], v = M[AT["plant.v"] + j], u = M[AT.torque + j];
    const slow = Math.abs(v) <= E.runaway;
    if (slow && Number.isFinite(q) && Number.isFinite(u)) continue;
    const cause = !Number.isFinite(v) ? "speed is not finite"
      : !slow ? `speed ${brief(Math.abs(v))} rad/s is beyond ${E.runaway} rad/s`
        : !Number.isFinite(u) ? "torque is not finite" : "angle is not finite";
    return {completed: false, time: row * S.step, joint: E.joints[j], cause};
  }
  return {completed: false, time: row * S.step, joint: "", cause: "not finite"};
}

const MOTION = ["q", "v", "torque"];

function simulate(S) {
  const law = E.laws[S.controller];
  M.fill(0);
  for (const [at, values] of START) M.set(values, at);
  setLaw(S, law);
  setAssistance(S, law);
  setOperators(S, STEPS.find((each) => each.step === S.step), law);
  setPlant(S);
  const rows = Math.round(E.duration / S.step) + 1, out = {};
  for (const name of [...MOTION, "q_ref", ...E.kept]) out[name] = new Float64Array(rows * N);
  const noisy = S.position_noise > 0 || S.velocity_noise > 0;
  const sample = sampler(S), draw = noisy ? normals(E.generator) : null;
  const rubs = S.dry_friction.some((f) => f > 0);
  let ended = -1;
  for (let first = 0; first < rows && ended < 0; first += B) {
    const count = Math.min(B, rows - first);
    sample(first);
    if (noisy) for (let i = 0; i < 2 * B * N; i++) M[AT["sensing.noise"] + i] = draw(i);
    M.set([first, count, 0, rows - 1, rubs ? 1 : 0], AT.counts);
    // The kernels have the places of all other arrays in them.
    ended = K.rollout(AT.inputs, AT.torque, AT.counts);
    const copy = (name, at) => out[name].set(M.subarray(at, at + count * N), first * N);
    MOTION.forEach((name, i) => copy(name, AT["rows.motion"] + i * B * N));
    copy("q_ref", AT["rows.reference"]);
    E.kept.forEach((name, i) => copy(name, AT["rows.kept"] + i * B * N));
  }
  const lost = ended >= 0 && ended < rows, valid = lost ? ended : rows;
  const end = lost ? outcome(valid, S) : {completed: true, time: (rows - 1) * S.step};
  for (const name of Object.keys(out)) out[name] = out[name].subarray(0, valid * N);
  return {...out, rows: valid, planned: rows, step: S.step, outcome: end, metrics: metrics(S.step)};
}

function metrics(h) {
  const table = {ise: [], iae: [], itae: [], rms: [], rms_tail: [], energy: [], total_variation: [],
    peak_torque: []};
  for (let j = 0; j < N; j++) {
    const sum = (field) => read("rows.sums", j, field);
    table.ise.push(h * sum("square"));
    table.iae.push(h * sum("absolute"));
    table.itae.push(h * sum("aged"));
    table.rms.push(Math.sqrt(sum("square") / sum("rows")));
    table.rms_tail.push(Math.sqrt(sum("late") / sum("late_rows")));
    table.energy.push(h * sum("effort"));
    table.total_variation.push(sum("changes"));
    table.peak_torque.push(sum("peak"));
  }
  return table;
}
