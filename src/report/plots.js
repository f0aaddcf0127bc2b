// plots.js: plots over the time of the run, as SVG, with a common cursor.

const SVG = 'http://www.w3.org/2000/svg';
const HEIGHT = { tall: 190, low: 130 };
const MARGIN = { left: 62, right: 10, top: 8, bottom: 22 };

function svg(name, attributes, text) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  return node;
}

// About `count` round numbers that divide a range.
function ticksOf(low, high, count) {
  const raw = (high - low) / count || 1, size = 10 ** Math.floor(Math.log10(raw));
  const step = size * ([1, 2, 5, 10].find((k) => k * size >= raw * 0.75) || 10), ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) ticks.push(Number((k * step).toPrecision(12)));
  return ticks;
}

// Ticks of a logarithmic axis: the logarithms of the powers of ten in its range; if there are fewer than two, of a few
// numbers between them; else of its middle.
function decades(low, high) {
  const first = Math.ceil(low - 1e-9), last = Math.floor(high + 1e-9), stride = Math.max(1, Math.ceil((last - first) / 4)), ticks = [];
  for (let k = first; k <= last; k += stride) ticks.push(k);
  if (ticks.length > 1) return ticks;
  const finer = [];
  for (let k = Math.floor(low); k <= high; k++) {
    for (const digit of [1, 2, 3, 5]) finer.push(k + Math.log10(digit));
  }
  const shown = finer.filter((tick) => tick >= low && tick <= high);
  return shown.length > 1 ? shown : [(low + high) / 2];
}

// A series: {name, color, t: [], y: [], steps: y is constant from t to the next t, on, unit}. Null values are gaps.
class Plot {
  constructor({ title, unit, series, marks = [], log = false, size = 'tall', zero = false, note = '' }) {
    Object.assign(this, { title, unit, series, marks, log, size, zero });
    this.figure = document.createElement('figure');
    const caption = document.createElement('figcaption');
    caption.append(title);
    const side = document.createElement('span');
    side.textContent = note || unit;
    caption.append(side);
    this.list = document.createElement('ul');
    this.list.className = 'series';
    this.image = svg('svg', { role: 'img', 'aria-label': `${title} over time` });
    this.figure.append(caption, this.list, this.image);
    for (const one of series) this.addLegend(one);
  }

  addLegend(one) {
    const item = document.createElement('li'), button = document.createElement('button');
    button.type = 'button';
    button.textContent = one.name;
    button.style.setProperty('--color', one.color);
    one.on = one.on !== false;
    button.setAttribute('aria-pressed', one.on);
    button.addEventListener('click', () => {
      one.on = !one.on;
      button.setAttribute('aria-pressed', one.on);
      this.render(this.width);
    });
    one.output = document.createElement('output');
    item.append(button, one.output);
    this.list.append(item);
  }

  scale(value) {
    return this.log ? Math.log10(value) : value;
  }

  range() {
    let low = Infinity, high = -Infinity;
    const take = (value) => {
      if (value === null || (this.log && !(value > 0))) return;
      low = Math.min(low, this.scale(value));
      high = Math.max(high, this.scale(value));
    };
    for (const one of this.series) if (one.on) for (const value of one.y) take(value);
    for (const mark of this.marks) take(mark.y);
    if (this.zero) low = Math.min(low, 0);
    if (!(low <= high)) return [0, 1];
    const pad = high > low ? 0.05 * (high - low) : Math.abs(high) * 0.1 || (this.log ? 0.5 : 1);
    return [this.zero && low === 0 ? 0 : low - pad, high + pad];
  }

  x(time) {
    const span = run.end - run.begin || 1;
    return MARGIN.left + (time - run.begin) / span * (this.width - MARGIN.left - MARGIN.right);
  }

  y(value) {
    const height = HEIGHT[this.size] - MARGIN.top - MARGIN.bottom;
    return MARGIN.top + height * (1 - (this.scale(value) - this.low) / (this.high - this.low));
  }

