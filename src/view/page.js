'use strict';
(() => {
const byId = (id) => document.getElementById(id);
const kWindow_s = 20, kTrackMax = 4000, kCurveMax = 600, kMarksMax = 20;

// ---- what is known -------------------------------------------------------------------------------------------
const fresh = () => ({status: null, mounting: '', navigation: null, odometry: null, track: [], imus: new Map(), marks: [], time_s: 0});
let known = fresh();
let picture = -1, socket = null, heardAt = 0, silent_s = null, play = null, chosen = null;
let expectedRows = null;
// Counted for whoever looks after the page: rows taken, rows that should have come and did not, whole pictures.
const counts = {rows: 0, missed: 0, wholes: 0, parts: 0, lost: 0, leftOut: 0, bytes: 0, connections: 0};

const imuOf = (name) => {
  if (!known.imus.has(name))
    known.imus.set(name, {calibration: null, curve: [], errors: [], last_s: -Infinity, regime: '', validity: 0, variances: null, models: null});
  return known.imus.get(name);
};

const kStride = 13; // time, then the least and the most of six axes

// Rows of one message become one stroke of the scrolling signal: the least and the most of each axis. At 100 Hz
// a pixel holds several samples; none is passed over.
function takeRows(imu, rows) {
  const kRow = 7, kStroke_s = 0.05;
  for (let i = 0; i + kRow <= rows.length; i += kRow) {
    ++counts.rows;
    const t = rows[i];
    if (t === null || t <= imu.last_s) continue;
    imu.last_s = t;
    const at = imu.errors.length - kStride;
    const joins = at >= 0 && imu.open_s !== undefined && t < imu.open_s + kStroke_s;
    if (!joins) {
      imu.open_s = t;
      imu.errors.push(t);
      for (let k = 1; k < kRow; ++k) imu.errors.push(rows[i + k], rows[i + k]);
    } else {
      imu.errors[at] = t;
      for (let k = 1; k < kRow; ++k) {
        const v = rows[i + k], least = at + 2 * k - 1;
        if (v === null) continue;
        if (imu.errors[least] === null || v < imu.errors[least]) imu.errors[least] = v;
        if (imu.errors[least + 1] === null || v > imu.errors[least + 1]) imu.errors[least + 1] = v;
      }
    }
  }
  const oldest = imu.last_s - kWindow_s - 1;
  let gone = 0;
  while (gone < imu.errors.length && imu.errors[gone] < oldest) gone += kStride;
  if (gone > 0) imu.errors.splice(0, gone);
}

const thin = (list, stride, most) => {
  if (list.length <= stride * most) return list;
  const kept = [];
  for (let i = 0; i < list.length; i += 2 * stride) kept.push(...list.slice(i, i + stride));
  return kept;
};

const largest = (three) => three.some((v) => v === null) ? null : Math.max(...three);

function take(message) {
  const whole = message.kind === 'whole';
  heardAt = performance.now();
  if (whole) {
    ++counts.wholes;
    picture = message.picture;
    known = fresh();
    expectedRows = null;
  } else {
    ++counts.parts;
    if (message.picture !== picture) return;
  }
  known.time_s = message.time_s ?? known.time_s;
  counts.lost = message.messages_lost;
  counts.leftOut = message.rows_left_out;
  if (message.silent_s !== undefined) silent_s = message.silent_s;
  if (message.play) play = message.play;
  if (message.status) known.status = message.status;
  if (message.odometry) known.odometry = message.odometry;
  if (message.mounting !== undefined) known.mounting = message.mounting;
  if (message.navigation) known.navigation = message.navigation;
  if (message.track) known.track = thin(known.track.concat(message.track), 2, kTrackMax);
  for (const [name, news] of Object.entries(message.imus ?? {})) {
    const imu = imuOf(name);
    if (news.convergence) imu.curve = news.convergence;
    if (news.calibration) {
      imu.calibration = news.calibration;
      const c = news.calibration;
      if (!whole && c.time_s !== null) {
        // The curve grows by one point a second: ten would only be thinned away.
        if (imu.curve.length < 4 || c.time_s - imu.curve[imu.curve.length - 4] >= 1)
          imu.curve = thin(imu.curve.concat([c.time_s, largest(c.sd_psi_deg), largest(c.sd_r_m), c.sd_t_d_ms]), 4, kCurveMax);
      }
    }
    if (news.variances) imu.variances = news.variances;
    if (news.models) imu.models = news.models;
  }
  const before = counts.rows;
  for (const [name, news] of Object.entries(message.errors ?? {})) {
    const imu = imuOf(name);
    imu.regime = news.regime;
    imu.validity = news.validity;
    if (news.past) {
      imu.errors = news.past;
      imu.last_s = news.past.length ? news.past[news.past.length - kStride] : -Infinity;
    }
    if (news.rows) takeRows(imu, news.rows);
  }
  if (!whole) {
    if (expectedRows !== null) counts.missed += message.rows - expectedRows - (counts.rows - before);
    expectedRows = message.rows;
  }
  if (message.marks) known.marks = known.marks.concat(message.marks).slice(-kMarksMax);
  dirty = true;
}

// ---- words ---------------------------------------------------------------------------------------------------
const kUnknown = '–';
const number = (v, decimals) => v === null || v === undefined ? kUnknown : v.toFixed(decimals);
const brief = (v) => {
  if (v === null || v === undefined) return kUnknown;
  const a = Math.abs(v);
  return a !== 0 && (a < 1e-3 || a >= 1e5) ? v.toExponential(2) : String(Number(v.toPrecision(3)));
};
const micro = (us) => us === null || us === undefined ? kUnknown : us < 1000 ? us.toFixed(0) + ' µs' : (us / 1000).toFixed(1) + ' ms';
const clock = (s) => {
  const t = Math.max(0, Math.floor(s));
  const two = (n) => String(n).padStart(2, '0');
  return (t >= 3600 ? Math.floor(t / 3600) + ':' : '') + two(Math.floor(t / 60) % 60) + ':' + two(t % 60);
};
const three = (list, factor, decimals) => list.map((v) => v === null ? kUnknown : (v * factor >= 0 ? '+' : '') + (v * factor).toFixed(decimals)).join(' ');

// ---- elements: made once, and changed only where their text did ------------------------------------------------
const element = (tag, className, text) => {
  const e = document.createElement(tag);
  if (className) e.className = className;
  if (text !== undefined) e.textContent = text;
  return e;
};
const say = (e, text) => { if (e.textContent !== text) e.textContent = text; };
const dress = (e, className) => { if (e.className !== className) e.className = className; };

// Children of `parent`, one for each key, in that order; `make` makes one that is new.
function children(parent, keys, make) {
  const wanted = new Set(keys);
  for (const child of [...parent.children]) if (!wanted.has(child.dataset.key)) child.remove();
  const there = new Map([...parent.children].map((child) => [child.dataset.key, child]));
  keys.forEach((key, i) => {
    let child = there.get(key);
    if (!child) {
      child = make(key);
      child.dataset.key = key;
      there.set(key, child);
    }
    if (parent.children[i] !== child) parent.insertBefore(child, parent.children[i] ?? null);
  });
  return keys.map((key) => there.get(key));
}

function figures(tile, list) {
  tile.cells ??= new Map();
  let dl = tile.querySelector('dl');
  if (!dl) tile.append(dl = element('dl', 'figures'));
  for (const [field, label, text, fine] of list) {
    let dd = tile.cells.get(field);
    if (!dd) {
      dd = element('dd');
      dd.dataset.field = field;
      const dt = element('dt', fine ? 'fine' : '', label);
      dd.className = dt.className;
      dl.append(dt, dd);
      tile.cells.set(field, dd);
    }
    say(dd, text);
  }
}

// ---- sections --------------------------------------------------------------------------------------------------
const kStates = {running: 'yes', recorded: 'yes', starting: 'partly', aligning: 'partly', degraded: 'partly', failed: 'no'};

function showHead() {
  const s = known.status;
  const offline = !socket || socket.readyState !== 1;
  const quiet_s = play ? 0 : silent_s === null ? null : silent_s + (performance.now() - heardAt) / 1000;
  let state = s ? s.state : 'no service heard', reason = s ? s.reason : '', dressed = s ? kStates[s.state] ?? '' : 'partly';
  if (offline) {
    state = 'page offline'; dressed = 'no';
    reason = '`imuscope view` does not answer; trying again. What follows is old.';
  } else if (!play && !s && quiet_s === null) {
    reason = 'Is `imuscope run` running, and on the same LCM bus?';
  } else if (quiet_s !== null && quiet_s > 3) {
    state = 'silent for ' + clock(quiet_s); dressed = 'no';
    reason = 'The service says nothing. What follows is old.';
  }
  say(byId('run'), s && s.run ? s.run : 'imuscope');
  say(byId('state'), state);
  dress(byId('state'), 'pill ' + dressed);
  say(byId('reason'), reason + (s && !offline ? '  ·  up ' + clock(s.uptime_s ?? 0) : ''));
  if (s) {
    say(byId('machine'), 'memory ' + number(s.resident_memory_mb, 0) + ' MB  ·  refits ' + s.refits +
      (s.refit_duration_s !== null ? ' (last ' + (s.refit_duration_s * 1000).toFixed(0) + ' ms)' : '') + '  ·  ' +
      (s.capture_path ? 'recorded ' + (s.capture_bytes / 1e6).toFixed(1) + ' MB, lost ' + s.capture_lost : 'not recording') +
      '  ·  rings refused ' + s.rings.reduce((n, r) => n + r.refused, 0) + '  ·  UTC by ' + (s.utc_source || kUnknown));
    say(byId('about'), 'imuscope ' + s.version + '  ·  configuration ' + s.configuration_hash.slice(0, 12) +
      '  ·  data messages lost on the way here ' + counts.lost);
  }
}

function showAlarms() {
  const alarms = known.status ? known.status.alarms : [];
  listAlarms(byId('alarms'), alarms.filter((a) => a.active));
  const over = alarms.filter((a) => !a.active);
  listAlarms(byId('over'), over);
  byId('past').hidden = over.length + known.marks.length === 0;
}

function listAlarms(place, alarms) {
  const keys = alarms.map((a, i) => a.kind + '|' + a.subject + '|' + i);
  const shown = children(place, keys, () => {
    const e = element('div', 'alarm');
    e.append(element('div'), element('div', 'quiet'));
    return e;
  });
  alarms.forEach((a, i) => {
    dress(shown[i], a.active ? 'alarm now' : 'alarm');
    say(shown[i].children[0], (a.active ? '' : 'over: ') + a.what + ' (' + (a.active ? 'for ' : 'lasted ') + clock(a.lasted_s ?? 0) +
      (a.times > 1 ? ', ' + a.times + ' times' : '') + ')');
    say(shown[i].children[1], a.active ? a.remedy : '');
  });
}

function showDevices() {
  const devices = known.status ? known.status.devices : [];
  const tiles = children(byId('devices'), devices.map((d) => d.name), (name) => {
    const tile = element('div', 'tile'), head = element('div', 'head');
    head.append(element('h3', '', name), element('span', 'quiet'));
    const rate = element('div', 'head');
    rate.append(element('div', 'big'), element('span'));
    rate.children[0].dataset.field = 'rate';
    rate.children[1].dataset.field = 'state';
    tile.append(head, rate);
    // On a phone the fine figures wait for a tap.
    tile.addEventListener('click', () => tile.classList.toggle('open'));
    return tile;
  });
  devices.forEach((d, i) => {
    const tile = tiles[i];
    const streams = d.state === 'streaming' || d.state === 'recorded';
    dress(tile, 'tile ' + (tile.classList.contains('open') ? 'open ' : '') + (d.state === 'failed' ? 'no' : !streams ? 'partly' : d.problem ? 'partly' : 'yes'));
    say(tile.querySelector('.head span'), d.role + ' · ' + d.protocol);
    say(tile.children[1].children[0], streams ? number(d.rate_hz, 1) + ' Hz' : kUnknown);
    say(tile.children[1].children[1], d.state);
    figures(tile, [
      ['age', 'newest', d.data_age_s === null ? kUnknown : d.data_age_s.toFixed(1) + ' s ago'],
      ['latency', 'latency', d.latency_ms === null ? kUnknown : number(d.latency_ms, 1) + ' ms'],
      ['lost', 'lost', String(d.samples_lost)],
      ['samples', 'samples', String(d.samples), true],
      ['late', 'late', String(d.samples_late), true],
      ['refused', 'refused', String(d.samples_refused + d.frames_dropped), true],
      ['clock', 'clock', d.clock_drift_ppm === null ? kUnknown : number(d.clock_drift_ppm, 1) + ' ppm ± ' + number(d.clock_sd_us, 0) + ' µs', true]]);
    let problem = tile.querySelector('p');
    if (d.problem && !problem) tile.append(problem = element('p'));
    if (problem) say(problem, d.problem);
  });
}

// Of C_b_s, as configurations write a mounting.
function rotationVector_deg(q) {
  if (q.some((v) => v === null)) return [null, null, null];
  const sign = q[0] < 0 ? -1 : 1, sine = Math.hypot(q[1], q[2], q[3]);
  const angle = 2 * Math.atan2(sine, sign * q[0]), scale = sine > 0 ? sign * angle / sine : 2;
  return [q[1], q[2], q[3]].map((v) => v * scale * 180 / Math.PI);
}

// Boresight, lever arm, time offset: each with its unit for people.
const kGoals = [
  {key: 'psi', label: 'boresight', unit: 'mdeg', factor: 1000, sd: (c) => largest(c.sd_psi_deg), goal: (c) => c.goal_psi_deg,
    value: (c) => three(rotationVector_deg(c.q), 1, 3) + ' deg'},
  {key: 'r', label: 'lever arm', unit: 'mm', factor: 1000, sd: (c) => largest(c.sd_r_m), goal: (c) => c.goal_r_m,
    value: (c) => three(c.r_m, 1000, 1) + ' mm'},
  {key: 't', label: 'time offset', unit: 'µs', factor: 1000, sd: (c) => c.sd_t_d_ms, goal: (c) => c.goal_t_d_ms,
    value: (c) => (c.t_d_ms === null ? kUnknown : (c.t_d_ms >= 0 ? '+' : '') + c.t_d_ms.toFixed(3)) + ' ms'}];
const kValidities = ['usable', 'converging', '', 'contradicted', 'stale'];

function goalRow(goal) {
  const row = element('div', 'goal');
  row.dataset.key = goal.key;
  const head = element('div', 'row'), bar = element('div', 'bar');
  head.append(element('span', '', goal.label), element('span'));
  bar.append(element('div', 'fill'));
  row.append(head, bar, element('div', 'values'));
  row.children[0].children[1].dataset.field = goal.key + '.sd';
  row.children[2].dataset.field = goal.key + '.value';
  return row;
}

function showCalibration() {
  const studies = new Map((known.status ? known.status.studies : []).map((s) => [s.name, s]));
  const names = [...new Set([...studies.keys(), ...known.imus.keys()])].sort();
  const tiles = children(byId('calibration'), names, (name) => {
    const tile = element('div', 'tile'), head = element('div', 'head');
    head.append(element('h3', '', name), element('span', 'quiet'));
    tile.append(head);
    for (const goal of kGoals) tile.append(goalRow(goal));
    tile.append(element('canvas', 'small'), element('p', 'manoeuvre'));
    return tile;
  });
  names.forEach((name, i) => {
    const tile = tiles[i], study = studies.get(name), imu = known.imus.get(name), c = imu ? imu.calibration : null;
    const state = study ? study.state : c ? kValidities[c.validity] ?? '' : 'not begun';
    const reached = c && kGoals.every((g) => g.sd(c) !== null && g.sd(c) <= g.goal(c));
    dress(tile, 'tile ' + (reached ? 'yes' : c && c.validity === 3 ? 'no' : 'partly'));
    say(tile.querySelector('.head span'), [state, imu ? imu.regime : ''].filter(Boolean).join(' · '));
    kGoals.forEach((g, k) => {
      const row = tile.children[1 + k], sd = c ? g.sd(c) : null, target = c ? g.goal(c) : null;
      say(row.children[0].children[1], sd === null ? kUnknown : brief(sd * g.factor) + ' / ' + brief(target * g.factor) + ' ' + g.unit);
      const fill = row.children[1].children[0];
      // Full at the goal; empty at a thousand times it.
      const share = sd > 0 && target > 0 ? Math.min(1, Math.max(0, 1 - Math.log10(sd / target) / 3)) : 0;
      fill.style.width = (100 * share).toFixed(1) + '%';
      dress(fill, share >= 1 ? 'fill reached' : 'fill');
      say(row.children[2], c ? g.value(c) : kUnknown);
    });
    const advice = study && study.manoeuvre ? study.manoeuvre : c ? c.advice : '';
    const p = tile.querySelector('.manoeuvre');
    p.dataset.field = 'manoeuvre';
    say(p, reached ? 'known' : advice ? 'Missing: ' + advice : '');
    if (imu) drawConvergence(tile.querySelector('canvas'), imu);
  });
}

// The drawing is markup of the program's own. Parsed apart: nothing in it runs.
let drawnMounting = null;
function showMounting() {
  const drawing = known.mounting;
  byId('mounting-section').hidden = drawing === '';
  if (drawing === drawnMounting) return;
  drawnMounting = drawing;
  byId('mounting').replaceChildren(...new DOMParser().parseFromString(drawing, 'text/html').body.childNodes);
}

function showThreads() {
  const threads = known.status ? known.status.threads : [];
  byId('deadlines').hidden = known.status !== null && threads.length === 0;
  const rows = children(byId('threads'), threads.map((t, i) => t.name + '|' + i), () => {
    const row = element('tr');
    for (let i = 0; i < 9; ++i) row.append(element('td'));
    return row;
  });
  threads.forEach((t, i) => {
    const texts = [t.name, number(t.cpu_percent, 1), String(t.ticks), String(t.skipped), String(t.overruns), micro(t.lateness_p50_us),
      micro(t.lateness_p99_us), micro(t.lateness_max_us), micro(t.done_p99_us)];
    texts.forEach((text, k) => say(rows[i].children[k], text));
  });
}

function showMarks() {
  const marks = known.marks.slice().reverse();
  const rows = children(byId('marks'), marks.map((m, i) => String(marks.length - i)), () => element('p'));
  marks.forEach((m, i) => say(rows[i], clock(m.time_s) + '  ' + m.text));
}

function showPosition() {
  const n = known.navigation;
  if (!n) return;
  const speed = n.v_n_mps === null || n.v_e_mps === null ? null : Math.hypot(n.v_n_mps, n.v_e_mps);
  const validity = ['', '', 'without GNSS · ', 'GNSS contradicts the motion · ', 'stale · '][n.validity] ?? '';
  say(byId('position'), validity + number(n.lat_deg, 6) + ' ' + number(n.lon_deg, 6) + ' ± ' + brief(Math.max(n.sd_n_m, n.sd_e_m)) + ' m  ·  ' +
    number(speed === null ? null : speed * 3.6, 1) + ' km/h  ·  heading ' + number(n.heading_deg, 1) + '°' +
    (known.odometry ? '  ·  wheels ' + number(known.odometry.speed_mps, 2) + ' m/s' : ''));
}

function showPlayer() {
  byId('player').hidden = !play;
  byId('mark').hidden = byId('mark-text').hidden = !!play;
  if (!play) return;
  const slider = byId('slider');
  slider.max = play.length_s;
  if (!sliding) slider.value = play.time_s;
  say(byId('play'), play.playing ? 'Pause' : 'Play');
  const speed = byId('speed');
  if (document.activeElement !== speed) speed.value = String(play.speed);
  say(byId('clock'), clock(sliding ? slider.value : play.time_s) + ' / ' + clock(play.length_s));
}

// ---- figures -----------------------------------------------------------------------------------------------------
let colours = {};
const readColours = () => {
  const style = getComputedStyle(document.documentElement);
  for (const name of ['ground', 'text', 'quiet', 'line', 'panel', 'yes', 'partly', 'no', 'x', 'y', 'z', 'neutral']) colours[name] = style.getPropertyValue('--' + name).trim();
};

// A canvas as large as its place, cleared, in CSS pixels.
function begin(canvas) {
  const ratio = Math.min(2, window.devicePixelRatio || 1), w = canvas.clientWidth, h = canvas.clientHeight;
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
    canvas.width = Math.round(w * ratio);
    canvas.height = Math.round(h * ratio);
  }
  const g = canvas.getContext('2d');
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, w, h);
  g.font = '12px system-ui, "DejaVu Sans", sans-serif';
  g.lineJoin = 'round';
  return {g, w, h};
}

