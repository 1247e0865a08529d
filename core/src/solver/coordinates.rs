//! The iterate: paths measured from straight lines, in steps at full speed.
//!
//! With h the interval, v the agent's speed bound and L = goal - start,
//!
//! x_i = start + (i / N) L + v h e_i,   h = `interval` / r,
//!
//! so that the iterate is the offsets e_1 .. e_(N-1) of every agent and one pace r. In y_i = e_i + (i / N) r l,
//! with l = L / (v `interval`), a step of the path is y_i - y_(i-1) in units of v h: the speed bound is the unit
//! ball, whatever the flight time. The acceleration bound |D2 e_i| <= a h / v shrinks like 1 / r, which is convex
//! from the wrong side; its tangent at the present pace lies inside it. Everything that the planner keeps to is
//! therefore convex in (e, r) together: a point between two feasible iterates is feasible.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | e_i | `offset` | v h | N + 1 points an agent, ends zero |
//! | r | `pace` | | 1 |
//! | l | `reach` | v `interval` | `DIM` an agent |
//!
//! Controls (see [`super::controls`]) are part of the iterate as they are. The metric of the iterate is |D1 e|^2
//! over all agents + m r^2 + the squares of the controls times [`CONTROL_WEIGHT`], with m = [`Frame::inertia`]: the squared change
//! of velocity, which makes the rate of descent independent of N.

use crate::math::{Point, Real, norm_squared, origin};
use crate::scenario::{Agent, BeamPattern, View};
use crate::trajectory::{Track, Trajectory};

use super::controls::{Bound, KINDS, Kind};

/// Weight of a squared change of a control in the metric, against one of a velocity over the largest speed.
pub(super) const CONTROL_WEIGHT: f64 = 1.0;

/// Offsets of all agents, and the pace; also a direction or a gradient in their space.
#[derive(Clone, Debug)]
pub(super) struct Iterate<T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
    /// e_i, zero at both ends.
    pub(super) offset: [[Point<T, DIM>; NODES]; AGENTS],
    /// Controls of each agent by [`Kind`], at nodes 1 .. N.
    pub(super) control: [[[T; NODES]; KINDS]; AGENTS],
    /// r.
    pub(super) pace: T,
}

impl<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Iterate<T, DIM, NODES, AGENTS> {
    pub(super) const fn zeros() -> Self {
        let control = [[[T::ZERO; NODES]; KINDS]; AGENTS];
        Self { offset: [[origin(); NODES]; AGENTS], control, pace: T::ZERO }
    }

    /// Makes the ends zero, which a problem with other intervals may have left otherwise.
    pub(super) fn pin_ends(&mut self, intervals: usize) {
        for nodes in &mut self.offset {
            if let Some(first) = nodes.first_mut() {
                *first = Point::zeros();
            }
            if let Some(last) = nodes.get_mut(intervals) {
                *last = Point::zeros();
            }
        }
    }

    /// Interior nodes 1 .. N-1 of each agent.
    pub(super) fn interior(&self, frame: &Frame<T, DIM, AGENTS>) -> impl Iterator<Item = &[Point<T, DIM>]> {
        let last = frame.intervals;
        self.offset.iter().take(frame.agents).map(move |agent| agent.get(1..last).unwrap_or_default())
    }

    /// Interior nodes 1 .. N-1 of each agent, to change.
    pub(super) fn interior_mut(
        &mut self,
        frame: &Frame<T, DIM, AGENTS>,
    ) -> impl Iterator<Item = &mut [Point<T, DIM>]> {
        let last = frame.intervals;
        self.offset.iter_mut().take(frame.agents).map(move |agent| agent.get_mut(1..last).unwrap_or_default())
    }

    /// A control of an agent at nodes 1 .. N.
    pub(super) fn levels(&self, (agent, kind): Slot, intervals: usize) -> &[T] {
        let nodes = self.control.get(agent).and_then(|kinds| kinds.get(kind as usize));
        nodes.and_then(|nodes| nodes.get(1..=intervals)).unwrap_or_default()
    }

    /// A control of an agent at nodes 1 .. N, to change.
    pub(super) fn levels_mut(&mut self, (agent, kind): Slot, intervals: usize) -> &mut [T] {
        let nodes = self.control.get_mut(agent).and_then(|kinds| kinds.get_mut(kind as usize));
        nodes.and_then(|nodes| nodes.get_mut(1..=intervals)).unwrap_or_default()
    }

