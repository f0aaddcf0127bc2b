// player.js: the view: cloth, colliders and their shadows on planes, by WebGL 2.

const VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in float value;
uniform mat4 camera;
uniform vec3 offset;
uniform vec4 rotation;   // a quaternion x y z w, before the offset
uniform vec4 flatten;    // a plane n.x = d to project everything onto, along the light; n = 0: none
uniform vec3 light;
uniform float point_size;
out vec3 at, n;
out float v;
vec3 rotated(vec3 a) { return a + 2.0 * cross(rotation.xyz, cross(rotation.xyz, a) + rotation.w * a); }
void main() {
  at = rotated(position) + offset;
  if (dot(flatten.xyz, flatten.xyz) > 0.0)
    at -= light * ((dot(flatten.xyz, at) - flatten.w) / dot(flatten.xyz, light));
  n = rotated(normal);
  v = value;
  gl_Position = camera * vec4(at, 1.0);
  gl_PointSize = point_size;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 at, n;
in float v;
uniform vec3 eye, light, front, back;
uniform int kind;        // 0 lit surface, 1 surface coloured by value, 2 uniform colour, 3 round point, 4 ground
uniform float alpha;
uniform vec4 disk;       // center and reach of a ground
uniform vec2 range;
uniform sampler2D colors;
out vec4 result;         // premultiplied by alpha, over the background of the page
vec3 linear(vec3 c) { return c * c * (0.3 + 0.7 * c); }
vec3 encoded(vec3 c) { return pow(clamp(c, 0.0, 1.0), vec3(1.0 / 2.2)); }
vec4 shaded() {
  if (kind == 3) {
    float r = length(gl_PointCoord - 0.5);
    if (r > 0.5) discard;
    return vec4(r > 0.34 ? front * 0.45 : front, 1.0);
  }
  if (kind == 2) return vec4(front, alpha);
  vec3 view = normalize(eye - at), m = normalize(n);
  bool away = dot(m, view) < 0.0;
  if (away) m = -m;
  float key = max(dot(m, light), 0.0), fill = max(dot(m, normalize(vec3(-light.x, 0.3, -light.z))), 0.0);
  float sky = 0.5 + 0.5 * m.y;
  if (kind == 4) {
    float far = length(at - disk.xyz) / disk.w;
    return vec4(front, alpha * (1.0 - smoothstep(0.3, 1.0, far)));
  }
  if (kind == 1) {
    vec3 base = texture(colors, vec2(clamp((v - range.x) / max(range.y - range.x, 1e-30), 0.0, 1.0), 0.5)).rgb;
    return vec4(encoded(linear(base) * (0.58 + 0.25 * key + 0.1 * sky + 0.12 * max(dot(m, view), 0.0))), alpha);
  }
  vec3 base = linear(away ? back : front);
  vec3 h = normalize(light + view);
  float shine = 0.12 * pow(max(dot(m, h), 0.0), 40.0), edge = 0.1 * pow(1.0 - abs(dot(m, view)), 3.0);
  return vec4(encoded(base * (0.24 * sky + 0.16 + 0.8 * key + 0.3 * fill + 0.1 * max(dot(m, view), 0.0)) + shine + edge * sky), alpha);
}
void main() {
  vec4 color = shaded();
  result = vec4(color.rgb * color.a, color.a);
}`;

function multiply(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) {
    let sum = 0;
    for (let k = 0; k < 4; k++) sum += a[4 * k + r] * b[4 * c + k];
    out[4 * c + r] = sum;
  }
  return out;
}

function perspective(angle, aspect, near, far) {
  const f = 1 / Math.tan(angle / 2), m = new Float32Array(16);
  m[0] = f / aspect;
  m[5] = f;
  m[10] = (far + near) / (near - far);
  m[11] = -1;
  m[14] = 2 * far * near / (near - far);
  return m;
}

function lookAt(eye, target) {
  const z = unit(sub(eye, target)), x = unit(cross([0, 1, 0], z)), y = cross(z, x);
  return new Float32Array([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
}

// Each edge once.
function edgesOf(corners) {
  const seen = new Set(), edges = [];
  for (let i = 0; i < corners.length; i += 3) {
    for (let k = 0; k < 3; k++) {
      const a = corners[i + k], b = corners[i + (k + 1) % 3];
      const key = Math.min(a, b) * 4294967296 + Math.max(a, b);
      if (seen.has(key)) continue;
      seen.add(key);
      edges.push(a, b);
    }
  }
  return new Uint32Array(edges);
}

// The box of all frames and of the bounded colliders.
function boundsOf(lows, highs) {
  const center = lows.map((low, k) => (low + highs[k]) / 2);
  return { center, radius: Math.hypot(...sub(highs, lows)) / 2 || 1 };
}

// The lamp does not move with the camera; it is that of drape render, at elevation 54 and azimuth -16 degrees.
const LIGHT = unit([Math.tan(Math.PI / 5) * Math.sin(-0.279), 1, Math.tan(Math.PI / 5) * Math.cos(-0.279)]);

// A vector turned by a quaternion x y z w.
function rotated(q, a) {
  const once = along(cross(q, a), q[3], a);
  return along(a, 2, cross(q, once));
}

class Player {
  constructor(canvas) {
    this.gl = canvas.getContext('webgl2', { antialias: true, stencil: true, alpha: true, preserveDrawingBuffer: true });
    if (!this.gl) throw new Error('no WebGL 2');
    this.canvas = canvas;
    this.light = LIGHT;
    this.positions = new Float32Array(3 * run.nodes);
    this.normals = new Float32Array(3 * run.nodes);
    this.values = new Float32Array(run.nodes);
    this.ranges = { strain: quantiles('strain', 0, 0.998), speed: quantiles('speed', 0, 0.998) };
    const strain = this.ranges.strain;
    if (strain[0] > -1e-3 * strain[1]) strain[0] = 0;
    this.ranges.speed[0] = 0;
    this.makeProgram();
    this.cloth = this.makeMesh([[3, this.positions], [3, this.normals], [1, this.values]], run.corners);
    this.pins = this.elements(new Uint32Array(run.pinned));
    this.makeColliders();
    this.resetView();
  }

  makeProgram() {
    const gl = this.gl, program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    this.at = {};
    for (const name of ['camera', 'offset', 'rotation', 'flatten', 'light', 'point_size', 'eye', 'front', 'back', 'kind', 'alpha', 'disk', 'range']) {
      this.at[name] = gl.getUniformLocation(program, name);
    }
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, colorTable(256));
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  // Buffers by number, with the numbers of each vertex.
  makeMesh(arrays, corners) {
    const gl = this.gl, mesh = { vertices: gl.createVertexArray(), buffers: [], count: corners.length };
    gl.bindVertexArray(mesh.vertices);
    arrays.forEach(([width, data], i) => {
      mesh.buffers[i] = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[i]);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, width, gl.FLOAT, false, 0, 0);
    });
    mesh.corners = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.corners);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    return mesh;
  }

  elements(corners) {
    const gl = this.gl, buffer = gl.createBuffer();
    gl.bindVertexArray(this.cloth.vertices);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    return { vertices: this.cloth.vertices, corners: buffer, count: corners.length };
  }

  makeColliders() {
    const { low, step } = run.field.positions;
    const lows = [...low], highs = low.map((x, k) => x + 65535 * step[k]);
    const cloth = boundsOf(lows, highs);
    this.colliders = [];
    for (const collider of run.colliders) {
      const shape = shapeOf(collider, cloth);
      if (!shape) continue;
      const values = new Float32Array(shape.positions.length / 3);
      this.colliders.push({ ...this.makeMesh([[3, shape.positions], [3, shape.normals], [1, values]], shape.corners), plane: shape.plane, displacements: collider.displacements, rotations: collider.rotations, pivot: collider.pivot, moving: shape.points ? shape : null });
      const corners = shape.box ?? shape.positions;
      for (let i = 0; shape.bounded && i < corners.length; i++) {
        const reach = 1.6 * cloth.radius, k = i % 3; // of a large one only a part is shown
        lows[k] = Math.min(lows[k], Math.max(corners[i], cloth.center[k] - reach));
        highs[k] = Math.max(highs[k], Math.min(corners[i], cloth.center[k] + reach));
      }
    }
    this.bounds = boundsOf(lows, highs);
  }

  resetView() {
    this.target = [...this.bounds.center];
    this.yaw = 0.55;
    this.pitch = 0.32;
    this.distance = 2.7 * this.bounds.radius;
  }

  eye() {
    const c = Math.cos(this.pitch);
    return along(this.target, this.distance, [c * Math.sin(this.yaw), Math.sin(this.pitch), c * Math.cos(this.yaw)]);
  }

  turn(dx, dy) {
    this.yaw -= 0.008 * dx;
    this.pitch = Math.min(Math.max(this.pitch + 0.008 * dy, -1.5), 1.5);
  }

  pan(dx, dy) {
    const eye = this.eye(), z = unit(sub(eye, this.target)), x = unit(cross([0, 1, 0], z)), y = cross(z, x);
    const scale = this.distance * 0.6 / this.canvas.clientHeight;
    this.target = along(along(this.target, -dx * scale, x), dy * scale, y);
  }

  zoom(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, 0.05 * this.bounds.radius), 40 * this.bounds.radius);
  }

  load(time, shade) {
    normalsOf(fieldAt('positions', time, this.positions), run.corners, this.normals);
    if (shade !== 'plain') fieldAt(shade, time, this.values);
    this.refill(this.cloth, [this.positions, this.normals, this.values]);
    for (const collider of this.colliders) {
      if (!collider.moving) continue;
      const { positions, normals, corners, points } = collider.moving;
      normalsOf(numbersAt(points, positions.length / 3, time, positions), corners, normals);
      this.refill(collider, [positions, normals]);
    }
  }

  refill(mesh, arrays) {
    const gl = this.gl;
    arrays.forEach((data, i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[i]);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, data);
    });
  }

  place(collider, time) {
    const still = { offset: [0, 0, 0], rotation: [0, 0, 0, 1] };
    if (!collider.displacements) return still;
    const { frame, next, part } = frameAt(time), between = (list, sign) => list[frame].map((x, k) => x + part * (sign * list[next][k] - x));
    const offset = between(collider.displacements, 1);
    if (!collider.rotations) return { ...still, offset };
    const sign = dot(collider.rotations[frame], collider.rotations[next]) < 0 ? -1 : 1;
    const rotation = between(collider.rotations, sign), length = Math.hypot(...rotation);
    rotation.forEach((q, k) => { rotation[k] = q / length; });
    return { offset: along(sub(offset, rotated(rotation, collider.pivot)), 1, collider.pivot), rotation };
  }

  draw(mesh, { kind, mode = this.gl.TRIANGLES, front = [0, 0, 0], back = front, alpha = 1, offset = [0, 0, 0], rotation = [0, 0, 0, 1] }) {
    const gl = this.gl;
    gl.bindVertexArray(mesh.vertices);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.corners);
    gl.uniform1i(this.at.kind, kind);
    gl.uniform3fv(this.at.front, front);
    gl.uniform3fv(this.at.back, back);
    gl.uniform1f(this.at.alpha, alpha);
    gl.uniform3fv(this.at.offset, offset);
    gl.uniform4fv(this.at.rotation, rotation);
    gl.drawElements(mode, mesh.count, gl.UNSIGNED_INT, 0);
  }

  // Shadows: everything above a plane darkens it, each pixel once.
  drawShadow(plane, { offset, rotation }, time) {
    const gl = this.gl, n = rotated(rotation, plane.normal), d = dot(n, along(rotated(rotation, plane.point), 1, offset)) + 1e-3 * this.bounds.radius;
    if (dot(n, this.light) < 0.2) return;
    gl.uniform4f(this.at.flatten, ...n, d);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    gl.depthMask(false);
    this.draw(this.cloth, { kind: 2, alpha: 0.15 });
    for (const other of this.colliders) if (!other.plane) this.draw(other, { kind: 2, alpha: 0.15, ...this.place(other, time) });
    gl.depthMask(true);
    gl.disable(gl.STENCIL_TEST);
    gl.clear(gl.STENCIL_BUFFER_BIT);
    gl.uniform4f(this.at.flatten, 0, 0, 0, 0);
  }

  show(time, { shade, edges, dark }) {
    const gl = this.gl, canvas = this.canvas, scale = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * scale)), height = Math.max(1, Math.round(canvas.clientHeight * scale));
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    this.load(time, shade);
    const eye = this.eye(), reach = this.distance + 6 * this.bounds.radius;
    const wide = 2 * Math.atan(Math.tan(0.28) * Math.max(1, 1.2 * height / width)); // a narrow view still shows all of the cloth
    const camera = multiply(perspective(wide, width / height, 0.004 * reach, reach), lookAt(eye, this.target));
    gl.uniformMatrix4fv(this.at.camera, false, camera);
    gl.uniform3fv(this.at.eye, eye);
    gl.uniform3fv(this.at.light, this.light);
    gl.uniform4f(this.at.flatten, 0, 0, 0, 0);
    gl.uniform1f(this.at.point_size, 9 * scale);
    gl.enable(gl.BLEND);
    const grey = dark ? [0.42, 0.45, 0.5] : [0.68, 0.7, 0.73], ground = dark ? [0.25, 0.27, 0.3] : [0.8, 0.82, 0.84];
    for (const collider of this.colliders) {
      if (!collider.plane) continue;
      const placed = this.place(collider, time);
      gl.uniform4f(this.at.disk, ...along(rotated(placed.rotation, collider.plane.point), 1, placed.offset), collider.plane.reach);
      gl.depthMask(false);
      this.draw(collider, { kind: 4, front: ground, alpha: 0.9, ...placed });
      gl.depthMask(true);
      this.drawShadow(collider.plane, placed, time);
    }
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 1);
    for (const collider of this.colliders) if (!collider.plane) this.draw(collider, { kind: 0, front: grey, ...this.place(collider, time) });
    if (shade !== 'plain') gl.uniform2fv(this.at.range, this.ranges[shade]);
    this.draw(this.cloth, shade === 'plain' ? { kind: 0, front: [0.72, 0.2, 0.17], back: [0.86, 0.62, 0.4] } : { kind: 1 });
    gl.disable(gl.POLYGON_OFFSET_FILL);
    if (edges) this.edges ??= this.elements(edgesOf(run.corners)); // made when needed: a large mesh has many
    if (edges) this.draw(this.edges, { kind: 2, mode: gl.LINES, front: [0.05, 0.05, 0.08], alpha: 0.45 });
    if (this.pins.count) this.draw(this.pins, { kind: 3, mode: gl.POINTS, front: [0.1, 0.75, 0.85] });
  }
}