const niceStep = (range, n) => {
  const raw = range / n, power = 10 ** Math.floor(Math.log10(raw)), share = raw / power;
  return (share < 1.5 ? 1 : share < 3.5 ? 2 : share < 7.5 ? 5 : 10) * power;
};

function drawSignal(canvas, imu, first, factor, title, unit) {
  const {g, w, h} = begin(canvas);
  const left = 52, right = w - 6, top = 18, bottom = h - 6;
  g.fillStyle = colours.quiet;
  g.textBaseline = 'top';
  g.fillText(title + ', ' + unit, left, 2);
  ['x', 'y', 'z'].forEach((axis, k) => {
    g.fillStyle = colours[axis];
    g.fillText(axis, right - 60 + 20 * k, 2);
  });
  if (!imu || imu.errors.length === 0) return;
  const to = imu.last_s, from = to - kWindow_s, e = imu.errors;
  let least = Infinity, most = -Infinity;
  for (let i = 0; i < e.length; i += kStride) {
    if (e[i] < from) continue;
    for (let k = 0; k < 3; ++k) {
      const a = e[i + 1 + 2 * (first + k)], b = e[i + 2 + 2 * (first + k)];
      if (a !== null && a < least) least = a;
      if (b !== null && b > most) most = b;
    }
  }
  if (!(most >= least)) return;
  const pad = 0.08 * (most - least) || 1e-9;
  least = (least - pad) * factor;
  most = (most + pad) * factor;
  const x = (t) => left + (t - from) / kWindow_s * (right - left), y = (v) => bottom - (v - least) / (most - least) * (bottom - top);
  const step = niceStep(most - least, 4);
  g.strokeStyle = colours.line;
  g.fillStyle = colours.quiet;
  g.textBaseline = 'middle';
  g.textAlign = 'right';
  g.lineWidth = 1;
  for (let v = Math.ceil(least / step) * step; v <= most; v += step) {
    g.beginPath();
    g.moveTo(left, y(v));
    g.lineTo(right, y(v));
    g.stroke();
    g.fillText(brief(Math.abs(v) < step / 1000 ? 0 : v), left - 5, y(v));
  }
  g.textAlign = 'left';
  g.lineWidth = 1.4;
  ['x', 'y', 'z'].forEach((axis, k) => {
    g.strokeStyle = colours[axis];
    g.beginPath();
    let before = null;
    for (let i = 0; i < e.length; i += kStride) {
      const a = e[i + 1 + 2 * (first + k)], b = e[i + 2 + 2 * (first + k)];
      if (e[i] < from || a === null) { before = null; continue; }
      const at = x(e[i]);
      if (before === null || e[i] - before > 0.3) g.moveTo(at, y(a * factor)); else g.lineTo(at, y(a * factor));
      g.lineTo(at, y(b * factor));
      before = e[i];
    }
    g.stroke();
  });
}

