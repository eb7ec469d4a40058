"use strict";
// What a playground shows of its runs: curves, and the arm with a clock.
// One law: a colour for each joint; several: a colour for each law. The pinned run is dashed and thin.
const colour = (k) => PAGE.palette[dark.matches ? "dark" : "light"][k % PAGE.palette.dark.length];
const TIMES = Array.from({length: ENGINE.shown}, (_, k) => ((k / ENGINE.shown) * ENGINE.duration));

// A number in as few signs as say it.
function label(x) {
  const size = Math.abs(x), far = x !== 0 && (size >= 1e5 || size < 1e-3);
  return String(far ? Number(x.toPrecision(2)).toExponential() : tidy(x, 4));
}

class Plot {
  constructor(holder) {
    this.holder = holder;
    this.curves = [];
    this.build();
    new ResizeObserver(() => this.chart.setSize(this.size())).observe(holder);
  }

  build() {
    this.chart?.destroy();
    const ink = dark.matches ? "#a9b1bc" : "#59636e", grid = dark.matches ? "#2b323b" : "#e4e8ec";
    const axis = (size, text) => ({size, values: (_, ticks) => ticks.map(text), stroke: ink,
      grid: {stroke: grid, width: 1}, ticks: {stroke: grid, width: 1, size: 4}, font: "11px system-ui, sans-serif"});
    const seek = (chart, target, handler) => (event) => {
      handler(event);
      if (chart.cursor.left >= 0) stage.seek(chart.posToVal(chart.cursor.left, "x"));
    };
    this.chart = new uPlot({
      ...this.size(), padding: [6, 16, 0, 0], legend: {show: false},
      hooks: {draw: [(chart) => this.drawTime(chart)]},
      cursor: {sync: {key: "time"}, drag: {x: false, y: false}, points: {size: 6}, bind: {mousedown: seek}},
      scales: {x: {time: false, range: [0, ENGINE.duration]},
        y: {range: (chart, low, high) => this.range(low, high)}},
      axes: [axis(26, (t) => `${t} s`), axis(54, label)],
      series: [{}, ...this.curves.map(({kind, dashed}) => ({stroke: colour(kind) + (dashed ? "b0" : ""),
        width: dashed ? 1 : 1.6, dash: dashed ? [4, 3] : undefined, points: {show: false}}))],
    }, this.data(), this.holder);
    this.chart.root.setAttribute("aria-hidden", "true");
  }

  data() {
    return [TIMES, ...this.curves.map(({values}) => values)];
  }

  size() {
    return {width: Math.max(this.holder.clientWidth, 50), height: Math.max(this.holder.clientHeight, 60)};
  }

  // A run that diverges would press everything else flat: what it does at last is cut off.
  range(low, high) {
    if (low === null || !Number.isFinite(low)) return [-1, 1];
    if (this.curves.some(({lost}) => lost)) {
      const sizes = this.curves.flatMap(({values}) => values).filter((x) => x !== null)
        .map(Math.abs).sort((a, b) => a - b);
      const most = 1.6 * (sizes[Math.floor(0.9 * sizes.length)] ?? 1) || 1;
      [low, high] = [Math.max(low, -most), Math.min(high, most)];
    }
    // The marks of a gain that hardly moves have to differ in four digits.
    const room = Math.max(0.06 * (high - low), 0.01 * Math.abs(high), 0.01 * Math.abs(low)) || 1;
    return [low - room, high + room];
  }

  // Curves: values, a kind by which they are coloured, whether dashed, whether the run was lost.
  show(curves) {
    const styles = (all) => all.map(({kind, dashed}) => [kind, dashed]);
    const alike = same(styles(curves), styles(this.curves));
    this.curves = curves;
    if (alike) this.chart.setData(this.data()); else this.build();
  }

  drawTime(chart) {
    const x = Math.round(chart.valToPos(stage.time, "x", true)), {ctx, bbox} = chart;
    ctx.fillStyle = dark.matches ? "#ffffff80" : "#00000060";
    ctx.fillRect(x, bbox.top, devicePixelRatio, bbox.height);
  }
}

// The arm, where it should be (translucent), and the tool's paths: now, wanted, pinned; and a clock.
class ArmView {
  constructor(holder) {
    [this.playing, this.time] = [false, 0];
    try {
      this.stage = new Stage(holder);
    } catch {
      holder.textContent = "The arm needs WebGL, which this browser does not give this page.";
      holder.classList.add("without");
      return;
    }
    this.arms = new ArmPair(this.stage, SCENE.runs[0]);
    this.pinned = this.arms.tube(0.003, [0.5, 0.5, 0.5], 0.9);
    this.stage.frame();
  }

  show(frames, pinned) {
    this.frames = frames;
    if (!this.stage) return;
    const {arm, trail, wanted} = this.arms;
    for (const [tube, q] of [[trail, frames.q], [wanted, frames.q_ref], [this.pinned, pinned?.q ?? []]]) {
      tube.set(arm.path(q).points);
    }
    this.pose();
  }

  pose() {
    if (!this.frames || !this.stage) return;
    const {t, q, q_ref} = this.frames, last = t.length - 1, n = JOINTS.length;
    const k = Math.min(Math.round((this.time / (t[last] || 1)) * last), last);
    this.arms.pose(...[q, q_ref].map((rows) => rows.subarray(k * n, (k + 1) * n)));
    this.stage.viewer.set_dirty();
  }

  seek(t) {
    this.time = Math.min(Math.max(t, 0), ENGINE.duration);
    this.pose();
    this.moved();
  }

  play(on) {
    this.playing = on;
    let before = null;
    const tick = (now) => {
      if (!this.playing) return;
      const t = this.time + (now - (before ?? now)) / 1000;
      before = now;
      this.seek(t > ENGINE.duration ? 0 : t);
      requestAnimationFrame(tick);
    };
    if (on) requestAnimationFrame(tick);
    this.moved();
  }
}
