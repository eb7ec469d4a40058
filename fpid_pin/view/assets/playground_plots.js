"use strict";
// Plots of runs. One law: a colour for each joint; several: a colour for each law. The pinned run
// is dashed and thin.
const LIGHT = ["#0063a3", "#c24b00", "#00795a", "#a8457f", "#8a6200", "#2a8fc9", "#6d4aa5"];
const DARK = ["#5db4f0", "#ff9350", "#35c99d", "#ee9fcb", "#f2c14b", "#9bd8ff", "#c0a5f0"];
const colour = (k) => (dark.matches ? DARK : LIGHT)[k % LIGHT.length];
const TIMES = Array.from({length: ENGINE.shown}, (_, k) => ((k / ENGINE.shown) * ENGINE.duration));

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
    const axis = {stroke: ink, grid: {stroke: grid, width: 1}, ticks: {stroke: grid, width: 1, size: 4},
      font: "11px system-ui, sans-serif"};
    const line = ({kind, dashed}) => ({stroke: colour(kind) + (dashed ? "b0" : ""),
      width: dashed ? 1 : 1.6, dash: dashed ? [4, 3] : undefined, points: {show: false}});
    this.chart = new uPlot({
      ...this.size(), padding: [6, 16, 0, 0], legend: {show: false},
      hooks: {draw: [(chart) => this.drawTime(chart)]},
      cursor: {sync: {key: "time"}, drag: {x: false, y: false}, points: {size: 6},
        bind: {mousedown: (chart, target, handler) => (event) => {
          handler(event);
          if (chart.cursor.left >= 0) stage.seek(chart.posToVal(chart.cursor.left, "x"));
        }}},
      scales: {x: {time: false, range: [0, ENGINE.duration]},
        y: {range: (chart, low, high) => this.range(low, high)}},
      axes: [{...axis, size: 26, values: (_, ticks) => ticks.map((t) => `${t} s`)},
        {...axis, size: 54, values: (_, ticks) => ticks.map((x) => label(x))}],
      series: [{}, ...this.curves.map(line)],
    }, [TIMES, ...this.curves.map(({values}) => values)], this.holder);
    this.chart.root.setAttribute("aria-hidden", "true");
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
    const room = 0.06 * (high - low) || Math.abs(high) * 0.1 || 1;
    return [low - room, high + room];
  }

  // Curves: values, a kind by which they are coloured, whether dashed, whether the run was lost.
  show(curves) {
    const styles = (all) => all.map(({kind, dashed}) => [kind, dashed]);
    const alike = same(styles(curves), styles(this.curves));
    this.curves = curves;
    if (alike) this.chart.setData([TIMES, ...curves.map(({values}) => values)]);
    else this.build();
  }

  drawTime(chart) {
    if (this.time === undefined) return;
    const x = Math.round(chart.valToPos(this.time, "x", true)), {ctx, bbox} = chart;
    ctx.fillStyle = dark.matches ? "#ffffff80" : "#00000060";
    ctx.fillRect(x, bbox.top, devicePixelRatio, bbox.height);
  }
}

// A number in as few signs as say it.
function label(x) {
  const size = Math.abs(x);
  if (x !== 0 && (size >= 1e5 || size < 1e-3)) return String(Number(x.toPrecision(2)).toExponential());
  return String(Number(x.toPrecision(4)));
}
