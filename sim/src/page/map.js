// The map: landscape, regions, sensors, paths and vehicles at one instant, on axes of uPlot.

const INK = '#1a1a1a';
const FINER = 8; // pixels along a cell of a landscape
const FAINTEST = 0.02; // jamming below this is not drawn

/** The ways that have a beginning: one that nobody has flown yet has no place. */
function ways(data) {
  return data.paths.filter((path) => path.times.length > 0);
}

/** The place on a way of `times`, `x`, `y` at an instant: at rest before and after. */
function placeAt(way, time) {
  const { times, x, y } = way;
  let next = 0;
  while (next < times.length && times[next] <= time) next += 1;
  if (next === 0) return { x: x[0], y: y[0], heading: headingOf(way, 1), node: 0 };
  if (next === times.length) return { x: x[next - 1], y: y[next - 1], heading: headingOf(way, next - 1), node: next - 1 };
  const share = (time - times[next - 1]) / (times[next] - times[next - 1]);
  const mix = (all) => all[next - 1] + share * (all[next] - all[next - 1]);
  return { x: mix(x), y: mix(y), heading: headingOf(way, next), node: next };
}

function headingOf({ x, y }, node) {
  return node > 0 && node < x.length ? Math.atan2(y[node] - y[node - 1], x[node] - x[node - 1]) : 0;
}

/** Landscapes, unpacked as they are asked for: two letters a cell. */
class Landscape {
  constructor(fields, colours) {
    this.fields = fields;
    this.colours = colours.map((css) => [1, 3, 5].map((at) => parseInt(css.slice(at, at + 2), 16)));
    this.letters = new Map([...'ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/'].map((c, i) => [c, i]));
    this.canvas = document.createElement('canvas');
    this.smooth = document.createElement('canvas');
    this.drawn = '';
  }

  /** Index of the frame that is nearest to an instant. */
  frame(time) {
    let best = 0;
    this.fields.times.forEach((at, index) => {
      if (Math.abs(at - time) < Math.abs(this.fields.times[best] - time)) best = index;
    });
    return best;
  }

  text(metric, frame) {
    const field = this.fields.metrics[metric];
    return (field.same === undefined ? field : this.fields.metrics[field.same]).frames[frame];
  }

  /** The share of the scale at a cell; null where there is no value. */
  share(text, cell) {
    const code = this.letters.get(text[2 * cell]) * 64 + this.letters.get(text[2 * cell + 1]);
    return code === 4095 ? null : code / 4094;
  }

  image(metric, time) {
    const frame = this.frame(time);
    const { columns, rows } = this.fields;
    const key = `${metric} ${frame}`;
    if (this.drawn === key) return this.smooth;
    this.canvas.width = columns;
    this.canvas.height = rows;
    const context = this.canvas.getContext('2d');
    const pixels = context.createImageData(columns, rows);
    const text = this.text(metric, frame);
    for (let cell = 0; cell < columns * rows; cell += 1) {
      const share = this.share(text, cell);
      const rgb = share === null ? [160, 160, 160] : this.colours[Math.round(share * (this.colours.length - 1))];
      // Rows come from the south, pixels from the top.
      const at = 4 * ((rows - 1 - Math.floor(cell / columns)) * columns + (cell % columns));
      pixels.data.set([...rgb, 255], at);
    }
    context.putImageData(pixels, 0, 0);
    // A printer does not smooth what it draws larger.
    this.smooth.width = FINER * columns;
    this.smooth.height = FINER * rows;
    this.smooth.getContext('2d').drawImage(this.canvas, 0, 0, this.smooth.width, this.smooth.height);
    this.drawn = key;
    return this.smooth;
  }

  /** The value at shares of the width and height, as words; empty where there is none. */
  value(metric, time, east, north) {
    const { columns, rows, metrics } = this.fields;
    const [column, row] = [Math.floor(east * columns), Math.floor(north * rows)];
    if (column < 0 || row < 0 || column >= columns || row >= rows) return '';
    const share = this.share(this.text(metric, this.frame(time)), row * columns + column);
    if (share === null) return 'no value';
    const { low, high, log } = metrics[metric];
    const value = log ? low * (high / low) ** share : low + share * (high - low);
    const beyond = share >= 1 ? '\u2265 ' : share <= 0 && metrics[metric].kind !== 'probability' ? '\u2264 ' : '';
    return beyond + figure(value);
  }
}

/** A number with three digits. */
function figure(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return '\u2013';
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e5 || size < 1e-3)) return value.toExponential(2).replace('e+', 'e');
  return String(Number(value.toPrecision(4)));
}

