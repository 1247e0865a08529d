// Diagrams over time, one a figure, all at the same instant.

class Charts {
  constructor(data, element, moment) {
    Object.assign(this, { data, element, moment, plots: [] });
    this.figures = data.panels.map((panel) => {
      const box = document.createElement('figure');
      const caption = document.createElement('figcaption');
      caption.textContent = panel.unit ? `${panel.title} (${panel.unit})` : panel.title;
      box.append(caption);
      element.append(box);
      return box;
    });
    this.build();
  }

  build() {
    this.plots = this.data.panels.map((panel, index) => this.plot(panel, this.figures[index]));
    this.update();
  }

  size(box) {
    return { width: Math.max(240, box.clientWidth), height: 170 };
  }

  plot(panel, box) {
    const theme = colours();
    const { clock, time, agents } = this.data;
    const [unit, second] = clock;
    const tables = panel.lines.map((line) => [line.times.map((at) => at / second), line.values]);
    const [times, ...values] = tables.length > 1 ? uPlot.join(tables) : tables[0] || [[], []];
    const axis = { stroke: theme.ink, grid: { stroke: theme.line, width: 1 }, ticks: { stroke: theme.line } };
    const several = agents.length > 1;
    const chart = new uPlot({
      ...this.size(box),
      padding: [8, 10, 0, 0],
      cursor: { y: false, drag: { x: false, y: false, setScale: false }, bind: { mouseleave: () => null, dblclick: () => null } },
      legend: { live: true, markers: { fill: (plot, index) => plot.series[index].stroke(plot, index) } },
      scales: {
        x: { time: false, range: () => time.map((at) => at / second) },
        y: { distr: panel.log ? 3 : 1, range: () => [panel.low, panel.high] },
      },
      axes: [
        { ...axis, label: `time (${unit})`, labelSize: 18, size: 28 },
        { ...axis, size: 58, values: (plot, ticks) => ticks.map((tick) => (tick === null ? '' : figure(tick))) },
      ],
      series: [
        { label: unit, value: (plot, value) => (value === null ? '\u2013' : value.toFixed(1)) },
        ...panel.lines.map((line) => ({
          label: several ? agents[line.agent].name : panel.unit || 'value',
          stroke: () => tint(agents[line.agent].colour),
          width: 2, dash: DASHES[line.agent % DASHES.length], spanGaps: several, points: { show: false },
          value: (plot, value) => figure(value),
        })),
      ],
      hooks: {
        draw: [(plot) => panel.bounds.forEach(([value, words]) => bound(plot, value, words))],
        setCursor: [(plot) => {
          if (this.quiet || plot.cursor.left === undefined || plot.cursor.left < 0) return;
          this.moment.set(plot.posToVal(plot.cursor.left, 'x') * second, plot);
        }],
      },
    }, [times, ...values], box);
    touch(chart, (left) => this.moment.set(chart.posToVal(left, 'x') * second, null));
    return chart;
  }

  update(source) {
    const second = this.data.clock[1];
    this.quiet = true;
    for (const plot of this.plots) {
      if (plot !== source) plot.setCursor({ left: plot.valToPos(this.moment.time / second, 'x'), top: 10 }, false);
    }
    this.quiet = false;
    for (const plot of this.plots) if (plot !== source) plot.setLegend({ idx: plot.valToIdx(this.moment.time / second) });
  }

  resize() {
    this.plots.forEach((plot, index) => plot.setSize(this.size(this.figures[index])));
    this.update();
  }

  restyle() {
    this.plots.forEach((plot) => plot.destroy());
    this.build();
  }
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

/** A finger that moves sideways over a chart moves the time. */
function touch(plot, to) {
  plot.over.addEventListener('pointermove', (event) => {
    if (event.pointerType === 'touch') to(Math.min(Math.max(event.offsetX, 0), plot.over.clientWidth));
  });
}
