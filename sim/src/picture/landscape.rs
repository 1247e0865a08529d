//! The landscape: a metric over the area as colours, and what happens there on top of it.
//!
//! | part | drawn as |
//! |---|---|
//! | metric | colours with a bar; the outermost percent of values at either end share the end's colour |
//! | sensor | white dot with its name; a moving one at the picture's instant, its track dashed |
//! | region | what is forbidden hatched: the region, or all around one to stay in |
//! | flight | coloured line with arrowheads, ring at the start, square at the goal |
//! | jamming | pale band along the flight, as wide as the level is high; rays where a beam points |
//! | dropout | wider line with a white core where the transmitter is at least half silent |
//!
//! Both axes have the same scale.

use quietpath_core::scenario::Side;

use super::canvas::{Align, Area, Canvas, INK, Stroke, Type};
use super::colour;
use super::font;
use super::marks::{self, Entry, LABEL_TEXT, Numbers, SAMPLE, Sampler, TICK_TEXT};
use super::scale::{Kind, Scale, trimmed};
use super::{DrawError, Grid, Picture};

/// Largest width and height of the area between the axes.
const ROOM: [f64; 2] = [780.0, 760.0];
/// Smallest side of the area between the axes, for very long and narrow domains.
const SIDE_MIN: f64 = 90.0;
/// Width of the colour bar.
const BAR: f64 = 20.0;
/// Jamming levels and dropouts below this are not drawn.
const FAINTEST: f64 = 0.02;
/// Length of the rays that tell where a beam points.
const RAY: f64 = 34.0;
/// Least distance of two rays along a flight.
const RAYS_APART: f64 = 26.0;
/// Opacity of the bands that tell of jamming.
const JAM_OPACITY: f64 = 0.55;
/// Usual width of a flight's line.
pub const LINE: f64 = 3.2;
/// Arrowheads along a flight of usual length.
const ARROWS: usize = 7;
/// Flights from which on fewer arrowheads show each way, so that they do not hide each other.
const CROWD: usize = 3;
/// Arrowheads along a flight among many.
const ARROWS_IN_CROWD: usize = 2;

/// A sensor on the map.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Its name.
    pub name: String,
    /// Where it is at the picture's instant.
    pub position: [f64; 2],
    /// The way it takes; empty for one that stays.
    pub track: Vec<[f64; 2]>,
}

/// A region to keep out of or to stay in.
#[derive(Clone, Debug)]
pub struct Region {
    /// Its name.
    pub name: String,
    /// Corners of its outline.
    pub ring: Vec<[f64; 2]>,
    /// Which side of the outline flights stay on.
    pub side: Side,
}

/// One agent's flight.
#[derive(Clone, Debug)]
pub struct Flight {
    /// What the legend calls it; empty to leave it out.
    pub name: String,
    /// Colour, as CSS.
    pub colour: String,
    /// Dash pattern; empty for a solid line.
    pub dash: &'static str,
    /// Width of the line; [`LINE`] is the usual.
    pub width: f64,
    /// Which of its ends are marked.
    pub ends: Ends,
    /// Its nodes.
    pub points: Vec<[f64; 2]>,
    /// Jamming level at each node, 0 to 1; may be empty.
    pub jam: Vec<f64>,
    /// Direction of a beam at each node, rad counter-clockwise from east; empty where jamming has no direction.
    pub azimuth: Vec<f64>,
    /// Dropout at each node, 0 to 1; may be empty.
    pub dropout: Vec<f64>,
}

/// Which ends of a flight are marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// Start and goal.
    Both,
    /// The start alone: the flight goes on.
    Start,
    /// The goal alone: the flight has begun before.
    Goal,
    /// None, and no arrowheads either: one of many.
    Neither,
}

/// What the landscape shows; all positions in the unit that the axes name.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Headline.
    pub title: String,
    /// The line below it.
    pub subtitle: String,
    /// Unit of the axes.
    pub unit: &'static str,
    /// The metric; its extent is that of the picture.
    pub grid: Grid,
    /// What kind of number the metric is.
    pub kind: Kind,
    /// Name and unit of the metric.
    pub metric: String,
    /// Sensors.
    pub sensors: Vec<Sensor>,
    /// Regions.
    pub regions: Vec<Region>,
    /// Flights, in the order of their colours.
    pub flights: Vec<Flight>,
}

