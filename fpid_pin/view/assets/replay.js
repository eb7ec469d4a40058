"use strict";
// The scene, its clock and its panel. meshcat keeps the time; what is seen follows from it.
function fail(text) {
  element("message").textContent = text;
  element("message").hidden = false;
}

let stage = null;
try {
  stage = new Stage(element("stage"));
} catch (error) {
  fail("This page needs WebGL, which this browser does not give it.");
  throw error;
}
const {viewer} = stage, {reach} = SCENE;

function caption(text, parent, height) {
  const canvas = document.createElement("canvas"), context = canvas.getContext("2d");
  const font = "600 56px system-ui, sans-serif";
  context.font = font;
  canvas.width = Math.ceil(context.measureText(text).width) + 40;
  canvas.height = 80;
  context.font = font;
  context.fillStyle = dark.matches ? "#e8eaed" : "#1b1f24";
  context.textBaseline = "middle";
  context.fillText(text, 20, 42);
  const map = new THREE.CanvasTexture(canvas);
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({map, depthTest: false}));
  const size = 0.13 * reach;
  sprite.scale.set((size * canvas.width) / canvas.height, size, 1);
  sprite.position.set(0, 0, height);
  parent.add(sprite);
  return sprite;
}

// One run: the arm, its ghost, the tool's paths, the torque arcs, and its part of the panel.
class RunView {
  constructor(table, number) {
    this.table = table;
    this.joints = SCENE.arms[table.arm].joints;
    const node = (name) => {
      const group = stage.node(`${number + 1} ${table.caption}`, name);
      group.position.set(...table.offset);
      return group;
    };
    this.arm = new ArmBody(table.arm, node("actual"), false);
    this.ghost = new ArmBody(table.arm, node("desired"), true);
    // The arcs move with an arm of their own, of which nothing else is seen.
    this.arcBody = new ArmBody(table.arm, node("torque"), true);
    this.arcBody.root.traverse((thing) => { if (thing.isMesh) thing.visible = false; });
    this.arcs = this.arcBody.turns.map(([, axis, slides], j) =>
      new TorqueArc(this.arcBody.frames[j], axis, 0.08 * reach, slides));
    this.wanted = new Tube(node("path"), 0.003 * reach, new THREE.Color(...GHOST), 0.7);
    this.trail = new Tube(node("path"), 0.005 * reach, new THREE.Color(table.colour), 1);
    this.label = SCENE.runs.length > 1
      ? caption(table.caption, node("caption"), table.top + 0.16 * reach) : null;
    this.peak = this.joints.map(() => 1e-9);
    this.points = [[], []];
    if (!SCENE.live) {
      this.rows = Object.fromEntries(["t", "q", "q_ref", "torque"].map((k) => [k, BUFFERS[table[k]]]));
      const {points, rows} = this.arm.path(this.rows.q);
      this.trail.set(points);
      this.marks = rows.map((k) => this.rows.t[k]);
      this.wanted.set(this.arm.path(this.rows.q_ref).points);
      this.rows.torque.forEach((u, i) => this.seen(i % this.joints.length, u));
    }
    this.panel();
  }

  seen(j, torque) {
    this.peak[j] = Math.max(this.peak[j], Math.abs(torque));
  }

  row(name, k) {
    const n = this.joints.length;
    return this.rows[name].subarray(n * k, n * (k + 1));
  }

  panel() {
    const swatch = make("i", {class: "swatch"}), table = make("table");
    swatch.style.background = this.table.colour;
    element("runs").append(make("h2", {}, swatch, this.table.caption));
    if (this.table.outcome) element("runs").append(make("div", {class: "bad"}, this.table.outcome));
    this.bars = this.joints.map(({name}) => {
      const bar = make("i"), value = make("td", {class: "value"});
      table.append(make("tr", {}, make("td", {}, name),
        make("td", {class: "bar"}, make("div", {class: "track"}, bar)), value));
      return [bar, value];
    });
    element("runs").append(table);
  }

  at(t) {
    const times = this.rows.t, last = times.length - 1;
    // All frames but the last are as far apart as the first two.
    const low = Math.max(Math.min(Math.floor(t / (times[1] || 1)), last - 1), 0);
    const high = Math.min(low + 1, last), span = times[high] - times[low];
    const part = span > 0 ? Math.min(Math.max((t - times[low]) / span, 0), 1) : 0;
    const between = (name) => {
      const a = this.row(name, low), b = this.row(name, high);
      return Array.from(a, (x, j) => x + part * (b[j] - x));
    };
    this.show(between("q"), between("q_ref"), this.row("torque", part < 1 ? low : high));
    let passed = 0;
    while (passed < this.marks.length && this.marks[passed] <= t) passed++;
    this.trail.upTo(Math.max(passed - 1, 0));
  }

  show(q, q_ref, torque) {
    this.arm.pose(q);
    this.ghost.pose(q_ref);
    this.arcBody.pose(q);
    this.joints.forEach(({limit, slides}, j) => {
      const part = torque[j] / (limit === null ? this.peak[j] : limit);
      this.arcs[j].show(part);
      const [bar, value] = this.bars[j], half = 50 * Math.min(Math.abs(part), 1);
      bar.style.left = `${part < 0 ? 50 - half : 50}%`;
      bar.style.width = `${half}%`;
      bar.style.background = `#${loadColour(Math.abs(part)).getHexString()}`;
      const full = limit === null ? "" : ` / ${limit}`;
      const shown = Math.abs(torque[j]) < 0.05 ? 0 : torque[j];
      value.textContent = `${shown.toFixed(1)}${full} ${slides ? "N" : "N m"}`;
    });
  }