/** Pens: what is drawn on the canvas of the map, in its pixels. */
class Pen {
  constructor(chart) {
    this.context = chart.ctx;
    this.dot = window.devicePixelRatio || 1;
    this.at = (x, y) => [chart.valToPos(x, 'x', true), chart.valToPos(y, 'y', true)];
  }

  line(points, colour, width, dash = []) {
    const { context } = this;
    if (points.length < 2) return;
    context.beginPath();
    points.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.strokeStyle = colour;
    context.lineWidth = width * this.dot;
    context.setLineDash(dash.map((part) => part * this.dot));
    context.lineJoin = context.lineCap = 'round';
    context.stroke();
    context.setLineDash([]);
  }

  circle([x, y], radius, fill, rim, width) {
    const { context } = this;
    context.beginPath();
    context.arc(x, y, radius * this.dot, 0, 2 * Math.PI);
    context.fillStyle = fill;
    context.fill();
    context.strokeStyle = rim;
    context.lineWidth = width * this.dot;
    context.stroke();
  }

  square([x, y], side, fill, rim) {
    const { context } = this;
    const half = (side * this.dot) / 2;
    context.beginPath();
    context.rect(x - half, y - half, 2 * half, 2 * half);
    context.fillStyle = fill;
    context.fill();
    context.strokeStyle = rim;
    context.lineWidth = 1.6 * this.dot;
    context.stroke();
  }

  vehicle([x, y], heading, fill) {
    const { context } = this;
    context.save();
    context.translate(x, y);
    context.rotate(-heading);
    context.scale(this.dot, this.dot);
    context.beginPath();
    [[13, 0], [-9, 8.5], [-5, 0], [-9, -8.5]].forEach(([a, b], index) => (index ? context.lineTo(a, b) : context.moveTo(a, b)));
    context.closePath();
    context.fillStyle = fill;
    context.fill();
    context.strokeStyle = '#ffffff';
    context.lineWidth = 2;
    context.stroke();
    context.restore();
  }

  name(text, [x, y]) {
    const { context } = this;
    context.font = `${12 * this.dot}px system-ui, "DejaVu Sans", sans-serif`;
    context.textAlign = 'center';
    context.textBaseline = 'bottom';
    context.lineWidth = 3 * this.dot;
    context.strokeStyle = 'rgba(255,255,255,0.85)';
    context.strokeText(text, x, y - 8 * this.dot);
    context.fillStyle = INK;
    context.fillText(text, x, y - 8 * this.dot);
  }
}

const DASHES = [[], [10, 5], [3, 4], [12, 4, 3, 4]];

class FlightMap {
  constructor(data, element, moment) {
    Object.assign(this, { data, element, moment, metric: 0 });
    this.loudest = loudest(data);
    this.landscape = new Landscape(data.fields, data.map.colours);
    this.view = { x: [...data.map.x], y: [...data.map.y] };
    this.plot = this.build();
    this.follow();
  }

  /** Sides of the drawing for a width: axes beside it, and one scale for both directions. */
  size() {
    const { x, y } = this.data.map;
    const width = Math.max(260, this.element.clientWidth);
    const [left, below] = [76, 56];
    const height = ((width - left - 20) * (y[1] - y[0])) / (x[1] - x[0]) + below + 12;
    return { width, height: Math.max(160, Math.min(height, 1.5 * width)) };
  }

  build() {
    const theme = colours();
    const axis = (label, side) => ({
      scale: side === 2 ? 'x' : 'y', side, label: `${label} (${this.data.map.unit})`, labelSize: 24, size: side === 2 ? 32 : 52,
      stroke: theme.ink, grid: { show: false }, ticks: { stroke: theme.line }, values: (plot, ticks) => ticks.map(mark),
    });
    return new uPlot({
      ...this.size(),
      padding: [12, 20, 0, 0],
      legend: { show: false },
      cursor: { drag: { setScale: false, x: false, y: false } },
      scales: { x: { time: false, range: () => this.view.x }, y: { range: () => this.view.y } },
      axes: [axis('east, x', 2), axis('north, y', 3)],
      series: [{}, { show: false }],
      hooks: {
        drawClear: [(plot) => this.clipped(plot, () => this.ground(plot))],
        draw: [(plot) => this.clipped(plot, () => this.scene(plot))],
        setCursor: [(plot) => this.read(plot)],
      },
    }, [this.data.map.x, this.data.map.y], this.element);
  }

  clipped(plot, work) {
    const { left, top, width, height } = plot.bbox;
    plot.ctx.save();
    plot.ctx.beginPath();
    plot.ctx.rect(left, top, width, height);
    plot.ctx.clip();
    work();
    plot.ctx.restore();
  }