    /// `self = from + (to - from) * share`.
    pub(super) fn between(&mut self, from: &Self, to: &Self, share: T, frame: &Frame<T, DIM, AGENTS>) {
        for ((mine, a), b) in self.interior_mut(frame).zip(from.interior(frame)).zip(to.interior(frame)) {
            for ((value, &a), &b) in mine.iter_mut().zip(a).zip(b) {
                *value = a + (b - a) * share;
            }
        }
        for (slot, _) in frame.equipment() {
            let sources = from.levels(slot, frame.intervals).iter().zip(to.levels(slot, frame.intervals));
            for (value, (&a, &b)) in self.levels_mut(slot, frame.intervals).iter_mut().zip(sources) {
                *value = a + (b - a) * share;
            }
        }
        self.pace = from.pace + (to.pace - from.pace) * share;
    }

    /// The plain inner product of `self`, a gradient, with `to - from`.
    pub(super) fn slope(&self, from: &Self, to: &Self, frame: &Frame<T, DIM, AGENTS>) -> T {
        let mut sum = self.pace * (to.pace - from.pace);
        for ((gradient, a), b) in self.interior(frame).zip(from.interior(frame)).zip(to.interior(frame)) {
            for ((slope, &a), &b) in gradient.iter().zip(a).zip(b) {
                sum += slope.dot(&(b - a));
            }
        }
        for (slot, _) in frame.equipment() {
            let ends = from.levels(slot, frame.intervals).iter().zip(to.levels(slot, frame.intervals));
            for (&slope, (&a, &b)) in self.levels(slot, frame.intervals).iter().zip(ends) {
                sum += slope * (b - a);
            }
        }
        sum
    }

    /// Makes the used part zero.
    pub(super) fn clear(&mut self, frame: &Frame<T, DIM, AGENTS>) {
        self.interior_mut(frame).for_each(|offsets| offsets.fill(Point::zeros()));
        for (slot, _) in frame.equipment() {
            self.levels_mut(slot, frame.intervals).fill(T::zero());
        }
        self.pace = T::zero();
    }

    /// Copies the used part.
    pub(super) fn assign(&mut self, from: &Self, frame: &Frame<T, DIM, AGENTS>) {
        for (mine, theirs) in self.interior_mut(frame).zip(from.interior(frame)) {
            copy(theirs, mine);
        }
        for (slot, _) in frame.equipment() {
            copy(from.levels(slot, frame.intervals), self.levels_mut(slot, frame.intervals));
        }
        self.pace = from.pace;
    }
}

/// Copies what is in both, and so has no lengths to disagree about.
fn copy<V: Copy>(from: &[V], to: &mut [V]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

/// An agent's control.
pub(super) type Slot = (usize, Kind);

/// What the bounds of one agent are in the iterate's units.
#[derive(Clone, Copy, Debug)]
pub(super) struct AgentFrame<T, const DIM: usize> {
    /// Start, length units.
    pub(super) start: Point<T, DIM>,
    /// L = goal - start, length units.
    pub(super) line: Point<T, DIM>,
    /// v `interval`: distance of one interval at full speed and pace 1, length units.
    pub(super) stride: T,
    /// l = L / stride.
    pub(super) reach: Point<T, DIM>,
    /// a `interval` / v: the acceleration bound at pace 1.
    pub(super) bend_max: T,
    /// Start velocity over v, where it is given.
    pub(super) start_velocity: Option<Point<T, DIM>>,
    /// a h_0 / v with the interval h_0 before the start, where the start is a seam between two plans.
    pub(super) seam: Option<T>,
    /// Bounds of the controls by [`Kind`].
    pub(super) controls: [Bound<T>; KINDS],
}

impl<T: Real, const DIM: usize> AgentFrame<T, DIM> {
    /// The bound on the change from the start velocity to the first step, where that on other changes is `bend`: at a
    /// seam a (h + h_0) / 2, half of which moves with the pace, and otherwise the same.
    pub(super) fn first_bend(&self, bend: T) -> T {
        self.seam.map_or(bend, |seam| (bend + seam) * T::real(0.5))
    }

    /// Derivative of [`Self::first_bend`] by the pace, where that of `bend` is `bend_by_pace`.
    pub(super) fn first_bend_by_pace(&self, bend_by_pace: T) -> T {
        if self.seam.is_some() { bend_by_pace * T::real(0.5) } else { bend_by_pace }
    }
}

/// The map between iterates and trajectories of one scenario.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame<T, const DIM: usize, const AGENTS: usize> {
    /// N.
    pub(super) intervals: usize,
    /// Number of agents.
    pub(super) agents: usize,
    /// Interval at pace 1, s.
    pub(super) interval: T,
    /// Time at node 0, s.
    pub(super) start_time: T,
    /// Smallest pace: the whole of the time there is.
    pub(super) pace_min: T,
    /// Largest pace, where the flight is held to the times between which no node crosses an instant at which terms change, or
    /// where nobody has anywhere to go.
    pub(super) pace_max: Option<T>,
    /// Weight m of the squared pace in the metric.
    pub(super) inertia: T,
    agent: [AgentFrame<T, DIM>; AGENTS],
}

