//! The Newton system of one agent: banded in the path, eliminated node by node in the controls, bordered by what all
//! nodes share.
//!
//! | symbol | name | shape |
//! |---|---|---|
//! | B | `rows`, path by path | N - 1 block rows |
//! | C_i, G_i | `Local`, controls by controls and by the path around node i | `KINDS` square, `KINDS` x 2 `DIM` |
//! | c_j | `columns`: pace, budgets, worst values | as an agent's part of the iterate |
//!
//! Budgets and worst values are extra unknowns of the border, so that everything else stays local; the border itself
//! is a handful of numbers, reduced to one for the pace that the agents share.
//!
//! Limits: [`EXTREMES_MAX`] worst-case terms an agent.

#![expect(clippy::needless_range_loop, reason = "rows and columns by the letters of the equations")]

use crate::math::{Point, Real, origin};
use crate::solver::controls::KINDS;

use super::block::{self, BlockRow};

/// Worst-case terms that one agent can have in a refinement.
pub(super) const EXTREMES_MAX: usize = 2;
/// Columns of the border: the pace, a budget a kind of level, and the worst values.
pub(super) const COLUMNS: usize = 1 + 2 + EXTREMES_MAX;
/// The column of the pace.
pub(super) const PACE: usize = 0;
/// The first column of budgets: jamming, then dropout.
pub(super) const BUDGETS: usize = 1;
/// The first column of worst values.
pub(super) const EXTREMES: usize = 3;

/// An agent's part of a vector.
#[derive(Clone, Debug)]
pub(super) struct Part<T, const DIM: usize, const NODES: usize> {
    /// By interior index: node - 1.
    pub(super) path: [Point<T, DIM>; NODES],
    /// By node - 1.
    pub(super) control: [[T; KINDS]; NODES],
}

impl<T: Real, const DIM: usize, const NODES: usize> Part<T, DIM, NODES> {
    pub(super) const fn zeros() -> Self {
        Self { path: [origin(); NODES], control: [[T::ZERO; KINDS]; NODES] }
    }

    fn clear(&mut self, intervals: usize) {
        self.path.iter_mut().take(intervals).for_each(|node| *node = Point::zeros());
        self.control.iter_mut().take(intervals).for_each(|node| *node = [T::zero(); KINDS]);
    }

    fn assign(&mut self, from: &Self, intervals: usize) {
        for (mine, theirs) in self.path.iter_mut().zip(&from.path).take(intervals) {
            *mine = *theirs;
        }
        for (mine, theirs) in self.control.iter_mut().zip(&from.control).take(intervals) {
            *mine = *theirs;
        }
    }

    fn dot(&self, other: &Self, intervals: usize, has_controls: Controls) -> T {
        let mut sum = T::zero();
        for (a, b) in self.path.iter().zip(&other.path).take(intervals.saturating_sub(1)) {
            sum += a.dot(b);
        }
        if has_controls == Controls::Some {
            for (a, b) in self.control.iter().zip(&other.control).take(intervals) {
                for (&a, &b) in a.iter().zip(b) {
                    sum += a * b;
                }
            }
        }
        sum
    }
}

/// Whether an agent controls anything besides its path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Controls {
    None,
    Some,
}

/// A node's controls: their matrix, its factor, and what couples them to the path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Local<T, const DIM: usize> {
    pub(super) matrix: [[T; KINDS]; KINDS],
    /// Lower triangle with inverted diagonal.
    factor: [[T; KINDS]; KINDS],
    /// By kind: to this node's offset.
    pub(super) here: [Point<T, DIM>; KINDS],
    /// By kind: to the offset of the node before.
    pub(super) before: [Point<T, DIM>; KINDS],
}

impl<T: Real, const DIM: usize> Local<T, DIM> {
    const fn zeros() -> Self {
        let none = [[T::ZERO; KINDS]; KINDS];
        Self { matrix: none, factor: none, here: [origin(); KINDS], before: [origin(); KINDS] }
    }

