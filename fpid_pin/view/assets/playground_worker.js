"use strict";
// The worker's end: a run for each message, thinned out to what a screen can show.
const POINTS_SHOWN = E.shown;

// Each of so many spans of time gives the least and the largest sample in it, in their order; where
// there are fewer samples than spans, the one that was held.
function thin(values, rows, step, j) {
  const spans = POINTS_SHOWN / 2, out = new Array(POINTS_SHOWN).fill(null);
  for (let k = 0; k < spans; k++) {
    const from = Math.ceil((k / spans) * E.duration / step - 1e-9);
    const to = Math.min(Math.ceil(((k + 1) / spans) * E.duration / step - 1e-9), rows);
    if (to <= from) {
      const held = Math.floor((k / spans) * E.duration / step);
      if (held < rows) out[2 * k] = out[2 * k + 1] = values(held, j);
      continue;
    }
    let low = from, high = from, least = Infinity, most = -Infinity;
    for (let r = from; r < to; r++) {
      const value = values(r, j);
      if (value < least) [least, low] = [value, r];
      if (value > most) [most, high] = [value, r];
    }
    // A stretch that only rises or falls is drawn by two of its samples, or it would have steps.
    const ends = Math.min(low, high) === from && Math.max(low, high) === to - 1;
    if (ends) [out[2 * k], out[2 * k + 1]] = [values(from, j), values((from + to) >> 1, j)];
    else [out[2 * k], out[2 * k + 1]] = low <= high ? [least, most] : [most, least];
  }
  return out;
}

function shown(run, moves) {
  const at = (name) => (r, j) => run[name][r * N + j];
  const error = (r, j) => run.q_ref[r * N + j] - run.q[r * N + j];
  const each = (values) => Array.from({length: N}, (_, j) => thin(values, run.rows, run.step, j));
  const plots = {error: each(error), torque: each(at("torque"))};
  for (const name of ["kp", "ki", "kd"]) plots[name] = each(at(name));
  // Orders that stay are one number from end to end.
  const still = Array.from({length: N}, (_, j) => (k) =>
    new Array(POINTS_SHOWN).fill(run.rows ? run[k][j] : null));
  for (const name of ["integral_order", "derivative_order"]) {
    plots[name] = moves ? each(at(name)) : still.map((row) => row(name));
  }
  return plots;
}

// The motion at 30 frames a second.
function frames(run) {
  const end = Math.max(run.rows - 1, 0), count = Math.max(Math.ceil(end * run.step * 30), 1);
  const out = {t: new Float32Array(count + 1)};
  for (const name of ["q", "q_ref", "torque"]) out[name] = new Float32Array((count + 1) * N);
  for (let k = 0; k <= count; k++) {
    const row = (k / count) * end, low = Math.min(Math.floor(row), Math.max(end - 1, 0));
    const part = row - low;
    out.t[k] = row * run.step;
    for (let j = 0; j < N; j++) {
      for (const name of ["q", "q_ref"]) {
        const a = run[name][low * N + j], b = run[name][Math.min(low + 1, end) * N + j];
        out[name][k * N + j] = a + part * (b - a);
      }
      out.torque[k * N + j] = run.torque[low * N + j];
    }
  }
  return out;
}

self.onmessage = ({data: {id, settings, whole}}) => {
  try {
    const start = performance.now(), run = simulate(settings), done = performance.now();
    const {metrics, outcome, rows, step} = run;
    const answer = {id, metrics, outcome, rows, step, milliseconds: done - start,
      plots: shown(run, settings.order_learning_rate > 0), frames: frames(run)};
    if (whole) {
      answer.whole = Object.fromEntries(["q", "v", "q_ref", "torque", "kp", "ki", "kd"]
        .map((name) => [name, Array.from(run[name])]));
    }
    answer.thinning = performance.now() - done;
    self.postMessage(answer);
  } catch (error) {
    self.postMessage({id, fault: String(error)});
  }
};
