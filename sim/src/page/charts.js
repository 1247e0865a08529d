// Diagrams over time, one a figure, all at the same instant.

class Charts {
  constructor(data, element, moment) {
    Object.assign(this, { data, element, moment, plots: [] });
    this.build();
  }

  frames() {
    return this.data.panels.map((panel) => {
      const box = document.createElement('figure');
      const caption = document.createElement('figcaption');
      caption.textContent = panel.unit ? `${panel.title} (${panel.unit})` : panel.title;
      box.append(caption);
      this.element.append(box);
      return box;
    });
  }

  /** Takes over new data: in place where diagrams and lines are the same, so that the page does not jump. */
  reload() {
    const { panels } = this.data;
    const fits = panels.length === this.plots.length && panels.every((panel, index) => panel.lines.length + 1 === this.plots[index].series.length);
    if (!fits) {
      this.restyle();
      return;
    }
    panels.forEach((panel, index) => this.plots[index].setData(this.columns(panel)));
    this.updateSoon();
  }

  /** The numbers of a diagram: times, and the values of each line. */
  columns(panel) {
    const second = this.data.clock[1];
    const tables = panel.lines.map((line) => [line.times.map((at) => at / second), line.values]);
    return tables.length > 1 ? uPlot.join(tables) : tables[0] || [[], []];
  }

  build() {
    this.figures = this.frames();
    this.plots = this.data.panels.map((panel, index) => this.plot(index, this.figures[index]));
    this.updateSoon();
  }

  size(box) {
    return { width: Math.max(240, box.clientWidth), height: 170 };
  }

  plot(index, box) {
    const theme = colours();
    const { clock, agents } = this.data;
    const [unit, second] = clock;
    const panel = this.data.panels[index];
    // New data has new ranges.
    const now = () => this.data.panels[index] ?? panel;
    const axis = { stroke: theme.ink, grid: { stroke: theme.line, width: 1 }, ticks: { stroke: theme.line } };
    const few = panel.log ? { splits: decades, filter: (plot, ticks) => ticks } : {};
    const several = agents.length > 1;
    const chart = new uPlot({
      ...this.size(box),
      padding: [8, 10, 0, 0],
      cursor: { y: false, drag: { x: false, y: false, setScale: false }, bind: { mouseleave: () => null, dblclick: () => null } },
      legend: { live: true, markers: { fill: (plot, index) => plot.series[index].stroke(plot, index) } },
      scales: {
        x: { time: false, range: () => this.data.time.map((at) => at / second) },
        y: { distr: panel.log ? 3 : 1, range: () => [now().low, now().high] },
      },
      axes: [
        { ...axis, label: `time (${unit})`, labelSize: 20, size: 30 },
        {
          ...axis, ...few, size: 64,
          values: (plot, ticks) => ticks.map(mark),
        },
      ],
      series: [
        { label: `time (${unit})`, value: (plot, value) => (Number.isFinite(value) ? value.toFixed(second > 1 ? 2 : 1) : '\u2013') },
        ...panel.lines.map((line) => ({
          label: agents[line.agent].name,
          stroke: () => tint(agents[line.agent].colour),
          width: 2, dash: DASHES[line.agent % DASHES.length], spanGaps: several, points: { show: false },
          value: (plot, value) => figure(value),
        })),
      ],
      hooks: {
        drawClear: [(plot) => takeovers(this.data).forEach((time) => takeover(plot, time / second))],
        draw: [(plot) => now().bounds.forEach(([value, words]) => bound(plot, value, words))],
      },
    }, this.columns(panel), box);
    pointed(chart, (left) => this.moment.set(chart.posToVal(left, 'x') * second, chart));
    return chart;
  }

  /** uPlot lays out in a microtask of its own: places are known behind it. */
  updateSoon() {
    queueMicrotask(() => this.update());
  }