    /// Factors the matrix with `shift` on the diagonal; false if it holds what is not a number. Kinds that do not exist
    /// have a zero diagonal and stay out.
    ///
    /// Where a control bends downwards, as silence does that is all but complete, its curvature is taken positive and its
    /// coupling to the path is left out: else the shift that would make it definite would hold the whole path.
    fn factor(&mut self, shift: T) -> bool {
        let mut lower = [[T::zero(); KINDS]; KINDS];
        for column in 0..KINDS {
            let exists = self.matrix[column][column] != T::zero();
            let mut pivot = if exists { self.matrix[column][column] } else { T::one() };
            for k in 0..column {
                pivot -= lower[column][k] * lower[column][k];
            }
            if pivot <= T::zero() {
                pivot = (-pivot).max(T::MIN_POSITIVE);
                (self.here[column], self.before[column]) = (Point::zeros(), Point::zeros());
            }
            pivot += if exists { shift } else { T::zero() };
            if pivot.is_not_a_number() {
                return false;
            }
            let inverse = T::one() / pivot.sqrt();
            lower[column][column] = inverse;
            for row in column + 1..KINDS {
                let mut sum = self.matrix[row][column];
                for k in 0..column {
                    sum -= lower[row][k] * lower[column][k];
                }
                lower[row][column] = sum * inverse;
            }
        }
        self.factor = lower;
        true
    }

    /// C^-1 v.
    fn solve(&self, mut values: [T; KINDS]) -> [T; KINDS] {
        for row in 0..KINDS {
            for k in 0..row {
                values[row] -= self.factor[row][k] * values[k];
            }
            values[row] *= self.factor[row][row];
        }
        for row in (0..KINDS).rev() {
            for k in row + 1..KINDS {
                values[row] -= self.factor[k][row] * values[k];
            }
            values[row] *= self.factor[row][row];
        }
        values
    }
}

/// sum over kinds of a_k b_k', a block.
fn outer<T: Real, const DIM: usize>(a: &[Point<T, DIM>; KINDS], b: &[Point<T, DIM>; KINDS]) -> block::Block<T, DIM> {
    let mut sum = block::Block::zeros();
    for (a, b) in a.iter().zip(b) {
        sum += a * b.transpose();
    }
    sum
}

/// One agent's system.
#[derive(Clone, Debug)]
pub(super) struct System<T, const DIM: usize, const NODES: usize> {
    pub(super) rows: [BlockRow<T, DIM>; NODES],
    factored: [BlockRow<T, DIM>; NODES],
    pub(super) local: [Local<T, DIM>; NODES],
    pub(super) columns: [Part<T, DIM, NODES>; COLUMNS],
    solved: [Part<T, DIM, NODES>; COLUMNS],
    /// Minus the gradient of the objective.
    pub(super) right: Part<T, DIM, NODES>,
    /// Gradient of the sum of ln g: what the barrier parameter multiplies.
    pub(super) centre: Part<T, DIM, NODES>,
    /// `centre`, solved.
    pub(super) pull: Part<T, DIM, NODES>,
    /// `right`, solved, and after [`Self::aim`] the step.
    pub(super) step: Part<T, DIM, NODES>,
    /// Border by border, upper left of the reduced system.
    pub(super) border: [[T; COLUMNS]; COLUMNS],
    /// Right-hand side of the border.
    pub(super) border_right: [T; COLUMNS],
    /// What the barrier parameter multiplies there.
    pub(super) border_centre: [T; COLUMNS],
    /// Which columns are in use.
    pub(super) used: [bool; COLUMNS],
    pub(super) controls: Controls,
    pub(super) intervals: usize,
}

impl<T: Real, const DIM: usize, const NODES: usize> System<T, DIM, NODES> {
    pub(super) const fn empty() -> Self {
        Self {
            rows: [BlockRow::zeros(); NODES],
            factored: [BlockRow::zeros(); NODES],
            local: [Local::zeros(); NODES],
            columns: [const { Part::zeros() }; COLUMNS],
            solved: [const { Part::zeros() }; COLUMNS],
            right: Part::zeros(),
            centre: Part::zeros(),
            pull: Part::zeros(),
            step: Part::zeros(),
            border: [[T::ZERO; COLUMNS]; COLUMNS],
            border_right: [T::ZERO; COLUMNS],
            border_centre: [T::ZERO; COLUMNS],
            used: [false; COLUMNS],
            controls: Controls::None,
            intervals: 0,
        }
    }