function drawTrack() {
  const {g, w, h} = begin(byId('track'));
  const p = known.track, n = known.navigation;
  if (p.length < 2) return;
  let minE = Infinity, maxE = -Infinity, minN = Infinity, maxN = -Infinity;
  for (let i = 0; i < p.length; i += 2) {
    minE = Math.min(minE, p[i]); maxE = Math.max(maxE, p[i]);
    minN = Math.min(minN, p[i + 1]); maxN = Math.max(maxN, p[i + 1]);
  }
  const scale = Math.min((w - 40) / Math.max(maxE - minE, 10), (h - 60) / Math.max(maxN - minN, 10));
  const x = (e) => w / 2 + (e - (minE + maxE) / 2) * scale, y = (north) => h / 2 - 8 - (north - (minN + maxN) / 2) * scale;
  g.strokeStyle = colours.x;
  g.lineWidth = 2.2;
  g.beginPath();
  for (let i = 0; i < p.length; i += 2) g.lineTo(x(p[i]), y(p[i + 1]));
  g.stroke();
  // Where it is, and where it looks.
  const e = x(p[p.length - 2]), north = y(p[p.length - 1]), heading = (n && n.heading_deg !== null ? n.heading_deg : 0) * Math.PI / 180;
  g.save();
  g.translate(e, north);
  g.rotate(heading);
  g.fillStyle = n && n.validity !== 0 ? colours.no : colours.text;
  g.beginPath();
  g.moveTo(0, -12);
  g.lineTo(7, 8);
  g.lineTo(0, 4);
  g.lineTo(-7, 8);
  g.fill();
  g.restore();
  const length = niceStep((w - 40) / scale, 4), pixels = length * scale;
  g.strokeStyle = g.fillStyle = colours.text;
  g.lineWidth = 2;
  g.beginPath();
  g.moveTo(14, h - 14);
  g.lineTo(14 + pixels, h - 14);
  g.stroke();
  g.textBaseline = 'bottom';
  g.textAlign = 'left';
  g.fillText(length >= 1000 ? length / 1000 + ' km' : length + ' m', 14, h - 18);
  g.textAlign = 'right';
  g.fillText('N ↑', w - 12, h - 12);
}

