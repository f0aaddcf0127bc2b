// page.js: the time, its controls, and the texts.

// It opens on the last frame, in which most runs have something to show.
const state = { time: run.end, playing: false, rate: 1, shade: 'plain', edges: false };
const dark = window.matchMedia('(prefers-color-scheme: dark)');
let player = null, plots = [], stale = true, moved = true, last = null;

function seek(time) {
  state.time = Math.min(Math.max(time, run.begin), run.end);
  stale = true;
}

function stepFrame(by) {
  const { frame, part } = frameAt(state.time);
  play(false);
  seek(run.times[Math.min(Math.max(by < 0 && part > 1e-6 ? frame : frame + by, 0), run.times.length - 1)]);
}

function play(on) {
  if (on && state.time >= run.end) state.time = run.begin;
  state.playing = on;
  stale = true;
  const button = element('play');
  button.setAttribute('aria-label', on ? 'Pause' : 'Play');
  button.querySelector('path').setAttribute('d', on ? 'M3.5 2.5h3v11h-3zM9.5 2.5h3v11h-3z' : 'M4 2.5v11l9-5.5z');
}

function shadeBy(shade) {
  state.shade = shade;
  stale = true;
  document.querySelector(`input[name=shade][value=${shade}]`).checked = true;
  const legend = element('legend');
  legend.hidden = shade === 'plain' || !player;
  if (legend.hidden) return;
  const [low, high] = player.ranges[shade], percent = shade === 'strain';
  const say = (x) => (percent ? `${format(100 * x, 3)} %` : `${format(x, 3)} m/s`);
  element('legend-name').textContent = percent ? 'largest principal strain' : 'speed';
  element('legend-low').textContent = say(low);
  element('legend-high').textContent = say(high);
}

function setEdges(on) {
  state.edges = on;
  element('edges').checked = on;
  stale = true;
}

// ---- Drawing

function show() {
  element('scrub').value = state.time;
  const { frame, next, part } = frameAt(state.time);
  const shown = part > 0.5 ? next : frame;
  element('time').textContent = `${state.time.toFixed(3)} s, frame ${run.frames.numbers[shown]} of ${run.frames.all - 1}`;
  if (player) player.show(state.time, { shade: state.shade, edges: state.edges, dark: dark.matches });
  for (const plot of plots) plot.point(state.time);
}

function tick(now) {
  if (moved) {
    const width = Math.max(280, Math.round(element('plots').clientWidth));
    for (const plot of plots) plot.render(width);
    moved = false;
    stale = true;
  }
  if (state.playing && last !== null) {
    const time = state.time + state.rate * Math.min(now - last, 250) / 1000;
    seek(time > run.end ? run.begin : time);
  }
  last = now;
  if (stale) {
    stale = false;
    show();
  }
  requestAnimationFrame(tick);
}

// ---- Texts

function lines(title, pairs) {
  const group = document.createElement('div'), head = document.createElement('h2'), list = document.createElement('dl');
  head.textContent = title;
  for (const [name, value] of pairs) {
    if (value === undefined || value === null) continue;
    const term = document.createElement('dt'), text = document.createElement('dd');
    term.textContent = name;
    text.textContent = value;
    list.append(term, text);
  }
  group.append(head, list);
  return group;
}

// Parts that add up to the whole, including the rest of the steps and the time outside steps.
function shares(wall) {
  const inner = ['residual', 'jacobian', 'factor', 'solve', 'contact'].map((name) => [name, wall[name] || 0]);
  const sum = (pairs) => pairs.reduce((total, [, x]) => total + x, 0);
  const all = [...inner, ['rest of the steps', Math.max(wall.steps - sum(inner), 0)], ['setup', wall.setup || 0], ['output', wall.output || 0]];
  all.push(['other', Math.max(wall.total - sum(all), 0)]);
  const share = (x) => `${format(x, 3)} s, ${(100 * x / (wall.total || 1)).toFixed(1)} %`;
  return [['total', `${format(wall.total, 3)} s`], ...all.filter(([, x]) => x > 0).map(([name, x]) => [name, share(x)])];
}

function summarize(s) {
  const percent = (x) => `${format(100 * x, 3)} %`;
  const numbers = (object, unit) => Object.entries(object).map(([name, value]) => [name, `${format(value)}${unit}`]);
  return [
    lines('Model', [['nodes', s.nodes], ['triangles', run.simulated_triangles], ['unknowns', s.dofs], ['nonzeros', s.nnz], ['smallest strain', percent(s.strain.min)], ['largest strain', percent(s.strain.max)]]),
    lines('Steps', [['simulated', `${format(s.time)} s`], ['accepted', s.steps.accepted], ['rejected', s.steps.rejected],
      ...Object.entries(s.steps.reasons || {}), ['unconverged', s.steps.unconverged || null], ['shortest step', `${format(s.steps.h_min, 3)} s`], ['longest step', `${format(s.steps.h_max, 3)} s`]]),
    lines('Newton', Object.entries(s.newton).map(([name, value]) => [name.replace('_', ' '), value])),
    lines('Wall time', shares(s.wall_s)),
    lines('Energy at the end', numbers(s.energy, ' J')),
    lines('Result', [['status', s.status], ['message', s.message || null], ['frames', s.frames], ['hash', s.hash], ['Drape', s.version],
      ['equilibrium', s.equilibrium && (s.equilibrium.stable ? 'stable' : `unstable, ${s.equilibrium.unstable_modes} modes`)]])];
}

