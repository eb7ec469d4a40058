"use strict";
// The worker's end: runs for each message, thinned out to what a screen can show.
const SPANS = E.shown / 2;
//: Answers to what was asked for last; a law whose settings stay is not run again.
const known = new Map();

// Each of so many spans of time gives the least and the largest sample in it, in their order; where
// there are fewer samples than spans, the one that was held.
function thin({rows, step}, value) {
  const out = new Array(2 * SPANS).fill(null);
  for (let k = 0; k < SPANS; k++) {
    const from = Math.ceil((k / SPANS) * E.duration / step - 1e-9);
    const to = Math.min(Math.ceil(((k + 1) / SPANS) * E.duration / step - 1e-9), rows);
    let low = from, high = from;
    if (to <= from) {
      low = high = Math.floor((k / SPANS) * E.duration / step);
      if (low >= rows) continue;
    }
    for (let r = from; r < to; r++) {
      if (value(r) < value(low)) low = r;
      if (value(r) > value(high)) high = r;
    }
    let pair = [Math.min(low, high), Math.max(low, high)];
    // A stretch that only rises or falls is drawn by two of its samples, or it would have steps.
    if (pair[0] === from && pair[1] === to - 1) pair = [from, (from + to) >> 1];
    [out[2 * k], out[2 * k + 1]] = pair.map(value);
  }
  return out;
}

// The motion at 30 frames a second.
function frames(run) {
  const end = Math.max(run.rows - 1, 0), count = Math.max(Math.ceil(end * run.step * 30), 1);
  const rows = Array.from({length: count + 1}, (_, k) => Math.round((k / count) * end));
  const motion = (name) => Float32Array.from(rows.flatMap((row) =>
    Array.from(run[name].subarray(row * N, (row + 1) * N))));
  return {t: rows.map((row) => row * run.step), q: motion("q"), q_ref: motion("q_ref")};
}

function answer(S, signal, whole) {
  const key = JSON.stringify([S, signal, whole]), before = known.get(key);
  known.delete(key);
  const start = performance.now(), run = before ? null : simulate(S);
  const found = before ?? {
    metrics: run.metrics, outcome: run.outcome, rows: run.rows, controller: S.controller,
    milliseconds: performance.now() - start, frames: frames(run), whole: whole ? run : null,
    plots: {
      error: E.joints.map((_, j) => thin(run, (r) => run.q_ref[r * N + j] - run.q[r * N + j])),
      torque: E.joints.map((_, j) => thin(run, (r) => run.torque[r * N + j])),
      signal: signal in run ? E.joints.map((_, j) => thin(run, (r) => run[signal][r * N + j])) : null}};
  known.set(key, found);
  if (known.size > 12) known.delete(known.keys().next().value);
  return found;
}

self.onmessage = ({data: {runs, signal, whole}}) => {
  try {
    self.postMessage({runs: runs.map((S) => answer(S, signal, whole))});
  } catch (error) {
    self.postMessage({fault: String(error)});
  }
};