function drawConvergence(canvas, imu) {
  const {g, w, h} = begin(canvas);
  const c = imu.curve, calibration = imu.calibration;
  if (c.length < 8 || !calibration) return;
  const goals = kGoals.map((goal) => goal.goal(calibration));
  const from = c[0], to = c[c.length - 4];
  if (!(to > from)) return;
  // Decades above the goal: 3 on top, half of one below it at the bottom.
  const kTop = 3, kBottom = -0.5;
  const x = (t) => (t - from) / (to - from) * (w - 2), y = (d) => (kTop - Math.min(kTop, Math.max(kBottom, d))) / (kTop - kBottom) * h;
  g.strokeStyle = colours.text;
  g.setLineDash([4, 4]);
  g.lineWidth = 1;
  g.beginPath();
  g.moveTo(0, y(0));
  g.lineTo(w, y(0));
  g.stroke();
  g.setLineDash([]);
  ['x', 'y', 'z'].forEach((colour, k) => {
    g.strokeStyle = colours[colour];
    g.lineWidth = 1.8;
    g.beginPath();
    let down = false;
    for (let i = 0; i < c.length; i += 4) {
      const sd = c[i + 1 + k];
      if (!(sd > 0) || !(goals[k] > 0)) { down = false; continue; }
      const at = y(Math.log10(sd / goals[k]));
      if (down) g.lineTo(x(c[i]), at); else g.moveTo(x(c[i]), at);
      down = true;
    }
    g.stroke();
    g.fillStyle = colours[colour];
    g.textBaseline = 'top';
    g.fillText(['boresight', 'lever arm', 'time'][k], w - 176 + 62 * k, 0);
  });
  g.fillStyle = colours.quiet;
  g.textBaseline = 'bottom';
  g.fillText('goal', 2, y(0) - 1);
}

