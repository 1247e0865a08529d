// What links it all: one instant, set by the slider, by a diagram, by the map or by the play button.

const data = JSON.parse(document.getElementById('data').textContent);
const get = (id) => document.getElementById(id);
const STEPS = 1000;
const PLAY_SECONDS = 20;

/** Colours of the page as they are now. */
function colours() {
  const style = getComputedStyle(document.documentElement);
  return { ink: style.getPropertyValue('--ink').trim(), line: style.getPropertyValue('--line').trim() };
}

/** An agent's colour in a diagram: black would not show on a dark page. */
function tint(colour) {
  return colour === '#111111' ? colours().ink : colour;
}

const listeners = [];
const moment = {
  time: data.time[0],
  set(time, source) {
    const [first, last] = data.time;
    this.time = Math.min(Math.max(time, first), last);
    listeners.forEach((update) => update(source));
  },
};

function words(time) {
  const [unit, second] = data.clock;
  return `${(time / second).toFixed(second > 1 ? 2 : 1)} ${unit}`;
}

get('title').textContent = data.title;
get('subtitle').textContent = data.subtitle;
if (data.alarming) get('subtitle').className = 'bad';
tables(data);
legend(data);

const map = new FlightMap(data, get('map'), moment);
const charts = new Charts(data, get('charts'), moment);
const slider = get('slider');
listeners.push((source) => map.update(), (source) => charts.update(source), (source) => {
  const [first, last] = data.time;
  if (source !== slider) slider.value = Math.round((STEPS * (moment.time - first)) / (last - first));
  slider.setAttribute('aria-valuetext', words(moment.time));
  get('now').textContent = words(moment.time);
});
listeners.push(() => positions(data, moment.time));
slider.addEventListener('input', () => {
  const [first, last] = data.time;
  moment.set(first + ((last - first) * slider.value) / STEPS, slider);
});

data.fields.metrics.forEach((field, index) => get('metric').add(new Option(field.name, index)));
function choose(index) {
  const { ticks, label, low, high } = data.fields.metrics[index];
  map.choose(index);
  get('bar').style.background = `linear-gradient(to right, ${data.map.colours.join(',')})`;
  get('ticks').replaceChildren(...ticks.map(([share, text]) => {
    const tick = document.createElement('span');
    tick.textContent = text;
    tick.style.left = `${100 * share}%`;
    if (share < 0.04) tick.className = 'first';
    if (share > 0.96) tick.className = 'last';
    return tick;
  }));
  const height = data.fields.height ? `, at height ${data.fields.height}` : '';
  get('scale-label').textContent = label + height;
  get('scale').setAttribute('aria-label', `Colour scale of ${label}, from ${figure(low)} to ${figure(high)}`);
}
get('metric').addEventListener('change', (event) => choose(Number(event.target.value)));
get('metric').value = String(Math.max(0, data.fields.metrics.findIndex((field) => field.id === data.background)));
choose(Number(get('metric').value));

get('closer').addEventListener('click', () => map.zoom(1.5));
get('farther').addEventListener('click', () => map.zoom(1 / 1.5));
get('whole').addEventListener('click', () => map.zoom(0));

let playing = null;
function play(on) {
  const [first, last] = data.time;
  get('play').setAttribute('aria-pressed', String(on));
  get('play').textContent = on ? 'Pause' : 'Play';
  cancelAnimationFrame(playing);
  if (!on) return;
  let before = null;
  if (moment.time >= last) moment.set(first);
  const frame = (now) => {
    if (before !== null) moment.set(moment.time + ((now - before) / 1000) * ((last - first) / PLAY_SECONDS));
    before = now;
    if (moment.time >= last) play(false);
    else playing = requestAnimationFrame(frame);
  };
  playing = requestAnimationFrame(frame);
}
get('play').addEventListener('click', () => play(get('play').getAttribute('aria-pressed') !== 'true'));
get('clock').addEventListener('submit', (event) => event.preventDefault());

window.addEventListener('resize', () => {
  map.resize();
  charts.resize();
});

function restyle() {
  map.restyle();
  charts.restyle();
}
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', restyle);
window.addEventListener('beforeprint', () => {
  document.documentElement.dataset.theme = 'light';
  restyle();
});
window.addEventListener('afterprint', () => {
  delete document.documentElement.dataset.theme;
  restyle();
});
// `report.html#t=120` opens at an instant, in seconds.
const asked = Number(new URLSearchParams(location.hash.slice(1)).get('t') ?? NaN);
moment.set(Number.isFinite(asked) ? asked : data.time[0]);

// Live: every event is all that is known. Who looks at the newest instant stays there.
const live = get('data').dataset.live;
if (live) {
  moment.set(data.time[1]);
  const source = new EventSource(live);
  source.addEventListener('message', (event) => {
    const isNewest = moment.time >= data.time[1];
    Object.assign(data, JSON.parse(event.data));
    get('subtitle').textContent = data.subtitle;
    tables(data);
    legend(data);
    map.reload();
    charts.reload();
    choose(Number(get('metric').value));
    queueMicrotask(() => moment.set(isNewest ? data.time[1] : moment.time));
  });
  source.addEventListener('error', () => {
    get('subtitle').textContent = `${data.subtitle}; the flight is over, or its program has ended`;
    source.close();
  });
}