  // Live: the paths are what has been seen, the last part of it.
  grow(q, q_ref) {
    [q, q_ref].forEach((angles, i) => {
      const points = this.points[i], at = this.arm.tool(angles);
      if (points.length && at.distanceTo(points[points.length - 1]) < 3e-3 * reach) return;
      points.push(at);
      if (points.length > 500) points.shift();
      this.grown = true;
    });
  }

  drawPaths() {
    if (!this.grown) return;
    this.trail.set(this.points[0]);
    this.wanted.set(this.points[1]);
    this.grown = false;
  }
}

const views = SCENE.runs.map((table, i) => new RunView(table, i));
const limits = views.flatMap(({joints}) => joints.map(({limit}) => limit !== null));
const full = [...new Set(limits)].map((known) => (known ? "at the limit" : "at the largest seen"));
element("legend").textContent = "Green, translucent: where the arm should be, and its tool's path. "
  + `Arcs and bars: joint torque, full ${full.join(" or, where there is none, ")}.`;
if (window.innerWidth < 600 || window.innerHeight < 420) {
  element("panel").open = false;
  viewer.gui.width = 130;
}

// The panel and the clock lie over the pane; a caption may be wider than the arm below it.
stage.taken = () => {
  const {towards: [x, y], centre, extent} = SCENE.camera, level = Math.hypot(x, y) || 1;
  const panel = element("panel"), open = panel.open && window.innerWidth > 700;
  const wide = Math.max(extent[0], ...views.filter(({label}) => label).map(({label, table}) =>
    Math.abs((y * (table.offset[0] - centre[0]) - x * (table.offset[1] - centre[1])) / level)
    + 0.5 * label.scale.x));
  return {left: open ? panel.offsetLeft + panel.offsetWidth : 0, below: 52, wide,
    high: extent[1] + (views.length > 1 ? 0.12 * reach : 0)};
};
stage.frame();
element("panel").addEventListener("toggle", () => stage.frame());

const clock = {seek: element("seek"), play: element("play"), time: element("time")};
const draw = viewer.render.bind(viewer);

if (!SCENE.live) {
  // One number that runs from 0 to the duration gives meshcat a clip to play, seek and loop;
  // poses are computed from its time whenever it draws. Its keys are in frames: one a second.
  const duration = SCENE.duration, animator = viewer.animator;
  stage.node().clock = 0;
  viewer.set_animation([{path: ["fpid_pin"], clip: {name: "run", fps: 1, tracks: [
    {name: ".clock", type: "number", times: [0, Math.max(duration, 1e-3)], values: [0, duration]},
  ]}}], {play: false, repetitions: Infinity});
  let shown = null;
  viewer.render = () => {
    const t = Math.min(animator.time, duration);
    views.forEach((view) => view.at(t));
    if (document.activeElement !== clock.seek || animator.playing) clock.seek.value = t;
    clock.time.textContent = `t = ${t.toFixed(2)} s of ${duration.toFixed(1)} s`;
    if (shown !== animator.playing) clock.play.textContent = animator.playing ? "Pause" : "Play";
    shown = animator.playing;
    draw();
  };
  const seek = (t) => {
    animator.pause();
    animator.display_progress(t);
    animator.seek(t);
  };
  clock.seek.max = duration;
  clock.seek.addEventListener("input", () => seek(Number(clock.seek.value)));
  const toggle = () => {
    if (animator.playing) animator.pause(); else animator.play();
    viewer.set_dirty();
  };
  clock.play.addEventListener("click", toggle);
  document.addEventListener("keydown", (event) => {
    if (event.key === " " && event.target === document.body) { event.preventDefault(); toggle(); }
  });
  window.fpidPin = {seek, viewer, views};
  const asked = new URLSearchParams(location.hash.slice(1)).get("t");
  if (asked !== null) seek(Number(asked));
  else if (reduced.matches) seek(0);
  else animator.play();
} else {
  clock.seek.hidden = clock.play.hidden = true;
  // The page's own address ends with the token.
  const link = new WebSocket(`ws://${location.host}${location.pathname}frames`);
  link.binaryType = "arraybuffer";
  const [view] = views, n = view.joints.length;
  let frames = 0, time = 0, news = null;
  // A frame: t, q, q_ref and torque. All count for paths and peaks, though a slow browser draws only
  // the last.
  link.onmessage = ({data}) => {
    const values = new Float32Array(data);
    news = [1, 1 + n, 1 + 2 * n].map((at) => values.subarray(at, at + n));
    news[2].forEach((u, j) => view.seen(j, u));
    view.grow(news[0], news[1]);
    [time, frames] = [values[0], frames + 1];
    viewer.set_dirty();
  };
  link.onclose = () => fail("The live view has ended.");
  viewer.render = () => {
    if (news) view.show(...news);
    view.drawPaths();
    clock.time.textContent = `t = ${time.toFixed(2)} s`;
    draw();
  };
  document.addEventListener("keydown", (event) => {
    if (event.key.length === 1 && !event.ctrlKey && !event.metaKey && link.readyState === 1) {
      link.send(event.key);
    }
  });
  window.fpidPin = {viewer, views, frames: () => frames};
}
viewer.set_dirty();
