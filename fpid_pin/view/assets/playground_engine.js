"use strict";
// Runs an experiment on the printed kernels, in a Web Worker or in node: what the settings say is
// written into a memory that starts as the description's, then blocks of ticks are flown.
// E (the engine's table), M (the memory) and K (the kernels) stand before this script.
const decode = (text) => new Float64Array(
  Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
const START = decode(E.memory), STARTS = E.starts.map((parts) =>
  Object.fromEntries(Object.entries(parts).map(([name, text]) => [name, decode(text)])));
const POINTS = decode(E.points), PAYLOAD = decode(E.payload), AT = E.places;
const STEPS = E.steps.map((one) => ({step: one.step, poles: decode(one.poles),
  weights: decode(one.weights), known: decode(one.known), exact: decode(one.exact)}));
const N = E.shapes.torque[1];
const WIDTH = 3 + E.shapes.modes[E.shapes.modes.length - 1];
const B = E.block;

// The place of a field of record k of an array.
const place = (name, k, field) => {
  const fields = E.fields[name];
  return AT[name] + k * Object.keys(fields).length + fields[field];
};
const write = (name, k, values) => {
  for (const [field, value] of Object.entries(values)) M[place(name, k, field)] = value;
};
const read = (name, k, field) => M[place(name, k, field)];

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

function setOperators(S, one) {
  M.set(one.poles, AT.poles);
  const modes = WIDTH - 3;
  for (let j = 0; j < N; j++) {
    [1 - S.integral_order[j], S.derivative_order[j]].forEach((order, which) => {
      const k = 2 * j + which, w = weightsAt(one, order), moves = S.order_learning_rate > 0;
      write("ops", k, {order, c1: w[0], c0: w[1], c2: w[2]});
      if (S.initialisation === "grunwald_letnikov") {
        write("ops", k, {kick: Math.pow(one.step, -order)});
      }
      for (let m = 0; m < modes; m++) write("modes", k * modes + m, {weight: w[3 + m], x: 0});
    });
  }
  if (S.order_learning_rate > 0) {
    for (let a = 0; a < E.nodes; a++) {
      const w = weightsAt(one, a / (E.nodes - 1));
      for (let i = 0; i < WIDTH; i++) M[AT.table + i * E.nodes + a] = w[i];
    }
  }
}

function setLaw(S) {
  const start = STARTS[S.controller];
  for (const name of ["robots", "joints", "ops"]) M.set(start[name], AT[name]);
  write("robots", 0, {h: S.step, moves: S.order_learning_rate > 0 ? 1 : 0});
  const guard = read("robots", 0, "guarded") || S.sigma > 0 || S.dead_zone > 0;
  const rates = S.learning_rate;
  for (let j = 0; j < N; j++) {
    if (guard && !read("robots", 0, "guarded")) {
      write("joints", j, {kp_min: 0, ki_min: 0, kd_min: 0});
    }
    for (const gain of ["kp", "ki", "kd"]) {
      const low = read("joints", j, `${gain}_min`), high = read("joints", j, `${gain}_max`);
      const value = Math.min(Math.max(S[gain][j], low), high);
      write("joints", j, {[gain]: value, [`${gain}_0`]: value});
      const gamma = `gamma_${gain[1]}`;
      write("joints", j, {[gamma]: rates === 1 ? read("joints", j, gamma)
        : read("joints", j, gamma) * rates});
    }
    write("joints", j, {k0: S.k0[j], k1: S.k1[j], sigma: S.sigma, dead_zone: S.dead_zone,
      lam: 1 - (1 - S.integral_order[j]), mu: S.derivative_order[j],
      i_order_0: 1 - S.integral_order[j], d_order_0: S.derivative_order[j],
      gamma_io: S.order_learning_rate, gamma_do: S.order_learning_rate});
    if (S.knows_limit) write("joints", j, {limit: S.effort_limit[j]});
  }
  if (guard) write("robots", 0, {guarded: 1});
}

// The supervisor's constants, as `control.supervisor` has them, for this M_x and step.
function setSupervisor(S) {
  const start = E.supervision[S.controller], fields = Object.keys(E.fields.robots);
  for (const name of ["p11", "p12", "p22", "k0", "k1", "layer", "lookahead", "target", "trigger",
    "l1", "l2", "own_gravity"]) if (fields.includes(name)) write("robots", 0, {[name]: 0});
  write("robots", 0, {threshold: Infinity});
  M.fill(0, AT.asked, AT.asked + Object.keys(E.fields.asked).length);
  for (let j = 0; j < N; j++) write("joints", j, {bound: 0});
  if (!S.supervised) return;
  const size = S.m_x - start.reference_bound, most = start.half_smallest * (size * size);
  const [p11, p12, p22] = start.p, paper = start.kind === "paper";
  write("robots", 0, {p11, p12, p22, k0: start.k0, k1: start.k1});
  if (paper) {
    write("robots", 0, {threshold: most, layer: start.layer, own_gravity: start.own_gravity ? 1 : 0});
  } else {
    write("robots", 0, {lookahead: Math.max(start.lookahead, S.step), target: start.target * most,
      trigger: start.trigger * most});
  }
  if (start.observer > 0) {
    const pole = Math.exp(-start.observer * S.step);
    write("robots", 0, {l1: 1 - pole * pole, l2: ((1 - pole) * (1 - pole)) / S.step});
    write("robots", 0, {observing: start.observing});
    start.predicted.forEach((a, j) => write("joints", j, {predicted: S.step * a}));
    write("asked", 0, {observes: 1});
  }
  write("asked", 0, paper ? {paper: 1} : {sampled: 1});
  for (let j = 0; j < N; j++) write("joints", j, {bound: start.bound[j]});
}

// Ticks of a law that the model assists: `kernels.flight` part by part. Row -1: none is lost.
function flyAssisted(S, X, rubs, senses, first, count) {
  const {joints, robots} = E.fields, from = KEPT.map((name) => joints[name]);
  const wide = Object.keys(joints).length;
  for (let k = 0; k < count; k++) {
    if (senses) {
      K.measure(AT.alive, AT.sensors, X, first + k, AT.history, AT.noise, (first + k) % B, AT.seen);
    }
    K.assisted(AT.alive, AT.asked, AT.robots, AT.joints, AT.ops, AT.poles, AT.modes, AT.table,
      AT.nominal, AT.pull, AT.there, AT.nominal_mass, AT.factored, AT.assistance, AT.seen, AT.torque);
    const lost = K.drive(AT.alive, AT.plants, AT.torque, X, AT.forces, k, AT.rows, AT.tau);
    M[AT.values + k] = M[AT.robots + robots.value];
    for (let i = 0; i < from.length; i++) {
      for (let j = 0; j < N; j++) {
        M[AT.kept + (i * B + k) * N + j] = M[AT.joints + j * wide + from[i]];
      }
    }
    if (lost) return k;
    K.steps(AT.alive, AT.model, AT.bodies, AT.gravity, AT.frames, AT.mass, rubs, AT.dry, AT.stuck,
      AT.force, AT.room, AT.response, AT.matrix, S.step, X, AT.tau, AT.a);
    if (K.arrive(AT.alive, AT.plants, X, AT.references, (k + 1) % B, AT.seen)) return k + 1;
  }
  return -1;
}

function setPlant(S) {
  const fields = Object.keys(E.fields.bodies).length;
  for (let i = 0; i < N; i++) {
    for (let f = 0; f < fields; f++) {
      M[AT.bodies + i * fields + f] += S.payload * PAYLOAD[i * fields + f];
    }
    M[place("bodies", i, "armature")] += S.step * S.viscous_friction[i];
    write("plants", i, {limit: S.effort_limit[i], viscous: S.viscous_friction[i]});
    M[AT.dry + i] = S.dry_friction[i];
    write("sensors", i, {noise_q: S.position_noise, noise_v: S.velocity_noise,
      resolution: S.position_resolution, delay: S.delay,
      derived: S.differentiated ? 1 : 0, keep: Math.exp(-E.cutoff * S.step)});
    write("sensors", i, {gain: (1 - read("sensors", i, "keep")) / S.step});
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
        const at = AT.references + k * N + j, part = B * N;
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
        M[AT.forces + k * N + j] = force;
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
    const q = M[AT.x_now + j], v = M[AT.x_now + N + j], u = M[AT.torque + j];
    const slow = Math.abs(v) <= E.runaway;
    if (slow && Number.isFinite(q) && Number.isFinite(u)) continue;
    const cause = !Number.isFinite(v) ? "speed is not finite"
      : !slow ? `speed ${brief(Math.abs(v))} rad/s is beyond ${E.runaway} rad/s`
        : !Number.isFinite(u) ? "torque is not finite" : "angle is not finite";
    return {completed: false, time: row * S.step, joint: E.joints[j], cause};
  }
  return {completed: false, time: row * S.step, joint: "", cause: "not finite"};
}

const SIGNALS = ["q", "v", "torque"], KEPT = ["kp", "ki", "kd", "u_fpid", "u_s", "s", "lam", "mu"];
const KEEP = [0, 1, 2, 6, 7];

function simulate(S) {
  const one = STEPS.find((each) => each.step === S.step);
  M.set(START);
  setLaw(S);
  setSupervisor(S);
  setOperators(S, one);
  setPlant(S);
  const senses = S.position_noise > 0 || S.velocity_noise > 0 || S.delay > 0 || S.differentiated
    || S.position_resolution > 0 || E.biased;
  const noisy = S.position_noise > 0 || S.velocity_noise > 0;
  const X = AT.x_now = senses ? AT.x : AT.seen;
  for (let j = 0; j < N; j++) [M[X + j], M[X + N + j]] = [S.q0[j], E.v0[j]];
  const rubs = S.dry_friction.some((f) => f > 0);
  const rows = Math.round(E.duration / S.step) + 1, half = (rows - 1) >> 1;
  const out = {};
  for (const name of ["q", "v", "q_ref", "torque", "kp", "ki", "kd", "lam", "mu"]) {
    out[name] = new Float64Array(rows * N);
  }
  const sample = sampler(S), draw = noisy ? normals(E.generator) : null;
  let valid = rows, end = {completed: true, time: (rows - 1) * S.step};
  for (let first = 0; first < rows; first += B) {
    const count = Math.min(B, rows - first);
    sample(first);
    if (noisy) for (let i = 0; i < 2 * B * N; i++) M[AT.noise + i] = draw(i);
    K.arrive(AT.alive, AT.plants, X, AT.references, 0, AT.seen);
    if (S.supervised) M[AT.ends] = flyAssisted(S, X, rubs, senses, first, count);
    else K.fly(AT.alive, AT.robots, AT.joints, AT.ops, AT.poles, AT.modes, AT.table, AT.model, AT.bodies,
      AT.gravity, AT.frames, AT.mass, rubs, AT.dry, AT.stuck, AT.force, AT.room, AT.response,
      AT.matrix, S.step, AT.plants, X, AT.seen, AT.torque, AT.tau, AT.a, AT.references, AT.forces,
      AT.rows, senses, AT.sensors, AT.history, AT.noise, first, true, AT.kept, AT.values, 0, count, AT.ends);
    const lost = M[AT.ends], good = lost >= 0 ? lost : count;
    const copy = (name, at) => out[name].set(M.subarray(at, at + count * N), first * N);
    SIGNALS.forEach((name, i) => copy(name, AT.rows + i * B * N));
    copy("q_ref", AT.references);
    KEEP.forEach((i) => copy(KEPT[i], AT.kept + i * B * N));
    for (let i = 0; i < count * N; i++) {
      M[AT.error + i] = M[AT.references + i] - M[AT.rows + i];
    }
    M[AT.valid] = Math.min(good, count);
    K.tally(AT.sums, AT.error, AT.rows + 2 * B * N, AT.valid, first, rows - 1, half, S.step);
    if (lost >= 0) {
      if (first + lost < rows) {
        valid = first + lost;
        end = outcome(valid, S);
      }
      break;
    }
  }
  for (const name of Object.keys(out)) out[name] = out[name].subarray(0, valid * N);
  return {...out, rows: valid, planned: rows, step: S.step, outcome: end, metrics: metrics(S.step)};
}

function metrics(h) {
  const table = {ise: [], iae: [], itae: [], rms: [], rms_tail: [], energy: [], total_variation: [],
    peak_torque: []};
  for (let j = 0; j < N; j++) {
    const sum = (field) => read("sums", j, field);
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