  // If many points lie in one column of pixels, only the lowest and the highest are drawn.
  path(one) {
    const parts = [];
    let pen = false, column = null, least, most, last;
    const flush = () => {
      if (column === null) return;
      const points = least === most ? [last] : [least, most, last];
      for (const y of points) {
        parts.push(`${pen ? 'L' : 'M'}${column.toFixed(1)} ${this.y(y).toFixed(1)}`);
        pen = true;
      }
      column = null;
    };
    for (let i = 0; i < one.t.length; i++) {
      const y = one.y[i];
      if (y === null || (this.log && !(y > 0))) { flush(); pen = false; continue; }
      const x = Math.round(2 * this.x(one.t[i])) / 2;
      if (x !== column) {
        flush();
        if (one.steps && pen) parts.push(`H${x.toFixed(1)}`);
        column = x;
        least = most = y;
      }
      least = Math.min(least, y);
      most = Math.max(most, y);
      last = y;
    }
    flush();
    if (one.steps && pen) parts.push(`H${this.x(run.end).toFixed(1)}`);
    return parts.join('');
  }

  render(width) {
    const height = HEIGHT[this.size], image = this.image;
    this.width = width;
    [this.low, this.high] = this.range();
    image.setAttribute('viewBox', `0 0 ${width} ${height}`);
    image.replaceChildren();
    const right = width - MARGIN.right, bottom = height - MARGIN.bottom;
    const ticks = this.log ? decades(this.low, this.high) : ticksOf(this.low, this.high, height > 150 ? 5 : 3);
    for (const tick of ticks) {
      const y = this.y(this.log ? 10 ** tick : tick);
      image.append(svg('line', { class: 'grid', x1: MARGIN.left, x2: right, y1: y, y2: y }));
      image.append(svg('text', { x: MARGIN.left - 6, y: y + 4, 'text-anchor': 'end' }, format(this.log ? 10 ** tick : tick, 3)));
    }
    for (const tick of ticksOf(run.begin, run.end, Math.max(3, Math.floor(width / 110)))) {
      const x = this.x(tick);
      image.append(svg('line', { class: 'axis', x1: x, x2: x, y1: bottom, y2: bottom + 4 }));
      image.append(svg('text', { x: Math.min(x, right - 8), y: bottom + 16, 'text-anchor': 'middle' }, format(tick, 3)));
    }
    image.append(svg('text', { x: MARGIN.left - 6, y: bottom + 16, 'text-anchor': 'end' }, 't [s]'));
    image.append(svg('line', { class: 'axis', x1: MARGIN.left, x2: right, y1: bottom, y2: bottom }));
    for (const one of this.series) if (one.on) image.append(svg('path', { class: 'curve', d: this.path(one), style: `stroke: ${one.color}` }));
    let crosses = '';
    for (const mark of this.marks) {
      if (this.log && !(mark.y > 0)) continue;
      const x = this.x(mark.t), y = this.y(mark.y);
      crosses += `M${(x - 3).toFixed(1)} ${(y - 3).toFixed(1)}l6 6m-6 0l6 -6`;
    }
    if (crosses) image.append(svg('path', { class: 'rejected', d: crosses }));
    this.cursor = svg('line', { class: 'cursor', y1: MARGIN.top, y2: bottom });
    image.append(this.cursor);
    this.point(this.time ?? run.begin);
  }

  // Moves the cursor and shows the values there.
  point(time) {
    this.time = time;
    if (!this.cursor) return;
    const x = this.x(Math.min(Math.max(time, run.begin), run.end));
    this.cursor.setAttribute('x1', x);
    this.cursor.setAttribute('x2', x);
    for (const one of this.series) one.output.textContent = `${format(valueAt(one, time))} ${this.unit}`.trim();
  }