  ground(plot) {
    const { x, y } = this.data.map;
    const pen = new Pen(plot);
    const [[left, bottom], [right, top]] = [pen.at(x[0], y[0]), pen.at(x[1], y[1])];
    plot.ctx.imageSmoothingEnabled = true;
    plot.ctx.drawImage(this.landscape.image(this.metric, this.moment.time), left, top, right - left, bottom - top);
  }

  scene(plot) {
    const pen = new Pen(plot);
    this.regions(pen);
    const { time } = this.moment;
    for (const path of ways(this.data).filter((path) => path.kind === 'step')) this.step(pen, path);
    const main = ways(this.data).filter((path) => path.kind !== 'step');
    for (const path of main) {
      const flown = path.kind === 'flown';
      this.route(pen, path, DASHES[path.agent % DASHES.length], flown ? time : Infinity);
    }
    this.sensors(pen);
    for (const path of main) {
      const { x, y, heading } = placeAt(path, time);
      pen.vehicle(pen.at(x, y), heading, this.data.agents[path.agent].colour);
      if (this.data.agents.length > 1) pen.name(this.data.agents[path.agent].name, pen.at(x, y));
    }
  }

  /** Whether a step's plan is the one that flies at the moment. */
  inForce(path) {
    const { time } = this.moment;
    const later = this.data.paths.some((other) => other.kind === 'step' && other.agent === path.agent && other.times[0] > path.times[0] && other.times[0] <= time);
    return path.times[0] <= time && !later;
  }

  /** The plan of a step: thin, and bright while it flies. Emissions and rims of many would bury the map. */
  step(pen, path) {
    const points = path.x.map((x, node) => pen.at(x, path.y[node]));
    const flies = this.inForce(path);
    if (flies) pen.line(points, 'rgba(255,255,255,0.9)', 3.8);
    pen.context.globalAlpha = flies ? 1 : 0.4;
    pen.line(points, this.data.agents[path.agent].colour, flies ? 1.8 : 1.1, [5, 4]);
    pen.context.globalAlpha = 1;
  }

  route(pen, path, dash, until) {
    const points = path.x.map((x, node) => pen.at(x, path.y[node])).filter((_, node) => path.times[node] <= until);
    const { colour } = this.data.agents[path.agent];
    const legs = (wanted) => points.slice(1).map((to, index) => [points[index], to, index + 1]).filter(([, , node]) => wanted(node));
    pen.context.globalAlpha = 0.6;
    for (const [a, b, node] of legs((node) => path.jam[node] > FAINTEST)) pen.line([a, b], '#fff3a6', 6 + (14 * path.jam[node]) / this.loudest);
    pen.context.globalAlpha = 1;
    pen.line(points, 'rgba(255,255,255,0.9)', 5.6);
    pen.line(points, colour, 3.2, dash);
    for (const rim of [[8.6, '#ffffff'], [6.4, colour], [2.6, '#ffffff']]) {
      for (const [a, b] of legs((node) => path.dropout[node] >= 0.5)) pen.line([a, b], rim[1], rim[0]);
    }
    const end = path.x.length - 1;
    pen.circle(pen.at(path.x[0], path.y[0]), 6, '#ffffff', colour, 3);
    pen.square(pen.at(path.x[end], path.y[end]), 12, colour, '#ffffff');
  }

  regions(pen) {
    const { time } = this.moment;
    for (const region of this.data.map.regions) {
      const applies = (region.from === null || time >= region.from) && (region.until === null || time < region.until);
      const ring = region.ring.map(([x, y]) => pen.at(x, y));
      const { context } = pen;
      context.save();
      context.globalAlpha = applies ? 1 : 0.3;
      context.beginPath();
      ring.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
      context.closePath();
      if (region.inside) context.rect(0, 0, context.canvas.width, context.canvas.height);
      context.fillStyle = hatching(context, pen.dot);
      context.fill('evenodd');
      context.restore();
      pen.line([...ring, ring[0]], '#ffffff', 3.2);
      pen.line([...ring, ring[0]], INK, 1.4, applies ? [] : [4, 4]);
      pen.name(region.name, [mean(ring, 0), mean(ring, 1)]);
    }
  }

  sensors(pen) {
    for (const sensor of this.data.map.sensors) {
      const track = sensor.x.map((x, knot) => pen.at(x, sensor.y[knot]));
      pen.line(track, 'rgba(30,30,30,0.55)', 3.2);
      pen.line(track, '#ffffff', 1.6, [7, 5]);
    }
    for (const sensor of this.data.map.sensors) {
      const { x, y } = placeAt(sensor, this.moment.time);
      pen.circle(pen.at(x, y), 5, '#ffffff', INK, 1.8);
      pen.name(sensor.name, pen.at(x, y));
    }
  }

