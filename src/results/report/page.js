// Draws the figures of the page from the JSON in #figures. Every figure has a place in the page that names it.
(function () {
  'use strict';

  const WHISKER_STEP = 2.4;  // pixels
  const TRUTH_DASH = [6, 4];
  const COMPONENT_DASH = [4, 3];

  const escaped = (any) => String(any).replace(/[&<>"']/g, (c) => '&#' + c.charCodeAt(0) + ';');
  const variable = (name) => getComputedStyle(document.body).getPropertyValue(name).trim();

  // Of the kit: the axes, and what else stands beside them.
  const [X, Y, Z, FOURTH, FIFTH] = ['--x', '--y', '--z', '--series-3', '--series-4'].map(variable);
  const COLOURS = [X, Y, Z, FOURTH, FIFTH];
  const REGIME_COLOURS = [Z, X, Y, FOURTH, FIFTH];
  const SPEED_COLOURS = [FOURTH, Z, Y, '#d99a00', X];  // from slow to fast
  const shown = (value) => {
    if (value === null || !isFinite(value)) return '–';
    return Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3) ? value.toExponential(2)
                                                                            : String(+value.toPrecision(5));
  };

  const graphs = [];
  let wholeRange = false;
  const groups = new Map();

  // A finger scrolls the page; two fingers zoom. The library alone would take both.
  const interaction = Object.assign({}, Dygraph.defaultInteractionModel);
  for (const kind of ['touchstart', 'touchmove', 'touchend']) {
    const whole = Dygraph.defaultInteractionModel[kind];
    interaction[kind] = (event, graph, context) => {
      if (event.touches.length > 1 || (kind === 'touchend' && context.touchDirections)) whole(event, graph, context);
    };
  }

  function legend(entries) {
    return entries.map((entry) => '<span class="swatch" style="background:' + entry.colour + '"></span>' +
                                  escaped(entry.text)).join('');
  }

  // What lies under the curves: times at rest, and the truth where it is known.
  function underlay(figure) {
    return (canvas, area, graph) => {
      canvas.fillStyle = variable('--still');
      for (const [begin, end] of figure.shaded) {
        const left = Math.max(graph.toDomXCoord(begin), area.x);
        const right = Math.min(graph.toDomXCoord(end), area.x + area.w);
        if (right > left) canvas.fillRect(left, area.y, right - left, area.h);
      }
      if (figure.truth === undefined) return;
      const y = graph.toDomYCoord(figure.truth);
      canvas.save();
      canvas.strokeStyle = variable('--text');
      canvas.setLineDash(TRUTH_DASH);
      canvas.beginPath();
      canvas.moveTo(area.x, y);
      canvas.lineTo(area.x + area.w, y);
      canvas.stroke();
      canvas.restore();
    };
  }

  function zoomTogether(group) {
    return (left, right) => {
      for (const graph of groups.get(group) || []) graph.updateOptions({dateWindow: [left, right]});
    };
  }

  function common(figure, legendPlace) {
    return {
      customBars: true,
      interactionModel: interaction,
      underlayCallback: underlay(figure),
      labelsDiv: legendPlace,
      legend: 'always',
      gridLineColor: variable('--line'),
      axisLineColor: variable('--line'),
      axisLabelFontSize: 12,
      fillAlpha: 0.25,
      strokeWidth: 1.3,
      highlightCircleSize: 2.5,
      rightGap: 8,
      axes: {y: {axisLabelWidth: 52, pixelsPerLabel: 24}, x: {axisLabelWidth: 46, pixelsPerLabel: 48}},
    };
  }

  // Times of a figure's values: the first, and the step to the next.
  const timesOf = (figure, n) => Array.from({length: n}, (_, i) => +(figure.times[0] + i * figure.times[1]).toFixed(2));

  // A value with the ends of its band: smallest and largest, or one sd to either side.
  function band(figure, i) {
    const mid = figure.mid[i];
    if (mid === null) return [null, null, null];
    if (figure.sd) return [mid - (figure.sd[i] || 0), mid, mid + (figure.sd[i] || 0)];
    return [figure.low[i] === null ? mid : figure.low[i], mid, figure.high[i] === null ? mid : figure.high[i]];
  }

  function drawTime(figure, place, legendPlace) {
    const rows = timesOf(figure, figure.mid.length).map((time, i) => [time, band(figure, i)]);
    const colour = COLOURS[figure.colour % COLOURS.length];
    const options = common(figure, legendPlace);
    options.labels = ['time', 'value'];
    options.colors = [colour];
    options.valueRange = wholeRange ? null : figure.window || null;
    options.axes.y.axisLabelFormatter = shown;
    options.axes.x.axisLabelFormatter = (value) => value + ' s';
    options.zoomCallback = figure.group ? zoomTogether(figure.group) : null;
    // Values under the pointer. The library asks while it constructs the graph, too, before there is one.
    let graph = null;
    options.legendFormatter = (data) => {
      if (graph === null || data.x === undefined || data.x === null) return '';
      const row = rows[graph.getSelection()];
      if (!row || row[1][1] === null) return '';
      return legend([{colour, text: shown(row[1][1]) + ' (' + shown(row[1][0]) + ' … ' + shown(row[1][2]) + ') ' +
                                    figure.y_label + ' at ' + data.x + ' s'}]);
    };
    graph = new Dygraph(place, rows, options);
    graphs.push({graph, figure});
    if (figure.group) groups.set(figure.group, (groups.get(figure.group) || []).concat(graph));
  }

  // A point with its interval as a whisker. Regimes stand side by side, so that none hides the other.
  const whiskers = (shift) => (e) => {
    const canvas = e.drawingContext;
    canvas.strokeStyle = e.color;
    canvas.fillStyle = e.color;
    canvas.lineWidth = 1.4;
    for (const point of e.points) {
      if (!isFinite(point.canvasy) || point.yval === null) continue;
      const x = point.canvasx + shift;
      canvas.beginPath();
      canvas.moveTo(x, e.plotArea.y + e.plotArea.h * point.y_top);
      canvas.lineTo(x, e.plotArea.y + e.plotArea.h * point.y_bottom);
      canvas.stroke();
      canvas.beginPath();
      canvas.arc(x, point.canvasy, 2.4, 0, 2 * Math.PI);
      canvas.fill();
    }
  };

  // Powers of ten only: between them there is no room for labels.
  function decades(low, high) {
    const ticks = [];
    const first = Math.floor(Math.log10(low));
    const last = Math.ceil(Math.log10(high));
    const step = Math.max(1, Math.ceil((last - first) / 5));
    for (let exponent = first; exponent <= last; ++exponent) {
      const labelled = (exponent - first) % step === 0;
      ticks.push({v: Math.pow(10, exponent), label: labelled ? '10' + superscript(exponent) : ''});
    }
    return ticks;
  }
  const superscript = (exponent) => '<sup>' + String(exponent).replace('-', '−') + '</sup>';

  function drawWavelet(figure, place, legendPlace) {
    const taus = [...new Set(figure.series.flatMap((series) => series.tau))].sort((a, b) => a - b);
    const labels = ['τ'];
    const options = common(figure, legendPlace);
    options.series = {};
    options.colors = [];
    const bar = (value) => value === null || value === undefined ? null : [value, value, value];
    // To the library curves have names of our own: one of a regime may be anything, twice as well.
    const observed = (k) => 'observed ' + k;
    const fitted = (k) => 'fitted ' + k;
    figure.series.forEach((series, k) => {
      const colour = REGIME_COLOURS[k % REGIME_COLOURS.length];
      labels.push(observed(k), fitted(k));
      options.colors.push(colour, colour);
      options.series[observed(k)] = {plotter: whiskers(WHISKER_STEP * (k - (figure.series.length - 1) / 2)), strokeWidth: 0};
      options.series[fitted(k)] = {plotter: Dygraph.Plotters.linePlotter};
      series.components.forEach((component, i) => {
        const label = 'component ' + k + ' ' + i;
        labels.push(label);
        options.colors.push(colour);
        options.series[label] = {plotter: Dygraph.Plotters.linePlotter, strokeWidth: 0.8, strokePattern: COMPONENT_DASH,
                                 drawPoints: false, highlightCircleSize: 0};
      });
    });
    const rows = taus.map((tau) => {
      const row = [tau];
      for (const series of figure.series) {
        const i = series.tau.indexOf(tau);
        const mid = i < 0 ? null : series.mid[i];
        // A lower end at zero has no place on a logarithmic axis.
        const low = mid === null ? null : series.low[i] > 0 ? series.low[i] : mid / 100;
        const high = mid === null ? null : series.high[i] === null ? mid : series.high[i];
        row.push(mid === null ? null : [low, mid, high], bar(i < 0 ? null : series.fitted[i]));
        // What has no height left on a logarithmic axis is not drawn.
        for (const component of series.components) row.push(bar(i < 0 || !(component.values[i] > 0) ? null : component.values[i]));
      }
      return row;
    });
    const isMain = (label) => !label.startsWith('component ');
    const ends = rows.flatMap((row) => row.filter((cell, i) => i > 0 && cell !== null && isMain(labels[i])).flat());
    options.labels = labels;
    options.connectSeparatedPoints = true;
    options.logscale = true;
    options.valueRange = ends.length ? [Math.min(...ends) / 1.4, Math.max(...ends) * 1.4] : null;
    options.dateWindow = [taus[0] / 1.4, taus[taus.length - 1] * 1.4];
    options.axes.x.logscale = true;
    options.axes.x.ticker = decades;
    options.axes.y.ticker = decades;
    options.axes.y.axisLabelWidth = 36;
    options.interactionModel = {};
    const nameOf = new Map(figure.series.map((series, k) => [observed(k), series.name]));
    const names = () => legend(figure.series.map((series, k) => ({
      colour: REGIME_COLOURS[k % REGIME_COLOURS.length], text: series.name,
    })));
    options.legendFormatter = (data) => {
      if (data.x === undefined || data.x === null) return names();
      return legend(data.series.filter((series) => nameOf.has(series.label) && series.y !== undefined && series.y !== null)
          .map((series) => ({colour: series.color, text: nameOf.get(series.label) + ' ' + shown(series.y)}))) +
          ' at τ = ' + shown(data.x) + ' s';
    };
    graphs.push({graph: new Dygraph(place, rows, options), figure});
  }

  function drawScatter(figure, place, legendPlace) {
    const colour = COLOURS[figure.colour % COLOURS.length];
    const options = common(figure, legendPlace);
    Object.assign(options, {
      customBars: false, labels: ['x', 'y'], colors: [colour], strokeWidth: 0,
      drawPoints: true, pointSize: 1.1, interactionModel: {}, xlabel: escaped(figure.x_label), xLabelHeight: 15,
      xRangePad: 4, yRangePad: 4,
    });
    options.axes.x.axisLabelFormatter = shown;
    options.axes.y.axisLabelFormatter = shown;
    options.legendFormatter = () => '';
    // The library wants its abscissas in order.
    const y = sheet.columns[figure.y];
    const points = sheet.columns[figure.x].map((x, i) => [x, y[i]]).filter((point) => point[0] !== null && point[1] !== null)
        .sort((a, b) => a[0] - b[0]);
    graphs.push({graph: new Dygraph(place, points, options), figure});
  }

  // Metres that make a scale bar of about `wanted` metres.
  function roundLength(wanted) {
    const power = Math.pow(10, Math.floor(Math.log10(wanted)));
    return [5, 2, 1].map((digit) => digit * power).find((length) => length <= wanted) || power;
  }

  function drawMap(figure, place, legendPlace) {
    const points = timesOf(figure, figure.north.length)
        .map((time, i) => ({time, n: figure.north[i], e: figure.east[i], v: figure.speed[i]}))
        .filter((point) => point.n !== null && point.e !== null);
    if (points.length === 0) return;
    const range = (values) => [Math.min(...values), Math.max(...values)];
    const [south, north] = range(points.map((point) => point.n));
    const [west, east] = range(points.map((point) => point.e));
    const [, fastest] = range(points.map((point) => point.v || 0));
    const width = Math.max(320, place.clientWidth);
    const margin = 36;
    const flattest = 0.36;  // of height to width: the map shall leave room on a screen
    const scale = (width - 2 * margin) / Math.max(east - west, (north - south) / flattest, 1);
    const foot = 30;  // a strip of its own for scale bar and north, so that the way never runs under them
    const field = Math.max((north - south) * scale, 140) + 2 * margin;
    const height = field + foot;
    const x = (e) => margin + (e - west) * scale + ((width - 2 * margin) - (east - west) * scale) / 2;
    const y = (n) => field - margin - (n - south) * scale - ((field - 2 * margin) - (north - south) * scale) / 2;
    const level = (v) => Math.min(SPEED_COLOURS.length - 1, Math.floor((v || 0) / (fastest || 1) * SPEED_COLOURS.length));

    // One path for each run of points of the same speed class; a gap in time breaks the way.
    const step = figure.times[1];
    const at = (i) => [x(points[i].e), y(points[i].n)];
    const isNext = (i, j) => points[i] && points[j] && points[j].time - points[i].time <= 1.5 * step;
    // From one point to the next as a curve that leaves each in the direction of its neighbours (Catmull-Rom).
    const curve = (i) => {
      const [from, to] = [at(i - 1), at(i)];
      const before = isNext(i - 2, i - 1) ? at(i - 2) : from;
      const after = isNext(i, i + 1) ? at(i + 1) : to;
      const control = (p, a, b, sign) => [0, 1].map((k) => (p[k] + sign * (b[k] - a[k]) / 6).toFixed(1)).join(' ');
      return 'C' + control(from, before, to, 1) + ' ' + control(to, from, after, -1) + ' ' + to.map((c) => c.toFixed(1)).join(' ');
    };
    const paths = [];
    for (let i = 1; i < points.length; ++i) {
      const from = points[i - 1];
      const to = points[i];
      if (to.time - from.time > 1.5 * step) continue;
      const colour = SPEED_COLOURS[level(to.v)];
      const last = paths[paths.length - 1];
      const segment = curve(i);
      if (last && last.colour === colour && last.end === i - 1) {
        last.d += segment;
        last.end = i;
      } else {
        paths.push({colour, end: i, d: 'M' + x(from.e).toFixed(1) + ' ' + y(from.n).toFixed(1) + segment});
      }
    }
    const bar = roundLength((width - 2 * margin) / 3 / scale);
    const mark = (point, label) => '<circle cx="' + x(point.e) + '" cy="' + y(point.n) + '" r="5" fill="none" stroke-width="2" ' +
        'stroke="currentColor"/><text ' + (x(point.e) > width - 60 ? 'text-anchor="end" x="' + (x(point.e) - 9) : 'x="' + (x(point.e) + 9)) +
        '" y="' + (y(point.n) - 7) + '">' + label + '</text>';
    place.innerHTML = '<svg viewBox="0 0 ' + width + ' ' + height.toFixed(0) + '" role="img" aria-label="map">' +
        '<rect class="frame" x="0.5" y="0.5" width="' + (width - 1) + '" height="' + (height - 1).toFixed(0) + '"/>' +
        paths.map((path) => '<path d="' + path.d + '" fill="none" stroke-width="2.5" vector-effect="non-scaling-stroke" ' +
                            'stroke-linejoin="round" stroke="' + path.colour + '"/>').join('') +
        mark(points[0], 'start') + mark(points[points.length - 1], 'end') +
        '<path d="M20 ' + (height - 14) + 'h' + (bar * scale) + '" stroke="currentColor" stroke-width="3"/>' +
        '<text x="' + (28 + bar * scale) + '" y="' + (height - 10) + '">' + (bar >= 1000 ? bar / 1000 + ' km' : bar + ' m') + '</text>' +
        '<path d="M' + (width - 20) + ' ' + (height - 6) + 'v-22l-5 8m5-8l5 8" fill="none" stroke="currentColor" stroke-width="2"/>' +
        '<text x="' + (width - 42) + '" y="' + (height - 10) + '">N</text></svg>';
    legendPlace.innerHTML = legend(SPEED_COLOURS.map((colour, k) => ({
      colour,
      text: (k * fastest / SPEED_COLOURS.length).toFixed(0) + '–' + ((k + 1) * fastest / SPEED_COLOURS.length).toFixed(0) +
            (k === SPEED_COLOURS.length - 1 ? ' m/s' : ''),
    })));
    makeMapMovable(place.firstChild, width, height);
  }

  // Wheel with Ctrl zooms about the pointer, dragging moves, a double click returns.
  function makeMapMovable(svg, width, height) {
    let box = [0, 0, width, height];
    const show = () => svg.setAttribute('viewBox', box.join(' '));
    svg.addEventListener('wheel', (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      const bounds = svg.getBoundingClientRect();
      const u = (event.clientX - bounds.left) / bounds.width;
      const v = (event.clientY - bounds.top) / bounds.height;
      const factor = Math.exp(event.deltaY / 400);
      const wide = Math.min(width, Math.max(width / 200, box[2] * factor));
      const high = wide * height / width;
      box = [box[0] + u * (box[2] - wide), box[1] + v * (box[3] - high), wide, high];
      show();
    }, {passive: false});
    let from = null;
    svg.addEventListener('pointerdown', (event) => { from = event.pointerType === 'mouse' ? event : null; });
    window.addEventListener('pointerup', () => { from = null; });
    svg.addEventListener('pointermove', (event) => {
      if (from === null) return;
      const factor = box[2] / svg.getBoundingClientRect().width;
      box[0] -= (event.clientX - from.clientX) * factor;
      box[1] -= (event.clientY - from.clientY) * factor;
      from = event;
      show();
    });
    svg.addEventListener('dblclick', () => { box = [0, 0, width, height]; show(); });
  }

  const sheet = JSON.parse(document.getElementById('figures').textContent);
  const draw = {time: drawTime, wavelet: drawWavelet, map: drawMap, scatter: drawScatter};
  const places = new Map();
  document.querySelectorAll('.plot').forEach((place) => places.set(place.dataset.figure, place));
  const waiting = new Map(sheet.figures.filter((figure) => places.has(figure.id)).map((figure) => [figure.id, figure]));
  const isShown = (place) => place.clientWidth > 0;

  function drawOne(id) {
    const figure = waiting.get(id);
    const place = places.get(id);
    if (!figure || !isShown(place)) return;
    waiting.delete(id);
    draw[figure.kind](figure, place, place.parentElement.querySelector('.legend'));
    document.body.dataset.figuresDrawn = String(graphs.length);
  }
  function drawInside(element) {
    element.querySelectorAll('.plot').forEach((place) => drawOne(place.dataset.figure));
  }

  // One figure after the other, so that the page can be read and scrolled meanwhile; those in a fold when it is opened.
  const order = [...places.keys()];
  function drawNext() {
    const id = order.shift();
    if (id === undefined) {
      document.body.dataset.ready = 'yes';
      return;
    }
    drawOne(id);
    setTimeout(drawNext, 0);
  }
  document.body.dataset.figuresDrawn = '0';
  setTimeout(drawNext, 0);
  document.querySelectorAll('details').forEach((fold) => fold.addEventListener('toggle', () => { if (fold.open) drawInside(fold); }));

  // On paper, what is folded stands in an appendix behind all else, and returns to its place afterwards.
  const moved = [];
  window.addEventListener('beforeprint', () => {
    drawInside(document.body);
    const folds = [...document.querySelectorAll('main > section details.fold:not([open])')]
        .filter((fold) => !fold.parentElement.closest('details.fold:not([open])'));
    if (folds.length === 0) return;
    const appendix = document.createElement('section');
    appendix.id = 'appendix';
    const title = document.createElement('h2');
    title.textContent = 'Appendix';
    appendix.append(title);
    for (const fold of folds) {
      const mark = document.createElement('span');
      const words = document.createElement('h3');
      const tile = fold.closest('.tile');
      const of = tile ? tile.querySelector('h3') : fold.closest('section').querySelector('h2');
      words.textContent = (of ? of.textContent + (tile ? ' ' : ': ') : '') + fold.querySelector('summary').textContent;
      fold.before(mark);
      appendix.append(words, fold);
      fold.open = true;
      moved.push({fold, mark});
    }
    document.querySelector('main').append(appendix);
    drawInside(appendix);
  });
  window.addEventListener('afterprint', () => {
    for (const {fold, mark} of moved.splice(0)) {
      fold.open = false;
      mark.replaceWith(fold);
    }
    const appendix = document.getElementById('appendix');
    if (appendix) appendix.remove();
  });

  // The contents show where one is.
  const links = new Map([...document.querySelectorAll('nav.contents a')].map((link) => [link.hash.slice(1), link]));
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      links.forEach((link) => link.removeAttribute('aria-current'));
      const link = links.get(entry.target.id);
      if (link) link.setAttribute('aria-current', 'true');
    }
  }, {rootMargin: '-15% 0px -75% 0px'});
  document.querySelectorAll('h2[id]').forEach((heading) => seen.observe(heading));

  const button = document.getElementById('whole-range');
  if (button) {
    button.addEventListener('click', () => {
      wholeRange = !wholeRange;
      const whole = wholeRange;
      button.setAttribute('aria-pressed', String(whole));
      button.textContent = whole ? 'show the settled estimates' : 'show the whole range';
      for (const {graph, figure} of graphs) {
        if (figure.window) graph.updateOptions({valueRange: whole ? null : figure.window});
      }
    });
  }

  window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
    for (const {graph} of graphs) graph.updateOptions({gridLineColor: variable('--line'), axisLineColor: variable('--line')});
  });
})();
