"use strict";
// The arm, where it should be (translucent), and the tool's paths: now, wanted, pinned.
const GHOST = [0.0, 0.62, 0.45];
const reduced = window.matchMedia("(prefers-reduced-motion: reduce)");

class Stage {
  constructor(holder) {
    this.holder = holder;
    this.playing = false;
    this.time = 0;
    try {
      this.viewer = new MeshCat.Viewer(holder);
    } catch {
      holder.textContent = "The arm needs WebGL, which this browser does not give this page.";
      holder.classList.add("without");
      return;
    }
    const viewer = this.viewer, reach = SCENE.reach;
    viewer.set_property(["Axes"], "visible", false);
    const want = 0.25 * reach, power = 10 ** Math.floor(Math.log10(want));
    const cell = 2 * [5, 2, 1].find((k) => k * power <= want) * power;
    viewer.set_property(["Grid"], "scale", [cell, cell, cell]);
    viewer.set_property(["Grid"], "position", [...SCENE.camera.centre.slice(0, 2), SCENE.floor]);
    const node = (name) => viewer.scene_tree.find(["fpid_pin", name]).object;
    this.arm = new ArmBody(0, node("actual"), false);
    this.ghost = new ArmBody(0, node("desired"), true);
    const tube = (size, colour, opacity) =>
      new Tube(node("path"), size * reach, new THREE.Color(...colour), opacity);
    this.paths = {q: tube(0.005, [0.0, 0.45, 0.7], 1), q_ref: tube(0.003, GHOST, 0.7),
      pinned: tube(0.003, [0.5, 0.5, 0.5], 0.9)};
    if (SCENE.floor < -0.05 * reach) this.stand();
    this.paint();
    dark.addEventListener("change", () => this.paint());
    const size = viewer.set_3d_pane_size.bind(viewer);
    viewer.set_3d_pane_size = () => size(Math.max(holder.clientWidth, 1), Math.max(holder.clientHeight, 1));
    new ResizeObserver(() => {
      viewer.set_3d_pane_size();
      this.frame();
    }).observe(holder);
    this.frame();
  }

  stand() {
    const reach = SCENE.reach, [x, y] = SCENE.camera.towards;
    const back = ((SCENE.planar ? -0.14 : 0) * reach) / (Math.hypot(x, y) || 1);
    const post = new THREE.Mesh(
      new THREE.CylinderGeometry(0.025 * reach, 0.05 * reach, -SCENE.floor, 24).rotateX(Math.PI / 2),
      new THREE.MeshPhongMaterial({color: 0x9aa0a6}));
    post.position.set(back * x, back * y, SCENE.floor / 2);
    this.viewer.scene_tree.find(["fpid_pin", "stand"]).object.add(post);
  }

  paint() {
    const [top, bottom] = dark.matches ? [[0.12, 0.14, 0.17], [0.07, 0.08, 0.1]]
      : [[1, 1, 1], [0.91, 0.93, 0.95]];
    this.viewer.set_property(["Background"], "top_color", top);
    this.viewer.set_property(["Background"], "bottom_color", bottom);
  }

  frame() {
    const {towards, centre, extent} = SCENE.camera, {camera, controls} = this.viewer;
    const aspect = Math.max(this.holder.clientWidth, 1) / Math.max(this.holder.clientHeight, 1);
    camera.fov = 40;
    camera.near = 0.05 * SCENE.reach;
    camera.far = 200 * SCENE.reach;
    const rise = Math.tan((camera.fov * Math.PI) / 360);
    const away = extent[2] + Math.max(extent[1] / rise, extent[0] / (rise * aspect));
    const up = ([x, y, z]) => [x, z, -y];
    controls.target.set(...up(centre));
    camera.position.set(...up(centre.map((c, i) => c + away * towards[i])));
    controls.update();
    this.viewer.set_dirty();
  }

  trace(tube, frames, name) {
    const points = [], n = JOINTS.length;
    for (let k = 0; k < frames.t.length; k++) {
      const q = frames[name].subarray(k * n, (k + 1) * n);
      if (!q.every(Number.isFinite)) continue;
      const at = this.arm.tool(q);
      if (points.length && at.distanceTo(points[points.length - 1]) < 2e-3 * SCENE.reach) continue;
      points.push(at);
    }
    tube.set(points);
  }

  show(frames, pinned) {
    this.frames = frames;
    if (!this.viewer) return;
    this.trace(this.paths.q, frames, "q");
    this.trace(this.paths.q_ref, frames, "q_ref");
    if (pinned) this.trace(this.paths.pinned, pinned, "q"); else this.paths.pinned.set([]);
    this.pose();
  }

  pose() {
    if (!this.frames || !this.viewer) return;
    const {t} = this.frames, last = t.length - 1, n = JOINTS.length;
    const k = Math.min(Math.round((this.time / (t[last] || 1)) * last), last);
    this.arm.pose(this.frames.q.subarray(k * n, (k + 1) * n));
    this.ghost.pose(this.frames.q_ref.subarray(k * n, (k + 1) * n));
    this.viewer.set_dirty();
  }

  seek(t) {
    this.time = Math.min(Math.max(t, 0), ENGINE.duration);
    this.pose();
    this.moved?.(this.time);
  }

  play(on) {
    this.playing = on;
    let before = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      const t = this.time + (now - before) / 1000;
      before = now;
      this.seek(t > ENGINE.duration ? 0 : t);
      requestAnimationFrame(tick);
    };
    if (on) requestAnimationFrame((now) => { before = now; tick(now); });
    this.toggled?.(on);
  }
}
