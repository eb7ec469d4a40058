"use strict";
// What all pages with an arm share: the viewer, its floor, its background, and where it looks from.
const element = (id) => document.getElementById(id);
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const reduced = window.matchMedia("(prefers-reduced-motion: reduce)");
const make = (tag, attributes = {}, ...children) => {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
};

class Stage {
  // Throws where the browser has no WebGL.
  constructor(holder) {
    const viewer = this.viewer = new MeshCat.Viewer(holder), {reach, floor, camera, runs} = SCENE;
    this.holder = holder;
    // The grid's cells are about a quarter of the arm: 1, 2 or 5 times a power of ten.
    const want = 0.25 * reach, power = 10 ** Math.floor(Math.log10(want));
    const cell = 2 * [5, 2, 1].find((k) => k * power <= want) * power;
    viewer.set_property(["Axes"], "visible", false);
    viewer.set_property(["Grid"], "scale", [cell, cell, cell]);
    viewer.set_property(["Grid"], "position", [camera.centre[0], camera.centre[1], floor]);
    if (floor < -0.05 * reach) runs.forEach(({offset}) => this.stand(offset));
    this.paint();
    dark.addEventListener("change", () => this.paint());
    const size = viewer.set_3d_pane_size.bind(viewer);
    viewer.set_3d_pane_size = () => size(Math.max(holder.clientWidth, 1), Math.max(holder.clientHeight, 1));
    new ResizeObserver(() => {
      viewer.set_3d_pane_size();
      this.frame();
    }).observe(holder);
  }

  node(...path) {
    return this.viewer.scene_tree.find(["fpid_pin", ...path]).object;
  }

  // Where the arm swings in a plane through its base the stand is behind, out of the way.
  stand([ox, oy]) {
    const {reach, floor, planar, camera: {towards: [x, y]}} = SCENE;
    const back = ((planar ? -0.14 : 0) * reach) / (Math.hypot(x, y) || 1);
    const post = new THREE.Mesh(
      new THREE.CylinderGeometry(0.025 * reach, 0.05 * reach, -floor, 24).rotateX(Math.PI / 2),
      new THREE.MeshPhongMaterial({color: 0x9aa0a6}));
    post.position.set(ox + back * x, oy + back * y, floor / 2);
    this.node("stand").add(post);
  }

  paint() {
    const [top, bottom] = dark.matches ? [0.16, 0.08] : [1, 0.88];
    this.viewer.set_property(["Background"], "top_color", [top, top, top]);
    this.viewer.set_property(["Background"], "bottom_color", [bottom, bottom, bottom]);
  }

  // What is taken from the room on the left and below, and what the room has to have at least.
  taken() {
    return {left: 0, below: 0, wide: SCENE.camera.extent[0], high: SCENE.camera.extent[1]};
  }

  // Fit the room into what is left of the pane, whatever its shape; meshcat's camera has y up.
  frame() {
    const {towards, centre, extent} = SCENE.camera, {camera, controls} = this.viewer;
    const {left, below, wide, high} = this.taken();
    const width = Math.max(this.holder.clientWidth, 1), height = Math.max(this.holder.clientHeight, 1);
    camera.fov = 40;
    camera.near = 0.05 * SCENE.reach;
    camera.far = 200 * SCENE.reach;
    const rise = Math.tan((camera.fov * Math.PI) / 360);
    const away = extent[2] + Math.max(
      (high * height) / (rise * (height - below)), (wide * height) / (rise * (width - left)));
    const up = ([x, y, z]) => [x, z, -y];
    controls.target.set(...up(centre));
    camera.position.set(...up(centre.map((c, i) => c + away * towards[i])));
    camera.setViewOffset(width, height, -left / 2, below / 2, width, height);
    controls.update();
    this.viewer.set_dirty();
  }
}