const kAxes = ['gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z'];

function drawWavelet(canvas, variances, models) {
  const {g, w, h} = begin(canvas);
  const left = 46, right = w - 8, top = 6, bottom = h - 22;
  let minT = Infinity, maxT = -Infinity, minV = Infinity, maxV = -Infinity;
  for (const v of variances) {
    v.tau_s.forEach((tau, i) => {
      if (!(tau > 0) || !(v.value[i] > 0)) return;
      minT = Math.min(minT, tau); maxT = Math.max(maxT, tau);
      // A level of few coefficients has an interval of decades: it is cut, not the figure.
      minV = Math.min(minV, Math.max(v.ci_low[i] > 0 ? v.ci_low[i] : v.value[i], v.value[i] / 10));
      maxV = Math.max(maxV, Math.min(v.ci_high[i] > 0 ? v.ci_high[i] : v.value[i], v.value[i] * 10));
    });
  }
  if (!(maxT > 0)) return;
  const x0 = Math.log10(minT) - 0.1, x1 = Math.log10(maxT) + 0.1, y0 = Math.log10(minV) - 0.1, y1 = Math.log10(maxV) + 0.1;
  const x = (t) => left + (Math.log10(t) - x0) / (x1 - x0) * (right - left), y = (v) => bottom - (Math.log10(v) - y0) / (y1 - y0) * (bottom - top);
  g.strokeStyle = colours.line;
  g.fillStyle = colours.quiet;
  g.lineWidth = 1;
  for (let d = Math.ceil(x0); d <= x1; ++d) {
    g.beginPath(); g.moveTo(x(10 ** d), top); g.lineTo(x(10 ** d), bottom); g.stroke();
    g.textAlign = 'center'; g.textBaseline = 'top';
    g.fillText(d >= 0 && d < 4 ? 10 ** d + ' s' : '1e' + d + ' s', x(10 ** d), bottom + 4);
  }
  const every = Math.max(1, Math.ceil((y1 - y0) / 5));
  for (let d = Math.ceil(y0); d <= y1; d += every) {
    g.beginPath(); g.moveTo(left, y(10 ** d)); g.lineTo(right, y(10 ** d)); g.stroke();
    g.textAlign = 'right'; g.textBaseline = 'middle';
    g.fillText('1e' + d, left - 4, y(10 ** d));
  }
  g.textAlign = 'left';
  g.save();
  g.beginPath();
  g.rect(left, top, right - left, bottom - top);
  g.clip();
  const regimes = [...new Set(variances.map((v) => v.regime))];
  const fixed = {static: colours.neutral, dynamic: colours.x, all: colours.text};
  const colourOf = (regime) => fixed[regime] ?? colours[['x', 'y', 'z', 'partly'][regimes.indexOf(regime) % 4]];
  for (const v of variances) {
    g.strokeStyle = g.fillStyle = colourOf(v.regime);
    g.lineWidth = 1.5;
    v.tau_s.forEach((tau, i) => {
      if (!(v.value[i] > 0)) return;
      g.beginPath();
      if (v.ci_low[i] > 0 && v.ci_high[i] > 0) {
        g.moveTo(x(tau), y(v.ci_low[i]));
        g.lineTo(x(tau), y(v.ci_high[i]));
        g.stroke();
      }
      g.beginPath();
      g.arc(x(tau), y(v.value[i]), 3, 0, 7);
      g.fill();
    });
  }
  for (const m of models) {
    g.strokeStyle = colourOf(m.regime);
    g.lineWidth = 2.2;
    g.beginPath();
    m.tau_s.forEach((tau, i) => { if (m.fitted[i] > 0) g.lineTo(x(tau), y(m.fitted[i])); });
    g.stroke();
  }
  g.restore();
  // Variances fall: the lower left is free.
  g.textAlign = 'left';
  g.textBaseline = 'bottom';
  regimes.forEach((regime, i) => {
    g.fillStyle = colourOf(regime);
    g.fillText(regime, left + 6, bottom - 4 - 15 * (regimes.length - 1 - i));
  });
}