/// Draws a landscape.
///
/// # Errors
/// Where the heat map cannot be encoded, as for a grid without cells.
pub fn draw(scene: &Scene) -> Result<Picture, DrawError> {
    let (x_scale, y_scale) = (span(scene.grid.x), span(scene.grid.y));
    let (dx, dy) = (x_scale.max - x_scale.min, y_scale.max - y_scale.min);
    let unit = (ROOM[0] / dx).min(ROOM[1] / dy);
    let sides = [(dx * unit).max(SIDE_MIN), (dy * unit).max(SIDE_MIN)];
    let ticks = [wanted(sides[0], 85.0), wanted(sides[1], 75.0)];
    let numbers = y_scale.ticks(ticks[1]).iter().map(|tick| font::width(&tick.label, TICK_TEXT)).fold(0.0, f64::max);
    let area = Area { left: numbers + 48.0, top: 84.0, width: sides[0], height: sides[1] };
    let map = Map { area, x: x_scale, y: y_scale };

    let mut canvas = Canvas::new();
    marks::heading(&mut canvas, [area.left, 34.0], &scene.title, &scene.subtitle);
    let scale = Scale::of_values(&scene.grid.values, scene.kind);
    let mut inside = Canvas::clipped("area");
    let uri = colour::heat_map(&scene.grid, &scale).map_err(DrawError::new)?;
    inside.image(area, uri);
    regions(&mut inside, &map, &scene.regions);
    flights(&mut inside, &map, &scene.flights);
    sensors(&mut inside, &map, scene);
    canvas.place(inside);
    canvas.rectangle(area, "none", Stroke::solid(INK, 1.2));
    marks::x_axis(&mut canvas, area, &x_scale, ticks[0], Numbers::Shown);
    marks::y_axis(&mut canvas, area, &y_scale, ticks[1]);
    let label = Type::plain(LABEL_TEXT, Align::Middle);
    let below = area.bottom() + 46.0;
    canvas.text([area.left + 0.5 * area.width, below], &format!("east, x ({})", scene.unit), label);
    canvas.upward([20.0, area.top + 0.5 * area.height], &format!("north, y ({})", scene.unit), label);
    let bar = Area { left: area.right() + 26.0, width: BAR, top: area.top + 16.0, height: area.height - 32.0 };
    marks::colour_bar(&mut canvas, bar, &scale, &scene.metric, beyond(scene, &scale));
    let right = bar.right() + marks::colour_bar_numbers(&scale) + LABEL_TEXT + 30.0;
    let heading = (1.12 * font::width(&scene.title, 20.0)).max(font::width(&scene.subtitle, 14.0));
    let width = right.max(area.left + heading + 24.0);
    let legend = marks::legend(&mut canvas, [area.left, below + 14.0], width - area.left - 24.0, &entries(scene));
    Ok(canvas.finish(width, below + 14.0 + legend + 16.0, &[("area", area)]))
}

fn span(ends: [f64; 2]) -> Scale {
    Scale::linear(ends[0], ends[1])
}

/// Ticks that fit on a length, one for each `apart`.
fn wanted(length: f64, apart: f64) -> usize {
    (length / apart).clamp(2.0, 10.0) as usize
}

/// Whether values lie below and above the colours.
fn beyond(scene: &Scene, scale: &Scale) -> [bool; 2] {
    let any = |test: &dyn Fn(f64) -> bool| scene.grid.values.iter().any(|value| value.is_finite() && test(*value));
    let slack = 1e-9 * (scale.max - scale.min);
    [any(&|value| value < scale.min - slack), any(&|value| value > scale.max + slack)]
}

/// From positions to places on the sheet.
struct Map {
    area: Area,
    x: Scale,
    y: Scale,
}

impl Map {
    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.area.left + self.x.share(x) * self.area.width, self.area.bottom() - self.y.share(y) * self.area.height]
    }

    fn all(&self, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        points.iter().map(|point| self.at(*point)).collect()
    }
}

