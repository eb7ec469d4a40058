"use strict";
// The scene, its clock and its panel. meshcat keeps the time; what is seen follows from it.
const GHOST = [0.0, 0.62, 0.45];
const element = (id) => document.getElementById(id);
const css = ([r, g, b]) => `rgb(${[r, g, b].map((x) => Math.round(255 * x)).join(",")})`;
const three = ([r, g, b]) => new THREE.Color(r, g, b);

function fail(text) {
  element("message").textContent = text;
  element("message").hidden = false;
}

let viewer = null;
try {
  viewer = new MeshCat.Viewer(element("meshcat-pane"));
} catch (error) {
  fail("This page needs WebGL, which this browser does not give it.");
  throw error;
}

const reach = SCENE.reach;

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
    this.colour = table.colour;
    const node = (name) => {
      const group = viewer.scene_tree.find(["fpid_pin", `${number + 1} ${table.caption}`, name]).object;
      group.position.set(...table.offset);
      return group;
    };
    this.arm = new ArmBody(table.arm, node("actual"), false);
    this.ghost = new ArmBody(table.arm, node("desired"), true);
    const torques = node("torque");
    const arcs = new ArmBody(table.arm, torques, true);
    arcs.root.traverse((thing) => { if (thing.isMesh) thing.visible = false; });
    this.arcBody = arcs;
    this.arcs = arcs.turns.map(([, axis, slides], j) =>
      new TorqueArc(arcs.frames[j], axis, 0.08 * reach, slides));
    const paths = node("path");
    this.wanted = new Tube(paths, 0.003 * reach, three(GHOST), 0.7);
    this.trail = new Tube(paths, 0.005 * reach, new THREE.Color(this.colour), 1);
    this.label = SCENE.runs.length > 1
      ? caption(table.caption, node("caption"), table.top + 0.16 * reach) : null;
    this.peak = this.joints.map(() => 1e-9);
    if (!SCENE.live) {
      this.rows = Object.fromEntries(["t", "q", "q_ref", "torque"].map((k) => [k, BUFFERS[table[k]]]));
      this.trace();
      this.rows.torque.forEach((u, i) => this.seen(i % this.joints.length, u));
    } else {
      this.points = [[], []];
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

  // The tool's paths; points closer than a thousandth of the arm are left out.
  trace() {
    this.marks = [];
    [[this.trail, "q"], [this.wanted, "q_ref"]].forEach(([tube, name]) => {
      const points = [], marks = [];
      for (let k = 0; k < this.rows.t.length; k++) {
        const at = this.arm.tool(this.row(name, k));
        if (points.length && at.distanceTo(points[points.length - 1]) < 1e-3 * reach) continue;
        points.push(at);
        marks.push(this.rows.t[k]);
      }
      tube.set(points);
      if (name === "q") this.marks = marks;
    });
  }

  panel() {
    const box = element("runs"), head = document.createElement("h2");
    const swatch = document.createElement("span");
    swatch.className = "swatch";
    swatch.style.background = this.colour;
    head.append(swatch, this.table.caption);
    box.append(head);
    if (this.table.outcome) {
      const ended = document.createElement("div");
      ended.className = "ended";
      ended.textContent = this.table.outcome;
      box.append(ended);
    }
    const table = document.createElement("table");
    this.bars = this.joints.map((joint) => {
      const row = table.insertRow();
      row.insertCell().textContent = joint.name;
      const cell = row.insertCell(), track = document.createElement("div");
      cell.className = "bar";
      track.className = "track";
      const bar = document.createElement("i");
      track.append(bar);
      cell.append(track);
      const value = row.insertCell();
      value.className = "value";
      return [bar, value];
    });
    box.append(table);
  }

  at(t) {
    const times = this.rows.t, last = times.length - 1;
    let low = 0, high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle; else high = middle;
    }
    const span = times[high] - times[low];
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

const dark = window.matchMedia("(prefers-color-scheme: dark)");
function paint() {
  const [top, bottom] = dark.matches ? [0.16, 0.08] : [1.0, 0.86];
  viewer.set_property(["Background"], "top_color", [top, top, top]);
  viewer.set_property(["Background"], "bottom_color", [bottom, bottom, bottom]);
}
paint();
dark.addEventListener("change", paint);

// The grid's cells are about a quarter of the arm: 1, 2 or 5 times a power of ten.
const cell = (() => {
  const want = 0.25 * reach, power = 10 ** Math.floor(Math.log10(want));
  return [5, 2, 1].find((k) => k * power <= want) * power;
})();
viewer.set_property(["Axes"], "visible", false);
viewer.set_property(["Grid"], "scale", [2 * cell, 2 * cell, 2 * cell]);
viewer.set_property(["Grid"], "position", [SCENE.camera.centre[0], SCENE.camera.centre[1], SCENE.floor]);

const views = SCENE.runs.map((table, i) => new RunView(table, i));
if (SCENE.floor < -0.05 * reach) {
  // A stand; where the arm swings in a plane through its base it is behind, out of the way.
  for (const {offset} of SCENE.runs) {
    const [x, y] = SCENE.camera.towards;
    const back = ((SCENE.planar ? -0.14 : 0) * reach) / (Math.hypot(x, y) || 1);
    const post = new THREE.Mesh(
      new THREE.CylinderGeometry(0.025 * reach, 0.05 * reach, -SCENE.floor, 24).rotateX(Math.PI / 2),
      new THREE.MeshPhongMaterial({color: 0x9aa0a6}));
    post.position.set(offset[0] + back * x, offset[1] + back * y, SCENE.floor / 2);
    viewer.scene_tree.find(["fpid_pin", "stand"]).object.add(post);
  }
}
const limited = views.some((view) => view.joints.some((joint) => joint.limit !== null));
const unlimited = views.some((view) => view.joints.some((joint) => joint.limit === null));
element("legend").textContent = "Green, translucent: where the arm should be, and its tool's path. "
  + "Arcs and bars: joint torque"
  + (limited ? ", full at the limit" : "")
  + (unlimited ? `${limited ? " or, where none is given," : ", full"} at the largest seen` : "") + ".";
if (window.innerWidth < 600 || window.innerHeight < 420) {
  element("panel").open = false;
  viewer.gui.width = 130;
}

// Fit the room into what the panel and the clock leave of the window, whatever its shape;
// meshcat's camera frame has y up.
function frame() {
  const {towards, centre, extent} = SCENE.camera, camera = viewer.camera;
  const [width, height] = [window.innerWidth, window.innerHeight], panel = element("panel");
  const left = panel.open && width > 700 ? panel.offsetLeft + panel.offsetWidth : 0;
  const [free, tall] = [width - left, height - 52];
  camera.fov = 40;
  camera.near = 0.05 * reach;
  camera.far = 200 * reach;
  const rise = Math.tan((camera.fov * Math.PI) / 360);
  const top = extent[1] + (views.length > 1 ? 0.12 * reach : 0);
  // A caption may be wider than the arm that it stands above.
  const [x, y] = towards, level = Math.hypot(x, y) || 1;
  const wide = Math.max(extent[0], ...views.filter(({label}) => label).map(({label, table}) =>
    Math.abs((y * (table.offset[0] - centre[0]) - x * (table.offset[1] - centre[1])) / level)
    + 0.5 * label.scale.x));
  const away = extent[2]
    + Math.max((top * height) / (rise * tall), (wide * height) / (rise * free));
  const y_up = ([x, y, z]) => [x, z, -y];
  viewer.controls.target.set(...y_up(centre));
  camera.position.set(...y_up(centre.map((c, i) => c + away * towards[i])));
  camera.setViewOffset(width, height, -left / 2, (height - tall) / 2, width, height);
  viewer.controls.update();
  viewer.set_dirty();
}
frame();
window.addEventListener("resize", frame);
element("panel").addEventListener("toggle", frame);

const clock = {seek: element("seek"), play: element("play"), time: element("time")};
function tell(t, whole) {
  clock.time.textContent = `t = ${t.toFixed(2)} s` + (whole ? ` of ${whole.toFixed(1)} s` : "");
}
const draw = viewer.render.bind(viewer);

if (!SCENE.live) {
  // One number that runs from 0 to the duration gives meshcat a clip to play, seek and loop;
  // poses are computed from its time whenever it draws. Its keys are in frames: one a second.
  const duration = SCENE.duration, animator = viewer.animator;
  viewer.scene_tree.find(["fpid_pin"]).object.clock = 0;
  viewer.set_animation([{path: ["fpid_pin"], clip: {name: "run", fps: 1, tracks: [
    {name: ".clock", type: "number", times: [0, Math.max(duration, 1e-3)], values: [0, duration]},
  ]}}], {play: false, repetitions: Infinity});
  let shown = null;
  viewer.render = () => {
    const t = Math.min(animator.time, duration);
    views.forEach((view) => view.at(t));
    if (document.activeElement !== clock.seek || animator.playing) clock.seek.value = t;
    tell(t, duration);
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
  else if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) seek(0);
  else animator.play();
} else {
  clock.seek.hidden = clock.play.hidden = true;
  // The page's own address ends with the token.
  const link = new WebSocket(`ws://${location.host}${location.pathname}frames`);
  link.binaryType = "arraybuffer";
  let frames = 0, time = 0, news = [];
  // A frame: t, then q, q_ref and torque of every run. All count for paths and peaks, though a
  // slow browser draws only the last.
  link.onmessage = ({data}) => {
    const values = new Float32Array(data);
    let at = 1;
    news = views.map((view) => {
      const n = view.joints.length;
      const rows = [0, 1, 2].map((i) => values.subarray(at + i * n, at + (i + 1) * n));
      at += 3 * n;
      rows[2].forEach((u, j) => view.seen(j, u));
      view.grow(rows[0], rows[1]);
      return rows;
    });
    [time, frames] = [values[0], frames + 1];
    viewer.set_dirty();
  };
  link.onclose = () => fail("The live view has ended.");
  viewer.render = () => {
    news.forEach((rows, i) => {
      views[i].show(...rows);
      views[i].drawPaths();
    });
    tell(time);
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