function showWavelets(imu) {
  say(byId('no-wavelets'), imu && imu.variances ? '' : 'none yet: the first fit comes with the first hundreds of samples');
  const variances = imu && imu.variances ? imu.variances : [], models = imu && imu.models ? imu.models : [];
  const axes = kAxes.filter((axis) => variances.some((v) => v.axis === axis));
  const tiles = children(byId('wavelets'), axes, (axis) => {
    const tile = element('div', 'tile'), head = element('div', 'head');
    head.append(element('h3', '', axis.replace('_', '\u00a0')), element('span', 'quiet'));
    tile.append(head, element('canvas', 'loglog'), element('p', 'values'));
    return tile;
  });
  axes.forEach((axis, i) => {
    const v = variances.filter((one) => one.axis === axis), m = models.filter((one) => one.axis === axis);
    say(tiles[i].querySelector('.head span'), v.map((one) => one.regime + ' ' + one.n).join(' · ') + ' samples');
    say(tiles[i].querySelector('p'), m.map((one) => one.regime + ': ' + one.model + (one.identifiable ? '' : ' (not identifiable)') + ', ' +
      one.parameters.filter((p) => p[1] === 'sigma2' && p[3] > 0).map((p) => p[0] + ' ' + brief(Math.sqrt(p[3]))).join(', ') + ' ' + (v[0] ? v[0].unit : '')).join('\n'));
    drawWavelet(tiles[i].querySelector('canvas'), v, m);
  });
}

