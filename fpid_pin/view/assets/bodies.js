"use strict";
// Solids, arms, tubes and arcs for three.js (which meshcat brings along).
const THREE = MeshCat.THREE;
// The colour of where an arm should be.
const GHOST = [0.0, 0.62, 0.45];

const BUFFERS = SCENE.buffers.map(({type, data}) => {
  const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
  const kinds = {f4: Float32Array, u2: Uint16Array, u4: Uint32Array};
  return new kinds[type](bytes.buffer);
});

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

// A line through points as three.js lays a tube along it.
class Polyline extends THREE.Curve {
  constructor(points) {
    super();
    this.at = (u, ahead) => {
      const last = points.length - 1, i = Math.round(u * last) + ahead;
      return points[Math.min(Math.max(i, 0), last)];
    };
  }

  getPointAt(u, target = new THREE.Vector3()) {
    return target.copy(this.at(u, 0));
  }

  getTangentAt(u, target = new THREE.Vector3()) {
    return target.subVectors(this.at(u, 1), this.at(u, -1)).normalize();
  }
}

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
    this.mesh.geometry = points.length < 2 ? new THREE.BufferGeometry()
      : new THREE.TubeGeometry(new Polyline(points), points.length - 1, this.radius, SIDES);
    return this;
  }

  upTo(segments) {
    this.mesh.geometry.setDrawRange(0, 6 * SIDES * segments);
  }
}

const HALF = 48;
const CALM = new THREE.Color(0.17, 0.48, 0.71), BUSY = new THREE.Color(0.94, 0.77, 0.1);
const FULL = new THREE.Color(0.84, 0.1, 0.11);

function loadColour(part) {
  const colour = CALM.clone();
  return part < 0.5 ? colour.lerp(BUSY, 2 * part)
    : colour.copy(BUSY).lerp(FULL, Math.min(2 * part - 1, 1));
}

// A joint's torque as an arc about its axis: half a turn is the limit, the sense is the sign.
// A force is a bar along the axis, of the arc's length.
class TorqueArc {
  constructor(frame, axis, radius, slides) {
    const turn = new THREE.Group();
    turn.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), axis);
    frame.add(turn);
    const circle = (turns, parts) => Array.from({length: parts + 1}, (_, i) => {
      const angle = (turns * 2 * Math.PI * i) / parts;
      return slides ? new THREE.Vector3(0, 0, radius * angle)
        : new THREE.Vector3(radius * Math.cos(angle), radius * Math.sin(angle), 0);
    });
    const whole = circle(1, 2 * HALF);
    // To both sides of the joint.
    if (slides) for (const point of whole) point.z -= Math.PI * radius;
    new Tube(turn, 0.018 * radius, 0x808080, 0.55).set(whole);
    this.sense = new THREE.Group();
    turn.add(this.sense);
    this.arc = new Tube(this.sense, 0.075 * radius, 0x000000, 1).set(circle(0.5, HALF));
  }

  show(part) {
    // Half a turn about x makes a clockwise arc of a counter-clockwise one, and turns a bar round.
    this.sense.rotation.x = part < 0 ? Math.PI : 0;
    const size = Math.min(Math.abs(part), 1);
    this.arc.upTo(Math.round(HALF * size));
    this.arc.mesh.material.color.copy(loadColour(size));
  }
}
