"use strict";
// Plots of the run and, dashed and thin, of the pinned one. Joints keep their colours everywhere.
const LIGHT = ["#0063a3", "#c24b00", "#00795a", "#a8457f", "#8a6200", "#2a8fc9", "#6d4aa5"];
const DARK = ["#5db4f0", "#ff9350", "#35c99d", "#ee9fcb", "#f2c14b", "#9bd8ff", "#c0a5f0"];
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const jointColour = (j) => (dark.matches ? DARK : LIGHT)[j % LIGHT.length];
const TIMES = Array.from({length: ENGINE.shown}, (_, k) => ((k / ENGINE.shown) * ENGINE.duration));
const sync = uPlot.sync("time");

class Plot {
  constructor(holder, heading, unit) {
    this.holder = holder;
    this.unit = unit;
    this.rows = {now: null, pinned: null};
    this.joints = JOINTS.map((_, j) => j);
    this.build();
    new ResizeObserver(() => this.fit()).observe(holder);
  }

  build() {
    if (this.chart) this.chart.destroy();
    const ink = dark.matches ? "#a9b1bc" : "#59636e", grid = dark.matches ? "#2b323b" : "#e4e8ec";
    const axis = {stroke: ink, grid: {stroke: grid, width: 1}, ticks: {stroke: grid, width: 1, size: 4},
      font: "11px system-ui, sans-serif"};
    const line = (j, pinned) => ({
      label: pinned ? `${JOINTS[j]}, pinned` : JOINTS[j], stroke: jointColour(j) + (pinned ? "b0" : ""),
      width: pinned ? 1 : 1.6, dash: pinned ? [4, 3] : undefined, points: {show: false},
      spanGaps: false, scale: "y"});
    const hooks = {draw: [(chart) => this.drawTime(chart)]};
    this.chart = new uPlot({
      ...this.size(), padding: [6, 16, 0, 0], legend: {show: false}, hooks,
      cursor: {sync: {key: sync.key}, drag: {x: false, y: false}, points: {size: 6},
        bind: {mousedown: (chart, target, handler) => (event) => {
          handler(event);
          if (chart.cursor.left >= 0) stage.seek(chart.posToVal(chart.cursor.left, "x"));
        }}},
      scales: {x: {time: false, range: [0, ENGINE.duration]}, y: {range: (chart, low, high) =>
        this.range(low, high)}},
      axes: [{...axis, size: 26, values: (_, ticks) => ticks.map((t) => `${t} s`)},
        {...axis, size: 54, values: (_, ticks) => ticks.map((x) => label(x))}],
      series: [{}, ...JOINTS.map((_, j) => line(j, true)), ...JOINTS.map((_, j) => line(j, false))],
    }, this.data(), this.holder);
    this.chart.root.setAttribute("aria-hidden", "true");
  }

  size() {
    return {width: Math.max(this.holder.clientWidth, 50), height: Math.max(this.holder.clientHeight, 60)};
  }

  fit() {
    const {width, height} = this.size();
    if (width !== this.chart.width || height !== this.chart.height) this.chart.setSize({width, height});
  }

  data() {
    const empty = TIMES.map(() => null);
    const pick = (rows) => JOINTS.map((_, j) =>
      (rows && this.joints.includes(j) ? rows[j] : empty));
    return [TIMES, ...pick(this.rows.pinned), ...pick(this.rows.now)];
  }

  // A run that diverges would press everything else flat: what it does at last is cut off.
  range(low, high) {
    if (low === null || !Number.isFinite(low)) return [-1, 1];
    if (this.lost) {
      const sizes = JOINTS.flatMap((_, j) => (this.rows.now?.[j] ?? []).filter((x) => x !== null)
        .map(Math.abs)).sort((a, b) => a - b);
      const most = 1.6 * (sizes[Math.floor(0.9 * sizes.length)] ?? 1) || 1;
      [low, high] = [Math.max(low, -most), Math.min(high, most)];
    }
    const room = 0.06 * (high - low) || Math.abs(high) * 0.1 || 1;
    return [low - room, high + room];
  }

  show(now, pinned, joints, lost) {
    Object.assign(this, {rows: {now, pinned}, joints, lost});
    this.chart.setData(this.data());
  }

  drawTime(chart) {
    if (this.time === undefined) return;
    const x = Math.round(chart.valToPos(this.time, "x", true)), {ctx, bbox} = chart;
    ctx.save();
    ctx.strokeStyle = dark.matches ? "#ffffff80" : "#00000060";
    ctx.lineWidth = devicePixelRatio;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.restore();
  }
}

// A number in as few signs as say it.
function label(x) {
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size >= 1e5 || size < 1e-3) return x.toExponential(Math.abs(x / 10 ** Math.floor(Math.log10(size))) % 1 > 1e-6 ? 1 : 0);
  return String(Number(x.toPrecision(4)));
}