  /** What is under the pointer. */
  read(plot) {
    const { left, top } = plot.cursor;
    if (left === undefined || left < 0) return;
    const { map, fields } = this.data;
    const [x, y] = [plot.posToVal(left, 'x'), plot.posToVal(top, 'y')];
    const share = (value, [low, high]) => (value - low) / (high - low);
    const value = this.landscape.value(this.metric, this.moment.time, share(x, map.x), share(y, map.y));
    const words = value ? `${fields.metrics[this.metric].label}: ${value}` : '';
    document.getElementById('reading').textContent = `east ${figure(x)}, north ${figure(y)} ${map.unit}. ${words}`;
  }

  /** Dragging moves a map that is zoomed in; a tap on a path goes to that instant. */
  follow() {
    const { over } = this.plot;
    let grip = null;
    over.addEventListener('pointerdown', (event) => {
      grip = { x: event.offsetX, y: event.offsetY, view: structuredClone(this.view), moved: false };
    });
    over.addEventListener('pointermove', (event) => {
      if (!grip || event.buttons === 0) return;
      const [dx, dy] = [event.offsetX - grip.x, event.offsetY - grip.y];
      if (Math.hypot(dx, dy) > 4) grip.moved = true;
      const { x, y } = grip.view;
      const [east, north] = [(-dx * (x[1] - x[0])) / over.clientWidth, (dy * (y[1] - y[0])) / over.clientHeight];
      this.show({ x: x.map((edge) => edge + east), y: y.map((edge) => edge + north) });
    });
    over.addEventListener('pointerup', (event) => {
      if (grip && !grip.moved) this.tap(event.offsetX, event.offsetY);
      grip = null;
    });
    over.addEventListener('dblclick', () => this.zoom(0));
  }

  tap(left, top) {
    let best = { gap: 24, time: null };
    for (const path of this.data.paths.filter((path) => path.kind !== 'step')) {
      path.times.forEach((time, node) => {
        const gap = Math.hypot(this.plot.valToPos(path.x[node], 'x') - left, this.plot.valToPos(path.y[node], 'y') - top);
        if (gap < best.gap) best = { gap, time };
      });
    }
    if (best.time !== null) this.moment.set(best.time, this);
  }

  /** Zooms by a factor about the middle; 0 shows all. */
  zoom(factor) {
    const { x, y } = this.data.map;
    const about = ([low, high]) => [(low + high) / 2 - (high - low) / (2 * factor), (low + high) / 2 + (high - low) / (2 * factor)];
    this.show(factor ? { x: about(this.view.x), y: about(this.view.y) } : { x: [...x], y: [...y] });
  }

  /** Shows a part of the area, and nothing beyond its edges. */
  show(view) {
    const kept = ([low, high], [first, last]) => {
      const side = Math.min(high - low, last - first);
      const start = Math.min(Math.max(low, first), last - side);
      return [start, start + side];
    };
    this.view = { x: kept(view.x, this.data.map.x), y: kept(view.y, this.data.map.y) };
    this.plot.redraw(true, true);
    this.plot.setData(this.plot.data);
  }

  /** Takes over new data. */
  reload() {
    this.loudest = loudest(this.data);
    this.landscape = new Landscape(this.data.fields, this.data.map.colours);
  }

  choose(metric) {
    this.metric = metric;
    this.update();
  }

  update() {
    this.plot.redraw(false, false);
  }

  resize() {
    this.plot.setSize(this.size());
  }

  restyle() {
    this.plot.destroy();
    this.plot = this.build();
    this.follow();
  }
}

/** The highest jamming level of any path; node 0 has no interval. */
function loudest(data) {
  return data.paths.reduce((most, path) => path.jam.slice(1).reduce((a, b) => Math.max(a, b), most), 0);
}

function mean(ring, axis) {
  return ring.reduce((sum, corner) => sum + corner[axis], 0) / ring.length;
}

let hatch = null;
function hatching(context, dot) {
  if (hatch) return hatch;
  const tile = document.createElement('canvas');
  tile.width = tile.height = 8 * dot;
  const pen = tile.getContext('2d');
  pen.strokeStyle = 'rgba(20,20,20,0.6)';
  pen.lineWidth = 1.4 * dot;
  for (const shift of [-tile.width, 0, tile.width]) {
    pen.moveTo(shift, tile.height);
    pen.lineTo(shift + tile.width, 0);
  }
  pen.stroke();
  hatch = context.createPattern(tile, 'repeat');
  return hatch;
}
