"use strict";
// The arm, where it should be (translucent), and the tool's paths: now, wanted, pinned; and a clock.
class ArmView {
  constructor(holder) {
    this.playing = false;
    this.time = 0;
    try {
      this.stage = new Stage(holder);
    } catch {
      holder.textContent = "The arm needs WebGL, which this browser does not give this page.";
      holder.classList.add("without");
      return;
    }
    const node = (name) => this.stage.node(name);
    this.arm = new ArmBody(0, node("actual"), false);
    this.ghost = new ArmBody(0, node("desired"), true);
    const tube = (size, colour, opacity) =>
      new Tube(node("path"), size * SCENE.reach, new THREE.Color(...colour), opacity);
    this.paths = {q: tube(0.005, [0.0, 0.45, 0.7], 1), q_ref: tube(0.003, GHOST, 0.7),
      pinned: tube(0.003, [0.5, 0.5, 0.5], 0.9)};
    this.stage.frame();
  }

  show(frames, pinned) {
    this.frames = frames;
    if (!this.stage) return;
    for (const [name, q] of [["q", frames.q], ["q_ref", frames.q_ref], ["pinned", pinned?.q ?? []]]) {
      this.paths[name].set(this.arm.path(q).points);
    }
    this.pose();
  }

  pose() {
    if (!this.frames || !this.stage) return;
    const {t} = this.frames, last = t.length - 1, n = JOINTS.length;
    const k = Math.min(Math.round((this.time / (t[last] || 1)) * last), last);
    this.arm.pose(this.frames.q.subarray(k * n, (k + 1) * n));
    this.ghost.pose(this.frames.q_ref.subarray(k * n, (k + 1) * n));
    this.stage.viewer.set_dirty();
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
