// Tables: cells are text, never markup.

function table(id, head, rows) {
  const element = document.getElementById(id);
  element.replaceChildren();
  if (head.length) {
    const top = element.createTHead().insertRow();
    for (const words of head) {
      const cell = document.createElement('th');
      cell.scope = 'col';
      cell.textContent = words;
      top.append(cell);
    }
  }
  const body = element.createTBody();
  for (const row of rows) {
    const line = body.insertRow();
    row.forEach((content, index) => {
      const { text, kind } = typeof content === 'object' ? content : { text: content, kind: '' };
      const cell = document.createElement(index === 0 ? 'th' : 'td');
      if (index === 0) cell.scope = 'row';
      cell.textContent = text;
      if (kind) cell.className = kind;
      line.append(cell);
    });
  }
}

function tables(data) {
  const number = (text) => ({ text, kind: 'number' });
  table('figures', [], data.figures);
  table('margins', ['constraint', 'what', 'found', 'allowed', 'room', 'verdict'], data.margins.map((row) => [
    row.constraint.replace('_', ' '), row.about, number(row.found), number(row.bound), number(row.room),
    row.kept ? 'kept' : { text: 'BROKEN', kind: 'bad' },
  ]));
  table('violations', ['constraint', 'violation'], data.violations.map(([name, size]) => [name.replace('_', ' '), number(size)]));
  table('provenance', [], data.provenance);
  document.getElementById('scenario').textContent = data.scenario;
  document.getElementById('takeovers').hidden = takeovers(data).length === 0;
  const section = document.getElementById('wire-section');
  section.hidden = data.wire.length === 0;
  table('wire', ['time (s)', 'way', 'message', 'content'], data.wire.map((row) => [number(row.time.toFixed(2)), row.way, row.name, row.content]));
}

/** Where everything is at an instant, for those who do not see the map. */
function positions(data, time) {
  const at = (name, way) => {
    const { x, y } = placeAt(way, time);
    return [name, { text: x.toFixed(3), kind: 'number' }, { text: y.toFixed(3), kind: 'number' }];
  };
  const vehicles = ways(data).filter((path) => path.kind !== 'step');
  table('positions', ['what', `east (${data.map.unit})`, `north (${data.map.unit})`], [
    ...vehicles.map((path) => at(data.agents[path.agent].name, path)),
    ...data.map.sensors.map((sensor) => at(sensor.name, sensor)),
  ]);
}

/** The legend of the map: each mark as it is drawn. */
function legend(data) {
  const list = document.getElementById('legend');
  const add = (words, drawing) => {
    const item = document.createElement('li');
    const mark = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
    mark.setAttribute('width', '34');
    mark.setAttribute('height', '18');
    mark.setAttribute('aria-hidden', 'true');
    for (const [name, attributes] of drawing) {
      const part = document.createElementNS('http://www.w3.org/2000/svg', name);
      Object.entries(attributes).forEach(([key, value]) => part.setAttribute(key, value));
      mark.append(part);
    }
    item.append(mark, words);
    list.append(item);
  };
  const line = (stroke, width, dash) => ['line', { x1: 2, x2: 32, y1: 9, y2: 9, stroke, 'stroke-width': width, 'stroke-dasharray': dash }];
  const back = ['rect', { width: 34, height: 18, fill: '#3b6f8c' }];
  const has = (kind) => data.paths.some((path) => path.kind === kind);
  list.replaceChildren();
  const flown = has('flown');
  data.agents.forEach(({ name, colour }, index) => {
    add(`${name}, ${flown ? 'flown' : 'planned'}`, [line('#ffffff', 6, ''), line(colour, 3.2, DASHES[index % DASHES.length].join(' '))]);
  });
  if (has('step')) add(takeovers(data).length ? 'plan of each step' : 'plan', [line('#ffffff', 4, ''), line(data.agents[0].colour, 1.4, '5 4')]);
  add('start', [['circle', { cx: 17, cy: 9, r: 6, fill: '#ffffff', stroke: data.agents[0].colour, 'stroke-width': 3 }]]);
  add('goal', [['rect', { x: 11, y: 3, width: 12, height: 12, fill: data.agents[0].colour }]]);
  add('sensor', [back, ['circle', { cx: 17, cy: 9, r: 5, fill: '#ffffff', stroke: INK, 'stroke-width': 1.8 }]]);
  if (data.map.sensors.some((sensor) => sensor.x.length > 1)) add('track of a sensor', [back, line('#ffffff', 1.6, '7 5')]);
  if (data.map.regions.length) add('forbidden', [['rect', { x: 4, y: 1, width: 26, height: 16, fill: 'none', stroke: 'currentColor' }], ['path', { d: 'M4 17 L20 1 M12 17 L28 1 M20 17 L30 7', stroke: 'currentColor' }]]);
  if (data.paths.some((path) => path.jam.some((level) => level > FAINTEST))) add(`jamming (width: level, up to ${figure(Number(loudest(data).toFixed(2)))})`, [back, line('#fff3a6', 12, '')]);
  if (data.paths.some((path) => path.dropout.some((level) => level >= 0.5))) add('dropout (transmitter silent)', [line('#ffffff', 8.6, ''), line(data.agents[0].colour, 6.4, ''), line('#ffffff', 2.6, '')]);
}