function showChoice() {
  const names = [...known.imus.keys()].sort();
  if (!known.imus.has(chosen)) chosen = names[0] ?? null;
  const buttons = children(byId('choose'), names, (name) => {
    const button = element('button', '', name);
    button.type = 'button';
    button.addEventListener('click', () => { chosen = name; dirty = true; });
    return button;
  });
  names.forEach((name, i) => buttons[i].setAttribute('aria-pressed', String(name === chosen)));
}

// ---- the loop: at most ten pictures a second, none while nobody looks ----------------------------------------------
let dirty = true, drawnAt = -Infinity, drawnWavelets = [];
function frame(now) {
  requestAnimationFrame(frame);
  if (now - drawnAt < (dirty ? 95 : 950)) return;
  drawnAt = now;
  dirty = false;
  draw();
}

function draw() {
  showHead();
  showPlayer();
  showAlarms();
  showDevices();
  showCalibration();
  showMounting();
  showChoice();
  showThreads();
  showMarks();
  showPosition();
  drawTrack();
  const imu = known.imus.get(chosen);
  drawSignal(byId('gyro'), imu, 0, 180 / Math.PI, 'gyroscope', 'deg/s');
  drawSignal(byId('accel'), imu, 3, 1, 'accelerometer', 'm/s²');
  say(byId('errors-note'), imu && imu.errors.length ? [kValidities[imu.validity], imu.regime].filter(Boolean).join(' · ') +
    (counts.missed ? ' · ' + counts.missed + ' rows were missed: this connection is slow' : '') : 'none yet');
  // Six figures that change once in a while alone.
  const shown = [imu, imu && imu.variances, imu && imu.models, innerWidth, colours.ground];
  if (shown.some((what, i) => what !== drawnWavelets[i])) {
    drawnWavelets = shown;
    showWavelets(imu);
  }
}