fn regions(canvas: &mut Canvas, map: &Map, regions: &[Region]) {
    for region in regions {
        let ring = map.all(&region.ring);
        let rim = Stroke::solid("#333333", 1.6);
        let count = ring.len().max(1) as f64;
        let [x, middle] = [0, 1].map(|axis| ring.iter().filter_map(|corner| corner.get(axis)).sum::<f64>() / count);
        let label = match region.side {
            Side::Outside => {
                canvas.polygon(&ring, "url(#hatch)", rim);
                middle
            }
            Side::Inside => {
                canvas.around(map.area, &ring, "url(#hatch)", rim);
                // Below the topmost corner, where flights are rare.
                ring.iter().map(|corner| corner[1]).fold(f64::INFINITY, f64::min) + 24.0
            }
        };
        let y = label.clamp(map.area.top + 20.0, map.area.bottom() - 10.0);
        canvas.label([x, y], &region.name, Type::plain(TICK_TEXT, Align::Middle));
    }
}

fn flights(canvas: &mut Canvas, map: &Map, flights: &[Flight]) {
    let loudest = highest(flights, |flight| &flight.jam);
    let mut bands = Canvas::faded(JAM_OPACITY);
    for flight in flights {
        controls(&mut bands, &map.all(&flight.points), &flight.jam, loudest);
    }
    canvas.place(bands);
    // All rims below all lines, so that no rim hides a wider line on the same way.
    for flight in flights {
        canvas.polyline(&map.all(&flight.points), Stroke::solid("#ffffff", flight.width + 2.4).opacity(0.9));
    }
    for flight in flights {
        let points = map.all(&flight.points);
        canvas.polyline(&points, Stroke::solid(&flight.colour, flight.width).dashed(flight.dash));
        silence(canvas, &points, flight);
    }
    for flight in flights {
        rays(canvas, &map.all(&flight.points), flight);
    }
    let arrows_max = if flights.len() > CROWD { ARROWS_IN_CROWD } else { ARROWS };
    for flight in flights.iter().filter(|flight| flight.ends != Ends::Neither) {
        let points = map.all(&flight.points);
        arrows(canvas, &points, &flight.colour, arrows_max);
        if let (Some(start), Ends::Both | Ends::Start) = (points.first(), flight.ends) {
            start_mark(canvas, *start, &flight.colour);
        }
        if let (Some(goal), Ends::Both | Ends::Goal) = (points.last(), flight.ends) {
            goal_mark(canvas, *goal, &flight.colour);
        }
    }
}

/// The band that tells of jamming. Controls hold over the interval that ends at their node.
fn controls(canvas: &mut Canvas, points: &[[f64; 2]], jam: &[f64], loudest: f64) {
    for (ends, level) in points.windows(2).zip(jam.iter().skip(1)) {
        if *level > FAINTEST {
            canvas.polyline(ends, Stroke::solid("#fff3a6", 6.0 + 14.0 * level / loudest));
        }
    }
}

/// Rays from the flight to where its beam points, as far apart as can be told from each other.
fn rays(canvas: &mut Canvas, points: &[[f64; 2]], flight: &Flight) {
    let mut since = RAYS_APART;
    let nodes = points.windows(2).zip(flight.azimuth.iter().zip(&flight.jam).skip(1));
    for (ends, (azimuth, level)) in nodes {
        since += length(ends);
        if let ([_, at], true) = (ends, *level > FAINTEST && since >= RAYS_APART) {
            ray(canvas, *at, *azimuth);
            since = 0.0;
        }
    }
}

fn ray(canvas: &mut Canvas, [x, y]: [f64; 2], azimuth: f64) {
    let along = [RAY * azimuth.cos(), -RAY * azimuth.sin()];
    let tip = [x + along[0], y + along[1]];
    canvas.line([x, y], tip, Stroke::solid("#222222", 3.6).opacity(0.6));
    canvas.line([x, y], tip, Stroke::solid("#fff3a6", 1.8));
    marks::arrowhead(canvas, tip, along, 5.5, "#222222");
}

/// The highest value of a control in any flight; node 0 has no interval, so its value means nothing.
fn highest(flights: &[Flight], control: impl Fn(&Flight) -> &[f64]) -> f64 {
    flights.iter().flat_map(|flight| control(flight).iter().skip(1)).copied().fold(0.0, f64::max)
}