  update(source) {
    const second = this.data.clock[1];
    for (const plot of this.plots) {
      if (plot === source) continue;
      plot.setCursor({ left: plot.valToPos(this.moment.time / second, 'x'), top: 10 }, false);
      plot.setLegend({ idx: plot.valToIdx(this.moment.time / second) });
    }
  }

  resize() {
    this.plots.forEach((plot, index) => plot.setSize(this.size(this.figures[index])));
    this.updateSoon();
  }

  restyle() {
    this.plots.forEach((plot) => plot.destroy());
    this.element.replaceChildren();
    this.build();
  }
}

/** When a new plan took over from another, s. */
function takeovers(data) {
  return ways(data).filter((path) => path.kind === 'step' && path.agent === 0).map((path) => path.times[0]).slice(1);
}

/** A dotted line where a new plan took over. */
function takeover(plot, time) {
  const { ctx, bbox } = plot;
  const dot = window.devicePixelRatio || 1;
  const x = plot.valToPos(time, 'x', true);
  ctx.save();
  ctx.strokeStyle = colours().ink;
  ctx.globalAlpha = 0.45;
  ctx.lineWidth = dot;
  ctx.setLineDash([dot, 3 * dot]);
  ctx.beginPath();
  ctx.moveTo(x, bbox.top);
  ctx.lineTo(x, bbox.top + bbox.height);
  ctx.stroke();
  ctx.restore();
}

/** A dashed limit with its name. */
function bound(plot, value, words) {
  const { ctx, bbox } = plot;
  const dot = window.devicePixelRatio || 1;
  const y = plot.valToPos(value, 'y', true);
  if (!(y >= bbox.top - 1 && y <= bbox.top + bbox.height + 1)) return;
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = colours().ink;
  ctx.lineWidth = 1.2 * dot;
  ctx.setLineDash([6 * dot, 4 * dot]);
  ctx.beginPath();
  ctx.moveTo(bbox.left, y);
  ctx.lineTo(bbox.left + bbox.width, y);
  ctx.stroke();
  ctx.font = `${11 * dot}px system-ui, "DejaVu Sans", sans-serif`;
  ctx.textAlign = 'right';
  ctx.textBaseline = y > bbox.top + 16 * dot ? 'bottom' : 'top';
  ctx.fillText(words, bbox.left + bbox.width - 4 * dot, y + (ctx.textBaseline === 'top' ? 2 : -2) * dot);
  ctx.restore();
}

/** A pointer over a chart moves the time; a finger does so sideways, and scrolls the page up and down. */
function pointed(plot, to) {
  const follow = (event) => {
    const box = plot.over.getBoundingClientRect();
    to(Math.min(Math.max(event.clientX - box.left, 0), box.width));
  };
  plot.over.addEventListener('mousemove', follow);
  plot.over.addEventListener('pointermove', (event) => event.pointerType === 'touch' && follow(event));
}

/** Ticks of a logarithmic axis: powers of ten, and more where there are few of these. */
function decades(plot) {
  const { min, max } = plot.scales.y;
  const span = Math.log10(max / min);
  const leads = span < 2 ? [1, 2, 5] : [1];
  const every = Math.max(1, Math.ceil(span / 5));
  const ticks = [];
  for (let power = Math.floor(Math.log10(min)); power <= Math.log10(max); power += 1) {
    if (power % every === 0) ticks.push(...leads.map((lead) => lead * 10 ** power));
  }
  return ticks.filter((tick) => tick >= min && tick <= max);
}

/** A number on an axis. */
function mark(tick) {
  const size = Math.abs(tick);
  if (tick === 0 || (size < 1e5 && size >= 1e-3)) return figure(tick);
  const power = Math.floor(Math.log10(size) + 1e-9);
  const raised = [...String(power)].map((digit) => '\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079'[digit] ?? '\u207b').join('');
  const lead = Number((tick / 10 ** power).toPrecision(3));
  return lead === 1 ? `10${raised}` : `${lead}\u00b710${raised}`;
}
