"use strict";
// Arms, their clock and their panel. meshcat keeps the time; what is seen follows from it.
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
  const canvas = make("canvas"), context = canvas.getContext("2d");
  const font = "600 56px system-ui, sans-serif";
  context.font = font;
  canvas.width = Math.ceil(context.measureText(text).width) + 40;
  canvas.height = 80;
  Object.assign(context, {font, fillStyle: dark.matches ? "#e8eaed" : "#1b1f24", textBaseline: "middle"});
  context.fillText(text, 20, 42);
  const map = new THREE.CanvasTexture(canvas), size = 0.13 * reach;
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({map, depthTest: false}));
  sprite.scale.set((size * canvas.width) / canvas.height, size, 1);
  sprite.position.z = height;
  parent.add(sprite);
  return sprite;
}

const HALF = 48;
const [CALM, BUSY, FULL] = [[0.17, 0.48, 0.71], [0.94, 0.77, 0.1], [0.84, 0.1, 0.11]]
  .map((colour) => new THREE.Color(...colour));
const loadColour = (part) => (part < 0.5 ? CALM.clone().lerp(BUSY, 2 * part)
  : BUSY.clone().lerp(FULL, Math.min(2 * part - 1, 1)));

// A joint's torque as an arc about its axis: half a turn is the limit, the sense is the sign.
// A force is a bar along the axis, of the arc's length.
class TorqueArc {
  constructor(frame, axis, radius, slides) {
    const turn = new THREE.Group();
    turn.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), axis);
    frame.add(turn);
    const circle = (from, to, parts) => Array.from({length: parts + 1}, (_, i) => {
      const angle = Math.PI * (from + ((to - from) * i) / parts);
      return slides ? new THREE.Vector3(0, 0, radius * angle)
        : new THREE.Vector3(radius * Math.cos(angle), radius * Math.sin(angle), 0);
    });
    // To both sides of the joint.
    new Tube(turn, 0.018 * radius, 0x808080, 0.55).set(circle(-1, 1, 2 * HALF));
    this.sense = new THREE.Group();
    turn.add(this.sense);
    this.arc = new Tube(this.sense, 0.075 * radius, 0x000000, 1).set(circle(0, 1, HALF));
  }

  show(part) {
    // Half a turn about x makes a clockwise arc of a counter-clockwise one, and turns a bar round.
    this.sense.rotation.x = part < 0 ? Math.PI : 0;
    const size = Math.min(Math.abs(part), 1);
    this.arc.upTo(Math.round(HALF * size));
    this.arc.mesh.material.color.copy(loadColour(size));
  }
}

// One run: the arm, its ghost, the tool's paths, the torque arcs, and its part of the panel.
class RunView extends ArmPair {
  constructor(table, number) {
    super(stage, table, `${number + 1} ${table.caption}`);
    this.table = table;
    this.joints = SCENE.arms[table.arm].joints;
    // The arcs move with an arm of their own, of which nothing else is seen.
    this.arcBody = new ArmBody(table.arm, this.node("torque"), true);
    this.arcBody.root.traverse((thing) => { if (thing.isMesh) thing.visible = false; });
    this.arcs = this.arcBody.turns.map(([, axis, slides], j) =>
      new TorqueArc(this.arcBody.frames[j], axis, 0.08 * reach, slides));
    this.label = SCENE.runs.length > 1
      ? caption(table.caption, this.node("caption"), table.top + 0.16 * reach) : null;
    this.peak = this.joints.map(() => 1e-9);
    this.points = [[], []];
    if (!SCENE.live) this.record();
    const swatch = make("i", {class: "swatch", style: `background: ${table.colour}`});
    this.bars = this.joints.map(() => [make("i"), make("td", {class: "value"})]);
    element("runs").append(make("h2", {}, swatch, table.caption),
      ...(table.outcome ? [make("div", {class: "bad"}, table.outcome)] : []),
      make("table", {}, ...this.joints.map(({name}, j) => make("tr", {}, make("td", {}, name),
        make("td", {class: "bar"}, make("div", {class: "track"}, this.bars[j][0])), this.bars[j][1]))));
  }

  // A replay: what is between its rows is interpolated, and the whole of the paths is there at once.
  record() {
    const {table} = this, n = this.joints.length, [t, q, wanted, torque] =
      ["t", "q", "q_ref", "torque"].map((name) => BUFFERS[table[name]]);
    this.tracks = [q, wanted].map((rows) => new THREE.LinearInterpolant(t, rows, n));
    this.tracks.push(new THREE.DiscreteInterpolant(t, torque, n));
    const {points, rows} = this.arm.path(q);
    this.trail.set(points);
    this.marks = rows.map((k) => t[k]);
    this.wanted.set(this.arm.path(wanted).points);
    torque.forEach((u, i) => this.seen(i % n, u));
  }

  seen(j, torque) {
    this.peak[j] = Math.max(this.peak[j], Math.abs(torque));
  }

  at(t) {
    this.show(...this.tracks.map((track) => track.evaluate(t)));
    this.trail.upTo(Math.max(this.marks.findLastIndex((mark) => mark <= t), 0));
  }