impl<T: Real, const DIM: usize, const AGENTS: usize> Frame<T, DIM, AGENTS> {
    /// The map at which pace 1 is the flight time `duration`.
    pub(super) fn new(scenario: &View<'_, T, DIM>, duration: T) -> Self {
        let intervals = scenario.frame.intervals;
        let interval = duration / T::from_count(intervals.max(1));
        let none = AgentFrame {
            start: Point::zeros(),
            line: Point::zeros(),
            stride: T::one(),
            reach: Point::zeros(),
            bend_max: T::one(),
            start_velocity: None,
            seam: None,
            controls: [Bound::Off; KINDS],
        };
        let mut agent = [none; AGENTS];
        for (slot, given) in agent.iter_mut().zip(scenario.agents) {
            let stride = given.speed_max * interval;
            let line = given.goal - given.start;
            *slot = AgentFrame {
                start: given.start,
                line,
                stride,
                reach: line / stride,
                bend_max: given.accel_max * interval / given.speed_max,
                start_velocity: given.start_velocity.map(|velocity| velocity / given.speed_max),
                seam: scenario.frame.start_interval.map(|before| given.accel_max * before / given.speed_max),
                controls: control_bounds(given, interval),
            };
        }
        let agents = scenario.agents.len().min(AGENTS);
        let allowed = scenario.frame.time.max - scenario.frame.start_time;
        let mut frame = Self {
            intervals,
            agents,
            interval,
            start_time: scenario.frame.start_time,
            pace_min: duration / allowed,
            pace_max: None,
            inertia: T::zero(),
            agent,
        };
        // A change of pace alone moves every step by about its own length; the second part keeps the weight away
        // from zero where start and goal coincide.
        let count = T::from_count(intervals.max(1));
        let stretch: T =
            frame.agent().map(|a| norm_squared(&a.reach) / count).fold(T::zero(), |sum, part| sum + part);
        frame.inertia = stretch + count * T::from_count(agents.max(1));
        if frame.agent().all(|agent| norm_squared(&agent.line) == T::zero()) {
            frame.pace_max = Some(duration / scenario.shortest_flight());
        }
        frame
    }

    /// Holds the flight time between the shortest and the longest given.
    pub(super) fn hold(&mut self, [shortest, longest]: [Option<T>; 2]) {
        let whole = self.duration(T::one());
        self.pace_min = longest.map_or(self.pace_min, |longest| self.pace_min.max(whole / longest));
        let most = shortest.map(|shortest| whole / shortest);
        self.pace_max = most.map_or(self.pace_max, |most| Some(self.pace_max.map_or(most, |known| known.min(most))));
    }

    /// Room to the smallest pace, and to the largest where there is one.
    pub(super) fn pace_slacks(&self, pace: T) -> [Option<T>; 2] {
        [Some(pace - self.pace_min), self.pace_max.map(|most| most - pace)]
    }

    /// Frames of the agents there are.
    pub(super) fn agent(&self) -> impl Iterator<Item = &AgentFrame<T, DIM>> {
        self.agent.iter().take(self.agents)
    }

    /// The controls that there are, with their bounds.
    pub(super) fn equipment(&self) -> impl Iterator<Item = (Slot, Bound<T>)> {
        self.agent().enumerate().flat_map(|(agent, frame)| {
            let all = Kind::ALL.into_iter().zip(frame.controls);
            all.filter(|(_, bound)| *bound != Bound::Off).map(move |(kind, bound)| ((agent, kind), bound))
        })
    }