    /// Zeros for a number of intervals.
    pub(super) fn clear(&mut self, intervals: usize, controls: Controls, used: [bool; COLUMNS]) {
        self.intervals = intervals;
        self.controls = controls;
        self.used = used;
        self.rows.iter_mut().take(intervals).for_each(|row| *row = BlockRow::zeros());
        if controls == Controls::Some {
            self.local.iter_mut().take(intervals).for_each(|local| *local = Local::zeros());
        }
        for (column, _) in self.columns.iter_mut().zip(used).filter(|(_, used)| *used) {
            column.clear(intervals);
        }
        self.right.clear(intervals);
        self.centre.clear(intervals);
        self.border = [[T::zero(); COLUMNS]; COLUMNS];
        self.border_right = [T::zero(); COLUMNS];
        self.border_centre = [T::zero(); COLUMNS];
    }

    /// Factors with `shift` times the metric added; false if the result is not positive definite.
    #[must_use]
    pub(super) fn factor(&mut self, shift: T) -> bool {
        let interior = self.intervals.saturating_sub(1);
        let two = T::real(2.0);
        for (factored, row) in self.factored.iter_mut().zip(&self.rows).take(interior) {
            *factored = *row;
            for k in 0..DIM {
                factored.here[(k, k)] += two * shift;
                factored.one[(k, k)] -= shift;
            }
        }
        if self.controls == Controls::Some {
            for (index, local) in self.local.iter_mut().enumerate().take(self.intervals) {
                if !local.factor(shift) {
                    return false;
                }
                let solved_here = columns_solved(local, &local.here);
                let solved_before = columns_solved(local, &local.before);
                let before = index.checked_sub(1);
                if index < interior
                    && let Some(row) = self.factored.get_mut(index)
                {
                    row.here -= outer(&local.here, &solved_here);
                    row.one -= outer(&local.here, &solved_before);
                }
                if let Some(row) = before.and_then(|before| self.factored.get_mut(before)) {
                    row.here -= outer(&local.before, &solved_before);
                }
            }
        }
        block::factor(self.factored.get_mut(..interior).unwrap_or_default(), T::zero())
    }

    /// Solves for both right-hand sides and every column in use.
    pub(super) fn solve_all(&mut self) {
        let Self { factored, local, columns, solved, right, centre, pull, step, used, controls, intervals, .. } =
            self;
        let matrix = Matrix { factored, local, controls: *controls, intervals: *intervals };
        let mut columns = solved.iter_mut().zip(columns).zip(used).filter(|(_, used)| **used);
        step.assign(right, matrix.intervals);
        pull.assign(centre, matrix.intervals);
        // The pace has a column always.
        if let Some(((pace, column), _)) = columns.next() {
            pace.assign(column, matrix.intervals);
            matrix.solve([step, pull, pace]);
        }
        for ((solved, column), _) in columns {
            solved.assign(column, matrix.intervals);
            matrix.solve([solved]);
        }
    }

    /// Adds `barrier` times the step towards the centre to the step.
    pub(super) fn aim(&mut self, barrier: T) {
        for (value, part) in self.step.path.iter_mut().zip(&self.pull.path).take(self.intervals) {
            *value += part * barrier;
        }
        if self.controls == Controls::Some {
            for (values, parts) in self.step.control.iter_mut().zip(&self.pull.control).take(self.intervals) {
                for (value, &part) in values.iter_mut().zip(parts) {
                    *value += part * barrier;
                }
            }
        }
    }