  show(q, wanted, torque) {
    this.pose(q, wanted);
    this.arcBody.pose(q);
    this.joints.forEach(({limit, slides}, j) => {
      const part = torque[j] / (limit ?? this.peak[j]), half = 50 * Math.min(Math.abs(part), 1);
      const [bar, value] = this.bars[j], left = `${part < 0 ? 50 - half : 50}%`;
      this.arcs[j].show(part);
      Object.assign(bar.style,
        {left, width: `${half}%`, background: `#${loadColour(Math.abs(part)).getHexString()}`});
      const shown = Math.abs(torque[j]) < 0.05 ? 0 : torque[j], full = limit === null ? "" : ` / ${limit}`;
      value.textContent = `${shown.toFixed(1)}${full} ${slides ? "N" : "N m"}`;
    });
  }

  // Live: the paths are what has been seen, the last part of it.
  grow(...angles) {
    this.points.forEach((points, i) => {
      const at = this.arm.tool(angles[i]);
      if (points.length && at.distanceTo(points[points.length - 1]) < 3e-3 * reach) return;
      points.push(at);
      if (points.length > 500) points.shift();
      this.grown = true;
    });
  }

  drawPaths() {
    if (this.grown) [this.trail, this.wanted].forEach((tube, i) => tube.set(this.points[i]));
    this.grown = false;
  }
}

const views = SCENE.runs.map((table, i) => new RunView(table, i));
// Captions that are wider than the way to the next arm stand in two rows.
const ways = SCENE.runs.slice(1).map(({offset}, k) =>
  Math.hypot(...offset.map((x, axis) => x - SCENE.runs[k].offset[axis])));
const row = Math.max(...views.map(({label}) => label?.scale.x ?? 0)) > Math.min(...ways) ? 0.13 * reach : 0;
views.forEach(({label}, k) => { if (label) label.position.z += (k % 2) * row; });
const limits = new Set(views.flatMap(({joints}) => joints.map(({limit}) => limit !== null)));
const full = [...limits].map((known) => (known ? "at the limit" : "at the largest seen"));
element("legend").textContent = "Green, translucent: where the arm should be, and its tool's path. "
  + `Arcs and bars: joint torque, full ${full.join(" or, where there is none, ")}.`;
const panel = element("panel");
if (window.innerWidth < 600 || window.innerHeight < 420) {
  panel.open = false;
  viewer.gui.width = 130;
}

// The panel and the clock lie over the pane; a caption may be wider than the arm below it.
stage.taken = () => {
  const {towards: [x, y], centre, extent} = SCENE.camera, level = Math.hypot(x, y) || 1;
  const open = panel.open && window.innerWidth > 700;
  const wide = Math.max(extent[0], ...views.filter(({label}) => label).map(({label, table}) =>
    Math.abs((y * (table.offset[0] - centre[0]) - x * (table.offset[1] - centre[1])) / level)
    + 0.5 * label.scale.x));
  return {left: open ? panel.offsetLeft + panel.offsetWidth : 0, below: 52, wide,
    high: extent[1] + row + (views.length > 1 ? 0.12 * reach : 0)};
};
stage.frame();
panel.addEventListener("toggle", () => stage.frame());

const [seek, play, clock] = ["seek", "play", "time"].map(element);
const draw = viewer.render.bind(viewer);
window.fpidPin = {viewer, views};
if (SCENE.live) live(); else replay();
viewer.set_dirty();

// One number that runs from 0 to the duration gives meshcat a clip to play, seek and loop;
// poses are computed from its time whenever it draws. Its keys are in frames: one a second.
function replay() {
  const {duration} = SCENE, {animator} = viewer;
  stage.node().clock = 0;
  viewer.set_animation([{path: ["fpid_pin"], clip: {name: "run", fps: 1, tracks: [
    {name: ".clock", type: "number", times: [0, Math.max(duration, 1e-3)], values: [0, duration]},
  ]}}], {play: false, repetitions: Infinity});
  viewer.render = () => {
    const t = Math.min(animator.time, duration);
    views.forEach((view) => view.at(t));
    if (document.activeElement !== seek || animator.playing) seek.value = t;
    clock.textContent = `t = ${t.toFixed(2)} s of ${duration.toFixed(1)} s`;
    play.textContent = animator.playing ? "Pause" : "Play";
    draw();
  };
  const go = (t) => {
    animator.pause();
    animator.display_progress(t);
    animator.seek(t);
  };
  const toggle = () => {
    if (animator.playing) animator.pause(); else animator.play();
    viewer.set_dirty();
  };
  seek.max = duration;
  seek.addEventListener("input", () => go(Number(seek.value)));
  play.addEventListener("click", toggle);
  onSpace(toggle);
  window.fpidPin.seek = go;
  const asked = new URLSearchParams(location.hash.slice(1)).get("t");
  if (asked !== null || reduced.matches) go(Number(asked)); else animator.play();
}

function live() {
  seek.hidden = play.hidden = true;
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
    clock.textContent = `t = ${time.toFixed(2)} s`;
    draw();
  };
  document.addEventListener("keydown", ({key, ctrlKey, metaKey}) => {
    if (key.length === 1 && !ctrlKey && !metaKey && link.readyState === 1) link.send(key);
  });
  window.fpidPin.frames = () => frames;
}