    /// l / N of each agent, times the pace: the step of the straight line.
    pub(super) fn cruise(&self, agent: &AgentFrame<T, DIM>, pace: T) -> Point<T, DIM> {
        agent.reach * (pace / T::from_count(self.intervals.max(1)))
    }

    /// Flight time at a pace, s.
    pub(super) fn duration(&self, pace: T) -> T {
        self.interval * T::from_count(self.intervals) / pace
    }

    /// Writes an iterate out as positions, times and controls.
    pub(super) fn expand<const NODES: usize>(
        &self,
        iterate: &Iterate<T, DIM, NODES, AGENTS>,
        trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
    ) {
        trajectory.set_duration(self.start_time, self.duration(iterate.pace));
        let count = T::from_count(self.intervals.max(1));
        for ((track, offsets), agent) in trajectory.active_mut().iter_mut().zip(&iterate.offset).zip(self.agent()) {
            let scale = agent.stride / iterate.pace;
            let nodes = track.path.iter_mut().zip(offsets).take(self.intervals).enumerate();
            for (node, (position, offset)) in nodes {
                let share = T::from_count(node) / count;
                *position = agent.start + agent.line * share + offset * scale;
            }
            if let Some(goal) = track.path.get_mut(self.intervals) {
                *goal = agent.start + agent.line;
            }
        }
        for ((agent, kind), _) in self.equipment() {
            let levels = iterate.levels((agent, kind), self.intervals);
            if let Some(nodes) = trajectory.tracks.get_mut(agent).map(|track| of_track(track, kind)) {
                let nodes = nodes.get_mut(1..=self.intervals).unwrap_or_default().iter_mut();
                nodes.zip(levels).for_each(|(mine, &level)| *mine = level);
            }
        }
    }

    /// Reads an iterate off positions and flight time; the inverse of [`Frame::expand`].
    pub(super) fn collapse<const NODES: usize>(
        &self,
        trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
        iterate: &mut Iterate<T, DIM, NODES, AGENTS>,
    ) {
        iterate.pace = self.duration(T::one()) / trajectory.duration();
        let count = T::from_count(self.intervals.max(1));
        let pace = iterate.pace;
        for ((track, offsets), agent) in trajectory.active().iter().zip(&mut iterate.offset).zip(self.agent()) {
            let scale = pace / agent.stride;
            let nodes = track.path.iter().zip(offsets).take(self.intervals).enumerate().skip(1);
            for (node, (position, offset)) in nodes {
                let share = T::from_count(node) / count;
                *offset = (position - agent.start - agent.line * share) * scale;
            }
        }
        for ((agent, kind), _) in self.equipment() {
            let Some(track) = trajectory.tracks.get(agent) else { continue };
            let nodes = match kind {
                Kind::Jam => &track.jam,
                Kind::Azimuth => &track.azimuth,
                Kind::Dropout => &track.dropout,
            };
            let nodes = nodes.get(1..=self.intervals).unwrap_or_default();
            let levels = iterate.levels_mut((agent, kind), self.intervals).iter_mut();
            levels.zip(nodes).for_each(|(mine, &level)| *mine = level);
        }
    }

    /// Chain rule: turns a gradient by positions and node times into one by offsets and pace.
    pub(super) fn pull_back<const NODES: usize>(
        &self,
        iterate: &Iterate<T, DIM, NODES, AGENTS>,
        by_trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
        gradient: &mut Iterate<T, DIM, NODES, AGENTS>,
    ) {
        let count = T::from_count(self.intervals.max(1));
        // dF / dtau, with t_i = t_0 + (i / N) tau.
        let mut by_duration = T::zero();
        for (node, &by_time) in by_trajectory.times.iter().enumerate().take(self.intervals + 1) {
            by_duration += by_time * (T::from_count(node) / count);
        }
        // dh / dr = -h / r, in positions and in flight time alike.
        let mut by_pace = -by_duration * self.duration(iterate.pace) / iterate.pace;
        let sources = by_trajectory.active().iter().zip(iterate.interior(self)).zip(self.agent());
        for (slopes, ((track, offsets), agent)) in gradient.interior_mut(self).zip(sources) {
            let scale = agent.stride / iterate.pace;
            let by_position = track.path.get(1..self.intervals).unwrap_or_default();
            for ((slope, by_position), offset) in slopes.iter_mut().zip(by_position).zip(offsets) {
                *slope = by_position * scale;
                by_pace -= slope.dot(offset) / iterate.pace;
            }
        }
        gradient.pace = by_pace;
        for ((agent, kind), _) in self.equipment() {
            if let Some(nodes) = by_trajectory.tracks.get_mut(agent).map(|track| of_track(track, kind)) {
                let slopes = nodes.get(1..=self.intervals).unwrap_or_default();
                let levels = gradient.levels_mut((agent, kind), self.intervals).iter_mut();
                levels.zip(slopes).for_each(|(mine, &slope)| *mine = slope);
            }
        }
    }