    /// The reduced border: the pace's own equation, `weight * pace = right`, after this agent's part is eliminated;
    /// `None` if a worst value's pivot is not positive.
    pub(super) fn reduce(&self) -> Option<Reduced<T>> {
        let mut matrix = self.border;
        let mut right = self.border_right;
        let mut centre = self.border_centre;
        for a in 0..COLUMNS {
            if !self.used[a] {
                continue;
            }
            right[a] -= self.columns[a].dot(&self.step, self.intervals, self.controls);
            centre[a] -= self.columns[a].dot(&self.pull, self.intervals, self.controls);
            for b in 0..COLUMNS {
                if self.used[b] {
                    matrix[a][b] -= self.columns[a].dot(&self.solved[b], self.intervals, self.controls);
                }
            }
        }
        // Budgets have negative pivots, worst values positive ones; the pace is last and stays.
        for pivot_index in 1..COLUMNS {
            if !self.used[pivot_index] {
                continue;
            }
            let pivot = matrix[pivot_index][pivot_index];
            let is_budget = pivot_index < EXTREMES;
            let is_sound = if is_budget { pivot < T::zero() } else { pivot > T::zero() };
            if !is_sound {
                return None;
            }
            for row in 0..COLUMNS {
                let is_below = row == PACE || row > pivot_index;
                if !is_below || !self.used[row] {
                    continue;
                }
                let share = matrix[row][pivot_index] / pivot;
                for column in 0..COLUMNS {
                    let above = matrix[pivot_index][column];
                    matrix[row][column] -= share * above;
                }
                right[row] -= share * right[pivot_index];
                centre[row] -= share * centre[pivot_index];
            }
        }
        Some(Reduced { matrix, right, centre })
    }

    /// The border's unknowns for changes of pace, of the step and of the one towards the centre, and the agent's parts of both.
    pub(super) fn expand(&mut self, reduced: &Reduced<T>, pace: [T; 2]) -> [[T; COLUMNS]; 2] {
        let Self { solved, step, pull, used, controls, intervals, .. } = self;
        let mut both = [[T::zero(); COLUMNS]; 2];
        let sides = pace.into_iter().zip([(&reduced.right, step), (&reduced.centre, pull)]).zip(&mut both);
        for ((pace, (right, step)), unknowns) in sides {
            unknowns[PACE] = pace;
            for row in (1..COLUMNS).rev() {
                if !used[row] {
                    continue;
                }
                let mut rest = right[row] - reduced.matrix[row][PACE] * pace;
                for (&coefficient, &unknown) in reduced.matrix[row].iter().zip(unknowns.iter()).skip(row + 1) {
                    rest -= coefficient * unknown;
                }
                unknowns[row] = rest / reduced.matrix[row][row];
            }
            for (column, (&unknown, &used)) in unknowns.iter().zip(used.iter()).enumerate() {
                if !used || unknown == T::zero() {
                    continue;
                }
                let solved = &solved[column];
                for (value, part) in step.path.iter_mut().zip(&solved.path).take(*intervals) {
                    *value -= part * unknown;
                }
                if *controls == Controls::Some {
                    for (values, parts) in step.control.iter_mut().zip(&solved.control).take(*intervals) {
                        for (value, &part) in values.iter_mut().zip(parts) {
                            *value -= part * unknown;
                        }
                    }
                }
            }
        }
        both
    }

    /// Minus the gradient times the step, the shared part of the pace aside, as coefficients of 1, mu and mu squared.
    pub(super) fn work(&self, unknowns: &[[T; COLUMNS]; 2]) -> [T; 3] {
        let used = |numbers: &[T; COLUMNS]| {
            core::array::from_fn::<T, COLUMNS, _>(
                |column| if self.used[column] { numbers[column] } else { T::zero() },
            )
        };
        let mut work = [T::zero(); 3];
        for (((&right, &centre), &step), &pull) in
            used(&self.border_right).iter().zip(&used(&self.border_centre)).zip(&unknowns[0]).zip(&unknowns[1])
        {
            work.iter_mut().zip(products(&[right, centre], &[step, pull])).for_each(|(work, part)| *work += part);
        }
        let dot = |a: &Part<T, DIM, NODES>, b: &Part<T, DIM, NODES>| a.dot(b, self.intervals, self.controls);
        let [by_step, by_both, by_pull] = &mut work;
        *by_step += dot(&self.right, &self.step);
        *by_both += dot(&self.right, &self.pull) + dot(&self.centre, &self.step);
        *by_pull += dot(&self.centre, &self.pull);
        work
    }
}