// ---- the connection ----------------------------------------------------------------------------------------------
let pause_ms = 500;
function connect() {
  socket = new WebSocket('ws://' + location.host + '/live' + location.search);
  socket.addEventListener('open', () => { pause_ms = 500; ++counts.connections; dirty = true; });
  socket.addEventListener('message', (event) => {
    counts.bytes += event.data.length;
    take(JSON.parse(event.data));
  });
  socket.addEventListener('close', () => {
    dirty = true;
    setTimeout(connect, pause_ms);
    pause_ms = Math.min(5000, 2 * pause_ms);
  });
}
const send = (command) => { if (socket && socket.readyState === 1) socket.send(JSON.stringify(command)); };

const mark = () => {
  send({mark: byId('mark-text').value || 'mark'});
  byId('mark-text').value = '';
};
byId('mark').addEventListener('click', mark);
byId('mark-text').addEventListener('keydown', (event) => { if (event.key === 'Enter') mark(); });
let sliding = false, slideTimer = null;
byId('slider').addEventListener('input', () => {
  sliding = true;
  clearTimeout(slideTimer);
  slideTimer = setTimeout(() => { sliding = false; }, 400);
  send({seek_s: Number(byId('slider').value)});
  dirty = true;
});
byId('play').addEventListener('click', () => send(play && play.playing ? {pause: true} : {play: Number(byId('speed').value)}));
byId('speed').addEventListener('change', () => send({play: Number(byId('speed').value)}));

const kColours = ['auto', 'day', 'night'];
function setColours(which) {
  say(byId('colours'), which);
  if (which === 'auto') delete document.documentElement.dataset.colours; else document.documentElement.dataset.colours = which;
  try { localStorage.setItem('colours', which); } catch { /* a browser that keeps nothing */ }
  readColours();
  dirty = true;
}
byId('colours').addEventListener('click', () => setColours(kColours[(kColours.indexOf(byId('colours').textContent) + 1) % 3]));
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { readColours(); dirty = true; });
addEventListener('resize', () => { dirty = true; });
let kept = null;
try { kept = localStorage.getItem('colours'); } catch { /* the same */ }
setColours(kColours.includes(kept) ? kept : 'auto');
window.imuscope = {counts, get known() { return known; }, get picture() { return picture; }, get play() { return play; }};
connect();
draw();
requestAnimationFrame(frame);
})();
