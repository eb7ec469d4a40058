"use strict";
// What all pages with an arm share: the scene, the viewer that it is seen in, and what stands there.
const THREE = MeshCat.THREE;
const element = (id) => document.getElementById(id);
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const reduced = window.matchMedia("(prefers-reduced-motion: reduce)");
const make = (tag, attributes = {}, ...children) => {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
};

const onSpace = (act) => document.addEventListener("keydown", (event) => {
  if (event.key !== " " || event.target !== document.body) return;
  event.preventDefault();
  act();
});

// Data of the page: a report shows another group by writing its number there.
const SCENE = JSON.parse(element("scene").textContent);
if (SCENE.groups) Object.assign(SCENE, SCENE.groups[SCENE.shown]);
const BUFFERS = SCENE.buffers.map(({type, data}) => {
  const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
  const kinds = {f4: Float32Array, u2: Uint16Array, u4: Uint32Array};
  return new kinds[type](bytes.buffer);
});
// The colour of where an arm should be.
const GHOST = [0.0, 0.62, 0.45];

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

// Faces that meet at less than this share a normal: round parts look round, edges stay sharp.
const CREASE = Math.cos((40 * Math.PI) / 180);

function meshGeometry({low, scale, vertices, triangles}) {
  const grid = BUFFERS[vertices], index = BUFFERS[triangles];
  const position = Float32Array.from({length: 3 * index.length}, (_, i) =>
    low[i % 3] + scale[i % 3] * grid[3 * index[Math.floor(i / 3)] + (i % 3)]);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
  // Each face's own normals, at each of its corners.
  geometry.computeVertexNormals();
  const smooth = geometry.attributes.normal.array, own = smooth.slice();
  const corners = Array.from({length: grid.length / 3}, () => []);
  index.forEach((vertex, i) => corners[vertex].push(3 * i));
  index.forEach((vertex, i) => {
    const [x, y, z] = own.subarray(3 * i, 3 * i + 3);
    for (const j of corners[vertex]) {
      if (j === 3 * i || x * own[j] + y * own[j + 1] + z * own[j + 2] < CREASE) continue;
      for (let k = 0; k < 3; k++) smooth[3 * i + k] += own[j + k];
    }
  });
  geometry.normalizeNormals();
  return geometry;
}

const GEOMETRIES = SCENE.arms.map((arm) => arm.shapes.map(meshGeometry));

function placed(thing, matrix) {
  new THREE.Matrix4().fromArray(matrix).decompose(thing.position, thing.quaternion, thing.scale);
  return thing;
}

// One arm in the scene; ghost: in one translucent colour.
class ArmBody {
  constructor(kind, parent, ghost) {
    this.table = SCENE.arms[kind];
    this.root = new THREE.Group();
    parent.add(this.root);
    this.turns = [];
    this.frames = [];
    let above = this.root;
    for (const joint of this.table.joints) {
      const frame = placed(new THREE.Group(), joint.placement), turn = new THREE.Group();
      frame.add(turn);
      above.add(frame);
      this.frames.push(frame);
      this.turns.push([turn, new THREE.Vector3(...joint.axis), joint.slides]);
      above = turn;
    }
    const {joint, placement} = this.table.tool;
    this.end = placed(new THREE.Group(), placement);
    (joint < 0 ? this.root : this.turns[joint][0]).add(this.end);
    this.table.shapes.forEach((shape, i) => {
      // The base does not move: a ghost of it would only flicker.
      if (ghost && shape.joint < 0) return;
      const [r, g, b, opacity] = ghost ? [...GHOST, 0.32] : shape.colour;
      const material = new THREE.MeshPhongMaterial({
        color: new THREE.Color(r, g, b), opacity, transparent: opacity < 1, shininess: 25,
        side: THREE.DoubleSide,
        // Where the two arms nearly coincide the real one wins, without shimmer.
        polygonOffset: ghost, polygonOffsetFactor: 2, polygonOffsetUnits: 1500,
        depthWrite: !ghost,
      });
      const mesh = placed(new THREE.Mesh(GEOMETRIES[kind][i], material), shape.placement);
      (shape.joint < 0 ? this.root : this.turns[shape.joint][0]).add(mesh);
    });
  }

  pose(q) {
    this.turns.forEach(([turn, axis, slides], j) => {
      if (slides) turn.position.copy(axis).multiplyScalar(q[j]);
      else turn.quaternion.setFromAxisAngle(axis, q[j]);
    });
  }

  // Moves the arm to q, and returns where its tool is, in its own base frame.
  tool(q) {
    this.pose(q);
    return this.root.worldToLocal(this.end.getWorldPosition(new THREE.Vector3()));
  }

  // The tool's path through rows of q, and the row of each point; what is nearer than a thousandth
  // of the arm to the point before is left out.
  path(q) {
    const n = this.turns.length, points = [], rows = [];
    for (let k = 0; (k + 1) * n <= q.length; k++) {
      const at = this.tool(q.subarray(k * n, (k + 1) * n)), last = points[points.length - 1];
      if (!Number.isFinite(at.lengthSq()) || (last && at.distanceTo(last) < 1e-3 * SCENE.reach)) continue;
      points.push(at);
      rows.push(k);
    }
    return {points, rows};
  }
}

const SIDES = 6;

// A tube through points, drawn up to any of them: WebGL lines are one pixel wide.
class Tube {
  constructor(parent, radius, colour, opacity) {
    this.radius = radius;
    const material = new THREE.MeshBasicMaterial({
      color: colour, opacity, transparent: opacity < 1, side: THREE.DoubleSide,
    });
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), material);
    this.mesh.frustumCulled = false;
    parent.add(this.mesh);
  }

  set(points) {
    this.mesh.geometry.dispose();
    const line = new THREE.CatmullRomCurve3(points, false, "catmullrom"), last = points.length - 1;
    // A section at each point, however far apart they are.
    line.getUtoTmapping = (u) => u;
    this.mesh.geometry = last < 1 ? new THREE.BufferGeometry()
      : new THREE.TubeGeometry(line, last, this.radius, SIDES);
    return this;
  }

  upTo(segments) {
    this.mesh.geometry.setDrawRange(0, 6 * SIDES * segments);
  }
}

// An arm of the scene, its desired self, and the paths of both tools.
class ArmPair {
  constructor(stage, {arm, offset, colour}, ...path) {
    this.node = (name) => {
      const group = stage.node(...path, name);
      group.position.set(...offset);
      return group;
    };
    this.arm = new ArmBody(arm, this.node("actual"), false);
    this.ghost = new ArmBody(arm, this.node("desired"), true);
    this.wanted = this.tube(0.003, GHOST, 0.7);
    this.trail = this.tube(0.005, colour, 1);
  }

  tube(size, colour, opacity) {
    const own = new THREE.Color(...[colour].flat());
    return new Tube(this.node("path"), size * SCENE.reach, own, opacity);
  }

  pose(q, wanted) {
    this.arm.pose(q);
    this.ghost.pose(wanted);
  }
}