/// A wider line with a white core where the transmitter is silent.
fn silence(canvas: &mut Canvas, points: &[[f64; 2]], flight: &Flight) {
    let silent = || points.windows(2).zip(flight.dropout.iter().skip(1)).filter(|(_, reduction)| **reduction >= 0.5);
    let width = flight.width.max(6.4);
    for stroke in
        [Stroke::solid("#ffffff", width + 2.2), Stroke::solid(&flight.colour, width), Stroke::solid("#ffffff", 2.6)]
    {
        for (ends, _) in silent() {
            canvas.polyline(ends, stroke);
        }
    }
}

fn start_mark(canvas: &mut Canvas, at: [f64; 2], colour: &str) {
    canvas.circle(at, 8.3, "none", Stroke::solid("#ffffff", 1.5));
    canvas.circle(at, 6.2, "#ffffff", Stroke::solid(colour, 3.0));
}

fn goal_mark(canvas: &mut Canvas, [x, y]: [f64; 2], colour: &str) {
    let mark = Area { left: x - 6.5, top: y - 6.5, width: 13.0, height: 13.0 };
    canvas.rectangle(mark, colour, Stroke::solid("#ffffff", 1.6));
}

/// Arrowheads at equal distances along the path, fewer on a short one.
fn arrows(canvas: &mut Canvas, points: &[[f64; 2]], colour: &str, most: usize) {
    let legs: Vec<f64> = points.windows(2).map(length).collect();
    let total: f64 = legs.iter().sum();
    let count = wanted(total, 110.0).min(most);
    for number in 0..count {
        let mut left = total * (number as f64 + 0.5) / count as f64;
        for (leg, length) in points.windows(2).zip(&legs) {
            if left <= *length && *length > 0.0 {
                if let [a, b] = leg {
                    let (share, along) = (left / length, [b[0] - a[0], b[1] - a[1]]);
                    let at = [a[0] + share * along[0], a[1] + share * along[1]];
                    marks::arrowhead(canvas, at, along, 10.5, colour);
                }
                break;
            }
            left -= length;
        }
    }
}

fn length(leg: &[[f64; 2]]) -> f64 {
    if let [a, b] = leg { (b[0] - a[0]).hypot(b[1] - a[1]) } else { 0.0 }
}

fn sensors(canvas: &mut Canvas, map: &Map, scene: &Scene) {
    for sensor in &scene.sensors {
        let track = map.all(&sensor.track);
        canvas.polyline(&track, Stroke::solid("#222222", 3.4).opacity(0.55));
        canvas.polyline(&track, Stroke::solid("#ffffff", 1.8).dashed("7 5"));
        for leg in track.windows(2) {
            if let [a, b] = leg {
                let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
                marks::arrowhead(canvas, middle, [b[0] - a[0], b[1] - a[1]], 7.5, "#222222");
            }
        }
    }
    let mut taken: Vec<[f64; 2]> = scene.flights.iter().flat_map(|flight| map.all(&flight.points)).collect();
    taken.extend(scene.sensors.iter().map(|sensor| map.at(sensor.position)));
    taken.extend(scene.sensors.iter().flat_map(|sensor| map.all(&sensor.track)));
    for sensor in &scene.sensors {
        let at = map.at(sensor.position);
        canvas.circle(at, 5.2, "#ffffff", Stroke::solid("#111111", 2.0));
        let size = [font::width(&sensor.name, TICK_TEXT), TICK_TEXT];
        let corner = free_place(at, size, map.area, &taken);
        canvas.label(corner, &sensor.name, Type::plain(TICK_TEXT, Align::Start));
        for share in [0.0, 0.5, 1.0] {
            taken.push([corner[0] + share * size[0], corner[1] - 0.5 * size[1]]);
        }
    }
}

/// Where to begin a label of a size beside `at`: the first place inside the area without a point that is taken,
/// or the one with fewest.
fn free_place([x, y]: [f64; 2], [width, height]: [f64; 2], area: Area, taken: &[[f64; 2]]) -> [f64; 2] {
    let (side, up, down) = (9.0, -7.0, 7.0 + 0.75 * height);
    let places = [
        [x + side, y + up],
        [x - side - width, y + up],
        [x + side, y + down],
        [x - side - width, y + down],
        [x - 0.5 * width, y - 12.0],
        [x - 0.5 * width, y + 12.0 + 0.75 * height],
    ];
    let trouble = |[left, base]: [f64; 2]| {
        let (right, top) = (left + width, base - height);
        let out = left < area.left + 3.0 || right > area.right() - 3.0;
        let out = out || top < area.top + 2.0 || base > area.bottom() - 4.0;
        let hit = |p: &&[f64; 2]| {
            p[0] > left - 7.0 && p[0] < right + 7.0 && p[1] > top - 5.0 && p[1] < base + 6.0 && **p != [x, y]
        };
        taken.iter().filter(hit).count() + if out { 1000 } else { 0 }
    };
    places.into_iter().min_by_key(|place| trouble(*place)).unwrap_or([x + side, y + up])
}