function describe() {
  const s = run.summary, notes = [];
  let scene = {};
  try { scene = JSON.parse(run.scene.replace(/^\uFEFF/, '')); } catch { /* it has comments: its text is shown below */ }
  element('title').textContent = run.name;
  document.title = `${run.name}: Drape report`;
  element('description').textContent = scene.description || '';
  element('scene').textContent = run.scene;
  const status = element('status');
  status.textContent = !s ? 'not finished' : s.status === 'ok' ? 'done' : s.status.replace(/^e_/, '').replaceAll('_', ' ');
  status.classList.toggle('failed', !s || s.status !== 'ok');
  if (!s) notes.push('The run has no summary: it was killed, or is still running.');
  else if (s.message) notes.push(s.message);
  for (const warning of (s && s.warnings) || []) notes.push(`Warning: ${warning.text}.`);
  if (run.frames.numbers.length < run.frames.all) {
    notes.push(`The page has ${run.frames.numbers.length} of ${run.frames.all} frames, at equal intervals; drape report --megabytes N makes room for more.`);
  }
  if (run.steps.every > 1) notes.push(`Of ${run.steps.rows} attempts every ${run.steps.every}th accepted one and all rejected ones are plotted.`);
  const off = run.accuracy;
  if (off?.time?.text && off.hash === s?.hash) {
    element('accuracy').hidden = false;
    element('accuracy').append(lines('Accuracy', ['time', 'mesh', 'start'].map((name) => [name, off[name]?.text])));
  } else if (off) notes.push('accuracy.json is not of this run, and left out.');
  element('note').textContent = notes.join(' ');
  element('note').hidden = notes.length === 0;
  if (s) element('summary').append(...summarize(s));
  const p = run.field.positions.step, precision = Math.max(...p) / 2;
  element('footer').textContent = `Drape ${run.version}. Positions in this page are accurate to ${format(precision, 2)} m; positions.npy has all digits.`;
}

// ---- Input

function bindView(canvas) {
  let from = null;
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    from = event;
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!from || !event.buttons) return;
    const dx = event.clientX - from.clientX, dy = event.clientY - from.clientY;
    if (event.buttons & 6 || event.shiftKey) player.pan(dx, dy);
    else player.turn(dx, dy);
    from = event;
    stale = true;
  });
  canvas.addEventListener('pointerup', () => { from = null; });
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    player.zoom(Math.exp(0.0012 * event.deltaY * (event.deltaMode ? 20 : 1)));
    stale = true;
  }, { passive: false });
  canvas.addEventListener('dblclick', resetView);
}

function resetView() {
  if (player) player.resetView();
  stale = true;
}

const keys = {
  ' ': () => play(!state.playing), ArrowLeft: () => stepFrame(-1), ArrowRight: () => stepFrame(1),
  Home: () => seek(run.begin), End: () => seek(run.end), r: resetView, e: () => setEdges(!state.edges),
  1: () => shadeBy('plain'), 2: () => shadeBy('strain'), 3: () => shadeBy('speed'),
};

function bindKeysAndPlots() {
  document.addEventListener('keydown', (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key, own = event.target;
    const typing = own.matches && (own.matches('select, summary') || (key === ' ' && own.matches('button, input[type=checkbox]')));
    if (event.ctrlKey || event.metaKey || event.altKey || typing || !keys[key]) return;
    event.preventDefault();
    keys[key]();
  });
  for (const plot of plots) {
    if (!plot.image) continue;
    const follow = (event) => { if (event.buttons & 1) seek(plot.timeAt(event)); };
    plot.image.addEventListener('pointerdown', (event) => {
      plot.image.setPointerCapture(event.pointerId);
      play(false);
      follow(event);
    });
    plot.image.addEventListener('pointermove', follow);
  }
}

function bindControls() {
  const scrub = element('scrub');
  scrub.min = run.begin;
  scrub.max = run.end;
  scrub.addEventListener('input', () => {
    play(false);
    seek(Number(scrub.value));
  });
  element('play').addEventListener('click', () => play(!state.playing));
  element('reset').addEventListener('click', resetView);
  element('edges').addEventListener('change', (event) => setEdges(event.target.checked));
  element('rate').addEventListener('change', (event) => { state.rate = Number(event.target.value); });
  element('shades').addEventListener('change', (event) => shadeBy(event.target.value));
  dark.addEventListener('change', () => { stale = true; });
  window.addEventListener('hashchange', takeAddress);
  new ResizeObserver(() => { moved = true; }).observe(element('plots'));
  new ResizeObserver(() => { stale = true; }).observe(element('view'));
}

// #t=0.5&shade=strain&edges=1&play=1: a link to a time.
function takeAddress() {
  const wish = new URLSearchParams(location.hash.slice(1));
  if (wish.has('t')) seek(Number(wish.get('t')) || run.begin);
  if (['plain', 'strain', 'speed'].includes(wish.get('shade'))) shadeBy(wish.get('shade'));
  if (wish.has('edges')) setEdges(wish.get('edges') !== '0');
  if (wish.has('play')) play(wish.get('play') !== '0');
}

function start() {
  describe();
  plots = makePlots();
  element('plots').append(...plots.map((plot) => plot.figure));
  try {
    player = new Player(element('view'));
    bindView(element('view'));
  } catch (missing) {
    element('no-view').hidden = false;
    console.warn(String(missing));
  }
  element('legend').querySelector('i').style.background = colorGradient();
  bindControls();
  bindKeysAndPlots();
  takeAddress();
  requestAnimationFrame(tick);
}

start();