    /// Squared length of `to - from` in the metric.
    pub(super) fn distance_squared<const NODES: usize>(
        &self,
        from: &Iterate<T, DIM, NODES, AGENTS>,
        to: &Iterate<T, DIM, NODES, AGENTS>,
    ) -> T {
        let change = to.pace - from.pace;
        let mut sum = self.inertia * change * change;
        for (a, b) in from.interior(self).zip(to.interior(self)) {
            let mut before = Point::<T, DIM>::zeros();
            for (&a, &b) in a.iter().zip(b) {
                let here = b - a;
                sum += norm_squared(&(here - before));
                before = here;
            }
            sum += norm_squared(&before);
        }
        for (slot, _) in self.equipment() {
            let ends = from.levels(slot, self.intervals).iter().zip(to.levels(slot, self.intervals));
            sum += ends.fold(T::zero(), |part, (&a, &b)| part + (b - a).squared()) * T::real(CONTROL_WEIGHT);
        }
        sum
    }

    /// Length in the metric of the gradient's representative, the direction of steepest descent, which is left in
    /// `direction`: one tridiagonal system D1'D1 u = g an agent.
    pub(super) fn steepest<const NODES: usize>(
        &self,
        gradient: &Iterate<T, DIM, NODES, AGENTS>,
        direction: &mut Iterate<T, DIM, NODES, AGENTS>,
    ) -> T {
        let count = T::from_count(self.intervals.max(1));
        let mut sum = gradient.pace * gradient.pace / self.inertia;
        for (offsets, slopes) in direction.interior_mut(self).zip(gradient.interior(self)) {
            // Summed once from the left, D1'D1 u = g says: u's step into node i + 1 is its first step less the sum
            // of g up to i. That u ends at zero fixes the first step.
            let mut weighted = Point::<T, DIM>::zeros();
            for (index, slope) in slopes.iter().enumerate() {
                weighted += slope * (T::from_count(self.intervals.saturating_sub(index + 1)) / count);
            }
            let (mut step, mut here) = (weighted, Point::<T, DIM>::zeros());
            for (offset, slope) in offsets.iter_mut().zip(slopes) {
                here += step;
                sum += slope.dot(&here);
                *offset = here;
                step -= slope;
            }
        }
        for (slot, _) in self.equipment() {
            let slopes = gradient.levels(slot, self.intervals);
            for (level, &slope) in direction.levels_mut(slot, self.intervals).iter_mut().zip(slopes) {
                *level = slope / T::real(CONTROL_WEIGHT);
                sum += slope * *level;
            }
        }
        direction.pace = gradient.pace / self.inertia;
        sum.max(T::zero()).sqrt()
    }
}

/// The control of a track by its kind.
fn of_track<T, const DIM: usize, const NODES: usize>(
    track: &mut Track<T, DIM, NODES>,
    kind: Kind,
) -> &mut [T; NODES] {
    match kind {
        Kind::Jam => &mut track.jam,
        Kind::Azimuth => &mut track.azimuth,
        Kind::Dropout => &mut track.dropout,
    }
}

/// What an agent's equipment lets it control, by [`Kind`], with `interval` seconds at pace 1.
fn control_bounds<T: Real, const DIM: usize>(agent: &Agent<T, DIM>, interval: T) -> [Bound<T>; KINDS] {
    let level = |budget: T| Bound::Level { allowance: budget / interval };
    let jam = agent.jammer.map_or(Bound::Off, |jammer| level(jammer.budget));
    let azimuth = match agent.jammer.map(|jammer| jammer.pattern) {
        Some(BeamPattern::Cosine | BeamPattern::Cone { .. }) => Bound::Free,
        _ => Bound::Off,
    };
    let dropout = agent.dropout.map_or(Bound::Off, |dropout| level(dropout.budget));
    [jam, azimuth, dropout]
}
