// shapes.js: colliders as triangles, {positions, normals, corners}, and whether they are bounded. An entry of the table makes
// the shape of one type from its parameters; a type that is not in the table is drawn if it has triangles of its own.

const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const along = (a, s, b) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const n = Math.hypot(...a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };
const across = (a) => unit(cross(a, Math.abs(a[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0]));

function solid(positions, normals, corners, bounded = true) {
  return { positions: new Float32Array(positions.flat()), normals: new Float32Array(normals.flat()), corners: new Uint32Array(corners), bounded };
}

// A surface of revolution; the profile is a list of [distance from the axis, place along it, normal in these directions].
function turned(base, axis, profile) {
  const sides = 64, u = across(axis), v = cross(axis, u), positions = [], normals = [], corners = [];
  for (let i = 0; i <= sides; i++) {
    const angle = 2 * Math.PI * i / sides;
    const out = along(u.map((x) => x * Math.cos(angle)), Math.sin(angle), v);
    for (const [r, z, nr, nz] of profile) {
      positions.push(along(along(base, z, axis), r, out));
      normals.push(along(out.map((x) => x * nr), nz, axis));
    }
  }
  const m = profile.length;
  for (let i = 0; i < sides; i++) {
    for (let j = 0; j + 1 < m; j++) {
      const a = i * m + j, b = a + m;
      corners.push(a, b, a + 1, a + 1, b, b + 1);
    }
  }
  return solid(positions, normals, corners);
}

// An arc from one angle to another; 0 points away from the axis.
function arc(radius, r, z, from, to, steps) {
  const points = [];
  for (let i = 0; i <= steps; i++) {
    const angle = from + (to - from) * i / steps, c = Math.cos(angle), s = Math.sin(angle);
    points.push([r + radius * c, z + radius * s, c, s]);
  }
  return points;
}

// The rotation matrix, by rows, of a vector along the axis whose length is the angle in degrees.
function rotation(turn) {
  const degrees = Math.hypot(...turn), a = unit(turn), angle = degrees * Math.PI / 180, c = Math.cos(angle), s = Math.sin(angle);
  return [0, 1, 2].map((i) => [0, 1, 2].map((j) => {
    const skew = i === j ? 0 : (j - i + 3) % 3 === 1 ? -a[3 - i - j] : a[3 - i - j];
    return (i === j ? c : 0) + (1 - c) * a[i] * a[j] + s * skew;
  }));
}

const half = Math.PI / 2;
const shapes = {
  sphere: ({ center, radius }) => turned(center, [0, 1, 0], arc(radius, 0, 0, -half, half, 40)),
  capsule: ({ a, b, radius }) => {
    const axis = unit(sub(b, a)), length = Math.hypot(...sub(b, a));
    return turned(a, axis, [...arc(radius, 0, 0, -half, 0, 20), ...arc(radius, 0, length, 0, half, 20)]);
  },
  cylinder: ({ a, b, radius, rounding }) => {
    const axis = unit(sub(b, a)), length = Math.hypot(...sub(b, a)), core = radius - rounding;
    return turned(a, axis, [[0, 0, 0, -1], ...arc(rounding, core, rounding, -half, 0, 8),
      ...arc(rounding, core, length - rounding, 0, half, 8), [0, length, 0, 1]]);
  },
  box: ({ center, size, rotate, rounding }) => roundBox(center, size, rotation(rotate), rounding),
  plane: ({ point, normal }, bounds) => {
    const n = unit(normal), u = across(n), v = cross(n, u), reach = 2.2 * bounds.radius;
    const middle = along(bounds.center, -dot(sub(bounds.center, point), n), n);
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([s, t]) => along(along(middle, s * reach, u), t * reach, v));
    return { ...solid(corners, [n, n, n, n], [0, 1, 2, 0, 2, 3], false), plane: { point: middle, normal: n, reach } };
  },
};

// Each face is a grid on the core, moved along its normals by the rounding.
function roundBox(center, size, matrix, rounding) {
  const positions = [], normals = [], corners = [], steps = rounding > 0 ? 12 : 1;
  const core = size.map((s) => s / 2 - rounding);
  for (let axis = 0; axis < 3; axis++) {
    for (const side of [-1, 1]) {
      const first = positions.length, u = (axis + 1) % 3, v = (axis + 2) % 3;
      for (let i = 0; i <= steps; i++) {
        for (let j = 0; j <= steps; j++) {
          const p = [0, 0, 0];
          p[axis] = side * size[axis] / 2;
          p[u] = (i / steps - 0.5) * size[u];
          p[v] = (j / steps - 0.5) * size[v];
          const inner = p.map((x, k) => Math.min(Math.max(x, -core[k]), core[k]));
          const flat = [0, 0, 0];
          flat[axis] = side;
          const n = rounding > 0 ? unit(sub(p, inner)) : flat;
          const q = rounding > 0 ? along(inner, rounding, n) : p;
          positions.push(along(center, 1, matrix.map((row) => dot(row, q))));
          normals.push(matrix.map((row) => dot(row, n)));
        }
      }
      for (let i = 0; i < steps; i++) {
        for (let j = 0; j < steps; j++) {
          const a = first + i * (steps + 1) + j, b = a + steps + 1;
          corners.push(...(side > 0 ? [a, b, b + 1, a, b + 1, a + 1] : [a, b + 1, b, a, a + 1, b + 1]));
        }
      }
    }
  }
  return solid(positions, normals, corners);
}

// Flat triangles with separate corners.
function ownShape({ points, triangles }) {
  const at = (i) => points.slice(3 * i, 3 * i + 3), positions = [], normals = [];
  for (let i = 0; i < triangles.length; i += 3) {
    const [a, b, c] = [at(triangles[i]), at(triangles[i + 1]), at(triangles[i + 2])];
    const n = unit(cross(sub(b, a), sub(c, a)));
    positions.push(a, b, c);
    normals.push(n, n, n);
  }
  return solid(positions, normals, triangles.map((_, i) => i));
}

// Triangles that share corners, as they are at the beginning; its bounds are those of all frames.
function movingShape({ points, count, triangles }) {
  const positions = numbersAt(points, count, run.begin, new Float32Array(3 * count)), corners = new Uint32Array(triangles);
  const box = [...points.low, ...points.low.map((x, k) => x + 65535 * points.step[k])];
  return { positions, normals: normalsOf(positions, corners, new Float32Array(3 * count)), corners, bounded: true, box, points };
}

// The sum of the normals of the triangles around each point, by area.
function normalsOf(x, corners, n) {
  n.fill(0);
  for (let i = 0; i < corners.length; i += 3) {
    const a = 3 * corners[i], b = 3 * corners[i + 1], c = 3 * corners[i + 2];
    const u0 = x[b] - x[a], u1 = x[b + 1] - x[a + 1], u2 = x[b + 2] - x[a + 2];
    const v0 = x[c] - x[a], v1 = x[c + 1] - x[a + 1], v2 = x[c + 2] - x[a + 2];
    const n0 = u1 * v2 - u2 * v1, n1 = u2 * v0 - u0 * v2, n2 = u0 * v1 - u1 * v0;
    for (const k of [a, b, c]) { n[k] += n0; n[k + 1] += n1; n[k + 2] += n2; }
  }
  return n;
}

function shapeOf(collider, bounds) {
  const parameters = Object.fromEntries(Object.entries(collider.parameters).map(([name, value]) => [name, value ?? 0]));
  if (collider.shape?.points.levels) return movingShape(collider.shape);
  if (collider.shape) return ownShape(collider.shape);
  return shapes[collider.type] ? shapes[collider.type](parameters, bounds) : null;
}