/// (a_0 + a_1 mu) (b_0 + b_1 mu), as coefficients of 1, mu and mu squared.
pub(super) fn products<T: Real>([a, a_by]: &[T; 2], [b, b_by]: &[T; 2]) -> [T; 3] {
    [*a * *b, *a * *b_by + *a_by * *b, *a_by * *b_by]
}

/// The factored part of a system, on loan.
struct Matrix<'a, T, const DIM: usize> {
    factored: &'a [BlockRow<T, DIM>],
    local: &'a [Local<T, DIM>],
    controls: Controls,
    intervals: usize,
}

impl<T: Real, const DIM: usize> Matrix<'_, T, DIM> {
    /// Controls are eliminated into the path, the path is solved, and the controls follow from it.
    fn solve<const NODES: usize, const SIDES: usize>(&self, mut parts: [&mut Part<T, DIM, NODES>; SIDES]) {
        let interior = self.intervals.saturating_sub(1);
        if self.controls == Controls::Some {
            parts.iter_mut().for_each(|part| self.eliminate(part));
        }
        block::solve(self.factored, parts.each_mut().map(|part| part.path.get_mut(..interior).unwrap_or_default()));
        if self.controls == Controls::Some {
            parts.iter_mut().for_each(|part| self.follow(part));
        }
    }

    /// Takes what the controls bring from the path.
    fn eliminate<const NODES: usize>(&self, part: &mut Part<T, DIM, NODES>) {
        let interior = self.intervals.saturating_sub(1);
        let Part { path, control } = part;
        let path = path.get_mut(..interior).unwrap_or_default();
        for (index, (local, values)) in self.local.iter().zip(control.iter()).enumerate().take(self.intervals) {
            for (kind, value) in local.solve(*values).into_iter().enumerate() {
                if let Some(node) = path.get_mut(index) {
                    *node -= local.here[kind] * value;
                }
                if let Some(node) = index.checked_sub(1).and_then(|before| path.get_mut(before)) {
                    *node -= local.before[kind] * value;
                }
            }
        }
    }

    /// The controls that follow from the path.
    fn follow<const NODES: usize>(&self, part: &mut Part<T, DIM, NODES>) {
        let interior = self.intervals.saturating_sub(1);
        let Part { path, control } = part;
        let path = path.get(..interior).unwrap_or_default();
        let zero = Point::<T, DIM>::zeros();
        for (index, (local, values)) in self.local.iter().zip(control).enumerate().take(self.intervals) {
            let here = path.get(index).copied().unwrap_or(zero);
            let before = index.checked_sub(1).and_then(|before| path.get(before)).copied().unwrap_or(zero);
            for (kind, value) in values.iter_mut().enumerate() {
                *value -= local.here[kind].dot(&here) + local.before[kind].dot(&before);
            }
            *values = local.solve(*values);
        }
    }
}

/// C^-1 applied to the coupling, kind by kind.
fn columns_solved<T: Real, const DIM: usize>(
    local: &Local<T, DIM>,
    coupling: &[Point<T, DIM>; KINDS],
) -> [Point<T, DIM>; KINDS] {
    let mut solved = [Point::<T, DIM>::zeros(); KINDS];
    for component in 0..DIM {
        let values = local.solve(coupling.each_ref().map(|part| part.get(component).copied().unwrap_or(T::zero())));
        for (kind, value) in values.into_iter().enumerate() {
            solved[kind][component] = value;
        }
    }
    solved
}

/// An eliminated border.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reduced<T> {
    matrix: [[T; COLUMNS]; COLUMNS],
    right: [T; COLUMNS],
    centre: [T; COLUMNS],
}

impl<T: Real> Reduced<T> {
    /// Coefficient of the pace in its own equation.
    pub(super) fn weight(&self) -> T {
        self.matrix[PACE][PACE]
    }

    /// Right-hand side of the pace's equation.
    pub(super) fn right(&self) -> [T; 2] {
        [self.right[PACE], self.centre[PACE]]
    }
}