/// The legend, with only what the picture shows.
fn entries(scene: &Scene) -> Vec<Entry> {
    let mut entries = Vec::new();
    let mut add = |words: &str, sample: Sampler| {
        entries.push(Entry { sample, words: words.to_owned() });
    };
    for flight in scene.flights.iter().filter(|flight| !flight.name.is_empty()) {
        let (colour, dash, has_arrows) = (flight.colour.clone(), flight.dash, flight.ends != Ends::Neither);
        add(
            &flight.name,
            Box::new(move |canvas, [x, y]| {
                canvas.line([x, y], [x + SAMPLE, y], Stroke::solid(&colour, LINE).dashed(dash));
                if has_arrows {
                    marks::arrowhead(canvas, [x + 0.5 * SAMPLE, y], [1.0, 0.0], 10.5, &colour);
                }
            }),
        );
    }
    if !scene.flights.is_empty() {
        let tint = if scene.flights.len() == 1 { colour::agent(0) } else { "#555555" };
        add("start", Box::new(move |canvas, [x, y]| start_mark(canvas, [x + 0.5 * SAMPLE, y], tint)));
        add("goal", Box::new(move |canvas, [x, y]| goal_mark(canvas, [x + 0.5 * SAMPLE, y], tint)));
    }
    if !scene.sensors.is_empty() {
        add(
            "sensor",
            Box::new(|canvas, [x, y]| {
                canvas.circle([x + 0.5 * SAMPLE, y], 5.2, "#ffffff", Stroke::solid("#111111", 2.0));
            }),
        );
    }
    if scene.sensors.iter().any(|sensor| sensor.track.len() > 1) {
        add(
            "sensor track",
            Box::new(|canvas, [x, y]| {
                canvas.line([x, y], [x + SAMPLE, y], Stroke::solid("#222222", 3.4).opacity(0.55));
                canvas.line([x, y], [x + SAMPLE, y], Stroke::solid("#ffffff", 1.8).dashed("7 5"));
            }),
        );
    }
    if !scene.regions.is_empty() {
        add("forbidden region", Box::new(|canvas, [x, y]| region_sample(canvas, [x, y])));
    }
    let level = highest(&scene.flights, |flight| &flight.jam);
    if level > FAINTEST {
        add(
            &format!("jamming (width: level, up to {})", trimmed((level * 100.0).round() / 100.0)),
            Box::new(jam_sample),
        );
    }
    if level > FAINTEST && scene.flights.iter().any(|flight| !flight.azimuth.is_empty()) {
        add("where the beam points", Box::new(|canvas, [x, y]| ray(canvas, [x - 6.0, y], 0.0)));
    }
    if highest(&scene.flights, |flight| &flight.dropout) >= 0.5 {
        add("dropout (transmitter silent)", Box::new(dropout_sample));
    }
    entries
}

fn region_sample(canvas: &mut Canvas, [x, y]: [f64; 2]) {
    let sample = Area { left: x, top: y - 8.0, width: SAMPLE, height: 16.0 };
    canvas.rectangle(sample, "url(#hatch)", Stroke::solid("#333333", 1.6));
}

fn jam_sample(canvas: &mut Canvas, [x, y]: [f64; 2]) {
    canvas.line([x, y], [x + SAMPLE, y], Stroke::solid("#e3cf4f", 14.0).opacity(JAM_OPACITY));
}

fn dropout_sample(canvas: &mut Canvas, [x, y]: [f64; 2]) {
    canvas.line([x, y], [x + SAMPLE, y], Stroke::solid("#555555", 6.4));
    canvas.line([x, y], [x + SAMPLE, y], Stroke::solid("#ffffff", 2.6));
}
