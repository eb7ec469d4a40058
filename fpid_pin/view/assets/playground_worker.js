"use strict";
// The worker's end: runs for each message, thinned out to what a screen can show.
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