  timeAt(event) {
    const box = this.image.getBoundingClientRect(), x = (event.clientX - box.left) / box.width * this.width;
    const part = (x - MARGIN.left) / (this.width - MARGIN.left - MARGIN.right);
    return run.begin + Math.min(Math.max(part, 0), 1) * (run.end - run.begin);
  }
}

function valueAt({ t, y, steps }, time) {
  if (t.length === 0) return null;
  const low = lastOf(t, time);
  if (steps || low + 1 >= t.length || y[low] === null || y[low + 1] === null || time <= t[low]) return y[low];
  return y[low] + (y[low + 1] - y[low]) * (time - t[low]) / (t[low + 1] - t[low]);
}

// ---- The plots of a run

// At the times of the states.
function energyPlot() {
  const c = run.energies.columns;
  const change = (values) => values.map((x) => (x === null || values[0] === null ? null : x - values[0]));
  const series = [
    ['kinetic', c.kinetic], ['elastic', c.elastic], ['gravity (change)', change(c.gravity)], ['contact', c.contact],
    ['dissipated', c.dissipated], ['numerical', c.numerical], ['total (change)', change(c.total)]]
    .map(([name, y], i) => ({ name, y, t: c.t_state, color: `var(--c${i})` }))
    .filter(({ y }) => y.some((x) => x));
  return new Plot({ title: 'Energy', unit: 'J', series });
}

// The columns after those of the energies.
function workPlot() {
  const c = run.energies.columns;
  const series = Object.keys(c).slice(8).map((name, i) => ({ name, y: c[name], t: c.t_state, color: `var(--c${i % 7})` }));
  return series.length ? new Plot({ title: 'Work on the cloth', unit: 'J', series, size: 'low' }) : null;
}

function stepPlot({ c, good, bad }) {
  const series = [{ name: 'accepted', color: 'var(--c1)', steps: true, t: good.map((i) => c.t[i]), y: good.map((i) => c.h[i]) }];
  const marks = bad.map((i) => ({ t: c.t[i], y: c.h[i] }));
  return new Plot({ title: 'Step size', unit: 's', series, marks, log: true, size: 'low', note: bad.length ? 's, crosses: rejected' : 's' });
}

function iterationPlot({ c, good, bad }) {
  const explicit = run.summary && run.summary.newton && run.summary.newton.factorizations === 0;
  if (explicit || !c.iterations.some((x) => x > 0)) return null;
  const series = [{ name: 'iterations of an accepted step', color: 'var(--c4)', steps: true, t: good.map((i) => c.t[i]), y: good.map((i) => c.iterations[i]) }];
  const marks = bad.map((i) => ({ t: c.t[i], y: c.iterations[i] }));
  return new Plot({ title: 'Newton iterations', unit: '', series, marks, size: 'low', zero: true, note: bad.length ? 'crosses: rejected' : 'none rejected' });
}

function rejectionPlot({ c, bad }) {
  const reasons = [...new Set(bad.map((i) => c.reason[i]))];
  const series = reasons.map((reason, k) => {
    const mine = bad.filter((i) => c.reason[i] === reason);
    return { name: reason, color: `var(--c${k % 7})`, steps: true, t: [run.begin, ...mine.map((i) => c.t[i])], y: [0, ...mine.map((_, n) => n + 1)] };
  });
  if (series.length) return new Plot({ title: 'Rejected attempts so far', unit: '', series, size: 'low', zero: true, note: 'by reason' });
  const figure = document.createElement('figure');
  figure.innerHTML = '<figcaption>Rejected attempts</figcaption><p class="nothing">None was rejected.</p>';
  return { figure, render() {}, point() {} };
}

function makePlots() {
  const c = run.steps.columns, good = [], bad = [], all = { c, good, bad };
  for (let i = 0; i < c.t.length; i++) (c.accepted[i] ? good : bad).push(i);
  return [energyPlot(), workPlot(), stepPlot(all), iterationPlot(all), rejectionPlot(all)].filter((plot) => plot);
}
