// run.js: the data of the page: JSON, and little-endian arrays in base64.

const element = (id) => document.getElementById(id);

function bytesOf(id) {
  const text = atob(element(id).textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

const run = JSON.parse(element('run').textContent);
run.corners = new Uint32Array(bytesOf('triangles'));
run.times = run.frames.times;
run.field = {};
for (const field of run.fields) {
  run.field[field.name] = { ...field, levels: new Uint16Array(bytesOf(field.name)), width: field.low.length };
}
for (const { shape } of run.colliders) {
  if (shape?.block) shape.points = { levels: new Uint16Array(bytesOf(shape.block)), low: shape.low, step: shape.step, width: 3 };
}
run.end = run.times[run.times.length - 1];
run.begin = run.times[0];

// The last of increasing times that is at or before a time; 0 if none is.
function lastOf(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle - 1;
  }
  return low;
}

// The kept frame at or before a time, and the share of the interval to the next one.
function frameAt(time) {
  const times = run.times, low = lastOf(times, time);
  const next = Math.min(low + 1, times.length - 1);
  const span = times[next] - times[low];
  return { frame: low, next, part: span > 0 ? Math.min(Math.max((time - times[low]) / span, 0), 1) : 0 };
}

// Writes the numbers of all nodes, or points of a collider, at a time into an array, linear between two frames.
function numbersAt({ levels, low, step, width }, count, time, out) {
  const { frame, next, part } = frameAt(time);
  const size = count * width, from = frame * size, to = next * size;
  for (let i = 0; i < size; i++) {
    const a = levels[from + i];
    out[i] = low[i % width] + step[i % width] * (a + part * (levels[to + i] - a));
  }
  return out;
}

function fieldAt(name, time, out) {
  return numbersAt(run.field[name], run.nodes, time, out);
}

// The quantiles a and b of all numbers of a field, for a colour scale that single nodes do not distort.
function quantiles(name, a, b) {
  const { levels, low, step } = run.field[name];
  const counts = new Uint32Array(65536), stride = Math.max(1, Math.floor(levels.length / 2e6));
  let total = 0;
  for (let i = 0; i < levels.length; i += stride, total++) counts[levels[i]]++;
  const at = (share) => {
    let level = 0;
    for (let seen = counts[0]; seen < share * total && level < 65535; seen += counts[level]) level++;
    return low[0] + step[0] * level;
  };
  return [at(a), at(b)];
}

function format(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return 'none';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) return value.toExponential(digits - 2).replace('e+', 'e');
  return String(Number(value.toPrecision(digits)));
}
